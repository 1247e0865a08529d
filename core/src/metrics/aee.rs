//! Area of the 95 % error ellipse.
//!
//! `aee` = 23.964 pi sqrt(det P), length unit squared, and its logarithm. In three dimensions sqrt(det P) is a
//! volume (length unit cubed), and the constant is kept.
//!
//! Source: (16).

use crate::math::Real;
use crate::metrics::{Location, LocationAdjoint};
use crate::scenario::Metric;

/// The factor of (16).
pub const AEE_SCALE: f64 = 23.964 * core::f64::consts::PI;

/// ln [`AEE_SCALE`].
const LOG_AEE_SCALE: f64 = 4.321_282_590_071_078;

/// Area of the 95 % error ellipse, length unit squared.
#[inline]
pub fn aee<T: Real>(location: &Location<T>) -> T {
    T::real(AEE_SCALE) * (T::real(0.5) * location.ln_det).exp()
}

/// Logarithm of the area of the 95 % error ellipse.
#[inline]
pub fn log_aee<T: Real>(location: &Location<T>) -> T {
    T::real(LOG_AEE_SCALE) + T::real(0.5) * location.ln_det
}

/// `coefficient` times the derivatives of either; of `aee` for any other metric.
#[inline]
pub(crate) fn adjoint<T: Real>(metric: Metric, location: &Location<T>, coefficient: T) -> LocationAdjoint<T> {
    let half = T::real(0.5);
    let by_ln_det = if metric == Metric::LogAee { half } else { half * aee(location) };
    LocationAdjoint { ln_det: coefficient * by_ln_det, ..LocationAdjoint::default() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logarithm_of_the_scale_is_that_of_the_scale() {
        assert!((libm::log(AEE_SCALE) - LOG_AEE_SCALE).abs() < 1e-15);
    }
}
