//! The figures of merit of one agent at one node: how surely it is detected, how well it is located.
//!
//! | symbol | name | unit | shape |
//! |---|---|---|---|
//! | r0 | reference point | length unit | `DIM` |
//! | P | covariance of the position estimate | length unit squared | `DIM` x `DIM` |
//! | E1, E2, E3 | `cep2`, `aee`, `gdop` | length unit squared, same (3-D: cubed), 1 / length unit | |
//! | p, q | `detection`, `false_alarm` | | |
//!
//! `sample::forward` computes the values from all sensors' figures, which stay in the caller's
//! [`Sample`]s; `sample::backward` goes the same way back with one coefficient a figure, so that all
//! terms of an objective share one pass. Both cost O(sensors) a node.
//!
//! Source: section 2.3. Limits: location errors need more ranging sensors than dimensions.

pub mod aee;
pub mod cep;
pub(crate) mod curvature;
pub mod detection;
pub mod false_alarm;
pub mod fisher;
pub mod gdop;
pub mod pooled;
mod sample;

pub use curvature::Variables;
pub use sample::Sample;
pub(crate) use sample::{Digits, Situation, backward, figures, forward, place};

use crate::math::Real;
use crate::scenario::{Limit, Metric};

/// What all location errors are made of.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Location<T> {
    /// trace P, length unit squared.
    pub trace: T,
    /// ln det P, P in length units squared.
    pub ln_det: T,
    /// Sum of sigma_j^2 with jamming and dropout, length unit squared.
    pub variance_sum: T,
}

/// All figures of one agent at one node; those not asked for are zero or `None`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Values<T> {
    /// Combined probability of detection, (19).
    pub detection: T,
    /// Combined probability of a false alarm, (27).
    pub false_alarm: T,
    /// Location errors, where there are enough ranging sensors.
    pub location: Option<Location<T>>,
}

impl<T: Real> Values<T> {
    /// The value of a metric; `None` for a location error without enough ranging sensors.
    #[must_use]
    pub fn get(&self, metric: Metric) -> Option<T> {
        let location = self.location.as_ref();
        match metric {
            Metric::Detection => Some(self.detection),
            Metric::FalseAlarm => Some(self.false_alarm),
            Metric::Cep2 => location.map(cep::cep2),
            Metric::Cep => location.map(cep::cep),
            Metric::Aee => location.map(aee::aee),
            Metric::Gdop => location.map(gdop::gdop),
            Metric::LogCep2 => location.map(cep::log_cep2),
            Metric::LogCep => location.map(cep::log_cep),
            Metric::LogAee => location.map(aee::log_aee),
            Metric::LogGdop => location.map(gdop::log_gdop),
        }
    }
}

/// Which groups of figures are wanted; the others are not computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Needs {
    /// The combined probability of detection.
    pub detection: bool,
    /// The combined probability of a false alarm.
    pub false_alarm: bool,
    /// Location errors.
    pub location: bool,
}

impl Needs {
    pub(crate) const ALL: Self = Self { detection: true, false_alarm: true, location: true };

    /// What the limits of a scenario need to know.
    pub(crate) fn of_limits<T>(limits: &[Limit<T>]) -> Self {
        Self::of(limits.iter().map(|limit| limit.metric))
    }

    /// The groups that some metrics belong to.
    pub(crate) fn of(metrics: impl IntoIterator<Item = Metric>) -> Self {
        let mut needs = Self::default();
        metrics.into_iter().for_each(|metric| needs.add(metric));
        needs
    }

    /// Adds the group that a metric belongs to.
    pub fn add(&mut self, metric: Metric) {
        match metric {
            Metric::Detection => self.detection = true,
            Metric::FalseAlarm => self.false_alarm = true,
            _ => self.location = true,
        }
    }

    pub(crate) fn nothing(self) -> bool {
        self == Self::default()
    }
}

/// Derivatives of an objective by the figures of one agent at one node.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Adjoint<T> {
    pub detection: T,
    pub false_alarm: T,
    pub location: LocationAdjoint<T>,
}

/// Derivatives by the logarithms of what location errors are made of.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LocationAdjoint<T> {
    /// By ln trace P.
    pub ln_trace: T,
    /// By ln det P.
    pub ln_det: T,
    /// By the logarithm of the sum of the variances.
    pub ln_variance_sum: T,
}

impl<T: Real> Adjoint<T> {
    /// Adds `coefficient` times the derivatives of `metric`.
    pub(crate) fn add(&mut self, metric: Metric, coefficient: T, values: &Values<T>) {
        let added = match (metric, &values.location) {
            (Metric::Detection, _) => {
                self.detection += coefficient;
                return;
            }
            (Metric::FalseAlarm, _) => {
                self.false_alarm += coefficient;
                return;
            }
            (_, None) => return,
            (Metric::Cep2 | Metric::Cep | Metric::LogCep2 | Metric::LogCep, Some(location)) => {
                cep::adjoint(metric, location, coefficient)
            }
            (Metric::Aee | Metric::LogAee, Some(location)) => aee::adjoint(metric, location, coefficient),
            (Metric::Gdop | Metric::LogGdop, Some(location)) => gdop::adjoint(metric, location, coefficient),
        };
        self.location.ln_trace += added.ln_trace;
        self.location.ln_det += added.ln_det;
        self.location.ln_variance_sum += added.ln_variance_sum;
    }
}
