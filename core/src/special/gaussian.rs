//! The Gaussian tail of (24) and the scaled complementary error function.
//!
//! `Q(s) = erfc(s/sqrt 2)/2`, and `scaled_erfc(z) = exp(z²) erfc(z)`, which does not underflow.
//!
//! Limits: the scaled function for z not below 0.

use super::Tail;
use crate::math::Real;

/// z from which the scaled function is summed asymptotically.
const ASYMPTOTIC_FROM: f64 = 8.0;
/// Terms of that sum at most; at z = 8 the sixteenth is below the rounding of `f64`.
const ASYMPTOTIC_TERMS: usize = 17;

/// The probability that a standard normal variable exceeds `s`, and its density. Source: (24).
///
/// NaN gives NaN.
#[must_use]
pub fn gaussian_tail<T: Real>(s: T) -> Tail<T> {
    let half = T::real(0.5);
    let density = (-half * s * s).exp() / (T::PI + T::PI).sqrt();
    Tail { upper: half * (s * half.sqrt()).erfc(), density }
}

/// `exp(z²) erfc(z)` for z ≥ 0.
#[inline]
pub(super) fn scaled_erfc<T: Real>(z: T) -> T {
    if z < T::real(ASYMPTOTIC_FROM) {
        return (z * z).exp() * z.erfc();
    }
    // 1/(z sqrt π) Σ (-1)^n (2n-1)!! / (2z²)^n
    let step = T::one() / (z * z);
    let mut factor = T::real(0.5) * step;
    let (mut term, mut sum) = (T::one(), T::one());
    for _ in 0..ASYMPTOTIC_TERMS {
        term *= -factor;
        sum += term;
        factor += step;
        if term.abs() <= T::EPSILON {
            break;
        }
    }
    sum / (z * T::PI.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scaled_erfc_is_continuous_where_the_sum_takes_over() {
        let (below, above) = (scaled_erfc(8.0_f64.next_down()), scaled_erfc(8.0_f64));
        assert!((below - above).abs() < 4e-14 * above, "{below} {above}");
        let (below, above) = (scaled_erfc(8.0_f32.next_down()), scaled_erfc(8.0_f32));
        assert!((below - above).abs() < 2e-5 * above, "{below} {above}");
    }

    #[test]
    fn gaussian_tail_at_the_middle_and_at_one_standard_deviation() {
        assert_eq!(gaussian_tail(0.0_f64).upper, 0.5);
        // mpmath: erfc(1/sqrt(2))/2 and exp(-1/2)/sqrt(2 pi)
        let tail = gaussian_tail(1.0_f64);
        assert!((tail.upper - 0.158_655_253_931_457_05).abs() < 1e-16);
        assert!((tail.density - 0.241_970_724_519_143_37).abs() < 1e-16);
    }
}
