//! The gallery: every figure of section 4 of the paper, planned and drawn anew.
//!
//! `cargo xtask gallery` runs this from the top of the repository. It writes `docs/gallery.md` and `docs/gallery/*.png`; all
//! numbers on the page are figures of the plans that are drawn.

use std::error::Error;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use quietpath_bridge::file::ScenarioFile;
use quietpath_bridge::planning::{self, Options, Rollout, View};
use quietpath_core::scenario::Metric;
use quietpath_sim::illustrate::{self, Flown};
use quietpath_sim::picture::Picture;
use quietpath_sim::trade::{self, Amount, Case, Over, Point, Range};
use quietpath_sim::units::{self, Presentation};

/// Pixels of the pictures for each unit of the drawing.
const PIXELS_PER_UNIT: f32 = 0.62;
/// Cells along the longer side of landscapes.
const CELLS: f64 = 200.0;

type Outcome<T> = Result<T, Box<dyn Error>>;

/// What a figure is made of.
enum Plate {
    /// Landscapes of metrics, each of a scenario.
    Landscapes(&'static [(&'static str, Metric)]),
    /// Plans in one piece, over the metric that they optimise.
    Plans(&'static [&'static str]),
    /// Plans in one piece with all their figures over time.
    Flights(&'static [&'static str]),
    /// A sweep.
    Sweep(&'static str, Over, &'static [Amount]),
}

/// A figure of the paper.
struct Figure {
    number: &'static str,
    title: &'static str,
    text: &'static str,
    plate: Plate,
}

const FIGURES: &[Figure] = &[
    Figure {
        number: "Fig. 2",
        title: "Landscapes",
        text: "Six metrics over the same eight sensors: probability of detection by proxy and by energy detector, \
               probability of false alarms, and the logarithms of CEP, AEE and GDOP. Yellow is high, blue is low.",
        plate: Plate::Landscapes(&[
            ("square8-detection", Metric::Detection),
            ("square8-energy", Metric::Detection),
            ("square8-false-alarm", Metric::FalseAlarm),
            ("square8-cep", Metric::LogCep),
            ("square8-aee", Metric::LogAee),
            ("square8-gdop", Metric::LogGdop),
        ]),
    },
    Figure {
        number: "Fig. 3",
        title: "One objective each",
        text: "Least probability of detection keeps away from sensors; largest CEP, AEE and GDOP hug them.",
        plate: Plate::Plans(&["square8-detection", "square8-cep", "square8-aee", "square8-gdop"]),
    },
    Figure {
        number: "Fig. 4",
        title: "Deadlines",
        text: "Target times of 100, 105, 110 and 115 % of the shortest flight time: with more time, less detection.",
        plate: Plate::Sweep(
            "square8-deadline-105",
            Over::Deadline,
            &[Amount::Share(1.0), Amount::Share(1.05), Amount::Share(1.1), Amount::Share(1.15)],
        ),
    },
    Figure {
        number: "Fig. 5 (one agent)",
        title: "Jamming",
        text: "The largest location error with more and more jamming: levels, dashed, are highest where the error is low.",
        plate: Plate::Sweep(
            "square8-jam",
            Over::JamBudget,
            &[Amount::Seconds(0.0), Amount::Seconds(15.0), Amount::Seconds(30.0), Amount::Seconds(60.0)],
        ),
    },
    Figure {
        number: "Fig. 5 (two agents)",
        title: "A helper that jams",
        text: "Two agents start together; the second jams for both.",
        plate: Plate::Flights(&["square8-team"]),
    },
    Figure {
        number: "Fig. 6",
        title: "Intermittent communication",
        text: "Dropout budgets of 0, 17 and 35 % of the flight. Silent stretches have a white core.",
        plate: Plate::Sweep(
            "dropout4-35",
            Over::DropoutBudget,
            &[Amount::Share(0.0), Amount::Share(0.17), Amount::Share(0.35)],
        ),
    },
    Figure {
        number: "Fig. 7",
        title: "The Isle of Wight",
        text: "Sensors, one of them moving, and forbidden circles: AEE and probability of detection at the start.",
        plate: Plate::Landscapes(&[("wight", Metric::LogAee), ("wight", Metric::Detection)]),
    },
    Figure {
        number: "Figs. 8 and 9",
        title: "Isle of Wight without jamming",
        text: "Planned in one piece, every track known.",
        plate: Plate::Flights(&["wight"]),
    },
    Figure {
        number: "Figs. 10 and 11",
        title: "Isle of Wight with jamming",
        text: "Planned in one piece, every track known.",
        plate: Plate::Flights(&["wight-jam"]),
    },
];

fn main() -> Outcome<()> {
    let mut page = String::from(
        "# Gallery\n\nEvery figure of section 4 of the paper, planned and drawn by this program. `cargo xtask gallery` \
         makes this page\nand its pictures anew: no number on it is typed by hand.\n",
    );
    fs::create_dir_all("docs/gallery")?;
    for (index, figure) in FIGURES.iter().enumerate() {
        println!("{}: {}", figure.number, figure.title);
        let _ = write!(page, "\n## {}\n\n{} of the paper. {}\n\n", figure.title, figure.number, figure.text);
        let mut wall = Wall { page: &mut page, stem: format!("{:02}", index + 1) };
        wall.hang(&figure.plate)?;
    }
    fs::write("docs/gallery.md", page)?;
    Ok(())
}

/// Where a figure's pictures and rows go.
struct Wall<'a> {
    page: &'a mut String,
    stem: String,
}

impl Wall<'_> {
    fn hang(&mut self, plate: &Plate) -> Outcome<()> {
        match plate {
            Plate::Landscapes(views) => {
                for (name, metric) in *views {
                    let scenario = scenario(name)?;
                    let picture = illustrate::landscape(&scenario, &field(&scenario, *metric)?, None)?;
                    self.picture(&format!("{name}-{}", metric.name()), &picture)?;
                }
            }
            Plate::Plans(names) => {
                let points = self.plans(names, Series::Without)?;
                self.table(None, &points);
            }
            Plate::Flights(names) => {
                let points = self.plans(names, Series::With)?;
                self.table(None, &points);
            }
            Plate::Sweep(name, over, amounts) => {
                let scenario = scenario(name)?;
                let cases = trade::cases(&scenario, *over, &Range::Listed(amounts.to_vec()))?;
                let swept = trade::sweep(cases, *over, &once(), &|_, _| ())?;
                let metric = first_metric(&scenario);
                let drawn = trade::draw(&swept, &[metric], &field(&scenario, metric)?)?;
                for (what, picture) in [("paths", drawn.paths), ("along", drawn.along), ("trade", drawn.trade)] {
                    self.picture(&format!("{name}-{what}"), &picture)?;
                }
                self.table(Some(*over), &swept.points);
            }
        }
        Ok(())
    }

    /// Plans scenarios in one piece and hangs what comes out; says so on the page where one is not planned.
    fn plans(&mut self, names: &[&str], series: Series) -> Outcome<Vec<Point>> {
        let mut points = Vec::new();
        for name in names {
            let scenario = scenario(name)?;
            let planned = match planning::plan(&scenario, &once()) {
                Ok(planned) => planned,
                Err(error) => {
                    let _ = writeln!(self.page, "`{name}` is not planned by this version:\n\n```text\n{error}\n```");
                    continue;
                }
            };
            let grid = field(&scenario, first_metric(&scenario))?;
            self.picture(name, &illustrate::landscape(&scenario, &grid, Some(&planned.plan))?)?;
            if series == Series::With {
                let flown = Flown { plan: &planned.plan, assessment: &planned.assessment };
                self.picture(&format!("{name}-series"), &illustrate::series(&scenario, flown))?;
            }
            points.push(Point { case: Case { seconds: 0.0, share: 0.0, scenario }, planned });
        }
        Ok(points)
    }

    fn picture(&mut self, name: &str, picture: &Picture) -> Outcome<()> {
        let file = format!("gallery/{}-{}.png", self.stem, name.replace('_', "-"));
        fs::write(Path::new("docs").join(&file), picture.png_at(PIXELS_PER_UNIT)?)?;
        let _ = writeln!(self.page, "![{name}]({file})");
        Ok(())
    }

    /// A row an agent of every plan.
    fn table(&mut self, over: Option<Over>, points: &[Point]) {
        let Some(first) = points.first() else { return };
        let scenario = &first.case.scenario;
        let aee = Presentation::of(Metric::LogAee, scenario.dimension, scenario.frame.unit_m);
        let named = over.map_or("plan", Over::words);
        let _ = writeln!(
            self.page,
            "\n| {named} | agent | objective | flight time | status | mean detection | peak detection | mean {} | jamming | dropout |\n\
             |---|---|---|---|---|---|---|---|---|---|",
            aee.label()
        );
        for point in points {
            let label = over.map_or_else(|| point.case.scenario.name.clone(), |over| point.case.label(over));
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

/// Whether plans come with their figures over time.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Series {
    With,
    Without,
}

fn once() -> Options {
    Options { rollout: Rollout::Once, ..Options::default() }
}

fn scenario(name: &str) -> Outcome<ScenarioFile> {
    Ok(ScenarioFile::read(&format!("sim/scenarios/{name}.toml"))?.scenario)
}

fn first_metric(scenario: &ScenarioFile) -> Metric {
    scenario.terms.first().map_or(Metric::Detection, |term| term.metric)
}

/// A metric over the whole domain at the start, in square cells.
fn field(scenario: &ScenarioFile, metric: Metric) -> Outcome<planning::Grid> {
    let side = |axis: usize| {
        let ends = scenario.domain.min.get(axis).zip(scenario.domain.max.get(axis));
        ends.map_or(1.0, |(low, high)| high - low)
    };
    let longer = side(0).max(side(1));
    let cells = |axis| (side(axis) / longer * CELLS).round().max(2.0) as usize;
    let view = View { metric, time: scenario.start_time, columns: cells(0), rows: cells(1), height: None };
    Ok(planning::landscape(scenario, &view)?)
}
