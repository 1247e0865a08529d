//! Covariance of the position estimate, from all ranging sensors.
//!
//! | symbol | name | unit | shape |
//! |---|---|---|---|
//! | sigma_j^2, w_j | `variance`, `weight` = 1 / variance | length unit squared | |
//! | f_j | `direction` = (r0 - y_j) / d(r0, y_j) | | `DIM` |
//! | m | weighted mean of the f_j | | `DIM` |
//! | J | information | 1 / length unit squared | `DIM` x `DIM` |
//! | P | covariance = (J + 1e-12 I)^-1 | length unit squared | `DIM` x `DIM` |
//!
//! (12) has the closed form J = sum w_j (f_j - m)(f_j - m)^T, O(sensors) instead of a tridiagonal inverse. It is
//! not formed: Gram-Schmidt on the weighted rows, those of the floor included, gives a unit lower triangle T and
//! pivots D with P = T^T D^-1 T. Pivots are sums of squares, never below the floor, so the determinant keeps its
//! sign and its digits where sensors lie almost in line.
//!
//! Derivatives, with g_j = P (f_j - m): d ln det P = - sum [w_j (f_j - m).g_j d ln w_j + 2 w_j g_j.df_j], and
//! d trace P = - sum [w_j |g_j|^2 d ln w_j + 2 w_j (P g_j).df_j]; the terms in dm vanish.
//!
//! Source: (11), (12), (14), (42), (53). Limits: variances are held between `1 / Real::LARGE` and `Real::LARGE`.

use crate::math::{Point, Real};
use crate::metrics::sample::{Derivative, Sample, Situation};
use crate::metrics::{Location, LocationAdjoint};
use crate::model::jamming::{Emitter, error_factor, pull_error_factor};
use crate::model::{dropout, ranging, soft_square};
use crate::scenario::{StoredSensor, View};

/// Added to the diagonal of the information matrix, 1 / length unit squared.
pub const INFO_FLOOR: f64 = 1e-12;

/// P, factored.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Covariance<T, const DIM: usize> {
    /// Rows of the unit lower triangle T.
    pub(super) rows: [Point<T, DIM>; DIM],
    /// Reciprocals of the pivots.
    pub(super) scales: Point<T, DIM>,
    location: Location<T>,
}

/// Who jams, and the softening of the distances to them.
pub(super) struct Jamming<'a, T, const DIM: usize> {
    pub emitters: &'a mut [Emitter<T, DIM>],
    pub softening: T,
}

impl<T: Real, const DIM: usize> Covariance<T, DIM> {
    /// What location errors are made of.
    pub(crate) fn location(&self) -> Location<T> {
        self.location
    }

    /// T^T D^-1 `residual`: P times the vector whose residual that is.
    #[inline]
    fn expand(&self, residual: &Point<T, DIM>) -> Point<T, DIM> {
        let scaled = residual.component_mul(&self.scales);
        let mut sum = Point::zeros();
        for (row, &component) in self.rows.iter().zip(scaled.iter()) {
            sum += row * component;
        }
        sum
    }

    /// P times `vector`.
    #[inline]
    fn times(&self, vector: &Point<T, DIM>) -> Point<T, DIM> {
        self.expand(&Point::from_fn(|index, _| self.rows.get(index).map_or(T::zero(), |row| row.dot(vector))))
    }
}

/// Fills in the location part of the samples; `None` where there are not more ranging sensors than dimensions.
pub(super) fn forward<T: Real, const DIM: usize>(
    situation: &Situation<T, DIM>,
    sensors: &[StoredSensor<T, DIM>],
    samples: &mut [Sample<T, DIM>],
    emitters: &[Emitter<T, DIM>],
    softening: T,
) -> Option<Covariance<T, DIM>> {
    let pairs = sensors.iter().zip(samples.iter());
    if pairs.filter(|(sensor, _)| sensor.ranging.is_some()).count() <= DIM {
        return None;
    }
    let (quieting, _) = dropout::variance_factor(situation.dropout);
    let (mut weight_sum, mut variance_sum) = (T::zero(), T::zero());
    for (sensor, sample) in sensors.iter().zip(samples.iter_mut()) {
        let Some(model) = &sensor.ranging else {
            // No weight, and so no part in any sum.
            (sample.weight, sample.variance) = (T::zero(), T::zero());
            sample.residual = Point::zeros();
            continue;
        };
        let plain = ranging::variance(model, sample.square);
        sample.jam_factor = if emitters.is_empty() || sensor.jam.error_gain == T::zero() {
            T::one()
        } else {
            error_factor(emitters, &sample.place, &sensor.jam, softening)
        };
        let variance = plain.value * sample.jam_factor * quieting;
        let held = variance.clamp_to(T::one() / T::LARGE, T::LARGE);
        sample.moves = if held == variance { T::one() } else { T::zero() };
        sample.variance = held;
        sample.weight = T::one() / held;
        sample.variance_slope = plain.slope;
        let (offset, square) = match situation.reference {
            None => (sample.offset, sample.square),
            Some(reference) => {
                let offset = reference - sample.place;
                (offset, soft_square(&offset, softening))
            }
        };
        sample.nearness = T::one() / square.sqrt();
        sample.direction = offset * sample.nearness;
        sample.residual = sample.direction;
        weight_sum += sample.weight;
        variance_sum += held;
    }
    let samples = samples.get_mut(..sensors.len().min(samples.len())).unwrap_or_default();
    Some(factor(samples, weight_sum, variance_sum))
}

/// What location errors are made of, to the digits that a lattice needs, in one pass over the sensors; `None` where there are
/// not more ranging sensors than dimensions.
///
/// The reference point is the position, as it is for a lattice. Directions are taken from the first one, so that what cancels is no more than their spread about it; a pivot that is all
/// rounding is held at the floor.
pub(super) fn rough<T: Real, const DIM: usize>(
    scenario: &View<'_, T, DIM>,
    situation: &Situation<T, DIM>,
    emitters: &[Emitter<T, DIM>],
    sensors_max: usize,
) -> Option<Location<T>> {
    let softening = scenario.frame.softening;
    let (quieting, _) = dropout::variance_factor(situation.dropout);
    let (mut count, mut weight_sum, mut variance_sum) = (0, T::zero(), T::zero());
    let (mut from, mut mean) = (Point::<T, DIM>::zeros(), Point::<T, DIM>::zeros());
    let mut rows = [Point::<T, DIM>::zeros(); DIM];
    for sensor in scenario.sensors.iter().take(sensors_max) {
        let Some(model) = &sensor.ranging else { continue };
        let place = scenario.sensor_state(sensor, situation.time).0;
        let offset = situation.position - place;
        let square = soft_square(&offset, softening);
        let mut variance = ranging::variance(model, square).value * quieting;
        if !emitters.is_empty() && sensor.jam.error_gain != T::zero() {
            variance *= error_factor(emitters, &place, &sensor.jam, softening);
        }
        let variance = variance.clamp_to(T::one() / T::LARGE, T::LARGE);
        let weight = T::one() / variance;
        let direction = offset / square.sqrt();
        if count == 0 {
            from = direction;
        }
        let aside = direction - from;
        for k in 0..DIM {
            let weighted = aside[k] * weight;
            mean[k] += weighted;
            for l in 0..=k {
                rows[k][l] += weighted * aside[l];
            }
        }
        count += 1;
        weight_sum += weight;
        variance_sum += variance;
    }
    if count <= DIM {
        return None;
    }
    for k in 0..DIM {
        for l in 0..=k {
            rows[k][l] -= mean[k] * mean[l] / weight_sum;
        }
    }
    Some(located(rows, variance_sum))
}

/// Gram-Schmidt on the weighted columns 1, f_x, f_y .., the rows of the floor below them: takes the mean out of the
/// residuals, then each column out of those after it.
///
/// Twice: a sensor that outweighs all others has a residual that is at first the rounding of the mean and little
/// else, and the derivatives multiply it by its weight. The second round leaves it with digits of its own.
#[inline]
fn factor<T: Real, const DIM: usize>(
    samples: &mut [Sample<T, DIM>],
    weight_sum: T,
    variance_sum: T,
) -> Covariance<T, DIM> {
    let floor = T::real(INFO_FLOOR);
    let mut rows = [Point::<T, DIM>::zeros(); DIM];
    let mut pivots = Point::<T, DIM>::zeros();
    // The first mean of a column depends on no other: all at once.
    let mut means = Point::<T, DIM>::zeros();
    for sample in samples.iter() {
        means += sample.residual * sample.weight;
    }
    means /= weight_sum;
    for sample in samples.iter_mut() {
        sample.residual -= means;
    }
    for l in 0..DIM {
        rows[l][l] = T::one();
        for round in 0..2 {
            if round > 0 {
                let mut mean = T::zero();
                for sample in samples.iter() {
                    mean += sample.weight * sample.residual[l];
                }
                mean /= weight_sum;
                for sample in samples.iter_mut() {
                    sample.residual[l] -= mean;
                }
            }
            for k in 0..l {
                let mut product = floor * rows[k].dot(&rows[l]);
                for sample in samples.iter() {
                    product += sample.weight * sample.residual[k] * sample.residual[l];
                }
                let share = product / pivots[k];
                for sample in samples.iter_mut() {
                    let earlier = sample.residual[k];
                    sample.residual[l] -= share * earlier;
                }
                let earlier = rows[k];
                rows[l] -= earlier * share;
            }
        }
        let mut pivot = floor * crate::math::norm_squared(&rows[l]);
        for sample in samples.iter() {
            pivot += sample.weight * sample.residual[l].squared();
        }
        pivots[l] = pivot;
    }
    let scales = pivots.map(|pivot| T::one() / pivot);
    let mut trace = T::zero();
    for (row, &scale) in rows.iter().zip(scales.iter()) {
        trace += crate::math::norm_squared(row) * scale;
    }
    Covariance { rows, scales, location: Location { trace, ln_det: -ln_product(&pivots), variance_sum } }
}

/// What location errors are made of, from the lower triangle of the information matrix, factored as T D T^T.
#[expect(clippy::needless_range_loop, reason = "rows and columns by the letters of the equations")]
fn located<T: Real, const DIM: usize>(mut rows: [Point<T, DIM>; DIM], variance_sum: T) -> Location<T> {
    let mut pivots = Point::<T, DIM>::zeros();
    // Rows of T^-1.
    let mut inverse = [Point::<T, DIM>::zeros(); DIM];
    let mut trace = T::zero();
    for k in 0..DIM {
        let mut pivot = rows[k][k];
        for l in 0..k {
            let mut entry = rows[k][l];
            for m in 0..l {
                entry -= rows[k][m] * rows[l][m] * pivots[m];
            }
            rows[k][l] = entry / pivots[l];
            pivot -= rows[k][l] * entry;
        }
        pivots[k] = pivot.max(T::real(INFO_FLOOR));
        inverse[k][k] = T::one();
        for l in 0..k {
            for m in l..k {
                let part = rows[k][m] * inverse[m][l];
                inverse[k][l] -= part;
            }
        }
        trace += crate::math::norm_squared(&inverse[k]) / pivots[k];
    }
    Location { trace, ln_det: -ln_product(&pivots), variance_sum }
}

/// Logarithm of the product, through single logarithms only where the product could leave the range.
#[inline]
fn ln_product<T: Real, const DIM: usize>(pivots: &Point<T, DIM>) -> T {
    let mut product = T::one();
    for &pivot in pivots.iter() {
        product *= pivot;
    }
    if product * T::LARGE > T::one() && product < T::LARGE {
        return product.ln();
    }
    let mut sum = T::zero();
    for &pivot in pivots.iter() {
        sum += pivot.ln();
    }
    sum
}

/// Adds the derivatives of the location figures: by d^2 into the samples, by all else into `derivative` and the
/// emitters.
pub(super) fn backward<T: Real, const DIM: usize>(
    covariance: &Covariance<T, DIM>,
    situation: &Situation<T, DIM>,
    sensors: &[StoredSensor<T, DIM>],
    samples: &mut [Sample<T, DIM>],
    jamming: Jamming<'_, T, DIM>,
    adjoint: &LocationAdjoint<T>,
    derivative: &mut Derivative<T, DIM>,
) {
    let by_det = adjoint.ln_det;
    let by_trace = adjoint.ln_trace / covariance.location.trace;
    let mut by_all = T::zero();
    let ranging = sensors.iter().zip(samples).filter(|(_, sample)| sample.weight > T::zero());
    for (sensor, sample) in ranging {
        let gain = covariance.expand(&sample.residual);
        let fit = sample.residual.component_mul(&covariance.scales).dot(&sample.residual);
        let mut by_ln_weight = by_det * fit;
        let mut by_direction = gain * by_det;
        if by_trace != T::zero() {
            by_ln_weight += by_trace * crate::math::norm_squared(&gain);
            by_direction += covariance.times(&gain) * by_trace;
        }
        // ln w_j = -ln sigma_j^2.
        let share = sample.variance / covariance.location.variance_sum;
        let by_ln_variance = (sample.weight * by_ln_weight + adjoint.ln_variance_sum * share) * sample.moves;
        by_direction *= -T::real(2.0) * sample.weight;
        let along = sample.direction.dot(&by_direction);
        let by_reference = (by_direction - sample.direction * along) * sample.nearness;
        derivative.reference += by_reference;
        sample.by_square += by_ln_variance * sample.variance_slope;
        by_all += by_ln_variance;
        let mut by_place = -by_reference;
        if !jamming.emitters.is_empty() && by_ln_variance != T::zero() {
            let coefficient = by_ln_variance / sample.jam_factor;
            by_place +=
                pull_error_factor(jamming.emitters, &sample.place, &sensor.jam, jamming.softening, coefficient);
        }
        if sensor.is_moving() {
            derivative.time += sample.by_time(&by_place);
        }
    }
    let (_, quieting_slope) = dropout::variance_factor(situation.dropout);
    derivative.dropout += by_all * quieting_slope;
}
