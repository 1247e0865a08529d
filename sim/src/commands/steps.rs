//! Planning in steps, with a bar that shows how far the flight is, and the files that tell of each step.
//!
//! | file in `--out` | what |
//! |---|---|
//! | `steps.svg`, `.png` | the plans of all steps, and the path that was flown |
//! | `steps/steps.csv` | what each step did, a step a line |
//! | `steps/step-01.json`, .. | the plan of each step, from where it begins to the goal |
//! | `steps/step-01.png`, .. | the same as a picture, over the metric at the time of the step |

use std::fmt::Write as _;
use std::path::Path;

use quietpath_bridge::file::ScenarioFile;
use quietpath_bridge::planning::{self, Options, Rolled, Step, View};
use quietpath_core::scenario::Metric;

use super::landscape;
use crate::illustrate::{self, Flown};
use crate::outcome::{Failure, progress_bar, write_file};
use crate::report;

/// Cells along the longer side of landscapes.
const CELLS: usize = 200;
/// Pixels of the pictures of single steps for each unit of the drawing.
const PIXELS_PER_UNIT: f32 = 0.8;

/// Plans a scenario in steps.
///
/// # Errors
/// Bad input.
pub fn roll(scenario: &ScenarioFile, options: &Options) -> Result<Rolled, Failure> {
    let bar = progress_bar("planning step 1");
    bar.set_length(scenario.intervals as u64);
    let mut number = 1;
    let rolled = planning::roll(scenario, options, &mut |step: &Step| {
        number += 1;
        bar.set_position((step.node + step.intervals) as u64);
        bar.set_message(format!("planning step {number}, after {:.0} s", step.end()));
    });
    bar.finish_and_clear();
    Ok(rolled?)
}

/// Writes the files of the steps; their names.
///
/// # Errors
/// Files that cannot be written.
pub fn write(
    scenario: &ScenarioFile,
    flown: Flown<'_>,
    metric: Metric,
    folder: &Path,
) -> Result<Vec<String>, Failure> {
    let steps = folder.join("steps");
    std::fs::create_dir_all(&steps)
        .map_err(|cause| Failure::Input(format!("cannot make the folder {}: {cause}", steps.display())))?;
    let mut files = Vec::new();
    let mut put = |name: String, bytes: &[u8]| -> Result<(), Failure> {
        write_file(&folder.join(&name), bytes)?;
        files.push(name);
        Ok(())
    };
    let view = landscape::view(scenario, metric, CELLS);
    let grid = planning::landscape(scenario, &view)?;
    let all = illustrate::steps::all(scenario, &grid, flown).map_err(Failure::input)?;
    put("steps.png".into(), &all.png().map_err(Failure::input)?)?;
    put("steps.svg".into(), all.svg().as_bytes())?;
    put("steps/steps.csv".into(), csv(flown.steps).as_bytes())?;
    for (index, step) in flown.steps.iter().enumerate() {
        let stem = format!("steps/step-{:02}", index + 1);
        put(format!("{stem}.json"), step.plan.to_json().as_bytes())?;
        let grid = planning::landscape(scenario, &View { time: step.time(), ..view })?;
        let picture = illustrate::steps::step(scenario, &grid, flown, index).map_err(Failure::input)?;
        put(format!("{stem}.png"), &picture.small_png_at(PIXELS_PER_UNIT).map_err(Failure::input)?)?;
    }
    Ok(files)
}

/// What each step did, in the scenario's units.
fn csv(steps: &[Step]) -> String {
    let mut text =
        "step,time,node,intervals,plan,status,objective,feasible,change,evaluations,plan_seconds\n".to_owned();
    for (index, step) in steps.iter().enumerate() {
        let objective = step.plan.objective.map(|value| value.to_string()).unwrap_or_default();
        let _ = writeln!(
            text,
            "{},{},{},{},{},{},{objective},{},{},{},{}",
            index + 1,
            step.time(),
            step.node,
            step.intervals,
            report::choice(step.choice),
            step.status.name(),
            step.feasible,
            step.change,
            step.evaluations,
            step.plan_seconds(),
        );
    }
    text
}
