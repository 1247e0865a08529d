//! Scenario files: the problem as people write it, in TOML.
//!
//! [`ScenarioFile::read`] and [`ScenarioFile::parse`] check everything that the core checks, and the names that
//! only the file has; what they return can be planned, or is refused by the planner as not planned yet. All
//! numbers are in scenario length units and seconds, positions have `dimension` entries (east, north, up).
//!
//! | key | unit | when left out |
//! |---|---|---|
//! | `name` | | the name of the file |
//! | `dimension` | 2 or 3 | 2 |
//! | `softening` | length | 0.001 |
//! | `reference_point` | `current`, `lagged` | `current` |
//! | `[pooling]` `model`, `log_threshold`, `correlation` | `uncorrelated`, `correlated`; 0 to 1 | each sensor decides for itself |
//! | `start_time` | s | 0 |
//! | `separation` | length | none |
//! | `frame.unit_m` | m | 1 |
//! | `frame.latitude_deg`, `frame.longitude_deg`, `frame.altitude_m` | deg, m | plan only, no mission files |
//! | `grid.intervals` | | must be given |
//! | `time.max`, `time.target`, `time.penalty` | s, s, 1/s^2 | must be given, 0, 0 |
//! | `domain.min`, `domain.max` | length | must be given |
//! | `[[agent]]` `name`, `weight`, `start_velocity` | | `uav1` .., 1, free |
//! | `[[agent]]` `start`, `goal`, `speed_max`, `accel_max` | length, /s, /s^2 | must be given |
//! | `[[agent]]` `jammer`, `dropout` | | none |
//! | `[[sensor]]` `name`; `position` or `track` | length, s | `s1` ..; one of them |
//! | `[[sensor]]` `ranging`, `detection`, `jam` | | none, none, no effect |
//! | `[[objective.term]]` `metric` and its kin | | `metric` must be given |
//! | `[[region]]` `center` and `radius`, or `polygon` | length | one of them |
//! | `[[region]]` `name`, `inside`, `from`, `until` | , , s, s | `region1` .., false: keep out, always |
//! | `[[limit]]` | | none |
//! | `[rolling]` `steps`, or `adaptive` `shortest`, `longest`, `change` | | in one piece; one of them |
//! | `[rolling]` `reveal` | `current`, `predicted`, `known` | `current` |
//! | `[study]` `sensor_position`, `path_loss`, `wind` and their kin | length, , length/s | nothing varies |
//!
//! A polygon is a list of 3 to [`quietpath_core::scenario::VERTICES_MAX`] corners in order, in either direction, and
//! strictly convex. Limits: [`crate::capacity`].

mod convert;
mod explain;
mod read;
mod study;
#[cfg(test)]
mod tests;

pub(crate) use convert::point;
pub use study::{Study, Wind};

use quietpath_core::horizon::{Cadence, Reveal};
use quietpath_core::scenario::{
    Detection, Dropout, Jammer, Limit, Pooling, Ranging, ReferencePoint, Side, Susceptibility, Term, Timing, Window,
};

use super::reader::Source;

/// Where the scenario lies on the Earth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameSpec {
    /// Metres in a length unit.
    pub unit_m: f64,
    /// The origin, where the file gives it.
    pub origin: Option<Origin>,
}

/// The origin of the scenario's axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Origin {
    /// Latitude, WGS-84 degrees.
    pub latitude_deg: f64,
    /// Longitude, WGS-84 degrees.
    pub longitude_deg: f64,
    /// In two dimensions the height of the flight above home, in three the altitude of z = 0 above mean sea
    /// level, m.
    pub altitude_m: f64,
}

/// The box that the flight stays in.
#[derive(Clone, Debug, PartialEq)]
pub struct Bounds {
    /// Smallest coordinates, length units.
    pub min: Vec<f64>,
    /// Largest coordinates, length units.
    pub max: Vec<f64>,
}

/// A vehicle.
#[derive(Clone, Debug, PartialEq)]
pub struct AgentEntry {
    /// Unique name.
    pub name: String,
    /// Position at the start time.
    pub start: Vec<f64>,
    /// Position at arrival.
    pub goal: Vec<f64>,
    /// Velocity at the start time; free where not given.
    pub start_velocity: Option<Vec<f64>>,
    /// Largest speed, length units per s.
    pub speed_max: f64,
    /// Largest acceleration, length units per s^2.
    pub accel_max: f64,
    /// Weight in every term of the objective.
    pub weight: f64,
    /// Jamming payload.
    pub jammer: Option<Jammer<f64>>,
    /// Whether the scenario allows that payload to be switched on in flight. Planning does not ask.
    pub jammer_live: bool,
    /// Intermittent communication.
    pub dropout: Option<Dropout<f64>>,
}

/// An entry of a track.
#[derive(Clone, Debug, PartialEq)]
pub struct KnotEntry {
    /// Time, s.
    pub time: f64,
    /// Position, length units.
    pub position: Vec<f64>,
}

/// Where a sensor is.
#[derive(Clone, Debug, PartialEq)]
pub enum MotionEntry {
    /// It stays.
    Fixed(Vec<f64>),
    /// It moves linearly from entry to entry.
    Track(Vec<KnotEntry>),
}

/// A sensor.
#[derive(Clone, Debug, PartialEq)]
pub struct SensorEntry {
    /// Name.
    pub name: String,
    /// Where it is.
    pub motion: MotionEntry,
    /// How well it ranges.
    pub ranging: Option<Ranging<f64>>,
    /// How well it detects.
    pub detection: Option<Detection<f64>>,
    /// What jamming does to it.
    pub jam: Susceptibility<f64>,
}

/// The outline of a region.
#[derive(Clone, Debug, PartialEq)]
pub enum Outline {
    /// A circle.
    Circle {
        /// Centre, length units.
        center: [f64; 2],
        /// Radius, length units.
        radius: f64,
    },
    /// A convex polygon: its corners in order, in either direction, length units.
    Polygon(Vec<[f64; 2]>),
}

impl Outline {
    /// Corners of the outline, counter-clockwise, length units: `corners` places on a circle, those of a polygon.
    #[must_use]
    pub fn ring(&self, corners: u32) -> Vec<[f64; 2]> {
        match self {
            Self::Circle { center: [east, north], radius } => (0..corners)
                .map(|index| {
                    let angle = f64::from(index) * std::f64::consts::TAU / f64::from(corners);
                    [east + radius * angle.cos(), north + radius * angle.sin()]
                })
                .collect(),
            Self::Polygon(given) => {
                let mut ring = given.clone();
                let after = given.iter().cycle().skip(1);
                let doubled_area: f64 = given.iter().zip(after).map(|(a, b)| a[0] * b[1] - b[0] * a[1]).sum();
                if doubled_area < 0.0 {
                    ring.reverse();
                }
                ring
            }
        }
    }
}

/// A region to keep out of or to stay in, in three dimensions an upright column.
#[derive(Clone, Debug, PartialEq)]
pub struct RegionEntry {
    /// Name.
    pub name: String,
    /// Its outline.
    pub outline: Outline,
    /// On which side of the outline paths stay.
    pub side: Side,
    /// Time in which it applies.
    pub window: Window<f64>,
}

/// A plan made in steps while flying.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rolling {
    /// How much of each plan is flown.
    pub cadence: Cadence<f64>,
    /// What each step knows of moving sensors.
    pub reveal: Reveal,
}

/// A scenario, as its file holds it. See the [module](self).
#[derive(Clone, Debug, PartialEq)]
pub struct ScenarioFile {
    pub(crate) source: Source,
    /// Name of the scenario.
    pub name: String,
    /// Dimensions, 2 or 3.
    pub dimension: usize,
    /// Softening of every distance, length units.
    pub softening: f64,
    /// Where the sensors linearise.
    pub reference_point: ReferencePoint,
    /// Whether energy detectors pool their signals.
    pub pooling: Pooling<f64>,
    /// Time at node 0, s.
    pub start_time: f64,
    /// Least distance between two agents, length units.
    pub separation: Option<f64>,
    /// Where it lies on the Earth.
    pub frame: FrameSpec,
    /// Intervals of the time grid.
    pub intervals: usize,
    /// Flight-time bound and penalty.
    pub time: Timing<f64>,
    /// The box that the flight stays in.
    pub domain: Bounds,
    /// Vehicles.
    pub agents: Vec<AgentEntry>,
    /// Sensors.
    pub sensors: Vec<SensorEntry>,
    /// Terms of the objective.
    pub terms: Vec<Term<f64>>,
    /// Regions to keep out of or to stay in.
    pub regions: Vec<RegionEntry>,
    /// Limits on metrics.
    pub limits: Vec<Limit<f64>>,
    /// A plan made in steps.
    pub rolling: Option<Rolling>,
    /// What varies when the plan is flown many times.
    pub study: Option<Study>,
}

/// A scenario, and what is odd about it.
#[derive(Clone, Debug, PartialEq)]
pub struct Loaded {
    /// The scenario.
    pub scenario: ScenarioFile,
    /// What is legal, but hardly meant.
    pub warnings: Vec<super::Warning>,
}

impl ScenarioFile {
    /// The file as the user named it.
    #[must_use]
    pub fn file_name(&self) -> &str {
        &self.source.name
    }

    /// The file's text.
    #[must_use]
    pub fn text(&self) -> &str {
        &self.source.text
    }
}
