//! `quietpath trade`: plans over a range of deadlines or budgets, and what each buys.
//!
//! | file in `--out` | what |
//! |---|---|
//! | `trade.svg`, `.png` | objective, flight time and metrics against what was swept |
//! | `paths.svg`, `.png` | all paths over the landscape |
//! | `along.svg`, `.png` | metrics along all paths over time |
//! | `trade.csv` | figures, a plan a line, in the scenario's units |
//! | `trade.json` | figures and plans |
//!
//! Nothing is written before all plans are made, and each file appears whole or not at all: Ctrl-C leaves what was there.

use std::fmt::Write as _;
use std::path::Path;

use quietpath_bridge::file::ScenarioFile;
use quietpath_bridge::planning::{self, Options, Rollout};
use quietpath_core::scenario::Metric;

use super::{landscape, load, plan};
use crate::cli::TradeArgs;
use crate::outcome::{Failure, Stream, Verdict, progress_bar, say, with_progress, write_whole};
use crate::trade::{self, Drawn, POINTS_MAX, Range, Swept};
use crate::units::Presentation;

/// Points of a sweep where their number is not given.
const POINTS: u8 = 6;
/// Cells along the longer side of the landscape behind the paths.
const CELLS: usize = 240;

/// Sweeps a scenario.
///
/// # Errors
/// Bad input, what cannot be swept, files that cannot be written.
pub fn run(args: &TradeArgs) -> Result<Verdict, Failure> {
    let scenario = load(&args.scenario)?;
    let metrics = metrics(&scenario, plan::background(&scenario, args.metric)?);
    let cases = trade::cases(&scenario, args.over, &range(args)?)?;
    if let Some(folder) = &args.out {
        std::fs::create_dir_all(folder)
            .map_err(|cause| Failure::Input(format!("cannot make the folder {}: {cause}", folder.display())))?;
    }
    let options = Options { rollout: Rollout::Once, ..Options::default() };
    let bar = progress_bar("planning");
    let swept = trade::sweep(cases, args.over, &options, &|made, wanted| {
        bar.set_length(wanted as u64);
        bar.set_position(made as u64);
    })?;
    bar.finish_and_clear();
    let mut text = table(&swept, &metrics);
    if let Some(folder) = &args.out {
        with_progress("drawing", || write(&scenario, &swept, &metrics, folder, &mut text))?;
    }
    say(Stream::Out, &text)?;
    Ok(Verdict::on(swept.points.iter().all(|point| point.planned.assessment.feasible)))
}

fn range(args: &TradeArgs) -> Result<Range, Failure> {
    if !args.values.is_empty() {
        if args.values.len() > POINTS_MAX {
            return Err(Failure::Input(format!(
                "--values has {} entries, and may have {POINTS_MAX}",
                args.values.len()
            )));
        }
        return Ok(Range::Listed(args.values.clone()));
    }
    Ok(Range::Even { from: args.from, to: args.to, points: usize::from(args.points.unwrap_or(POINTS)) })
}

/// The metric asked for, then detection and a location error where the sensors give them.
fn metrics(scenario: &ScenarioFile, first: Metric) -> Vec<Metric> {
    let mut metrics = vec![first];
    if first != Metric::Detection && scenario.sensors.iter().any(|sensor| sensor.detection.is_some()) {
        metrics.push(Metric::Detection);
    }
    let ranging = scenario.sensors.iter().filter(|sensor| sensor.ranging.is_some()).count();
    if !first.is_location_error() && ranging > scenario.dimension {
        metrics.push(Metric::LogAee);
    }
    metrics
}

fn table(swept: &Swept, metrics: &[Metric]) -> String {
    let mut text = format!("{:>18} {:>14} {:>10} {:>16}", swept.over.words(), "objective", "time (s)", "status");
    let shown = metrics.first().copied().unwrap_or(Metric::Detection);
    for agent in swept.points.first().map(|point| point.figures(&[])).unwrap_or_default() {
        for word in ["mean", if shown == Metric::Detection { "peak" } else { "smallest" }] {
            let _ = write!(text, "  {:>20}", format!("{} {word}", agent.name));
        }
    }
    let scenario = swept.points.first().map(|point| &point.case.scenario);
    let presentation = scenario.map(|it| Presentation::of(shown, it.dimension, it.frame.unit_m));
    let label = presentation.map(|it| it.label()).unwrap_or_default();
    let _ = writeln!(text, "   [{label}]");
    for point in &swept.points {
        let status = if point.planned.assessment.feasible { point.planned.status.name() } else { "infeasible" };
        let _ = write!(
            text,
            "{:>18} {:>14.6} {:>10.2} {:>16}",
            point.case.label(swept.over),
            point.planned.assessment.objective,
            point.planned.plan.duration,
            status.replace('_', " ")
        );
        for figures in point.figures(&[shown]).iter().flat_map(|agent| &agent.metrics) {
            for value in [figures.mean, figures.worst] {
                let _ = write!(text, "  {:>20.4}", presentation.map_or(value, |it| it.convert(value)));
            }
        }
        text.push('\n');
    }
    text.push_str(&obstacles(swept));
    text
}

/// Why plans are not feasible, each reason once, with the cases that it stops.
fn obstacles(swept: &Swept) -> String {
    let mut reasons: Vec<(String, Vec<String>, &'static str)> = Vec::new();
    for point in &swept.points {
        let Some(obstacle) = &point.planned.obstacle else { continue };
        let (found, label) = (obstacle.describe(&point.case.scenario), point.case.label(swept.over));
        match reasons.iter_mut().find(|(reason, ..)| *reason == found) {
            Some((_, labels, _)) => labels.push(label),
            None => reasons.push((found, vec![label], obstacle.remedy())),
        }
    }
    let mut text = String::new();
    for (found, labels, help) in reasons {
        let _ = writeln!(text, "\nno feasible plan at {}: {found}\n  help: {help}", labels.join(", "));
    }
    text
}

fn write(
    scenario: &ScenarioFile,
    swept: &Swept,
    metrics: &[Metric],
    folder: &Path,
    text: &mut String,
) -> Result<(), Failure> {
    let behind = metrics.first().copied().unwrap_or(Metric::Detection);
    let grid = planning::landscape(scenario, &landscape::view(scenario, behind, CELLS))?;
    let Drawn { trade, paths, along } = trade::draw(swept, metrics, &grid).map_err(Failure::input)?;
    let mut files = vec![
        ("trade.csv".to_owned(), trade::to_csv(swept, metrics).into_bytes()),
        ("trade.json".to_owned(), trade::to_json(swept, metrics).map_err(Failure::input)?.into_bytes()),
    ];
    for (name, picture) in [("trade", trade), ("paths", paths), ("along", along)] {
        files.push((format!("{name}.png"), picture.png().map_err(Failure::input)?));
        files.push((format!("{name}.svg"), picture.svg().as_bytes().to_vec()));
    }
    text.push('\n');
    for (name, bytes) in files {
        let path = folder.join(name);
        write_whole(&path, &bytes)?;
        let _ = writeln!(text, "  {}", path.display());
    }
    Ok(())
}
