//! How figures are made: plans, their pictures, and tables of what they are worth.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use quietpath_bridge::file::ScenarioFile;
use quietpath_bridge::planning::{self, Options, Planned, Rollout, View};
use quietpath_core::horizon::Cadence;
use quietpath_core::scenario::{Metric, Pooling};
use quietpath_sim::illustrate::{self, Flown};
use quietpath_sim::picture::Picture;
use quietpath_sim::report;
use quietpath_sim::trade::{self, Case, Over, Point, Range};
use quietpath_sim::units::{self, Presentation};

use super::{Outcome, Plate};

/// Pixels of the pictures for each unit of the drawing.
const PIXELS_PER_UNIT: f32 = 0.7;
/// Cells along the longer side of landscapes.
const CELLS: f64 = 200.0;

/// Where a figure's pictures and rows go.
pub struct Wall<'a> {
    page: &'a mut String,
    stem: String,
}

impl<'a> Wall<'a> {
    /// The wall of figure `number` of the page.
    pub fn new(page: &'a mut String, number: usize) -> Self {
        Self { page, stem: format!("{number:02}") }
    }

    /// Makes a figure.
    pub fn hang(&mut self, plate: &Plate) -> Outcome<()> {
        match plate {
            Plate::Landscapes(views) => {
                for (name, metric) in *views {
                    let scenario = scenario(name)?;
                    let grid = field(&scenario, *metric, scenario.start_time)?;
                    let picture = illustrate::landscape(&scenario, &grid, None)?;
                    self.picture(&format!("{name}-{}", metric.name()), &picture)?;
                }
            }
            Plate::Plans(names) | Plate::Flights(names) => {
                let mut rows = Vec::new();
                for name in *names {
                    let point = once(scenario(name)?)?;
                    self.plan(&point)?;
                    if matches!(plate, Plate::Flights(_)) {
                        self.picture(
                            &format!("{name}-series"),
                            &illustrate::series(&point.case.scenario, flown(&point)),
                        )?;
                    }
                    rows.push(((*name).to_owned(), point));
                }
                self.table("plan", &rows);
            }
            Plate::Sweep(name, over, amounts) => {
                let scenario = scenario(name)?;
                let cases = trade::cases(&scenario, *over, &Range::Listed(amounts.to_vec()))?;
                let options = Options { rollout: Rollout::Once, ..Options::default() };
                let swept = trade::sweep(cases, *over, &options, &|_, _| ())?;
                let metric = first_metric(&scenario);
                let drawn = trade::draw(&swept, &[metric], &field(&scenario, metric, scenario.start_time)?)?;
                for (what, picture) in [("paths", drawn.paths), ("along", drawn.along), ("trade", drawn.trade)] {
                    self.picture(&format!("{name}-{what}"), &picture)?;
                }
                let rows: Vec<_> = swept.points.into_iter().map(|point| (point.case.label(*over), point)).collect();
                self.table(Over::words(*over), &rows);
            }
            Plate::Steps(name, cadence, shown) => self.steps(name, *cadence, shown)?,
            Plate::Pools(name) => self.pools(name)?,
        }
        Ok(())
    }

    /// A flight in steps: some of them, all of them, and what was met on the way.
    fn steps(&mut self, name: &str, cadence: Option<Cadence<f64>>, shown: &[usize]) -> Outcome<()> {
        let mut scenario = scenario(name)?;
        if let (Some(cadence), Some(rolling)) = (cadence, scenario.rolling.as_mut()) {
            rolling.cadence = cadence;
        }
        let rolled = planning::roll(&scenario, &Options::default(), &mut |_| ())?;
        let flown = Flown { plan: &rolled.plan, assessment: &rolled.assessment, steps: &rolled.steps };
        let metric = first_metric(&scenario);
        for number in shown {
            let index = number - 1;
            let Some(step) = rolled.steps.get(index) else { continue };
            let grid = field(&scenario, metric, step.time())?;
            let picture = illustrate::steps::step(&scenario, &grid, flown, index)?;
            self.picture(&format!("{name}-step-{number:02}"), &picture)?;
        }
        let grid = field(&scenario, metric, scenario.start_time)?;
        self.picture(&format!("{name}-steps"), &illustrate::steps::all(&scenario, &grid, flown)?)?;
        self.picture(&format!("{name}-flown"), &illustrate::series(&scenario, flown))?;
        self.list(&rolled.steps);
        let known = once(scenario.clone())?;
        let label = format!("flown in {} steps", rolled.steps.len());
        let point = Point { case: Case { seconds: 0.0, share: 0.0, scenario }, planned: Planned::from(rolled) };
        self.table("plan", &[(label, point), ("in one piece, every track known".to_owned(), known)]);
        Ok(())
    }

    /// The same detectors, by themselves and pooled in both ways.
    fn pools(&mut self, name: &str) -> Outcome<()> {
        let pooled = scenario(name)?;
        let Pooling::Correlated { log_threshold, .. } = pooled.pooling else {
            return Err(format!("{name} has no correlated signals").into());
        };
        let mut rows = Vec::new();
        for (label, pooling) in [
            ("each for itself", Pooling::None),
            ("pooled, uncorrelated", Pooling::Uncorrelated { log_threshold }),
            ("pooled, correlated", pooled.pooling),
        ] {
            let mut variant = pooled.clone();
            (variant.pooling, variant.name) = (pooling, format!("{name} ({label})"));
            let point = once(variant)?;
            let file = format!("{name}-{}", label.replace(", ", "-").replace(' ', "-"));
            self.landscape(&file, &point)?;
            rows.push((label.to_owned(), point));
        }
        self.table("sensors", &rows);
        Ok(())
    }

    fn plan(&mut self, point: &Point) -> Outcome<()> {
        self.landscape(&point.case.scenario.name.clone(), point)
    }

    /// A plan over the metric that it optimises.
    fn landscape(&mut self, name: &str, point: &Point) -> Outcome<()> {
        let scenario = &point.case.scenario;
        let grid = field(scenario, first_metric(scenario), scenario.start_time)?;
        self.picture(name, &illustrate::landscape(scenario, &grid, Some(&point.planned.plan))?)
    }

    fn picture(&mut self, name: &str, picture: &Picture) -> Outcome<()> {
        let file = format!("gallery/{}-{}.png", self.stem, name.replace('_', "-"));
        fs::write(Path::new("docs").join(&file), picture.small_png_at(PIXELS_PER_UNIT)?)?;
        let _ = writeln!(self.page, "![{name}]({file})");
        Ok(())
    }

    /// What each step did.
    fn list(&mut self, steps: &[planning::Step]) {
        self.page.push_str(
            "\n| step | begins | intervals flown | plan | status | objective ahead | feasible | change seen |\n\
             |---|---|---|---|---|---|---|---|\n",
        );
        for (index, step) in steps.iter().enumerate() {
            let _ = writeln!(
                self.page,
                "| {} | {:.1} s | {} | {} | {} | {:.3} | {} | {:.4} |",
                index + 1,
                step.time(),
                step.intervals,
                report::choice(step.choice),
                step.status.name().replace('_', " "),
                step.plan.objective.unwrap_or(f64::NAN),
                if step.feasible { "yes" } else { "no" },
                step.change,
            );
        }
    }

    /// A row an agent of every plan.
    fn table(&mut self, named: &str, rows: &[(String, Point)]) {
        let Some((_, first)) = rows.first() else { return };
        let scenario = &first.case.scenario;
        let aee = Presentation::of(Metric::LogAee, scenario.dimension, scenario.frame.unit_m);
        let _ = writeln!(
            self.page,
            "\n| {named} | agent | objective | flight time | status | mean detection | peak detection | mean {} | jamming | dropout |\n\
             |---|---|---|---|---|---|---|---|---|---|",
            aee.label()
        );
        for (label, point) in rows {
            let status = if point.planned.assessment.feasible { point.planned.status.name() } else { "infeasible" };
            for agent in point.figures(&[Metric::Detection, Metric::LogAee]) {
                let find = |metric: Metric| agent.metrics.iter().find(|figures| figures.metric == metric.name());
                let shown = |value: Option<f64>, digits: usize| {
                    value.map_or_else(|| "-".to_owned(), |value| format!("{value:.digits$}"))
                };
                let detection = find(Metric::Detection);
                let error = find(Metric::LogAee).map(|figures| aee.convert(figures.mean));
                let spent = |seconds: Option<f64>| seconds.map_or_else(|| "-".to_owned(), |it| format!("{it:.2} s"));
                let _ = writeln!(
                    self.page,
                    "| {label} | {} | {:.6} | {} | {} | {} | {} | {} | {} | {} |",
                    agent.name,
                    point.planned.assessment.objective,
                    units::duration(point.planned.plan.duration),
                    status.replace('_', " "),
                    shown(detection.map(|figures| figures.mean), 4),
                    shown(detection.map(|figures| figures.worst), 4),
                    shown(error, 3),
                    spent(agent.jam_spent),
                    spent(agent.dropout_spent),
                );
            }
        }
    }
}

fn flown(point: &Point) -> Flown<'_> {
    Flown { plan: &point.planned.plan, assessment: &point.planned.assessment, steps: &[] }
}

/// A plan in one piece, every track known.
fn once(scenario: ScenarioFile) -> Outcome<Point> {
    let planned = planning::plan(&scenario, &Options { rollout: Rollout::Once, ..Options::default() })?;
    Ok(Point { case: Case { seconds: 0.0, share: 0.0, scenario }, planned })
}

/// A scenario of the program, or of the gallery alone.
fn scenario(name: &str) -> Outcome<ScenarioFile> {
    let own = format!("sim/examples/gallery/{name}.toml");
    let file = if Path::new(&own).exists() { own } else { format!("sim/scenarios/{name}.toml") };
    Ok(ScenarioFile::read(&file)?.scenario)
}

fn first_metric(scenario: &ScenarioFile) -> Metric {
    scenario.terms.first().map_or(Metric::Detection, |term| term.metric)
}

/// A metric over the whole domain at a time, in square cells.
fn field(scenario: &ScenarioFile, metric: Metric, time: f64) -> Outcome<planning::Grid> {
    let side = |axis: usize| {
        let ends = scenario.domain.min.get(axis).zip(scenario.domain.max.get(axis));
        ends.map_or(1.0, |(low, high)| high - low)
    };
    let longer = side(0).max(side(1));
    let cells = |axis| (side(axis) / longer * CELLS).round().max(2.0) as usize;
    let view = View { metric, time, columns: cells(0), rows: cells(1), height: None };
    Ok(planning::landscape(scenario, &view)?)
}
