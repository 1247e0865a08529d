//! The saddlepoint, the matched chi-square variable, and the derivatives at them.
//!
//! v solves k'(s) = y. 1/k' is a concave, rising function of v (a harmonic mean of the 1/lambda_i + v), so Newton's steps
//! from the left never pass the solution; bounds that the extreme eigenvalues give are kept on either side all the same,
//! and halved where a step leaves them or passes the pole.
//!
//! With p a figure of a part: r dr = s dy - dk/dp dp, 2 B dv = dk'/dp dp - dy, and
//! dP = W (-(r/w) dr + d(1/w - 1/r) - d(1/w_nu - 1/r)).

use super::remainders::Remainders;
use super::sums::{Gap, Sums, slope};
use super::{ByPart, Part, Shape, tilt_max};
use crate::math::Real;
use crate::special::chi_square_tail;

/// Newton's steps for the saddlepoint, halvings included.
const TILT_STEPS: usize = 80;
/// Newton's steps for the matched variable.
const MATCH_STEPS: usize = 12;

/// What derivatives need.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Saddlepoint<T> {
    unit: T,
    /// W of the parent module.
    peak: T,
    /// Derivative of P / W by r, at fixed 1/w - 1/r.
    by_root: T,
    sums: Sums<T>,
    gap: Gap<T>,
}

/// Saddlepoint and tail of parts whose largest eigenvalue is at most 1; the tail alone, 0 or 1,
/// where the tilt is above [`tilt_max`].
pub(super) fn solve<T: Real>(
    parts: impl Iterator<Item = Part<T>> + Clone,
    shape: &Shape<T>,
    unit: T,
    scaled: T,
) -> Result<(Saddlepoint<T>, T), T> {
    let coupled = T::real(f64::from(shape.least_degrees));
    let tilt = tilt(parts.clone(), shape, unit, scaled);
    if tilt > tilt_max() {
        return Err(T::one());
    }
    let sums = Sums::at(parts, coupled, tilt);
    let gap = sums.gap();
    let root = -tilt * gap.root_a;
    // The chi-square variable with nu degrees that has the same r.
    let count = T::real(f64::from(shape.degrees));
    let (ratio, excess) = matched(root, count);
    let base = Sums::single(count, ratio, excess).gap();
    let at = count * ratio;
    let tail = chi_square_tail(shape.degrees, at);
    let peak = tail.density * at * (T::real(2.0) / count).sqrt();
    // Along the matched variable dr/dv = -B / sqrt A.
    let base_by_root = -base.by_tilt * base.root_a / base.root_b.squared();
    let by_root = -gap.root_a / gap.root_b - base_by_root;
    let upper = tail.upper + peak * (gap.value - base.value);
    let saddlepoint = Saddlepoint { unit, peak, by_root, sums, gap };
    // Only in single precision, and far out, can a product leave the range.
    let figures = [upper, saddlepoint.density(), gap.by_tilt, by_root];
    if figures.into_iter().all(Real::finite) {
        Ok((saddlepoint, upper))
    } else {
        Err(if root > T::zero() { T::zero() } else { T::one() })
    }
}

/// v with k'(s) = `scaled`.
fn tilt<T: Real>(parts: impl Iterator<Item = Part<T>> + Clone, shape: &Shape<T>, unit: T, scaled: T) -> T {
    let one = T::one();
    let coupled = T::real(f64::from(shape.least_degrees));
    // Every eigenvalue is at most 1, the largest at least that of the largest diagonal entry.
    let mut low = coupled / scaled - unit / shape.diagonal_max;
    let mut high = T::real(f64::from(shape.degrees)) / scaled - one;
    // Where all weights are equal this is the solution: rounding must not leave it outside.
    high += T::real(8.0) * T::EPSILON * (one + high.abs());
    let mut at = low;
    for _ in 0..TILT_STEPS {
        let middle = low + T::real(0.5) * (high - low);
        let Some((first, second)) = slope(parts.clone(), coupled, at) else {
            low = low.max(at);
            at = middle;
            continue;
        };
        if first > scaled {
            low = low.max(at)
        } else {
            high = high.min(at)
        }
        let step = -first * (scaled - first) / (scaled * second);
        let next = at + step;
        // Well above the rounding of the sums, which must not be taken for a side; the last step squares it away.
        if step.abs() <= T::real(64.0) * T::EPSILON * (at.abs() + first / second) {
            return next;
        }
        at = if next >= low && next <= high { next } else { middle };
    }
    at
}

/// q and q - 1 with nu (q - 1 - ln q) = r^2, on the side of r.
fn matched<T: Real>(root: T, count: T) -> (T, T) {
    let (one, half) = (T::one(), T::real(0.5));
    let eta = root * (T::real(2.0) / count).sqrt();
    let level = half * eta * eta;
    if eta < -one {
        // ln q from below: the left-hand side is convex in it.
        let mut log = -one - level;
        for _ in 0..MATCH_STEPS {
            let ratio = log.exp();
            let step = (ratio - one - log - level) / (ratio - one);
            log -= step;
            if step.abs() <= T::EPSILON * log.abs() {
                break;
            }
        }
        let ratio = log.exp();
        return (ratio, ratio - one);
    }
    let mut excess = eta * (one + eta * (T::real(1.0 / 3.0) + eta * T::real(1.0 / 36.0)));
    for _ in 0..MATCH_STEPS {
        if excess == T::zero() {
            break;
        }
        // (u^2 f2 - level) (1 + u) / u, divided by u first: squares of small numbers underflow.
        let residual = excess * Remainders::of(excess).f2 - half * eta * (eta / excess);
        let step = residual * (one + excess);
        excess -= step;
        if step.abs() <= T::EPSILON * excess.abs() {
            break;
        }
    }
    (one + excess, excess)
}

impl<T: Real> Saddlepoint<T> {
    /// Minus the derivative of the tail by the threshold.
    pub(super) fn density(&self) -> T {
        // dr/dy = 1 / (2 sqrt A), dv/dy = -1 / (2 B).
        let Gap { root_a, root_b, by_tilt, .. } = self.gap;
        let half = T::real(0.5);
        self.peak * half * (by_tilt / root_b.squared() - self.by_root / root_a) / self.unit
    }

    /// Derivatives of the tail by weight and coupling of a part.
    pub(super) fn by_part(&self, part: &Part<T>) -> ByPart<T> {
        let (one, two, three, half) = (T::one(), T::real(2.0), T::real(3.0), T::real(0.5));
        let Sums { degrees, tilt, k, s1, s2, t2, t3, r3, .. } = self.sums;
        let (weight, c) = (part.weight / self.unit, part.coupling / self.unit);
        let count = T::real(f64::from(part.degrees));
        let i = one / (one + tilt * weight);
        let (i2, m) = (i * i, weight * i);
        // Derivatives of B and E by S1, k moving with it.
        let b_s1 = -tilt * k * k * (s2 * s2 * k + t3);
        let vt = tilt * t2;
        let e_s1 = k * k * (k * (s1 * s1 + vt * vt) - tilt * r3 + t2 * (two * k - one));
        let both = s2 * k * k;
        let by_coupling = Moves {
            exponent: -half * degrees * k * i,
            slope: degrees * (k * i2 - both * tilt * i),
            a: degrees * (both * i + k * m * i),
            b: degrees * (both * i2 + k * m * i2 + b_s1 * i),
            e: degrees * (e_s1 * i + both * m * i + k * m * m * i),
        };
        let vm = tilt * m;
        let by_weight = Moves {
            exponent: -half * (count * i - degrees * k * tilt * c * i2),
            slope: count * i2 + degrees * c * tilt * i2 * (both * tilt - two * k * i),
            a: count * m * i + degrees * c * k * i2 * (one - two * vm - tilt * k * s2),
            b: count * m * i2 + degrees * c * i2 * (k * i * (one - three * vm) - two * tilt * both * i - tilt * b_s1),
            e: count * m * m * i
                + degrees * c * i2 * (both * (one - two * vm) + k * m * (two - three * vm) - tilt * e_s1),
        };
        ByPart { weight: self.moved(&by_weight), coupling: self.moved(&by_coupling) }
    }

    fn moved(&self, moves: &Moves<T>) -> T {
        let Gap { root_a, root_b, by_a, by_b, by_e, by_tilt, .. } = self.gap;
        let root = moves.exponent / root_a;
        let tilt = moves.slope / (T::real(2.0) * root_b.squared());
        let gap = by_a * moves.a + by_b * moves.b + by_e * moves.e + by_tilt * tilt;
        self.peak * (self.by_root * root + gap) / self.unit
    }
}

/// Derivatives of k(s) / v, k'(s), A, B and E by a figure of a part.
struct Moves<T> {
    exponent: T,
    slope: T,
    a: T,
    b: T,
    e: T,
}
