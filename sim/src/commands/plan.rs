//! `quietpath plan`: from a scenario to a plan, a summary, pictures and mission files.
//!
//! | file in `--out` | what |
//! |---|---|
//! | `plan.json` | the plan |
//! | `report.html` | all of it as one page that moves |
//! | `landscape.svg`, `.png` | a metric over the area, the flight on it |
//! | `series.svg`, `.png` | every figure along the flight |
//! | `mission.plan`, `mission.waypoints` | for ground stations, one an agent; with latitude and longitude only |
//! | `path.geojson` | for maps; with latitude and longitude only |
//!
//! A scenario with `[rolling]` is planned in steps; all files above are then those of the plan that was flown, and beside
//! them stands what [`super::steps`] writes. With `--once` it is planned in one piece.
//!
//! A plan that is not feasible is drawn and written for people to look at, but not as a mission or map.

use std::fmt::Write as _;
use std::path::Path;

use quietpath_bridge::file::mission::{file_name, missions};
use quietpath_bridge::file::{PlanFile, ScenarioFile, geojson};
use quietpath_bridge::planning::{self, Assessment, Obstacle, Options, Planned, Precision, Rollout, Step};
use quietpath_core::scenario::Metric;

use super::{landscape, load, steps};
use crate::cli::{MetricArg, PlanArgs, PrecisionArg};
use crate::illustrate::{self, Flown};
use crate::outcome::{Failure, Stream, Verdict, say, with_progress, write_file};
use crate::page::{self, Story, Way};
use crate::report;

/// Cells along the longer side of the landscape behind a flight.
const CELLS: usize = 240;

/// Plans a scenario file.
///
/// # Errors
/// Bad input, files that cannot be written.
pub fn run(args: &PlanArgs) -> Result<Verdict, Failure> {
    let scenario = load(&args.scenario)?;
    carry_out(&scenario, args)
}

fn carry_out(scenario: &ScenarioFile, args: &PlanArgs) -> Result<Verdict, Failure> {
    // Before the planning, so that a folder that cannot be written costs no time.
    if let Some(folder) = &args.out {
        std::fs::create_dir_all(folder)
            .map_err(|cause| Failure::Input(format!("cannot make the folder {}: {cause}", folder.display())))?;
    }
    let metric = background(scenario, args.metric)?;
    let made = make(scenario, args)?;
    let json_to_stdout = args.plan.as_deref() == Some(Path::new("-"));
    let summary_to = if json_to_stdout { Stream::Err } else { Stream::Out };
    match &args.plan {
        Some(_) if json_to_stdout => say(Stream::Out, &made.plan.to_json())?,
        Some(file) => write_file(file, made.plan.to_json().as_bytes())?,
        None => {}
    }
    let mut text = report::summary(scenario, &made.plan, &made.assessment);
    text.push_str(&report::steps(&made.steps));
    if let Some(obstacle) = &made.obstacle {
        text.push_str(&report::obstacle(scenario, obstacle));
    }
    if let Some(folder) = &args.out {
        let settings = settings(scenario, args);
        let written = with_progress("drawing", || write_folder(scenario, &made, metric, &settings, folder))?;
        text.push_str(&list(folder, &written));
    }
    say(summary_to, &text)?;
    Ok(Verdict::on(made.assessment.feasible))
}

/// A plan, made in one piece or in steps.
struct Made {
    plan: PlanFile,
    assessment: Assessment,
    obstacle: Option<Obstacle>,
    /// None where it was made in one piece.
    steps: Vec<Step>,
}

fn make(scenario: &ScenarioFile, args: &PlanArgs) -> Result<Made, Failure> {
    if scenario.rolling.is_some() && !args.once {
        let rolled = steps::roll(scenario, &options(args))?;
        let obstacle = rolled.obstacle().cloned();
        return Ok(Made { plan: rolled.plan, assessment: rolled.assessment, obstacle, steps: rolled.steps });
    }
    let planned = with_progress("planning", || planning::plan(scenario, &options(args)))?;
    let Planned { plan, assessment, obstacle, .. } = planned;
    Ok(Made { plan, assessment, obstacle, steps: Vec::new() })
}

fn options(args: &PlanArgs) -> Options {
    let precision = match args.precision {
        PrecisionArg::F32 => Precision::F32,
        PrecisionArg::F64 => Precision::F64,
    };
    let rollout = if args.once { Rollout::Once } else { Rollout::AsWritten };
    Options { precision, rollout, ..Options::default() }
}

/// What a report says of how the plan was made.
fn settings(scenario: &ScenarioFile, args: &PlanArgs) -> Vec<(String, String)> {
    let precision = match args.precision {
        PrecisionArg::F32 => "32 bits",
        PrecisionArg::F64 => "64 bits",
    };
    let in_steps = scenario.rolling.is_some() && !args.once;
    let pieces = if in_steps { "steps, as the scenario says" } else { "one piece, every track known" };
    let row = |name: &str, value: &str| (name.to_owned(), value.to_owned());
    vec![row("computed with", precision), row("planned in", pieces)]
}

/// The metric behind the flight: asked for, or that of the first term of the objective.
pub(super) fn background(scenario: &ScenarioFile, asked: Option<MetricArg>) -> Result<Metric, Failure> {
    let first = scenario.terms.first().map_or(Metric::Detection, |term| term.metric);
    let metric = asked.map_or(first, |asked| asked.0);
    let ranging = scenario.sensors.iter().filter(|sensor| sensor.ranging.is_some()).count();
    if metric.is_location_error() && ranging <= scenario.dimension {
        return Err(Failure::Input(format!(
            "--metric {} needs at least {} sensors with `ranging`, and the scenario has {ranging}",
            metric.name(),
            scenario.dimension + 1
        )));
    }
    Ok(metric)
}

/// What was written into a folder, and what was not and why.
struct Written {
    files: Vec<String>,
    skipped: Option<String>,
}

fn write_folder(
    scenario: &ScenarioFile,
    made: &Made,
    metric: Metric,
    settings: &[(String, String)],
    folder: &Path,
) -> Result<Written, Failure> {
    let flown = Flown { plan: &made.plan, assessment: &made.assessment, steps: &made.steps };
    let mut files = Vec::new();
    let mut put = |name: String, bytes: &[u8]| -> Result<(), Failure> {
        write_file(&folder.join(&name), bytes)?;
        files.push(name);
        Ok(())
    };
    put("plan.json".into(), flown.plan.to_json().as_bytes())?;
    let (plan, assessment, background) = (flown.plan, flown.assessment, metric);
    let steps: Vec<PlanFile> = made.steps.iter().map(|step| step.plan.clone()).collect();
    let way = Way::Planned;
    let story = Story { plan, way, assessment, steps: &steps, wire: &[], background, settings };
    put("report.html".into(), page::html(scenario, &story)?.as_bytes())?;
    let grid = planning::landscape(scenario, &landscape::view(scenario, metric, CELLS))?;
    let pictures = [
        ("landscape", illustrate::landscape(scenario, &grid, Some(flown.plan)).map_err(Failure::input)?),
        ("series", illustrate::series(scenario, flown)),
    ];
    for (name, picture) in &pictures {
        put(format!("{name}.png"), &picture.png().map_err(Failure::input)?)?;
        put(format!("{name}.svg"), picture.svg().as_bytes())?;
    }
    let mut skipped = None;
    if !flown.assessment.feasible {
        skipped = Some("no mission files: the plan is not feasible".into());
    } else if scenario.frame.origin.is_none() {
        skipped = Some("no mission files: the scenario has no frame.latitude_deg and frame.longitude_deg".into());
    } else {
        put("path.geojson".into(), geojson::to_geojson(scenario, flown.plan)?.as_bytes())?;
        match missions(scenario, flown.plan) {
            Ok(missions) => {
                for mission in &missions {
                    let name = |extension| file_name(&mission.agent, missions.len(), extension);
                    put(name("plan"), mission.to_qgc_plan().as_bytes())?;
                    put(name("waypoints"), mission.to_waypoints().as_bytes())?;
                }
            }
            Err(cause) => skipped = Some(format!("no mission files: {cause}")),
        }
    }
    if !made.steps.is_empty() {
        files.extend(steps::write(scenario, flown, metric, folder)?);
    }
    Ok(Written { files, skipped })
}

fn list(folder: &Path, written: &Written) -> String {
    let mut text = String::new();
    let pictures = |name: &&String| {
        Path::new(name.as_str()).extension().is_some_and(|extension| extension == "png" || extension == "svg")
    };
    for (title, wanted) in [("pictures", true), ("other files", false)] {
        let _ = writeln!(text, "\n{title}");
        for name in written.files.iter().filter(|name| pictures(name) == wanted) {
            let _ = writeln!(text, "  {}", folder.join(name).display());
        }
    }
    if let Some(reason) = &written.skipped {
        let _ = writeln!(text, "\nnote: {reason}");
    }
    text
}
