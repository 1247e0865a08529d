//! Regions and separations as barrier or penalty: they are not convex, so the projection cannot keep them.
//!
//! A barrier keeps a path that is clear of them clear; a penalty leads a path that is not to where it is. Slacks and
//! their derivatives come from [`crate::constraints::clearance`], those of limits from the metrics themselves.
//!
//! Source: (60)-(62).

use crate::constraints::clearance::{Clearance, clearance, separation_clearance};
use crate::math::{Point, Real};
use crate::metrics::{Needs, Sample};
use crate::objective::merit::{Guard, Merit, slacks};
use crate::objective::{self, Extreme, needed_values};
use crate::scenario::View;
use crate::trajectory::Trajectory;

/// Whether a scenario has constraints that the feasible set of the projection does not know.
pub(super) fn is_needed<T: Real, const DIM: usize>(scenario: &View<'_, T, DIM>) -> bool {
    !scenario.regions.is_empty() || !scenario.limits.is_empty() || scenario.frame.separation.is_some()
}

/// The objective, and the sum of -ln g over the slacks of regions, separations and limits, infinite outside them: what a
/// merit with a barrier of any weight is made of.
pub(super) fn parts<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    trajectory: &Trajectory<T, DIM, NODES, AGENTS>,
    scratch: &mut [Sample<T, DIM>],
) -> (T, T) {
    let guard = if is_needed(scenario) { Guard::Barrier { weight: T::one() } } else { Guard::None };
    let merit = Merit { extreme: Extreme::Exact, objective: T::one(), guard };
    let logs = clearance_logs(scenario, trajectory);
    if !logs.finite() {
        return (T::zero(), logs);
    }
    let (objective, limits) = objective::merit_parts(scenario, trajectory, &merit, scratch);
    (objective, logs + limits)
}

/// The sum of -ln g over the slacks of regions and separations, infinite outside them.
pub(super) fn clearance_logs<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    trajectory: &Trajectory<T, DIM, NODES, AGENTS>,
) -> T {
    let barrier = Guard::Barrier { weight: T::one() };
    let mut logs = T::zero();
    for_each_clearance(scenario, trajectory, |_, slack, _| logs += barrier.of(slack).0);
    logs
}

/// The value of a merit, regions and separations included, and its derivatives.
///
/// The derivatives are not written where the value is infinite.
pub(super) fn gradient<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    trajectory: &Trajectory<T, DIM, NODES, AGENTS>,
    merit: &Merit<T>,
    scratch: &mut [Sample<T, DIM>],
    gradient: &mut Trajectory<T, DIM, NODES, AGENTS>,
) -> T {
    let mut sum = T::zero();
    if merit.guard != Guard::None {
        for_each_clearance(scenario, trajectory, |_, slack, _| sum += merit.guard.of(slack).0);
    }
    if !sum.finite() {
        return sum;
    }
    let rest = objective::merit_gradient(scenario, trajectory, merit, scratch, gradient);
    if merit.guard != Guard::None {
        for_each_clearance(scenario, trajectory, |(agent, node), value, pull| {
            let by_clearance = merit.guard.of(value).1;
            if by_clearance != T::zero() {
                let Some(track) = gradient.tracks.get_mut(agent) else { return };
                let ends = track.path.get_mut(node.saturating_sub(1)..=node).unwrap_or_default();
                for (end, by_end) in ends.iter_mut().zip([pull.by_from, pull.by_to]) {
                    *end += by_end * by_clearance;
                }
            }
        });
    }
    sum + rest
}

/// The smallest slack of all regions, separations and limits; infinite where there are none.
pub(super) fn smallest_slack<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    trajectory: &Trajectory<T, DIM, NODES, AGENTS>,
    scratch: &mut [Sample<T, DIM>],
) -> T {
    let mut smallest = T::INFINITY;
    let mut take = |slack: T| smallest = if slack < smallest || slack.is_not_a_number() { slack } else { smallest };
    for_each_clearance(scenario, trajectory, |_, value, _| take(value));
    if !scenario.limits.is_empty() {
        let needs = Needs::of_limits(scenario.limits);
        for agent in 0..trajectory.agents() {
            for node in 1..trajectory.nodes() {
                let values = needed_values(scenario, trajectory, (agent, node), needs, scratch);
                for limit in scenario.limits {
                    let Some(value) = values.get(limit.metric) else { continue };
                    slacks(limit, value).into_iter().flatten().for_each(|(slack, _)| take(slack));
                }
            }
        }
    }
    smallest
}

/// Visits every clearance that counts: who and the node that its segment ends at, its value, and its derivatives by
/// both ends of the segment. A separation is visited once from either side; its value is shared between the visits.
pub(super) fn for_each_clearance<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    trajectory: &Trajectory<T, DIM, NODES, AGENTS>,
    mut visit: impl FnMut((usize, usize), T, &Clearance<T, DIM>),
) {
    let tracks = trajectory.active();
    for (agent, track) in tracks.iter().enumerate() {
        let ends = track.path.iter().zip(track.path.iter().skip(1)).zip(trajectory.times.iter().skip(1));
        for (index, ((from, to), &time)) in ends.enumerate().take(trajectory.intervals()) {
            for region in scenario.regions.iter().filter(|region| region.window.holds(time)) {
                let flat = clearance(region, &horizontal(from), &horizontal(to));
                let lifted =
                    Clearance { value: flat.value, by_from: lifted(&flat.by_from), by_to: lifted(&flat.by_to) };
                visit((agent, index + 1), flat.value, &lifted);
            }
            let Some(separation) = scenario.frame.separation else { continue };
            for (_, other_track) in tracks.iter().enumerate().filter(|(other, _)| *other != agent) {
                let other_ends = (other_track.path.get(index), other_track.path.get(index + 1));
                if let (Some(other_from), Some(other_to)) = other_ends {
                    let mut apart = separation_clearance(separation, from, to, other_from, other_to);
                    // The sum holds the clearance twice, and this is the only visit that moves this agent.
                    apart.by_from *= T::real(2.0);
                    apart.by_to *= T::real(2.0);
                    visit((agent, index + 1), apart.value, &apart);
                }
            }
        }
    }
}

/// The first two components.
fn horizontal<T: Real, const DIM: usize>(position: &Point<T, DIM>) -> Point<T, 2> {
    let mut components = position.iter().copied();
    Point::from_fn(|_, _| components.next().unwrap_or_default())
}

/// The inverse of [`horizontal`], with zeros above.
fn lifted<T: Real, const DIM: usize>(flat: &Point<T, 2>) -> Point<T, DIM> {
    let mut components = flat.iter().copied();
    Point::from_fn(|_, _| components.next().unwrap_or_default())
}

#[cfg(test)]
mod tests;
