//! Exact feasibility: how far one may go from a feasible iterate towards another before a bound is met.
//!
//! Bounds are the speed ball |D1 y| <= 1, the acceleration ball |D2 e| <= tangent of a h / v, the box, and the
//! shortest flight time. All are convex in (e, r), so the largest share is the smallest over the bounds, each by
//! its own quadratic or linear equation.

use crate::math::{Point, Real, norm_squared};

use super::coordinates::{AgentFrame, Frame, Iterate};
use crate::scenario::Domain;

/// The tangent at pace `center` to the acceleration bound `bend_max / pace`: inside the bound everywhere.
#[inline]
pub(super) fn bend_bound<T: Real>(bend_max: T, center: T, pace: T) -> T {
    (bend_max / center * (T::real(2.0) - pace / center)).max(T::zero())
}

/// Largest share of [0, 1] for which |a + share (b - a)| <= ra + share (rb - ra), where it holds at 0.
fn ball_share<T: Real, const DIM: usize>(a: &Point<T, DIM>, b: &Point<T, DIM>, ra: T, rb: T) -> T {
    if norm_squared(b) <= rb * rb && rb >= T::zero() {
        return T::one();
    }
    let (step, growth) = (b - a, rb - ra);
    let constant = (norm_squared(a) - ra * ra).min(T::zero());
    let half_linear = a.dot(&step) - ra * growth;
    let square = norm_squared(&step) - growth * growth;
    let root = (half_linear * half_linear - square * constant).max(T::zero()).sqrt();
    let bottom = half_linear + root;
    if bottom > T::zero() { (-constant / bottom).clamp_to(T::zero(), T::one()) } else { T::one() }
}

/// Largest share of [0, 1] for which a + share (b - a) stays between bounds that move from (la, ha) to (lb, hb).
fn box_share<T: Real>(a: T, b: T, low: (T, T), high: (T, T)) -> T {
    let one = |gap_a: T, gap_b: T| {
        if gap_b >= T::zero() {
            T::one()
        } else {
            (gap_a.max(T::zero()) / (gap_a.max(T::zero()) - gap_b)).clamp_to(T::zero(), T::one())
        }
    };
    one(a - low.0, b - low.1).min(one(high.0 - a, high.1 - b))
}

/// Largest share of the way from `from`, which is feasible, to `to`, that keeps every bound; `center` is the pace
/// at which the acceleration bound is linearised.
pub(super) fn largest_share<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize>(
    frame: &Frame<T, DIM, AGENTS>,
    domain: &Domain<T, DIM>,
    from: &Iterate<T, DIM, NODES, AGENTS>,
    to: &Iterate<T, DIM, NODES, AGENTS>,
    center: T,
) -> T {
    let most = frame.pace_max.unwrap_or(T::MAX);
    let mut share = box_share(from.pace, to.pace, (frame.pace_min, frame.pace_min), (most, most));
    let agents = from.interior(frame).zip(to.interior(frame)).zip(frame.agent());
    for ((a, b), agent) in agents {
        share = share.min(agent_share(frame, domain, agent, (a, from.pace), (b, to.pace), center));
    }
    share
}

/// An agent's interior offsets, and the pace that goes with them.
type Side<'a, T, const DIM: usize> = (&'a [Point<T, DIM>], T);

fn agent_share<T: Real, const DIM: usize, const AGENTS: usize>(
    frame: &Frame<T, DIM, AGENTS>,
    domain: &Domain<T, DIM>,
    agent: &AgentFrame<T, DIM>,
    from: Side<'_, T, DIM>,
    to: Side<'_, T, DIM>,
    center: T,
) -> T {
    let mut share = T::one();
    let cruise = (frame.cruise(agent, from.1), frame.cruise(agent, to.1));
    let bend = (bend_bound(agent.bend_max, center, from.1), bend_bound(agent.bend_max, center, to.1));
    let zero = Point::<T, DIM>::zeros();
    let ends = core::iter::once((&zero, &zero));
    let mut before = (zero, zero);
    let mut step_before: Option<(Point<T, DIM>, Point<T, DIM>)> =
        agent.start_velocity.map(|velocity| (velocity - cruise.0, velocity - cruise.1));
    let first = (agent.first_bend(bend.0), agent.first_bend(bend.1));
    for (index, (a, b)) in from.0.iter().zip(to.0).chain(ends).enumerate() {
        let step = (a - before.0, b - before.1);
        share = share.min(ball_share(&(step.0 + cruise.0), &(step.1 + cruise.1), T::one(), T::one()));
        if let Some(last) = step_before {
            let bend = if index == 0 { first } else { bend };
            share = share.min(ball_share(&(step.0 - last.0), &(step.1 - last.1), bend.0, bend.1));
        }
        before = (*a, *b);
        step_before = Some(step);
    }
    share.min(box_shares(frame, domain, agent, from, to))
}

/// The domain, node by node and component by component.
fn box_shares<T: Real, const DIM: usize, const AGENTS: usize>(
    frame: &Frame<T, DIM, AGENTS>,
    domain: &Domain<T, DIM>,
    agent: &AgentFrame<T, DIM>,
    from: Side<'_, T, DIM>,
    to: Side<'_, T, DIM>,
) -> T {
    let mut share = T::one();
    let count = T::from_count(frame.intervals.max(1));
    let scale = (from.1 / agent.stride, to.1 / agent.stride);
    for (node, (a, b)) in from.0.iter().zip(to.0).enumerate() {
        let line = agent.start + agent.line * (T::from_count(node + 1) / count);
        let (low, high) = (domain.min - line, domain.max - line);
        for (((&a, &b), &low), &high) in a.iter().zip(b.iter()).zip(low.iter()).zip(high.iter()) {
            let bounds = ((low * scale.0, low * scale.1), (high * scale.0, high * scale.1));
            share = share.min(box_share(a, b, bounds.0, bounds.1));
        }
    }
    share
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ball_share_ends_on_the_ball() {
        let (a, b) = (Point::<f64, 2>::new(0.5, 0.0), Point::<f64, 2>::new(2.0, 1.0));
        let share = ball_share(&a, &b, 1.0, 0.8);
        let there = a + (b - a) * share;
        assert!((crate::math::norm(&there) - (1.0 - 0.2 * share)).abs() < 1e-14, "share {share}");
        assert!(share > 0.0 && share < 1.0);
    }

    #[test]
    fn ball_share_inside_is_whole() {
        let (a, b) = (Point::<f64, 2>::new(0.5, 0.0), Point::<f64, 2>::new(0.1, 0.9));
        assert_eq!(ball_share(&a, &b, 1.0, 1.0), 1.0);
    }

    #[test]
    fn box_share_ends_on_the_moving_bound() {
        let share = box_share(0.0_f64, 3.0, (-1.0, -1.0), (1.0, 2.0));
        assert!((3.0 * share - (1.0 + share)).abs() < 1e-14, "share {share}");
    }
}
