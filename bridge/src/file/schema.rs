//! The scenario file as types, for the JSON Schema that editors use to complete and check it.
//!
//! [`ScenarioFile`](super::ScenarioFile) is read by hand, so that errors can name lines; these types say the same in the words
//! of serde. Two tests hold them to it: every scenario here can be read by both, and both know the same keys.
//!
//! Limits: what depends on two values at once (a start in the domain, tracks in order of time) is for
//! `quietpath check` to say.

use schemars::{JsonSchema, schema_for};
use serde::Deserialize;

/// A quietpath scenario. Lengths are in units of frame.unit_m metres, times in seconds, angles in radians
/// counter-clockwise from east.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "quietpath scenario")]
pub struct Scenario {
    /// Name of the scenario; that of the file where it is left out.
    pub name: Option<String>,
    /// 2 or 3.
    #[schemars(range(min = 2, max = 3))]
    pub dimension: Option<u8>,
    /// Every distance is sqrt(d^2 + softening^2).
    #[schemars(range(min = 0.0))]
    pub softening: Option<f64>,
    /// Where sensors linearise.
    pub reference_point: Option<ReferencePoint>,
    /// All energy detectors decide together.
    pub pooling: Option<Pooling>,
    /// Time at the first node, s.
    pub start_time: Option<f64>,
    /// Least distance between any two agents, length units.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub separation: Option<f64>,
    /// Where the scenario lies on the Earth.
    pub frame: Option<Frame>,
    /// The time grid.
    pub grid: Grid,
    /// How long the flight may take.
    pub time: Time,
    /// The box that the flight stays in.
    pub domain: Domain,
    /// Vehicles.
    #[schemars(length(min = 1))]
    pub agent: Vec<Agent>,
    /// Sensors.
    #[serde(default)]
    pub sensor: Vec<Sensor>,
    /// What is wanted.
    pub objective: Objective,
    /// Circles or convex polygons to keep out of or to stay in.
    #[serde(default)]
    pub region: Vec<Region>,
    /// Bounds on metrics.
    #[serde(default)]
    pub limit: Vec<Limit>,
    /// Replanning in steps.
    pub rolling: Option<Rolling>,
    /// What varies when the plan is flown many times.
    pub study: Option<Study>,
}

/// Where sensors linearise.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum ReferencePoint {
    /// At the agent.
    Current,
    /// Where the agent was one node earlier.
    Lagged,
}

/// All energy detectors decide together.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Pooling {
    /// How the signals at two sensors are related.
    pub model: PoolingModel,
    /// Logarithm of the likelihood threshold of the one test.
    pub log_threshold: f64,
    /// Correlation of the signals at two sensors, for `correlated`.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub correlation: Option<f64>,
}

/// How the signals at two sensors are related.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum PoolingModel {
    /// Not at all.
    Uncorrelated,
    /// All alike.
    Correlated,
}

/// Where the scenario lies on the Earth.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Frame {
    /// Metres in a length unit.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub unit_m: Option<f64>,
    /// Latitude of the origin, WGS-84 degrees.
    #[schemars(range(min = -90.0, max = 90.0))]
    pub latitude_deg: Option<f64>,
    /// Longitude of the origin, WGS-84 degrees.
    #[schemars(range(min = -180.0, max = 180.0))]
    pub longitude_deg: Option<f64>,
    /// 2-D: height of the flight above home, m; 3-D: altitude of up = 0 above mean sea level, m.
    pub altitude_m: Option<f64>,
}

/// The time grid.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Grid {
    /// Number of equal time intervals.
    #[schemars(range(min = 1, max = 512))]
    pub intervals: u32,
}

/// How long the flight may take.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Time {
    /// Latest arrival, s.
    pub max: f64,
    /// Arrival from which on lateness is penalised, s.
    pub target: Option<f64>,
    /// Weight of the squared lateness, 1/s^2.
    pub penalty: Option<f64>,
}

/// The box that the flight stays in.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Domain {
    /// Smallest coordinates, length units.
    pub min: Position,
    /// Largest coordinates, length units.
    pub max: Position,
}

/// East, north and, in three dimensions, up, length units.
#[derive(Debug, Deserialize, JsonSchema)]
pub struct Position(#[schemars(length(min = 2, max = 3))] pub Vec<f64>);

/// A vehicle.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Agent {
    /// Unique name.
    pub name: Option<String>,
    /// First position.
    pub start: Position,
    /// Last position.
    pub goal: Position,
    /// Velocity at the start, length units per s; free where it is left out.
    pub start_velocity: Option<Position>,
    /// Largest speed, length units per s.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub speed_max: f64,
    /// Largest acceleration, length units per s^2.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub accel_max: f64,
    /// Weight in every objective term.
    pub weight: Option<f64>,
    /// Jamming payload.
    pub jammer: Option<Jammer>,
    /// Intermittent communication.
    pub dropout: Option<Dropout>,
}

/// Jamming payload.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Jammer {
    /// Where it radiates to.
    pub pattern: Option<Pattern>,
    /// Full width of the cone, rad.
    pub beam_width: Option<f64>,
    /// Largest integral of the jamming level, s.
    #[schemars(range(min = 0.0))]
    pub budget: Option<f64>,
    /// How jamming betrays its agent.
    pub detection_model: Option<Betrayal>,
    /// Exponent of `max`.
    pub q: Option<f64>,
    /// Whether the bridge may switch it on in flight.
    pub live: Option<bool>,
}

/// Where a jammer radiates to.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Pattern {
    /// Everywhere.
    Isotropic,
    /// By the square of the cosine.
    Cosine,
    /// Into a cone of `beam_width`.
    Cone,
}

/// How jamming betrays its agent.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Betrayal {
    /// It does not.
    None,
    /// (44).
    Max,
    /// (45).
    Linear,
    /// Through a sigmoid of what is heard.
    Sigmoid,
}

/// Intermittent communication.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Dropout {
    /// Largest integral of the power reduction, s.
    #[schemars(range(min = 0.0))]
    pub budget: Option<f64>,
}

/// A sensor: `position` for one that stays, `track` for one that moves.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Sensor {
    /// Name.
    pub name: Option<String>,
    /// Where it is.
    pub position: Option<Position>,
    /// Linear between entries, at rest before the first and after the last.
    pub track: Option<Vec<Knot>>,
    /// How well it measures distance.
    pub ranging: Option<Ranging>,
    /// How well it detects.
    pub detection: Option<Detection>,
    /// What jamming does to it.
    pub jam: Option<Jam>,
}

/// An entry of a track.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Knot {
    /// Time, s.
    pub t: f64,
    /// Position then.
    pub position: Position,
}

/// Variance of the measured distance.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(tag = "model", rename_all = "lowercase", deny_unknown_fields)]
pub enum Ranging {
    /// scale d^(2 - 2 `path_loss`).
    Rss {
        /// Factor.
        scale: f64,
        /// Exponent.
        path_loss: f64,
    },
    /// c1 `d^path_loss` (1 + c2 `d^path_loss`).
    Toa {
        /// Factor.
        c1: f64,
        /// Factor of the second term.
        c2: f64,
        /// Exponent.
        path_loss: f64,
    },
}

/// Probability of detection.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(tag = "model", rename_all = "lowercase", deny_unknown_fields)]
pub enum Detection {
    /// min(1, scale / (epsilon + `d^path_loss`)).
    Proxy {
        /// Factor.
        scale: f64,
        /// Keeps it finite.
        epsilon: f64,
        /// Exponent.
        path_loss: f64,
    },
    /// An energy detector: signal variance signal d^(-2 `path_loss`) against noise.
    Energy {
        /// Number of signals taken.
        #[schemars(range(min = 1, max = 40960))]
        samples: u32,
        /// Variance of the signal at distance 1.
        signal: f64,
        /// Variance of the background noise.
        noise: f64,
        /// Logarithm of the likelihood threshold.
        log_threshold: f64,
        /// Exponent.
        path_loss: f64,
    },
}

/// What jamming does to a sensor.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Jam {
    /// Jamming multiplies the ranging variance by 1 + gain z / d^exponent.
    pub error_gain: Option<f64>,
    /// Exponent of that.
    pub error_exponent: Option<f64>,
    /// How loudly the sensor hears a jammer: gain z / d^exponent.
    pub detect_gain: Option<f64>,
    /// Exponent of that.
    pub detect_exponent: Option<f64>,
}

/// What is wanted: the sum of its terms.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Objective {
    /// Terms.
    #[schemars(length(min = 1))]
    pub term: Vec<Term>,
}

/// A term of the objective.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Term {
    /// The figure.
    pub metric: Metric,
    /// Whether less is better.
    pub sense: Option<Sense>,
    /// Integral over time, or the worst value along the path.
    pub reduce: Option<Reduce>,
    /// Weight.
    pub weight: Option<f64>,
    /// Names of the agents that it is about; all where it is left out.
    pub agents: Option<Vec<String>>,
    /// Time from which on it applies, s.
    pub from: Option<f64>,
    /// Time until which it applies, s.
    pub until: Option<f64>,
}

/// Figures at a position.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[expect(missing_docs, reason = "the names are the paper's")]
pub enum Metric {
    Detection,
    FalseAlarm,
    Cep2,
    Cep,
    Aee,
    Gdop,
    LogCep2,
    LogCep,
    LogAee,
    LogGdop,
}

/// Whether less is better.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Sense {
    /// Less is better.
    Min,
    /// More is better.
    Max,
}

/// How values along the path become one.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Reduce {
    /// Over time.
    Integral,
    /// The worst value along the path.
    Extreme,
}

/// A region: `center` and `radius`, or `polygon`.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Region {
    /// Name.
    pub name: Option<String>,
    /// Centre of a circle: east, north.
    pub center: Option<[f64; 2]>,
    /// Radius of a circle.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub radius: Option<f64>,
    /// Corners in order, strictly convex.
    #[schemars(length(min = 3, max = 12))]
    pub polygon: Option<Vec<[f64; 2]>>,
    /// true: stay in; false: keep out.
    pub inside: Option<bool>,
    /// Time from which on it applies, s.
    pub from: Option<f64>,
    /// Time until which it applies, s.
    pub until: Option<f64>,
}

/// Bounds on a metric at every node but the first.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Limit {
    /// The figure.
    pub metric: Metric,
    /// Smallest value.
    pub min: Option<f64>,
    /// Largest value.
    pub max: Option<f64>,
}

/// Planning in steps: `steps`, or `adaptive`.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Rolling {
    /// Number of steps of equal length.
    #[schemars(range(min = 1))]
    pub steps: Option<u32>,
    /// Steps that shorten where much changes.
    pub adaptive: Option<Adaptive>,
    /// What each step knows of moving sensors.
    pub reveal: Option<Reveal>,
}

/// Steps that shorten where much changes.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Adaptive {
    /// Intervals of the shortest step.
    #[schemars(range(min = 1))]
    pub shortest: u32,
    /// Intervals of the longest step.
    #[schemars(range(min = 1))]
    pub longest: u32,
    /// Mean change of the metrics along the plan, as a part of their range, from which on steps shorten.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub change: f64,
}

/// What each step knows of moving sensors.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Reveal {
    /// Where they are at the time of the step.
    Current,
    /// How they move at the time of the step.
    Predicted,
    /// Their tracks.
    Known,
}

/// What varies when the plan is flown many times: standard deviations.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Study {
    /// Where the random numbers begin.
    pub seed: Option<u32>,
    /// Of each coordinate of a sensor, length units.
    #[schemars(range(min = 0.0))]
    pub sensor_position: Option<f64>,
    /// Of a sensor's path-loss exponents.
    #[schemars(range(min = 0.0))]
    pub path_loss: Option<f64>,
    /// Largest airspeed, as a multiple of `speed_max`.
    #[schemars(range(min = 1.0))]
    pub airspeed: Option<f64>,
    /// The air.
    pub wind: Option<Wind>,
}

/// The wind of a study.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Wind {
    /// Mean wind: east, north, length units per s.
    pub mean: Option<[f64; 2]>,
    /// Standard deviation of each component of the mean wind, length units per s.
    #[schemars(range(min = 0.0))]
    pub deviation: Option<f64>,
    /// Standard deviation of each component of gusts, length units per s.
    #[schemars(range(min = 0.0))]
    pub gust: Option<f64>,
    /// Time over which gusts are forgotten, s.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub gust_time: Option<f64>,
}

/// The JSON Schema of scenario files, as text.
#[must_use]
pub fn scenario_schema() -> String {
    serde_json::to_string_pretty(&schema_for!(Scenario)).unwrap_or_default() + "\n"
}
