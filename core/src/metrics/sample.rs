//! One node's worth of work: every sensor's figures, there and back.
//!
//! | symbol | name | unit | shape |
//! |---|---|---|---|
//! | x | `position` | length unit | `DIM` |
//! | r0 | `reference` | length unit | `DIM` |
//! | y_j | `place` | length unit | `DIM` |
//! | d^2 | `square` | length unit squared | |

use crate::math::{Point, Real, origin};
use crate::metrics::{Adjoint, Needs, Values, detection, false_alarm, fisher, pooled};
use crate::model::jamming::Emitter;
use crate::model::soft_square;
use crate::scenario::{Betrayal, Pooling, StoredSensor, View};

/// Scratch for one sensor: its figures at the node that is being worked on.
///
/// Callers own a slice of these, one a sensor, and need not know what is inside.
#[derive(Clone, Copy, Debug)]
pub struct Sample<T, const DIM: usize> {
    pub(super) place: Point<T, DIM>,
    pub(super) velocity: Point<T, DIM>,
    pub(super) offset: Point<T, DIM>,
    pub(super) square: T,
    /// Derivative by d^2, collected on the way back.
    pub(super) by_square: T,
    // Location: sigma_j^2, its reciprocal, d ln sigma^2 / d(d^2), the jamming factor, and 0 where sigma^2 is held.
    pub(super) variance: T,
    pub(super) weight: T,
    pub(super) variance_slope: T,
    pub(super) jam_factor: T,
    pub(super) moves: T,
    // f_j, its residual in the factorisation, and 1 / d(r0, y_j).
    pub(super) direction: Point<T, DIM>,
    pub(super) residual: Point<T, DIM>,
    pub(super) nearness: T,
    // Detection and false alarm.
    pub(super) probability: T,
    pub(super) probability_slope: T,
    pub(super) probability_by_level: T,
    pub(super) missed_before: T,
    /// Signal-to-noise ratio, where signals are pooled.
    pub(super) ratio: T,
    pub(super) alarm: T,
    pub(super) alarm_slope: T,
    pub(super) quiet_before: T,
}

impl<T: Real, const DIM: usize> Sample<T, DIM> {
    /// A sample of nothing.
    #[must_use]
    pub const fn zeros() -> Self {
        let (zero, origin) = (T::ZERO, origin());
        Self {
            place: origin,
            velocity: origin,
            offset: origin,
            square: zero,
            by_square: zero,
            variance: zero,
            weight: zero,
            variance_slope: zero,
            jam_factor: zero,
            moves: zero,
            direction: origin,
            residual: origin,
            nearness: zero,
            probability: zero,
            probability_slope: zero,
            probability_by_level: zero,
            missed_before: zero,
            ratio: zero,
            alarm: zero,
            alarm_slope: zero,
            quiet_before: zero,
        }
    }
}

impl<T: Real, const DIM: usize> Default for Sample<T, DIM> {
    fn default() -> Self {
        Self::zeros()
    }
}

/// What the figures of one agent at one node depend on, other agents' jamming aside.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Situation<T, const DIM: usize> {
    pub time: T,
    pub position: Point<T, DIM>,
    /// r0 where it lags; `None` where it is the position.
    pub reference: Option<Point<T, DIM>>,
    pub dropout: T,
    pub level: T,
    pub betrayal: Betrayal<T>,
}

/// Derivatives by what a [`Situation`] holds; those by the emitters are in the emitters.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Derivative<T, const DIM: usize> {
    pub time: T,
    pub position: Point<T, DIM>,
    /// By r0 where it lags; part of `position` otherwise.
    pub reference: Point<T, DIM>,
    pub dropout: T,
    pub level: T,
}

/// Values, and what the way back needs besides the samples.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Outcome<T, const DIM: usize> {
    pub values: Values<T>,
    /// Where signals are pooled.
    pool: Option<pooled::Share<T>>,
    pub covariance: Option<fisher::Covariance<T, DIM>>,
}

/// How many digits location errors are to have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Digits {
    /// All that there are.
    All,
    /// As many as a lattice needs; where code is to be small, all.
    Few,
}

/// The values of [`forward`]; `samples` are of no use afterwards.
#[inline]
pub(crate) fn figures<T: Real, const DIM: usize>(
    scenario: &View<'_, T, DIM>,
    situation: &Situation<T, DIM>,
    emitters: &[Emitter<T, DIM>],
    (needs, digits): (Needs, Digits),
    samples: &mut [Sample<T, DIM>],
) -> Values<T> {
    let is_alone = needs.detection && scenario.frame.pooling == Pooling::None;
    let is_rough = needs.location && digits == Digits::Few && !cfg!(feature = "compact");
    let rest = Needs { detection: needs.detection && !is_alone, location: needs.location && !is_rough, ..needs };
    let mut values =
        if rest.nothing() { Values::default() } else { forward(scenario, situation, emitters, rest, samples).values };
    if is_alone {
        values.detection = detection::value(scenario, situation, samples.len());
    }
    if is_rough {
        values.location = fisher::rough(scenario, situation, emitters, samples.len());
    }
    values
}

/// Where all sensors are, and how far: what all figures begin with.
#[inline]
pub(crate) fn place<T: Real, const DIM: usize>(
    scenario: &View<'_, T, DIM>,
    situation: &Situation<T, DIM>,
    samples: &mut [Sample<T, DIM>],
) {
    for (sensor, sample) in scenario.sensors.iter().zip(samples) {
        (sample.place, sample.velocity) = scenario.sensor_state(sensor, situation.time);
        sample.offset = situation.position - sample.place;
        sample.square = soft_square(&sample.offset, scenario.frame.softening);
    }
}

/// Figures of one agent at one node, of the kinds that `needs` names.
pub(crate) fn forward<T: Real, const DIM: usize>(
    scenario: &View<'_, T, DIM>,
    situation: &Situation<T, DIM>,
    emitters: &[Emitter<T, DIM>],
    needs: Needs,
    samples: &mut [Sample<T, DIM>],
) -> Outcome<T, DIM> {
    let softening = scenario.frame.softening;
    place(scenario, situation, samples);
    let mut values = Values::default();
    let pooling = &scenario.frame.pooling;
    let mut pool = None;
    if needs.detection {
        values.detection = detection::forward(pooling, situation, scenario.sensors, samples);
        if *pooling != Pooling::None {
            let share = pooled::Share::forward(pooling, situation, values.detection, scenario.sensors, samples);
            values.detection = share.combined();
            pool = Some(share);
        }
    }
    if needs.false_alarm {
        values.false_alarm = match pooling {
            Pooling::None => false_alarm::forward(scenario.sensors, samples),
            _ => pooled::false_alarm(pooling, scenario.sensors, samples),
        };
    }
    let covariance = if needs.location {
        fisher::forward(situation, scenario.sensors, samples, emitters, softening)
    } else {
        None
    };
    values.location = covariance.as_ref().map(fisher::Covariance::location);
    Outcome { values, pool, covariance }
}

/// The way back: derivatives of what has derivatives `adjoint` by the values of `outcome`.
///
/// `samples` must be as [`forward`] left them.
pub(crate) fn backward<T: Real, const DIM: usize>(
    scenario: &View<'_, T, DIM>,
    situation: &Situation<T, DIM>,
    emitters: &mut [Emitter<T, DIM>],
    outcome: &Outcome<T, DIM>,
    adjoint: &Adjoint<T>,
    samples: &mut [Sample<T, DIM>],
) -> Derivative<T, DIM> {
    let zero = T::zero();
    let sensors: &[StoredSensor<T, DIM>] = scenario.sensors;
    let mut derivative =
        Derivative { time: zero, position: Point::zeros(), reference: Point::zeros(), dropout: zero, level: zero };
    for sample in samples.iter_mut() {
        sample.by_square = zero;
    }
    let pooling = &scenario.frame.pooling;
    if adjoint.detection != zero {
        let (mut by_alone, mut by_dropout) = (adjoint.detection, zero);
        if let Some(share) = &outcome.pool {
            by_dropout = share.backward(sensors, samples, adjoint.detection);
            by_alone *= share.missed();
        }
        (derivative.level, derivative.dropout) = detection::backward(pooling, situation, sensors, samples, by_alone);
        derivative.dropout += by_dropout;
    }
    if adjoint.false_alarm != zero {
        match pooling {
            Pooling::None => false_alarm::backward(sensors, samples, adjoint.false_alarm),
            _ => pooled::pull_false_alarm(sensors, samples, adjoint.false_alarm),
        }
    }
    if let Some(covariance) = &outcome.covariance {
        let softening = scenario.frame.softening;
        let jamming = fisher::Jamming { emitters, softening };
        fisher::backward(covariance, situation, sensors, samples, jamming, &adjoint.location, &mut derivative);
    }
    for (sensor, sample) in sensors.iter().zip(samples) {
        let pull = sample.offset * (T::real(2.0) * sample.by_square);
        derivative.position += pull;
        if sensor.is_moving() {
            derivative.time -= pull.dot(&sample.velocity);
        }
    }
    if situation.reference.is_none() {
        derivative.position += derivative.reference;
    }
    derivative
}

impl<T: Real, const DIM: usize> Sample<T, DIM> {
    /// Change per second of a figure whose derivative by the sensor's position is `by_place`.
    #[inline]
    pub(super) fn by_time(&self, by_place: &Point<T, DIM>) -> T {
        by_place.dot(&self.velocity)
    }
}
