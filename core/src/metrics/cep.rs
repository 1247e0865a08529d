//! Circular error probable.
//!
//! `cep2` = trace P (length unit squared, E1), `cep` = its root (length unit), and their logarithms.
//!
//! Source: (11), section 2.3.1.

use crate::math::Real;
use crate::metrics::{Location, LocationAdjoint};
use crate::scenario::Metric;

/// trace P, length unit squared.
#[inline]
pub fn cep2<T: Real>(location: &Location<T>) -> T {
    location.trace
}

/// Root of trace P, length unit.
#[inline]
pub fn cep<T: Real>(location: &Location<T>) -> T {
    location.trace.sqrt()
}

/// ln trace P.
#[inline]
pub fn log_cep2<T: Real>(location: &Location<T>) -> T {
    location.trace.ln()
}

/// Half of ln trace P.
#[inline]
pub fn log_cep<T: Real>(location: &Location<T>) -> T {
    T::real(0.5) * location.trace.ln()
}

/// `coefficient` times the derivatives of one of the four; of `cep` for any other metric.
#[inline]
pub(crate) fn adjoint<T: Real>(metric: Metric, location: &Location<T>, coefficient: T) -> LocationAdjoint<T> {
    let half = T::real(0.5);
    let by_ln_trace = match metric {
        Metric::Cep2 => location.trace,
        Metric::LogCep2 => T::one(),
        Metric::LogCep => half,
        _ => half * cep(location),
    };
    LocationAdjoint { ln_trace: coefficient * by_ln_trace, ..LocationAdjoint::default() }
}
