//! One sensor's probability of detecting an agent, and of a false alarm.
//!
//! | symbol | name | unit |
//! |---|---|---|
//! | d^2 | `square` | length unit squared |
//! | s^2 = `signal` d^(-2 gamma) | signal variance received | as `noise` |
//! | sigma^2 | `noise` | as `signal` |
//! | x = s^2 / sigma^2 | `ratio` | |
//! | N | `samples` | |
//! | ln gamma | `log_threshold` | |
//!
//! Proxy: p = min(1, c / (epsilon + d^gamma)), without false alarms. Energy detector: with
//! L = ln gamma + N/2 ln(1 + x), the threshold over the variance of the energy is t = 2 L / x where there is a
//! signal, and t (1 + x) where there is none, so that p = Q_N(t), and Q_N(t (1 + x)) for a false alarm.
//!
//! Source: (21)-(23), (25), (26), (28). Limits: the proxy has no derivatives where it reaches 1; there they are
//! given as 0. The signal-to-noise ratio is held above the smallest number whose reciprocal is finite.

use crate::math::{Real, power};
use crate::scenario::Detection;
use crate::special::chi_square_tail;

/// A probability and how it falls with distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Probability<T> {
    /// The probability.
    pub value: T,
    /// Derivative by d^2, 1 / length unit squared.
    pub slope: T,
    /// Second derivative by d^2, 1 / length unit to the fourth.
    pub bend: T,
}

/// Probability that the sensor detects an agent at squared distance `square`. Source: (25), (26).
#[inline(always)]
#[must_use]
pub fn detection<T: Real>(detection: &Detection<T>, square: T) -> Probability<T> {
    match *detection {
        Detection::Proxy { scale, epsilon, path_loss } => {
            let half = path_loss * T::real(0.5);
            let denominator = epsilon + power(square, half);
            if scale >= denominator {
                return Probability { value: T::one(), slope: T::zero(), bend: T::zero() };
            }
            let inverse = T::one() / denominator;
            let value = scale * inverse;
            let share = T::one() - epsilon * inverse;
            let nearness = T::one() / square;
            let slope = -value * half * share * nearness;
            let bend = slope * nearness * (half * (T::one() - T::real(2.0) * share) - T::one());
            Probability { value, slope, bend }
        }
        Detection::Energy { samples, signal, noise, log_threshold, path_loss } => {
            energy(samples, signal / noise, log_threshold, path_loss, square)
        }
    }
}

/// The energy detector, out of the way of the proxy.
#[inline(never)]
fn energy<T: Real>(samples: u32, ratio: T, log_threshold: T, path_loss: T, square: T) -> Probability<T> {
    let energy = Energy::new(samples, ratio, log_threshold, path_loss, square);
    energy.tail(&energy.with_signal, square)
}

/// Probability that the sensor gives a false alarm, with the threshold it has for an agent at squared distance
/// `square`. Source: (28).
#[inline]
#[must_use]
pub fn false_alarm<T: Real>(detection: &Detection<T>, square: T) -> Probability<T> {
    match *detection {
        Detection::Proxy { .. } => Probability { value: T::zero(), slope: T::zero(), bend: T::zero() },
        Detection::Energy { samples, signal, noise, log_threshold, path_loss } => {
            let energy = Energy::new(samples, signal / noise, log_threshold, path_loss, square);
            energy.tail(&energy.without_signal, square)
        }
    }
}

/// An argument of Q_N and its first and second derivatives by ln x.
struct Argument<T> {
    value: T,
    slope: T,
    bend: T,
}

/// Arguments of Q_N.
struct Energy<T> {
    samples: u32,
    path_loss: T,
    with_signal: Argument<T>,
    without_signal: Argument<T>,
}

impl<T: Real> Energy<T> {
    /// The detector at squared distance `square`, `ratio` being the signal-to-noise ratio at distance 1.
    #[inline]
    fn new(samples: u32, ratio: T, log_threshold: T, path_loss: T, square: T) -> Self {
        let ratio = (ratio * power(square, -path_loss)).clamp_to(T::MIN_POSITIVE / T::EPSILON, T::LARGE);
        let count = T::real(f64::from(samples));
        let log = ratio.ln_1p();
        // ln(1 + x) / x is 1 at 0, and its derivative by ln x is 1 / (1 + x) - ln(1 + x) / x.
        let mean = log / ratio;
        let rest = T::one() / (T::one() + ratio);
        let mean_slope = if ratio < T::real(0.015) { small_ratio_slope(ratio) } else { rest - mean };
        let offset = T::real(2.0) * log_threshold / ratio;
        let share = ratio * rest;
        let with_signal = Argument {
            value: offset + count * mean,
            slope: count * mean_slope - offset,
            bend: offset - count * (share * rest + mean_slope),
        };
        let without_signal = Argument {
            value: with_signal.value + T::real(2.0) * log_threshold + count * log,
            slope: with_signal.slope + count * share,
            bend: with_signal.bend + count * share * rest,
        };
        Self { samples, path_loss, with_signal, without_signal }
    }

    /// Q_N at `argument`; d ln x / d(d^2) = -gamma / d^2. The density has the logarithmic derivative
    /// (N/2 - 1) / t - 1/2.
    #[inline]
    fn tail(&self, argument: &Argument<T>, square: T) -> Probability<T> {
        let (zero, half) = (T::zero(), T::real(0.5));
        let tail = chi_square_tail(self.samples, argument.value);
        let by_square = self.path_loss / square;
        let slope = tail.density * argument.slope * by_square;
        let mut bend = zero;
        if tail.density > zero {
            let freedom = half * T::real(f64::from(self.samples)) - T::one();
            let falling = freedom / argument.value - half;
            let by_log_twice = -tail.density * (falling * argument.slope.squared() + argument.bend);
            bend = by_log_twice * by_square.squared() - slope / square;
        }
        Probability { value: tail.upper, slope, bend }
    }
}

/// 1 / (1 + x) - ln(1 + x) / x = -x/2 + 2x^2/3 - 3x^3/4 + .., free of cancellation: x below 0.015, error below
/// 1e-13 x.
fn small_ratio_slope<T: Real>(ratio: T) -> T {
    let mut sum = T::zero();
    for k in (1..=7_u32).rev() {
        let order = f64::from(k);
        sum = T::real(order / (order + 1.0)) - ratio * sum;
    }
    -ratio * sum
}
