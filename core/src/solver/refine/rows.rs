//! The bounds on speed and acceleration, each as a ball whose radius and centre move with the pace.
//!
//! | symbol | name | unit |
//! |---|---|---|
//! | v | `value`, a step D1 y_i or a bend D2 e_i | v_max h, bends too |
//! | R | `radius`, 1 or the bound on bends | as v |
//! | g = R^2 - abs(v)^2 | `slack` | |
//!
//! A bound sees up to three neighbouring nodes and the pace. One visitor lists all of an agent's bounds, so that
//! their barrier, its derivatives, and the change of multipliers are each written once.

use crate::math::{Point, Real, norm_squared};
use crate::solver::coordinates::{AgentFrame, Frame};

/// One bound at an iterate.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ball<T, const DIM: usize> {
    /// Interior index (node - 1) of the first node it sees; may be -1.
    pub(super) first: isize,
    /// Coefficients of the nodes from `first` on.
    pub(super) weights: [T; 3],
    pub(super) value: Point<T, DIM>,
    /// Derivative of `value` by the pace.
    pub(super) by_pace: Point<T, DIM>,
    pub(super) radius: T,
    /// Derivative of `radius` by the pace.
    pub(super) radius_by_pace: T,
}

impl<T: Real, const DIM: usize> Ball<T, DIM> {
    pub(super) fn slack(&self) -> T {
        self.radius * self.radius - norm_squared(&self.value)
    }

    /// Half the derivative of the slack by the pace.
    pub(super) fn half_slack_by_pace(&self) -> T {
        self.radius * self.radius_by_pace - self.value.dot(&self.by_pace)
    }

    /// Change of the slack, to first order, along a direction.
    pub(super) fn slack_change(&self, direction: &[Point<T, DIM>], pace: T) -> T {
        let mut moved = Point::<T, DIM>::zeros();
        for (offset, &weight) in self.weights.iter().enumerate() {
            if let Some(node) = index(self.first, offset).and_then(|index| direction.get(index)) {
                moved += node * weight;
            }
        }
        (self.half_slack_by_pace() * pace - self.value.dot(&moved)) * T::real(2.0)
    }
}

/// The interior index `offset` after `first`, if there is one.
pub(super) fn index(first: isize, offset: usize) -> Option<usize> {
    usize::try_from(first + isize::try_from(offset).ok()?).ok()
}

/// Visits the bounds of an agent in a fixed order: steps 1 .. N with places 0 .. N-1, bends with places N .. 2N-1,
/// the start's first.
pub(super) fn for_each_ball<T: Real, const DIM: usize, const AGENTS: usize>(
    frame: &Frame<T, DIM, AGENTS>,
    agent: &AgentFrame<T, DIM>,
    offsets: &[Point<T, DIM>],
    pace: T,
    mut visit: impl FnMut(usize, &Ball<T, DIM>),
) {
    let (zero, one, two) = (T::zero(), T::one(), T::real(2.0));
    let rate = agent.reach / T::from_count(frame.intervals.max(1));
    let bend = agent.bend_max / pace;
    let bend_by_pace = -bend / pace;
    let ends = core::iter::once(Point::<T, DIM>::zeros());
    let mut before = Point::<T, DIM>::zeros();
    let mut step_before: Option<Point<T, DIM>> = None;
    for (step_index, offset) in offsets.iter().copied().chain(ends).enumerate() {
        let here = isize::try_from(step_index).unwrap_or(isize::MAX);
        let step = offset - before;
        let cruise = rate * pace;
        visit(
            step_index,
            &Ball {
                first: here - 1,
                weights: [-one, one, zero],
                value: step + cruise,
                by_pace: rate,
                radius: one,
                radius_by_pace: zero,
            },
        );
        let place = frame.intervals + step_index;
        if let Some(last) = step_before {
            visit(
                place,
                &Ball {
                    first: here - 2,
                    weights: [one, -two, one],
                    value: step - last,
                    by_pace: Point::zeros(),
                    radius: bend,
                    radius_by_pace: bend_by_pace,
                },
            );
        } else if let Some(velocity) = agent.start_velocity {
            visit(
                place,
                &Ball {
                    first: here,
                    weights: [one, zero, zero],
                    value: step + cruise - velocity,
                    by_pace: rate,
                    radius: agent.first_bend(bend),
                    radius_by_pace: agent.first_bend_by_pace(bend_by_pace),
                },
            );
        }
        (before, step_before) = (offset, Some(step));
    }
}
