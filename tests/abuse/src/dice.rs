//! Choices by bytes: the fuzzer's, or those of a seed.
//!
//! Where the bytes end, every choice is its first, so that each list of bytes is a whole input.

use arbitrary::Unstructured;
use quietpath_core::{Point, Real};

/// What numbers may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mood {
    /// Within the range that is asked for.
    Sane,
    /// Now and then anything: not finite, huge, tiny, negative.
    Wild,
}

/// Numbers that programs stumble over.
const ODD: [f64; 14] = [
    f64::NAN,
    f64::INFINITY,
    f64::NEG_INFINITY,
    0.0,
    -0.0,
    -1.0,
    f64::MIN_POSITIVE,
    5e-324,
    f64::EPSILON,
    1e-30,
    1e18,
    1e38,
    1e300,
    f64::MAX,
];

/// One number in this many is odd, where the mood is wild.
const ODD_ONE_IN: usize = 100;

/// Choices by bytes.
pub struct Dice<'a> {
    bytes: Unstructured<'a>,
    mood: Mood,
}

impl<'a> Dice<'a> {
    /// Choices by these bytes.
    #[must_use]
    pub fn new(bytes: &'a [u8], mood: Mood) -> Self {
        Self { bytes: Unstructured::new(bytes), mood }
    }

    /// Whether all bytes are used.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }

    /// A whole number below `count`, 0 where that is 0.
    pub fn below(&mut self, count: usize) -> usize {
        self.bytes.int_in_range(0..=count.saturating_sub(1)).unwrap_or_default()
    }

    /// Whether something with a chance of one in `count` happens.
    pub fn one_in(&mut self, count: usize) -> bool {
        self.below(count) + 1 == count
    }

    /// One of several.
    pub fn of<V: Copy>(&mut self, choices: &[V]) -> Option<V> {
        choices.get(self.below(choices.len())).copied()
    }

    /// A byte.
    pub fn byte(&mut self) -> u8 {
        self.bytes.arbitrary().unwrap_or_default()
    }

    /// Some of the bytes that are left, at most `count`.
    pub fn some(&mut self, count: usize) -> &'a [u8] {
        let count = count.min(self.bytes.len());
        self.bytes.bytes(count).unwrap_or_default()
    }

    /// A number from `low` to `high`, in 65536 steps.
    pub fn number(&mut self, low: f64, high: f64) -> f64 {
        if self.mood == Mood::Wild && self.one_in(ODD_ONE_IN) {
            return self.of(&ODD).unwrap_or_default();
        }
        let step: u16 = self.bytes.arbitrary().unwrap_or_default();
        low + (high - low) * f64::from(step) / f64::from(u16::MAX)
    }

    /// The same, in the numbers of a problem.
    pub fn real<T: Real>(&mut self, low: f64, high: f64) -> T {
        T::real(self.number(low, high))
    }

    /// A point with all coordinates from `low` to `high`.
    pub fn point<T: Real, const DIM: usize>(&mut self, low: f64, high: f64) -> Point<T, DIM> {
        Point::from_fn(|_, _| self.real(low, high))
    }
}
