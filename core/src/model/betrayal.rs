//! How an agent's own jamming betrays it to a sensor.
//!
//! | symbol | name | unit |
//! |---|---|---|
//! | p_j | `probability` | |
//! | z | `level` | 0 .. 1 |
//! | k = c^_j z / d^mu_j | `received` | |
//!
//! `Max`: (p^q + z^q)^(1/q). `Linear`: p (1 + k). `Sigmoid`: p + (1 - p) (2 S(k) - 1) with the logistic function
//! S. `Max` and `Linear` are capped at 1, and flat there.
//!
//! Source: (43)-(45). Other agents' jammers do not betray this one.

mod curvature;

pub(crate) use curvature::betrayed_jet;

use crate::math::{Real, power};
use crate::scenario::{Betrayal, Susceptibility};

/// A probability and its derivatives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Betrayed<T> {
    /// Probability of detection.
    pub probability: T,
    /// Derivative by the probability without jamming.
    pub by_probability: T,
    /// Derivative by the jamming level z.
    pub by_level: T,
    /// Derivative by d^2 at constant probability without jamming, 1 / length unit squared.
    pub by_square: T,
}

/// Probability of detection of an agent that jams at `level`, at squared distance `square` from a sensor that
/// would detect it with `probability` if it did not.
#[inline]
#[must_use]
pub fn betrayed<T: Real>(
    betrayal: Betrayal<T>,
    jam: &Susceptibility<T>,
    probability: T,
    level: T,
    square: T,
) -> Betrayed<T> {
    let (zero, one) = (T::zero(), T::one());
    match betrayal {
        Betrayal::None => Betrayed { probability, by_probability: one, by_level: zero, by_square: zero },
        Betrayal::Max { q } => norm_of(probability, level.max(zero), q),
        Betrayal::Linear => {
            let (received, by_level, by_square) = received(jam, level, square);
            let raised = probability * (one + received);
            if raised >= one || received < -one {
                let probability = raised.clamp_to(zero, one);
                return Betrayed { probability, by_probability: zero, by_level: zero, by_square: zero };
            }
            Betrayed {
                probability: raised,
                by_probability: one + received,
                by_level: probability * by_level,
                by_square: probability * by_square,
            }
        }
        Betrayal::Sigmoid => {
            let (received, by_level, by_square) = received(jam, level, square);
            // 2 S(k) - 1 = (1 - e^-k) / (1 + e^-k); past 60 it is 1 to the last bit.
            let k = received.clamp_to(-T::real(60.0), T::real(60.0));
            let decay = (-k).exp();
            let share = -(-k).exp_m1() / (one + decay);
            let slope = T::real(2.0) * decay / (one + decay).squared();
            let rest = one - probability;
            Betrayed {
                probability: probability + rest * share,
                by_probability: one - share,
                by_level: rest * slope * by_level,
                by_square: rest * slope * by_square,
            }
        }
    }
}

/// k = c^ z / d^mu, with its derivatives by z and d^2.
#[inline]
fn received<T: Real>(jam: &Susceptibility<T>, level: T, square: T) -> (T, T, T) {
    let half = jam.detect_exponent * T::real(0.5);
    let by_level = (jam.detect_gain / power(square, half)).min(T::LARGE);
    let received = by_level * level;
    (received, by_level, -half * received / square)
}

/// (p^q + z^q)^(1/q), scaled by the larger one so that small probabilities do not underflow. Source: (44).
#[inline]
fn norm_of<T: Real>(probability: T, level: T, q: T) -> Betrayed<T> {
    let (zero, one) = (T::zero(), T::one());
    if level == zero && q > one {
        return Betrayed { probability, by_probability: one, by_level: zero, by_square: zero };
    }
    let large = probability.max(level);
    if large == zero {
        return Betrayed { probability, by_probability: one, by_level: one, by_square: zero };
    }
    let (p, z) = (probability / large, level / large);
    let ratio = (p.powf(q) + z.powf(q)).powf(one / q);
    let norm = large * ratio;
    if norm >= one {
        return Betrayed { probability: one, by_probability: zero, by_level: zero, by_square: zero };
    }
    let slope = |share: T| (share / ratio).powf(q - one);
    Betrayed { probability: norm, by_probability: slope(p), by_level: slope(z), by_square: zero }
}
