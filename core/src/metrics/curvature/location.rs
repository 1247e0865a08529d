//! Second derivatives of what location errors are made of.
//!
//! | symbol | name | unit | shape |
//! |---|---|---|---|
//! | r_j = f_j - m | residual | | `DIM` |
//! | l_j = ln w_j, l_ja, l_jab | and its derivatives by variables a, b | | |
//! | f_ja | derivative of f_j | | `DIM` |
//! | g_ja = f_ja + l_ja r_j - m_a | m_a the weighted mean of f_ja + l_ja r_j | | `DIM` |
//!
//! With J = sum w_j r_j r_j^T and sum w_j r_j = 0, the derivatives of m drop out of the first derivative and leave the
//! second as a sum of squares about a mean:
//!
//! J_a = sum w_j (l_ja r_j r_j^T + f_ja r_j^T + r_j f_ja^T), and for a symmetric K
//!
//! tr(K J_ab) = sum w_j [(l_jab - l_ja l_jb) r_j.K r_j + 2 f_jab.K r_j + 2 g_ja.K g_jb].
//!
//! ln det P has the derivatives -tr(P J_a) and tr(P J_a P J_b) - tr(P J_ab); tr P has -tr(P^2 J_a) and
//! 2 tr(P^2 J_a P J_b) - tr(P^2 J_ab). All is done in the coordinates of the factorisation P = T^T D^-1 T, in which the
//! residuals are kept: they have digits of their own where one sensor outweighs the others. The squares about the mean
//! are summed as the mean moves from sensor to sensor (B. P. Welford, Technometrics 4, 1962), for the same reason.
//!
//! The second derivatives are summed for one combination of the three logarithms, as the caller weighs them.
//!
//! Source: (11), (12), (42), (53). Limits: squares about the mean and products of first derivatives cancel where a few
//! sensors outweigh the others by ten orders of magnitude in poor geometry; two or three digits may be all that is left
//! of the smaller second derivatives then (`core/tests/model_curvature.rs` counts them).

use super::{Focus, Variables, axes, square};
use crate::jet::{Axes, Jet, unit};
use crate::math::{Point, Real};
use crate::metrics::LocationAdjoint;
use crate::metrics::fisher::Covariance;
use crate::metrics::sample::{Sample, Situation};
use crate::model::jamming::{Emission, Emitter};
use crate::model::{dropout, ranging};
use crate::scenario::StoredSensor;

/// Derivatives of the three logarithms.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LocationJets<T, const M: usize> {
    /// Of ln trace P.
    pub ln_trace: [T; M],
    /// Of ln det P.
    pub ln_det: [T; M],
    /// Of the logarithm of the sum of the variances.
    pub ln_variance_sum: [T; M],
    /// Second derivatives of the weighted sum of the three, upper triangle.
    pub hessian: [[T; M]; M],
}

/// Sums over the sensors, in the coordinates of the factorisation.
struct Sums<T, const DIM: usize, const M: usize> {
    /// Weight so far, m_a, and the upper triangle of the second derivatives.
    weight: T,
    mean: [Point<T, DIM>; M],
    /// T J_a T^T.
    information: [[Point<T, DIM>; DIM]; M],
    /// Of the sum of the variances.
    variance: [T; M],
    hessian: [[T; M]; M],
}

/// One sensor's derivatives: ln w_j, T f_j.
struct Sensed<T, const DIM: usize, const M: usize> {
    ln_weight: Jet<T, M>,
    direction: [Point<T, DIM>; M],
}

/// What does not change from sensor to sensor.
pub(crate) struct Around<'a, T, const DIM: usize> {
    pub situation: &'a Situation<T, DIM>,
    pub emitters: &'a [Emitter<T, DIM>],
    pub softening: T,
    pub focus: &'a Focus,
}

/// How what a sensor sees depends on the variables.
struct Dependence<T, const DIM: usize, const M: usize> {
    /// Agent less sensor.
    offset: Axes<T, DIM, M>,
    /// Reference point less sensor; `None` where it does not vary.
    reference: Option<Axes<T, DIM, M>>,
    dropout: [T; M],
    /// Sensor less emitter, level and azimuth: of the emitter whose emission varies, and of others.
    emission: [Emission<T, DIM, M>; 2],
}

impl<T: Real, const DIM: usize, const M: usize> Dependence<T, DIM, M> {
    #[inline(always)]
    fn new(around: &Around<'_, T, DIM>) -> Self {
        let Focus { direct, emission, .. } = around.focus;
        let first = if around.situation.reference.is_some() { direct.reference } else { direct.position };
        let varies = first.is_some() || direct.time.is_some();
        let emission = [*emission, emission.shared()].map(|parts| Emission {
            axes: Axes::new(parts.position, -T::one(), parts.time),
            level: unit(parts.level),
            azimuth: unit(parts.azimuth),
        });
        Self {
            offset: axes(direct),
            reference: varies.then(|| Axes::new(first, T::one(), direct.time)),
            dropout: unit(direct.dropout),
            emission,
        }
    }
}

/// Whether a variable changes weights: with a reference point of its own, `APART`, that one's components, which come after those
/// of the position, do not.
const fn weighs<const DIM: usize, const APART: bool>(a: usize) -> bool {
    !APART || a < DIM || a >= 2 * DIM
}

/// Whether a variable changes directions: with a reference point of its own, the position does not.
const fn turns<const DIM: usize, const APART: bool>(a: usize) -> bool {
    !APART || a >= DIM
}

/// Derivatives of the logarithms, second ones weighed by `adjoint`; samples must be as the way forward left them.
///
/// `APART` promises that the first variables are the position, those after them a reference point of its own: what is zero then
/// is not computed.
#[inline(always)]
pub(crate) fn location<T: Real, const DIM: usize, const M: usize, const APART: bool>(
    covariance: &Covariance<T, DIM>,
    around: &Around<'_, T, DIM>,
    sensors: &[StoredSensor<T, DIM>],
    samples: &[Sample<T, DIM>],
    adjoint: &LocationAdjoint<T>,
) -> LocationJets<T, M> {
    let zero = T::zero();
    let location = covariance.location();
    let by_trace = adjoint.ln_trace / location.trace;
    let by_sum = adjoint.ln_variance_sum / location.variance_sum;
    let kernel = Kernel::new(covariance, adjoint.ln_det, by_trace);
    let dependence = Dependence::new(around);
    let mut sums = Sums {
        weight: zero,
        mean: [Point::zeros(); M],
        information: [[Point::zeros(); DIM]; M],
        variance: [zero; M],
        hessian: [[zero; M]; M],
    };
    for (sensor, sample) in sensors.iter().zip(samples) {
        if sample.weight > zero
            && let Some(model) = &sensor.ranging
        {
            let pull = kernel.times(&sample.residual);
            let bent = covariance.pulled(&pull);
            let ln_weight = ln_weight(sensor, model, sample, (around, &dependence));
            let mut sensed = Sensed { ln_weight, direction: [Point::zeros(); M] };
            let directions =
                directions::<_, _, _, APART>(covariance, sample, &dependence, &bent, &mut sensed.direction);
            sums.include::<APART>(sample, &sensed, &directions, &kernel, &pull, by_sum);
        }
    }
    sums.close(covariance, adjoint, by_trace, location.variance_sum)
}

/// K = `by_det` P + `by_trace` P^2 in the coordinates of the factorisation.
struct Kernel<T, const DIM: usize> {
    rows: [Point<T, DIM>; DIM],
}

impl<T: Real, const DIM: usize> Kernel<T, DIM> {
    #[inline(always)]
    #[expect(clippy::needless_range_loop, reason = "rows and columns by the letters of the equations")]
    fn new(covariance: &Covariance<T, DIM>, by_det: T, by_trace: T) -> Self {
        let mut rows = [Point::zeros(); DIM];
        for k in 0..DIM {
            for l in 0..DIM {
                rows[k][l] = by_trace * covariance.spread(k, l);
            }
            rows[k][k] += by_det * covariance.scales[k];
        }
        Self { rows }
    }

    #[inline(always)]
    fn times(&self, vector: &Point<T, DIM>) -> Point<T, DIM> {
        let mut product = Point::zeros();
        for k in 0..DIM {
            product[k] = self.rows[k].dot(vector);
        }
        product
    }
}

/// ln w_j = -ln sigma_j^2, derivatives only.
#[inline(always)]
fn ln_weight<T: Real, const DIM: usize, const M: usize>(
    sensor: &StoredSensor<T, DIM>,
    model: &crate::scenario::Ranging<T>,
    sample: &Sample<T, DIM>,
    (around, dependence): (&Around<'_, T, DIM>, &Dependence<T, DIM, M>),
) -> Jet<T, M> {
    let zero = T::zero();
    if sample.moves == zero {
        return Jet::constant(zero);
    }
    let bend = ranging::bend(model, sample.square, sample.variance_slope);
    let mut jet = square(sample, &dependence.offset).chain(zero, -sample.variance_slope, -bend);
    if around.focus.direct.dropout.is_some() {
        // d ln factor = s dtheta with s = 2 / (1 - theta), so that ds = s^2 / 2 dtheta.
        let (_, slope) = dropout::variance_factor(around.situation.dropout);
        for (a, varies) in dependence.dropout.iter().enumerate() {
            jet.gradient[a] -= slope * *varies;
            jet.hessian[a][a] -= T::real(0.5) * slope * slope * *varies;
        }
    }
    if !around.emitters.is_empty() && sensor.jam.error_gain != zero {
        let jammed = jam_factor(sensor, sample, (around, dependence));
        let reciprocal = T::one() / sample.jam_factor;
        jet.add(&jammed.chain(zero, reciprocal, -reciprocal.squared()), -T::one());
    }
    jet
}

/// The factor that all jamming puts on the variance.
fn jam_factor<T: Real, const DIM: usize, const M: usize>(
    sensor: &StoredSensor<T, DIM>,
    sample: &Sample<T, DIM>,
    (around, dependence): (&Around<'_, T, DIM>, &Dependence<T, DIM, M>),
) -> Jet<T, M> {
    let mut factor = Jet::constant(T::one());
    let [of_focus, of_others] = &dependence.emission;
    for emitter in around.emitters {
        let varied = emitter.agent == around.focus.emitter;
        let (parts, emission) =
            if varied { (around.focus.emission, of_focus) } else { (around.focus.emission.shared(), of_others) };
        if parts == Variables::default() || (!varied && emitter.level == T::zero()) {
            continue;
        }
        let seen = (&(sample.place - emitter.position), &sample.velocity);
        factor.add(&emitter.error_jet(emission, seen, &sensor.jam, around.softening), T::one());
    }
    factor
}

/// Writes T f_ja, and returns the second derivatives of f_j along `pull`.
///
/// With n = 1 / d(r0, y) and R_a the derivative of r0 - y: f_a = n (R_a - f (f.R_a)), and f_ab.k = n^2
/// [3 (f.k) (f.R_a) (f.R_b) - (f.R_a) (k.R_b) - (f.R_b) (k.R_a) - (f.k) (R_a.R_b)].
#[inline(always)]
fn directions<T: Real, const DIM: usize, const M: usize, const APART: bool>(
    covariance: &Covariance<T, DIM>,
    sample: &Sample<T, DIM>,
    dependence: &Dependence<T, DIM, M>,
    pull: &Point<T, DIM>,
    first: &mut [Point<T, DIM>; M],
) -> [[T; M]; M] {
    let mut second = [[T::zero(); M]; M];
    let Some(reference) = &dependence.reference else { return second };
    let columns = reference.columns(&-sample.velocity);
    let near = sample.nearness;
    let along_pull = sample.direction.dot(pull);
    let mut along = [T::zero(); M];
    let mut across = [T::zero(); M];
    for a in (0..M).filter(|&a| turns::<DIM, APART>(a)) {
        along[a] = sample.direction.dot(&columns[a]);
        across[a] = pull.dot(&columns[a]);
        let turned = columns[a] - sample.direction * along[a];
        first[a] = covariance.turned(&turned) * near;
    }
    let square = near * near;
    let three = T::real(3.0);
    for a in (0..M).filter(|&a| turns::<DIM, APART>(a)) {
        let by_along = (three * along_pull * along[a] - across[a]) * square;
        let by_across = -along[a] * square;
        let by_both = -along_pull * square;
        for b in a..M {
            second[a][b] = by_along * along[b] + by_across * across[b] + by_both * columns[a].dot(&columns[b]);
        }
    }
    second
}

impl<T: Real, const DIM: usize, const M: usize> Sums<T, DIM, M> {
    #[inline(always)]
    fn include<const APART: bool>(
        &mut self,
        sample: &Sample<T, DIM>,
        sensed: &Sensed<T, DIM, M>,
        directions: &[[T; M]; M],
        kernel: &Kernel<T, DIM>,
        pull: &Point<T, DIM>,
        by_sum: T,
    ) {
        let (residual, weight) = (&sample.residual, sample.weight);
        let slopes = &sensed.ln_weight.gradient;
        let before = self.weight;
        self.weight += weight;
        // The weight of a square about the mean, which moves by `share` of the way.
        let share = weight / self.weight;
        let about = T::real(2.0) * before * share;
        let fit = weight * residual.dot(pull);
        let of_variance = by_sum * sample.variance;
        let twice = T::real(2.0) * weight;
        let mut aside = [Point::<T, DIM>::zeros(); M];
        for a in 0..M {
            let direction = &sensed.direction[a];
            // w (l r r^T + f r^T + r f^T), the first one split between the other two.
            let (growth, both) = if !weighs::<DIM, APART>(a) {
                (*direction, *direction)
            } else if turns::<DIM, APART>(a) {
                (direction + residual * slopes[a], direction + residual * (T::real(0.5) * slopes[a]))
            } else {
                (residual * slopes[a], residual * (T::real(0.5) * slopes[a]))
            };
            if weighs::<DIM, APART>(a) {
                self.variance[a] -= sample.variance * slopes[a];
            }
            aside[a] = growth - self.mean[a];
            self.mean[a] += aside[a] * share;
            for k in 0..DIM {
                for l in k..DIM {
                    self.information[a][k][l] += weight * (both[k] * residual[l] + residual[k] * both[l]);
                }
            }
        }
        for a in 0..M {
            let pulled = kernel.times(&aside[a]) * about;
            for b in a..M {
                let mut bend = pulled.dot(&aside[b]);
                if weighs::<DIM, APART>(a) && weighs::<DIM, APART>(b) {
                    let squares = slopes[a] * slopes[b];
                    bend += (fit + of_variance) * (sensed.ln_weight.hessian[a][b] - squares);
                }
                if turns::<DIM, APART>(a) && turns::<DIM, APART>(b) {
                    bend += twice * directions[a][b];
                }
                self.hessian[a][b] -= bend;
            }
        }
    }

    /// Adds what the first derivatives leave to the second ones.
    #[inline(always)]
    fn close(
        mut self,
        covariance: &Covariance<T, DIM>,
        adjoint: &LocationAdjoint<T>,
        by_trace: T,
        variance_sum: T,
    ) -> LocationJets<T, M> {
        let zero = T::zero();
        let mut jets = LocationJets {
            ln_trace: [zero; M],
            ln_det: [zero; M],
            ln_variance_sum: [zero; M],
            hessian: self.hessian,
        };
        // D^-1 J_a, and S J_a with S = D^-1 T T^T D^-1.
        let mut scaled = [[Point::<T, DIM>::zeros(); DIM]; M];
        let mut spread = [[Point::<T, DIM>::zeros(); DIM]; M];
        for a in 0..M {
            for k in 0..DIM {
                for l in 0..k {
                    self.information[a][k][l] = self.information[a][l][k];
                }
            }
            for k in 0..DIM {
                scaled[a][k] = self.information[a][k] * covariance.scales[k];
                jets.ln_det[a] -= scaled[a][k][k];
                for l in 0..DIM {
                    spread[a][k] += self.information[a][l] * covariance.spread(k, l);
                }
                jets.ln_trace[a] -= spread[a][k][k];
            }
            jets.ln_trace[a] /= covariance.location().trace;
            jets.ln_variance_sum[a] = self.variance[a] / variance_sum;
        }
        for a in 0..M {
            for b in a..M {
                let (mut of_det, mut of_trace) = (zero, zero);
                for k in 0..DIM {
                    for l in 0..DIM {
                        of_det += scaled[a][k][l] * scaled[b][l][k];
                        of_trace += spread[a][k][l] * scaled[b][l][k] + spread[b][k][l] * scaled[a][l][k];
                    }
                }
                jets.hessian[a][b] += adjoint.ln_det * of_det + by_trace * of_trace
                    - adjoint.ln_trace * jets.ln_trace[a] * jets.ln_trace[b]
                    - adjoint.ln_variance_sum * jets.ln_variance_sum[a] * jets.ln_variance_sum[b];
            }
        }
        jets
    }
}

impl<T: Real, const DIM: usize> Covariance<T, DIM> {
    /// T `vector`.
    #[inline(always)]
    fn turned(&self, vector: &Point<T, DIM>) -> Point<T, DIM> {
        let mut turned = Point::zeros();
        for k in 0..DIM {
            turned[k] = self.rows[k].dot(vector);
        }
        turned
    }

    /// T^T `vector`.
    #[inline(always)]
    fn pulled(&self, vector: &Point<T, DIM>) -> Point<T, DIM> {
        let mut pulled = Point::zeros();
        for k in 0..DIM {
            pulled += self.rows[k] * vector[k];
        }
        pulled
    }

    /// An entry of D^-1 T T^T D^-1.
    #[inline(always)]
    fn spread(&self, k: usize, l: usize) -> T {
        self.scales[k] * self.rows[k].dot(&self.rows[l]) * self.scales[l]
    }
}
