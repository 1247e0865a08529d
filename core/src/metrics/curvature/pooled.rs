//! Second derivatives of the probabilities of a pool of sensors.
//!
//! With q_j = d_j^2, p_ab = sum p_j q_j,ab + sum_i (d p_i along q_,b) q_i,a. Value and gradient are exact. The change of the
//! p_i along a variable is a difference of fourth order of the exact p_i: every p_i depends on every q_j, through a saddlepoint,
//! and four visits a variable cost no more than the third derivatives of its exponent would.
//!
//! Limits: in `f64` second derivatives are within 1e-5 of their own size (`core/tests/model_curvature.rs`, N up to 400). In `f32` steps
//! are long, and second derivatives coarse.

use super::{Variables, axes, square};
use crate::jet::{Axes, Jet};
use crate::math::Real;
use crate::metrics::pooled::{detection, false_alarm, pools};
use crate::metrics::sample::Sample;
use crate::model::soft_square;
use crate::scenario::{StoredSensor, View};

/// Points and weights of the difference.
const DIFFERENCE: [(f64, f64); 4] = [(-2.0, 1.0 / 12.0), (-1.0, -2.0 / 3.0), (1.0, 2.0 / 3.0), (2.0, -1.0 / 12.0)];

/// Which probability of a pool.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Figure {
    Detection,
    FalseAlarm,
}

impl Figure {
    fn visit<T: Real, const DIM: usize>(self, scenario: &View<'_, T, DIM>, samples: &mut [Sample<T, DIM>]) -> T {
        match self {
            Self::Detection => detection(&scenario.frame.pooling, scenario.sensors, samples),
            Self::FalseAlarm => false_alarm(&scenario.frame.pooling, scenario.sensors, samples),
        }
    }

    fn slope<T: Real, const DIM: usize>(self, sample: &Sample<T, DIM>) -> T {
        match self {
            Self::Detection => sample.probability_slope,
            Self::FalseAlarm => sample.alarm_slope,
        }
    }
}

/// The pool's probability and its derivatives; samples must have been placed, and are left so.
#[inline(never)]
pub(super) fn pooled<T: Real, const DIM: usize, const M: usize>(
    figure: Figure,
    scenario: &View<'_, T, DIM>,
    samples: &mut [Sample<T, DIM>],
    variables: &Variables,
) -> Jet<T, M> {
    let value = figure.visit(scenario, samples);
    let axes = axes(variables);
    let mut jet: Jet<T, M> = Jet::constant(T::zero());
    for sample in members(scenario.sensors, samples) {
        jet.add(&square(sample, &axes), figure.slope(sample));
    }
    jet.value = value;
    for b in 0..M {
        // Relative to the sensor whose distance changes fastest.
        let mut pace = T::zero();
        for sample in members(scenario.sensors, samples) {
            pace = pace.max(rate(sample, &axes, b).abs() / sample.square);
        }
        if pace == T::zero() {
            continue;
        }
        let step = T::EPSILON.sqrt().sqrt() / pace;
        for (steps, weight) in DIFFERENCE {
            for sample in members(scenario.sensors, samples) {
                let base = soft_square(&sample.offset, scenario.frame.softening);
                sample.square = base + T::real(steps) * step * rate(sample, &axes, b);
            }
            figure.visit(scenario, samples);
            let factor = T::real(weight) / step;
            for sample in members(scenario.sensors, samples) {
                for a in 0..=b {
                    jet.hessian[a][b] += factor * figure.slope(sample) * rate(sample, &axes, a);
                }
            }
        }
        for sample in members(scenario.sensors, samples) {
            sample.square = soft_square(&sample.offset, scenario.frame.softening);
        }
    }
    jet
}

/// Samples of the sensors in the pool.
fn members<'a, T: Real, const DIM: usize>(
    sensors: &'a [StoredSensor<T, DIM>],
    samples: &'a mut [Sample<T, DIM>],
) -> impl Iterator<Item = &'a mut Sample<T, DIM>> {
    sensors.iter().zip(samples).filter(|(sensor, _)| pools(sensor)).map(|(_, sample)| sample)
}

/// q_,a = 2 (x - y) . d(x - y)/du_a.
fn rate<T: Real, const DIM: usize, const M: usize>(sample: &Sample<T, DIM>, axes: &Axes<T, DIM, M>, a: usize) -> T {
    square(sample, axes).gradient.get(a).copied().unwrap_or_default()
}
