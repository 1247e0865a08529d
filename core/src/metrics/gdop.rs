//! Geometric dilution of position.
//!
//! `gdop` = cep / sum over j of sigma_j^2, with jamming and dropout in the variances, and its logarithm. The
//! velocity of the signal is 1.
//!
//! Source: (18).

use crate::math::Real;
use crate::metrics::cep::{cep, log_cep};
use crate::metrics::{Location, LocationAdjoint};
use crate::scenario::Metric;

/// Geometric dilution of position, 1 / length unit.
#[inline]
pub fn gdop<T: Real>(location: &Location<T>) -> T {
    cep(location) / location.variance_sum
}

/// Logarithm of the geometric dilution of position.
#[inline]
pub fn log_gdop<T: Real>(location: &Location<T>) -> T {
    log_cep(location) - location.variance_sum.ln()
}

/// `coefficient` times the derivatives of either; of `gdop` for any other metric.
#[inline]
pub(crate) fn adjoint<T: Real>(metric: Metric, location: &Location<T>, coefficient: T) -> LocationAdjoint<T> {
    let scaled = if metric == Metric::LogGdop { coefficient } else { coefficient * gdop(location) };
    LocationAdjoint { ln_trace: T::real(0.5) * scaled, ln_det: T::zero(), ln_variance_sum: -scaled }
}
