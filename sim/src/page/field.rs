//! Landscapes for the page: every metric that the sensors give, packed as text.
//!
//! A cell is two letters of the base64 alphabet, twelve bits: its share of the colour scale, from 0 at the smallest
//! value shown to [`TOP`] at the largest; [`NOTHING`] where there is no value. Rows go from south to north. The scale is
//! that of the pictures ([`Scale::of_values`]), one for all instants, so that colours keep their meaning while
//! sensors move.
//!
//! | symbol | name | unit |
//! |---|---|---|
//! | `columns`, `rows` | cells from west to east, from south to north | |
//! | `times` | instants of the frames | s |
//!
//! Limits: values beyond the scale are told as its ends; between them they are rounded to 1/[`TOP`] of the scale.

use quietpath_bridge::file::scenario::MotionEntry;
use quietpath_bridge::file::{FileError, ScenarioFile};
use quietpath_bridge::planning::{self, Grid};
use quietpath_core::Metric;
use serde::Serialize;

use crate::commands::landscape::view;
use crate::picture::scale::{Kind, Scale, Spacing};
use crate::units::Presentation;

/// Instants at which landscapes are drawn where sensors move.
pub const FRAMES: usize = 25;
/// Cells along the longer side where sensors rest.
const CELLS: usize = 160;
/// Cells along the longer side where sensors move: less, because there are so many frames.
const CELLS_MOVING: usize = 80;
/// The largest share.
pub const TOP: u16 = 4094;
/// A cell without a value.
pub const NOTHING: u16 = 4095;
/// Ticks of a colour bar.
const TICKS: usize = 5;

const ALPHABET: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

/// The landscapes of a scenario.
#[derive(Debug, Serialize)]
pub struct Fields {
    columns: usize,
    rows: usize,
    times: Vec<f64>,
    height: Option<String>,
    metrics: Vec<Field>,
}

/// One metric.
#[derive(Debug, Serialize)]
struct Field {
    id: &'static str,
    name: String,
    label: String,
    kind: &'static str,
    low: f64,
    high: f64,
    log: bool,
    /// Shares and labels of the colour bar's ticks.
    ticks: Vec<(f64, String)>,
    /// A frame an instant; or
    #[serde(skip_serializing_if = "Vec::is_empty")]
    frames: Vec<String>,
    /// the index of the metric that looks the same.
    #[serde(skip_serializing_if = "Option::is_none")]
    same: Option<usize>,
}

/// Draws every metric between two instants.
///
/// # Errors
/// As [`planning::landscapes`].
pub fn fields(scenario: &ScenarioFile, [from, until]: [f64; 2]) -> Result<Fields, Box<FileError>> {
    let moving = scenario.sensors.iter().any(|sensor| matches!(sensor.motion, MotionEntry::Track(_)));
    let (frames, cells) = if moving { (FRAMES, CELLS_MOVING) } else { (1, CELLS) };
    let time = |frame: usize| from + (until - from) * frame as f64 / (frames.max(2) - 1) as f64;
    let times: Vec<f64> = (0..frames).map(time).collect();
    let at = view(scenario, Metric::Detection, cells);
    let mut grids: Vec<Vec<Grid>> = Vec::with_capacity(frames);
    for time in &times {
        grids.push(planning::landscapes(scenario, &planning::View { time: *time, ..at })?);
    }
    let first = grids.first().map(Vec::as_slice).unwrap_or_default();
    let mut metrics = Vec::new();
    let mut drawn: Vec<(usize, Vec<Vec<u16>>)> = Vec::new();
    for (index, grid) in first.iter().enumerate() {
        // Without energy detectors nobody raises a false alarm.
        if grid.metric == Metric::FalseAlarm && grids.iter().all(|all| all.get(index).is_none_or(is_zero)) {
            continue;
        }
        let values: Vec<&Grid> = grids.iter().filter_map(|all| all.get(index)).collect();
        let (mut field, shares) = packed(scenario, &values);
        field.same = drawn.iter().find(|(_, known)| alike(known, &shares)).map(|(place, _)| *place);
        if field.same.is_none() {
            field.frames = shares.iter().map(|frame| letters(frame)).collect();
            drawn.push((metrics.len(), shares));
        }
        metrics.push(field);
    }
    let height =
        first.first().and_then(|grid| grid.height).map(|up| crate::units::length(up * scenario.frame.unit_m));
    Ok(Fields { columns: at.columns, rows: at.rows, times, height, metrics })
}

fn is_zero(grid: &Grid) -> bool {
    grid.values.iter().all(|value| *value == 0.0)
}

/// A metric's scale, and its share of it at every cell of every frame.
fn packed(scenario: &ScenarioFile, grids: &[&Grid]) -> (Field, Vec<Vec<u16>>) {
    let metric = grids.first().map_or(Metric::Detection, |grid| grid.metric);
    let shown = Presentation::of(metric, scenario.dimension, scenario.frame.unit_m);
    let frames: Vec<Vec<f64>> =
        grids.iter().map(|grid| grid.values.iter().map(|value| shown.convert(*value)).collect()).collect();
    let scale = Scale::of_values(&frames.concat(), shown.kind);
    let shares = frames.iter().map(|frame| frame.iter().map(|value| share(&scale, *value)).collect()).collect();
    let ticks = scale.ticks(TICKS).into_iter().filter(|tick| !tick.label.is_empty());
    let field = Field {
        id: metric.name(),
        name: shown.name.to_owned(),
        label: shown.label(),
        kind: if shown.kind == Kind::Probability { "probability" } else { "figure" },
        low: scale.min,
        high: scale.max,
        log: scale.spacing == Spacing::Log,
        ticks: ticks.map(|tick| (scale.share(tick.value), tick.label)).collect(),
        frames: Vec::new(),
        same: None,
    };
    (field, shares)
}

fn share(scale: &Scale, value: f64) -> u16 {
    let share = scale.share(value);
    if share.is_nan() { NOTHING } else { (share.clamp(0.0, 1.0) * f64::from(TOP)).round() as u16 }
}

/// Whether two metrics look the same but for rounding, as a logarithm does beside a logarithmic scale.
fn alike(one: &[Vec<u16>], other: &[Vec<u16>]) -> bool {
    one.iter().flatten().zip(other.iter().flatten()).all(|(a, b)| a.abs_diff(*b) <= 1)
}

fn letters(cells: &[u16]) -> String {
    let letter = |six: u16| ALPHABET.get(usize::from(six)).map_or('A', |letter| char::from(*letter));
    cells.iter().flat_map(|cell| [letter(cell >> 6), letter(cell & 63)]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_is_two_letters() {
        assert_eq!(letters(&[0, 1, 64, TOP, NOTHING]), "AAABBA/+//");
    }

    #[test]
    fn shares_stay_on_the_scale() {
        let scale = Scale::linear(0.0, 2.0);
        assert_eq!([-1.0, 1.0, 9.0, f64::NAN].map(|value| share(&scale, value)), [0, TOP / 2, TOP, NOTHING]);
    }

    #[test]
    fn logarithms_that_look_like_their_metric_are_not_kept_twice() {
        let text = include_str!("../../scenarios/square8-aee.toml");
        let scenario = ScenarioFile::parse("s.toml", text).unwrap().scenario;
        let fields = fields(&scenario, [0.0, 1.0]).unwrap();
        let place = |id: &str| fields.metrics.iter().position(|field| field.id == id).unwrap();
        assert!(fields.metrics[place("aee")].log);
        assert_eq!(fields.metrics[place("log_aee")].same, Some(place("aee")));
        assert_eq!(fields.metrics[place("aee")].frames[0].len(), 2 * fields.columns * fields.rows);
    }
}
