//! Second derivatives of the figures of merit of one agent at one node.
//!
//! | symbol | name | unit | shape |
//! |---|---|---|---|
//! | x, r0 | position, reference point | length unit | `DIM` |
//! | z, alpha, theta | jamming level, azimuth, dropout | 0 .. 1, rad, 0 .. 1 | |
//! | t | node time, where sensors move | s | |
//!
//! [`Variables`] says which of these vary and where each stands among the `M` variables. Detection and false alarm
//! are carried forward as jets; location errors need the factored covariance first, and get their second
//! derivatives in one more pass over the sensors (`location`).
//!
//! Limits: a node's time moves the sensors of all agents; an agent's level, azimuth and position enter the location
//! errors of all.

mod detection;
mod location;
mod pooled;

pub(crate) use location::{Around, LocationJets, location};

use crate::jet::{Axes, Jet};
use crate::math::Real;
use crate::metrics::sample::{Sample, Situation};
use crate::scenario::{Pooling, View};

/// Where the parts of one agent stand among the variables of a Jet; `None` for those that are constant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Variables {
    /// First component of the position x_i; the others follow.
    pub position: Option<usize>,
    /// First component of r0 = x_(i-1), where the reference point lags; nothing depends on it elsewhere.
    pub reference: Option<usize>,
    /// Jamming level z_i.
    pub level: Option<usize>,
    /// Jamming azimuth alpha_i.
    pub azimuth: Option<usize>,
    /// Dropout theta_i.
    pub dropout: Option<usize>,
    /// Node time t_i.
    pub time: Option<usize>,
}

impl Variables {
    /// The position alone.
    pub const POSITION: Self =
        Self { position: Some(0), reference: None, level: None, azimuth: None, dropout: None, time: None };

    /// Those that the direct figures of another agent depend on.
    pub(crate) const fn shared(self) -> Self {
        Self { position: None, reference: None, level: None, azimuth: None, dropout: None, time: self.time }
    }
}

/// What the figures are derived by.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Focus {
    /// What varies of the agent whose figures these are.
    pub direct: Variables,
    /// The agent whose emission varies.
    pub emitter: usize,
    /// What varies of that emission.
    pub emission: Variables,
}

/// Combined probability of detection, (19), and its derivatives; samples must have been placed.
#[inline]
pub(crate) fn detection<T: Real, const DIM: usize, const M: usize>(
    scenario: &View<'_, T, DIM>,
    situation: &Situation<T, DIM>,
    samples: &mut [Sample<T, DIM>],
    variables: &Variables,
) -> Jet<T, M> {
    let alone = detection::detected(scenario, situation, samples, variables);
    if scenario.frame.pooling == Pooling::None {
        return alone;
    }
    let pool = pooled::pooled(pooled::Figure::Detection, scenario, samples, variables);
    detection::beside(&alone, &pool, situation, variables)
}

/// Combined probability of a false alarm, (27), and its derivatives; samples must have been placed.
#[inline]
pub(crate) fn false_alarm<T: Real, const DIM: usize, const M: usize>(
    scenario: &View<'_, T, DIM>,
    samples: &mut [Sample<T, DIM>],
    variables: &Variables,
) -> Jet<T, M> {
    if scenario.frame.pooling != Pooling::None {
        return pooled::pooled(pooled::Figure::FalseAlarm, scenario, samples, variables);
    }
    detection::alarmed(scenario.sensors, samples, variables)
}

/// Of an agent less a sensor, x - y_j(t).
#[inline(always)]
fn axes<T: Real, const DIM: usize, const M: usize>(variables: &Variables) -> Axes<T, DIM, M> {
    Axes::new(variables.position, T::one(), variables.time)
}

/// d^2 of a sensor; `axes` are those of agent less sensor.
#[inline(always)]
fn square<T: Real, const DIM: usize, const M: usize>(sample: &Sample<T, DIM>, axes: &Axes<T, DIM, M>) -> Jet<T, M> {
    axes.square(&sample.offset, &-sample.velocity, sample.square)
}
