//! What a solver minimises in place of the objective: smoothed extremes, and limits as barrier or penalty.
//!
//! | symbol | name | unit |
//! |---|---|---|
//! | g | slack of a limit, (max - E) / scale or (E - min) / scale | 1 |
//! | mu | `weight` | as the objective |
//!
//! The scale of a limit is its own magnitude, or 1 where it is 0. A barrier adds -mu ln g and is infinite where a
//! limit is broken; a penalty adds mu max(0, `margin` - g)^2.
//!
//! Source: (61), (62).

use crate::math::Real;
use crate::metrics::{Adjoint, Needs, Values};
use crate::objective::Extreme;
use crate::scenario::{Limit, View};

/// How constraints that are not part of the feasible set enter what is minimised.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Guard<T> {
    /// Not at all.
    None,
    /// By logarithms that keep the inside.
    Barrier { weight: T },
    /// By squares that lead there.
    Penalty { weight: T, margin: T },
}

impl<T: Real> Guard<T> {
    /// What a slack adds, and its derivative by the slack.
    #[inline]
    pub(crate) fn of(&self, slack: T) -> (T, T) {
        match *self {
            Self::None => (T::zero(), T::zero()),
            Self::Barrier { weight } if slack > T::zero() => (-weight * slack.ln(), -weight / slack),
            Self::Barrier { .. } => (T::INFINITY, T::zero()),
            Self::Penalty { weight, margin } => {
                let missing = margin - slack;
                if missing > T::zero() {
                    (weight * missing * missing, -T::real(2.0) * weight * missing)
                } else {
                    (T::zero(), T::zero())
                }
            }
        }
    }
}

/// The sum that is minimised.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Merit<T> {
    /// What stands for worst values.
    pub extreme: Extreme<T>,
    /// Factor of the objective: 1, or 0 where only the constraints count.
    pub objective: T,
    /// What limits, regions and separations add.
    pub guard: Guard<T>,
}

impl<T: Real> Merit<T> {
    /// The objective alone.
    pub(crate) fn plain(extreme: Extreme<T>) -> Self {
        Self { extreme, objective: T::one(), guard: Guard::None }
    }

    /// Adds what the limits need to know.
    pub(super) fn needs<const DIM: usize>(&self, scenario: &View<'_, T, DIM>, needs: &mut Needs) {
        if self.guard != Guard::None {
            scenario.limits.iter().for_each(|limit| needs.add(limit.metric));
        }
    }

    /// What the limits add at a node; their derivatives go into `adjoint`.
    pub(super) fn limits<const DIM: usize>(
        &self,
        scenario: &View<'_, T, DIM>,
        values: &Values<T>,
        adjoint: &mut Adjoint<T>,
    ) -> T {
        let mut sum = T::zero();
        if self.guard == Guard::None {
            return sum;
        }
        for limit in scenario.limits {
            let Some(value) = values.get(limit.metric) else { continue };
            for (slack, by_value) in slacks(limit, value).into_iter().flatten() {
                let (added, by_slack) = self.guard.of(slack);
                sum += added;
                if by_slack != T::zero() {
                    adjoint.add(limit.metric, by_slack * by_value, values);
                }
            }
        }
        sum
    }
}

/// Slacks of the upper and the lower bound, and their derivatives by the value.
pub(crate) fn slacks<T: Real>(limit: &Limit<T>, value: T) -> [Option<(T, T)>; 2] {
    let scale = |bound: T| if bound == T::zero() { T::one() } else { bound.abs() };
    [
        limit.max.map(|max| ((max - value) / scale(max), -T::one() / scale(max))),
        limit.min.map(|min| ((value - min) / scale(min), T::one() / scale(min))),
    ]
}
