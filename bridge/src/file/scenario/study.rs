//! `[study]`: how much of the world is uncertain when a plan is flown many times.

use super::read::positive_optional;
use crate::file::reader::{Outcome, Table, Value};

/// What a study varies from run to run. Standard deviations are of normal distributions.
#[derive(Clone, Debug, PartialEq)]
pub struct Study {
    /// Where the random numbers begin.
    pub seed: u64,
    /// Standard deviation of each coordinate of a sensor, length units; a track shifts as a whole.
    pub sensor_position: f64,
    /// Standard deviation of a sensor's path-loss exponent: of ranging and detection together.
    pub path_loss: f64,
    /// Largest airspeed, as a multiple of `speed_max`.
    pub airspeed: f64,
    /// The air.
    pub wind: Wind,
}

/// The wind of a study: a mean that is drawn for each run, and gusts that come and go.
#[derive(Clone, Debug, PartialEq)]
pub struct Wind {
    /// What the mean wind is on average, length units per s: east, north.
    pub mean: [f64; 2],
    /// Standard deviation of each component of the mean wind, length units per s.
    pub deviation: f64,
    /// Standard deviation of each component of the gusts, length units per s.
    pub gust: f64,
    /// Time over which gusts are forgotten, s.
    pub gust_time: f64,
}

pub(super) const KEYS: &[&str] = &["seed", "sensor_position", "path_loss", "airspeed", "wind"];
pub(super) const WIND: &[&str] = &["mean", "deviation", "gust", "gust_time"];
/// Largest airspeed where the file does not say.
const AIRSPEED: f64 = 1.25;
/// How long gusts last where the file does not say, s.
const GUST_TIME: f64 = 10.0;

pub(super) fn study(top: &Table<'_>) -> Outcome<Option<Study>> {
    let Some(table) = top.table("study", KEYS)? else { return Ok(None) };
    let seed = table.optional("seed").map(|value| value.count()).transpose()?.unwrap_or(1);
    let airspeed = positive_optional(&table, "airspeed")?.unwrap_or(AIRSPEED);
    if airspeed < 1.0 {
        let help = "a vehicle flies its `speed_max` in still air: give 1.0 or more";
        return Err(table.error("airspeed", format!("must not be less than 1, but is {airspeed}"), help));
    }
    Ok(Some(Study {
        seed: seed as u64,
        sensor_position: spread(&table, "sensor_position")?,
        path_loss: spread(&table, "path_loss")?,
        airspeed,
        wind: wind(&table)?,
    }))
}

fn wind(study: &Table<'_>) -> Outcome<Wind> {
    let Some(table) = study.table("wind", WIND)? else {
        return Ok(Wind { mean: [0.0; 2], deviation: 0.0, gust: 0.0, gust_time: GUST_TIME });
    };
    let mean = |value: Value<'_>| match value.point(2)?.as_slice() {
        &[east, north] => Ok([east, north]),
        _ => Err(value.error("must have 2 numbers", "write [east, north]")),
    };
    Ok(Wind {
        mean: table.optional("mean").map(mean).transpose()?.unwrap_or_default(),
        deviation: spread(&table, "deviation")?,
        gust: spread(&table, "gust")?,
        gust_time: positive_optional(&table, "gust_time")?.unwrap_or(GUST_TIME),
    })
}

/// A standard deviation; 0 where it is left out.
fn spread(table: &Table<'_>, key: &str) -> Outcome<f64> {
    let value = table.number_or(key, 0.0)?;
    if value < 0.0 {
        return Err(table.error(key, format!("must not be negative, but is {value}"), "give a standard deviation"));
    }
    Ok(value)
}
