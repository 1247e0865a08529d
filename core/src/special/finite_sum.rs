//! The sums away from the middle: (23) from its largest term down, and the power series of the lower tail.
//!
//! All terms are positive, so nothing cancels, and the first term is 1, so nothing overflows.
//!
//! Limits: for N of 40 and more, abs(η) above 1, where the terms fall at least as 0.43^n.

use crate::math::Real;

/// Terms of the upper tail at most; the slowest, N = 40960 at η = 1, needs 42.
const UPPER_TERMS: u32 = 64;
/// Terms of the lower tail at most; the slowest, N = 39 at x = a, needs 47.
const LOWER_TERMS: u32 = 64;

/// `1 + (a-1)/x + (a-1)(a-2)/x² + ..` with `floor(N/2)` terms, or as many as count.
///
/// x of at least a/2 where N is below 40; x above 2.3 a elsewhere.
#[inline]
pub(super) fn upper<T: Real>(degrees: u32, point: T) -> T {
    let step = T::one() / point;
    // (a - n) / x for n = 1, 2, ..
    let mut factor = T::real(0.5) * T::from_count(degrees as usize) * step - step;
    let (mut term, mut sum) = (T::one(), T::zero());
    for _ in 0..(degrees / 2).min(UPPER_TERMS) {
        sum += term;
        term *= factor;
        factor -= step;
        if term <= T::EPSILON * sum {
            break;
        }
    }
    sum
}

/// `1 + x/(a+1) + x²/((a+1)(a+2)) + ..`, x not above a.
#[inline]
pub(super) fn lower<T: Real>(shape: T, point: T) -> T {
    let (mut term, mut sum, mut divisor) = (T::one(), T::one(), shape);
    for _ in 0..LOWER_TERMS {
        divisor += T::one();
        term *= point / divisor;
        sum += term;
        if term <= T::EPSILON * sum {
            break;
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The sum and how many terms of it count, each term over the last being `factor(n)`.
    fn counted(most: u32, factor: impl Fn(u32) -> f64) -> (f64, u32) {
        let (mut term, mut sum, mut count) = (1.0, 0.0, 0);
        for n in 1..=most {
            if term > f64::EPSILON * sum {
                count = n;
            }
            sum += term;
            term *= factor(n);
        }
        (sum, count)
    }

    #[test]
    fn named_bounds_cover_the_slowest_sums() {
        // x/a - 1 - ln(x/a) = 1/2 at 2.3577: eta = 1.
        let point = 20_480.0 * 2.3577;
        let (sum, count) = counted(500, |n| (20_480.0 - f64::from(n)) / point);
        assert_eq!(count, 42);
        assert!(count < UPPER_TERMS && (upper(40_960, point) / sum - 1.0).abs() < 1e-15);
        let (sum, count) = counted(500, |n| 19.5 / (19.5 + f64::from(n)));
        assert_eq!(count, 47);
        assert!(count < LOWER_TERMS && (lower(19.5, 19.5) / sum - 1.0).abs() < 1e-15);
    }
}
