//! Second derivatives of the combined probabilities of detection and of a false alarm.
//!
//! Both are 1 less the product of the sensors' 1 - s_j, s_j = (1 - theta) p_j. The product is carried as a jet, so that
//! a sensor with s_j = 1 needs no division; the value itself is summed as s + s_j (1 - s), as elsewhere.
//!
//! Source: (19), (27), (54).

use super::{Variables, axes, square};
use crate::jet::{Jet, unit};
use crate::math::Real;
use crate::metrics::sample::{Sample, Situation};
use crate::model::betrayal::betrayed_jet;
use crate::model::detector::{self, Probability};
use crate::scenario::{Betrayal, StoredSensor, View};

/// One less the product so far.
struct Union<T, const M: usize> {
    value: T,
    missed: Jet<T, M>,
}

impl<T: Real, const M: usize> Union<T, M> {
    #[inline]
    fn new() -> Self {
        Self { value: T::zero(), missed: Jet::constant(T::one()) }
    }

    #[inline(always)]
    fn include(&mut self, share: &Jet<T, M>) {
        self.value += share.value * (T::one() - self.value);
        let missed = &mut self.missed;
        let kept = T::one() - share.value;
        // In place, what has the most derivatives first: it needs the others as they were.
        for a in 0..M {
            for b in a..M {
                missed.hessian[a][b] = missed.hessian[a][b] * kept
                    - missed.value * share.hessian[a][b]
                    - missed.gradient[a] * share.gradient[b]
                    - share.gradient[a] * missed.gradient[b];
            }
        }
        for a in 0..M {
            missed.gradient[a] = missed.gradient[a] * kept - missed.value * share.gradient[a];
        }
        missed.value *= kept;
    }

    #[inline]
    fn into_jet(self) -> Jet<T, M> {
        let mut jet = self.missed.affine(-T::one(), T::one());
        jet.value = self.value;
        jet
    }
}

#[inline(always)]
pub(super) fn detected<T: Real, const DIM: usize, const M: usize>(
    scenario: &View<'_, T, DIM>,
    situation: &Situation<T, DIM>,
    samples: &[Sample<T, DIM>],
    variables: &Variables,
) -> Jet<T, M> {
    let is_common = M == DIM && *variables == Variables::POSITION && situation.betrayal == Betrayal::None;
    if is_common && !cfg!(feature = "compact") {
        return detected_at(scenario, situation, samples);
    }
    let (heard, dropout) = (T::one() - situation.dropout, unit(variables.dropout));
    let level = Jet::variable(situation.level, variables.level);
    let axes = axes(variables);
    let mut union = Union::new();
    let pooling = &scenario.frame.pooling;
    for (sensor, sample) in scenario.sensors.iter().zip(samples) {
        let Some(model) = sensor.detection.as_ref().filter(|detection| !pooling.takes(detection)) else {
            continue;
        };
        let square = square(sample, &axes);
        let Probability { value, slope, bend } = detector::detection(model, sample.square);
        let silent = square.chain(value, slope, bend);
        let loud = match situation.betrayal {
            Betrayal::None => silent,
            other => betrayed_jet(other, &sensor.jam, &silent, &level, &square),
        };
        let share = if variables.dropout.is_some() {
            loud.times_linear(heard, -T::one(), &dropout)
        } else {
            loud.affine(heard, T::zero())
        };
        union.include(&share);
    }
    union.into_jet()
}

/// The same by the position alone, without jamming: the common case, written out, so that it stays in registers.
#[inline(always)]
fn detected_at<T: Real, const DIM: usize, const M: usize>(
    scenario: &View<'_, T, DIM>,
    situation: &Situation<T, DIM>,
    samples: &[Sample<T, DIM>],
) -> Jet<T, M> {
    let (two, heard) = (T::real(2.0), T::one() - situation.dropout);
    let pooling = &scenario.frame.pooling;
    let mut union = Union::new();
    for (sensor, sample) in scenario.sensors.iter().zip(samples) {
        let Some(model) = sensor.detection.as_ref().filter(|detection| !pooling.takes(detection)) else {
            continue;
        };
        // d^2 has the derivatives 2 (x - y) and 2 I.
        let Probability { value, slope, bend } = detector::detection(model, sample.square);
        let (slope, bend) = (two * slope * heard, two * two * bend * heard);
        let mut share = Jet::constant(value * heard);
        let offset = &sample.offset;
        for a in 0..M.min(DIM) {
            share.gradient[a] = slope * offset[a];
            for b in a..M.min(DIM) {
                share.hessian[a][b] = bend * offset[a] * offset[b];
            }
            share.hessian[a][a] += slope;
        }
        union.include(&share);
    }
    union.into_jet()
}

/// A pool beside the sensors that decide for themselves.
pub(super) fn beside<T: Real, const DIM: usize, const M: usize>(
    alone: &Jet<T, M>,
    pool: &Jet<T, M>,
    situation: &Situation<T, DIM>,
    variables: &Variables,
) -> Jet<T, M> {
    let heard = Jet::variable(situation.dropout, variables.dropout).affine(-T::one(), T::one());
    let share = pool.times(&heard);
    let mut jet = alone.times(&share).affine(-T::one(), T::zero());
    jet.add(alone, T::one());
    jet.add(&share, T::one());
    jet.value = alone.value + share.value * (T::one() - alone.value);
    jet
}

#[inline(always)]
pub(super) fn alarmed<T: Real, const DIM: usize, const M: usize>(
    sensors: &[StoredSensor<T, DIM>],
    samples: &[Sample<T, DIM>],
    variables: &Variables,
) -> Jet<T, M> {
    let axes = axes(variables);
    let mut union = Union::new();
    for (sensor, sample) in sensors.iter().zip(samples) {
        if let Some(model) = &sensor.detection {
            let Probability { value, slope, bend } = detector::false_alarm(model, sample.square);
            union.include(&square(sample, &axes).chain(value, slope, bend));
        }
    }
    union.into_jet()
}
