//! A wire in memory, one direction: what is sent at one time comes out at a later one, or not, or twice.
//!
//! Chance comes from a seed, so the same sends at the same times always have the same fate. Reordering comes from
//! `jitter`: each copy of a chunk is delayed by its own chance. See [`crate::link`] for how two ends are joined.

use std::collections::BTreeMap;
use std::time::Duration;

use crate::clock::Time;

/// What a wire does to what is sent on it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Faults {
    /// Chance that a chunk is lost, 0 to 1.
    pub loss: f64,
    /// Chance that a chunk comes twice, 0 to 1.
    pub duplication: f64,
    /// Chance that a bit of a chunk is flipped, 0 to 1.
    pub corruption: f64,
    /// Least delay.
    pub delay: Duration,
    /// Largest delay on top of it, evenly distributed.
    pub jitter: Duration,
}

impl Faults {
    /// A perfect wire.
    pub const NONE: Self =
        Self { loss: 0.0, duplication: 0.0, corruption: 0.0, delay: Duration::ZERO, jitter: Duration::ZERO };
}

/// One direction of a link in memory.
#[derive(Clone, Debug)]
pub struct Wire {
    faults: Faults,
    chance: fastrand::Rng,
    /// Chunks under way by when they come out, then by when they went in.
    under_way: BTreeMap<(Time, u64), Vec<u8>>,
    sent: u64,
}

impl Wire {
    /// A wire with faults by a seed.
    #[must_use]
    pub fn new(faults: Faults, seed: u64) -> Self {
        Self { faults, chance: fastrand::Rng::with_seed(seed), under_way: BTreeMap::new(), sent: 0 }
    }

    /// Sends a chunk of bytes: one frame, or one datagram.
    pub fn send(&mut self, now: Time, bytes: &[u8]) {
        if self.chance.f64() < self.faults.loss {
            return;
        }
        let copies = if self.chance.f64() < self.faults.duplication { 2 } else { 1 };
        for _ in 0..copies {
            let mut copy = bytes.to_vec();
            if self.chance.f64() < self.faults.corruption && !copy.is_empty() {
                let bit = self.chance.usize(0..copy.len() * 8);
                copy.iter_mut().skip(bit / 8).take(1).for_each(|byte| *byte ^= 1 << (bit % 8));
            }
            let due = now + self.faults.delay + self.faults.jitter.mul_f64(self.chance.f64());
            self.under_way.insert((due, self.sent), copy);
            self.sent += 1;
        }
    }

    /// The next chunk that has come out by now.
    pub fn receive(&mut self, now: Time) -> Option<Vec<u8>> {
        let first = self.under_way.first_entry()?;
        (first.key().0 <= now).then(|| first.remove())
    }

    /// When the next chunk comes out; `None` where nothing is under way.
    #[must_use]
    pub fn next(&self) -> Option<Time> {
        self.under_way.first_key_value().map(|((due, _), _)| *due)
    }

    /// Cuts the wire: whatever is under way is lost.
    pub fn cut(&mut self) {
        self.under_way.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_have_the_rates_asked_for_and_repeat_from_their_seed() {
        let millis = Duration::from_millis;
        let faults =
            Faults { loss: 0.3, duplication: 0.1, corruption: 0.05, delay: millis(100), jitter: millis(400) };
        let run = |seed| {
            let mut wire = Wire::new(faults, seed);
            for number in 0_u16..10_000 {
                wire.send(Time::from_millis(u64::from(number)), &number.to_le_bytes());
            }
            assert_eq!(wire.receive(Time::from_millis(50)), None, "too early");
            std::iter::from_fn(|| wire.receive(Time::from_millis(20_000))).collect::<Vec<_>>()
        };
        let came = run(1);
        let share = came.len() as f64 / 10_000.0;
        assert!((share - 0.7 * 1.1).abs() < 0.02, "{share}");
        assert!(came.windows(2).any(|pair| pair[0] > pair[1]), "nothing came out of order");
        assert_eq!(came, run(1));
        assert_ne!(came, run(2));
    }
}
