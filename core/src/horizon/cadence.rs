//! How much of a plan is flown before the next step.

use crate::math::Real;

/// The lengths of control horizons, counted in intervals. Source: Remark 3.3.1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Cadence<T> {
    /// A fixed number of steps, of lengths as equal as whole intervals allow.
    Even {
        /// Number of steps, at least 1.
        steps: usize,
    },
    /// Half as long as the step before where the world changed a lot, twice as long where it hardly did.
    Adaptive {
        /// Least number of intervals, at least 1; that of the first step, which knows of no change.
        shortest: usize,
        /// Largest number of intervals.
        longest: usize,
        /// The [`super::Step::change`] that is a lot; less than half of it is hardly any.
        change: T,
    },
}

impl<T: Real> Cadence<T> {
    /// Intervals to fly in step `index` of a flight of `intervals`, after a step of `before` intervals at whose end the
    /// world had changed by `change`. It may be more than there are left.
    #[must_use]
    pub fn length(&self, intervals: usize, index: usize, before: usize, change: T) -> usize {
        match *self {
            Self::Even { steps } => {
                let steps = steps.max(1);
                let end_of = |index: usize| (index + 1) * intervals / steps;
                let begin = index.checked_sub(1).map_or(0, end_of);
                end_of(index).saturating_sub(begin).max(1)
            }
            Self::Adaptive { shortest, .. } if index == 0 => shortest.max(1),
            Self::Adaptive { shortest, longest, change: much } => {
                let wanted = if change > much {
                    before / 2
                } else if change + change < much {
                    before * 2
                } else {
                    before
                };
                wanted.min(longest).max(shortest).max(1)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn even_steps_cover_the_flight_exactly() {
        for (intervals, steps) in [(90, 18), (90, 7), (5, 5), (64, 9)] {
            let cadence = Cadence::<f64>::Even { steps };
            let lengths: std::vec::Vec<_> =
                (0..steps).map(|index| cadence.length(intervals, index, 0, 0.0)).collect();
            assert_eq!(lengths.iter().sum::<usize>(), intervals, "{lengths:?}");
            assert!(lengths.iter().all(|length| length.abs_diff(intervals / steps) <= 1), "{lengths:?}");
        }
    }

    #[test]
    fn steps_shorten_when_the_world_changes_and_grow_when_it_rests() {
        let cadence = Cadence::Adaptive { shortest: 2, longest: 12, change: 0.1 };
        assert_eq!(cadence.length(90, 0, 0, 0.0), 2);
        assert_eq!(cadence.length(90, 1, 8, 0.2), 4);
        assert_eq!(cadence.length(90, 1, 3, 0.2), 2);
        assert_eq!(cadence.length(90, 1, 8, 0.07), 8);
        assert_eq!(cadence.length(90, 1, 5, 0.01), 10);
        assert_eq!(cadence.length(90, 1, 8, 0.01), 12);
    }
}
