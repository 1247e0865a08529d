//! Second derivatives of what an agent's own jamming does to its detection.
//!
//! `Max` with b = (p^q + z^q)^(1/q): b_pp = (q - 1) / b (p/b)^(q-2) (z/b)^q, b_zz with p and z exchanged, and
//! b_pz = -(q - 1) / b (p/b)^(q-1) (z/b)^(q-1). The other two are products and chains.
//!
//! Source: (43)-(45). Limits: flat where capped at 1; q below 2 bends without bound where p or z is 0, and is given
//! no bend there.

use super::received;
use crate::jet::{Jet, Surface};
use crate::math::Real;
use crate::scenario::{Betrayal, Susceptibility};

/// Probability of detection of an agent that jams at `level`, with `square` and `probability` as in the parent's
/// [`betrayed`](super::betrayed).
pub(crate) fn betrayed_jet<T: Real, const M: usize>(
    betrayal: Betrayal<T>,
    jam: &Susceptibility<T>,
    probability: &Jet<T, M>,
    level: &Jet<T, M>,
    square: &Jet<T, M>,
) -> Jet<T, M> {
    let one = T::one();
    match betrayal {
        Betrayal::None => *probability,
        Betrayal::Max { q } => {
            probability.chain_two(level, &norm_of(probability.value, level.value.max(T::zero()), q))
        }
        Betrayal::Linear => {
            let received = received_jet(jam, level, square);
            let raised = probability.times(&received.affine(one, one));
            if raised.value >= one || received.value < -one {
                Jet::constant(raised.value.clamp_to(T::zero(), one))
            } else {
                raised
            }
        }
        Betrayal::Sigmoid => {
            let received = received_jet(jam, level, square);
            let k = received.value.clamp_to(-T::real(60.0), T::real(60.0));
            let decay = (-k).exp();
            let share = -(-k).exp_m1() / (one + decay);
            let slope = T::real(2.0) * decay / (one + decay).squared();
            let share = received.chain(share, slope, -share * slope);
            let mut raised = probability.times(&share.affine(-one, one));
            raised.add(&share, one);
            raised
        }
    }
}

/// k = c^ z / d^mu.
fn received_jet<T: Real, const M: usize>(
    jam: &Susceptibility<T>,
    level: &Jet<T, M>,
    square: &Jet<T, M>,
) -> Jet<T, M> {
    let half = jam.detect_exponent * T::real(0.5);
    let (_, by_level, _) = received(jam, level.value, square.value);
    let slope = -half * by_level / square.value;
    let bend = -(half + T::one()) * slope / square.value;
    square.chain(by_level, slope, bend).times_linear(level.value, T::one(), &level.gradient)
}

/// (p^q + z^q)^(1/q). Source: (44).
fn norm_of<T: Real>(probability: T, level: T, q: T) -> Surface<T> {
    let (zero, one, two) = (T::zero(), T::one(), T::real(2.0));
    let first = super::norm_of(probability, level, q);
    let mut surface = Surface {
        value: first.probability,
        by_first: first.by_probability,
        by_second: first.by_level,
        first_twice: zero,
        mixed: zero,
        second_twice: zero,
    };
    let norm = first.probability;
    if norm >= one || norm == zero {
        return surface;
    }
    let (p, z) = (probability / norm, level / norm);
    let bend = |share: T, other: T| {
        if share == zero && q < two { zero } else { (q - one) / norm * share.powf(q - two) * other.powf(q) }
    };
    surface.first_twice = bend(p, z);
    surface.second_twice = bend(z, p);
    surface.mixed = -(q - one) / norm * p.powf(q - one) * z.powf(q - one);
    surface
}
