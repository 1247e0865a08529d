//! The plain case of everything that has many fields: one line each, and `..` for what differs.
//!
//! ```
//! use quietpath_core::Point;
//! use quietpath_core::scenario::Agent;
//! let slow = Agent::plain([0.0, 0.0].into(), [9.0, 7.0].into(), 0.1, 0.02);
//! let heard = Agent { weight: 2.0, start_velocity: Some(Point::zeros()), ..slow };
//! # assert_eq!((heard.goal, heard.weight), (slow.goal, 2.0));
//! ```
//!
//! Limits: what is left out here is what scenario files leave out, with the same values.

use super::{
    Agent, AgentSet, Detection, Domain, Draft, Metric, Motion, Pooling, Ranging, Reduce, ReferencePoint, Sense,
    Sensor, Susceptibility, Term, Timing, Window,
};
use crate::math::{Point, Real};

/// Softening of distances, length units.
const SOFTENING: f64 = 1e-3;

impl<T: Real, const DIM: usize> Agent<T, DIM> {
    /// A vehicle without payloads whose first velocity is free: positions in length units, bounds per s and per s^2.
    #[must_use]
    pub fn plain(start: Point<T, DIM>, goal: Point<T, DIM>, speed_max: T, accel_max: T) -> Self {
        let (weight, start_velocity, jammer, dropout) = (T::one(), None, None, None);
        Self { start, goal, start_velocity, speed_max, accel_max, weight, jammer, dropout }
    }
}

impl<T: Real> Susceptibility<T> {
    /// Jamming does nothing to the sensor, and is not heard by it.
    #[must_use]
    pub fn none() -> Self {
        let two = T::real(2.0);
        Self { error_gain: T::zero(), error_exponent: two, detect_gain: T::zero(), detect_exponent: two }
    }
}

impl<T: Real, const DIM: usize> Sensor<'_, T, DIM> {
    /// A sensor that stays at `position` (length units), does not range, and cannot be jammed.
    #[must_use]
    pub fn detecting(position: Point<T, DIM>, detection: Detection<T>) -> Self {
        let motion = Motion::Fixed(position);
        Self { motion, ranging: None, detection: Some(detection), jam: Susceptibility::none() }
    }

    /// A sensor that stays at `position` (length units), does not detect, and cannot be jammed.
    #[must_use]
    pub fn ranging(position: Point<T, DIM>, ranging: Ranging<T>) -> Self {
        let motion = Motion::Fixed(position);
        Self { motion, ranging: Some(ranging), detection: None, jam: Susceptibility::none() }
    }
}

impl<T: Real> Term<T> {
    /// The integral of a metric over the flight of every agent, with weight 1.
    #[must_use]
    pub fn integral(metric: Metric, sense: Sense) -> Self {
        let (reduce, agents, window) = (Reduce::Integral, AgentSet::ALL, Window::always());
        Self { metric, sense, reduce, weight: T::one(), agents, window }
    }
}

impl<'a, T: Real, const DIM: usize> Draft<'a, T, DIM> {
    /// A flight that starts at 0 s, takes at most `time_max` s in `intervals` intervals, and stays in `domain`, without
    /// regions and limits.
    #[must_use]
    pub fn plain(
        intervals: usize,
        time_max: T,
        domain: Domain<T, DIM>,
        agents: &'a [Agent<T, DIM>],
        sensors: &'a [Sensor<'a, T, DIM>],
        terms: &'a [Term<T>],
    ) -> Self {
        Self {
            softening: T::real(SOFTENING),
            reference_point: ReferencePoint::Current,
            pooling: Pooling::None,
            intervals,
            start_time: T::zero(),
            time: Timing { max: time_max, target: time_max, penalty: T::zero() },
            domain,
            separation: None,
            agents,
            sensors,
            terms,
            regions: &[],
            limits: &[],
        }
    }
}
