//! Limits on metrics at the nodes 1 .. N.
//!
//! Source: (61), (62).

use crate::constraints::{Worst, raise};
use crate::math::Real;
use crate::metrics::{Needs, Sample};
use crate::objective::needed_values;
use crate::scenario::{LIMITS_MAX, Limit, View};
use crate::trajectory::Trajectory;

/// Farthest that the metric of `agent` lies outside each limit, relative to the upper limit, else the lower, at least
/// 1e-9; entries past the last limit are 0.
pub fn excess<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    trajectory: &Trajectory<T, DIM, NODES, AGENTS>,
    agent: usize,
    scratch: &mut [Sample<T, DIM>],
) -> [Worst<T>; LIMITS_MAX] {
    let mut worst = [Worst::none(); LIMITS_MAX];
    if scenario.limits.is_empty() {
        return worst;
    }
    let needs = Needs::of_limits(scenario.limits);
    for node in 1..trajectory.nodes() {
        let values = needed_values(scenario, trajectory, (agent, node), needs, scratch);
        for (limit, worst) in scenario.limits.iter().zip(&mut worst) {
            if let Some(value) = values.get(limit.metric) {
                worst.raise(node, outside(limit, value) / scale(limit));
            }
        }
    }
    worst
}

/// What a violation of the limit is relative to.
fn scale<T: Real>(limit: &Limit<T>) -> T {
    limit.max.or(limit.min).unwrap_or_default().abs().max(T::real(1e-9))
}

/// How far `value` lies outside the limit, in the unit of the metric; 0 inside.
fn outside<T: Real>(limit: &Limit<T>, value: T) -> T {
    let mut outside = T::zero();
    raise(&mut outside, limit.max.map_or(T::zero(), |max| value - max));
    raise(&mut outside, limit.min.map_or(T::zero(), |min| min - value));
    outside
}
