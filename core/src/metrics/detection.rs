//! Probability that at least one sensor detects the agent.
//!
//! | symbol | name | unit |
//! |---|---|---|
//! | p_j | probability of one sensor, with what jamming adds | |
//! | theta | dropout | 0 .. 1 |
//!
//! p = 1 - product over j of (1 - (1 - theta) p_j), summed as p + s (1 - p) so that small probabilities keep their
//! digits. The derivative by p_j is the product over the others, from products before and after j: dividing by
//! 1 - p_j would fail where p_j is 1.
//!
//! Sensors that pool their signals are left out here: [`crate::metrics::pooled`].
//!
//! Source: (19), (54).

use crate::math::Real;
use crate::metrics::sample::{Sample, Situation};
use crate::model::betrayal::{Betrayed, betrayed};
use crate::model::{detector, soft_square};
use crate::scenario::{Betrayal, Pooling, StoredSensor, View};

/// The combined probability alone, which is what [`forward`] returns: that also keeps what the way back needs.
#[inline]
pub(super) fn value<T: Real, const DIM: usize>(
    scenario: &View<'_, T, DIM>,
    situation: &Situation<T, DIM>,
    sensors_max: usize,
) -> T {
    let heard = T::one() - situation.dropout;
    let softening = scenario.frame.softening;
    let mut combined = T::zero();
    for sensor in scenario.sensors.iter().take(sensors_max) {
        let Some(detection) = &sensor.detection else { continue };
        let place = scenario.sensor_state(sensor, situation.time).0;
        let square = soft_square(&(situation.position - place), softening);
        let silent = detector::detection(detection, square).value;
        let loud = match situation.betrayal {
            Betrayal::None => silent,
            other => betrayed(other, &sensor.jam, silent, situation.level, square).probability,
        };
        combined += heard * loud * (T::one() - combined);
    }
    combined
}

/// Fills in the detection part of the samples and returns the combined probability.
#[inline]
pub(super) fn forward<T: Real, const DIM: usize>(
    pooling: &Pooling<T>,
    situation: &Situation<T, DIM>,
    sensors: &[StoredSensor<T, DIM>],
    samples: &mut [Sample<T, DIM>],
) -> T {
    let heard = T::one() - situation.dropout;
    let mut combined = T::zero();
    let mut missed = T::one();
    for (sensor, sample) in sensors.iter().zip(samples) {
        let Some(detection) = sensor.detection.as_ref().filter(|detection| !pooling.takes(detection)) else {
            continue;
        };
        let silent = detector::detection(detection, sample.square);
        let loud = match situation.betrayal {
            Betrayal::None => Betrayed {
                probability: silent.value,
                by_probability: T::one(),
                by_level: T::zero(),
                by_square: T::zero(),
            },
            other => betrayed(other, &sensor.jam, silent.value, situation.level, sample.square),
        };
        sample.probability = loud.probability;
        sample.probability_slope = silent.slope * loud.by_probability + loud.by_square;
        sample.probability_by_level = loud.by_level;
        sample.missed_before = missed;
        let share = heard * loud.probability;
        missed *= T::one() - share;
        combined += share * (T::one() - combined);
    }
    combined
}

/// Adds `coefficient` times the derivatives: by d^2 into the samples; returns those by jamming level and dropout.
#[inline]
pub(super) fn backward<T: Real, const DIM: usize>(
    pooling: &Pooling<T>,
    situation: &Situation<T, DIM>,
    sensors: &[StoredSensor<T, DIM>],
    samples: &mut [Sample<T, DIM>],
    coefficient: T,
) -> (T, T) {
    let heard = T::one() - situation.dropout;
    let (mut by_level, mut by_dropout) = (T::zero(), T::zero());
    let mut missed_after = T::one();
    let seen = sensors.len().min(samples.len());
    let (sensors, samples) = (sensors.get(..seen).unwrap_or_default(), samples.get_mut(..seen).unwrap_or_default());
    for (sensor, sample) in sensors.iter().zip(samples).rev() {
        if sensor.detection.as_ref().is_none_or(|detection| pooling.takes(detection)) {
            continue;
        }
        let by_share = coefficient * sample.missed_before * missed_after;
        let by_probability = by_share * heard;
        sample.by_square += by_probability * sample.probability_slope;
        by_level += by_probability * sample.probability_by_level;
        by_dropout -= by_share * sample.probability;
        missed_after *= T::one() - heard * sample.probability;
    }
    (by_level, by_dropout)
}
