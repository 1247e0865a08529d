//! Tail probabilities: the chi-square tail of (23), the Gaussian tail of (24), and their derivatives.
//!
//! | name      | symbol   | unit | meaning                                                        |
//! |-----------|----------|------|----------------------------------------------------------------|
//! | degrees   | N        | 1    | degrees of freedom: the signals a sensor takes to decide       |
//! | t         | t        | 1    | test statistic, in units of the noise variance                 |
//! | shape     | a = N/2  | 1    | shape of the regularised Gamma function                        |
//! | point     | x = t/2  | 1    | its argument                                                   |
//! | ratio     | x/a      | 1    | 1 in the middle of the distribution                            |
//! | eta       | η        | 1    | sign(x - a) sqrt(2 (x/a - 1 - ln(x/a)))                        |
//! | deviance  | a η²/2   | 1    | minus the logarithm of the density over its peak, but for 1/x  |
//! | weight    | w        | 1    | exp(-a η²/2) / (sqrt(2πa) Γ*(a)), Γ* the Stirling correction   |
//!
//! `Q_N(t) = Q(a, x) = Γ(a, x) / Γ(a)` for odd and even N, and `-dQ_N/dt = w a / t`. (23) is not summed as
//! printed: at N = 2000 its powers and factorials overflow. Everything here is the weight, which holds all that is
//! very large or small, times a sum of moderate size:
//!
//! | where                       | sum                                                              | at most  |
//! |-----------------------------|------------------------------------------------------------------|----------|
//! | N ≥ 40, abs(η) ≤ 1          | `Q = erfc(η sqrt(a/2))/2 + w B(η)`, Temme's expansion: `uniform` | 28 terms |
//! | N ≥ 40, η > 1               | `Q = w a/x (1 + (a-1)/x + (a-1)(a-2)/x² + ..)`: `finite_sum`     | 42 terms |
//! | N < 40, x ≥ a/2 (or a)      | the same, and `erfc(sqrt x)` for odd N                           | 19 terms |
//! | below those                 | `1 - Q = w (1 + x/(a+1) + x²/((a+1)(a+2)) + ..)`: `finite_sum`   | 47 terms |
//!
//! (The logarithms change at x = a, so that the smaller tail is the one summed.)
//!
//! Within nine standard deviations of the middle the expansion takes 12 terms from N = 10400 up, 14 from N = 2600
//! up and 20 from N = 650 up; in `f32` 6, 6, 8 and 12 terms take the place of 12, 14, 20 and 28. Besides, a tail costs
//! three square roots, one exponential, one complementary error function, and a logarithm where x/a is outside
//! 1/2 .. 2. The coefficients were derived for this module by `core/tools/special_tables.py`.
//!
//! Limits: `degrees` 0 is read as 1. The weight carries the rounding of its exponent, so the relative error of a tail
//! grows with its logarithm. Worst relative errors over 1105 points from N = 1 to 40960, against 60-digit arithmetic
//! (`cargo test -p quietpath-core --test chi_square_tail -- --nocapture`):
//!
//! | precision | tails and density from 1 down to | upper   | lower   | density | logarithms |
//! |-----------|----------------------------------|---------|---------|---------|------------|
//! | `f64`     | 1e-300                           | 2.4e-13 | 1.7e-13 | 2.5e-13 | 2.7e-13    |
//! | `f32`     | 1e-20                            | 1.1e-5  | 7.2e-6  | 1.3e-5  | 1.0e-5     |
//! | `f32`     | 1e-3                             | 1.4e-6  | 8.4e-7  | 1.5e-6  | 1.2e-6     |
//!
//! Weighted sums of chi-square variables, for pooled sensors, are in [`weighted_chi_square_tail`].
//!
//! Sources: (23), (24); N. M. Temme, "The asymptotic expansion of the incomplete gamma functions", SIAM J. Math.
//! Anal. 10 (1979); C. Loader, "Fast and accurate computation of binomial probabilities" (2000), for the deviance.

mod deviance;
mod finite_sum;
mod gaussian;
#[rustfmt::skip]
mod table;
mod uniform;
mod weighted_chi_square;

use crate::math::Real;
use deviance::Deviance;
pub use gaussian::gaussian_tail;
use gaussian::scaled_erfc;
pub use weighted_chi_square::{ByPart, Part, WeightedTail, weighted_chi_square_tail};

/// Degrees of freedom from which Temme's expansion holds in the middle.
const UNIFORM_FROM: u32 = 40;
/// The largest magnitude of eta for which Temme's expansion is summed.
const UNIFORM_ETA_MAX: f64 = 1.0;

/// An upper tail probability and how fast it falls.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tail<T> {
    /// Probability that the statistic exceeds t, 0 to 1.
    pub upper: T,
    /// The probability density at t: minus the derivative of `upper` with respect to t, never negative.
    pub density: T,
}

/// Both tails as natural logarithms, which do not underflow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LnTail<T> {
    /// Logarithm of the probability that the statistic exceeds t.
    pub ln_upper: T,
    /// Logarithm of the probability that it does not.
    pub ln_lower: T,
}

/// How the tails at a point are summed.
enum Method {
    /// Temme's expansion about the middle.
    Uniform,
    /// The upper tail, downward from its largest power.
    Upper,
    /// The lower tail, upward.
    Lower,
}

/// `Q_N(t)`, the probability that a chi-square variable with `degrees` degrees of freedom exceeds `t`, and its density.
///
/// `t` at or below 0 gives `upper` 1 and `density` 0, the derivative from the left; infinite `t` gives 0 and 0; NaN
/// gives NaN. Source: (23).
#[must_use]
pub fn chi_square_tail<T: Real>(degrees: u32, t: T) -> Tail<T> {
    let (zero, one) = (T::zero(), T::one());
    let half = T::real(0.5);
    let point = half * t;
    if t.is_not_a_number() {
        return Tail { upper: t, density: t };
    }
    if point <= zero {
        return Tail { upper: one, density: zero };
    }
    if !point.finite() {
        return Tail { upper: zero, density: zero };
    }
    let at = Deviance::new(degrees.max(1), point);
    let weight = at.weight();
    // From half the shape up the few multiplications of the upper sum are cheaper than the divisions of the lower one;
    // below, 1 less the lower tail rounds better.
    let upper = match method(&at, half * at.shape) {
        Method::Uniform => half * at.normal_deviate().erfc() + weight * uniform::bulk(at.shape, at.eta),
        Method::Upper => {
            let powers = weight * (at.shape / point) * finite_sum::upper(at.degrees, point);
            if at.ends_in_erfc() { powers + point.sqrt().erfc() } else { powers }
        }
        Method::Lower => one - weight * finite_sum::lower(at.shape, point),
    };
    Tail { upper: upper.clamp_to(zero, one), density: weight * at.shape / t }
}

/// `ln Q_N(t)` and `ln(1 - Q_N(t))`, however far out `t` is.
///
/// `t` at or below 0 gives 0 and minus infinity; infinite `t` gives minus infinity and 0; NaN gives NaN. Source: (23).
#[must_use]
pub fn ln_chi_square_tail<T: Real>(degrees: u32, t: T) -> LnTail<T> {
    let (zero, half) = (T::zero(), T::real(0.5));
    let point = half * t;
    if t.is_not_a_number() {
        return LnTail { ln_upper: t, ln_lower: t };
    }
    if point <= zero {
        return LnTail { ln_upper: zero, ln_lower: -T::INFINITY };
    }
    if !point.finite() {
        return LnTail { ln_upper: -T::INFINITY, ln_lower: zero };
    }
    let at = Deviance::new(degrees.max(1), point);
    // The smaller tail is summed; the larger one is what it leaves of 1.
    let smaller = match method(&at, at.shape) {
        Method::Uniform => {
            let side = if at.eta < zero { -T::one() } else { T::one() };
            let normal = half * scaled_erfc(at.normal_deviate().abs());
            (normal + side * at.peak_weight() * uniform::bulk(at.shape, at.eta)).ln() - at.deviance
        }
        Method::Upper => {
            let powers = (at.shape / point) * finite_sum::upper(at.degrees, point);
            let sum = if at.ends_in_erfc() { powers + at.erfc_over_weight() } else { powers };
            sum.ln() + at.ln_weight()
        }
        Method::Lower => finite_sum::lower(at.shape, point).ln() + at.ln_weight(),
    };
    let larger = (-smaller.exp().min(T::one())).ln_1p();
    if at.eta < zero {
        LnTail { ln_upper: larger, ln_lower: smaller }
    } else {
        LnTail { ln_upper: smaller, ln_lower: larger }
    }
}

/// Outside the expansion, the lower tail is summed where the point is below `lower_below` or N is large.
#[inline]
fn method<T: Real>(at: &Deviance<T>, lower_below: T) -> Method {
    let large = at.degrees >= UNIFORM_FROM;
    if large && at.eta.abs() <= T::real(UNIFORM_ETA_MAX) {
        Method::Uniform
    } else if (large && at.eta < T::zero()) || at.point < lower_below {
        Method::Lower
    } else {
        Method::Upper
    }
}
