//! Probability that at least one sensor gives a false alarm.
//!
//! q = 1 - product over j of (1 - q_j), summed as q + q_j (1 - q) so that small probabilities keep their digits.
//! Jamming and dropout do not enter. The derivative by q_j is the product over the others.
//!
//! Source: (27), (28).

use crate::math::Real;
use crate::metrics::sample::Sample;
use crate::model::detector;
use crate::scenario::StoredSensor;

/// Fills in the false-alarm part of the samples and returns the combined probability.
#[inline]
pub(super) fn forward<T: Real, const DIM: usize>(
    sensors: &[StoredSensor<T, DIM>],
    samples: &mut [Sample<T, DIM>],
) -> T {
    let mut combined = T::zero();
    let mut quiet = T::one();
    for (sensor, sample) in sensors.iter().zip(samples) {
        let Some(detection) = &sensor.detection else {
            continue;
        };
        let alarm = detector::false_alarm(detection, sample.square);
        sample.alarm = alarm.value;
        sample.alarm_slope = alarm.slope;
        sample.quiet_before = quiet;
        quiet *= T::one() - alarm.value;
        combined += alarm.value * (T::one() - combined);
    }
    combined
}

/// Adds `coefficient` times the derivatives by d^2 into the samples.
#[inline]
pub(super) fn backward<T: Real, const DIM: usize>(
    sensors: &[StoredSensor<T, DIM>],
    samples: &mut [Sample<T, DIM>],
    coefficient: T,
) {
    let mut quiet_after = T::one();
    let seen = sensors.len().min(samples.len());
    let (sensors, samples) = (sensors.get(..seen).unwrap_or_default(), samples.get_mut(..seen).unwrap_or_default());
    for (sensor, sample) in sensors.iter().zip(samples).rev() {
        if sensor.detection.is_none() {
            continue;
        }
        sample.by_square += coefficient * sample.quiet_before * quiet_after * sample.alarm_slope;
        quiet_after *= T::one() - sample.alarm;
    }
}
