//! Intermittent communication: what reduced transmit power does to the sensors.
//!
//! | symbol | name | unit |
//! |---|---|---|
//! | theta | `dropout` | 0 .. 1, 1 is silence |
//!
//! Variances are divided by max(1 - theta, [`THETA_FLOOR`])^2; the probability of detection is (1 - theta) p_j.
//! The paper's text gives theta both meanings; (53) and (54) decide.
//!
//! Source: (50)-(54).

use crate::math::Real;

/// Smallest share of the transmit power that variances are divided by.
pub const THETA_FLOOR: f64 = 1e-3;

/// The factor that dropout puts on every variance, and the derivative of its logarithm by theta.
#[inline]
#[must_use]
pub fn variance_factor<T: Real>(dropout: T) -> (T, T) {
    let floor = T::real(THETA_FLOOR);
    let power = T::one() - dropout;
    if power > floor {
        (T::one() / power.squared(), T::real(2.0) / power)
    } else {
        (T::one() / floor.squared(), T::zero())
    }
}
