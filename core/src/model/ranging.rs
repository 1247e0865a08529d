//! Variance of a sensor's distance estimator, before jamming and dropout.
//!
//! | symbol | name | unit |
//! |---|---|---|
//! | d^2 | `square` | length unit squared |
//! | gamma | `path_loss` | |
//! | sigma_j^2 | `variance` | length unit squared |
//!
//! Received signal strength: sigma^2 = k d^(2 - 2 gamma). Time of arrival: sigma^2 = c1 d^gamma (1 + c2 d^gamma).
//!
//! Source: (6)-(10).

use crate::math::{Real, power};
use crate::scenario::Ranging;

/// A variance and how it grows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Variance<T> {
    /// sigma_j^2, length unit squared.
    pub value: T,
    /// Derivative of ln sigma_j^2 by d^2, 1 / length unit squared.
    pub slope: T,
}

/// Variance at the squared distance `square`. Source: (8), (10).
#[inline(always)]
#[must_use]
pub fn variance<T: Real>(ranging: &Ranging<T>, square: T) -> Variance<T> {
    match *ranging {
        Ranging::Rss { scale, path_loss } => {
            let exponent = T::one() - path_loss;
            Variance { value: scale * power(square, exponent), slope: exponent / square }
        }
        Ranging::Toa { c1, c2, path_loss } => {
            let half = path_loss * T::real(0.5);
            let loss = power(square, half);
            let growth = T::one() + c2 * loss;
            // d ln(growth) / d ln(loss) = 1 - 1 / growth, in this form finite where the loss is not.
            let slope = half * (T::real(2.0) - T::one() / growth) / square;
            Variance { value: c1 * loss * growth, slope }
        }
    }
}

/// Second derivative of ln sigma_j^2 by d^2, 1 / length unit to the fourth, where the first is `slope`.
#[inline]
#[must_use]
pub fn bend<T: Real>(ranging: &Ranging<T>, square: T, slope: T) -> T {
    let straight = -slope / square;
    match *ranging {
        Ranging::Rss { .. } => straight,
        Ranging::Toa { path_loss, .. } => {
            // The slope holds 1 / growth; d growth / d(d^2) = gamma / 2 (growth - 1) / d^2.
            let half = path_loss * T::real(0.5);
            let rest = T::real(2.0) - slope * square / half;
            straight + (half / square).squared() * rest * (T::one() - rest)
        }
    }
}
