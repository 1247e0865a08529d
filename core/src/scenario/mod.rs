//! The problem to plan: agents, sensors, objective, bounds. Validated once, then trusted.
//!
//! A caller describes a problem as a [`Draft`] that borrows the caller's own lists. [`Scenario::new`] checks all
//! of it and copies it into fixed-size storage; past this one constructor there is no doubt left, and the
//! planner does not look again. [`Scenario::view`] lends the parts without their capacities.
//!
//! | symbol | name | unit | shape |
//! |---|---|---|---|
//! | T | `time.max` | s | |
//! | t_F, M | `time.target`, `time.penalty` | s, 1/s^2 | |
//! | N | `intervals` | | |
//! | | `separation` | scenario length unit | |
//!
//! Vehicles are in `agent`, sensors in `sensor`, objective and limits in `term`, regions in `region`, the plain case of each in
//! `plain`; the checks are in
//! `validate`.
//!
//! Source: sections 2, 3.3 and 4.1. Limits: [`TERMS_MAX`], [`REGIONS_MAX`], [`LIMITS_MAX`], and the
//! capacities of [`Scenario`].

mod agent;
mod plain;
mod region;
mod sensor;
mod term;
mod validate;

pub use agent::{Agent, BeamPattern, Betrayal, Dropout, Jammer};
pub use region::{Polygon, Region, Shape, Side, VERTICES_MAX};
pub(crate) use sensor::StoredMotion;
pub use sensor::{Detection, Knot, Motion, Pooling, Ranging, Sensor, Sighting, StoredSensor, Susceptibility};
pub use term::{AgentSet, Limit, Metric, Reduce, Sense, Term};

use sensor::track_state;

use heapless::Vec;

use crate::error::{Error, Fault, Item};
use crate::math::{Point, Real, norm};

/// Objective terms that a scenario can hold.
pub const TERMS_MAX: usize = 8;
/// Regions that a scenario can hold.
pub const REGIONS_MAX: usize = 16;
/// Limits that a scenario can hold.
pub const LIMITS_MAX: usize = 8;
/// Part of the time there is that a flight to where it begins takes at least.
const BRIEFEST: f64 = 0.05;

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
    /// sign, positions outside the domain or in a region that is forbidden, agents that start or arrive closer together than
    /// `separation`, tracks whose times do not increase, an objective without terms, too few ranging sensors for a location
    /// error, a goal that is too far for `time.max`, lists longer than the capacities.
    pub fn new(draft: &Draft<'_, T, DIM>) -> Result<Self, Error> {
        validate::check(draft)?;
        // Filled in place: on a small stack a copy of all lists counts.
        let mut made = Self {
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
            agents: Vec::new(),
            sensors: Vec::new(),
            knots: Vec::new(),
            terms: Vec::new(),
            regions: Vec::new(),
            limits: Vec::new(),
        };
        made.store_sensors(draft.sensors)?;
        copy("agent", draft.agents, &mut made.agents)?;
        copy("objective.term", draft.terms, &mut made.terms)?;
        copy("region", draft.regions, &mut made.regions)?;
        copy("limit", draft.limits, &mut made.limits)?;
        Ok(made)
    }

    /// Sensors, and their tracks one after the other.
    fn store_sensors(&mut self, sensors: &[Sensor<'_, T, DIM>]) -> Result<(), Error> {
        for (index, sensor) in sensors.iter().enumerate() {
            let motion = match sensor.motion {
                Motion::Fixed(position) => StoredMotion::Fixed(position),
                Motion::Track(entries) => {
                    let first = self.knots.len();
                    self.knots.extend_from_slice(entries).map_err(|_| {
                        let total = total_knots(sensors);
                        let fault = Fault::TooMany { count: total, capacity: KNOTS };
                        Error::new(Item::Sensor(index), "track", fault)
                    })?;
                    StoredMotion::Track { first, count: entries.len() }
                }
                Motion::Steady(sighting) => StoredMotion::Steady(sighting),
            };
            let stored =
                StoredSensor { motion, ranging: sensor.ranging, detection: sensor.detection, jam: sensor.jam };
            self.sensors.push(stored).map_err(|_| too_many("sensor", sensors.len(), SENSORS))?;
        }
        Ok(())
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

fn copy<V: Clone, const CAPACITY: usize>(
    field: &'static str,
    list: &[V],
    into: &mut Vec<V, CAPACITY>,
) -> Result<(), Error> {
    into.extend_from_slice(list).map_err(|_| too_many(field, list.len(), CAPACITY))
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

    /// Whether every term is a cost wherever it is, as exposure is: sensors are then hills, and what tells good ways apart is the
    /// sides on which they pass them. Where sensors are sought, or worst values count, there are good ways of many kinds on each.
    pub(crate) fn is_avoiding(&self) -> bool {
        self.terms.iter().all(|term| term.sense == Sense::Minimize && term.reduce == Reduce::Integral)
    }

    /// Seconds that the straight lines of all agents take at full speed: t_M of section 4.4. Where nobody has anywhere to go, a
    /// little of the time there is: any shorter flight would be as good, down to none, and in no time nothing has a speed.
    pub(crate) fn shortest_flight(&self) -> T {
        let times = self.agents.iter().map(|agent| norm(&(agent.goal - agent.start)) / agent.speed_max);
        let shortest = times.fold(T::zero(), T::max);
        let frame = self.frame;
        if shortest > T::zero() { shortest } else { (frame.time.max - frame.start_time) * T::real(BRIEFEST) }
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
