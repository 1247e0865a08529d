//! Where a point lies in the distribution, with no cancellation: Loader's deviance form of the density.
//!
//! `x^a e^-x / Γ(a+1) = w = exp(-deviance - ln Γ*(a)) / sqrt(2πa)` with `deviance = a (μ - ln(1+μ))`, `μ = x/a - 1`
//! and `Γ*(a) = Γ(a) / (sqrt(2π/a) (a/e)^a)`. The factors of the left-hand side overflow long before their
//! product matters; the exponent on the right is small wherever the density is not.
//!
//! Limits: a of at least 1/2, x positive and finite.

use super::gaussian::scaled_erfc;
use super::table::{ATANH, LN_GAMMA_STAR, STIRLING};
use super::{UNIFORM_FROM, uniform};
use crate::math::Real;

const ATANH_SINGLE: [f32; ATANH.len()] = uniform::narrowed(&ATANH);
const LN_GAMMA_STAR_SINGLE: [f32; LN_GAMMA_STAR.len()] = uniform::narrowed(&LN_GAMMA_STAR);
const STIRLING_SINGLE: [f32; STIRLING.len()] = uniform::narrowed(&STIRLING);

/// `v²` up to which the short artanh series suffices.
const SHORT_SQUARE_MAX: f64 = 0.01;
/// `v²` up to which the long one does: x/a from 1/2 to 2.
const LONG_SQUARE_MAX: f64 = 1.0 / 9.0;

/// A point and the parts of its weight; names as in the parent module.
pub(super) struct Deviance<T> {
    pub(super) degrees: u32,
    pub(super) shape: T,
    pub(super) point: T,
    pub(super) ratio: T,
    pub(super) eta: T,
    pub(super) deviance: T,
    /// `ln Γ*(a)`.
    stirling: T,
}

impl<T: Real> Deviance<T> {
    /// `degrees` of at least 1, `point` positive and finite.
    #[inline]
    pub(super) fn new(degrees: u32, point: T) -> Self {
        let shape = T::real(0.5) * T::from_count(degrees as usize);
        let excess = (point - shape) / shape;
        let ratio = point / shape;
        let unit = excess_less_log(excess, ratio);
        let magnitude = (unit + unit).sqrt();
        let eta = if excess < T::zero() { -magnitude } else { magnitude };
        Self { degrees, shape, point, ratio, eta, deviance: shape * unit, stirling: ln_gamma_star(degrees, shape) }
    }

    /// `η sqrt(a/2)`, the argument of the complementary error function.
    #[inline]
    pub(super) fn normal_deviate(&self) -> T {
        let magnitude = self.deviance.sqrt();
        if self.eta < T::zero() { -magnitude } else { magnitude }
    }

    #[inline]
    pub(super) fn weight(&self) -> T {
        (-(self.deviance + self.stirling)).exp() / self.root()
    }

    /// The weight less its factor `exp(-deviance)`.
    #[inline]
    pub(super) fn peak_weight(&self) -> T {
        (-self.stirling).exp() / self.root()
    }

    #[inline]
    pub(super) fn ln_weight(&self) -> T {
        -(self.deviance + self.stirling) - self.root().ln()
    }

    /// For odd N the descending powers end in `erfc(sqrt x)`, which counts only where they are few.
    #[inline]
    pub(super) fn ends_in_erfc(&self) -> bool {
        self.degrees < UNIFORM_FROM && !self.degrees.is_multiple_of(2)
    }

    /// `erfc(sqrt x) / w` for x not below a.
    ///
    /// `deviance - x = -a (1 + ln(x/a))`, written so that nothing cancels for large x.
    #[inline]
    pub(super) fn erfc_over_weight(&self) -> T {
        let exponent = self.stirling - self.shape * (T::one() + self.ratio.ln());
        exponent.exp() * self.root() * scaled_erfc(self.point.sqrt())
    }

    /// `sqrt(2πa)`.
    #[inline]
    fn root(&self) -> T {
        ((T::PI + T::PI) * self.shape).sqrt()
    }
}

/// `μ - ln(1+μ)` to full relative precision, from μ and 1 + μ.
///
/// With `v = μ/(2+μ)`, `ln(1+μ) = 2 artanh v` and `μ - 2v = μ v`, so the cancelling terms never appear.
#[inline]
fn excess_less_log<T: Real>(excess: T, ratio: T) -> T {
    let v = excess / (excess + T::real(2.0));
    let square = v * v;
    if square > T::real(LONG_SQUARE_MAX) || !square.finite() {
        return excess - ratio.ln();
    }
    let single = T::EPSILON.to_f64() > 1e-10;
    let terms = match (square <= T::real(SHORT_SQUARE_MAX), single) {
        (true, true) => 3,
        (false, true) => 7,
        (true, false) => 7,
        (false, false) => ATANH.len(),
    };
    let series = uniform::polynomial(&ATANH_SINGLE, &ATANH, terms, square);
    excess * v - T::real(2.0) * v * square * series
}

/// `ln Γ*(a)`: from a table below the cutover, from Stirling's series above.
#[inline]
fn ln_gamma_star<T: Real>(degrees: u32, shape: T) -> T {
    if degrees < UNIFORM_FROM {
        let index = (degrees as usize).saturating_sub(1);
        let entry = LN_GAMMA_STAR_SINGLE.get(index).zip(LN_GAMMA_STAR.get(index));
        return entry.map_or(T::zero(), |(&single, &double)| T::spelled(single, double));
    }
    let inverse = T::one() / shape;
    inverse * uniform::polynomial(&STIRLING_SINGLE, &STIRLING, STIRLING.len(), inverse * inverse)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn series_and_logarithm_agree_where_they_meet() {
        for ratio in [0.5_f64, 0.8181, 0.8182, 1.2222, 1.2223, 2.0] {
            let direct = ratio - 1.0 - libm::log(ratio);
            let series = excess_less_log(ratio - 1.0, ratio);
            assert!((series - direct).abs() < 4e-15 * direct, "{ratio}: {series} {direct}");
        }
    }

    #[test]
    fn stirling_table_continues_into_the_series() {
        // ln Γ*(a) - ln Γ*(a+1) = (a + 1/2) ln(1 + 1/a) - 1, across the cutover.
        let (below, above) = (19.5_f64, 20.5_f64);
        let step = (below + 0.5) * libm::log1p(1.0 / below) - 1.0;
        let difference = ln_gamma_star::<f64>(39, below) - ln_gamma_star::<f64>(41, above);
        assert!((difference - step).abs() < 1e-14, "{difference} {step}");
    }
}
