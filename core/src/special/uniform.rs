//! Temme's uniform asymptotic expansion of the regularised Gamma function about its middle.
//!
//! `Q(a, x) = erfc(η sqrt(a/2))/2 + w B(η)` defines `B = Σ b_n η^n`. Differentiating with respect to η gives
//! `η B = B'/a + g(η) - Γ*(a)` with `g = η / (x/a - 1) = Σ g_n η^n`, hence
//!
//! `b_(n-1) = g_n + (n+1)/a b_(n+1)`.
//!
//! Run downward, this sums Temme's `Σ C_k(η) a^-k` over every k at once from the single row of g_n.
//!
//! Limits: a of at least 20, abs(η) up to 1, where cutting the row costs no more than 2e-15 of the smaller tail in `f64`
//! and 4e-8 in `f32` (`core/tools/special_tables.py --check`); the series would converge to abs(η) = 2 sqrt π.

use super::table::BULK;
use crate::math::Real;

const BULK_SINGLE: [f32; BULK.len()] = narrowed(&BULK);

/// Terms kept where `max(|η|, 2/sqrt a)` is at most the first entry: in single, in double precision.
const TERMS: [(f64, usize, usize); 4] =
    [(0.125, 6, 12), (0.25, 6, 14), (0.5, 8, 20), (f64::INFINITY, 12, BULK.len())];

/// `B(η)` for shape a.
#[inline]
pub(super) fn bulk<T: Real>(shape: T, eta: T) -> T {
    let step = T::one() / shape;
    let mut factor = T::from_count(terms(step, eta) + 1) * step;
    let (mut here, mut above, mut sum) = (T::zero(), T::zero(), T::zero());
    let row = BULK_SINGLE.iter().zip(&BULK).take(terms(step, eta));
    for (&single, &double) in row.rev() {
        let below = T::spelled(single, double) + factor * above;
        sum = sum * eta + below;
        above = here;
        here = below;
        factor -= step;
    }
    sum
}

/// How many g_n are read.
#[inline]
fn terms<T: Real>(inverse_shape: T, eta: T) -> usize {
    let square = (eta * eta).max(T::real(4.0) * inverse_shape);
    let mut kept = 0;
    for (reach, in_single, in_double) in TERMS {
        kept = if T::EPSILON.to_f64() > 1e-10 { in_single } else { in_double };
        if square <= T::real(reach * reach) {
            break;
        }
    }
    kept
}

/// The first `terms` coefficients, lowest power first, as a polynomial in `variable`.
#[inline]
pub(super) fn polynomial<T: Real, const TERMS: usize>(
    single: &[f32; TERMS],
    double: &[f64; TERMS],
    terms: usize,
    variable: T,
) -> T {
    let mut sum = T::zero();
    for (&single, &double) in single.iter().zip(double).take(terms).rev() {
        sum = sum * variable + T::spelled(single, double);
    }
    sum
}

/// A table in single precision, rounded while compiling.
pub(super) const fn narrowed<const TERMS: usize>(double: &[f64; TERMS]) -> [f32; TERMS] {
    let mut single = [0.0; TERMS];
    let mut index = 0;
    while index < TERMS {
        single[index] = double[index] as f32;
        index += 1;
    }
    single
}
