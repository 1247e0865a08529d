//! One test of the signals of all energy detectors, instead of one test each.
//!
//! | symbol | name | unit |
//! |---|---|---|
//! | N_j | samples of sensor j | |
//! | x_j = s_j^2 / sigma_j^2 | signal-to-noise `ratio`, s_j^2 = signal d^(-2 gamma) | |
//! | rho | `correlation` of the signals at two sensors at the same instant | 0 .. 1 |
//! | ln gamma | `log_threshold` of the one test | |
//! | K | signal covariance at one instant over the noise, sensors x sensors | |
//!
//! With all samples divided by their noise's deviation, the covariance of one instant is I without and I + K with a signal.
//! Uncorrelated: K = diag(x), and sensors may take different numbers of samples. Correlated: one transmitter is heard by all,
//! K_ij = rho sqrt(x_i x_j), so that K = (1 - rho) diag(x) + rho sqrt(x) sqrt(x)^T; all N_j are N. At rho = 0 this is the
//! uncorrelated test, at rho = 1 the energy detector whose signal-to-noise ratio is the sum of all.
//!
//! The logarithm of the likelihood ratio (20) exceeds ln gamma where
//! T = sum_n z_n^T K (I + K)^-1 z_n > y = 2 ln gamma + sum ln det(I + K) (uncorrelated: 2 ln gamma + sum N_j ln(1 + x_j)).
//! T is a weighted chi-square sum, [`weighted_chi_square_tail`]: with a signal the weights are the eigenvalues of K, without
//! one those of K (I + K)^-1. Both matrices are diagonal plus rank one, so everything costs O(sensors).
//!
//! The pool counts as one sensor in (19), beside those that decide for themselves. Dropout as in (54): 1 - theta times the
//! probability of the pool. A test of one sensor is that of (21), (22), (28), exactly.
//!
//! Source: section 2.3.2, which refers to S. Kay, Fundamentals of statistical signal processing II (1998), Example 5.2 and
//! p. 144-146; the equal correlation is this project's choice. Limits: those of [`weighted_chi_square_tail`]; jamming has no
//! meaning here that would betray the jammer, and scenarios that ask for it are refused.

use crate::math::{Real, power};
use crate::metrics::sample::{Sample, Situation};
use crate::scenario::{Detection, Pooling, StoredSensor};
use crate::special::{Part, WeightedTail, weighted_chi_square_tail};

/// The test: threshold gamma and correlation.
#[derive(Clone, Copy, Debug)]
struct Test<T> {
    log_threshold: T,
    correlation: T,
}

/// What the pool hears at one node.
struct Heard<T> {
    test: Test<T>,
    /// y, and 1 / (1 + sum c/(1 + a)) for K = diag(a) + sqrt(c) sqrt(c)^T.
    threshold: T,
    rank_one: T,
    samples: u32,
}

/// One energy detector's part: N_j and x_j.
#[derive(Clone, Copy)]
struct Signal<T> {
    samples: u32,
    ratio: T,
}

impl<T: Real> Pooling<T> {
    fn test(&self) -> Option<Test<T>> {
        match *self {
            Self::None => None,
            Self::Uncorrelated { log_threshold } => Some(Test { log_threshold, correlation: T::zero() }),
            Self::Correlated { log_threshold, correlation } => Some(Test { log_threshold, correlation }),
        }
    }

    /// Whether a sensor gives its signal to the pool instead of deciding for itself.
    #[inline]
    pub(crate) fn takes(&self, detection: &Detection<T>) -> bool {
        *self != Self::None && matches!(detection, Detection::Energy { .. })
    }
}

/// The pool beside the sensors that decide for themselves.
#[derive(Clone, Copy, Debug)]
pub(super) struct Share<T> {
    /// 1 - theta.
    heard: T,
    /// Probability that the pool would detect the agent without dropout.
    pool: T,
    /// Probability that one of the other sensors does.
    alone: T,
}

impl<T: Real> Share<T> {
    /// `alone` is what the other sensors detect.
    pub(super) fn forward<const DIM: usize>(
        pooling: &Pooling<T>,
        situation: &Situation<T, DIM>,
        alone: T,
        sensors: &[StoredSensor<T, DIM>],
        samples: &mut [Sample<T, DIM>],
    ) -> Self {
        Self { heard: T::one() - situation.dropout, pool: detection(pooling, sensors, samples), alone }
    }

    /// Probability that the pool or another sensor detects the agent. Source: (19), (54).
    pub(super) fn combined(&self) -> T {
        self.alone + self.heard * self.pool * (T::one() - self.alone)
    }

    /// Probability that the pool does not.
    pub(super) fn missed(&self) -> T {
        T::one() - self.heard * self.pool
    }

    /// Adds `coefficient` times the derivatives by d^2 into the samples; returns that by dropout.
    pub(super) fn backward<const DIM: usize>(
        &self,
        sensors: &[StoredSensor<T, DIM>],
        samples: &mut [Sample<T, DIM>],
        coefficient: T,
    ) -> T {
        let by_share = coefficient * (T::one() - self.alone);
        for (_, sample) in sensors.iter().zip(samples).filter(|(sensor, _)| pools(sensor)) {
            sample.by_square += by_share * self.heard * sample.probability_slope;
        }
        -by_share * self.pool
    }
}

/// Whether a sensor gives its signal to a pool, where there is one.
pub(super) fn pools<T: Real, const DIM: usize>(sensor: &StoredSensor<T, DIM>) -> bool {
    matches!(sensor.detection, Some(Detection::Energy { .. }))
}

/// Adds `coefficient` times the derivatives of the probability of a false alarm by d^2 into the samples.
pub(super) fn pull_false_alarm<T: Real, const DIM: usize>(
    sensors: &[StoredSensor<T, DIM>],
    samples: &mut [Sample<T, DIM>],
    coefficient: T,
) {
    for (_, sample) in sensors.iter().zip(samples).filter(|(sensor, _)| pools(sensor)) {
        sample.by_square += coefficient * sample.alarm_slope;
    }
}

/// Probability that the pool detects the agent; its derivatives by d_j^2 go to the samples' `probability_slope`.
pub(super) fn detection<T: Real, const DIM: usize>(
    pooling: &Pooling<T>,
    sensors: &[StoredSensor<T, DIM>],
    samples: &mut [Sample<T, DIM>],
) -> T {
    let Some(heard) = pooling.test().and_then(|test| Heard::new(test, sensors, samples)) else {
        return T::zero();
    };
    let tail =
        weighted_chi_square_tail(signals(sensors, samples).map(|signal| heard.with_signal(&signal)), heard.threshold);
    let rho = heard.test.correlation;
    for (sensor, sample) in sensors.iter().zip(samples) {
        let Some((signal, falloff)) = signal(sensor, sample) else {
            continue;
        };
        let by = tail.by_part(&heard.with_signal(&signal));
        let by_ratio =
            (T::one() - rho) * by.weight + rho * by.coupling - tail.density * heard.threshold_slope(&signal);
        sample.probability_slope = by_ratio * falloff;
    }
    tail.upper
}

/// Probability that the pool gives a false alarm; derivatives go to the samples' `alarm_slope`. Source: (28).
pub(super) fn false_alarm<T: Real, const DIM: usize>(
    pooling: &Pooling<T>,
    sensors: &[StoredSensor<T, DIM>],
    samples: &mut [Sample<T, DIM>],
) -> T {
    let Some(heard) = pooling.test().and_then(|test| Heard::new(test, sensors, samples)) else {
        return T::zero();
    };
    let tail = weighted_chi_square_tail(
        signals(sensors, samples).map(|signal| heard.without_signal(&signal)),
        heard.threshold,
    );
    // Through k = 1 / (1 + sum c/(1 + a)), which every coupling has as a factor.
    let mut by_rank_one = T::zero();
    for signal in signals(sensors, samples) {
        let part = heard.without_signal(&signal);
        by_rank_one += tail.by_part(&part).coupling * part.coupling / heard.rank_one;
    }
    for (sensor, sample) in sensors.iter().zip(samples) {
        let Some((signal, falloff)) = signal(sensor, sample) else {
            continue;
        };
        sample.alarm_slope = heard.alarm_by_ratio(&signal, &tail, by_rank_one) * falloff;
    }
    tail.upper
}

/// N and x of a sensor in the pool, and dx / d(d^2).
#[inline]
fn signal<T: Real, const DIM: usize>(
    sensor: &StoredSensor<T, DIM>,
    sample: &Sample<T, DIM>,
) -> Option<(Signal<T>, T)> {
    let Some(Detection::Energy { samples, path_loss, .. }) = sensor.detection else {
        return None;
    };
    Some((Signal { samples, ratio: sample.ratio }, -path_loss * sample.ratio / sample.square))
}

fn signals<'a, T: Real, const DIM: usize>(
    sensors: &'a [StoredSensor<T, DIM>],
    samples: &'a [Sample<T, DIM>],
) -> impl Iterator<Item = Signal<T>> + Clone {
    sensors.iter().zip(samples).filter_map(|(sensor, sample)| signal(sensor, sample).map(|(signal, _)| signal))
}

impl<T: Real> Heard<T> {
    /// Fills in the samples' ratios; `None` where no sensor is in the pool.
    fn new<const DIM: usize>(
        test: Test<T>,
        sensors: &[StoredSensor<T, DIM>],
        samples: &mut [Sample<T, DIM>],
    ) -> Option<Self> {
        let (one, two) = (T::one(), T::real(2.0));
        let (mut diagonal, mut coupled, mut count) = (T::zero(), T::zero(), 0);
        for (sensor, sample) in sensors.iter().zip(samples) {
            let Some(Detection::Energy { samples, signal, noise, path_loss, .. }) = sensor.detection else {
                continue;
            };
            let ratio = signal / noise * power(sample.square, -path_loss);
            sample.ratio = ratio.clamp_to(T::MIN_POSITIVE / T::EPSILON, T::LARGE);
            let weight = (one - test.correlation) * sample.ratio;
            diagonal += T::real(f64::from(samples)) * weight.ln_1p();
            coupled += test.correlation * sample.ratio / (one + weight);
            count = samples;
        }
        if count == 0 {
            return None;
        }
        let threshold = two * test.log_threshold + diagonal + T::real(f64::from(count)) * coupled.ln_1p();
        Some(Self { test, threshold, rank_one: one / (one + coupled), samples: count })
    }

    /// (a, c) of the part of K, and 1 / (1 + a).
    #[inline]
    fn entries(&self, signal: &Signal<T>) -> (T, T, T) {
        let rho = self.test.correlation;
        let weight = (T::one() - rho) * signal.ratio;
        (weight, rho * signal.ratio, T::one() / (T::one() + weight))
    }

    /// The part of K.
    #[inline]
    fn with_signal(&self, signal: &Signal<T>) -> Part<T> {
        let (weight, coupling, _) = self.entries(signal);
        Part { degrees: signal.samples, weight, coupling }
    }

    /// The part of K (I + K)^-1 = diag(a/(1+a)) + k sqrt(e) sqrt(e)^T, e = c/(1+a)^2.
    #[inline]
    fn without_signal(&self, signal: &Signal<T>) -> Part<T> {
        let (weight, coupling, inverse) = self.entries(signal);
        let coupling = self.rank_one * coupling * inverse * inverse;
        Part { degrees: signal.samples, weight: weight * inverse, coupling }
    }

    /// d(c/(1+a)) / dx.
    #[inline]
    fn coupled_slope(&self, signal: &Signal<T>) -> T {
        let (weight, _, inverse) = self.entries(signal);
        // rho/(1+a) - c (1-rho)/(1+a)^2, and c (1-rho) = rho a.
        self.test.correlation * inverse * (T::one() - weight * inverse)
    }

    /// dy / dx.
    #[inline]
    fn threshold_slope(&self, signal: &Signal<T>) -> T {
        let (_, _, inverse) = self.entries(signal);
        let alone = T::real(f64::from(signal.samples)) * (T::one() - self.test.correlation) * inverse;
        alone + T::real(f64::from(self.samples)) * self.rank_one * self.coupled_slope(signal)
    }

    /// Derivative of the probability of a false alarm by x.
    #[inline]
    fn alarm_by_ratio(&self, signal: &Signal<T>, tail: &WeightedTail<T>, by_rank_one: T) -> T {
        let (one, rho) = (T::one(), self.test.correlation);
        let by = tail.by_part(&self.without_signal(signal));
        let (weight, _, inverse) = self.entries(signal);
        let square = inverse * inverse;
        let weight_slope = (one - rho) * square;
        let coupling_slope = self.rank_one * rho * square * (one - T::real(2.0) * weight * inverse);
        let rank_one_slope = -self.rank_one.squared() * self.coupled_slope(signal);
        by.weight * weight_slope + by.coupling * coupling_slope + by_rank_one * rank_one_slope
            - tail.density * self.threshold_slope(signal)
    }
}
