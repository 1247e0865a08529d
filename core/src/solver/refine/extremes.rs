//! Worst-case terms as unknowns: epsilon is not below any sign E_i, and it is epsilon that is minimised.
//!
//! Limits: [`EXTREMES_MAX`] worst-case terms an agent.

use heapless::Vec;

use crate::math::Real;
use crate::metrics::{Needs, Sample};
use crate::objective::needed_values;
use crate::scenario::{Reduce, Sense, Term, View};
use crate::trajectory::Trajectory;

use super::system::EXTREMES_MAX;

/// Worst values of all agents together.
const WORST_MAX: usize = 16;

/// One agent's worst value of one term.
#[derive(Clone, Copy, Debug)]
pub(super) struct Worst<T> {
    pub(super) agent: usize,
    pub(super) term: Term<T>,
    /// Place among the agent's columns.
    pub(super) slot: usize,
    /// Weight of the term times that of the agent.
    pub(super) weight: T,
    /// epsilon.
    pub(super) value: T,
}

impl<T: Real> Worst<T> {
    /// 1 where the term is minimised, -1 where it is maximised.
    pub(super) fn sign(&self) -> T {
        match self.term.sense {
            Sense::Minimize => T::one(),
            Sense::Maximize => -T::one(),
        }
    }

    /// Visits node and sign E_i of the nodes in the term's window.
    pub(super) fn for_each<const DIM: usize, const NODES: usize, const AGENTS: usize>(
        &self,
        scenario: &View<'_, T, DIM>,
        trajectory: &Trajectory<T, DIM, NODES, AGENTS>,
        scratch: &mut [Sample<T, DIM>],
        mut visit: impl FnMut(usize, T),
    ) {
        let needs = Needs::of([self.term.metric]);
        for (node, &time) in trajectory.times.iter().enumerate().take(trajectory.nodes()).skip(1) {
            if self.term.window.holds(time) {
                let values = needed_values(scenario, trajectory, (self.agent, node), needs, scratch);
                if let Some(value) = values.get(self.term.metric) {
                    visit(node, self.sign() * value);
                }
            }
        }
    }
}

/// All worst values of a scenario.
#[derive(Clone, Debug, Default)]
pub(super) struct Extremes<T>(pub(super) Vec<Worst<T>, WORST_MAX>);

impl<T: Real> Extremes<T> {
    /// The worst values of a scenario along a path, each with room above; `None` if there are too many of them.
    pub(super) fn new<const DIM: usize, const NODES: usize, const AGENTS: usize>(
        scenario: &View<'_, T, DIM>,
        trajectory: &Trajectory<T, DIM, NODES, AGENTS>,
        scratch: &mut [Sample<T, DIM>],
    ) -> Option<Self> {
        let mut all = Vec::new();
        for (index, agent) in scenario.agents.iter().enumerate() {
            let mut slot = 0;
            let terms = scenario.terms.iter().filter(|term| term.reduce == Reduce::Extreme);
            for term in terms.filter(|term| term.agents.contains(index) && term.weight * agent.weight > T::zero()) {
                let weight = term.weight * agent.weight;
                let mut worst = Worst { agent: index, term: *term, slot, weight, value: T::zero() };
                let (mut low, mut high) = (T::INFINITY, -T::INFINITY);
                worst.for_each(scenario, trajectory, scratch, |_, signed| {
                    (low, high) = (low.min(signed), high.max(signed));
                });
                if !high.finite() {
                    continue;
                }
                worst.value = high + (high - low).max(high.abs() * T::real(1e-3)).max(T::real(1e-6)) * T::real(0.05);
                if slot == EXTREMES_MAX || all.push(worst).is_err() {
                    return None;
                }
                slot += 1;
            }
        }
        Some(Self(all))
    }

    /// Those of one agent.
    pub(super) fn of(&self, agent: usize) -> impl Iterator<Item = &Worst<T>> {
        self.0.iter().filter(move |worst| worst.agent == agent)
    }

    /// Sum of weights times worst values.
    pub(super) fn total(&self) -> T {
        self.0.iter().fold(T::zero(), |sum, worst| sum + worst.weight * worst.value)
    }
}
