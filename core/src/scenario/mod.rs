//! The problem to plan: agents, sensors, objective, bounds. Validated once, then trusted.
//!
//! A caller describes a problem as a [`Draft`] that borrows the caller's own lists. [`Scenario::new`] checks all
//! of it and copies it into fixed-size storage; past this one constructor there is no doubt left, and the
//! planner does not look again. [`Scenario::view`] lends the parts without their capacities.
//!
//! | symbol | name | unit | shape |
//! |---|---|---|---|
//! | x_0, X | `start`, `goal` | scenario length unit | `DIM` |
//! | y_j | `position`, `track` | scenario length unit | `DIM` |
//! | T | `time.max` | s | |
//! | t_F, M | `time.target`, `time.penalty` | s, 1/s^2 | |
//! | v_max, a_max | `speed_max`, `accel_max` | unit/s, unit/s^2 | |
//! | N | `intervals` | | |
//! | | `separation` | scenario length unit | |
//!
//! Source: sections 2, 3.3 and 4.1. Limits: [`TERMS_MAX`], [`REGIONS_MAX`], [`LIMITS_MAX`], and the
//! capacities of [`Scenario`].

mod region;
mod validate;

pub use region::{Polygon, Region, Shape, Side, VERTICES_MAX};

use heapless::Vec;

use crate::error::{Error, Fault, Item};
use crate::math::{Point, Real};

/// Objective terms that a scenario can hold.
pub const TERMS_MAX: usize = 8;
/// Regions that a scenario can hold.
pub const REGIONS_MAX: usize = 16;
/// Limits that a scenario can hold.
pub const LIMITS_MAX: usize = 8;

/// The figure that an objective term or a limit is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Metric {
    /// Combined probability of detection, (19).
    Detection,
    /// Combined probability of a false alarm, (27).
    FalseAlarm,
    /// Squared circular error probable, trace P, length unit squared: E1 of section 2.3.1.
    Cep2,
    /// Circular error probable, length unit, (11).
    Cep,
    /// Area of the 95 % error ellipse, length unit squared; in three dimensions a volume proxy, (16).
    Aee,
    /// Geometric dilution of position, (18).
    Gdop,
    /// Natural logarithm of [`Metric::Cep2`].
    LogCep2,
    /// Natural logarithm of [`Metric::Cep`].
    LogCep,
    /// Natural logarithm of [`Metric::Aee`].
    LogAee,
    /// Natural logarithm of [`Metric::Gdop`].
    LogGdop,
}

impl Metric {
    /// All metrics, in the order of the paper.
    pub const ALL: [Self; 10] = [
        Self::Detection,
        Self::FalseAlarm,
        Self::Cep2,
        Self::Cep,
        Self::Aee,
        Self::Gdop,
        Self::LogCep2,
        Self::LogCep,
        Self::LogAee,
        Self::LogGdop,
    ];

    /// The name that scenario files use.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Detection => "detection",
            Self::FalseAlarm => "false_alarm",
            Self::Cep2 => "cep2",
            Self::Cep => "cep",
            Self::Aee => "aee",
            Self::Gdop => "gdop",
            Self::LogCep2 => "log_cep2",
            Self::LogCep => "log_cep",
            Self::LogAee => "log_aee",
            Self::LogGdop => "log_gdop",
        }
    }

    /// Whether the metric is a location error, and so needs ranging sensors.
    #[must_use]
    pub const fn is_location_error(self) -> bool {
        !matches!(self, Self::Detection | Self::FalseAlarm)
    }

    /// Whether the metric is the logarithm of another.
    #[must_use]
    pub const fn is_logarithm(self) -> bool {
        matches!(self, Self::LogCep2 | Self::LogCep | Self::LogAee | Self::LogGdop)
    }
}

/// Where the sensors linearise their measurements: r0 of (12).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ReferencePoint {
    /// r0 is the agent's present position.
    #[default]
    Current,
    /// r0 is the agent's position one node earlier (Remark 2.2).
    Lagged,
}

/// Flight-time bound and penalty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timing<T> {
    /// T: start time plus flight time may not exceed it, s.
    pub max: T,
    /// t_F of (29): later arrivals are penalised, s.
    pub target: T,
    /// M of (29), objective unit per s^2; 0 for no penalty.
    pub penalty: T,
}

/// The box that the flight stays in, length units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Domain<T, const DIM: usize> {
    /// Smallest coordinates.
    pub min: Point<T, DIM>,
    /// Largest coordinates.
    pub max: Point<T, DIM>,
}

/// A half-open span of time `[from, until)` in which something applies, s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Window<T> {
    /// First instant; minus infinity for none.
    pub from: T,
    /// End; infinity for none.
    pub until: T,
}

impl<T: Real> Window<T> {
    /// All of time.
    #[must_use]
    pub fn always() -> Self {
        Self { from: -T::INFINITY, until: T::INFINITY }
    }

    /// Whether `time` (s) lies in the window.
    #[inline]
    #[must_use]
    pub fn holds(&self, time: T) -> bool {
        self.from <= time && time < self.until
    }
}

/// How the strength of a jamming signal falls off from its direction: a(alpha, x, y) of section 3.1.2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BeamPattern<T> {
    /// The same in all directions: a = 1.
    Isotropic,
    /// a = max(0, cos)^2 of the angle from the azimuth.
    Cosine,
    /// The cone of full width `beam_width`, (47).
    Cone {
        /// Full width beta, rad.
        beam_width: T,
    },
}

/// How an agent's own jamming raises the probability that it is detected.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Betrayal<T> {
    /// Not at all.
    None,
    /// (44): the q-norm of detection probability and jamming level.
    Max {
        /// Exponent q, greater than 1.
        q: T,
    },
    /// (45): in proportion to the jamming level received.
    Linear,
    /// p + (1 - p) (2 S(k) - 1) with the logistic function S.
    Sigmoid,
}

/// A jamming payload.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jammer<T> {
    /// Directivity.
    pub pattern: BeamPattern<T>,
    /// What the emission does to the jammer's own detection.
    pub betrayal: Betrayal<T>,
    /// Largest integral of the level over the flight, s, (49).
    pub budget: T,
}

/// A transmitter that can fall silent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dropout<T> {
    /// Largest integral of the power reduction over the flight, s, (55).
    pub budget: T,
}

/// A vehicle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Agent<T, const DIM: usize> {
    /// Position at the start time, length units.
    pub start: Point<T, DIM>,
    /// Position at arrival, length units.
    pub goal: Point<T, DIM>,
    /// Velocity at the start time, length units per s; `None` leaves it free.
    pub start_velocity: Option<Point<T, DIM>>,
    /// Largest speed, length units per s.
    pub speed_max: T,
    /// Largest acceleration, length units per s^2.
    pub accel_max: T,
    /// Weight of the agent in every term of the objective.
    pub weight: T,
    /// Jamming payload, where there is one.
    pub jammer: Option<Jammer<T>>,
    /// Intermittent communication, where it is allowed.
    pub dropout: Option<Dropout<T>>,
}

/// An entry of a sensor's track.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Knot<T, const DIM: usize> {
    /// Time, s.
    pub time: T,
    /// Position, length units.
    pub position: Point<T, DIM>,
}

/// Where a sensor is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Motion<'a, T, const DIM: usize> {
    /// It stays at a position, length units.
    Fixed(Point<T, DIM>),
    /// It moves linearly from entry to entry, and rests before the first and after the last.
    Track(&'a [Knot<T, DIM>]),
    /// It keeps its velocity, before and after it was seen.
    Steady(Sighting<T, DIM>),
}

/// A sensor as it was seen at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sighting<T, const DIM: usize> {
    /// When, s.
    pub time: T,
    /// Where, length units.
    pub position: Point<T, DIM>,
    /// How it moved, length units per s.
    pub velocity: Point<T, DIM>,
}

/// Variance of a sensor's distance estimator, length unit squared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Ranging<T> {
    /// Received signal strength: `scale d^(2 - 2 path_loss)`, (8).
    Rss {
        /// Variance at distance 1.
        scale: T,
        /// Path-loss exponent gamma.
        path_loss: T,
    },
    /// Time of arrival: `c1 d^path_loss (1 + c2 d^path_loss)`, (10).
    Toa {
        /// First constant.
        c1: T,
        /// Second constant.
        c2: T,
        /// Path-loss exponent gamma.
        path_loss: T,
    },
}

/// Probability that a sensor detects an agent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Detection<T> {
    /// `min(1, scale / (epsilon + d^path_loss))`, (26).
    Proxy {
        /// c of (26).
        scale: T,
        /// epsilon of (26).
        epsilon: T,
        /// Path-loss exponent gamma.
        path_loss: T,
    },
    /// Likelihood-ratio energy detector, (21), (22), (25), (28).
    Energy {
        /// Signals taken, the paper's N.
        samples: u32,
        /// Signal variance at distance 1.
        signal: T,
        /// Variance of the background noise.
        noise: T,
        /// Logarithm of the likelihood threshold gamma.
        log_threshold: T,
        /// Path-loss exponent gamma.
        path_loss: T,
    },
}

/// Whether the sensors with energy detectors decide each for itself, or together.
///
/// Sensors that pool send their signals to one place, where a single likelihood-ratio test is made of all of them; their own
/// `log_threshold` is then not used. Sensors with [`Detection::Proxy`] decide for themselves in any case.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Pooling<T> {
    /// Each for itself; an agent is detected if any sensor detects it, (19).
    #[default]
    None,
    /// Pooled; signals at different sensors are uncorrelated.
    Uncorrelated {
        /// Logarithm of the likelihood threshold gamma of the one test.
        log_threshold: T,
    },
    /// Pooled; signals at any two sensors at the same instant have the same correlation. Every sensor takes the same number
    /// of samples.
    Correlated {
        /// Logarithm of the likelihood threshold gamma of the one test.
        log_threshold: T,
        /// Correlation of the signals at two sensors, 0 to 1.
        correlation: T,
    },
}

/// How a sensor suffers from jamming, and how it hears the jammer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Susceptibility<T> {
    /// c_j of (42).
    pub error_gain: T,
    /// rho_j of (42).
    pub error_exponent: T,
    /// c^_j of (45).
    pub detect_gain: T,
    /// mu_j of (45).
    pub detect_exponent: T,
}

/// A sensor, as a caller describes it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensor<'a, T, const DIM: usize> {
    /// Where it is.
    pub motion: Motion<'a, T, DIM>,
    /// How well it ranges, where it does.
    pub ranging: Option<Ranging<T>>,
    /// How well it detects, where it does.
    pub detection: Option<Detection<T>>,
    /// What jamming does to it.
    pub jam: Susceptibility<T>,
}

/// Which way a metric is wanted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Sense {
    /// Small is good.
    #[default]
    Minimize,
    /// Large is good.
    Maximize,
}

/// How a metric along the path becomes one figure.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Reduce {
    /// Integral over time, (3), (5).
    #[default]
    Integral,
    /// Worst value along the path, (4).
    Extreme,
}

/// The agents that a term is about: bit k stands for agent k.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct AgentSet(pub u32);

impl AgentSet {
    /// Every agent.
    pub const ALL: Self = Self(u32::MAX);

    /// Whether agent `index` belongs to the set.
    #[inline]
    #[must_use]
    pub const fn contains(self, index: usize) -> bool {
        index < 32 && (self.0 >> index) & 1 == 1
    }
}

/// One term of the objective: `weight * agent weight * reduce(metric)`, with a minus sign where maximised.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Term<T> {
    /// The figure.
    pub metric: Metric,
    /// Which way it is wanted.
    pub sense: Sense,
    /// How it is reduced along the path.
    pub reduce: Reduce,
    /// Weight, not negative.
    pub weight: T,
    /// Agents that it is about.
    pub agents: AgentSet,
    /// Time in which it applies.
    pub window: Window<T>,
}

/// Bounds on a metric at every node but the first, (61), (62).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limit<T> {
    /// The figure.
    pub metric: Metric,
    /// Smallest value allowed.
    pub min: Option<T>,
    /// Largest value allowed.
    pub max: Option<T>,
}

/// A problem as the caller describes it, unchecked; lists are the caller's own.
#[derive(Clone, Copy, Debug)]
pub struct Draft<'a, T, const DIM: usize> {
    /// Softening of every distance, length units.
    pub softening: T,
    /// Where the sensors linearise.
    pub reference_point: ReferencePoint,
    /// Whether energy detectors pool their signals.
    pub pooling: Pooling<T>,
    /// Intervals N of the time grid.
    pub intervals: usize,
    /// Time at node 0, s.
    pub start_time: T,
    /// Flight-time bound and penalty.
    pub time: Timing<T>,
    /// The box that the flight stays in.
    pub domain: Domain<T, DIM>,
    /// Least distance between any two agents at any time, length units.
    pub separation: Option<T>,
    /// Vehicles, at least one.
    pub agents: &'a [Agent<T, DIM>],
    /// Sensors.
    pub sensors: &'a [Sensor<'a, T, DIM>],
    /// Terms of the objective, at least one.
    pub terms: &'a [Term<T>],
    /// Regions to keep out of or to stay in.
    pub regions: &'a [Region<T>],
    /// Limits on metrics.
    pub limits: &'a [Limit<T>],
}

/// Where a stored sensor is: a position, or a range of the scenario's knots.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum StoredMotion<T, const DIM: usize> {
    Fixed(Point<T, DIM>),
    Track { first: usize, count: usize },
    Steady(Sighting<T, DIM>),
}

/// A sensor, as a [`Scenario`] holds it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StoredSensor<T, const DIM: usize> {
    pub(crate) motion: StoredMotion<T, DIM>,
    /// How well it ranges, where it does.
    pub ranging: Option<Ranging<T>>,
    /// How well it detects, where it does.
    pub detection: Option<Detection<T>>,
    /// What jamming does to it.
    pub jam: Susceptibility<T>,
}

impl<T, const DIM: usize> StoredSensor<T, DIM> {
    /// Whether the sensor moves.
    #[must_use]
    pub const fn is_moving(&self) -> bool {
        !matches!(self.motion, StoredMotion::Fixed(_))
    }

    /// The same sensor, at rest at `position` (length units).
    #[must_use]
    pub fn at_rest(self, position: Point<T, DIM>) -> Self {
        Self { motion: StoredMotion::Fixed(position), ..self }
    }

    /// The same sensor, keeping the velocity that it was seen with.
    #[must_use]
    pub fn steady(self, sighting: Sighting<T, DIM>) -> Self {
        Self { motion: StoredMotion::Steady(sighting), ..self }
    }
}

/// The parts of a problem that are not lists.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame<T, const DIM: usize> {
    /// Softening of every distance, length units.
    pub softening: T,
    /// Where the sensors linearise.
    pub reference_point: ReferencePoint,
    /// Whether energy detectors pool their signals.
    pub pooling: Pooling<T>,
    /// Intervals N of the time grid.
    pub intervals: usize,
    /// Time at node 0, s.
    pub start_time: T,
    /// The interval that was flown at the agents' start velocities before the start, s: the start is a seam between
    /// two plans, and the change of velocity there counts over the mean of the intervals on both sides. Without one
    /// it counts over the first interval.
    pub start_interval: Option<T>,
    /// Flight-time bound and penalty.
    pub time: Timing<T>,
    /// The box that the flight stays in.
    pub domain: Domain<T, DIM>,
    /// Least distance between any two agents at any time, length units.
    pub separation: Option<T>,
}

/// A validated problem in fixed-size storage: at most `SENSORS` sensors, `AGENTS` agents, and `KNOTS` entries of
/// all tracks together.
#[derive(Clone, Debug)]
pub struct Scenario<T, const DIM: usize, const SENSORS: usize, const AGENTS: usize, const KNOTS: usize> {
    frame: Frame<T, DIM>,
    agents: Vec<Agent<T, DIM>, AGENTS>,
    sensors: Vec<StoredSensor<T, DIM>, SENSORS>,
    knots: Vec<Knot<T, DIM>, KNOTS>,
    terms: Vec<Term<T>, TERMS_MAX>,
    regions: Vec<Region<T>, REGIONS_MAX>,
    limits: Vec<Limit<T>, LIMITS_MAX>,
}

impl<T: Real, const DIM: usize, const SENSORS: usize, const AGENTS: usize, const KNOTS: usize>
    Scenario<T, DIM, SENSORS, AGENTS, KNOTS>
{
    /// Checks a draft and takes a copy of it.
    ///
    /// # Errors
    /// The first thing that is wrong, with its item and field: numbers that are not finite or have the wrong
    /// sign, positions outside the domain or in a region that
    /// is forbidden, agents that start or arrive closer together than `separation`, tracks whose times do not increase, an objective without terms, too
    /// few ranging sensors for a location error, a goal that is too far for `time.max`, lists longer than the
    /// capacities.
    pub fn new(draft: &Draft<'_, T, DIM>) -> Result<Self, Error> {
        validate::check(draft)?;
        let mut knots = Vec::new();
        let mut sensors = Vec::new();
        for (index, sensor) in draft.sensors.iter().enumerate() {
            let item = Item::Sensor(index);
            let motion = match sensor.motion {
                Motion::Fixed(position) => StoredMotion::Fixed(position),
                Motion::Track(entries) => {
                    let first = knots.len();
                    knots.extend_from_slice(entries).map_err(|_| {
                        let total = total_knots(draft.sensors);
                        Error::new(item, "track", Fault::TooMany { count: total, capacity: KNOTS })
                    })?;
                    StoredMotion::Track { first, count: entries.len() }
                }
                Motion::Steady(sighting) => StoredMotion::Steady(sighting),
            };
            let stored =
                StoredSensor { motion, ranging: sensor.ranging, detection: sensor.detection, jam: sensor.jam };
            sensors.push(stored).map_err(|_| too_many("sensor", draft.sensors.len(), SENSORS))?;
        }
        Ok(Self {
            frame: Frame {
                softening: draft.softening,
                reference_point: draft.reference_point,
                pooling: draft.pooling,
                intervals: draft.intervals,
                start_time: draft.start_time,
                start_interval: None,
                time: draft.time,
                domain: draft.domain,
                separation: draft.separation,
            },
            agents: copied("agent", draft.agents)?,
            sensors,
            knots,
            terms: copied("objective.term", draft.terms)?,
            regions: copied("region", draft.regions)?,
            limits: copied("limit", draft.limits)?,
        })
    }

    /// Lends the parts, without their capacities.
    #[must_use]
    pub fn view(&self) -> View<'_, T, DIM> {
        View {
            frame: self.frame,
            agents: &self.agents,
            sensors: &self.sensors,
            knots: &self.knots,
            terms: &self.terms,
            regions: &self.regions,
            limits: &self.limits,
        }
    }
}

fn total_knots<T, const DIM: usize>(sensors: &[Sensor<'_, T, DIM>]) -> usize {
    let count = |sensor: &Sensor<'_, T, DIM>| match sensor.motion {
        Motion::Fixed(_) | Motion::Steady(_) => 0,
        Motion::Track(entries) => entries.len(),
    };
    sensors.iter().map(count).sum()
}

fn too_many(field: &'static str, count: usize, capacity: usize) -> Error {
    Error::new(Item::Scenario, field, Fault::TooMany { count, capacity })
}

fn copied<V: Clone, const CAPACITY: usize>(field: &'static str, list: &[V]) -> Result<Vec<V, CAPACITY>, Error> {
    Vec::from_slice(list).map_err(|_| too_many(field, list.len(), CAPACITY))
}

/// A validated problem on loan from a [`Scenario`].
#[derive(Clone, Copy, Debug)]
pub struct View<'a, T, const DIM: usize> {
    /// Everything that is not a list.
    pub frame: Frame<T, DIM>,
    /// Vehicles.
    pub agents: &'a [Agent<T, DIM>],
    /// Sensors.
    pub sensors: &'a [StoredSensor<T, DIM>],
    pub(crate) knots: &'a [Knot<T, DIM>],
    /// Terms of the objective.
    pub terms: &'a [Term<T>],
    /// Regions to keep out of or to stay in.
    pub regions: &'a [Region<T>],
    /// Limits on metrics.
    pub limits: &'a [Limit<T>],
}

impl<'a, T: Real, const DIM: usize> View<'a, T, DIM> {
    /// The same problem with other sensors. They may be those of this view, at rest, steady or on their tracks.
    #[must_use]
    pub const fn with_sensors(self, sensors: &'a [StoredSensor<T, DIM>]) -> Self {
        Self { sensors, ..self }
    }

    /// Position (length units) and velocity (length units per s) of a sensor at `time` (s).
    ///
    /// The velocity is zero before the first and after the last entry of a track, and that of the segment that
    /// begins at `time` on an entry.
    #[inline]
    #[must_use]
    pub fn sensor_state(&self, sensor: &StoredSensor<T, DIM>, time: T) -> (Point<T, DIM>, Point<T, DIM>) {
        match sensor.motion {
            StoredMotion::Fixed(position) => (position, Point::zeros()),
            StoredMotion::Track { first, count } => {
                let knots = self.knots.get(first..first + count).unwrap_or_default();
                track_state(knots, time)
            }
            StoredMotion::Steady(sighting) => {
                (sighting.position + sighting.velocity * (time - sighting.time), sighting.velocity)
            }
        }
    }
}

/// Piecewise linear interpolation, held before the first and after the last entry.
fn track_state<T: Real, const DIM: usize>(knots: &[Knot<T, DIM>], time: T) -> (Point<T, DIM>, Point<T, DIM>) {
    let next = knots.partition_point(|knot| knot.time <= time);
    let after = knots.get(next);
    let before = next.checked_sub(1).and_then(|index| knots.get(index));
    match (before, after) {
        (Some(a), Some(b)) => {
            let velocity = (b.position - a.position) / (b.time - a.time);
            (a.position + velocity * (time - a.time), velocity)
        }
        (Some(only), None) | (None, Some(only)) => (only.position, Point::zeros()),
        (None, None) => (Point::zeros(), Point::zeros()),
    }
}
