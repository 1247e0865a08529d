//! What the world looked like along a plan, to be compared with what it looks like later.

use crate::math::Real;
use crate::metrics::{Needs, Sample};
use crate::objective::needed_values;
use crate::scenario::{Sense, View};
use crate::trajectory::{Trajectory, shift};

/// What the objective sums, node by node along a plan.
#[derive(Clone, Debug)]
pub(super) struct Outlook<T, const NODES: usize, const AGENTS: usize> {
    values: [[T; NODES]; AGENTS],
    /// Largest less smallest value along the first plan, of the agent where it is largest; zero before the first.
    span: T,
}

impl<T: Real, const NODES: usize, const AGENTS: usize> Outlook<T, NODES, AGENTS> {
    pub(super) fn empty() -> Self {
        Self { values: [[T::zero(); NODES]; AGENTS], span: T::zero() }
    }

    /// Remembers the world of `scenario` along a plan.
    pub(super) fn take<const DIM: usize>(
        &mut self,
        scenario: &View<'_, T, DIM>,
        plan: &Trajectory<T, DIM, NODES, AGENTS>,
        scratch: &mut [Sample<T, DIM>],
    ) {
        let is_first = self.span == T::zero();
        for (agent, values) in self.values.iter_mut().enumerate().take(plan.agents()) {
            let (mut low, mut high) = (T::INFINITY, -T::INFINITY);
            for (node, value) in values.iter_mut().enumerate().take(plan.nodes()).skip(1) {
                *value = density(scenario, plan, (agent, node), scratch);
                (low, high) = (low.min(*value), high.max(*value));
            }
            if is_first {
                let size = if high > low { high - low } else { high.abs() };
                self.span = self.span.max(size);
            }
        }
        if is_first && !(self.span > T::zero() && self.span.finite()) {
            self.span = T::one();
        }
    }

    /// Forgets the first `count` intervals, which were flown.
    pub(super) fn advance(&mut self, count: usize) {
        for values in &mut self.values {
            shift(values, count);
        }
    }

    /// Mean change of the values along a plan since they were taken along it, over their span; 0 before the first.
    pub(super) fn change<const DIM: usize>(
        &self,
        scenario: &View<'_, T, DIM>,
        plan: &Trajectory<T, DIM, NODES, AGENTS>,
        scratch: &mut [Sample<T, DIM>],
    ) -> T {
        if self.span == T::zero() {
            return T::zero();
        }
        let mut sum = T::zero();
        for (agent, values) in self.values.iter().enumerate().take(plan.agents()) {
            for (node, &value) in values.iter().enumerate().take(plan.nodes()).skip(1) {
                sum += (density(scenario, plan, (agent, node), scratch) - value).abs();
            }
        }
        let count = T::from_count((plan.intervals() * plan.agents()).max(1));
        sum / count / self.span
    }
}

/// The sum of the terms of the objective that apply to an agent at a node, as if all were integrals.
fn density<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    plan: &Trajectory<T, DIM, NODES, AGENTS>,
    (agent, node): (usize, usize),
    scratch: &mut [Sample<T, DIM>],
) -> T {
    let time = plan.times.get(node).copied().unwrap_or_default();
    let weight = scenario.agents.get(agent).map_or(T::zero(), |agent| agent.weight);
    let terms = scenario.terms.iter().filter(|term| term.agents.contains(agent) && term.window.holds(time));
    let needs = Needs::of(terms.clone().map(|term| term.metric));
    let values = needed_values(scenario, plan, (agent, node), needs, scratch);
    terms.fold(T::zero(), |sum, term| {
        let value = values.get(term.metric).unwrap_or_default() * term.weight * weight;
        if term.sense == Sense::Maximize { sum - value } else { sum + value }
    })
}
