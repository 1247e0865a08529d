//! `quietpath landscape`: a metric over the area, as a picture or as numbers.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use quietpath_bridge::file::ScenarioFile;
use quietpath_bridge::planning::{self, Grid, View};
use quietpath_core::scenario::Metric;

use super::load;
use crate::cli::LandscapeArgs;
use crate::illustrate;
use crate::outcome::{Failure, Stream, Verdict, say, with_progress, write_file};

/// What a landscape is written as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Format {
    Png,
    Svg,
    Csv,
}

/// Writes the landscape files.
///
/// # Errors
/// Bad input, a metric that the sensors do not give, an unknown file format, files that cannot be written.
pub fn run(args: &LandscapeArgs) -> Result<Verdict, Failure> {
    let outputs: Vec<(&PathBuf, Format)> =
        args.out.iter().map(|path| format(path).map(|format| (path, format))).collect::<Result<_, _>>()?;
    let scenario = load(&args.scenario)?;
    if args.time.is_some_and(|time| !time.is_finite()) || args.height.is_some_and(|height| !height.is_finite()) {
        return Err(Failure::input("--time and --height must be finite numbers"));
    }
    let view = View {
        time: args.time.unwrap_or(scenario.start_time),
        height: args.height,
        ..view(&scenario, args.metric.0, usize::from(args.resolution))
    };
    let grid = with_progress("computing the landscape", || planning::landscape(&scenario, &view))?;
    let picture = outputs.iter().any(|(_, format)| *format != Format::Csv);
    let picture =
        if picture { Some(illustrate::landscape(&scenario, &grid, None).map_err(Failure::input)?) } else { None };
    for (path, format) in outputs {
        let bytes = match (format, &picture) {
            (Format::Svg, Some(picture)) => picture.svg().as_bytes().to_vec(),
            (Format::Png, Some(picture)) => picture.png().map_err(Failure::input)?,
            _ => csv(&grid).into_bytes(),
        };
        if path == Path::new("-") {
            say(Stream::Out, &String::from_utf8_lossy(&bytes))?;
        } else {
            write_file(path, &bytes)?;
            say(Stream::Err, &format!("wrote {}\n", path.display()))?;
        }
    }
    Ok(Verdict::Done)
}

fn format(path: &Path) -> Result<Format, Failure> {
    let extension = path.extension().map(|extension| extension.to_ascii_lowercase());
    match extension.as_ref().and_then(|extension| extension.to_str()) {
        Some("png") => Ok(Format::Png),
        Some("svg") => Ok(Format::Svg),
        Some("csv") => Ok(Format::Csv),
        None if path == Path::new("-") => Ok(Format::Csv),
        _ => Err(Failure::Input(format!(
            "--out {}: the name says no format\n  help: end it in .png, .svg or .csv",
            path.display()
        ))),
    }
}

/// A view of the whole domain in square cells, `longer` of them along the longer side.
pub(crate) fn view(scenario: &ScenarioFile, metric: Metric, longer: usize) -> View {
    let side = |axis: usize| {
        let bound = |bounds: &[f64]| bounds.get(axis).copied().unwrap_or_default();
        bound(&scenario.domain.max) - bound(&scenario.domain.min)
    };
    let (width, height) = (side(0), side(1));
    let cells = |side: f64| ((side / width.max(height) * longer as f64).round() as usize).clamp(2, longer.max(2));
    View { metric, time: scenario.start_time, columns: cells(width), rows: cells(height), height: None }
}

/// Centres of cells and values, in the scenario's units.
fn csv(grid: &Grid) -> String {
    let mut text = String::with_capacity(32 * grid.values.len());
    let up = grid.height.map(|height| format!(",{height}")).unwrap_or_default();
    let _ = writeln!(text, "x,y,{}{}", if grid.height.is_some() { "z," } else { "" }, grid.metric.name());
    for (row, y) in grid.values.chunks(grid.east.len().max(1)).zip(&grid.north) {
        for (value, x) in row.iter().zip(&grid.east) {
            let _ = writeln!(text, "{x},{y}{up},{value}");
        }
    }
    text
}
