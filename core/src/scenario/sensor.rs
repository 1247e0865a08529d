//! Sensors: where they are, how well they range and detect, and what jamming does to them.
//!
//! | symbol | name | unit | shape |
//! |---|---|---|---|
//! | y_j | `position`, `track` | scenario length unit | `DIM` |
//!
//! Source: sections 2.3 and 3.1. Limits: a track is piecewise linear.

use crate::math::{Point, Real};

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

/// Where a stored sensor is: a position, or a range of the scenario's knots.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum StoredMotion<T, const DIM: usize> {
    Fixed(Point<T, DIM>),
    Track { first: usize, count: usize },
    Steady(Sighting<T, DIM>),
}

/// A sensor, as a [`Scenario`](super::Scenario) holds it.
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

/// Piecewise linear interpolation, held before the first and after the last entry.
pub(super) fn track_state<T: Real, const DIM: usize>(
    knots: &[Knot<T, DIM>],
    time: T,
) -> (Point<T, DIM>, Point<T, DIM>) {
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
