//! Sums and extremes of the terms while the nodes are visited.

use crate::math::Real;
use crate::metrics::{Adjoint, Needs, Values};
use crate::objective::Extreme;
use crate::objective::curvature::{Slope, Slopes};
use crate::objective::merit::Merit;
use crate::scenario::{Reduce, Sense, TERMS_MAX, Term, View};

/// Which terms a visit is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Which {
    /// All of them.
    All,
    /// Those that are integrals.
    Integrals,
    /// Those that are reduced to the worst value.
    Extremes,
}

/// The worst value of one term for one agent so far, as something that is minimised.
#[derive(Clone, Copy, Debug)]
struct Worst<T> {
    value: T,
    /// Node that has it; 0 while none was seen, as node 0 is no part of the objective.
    node: usize,
    /// Sum of exp(sharpness (E - `value`)).
    sum: T,
}

/// Sums and extremes so far.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tally<T, const AGENTS: usize> {
    /// Factor of everything.
    objective: T,
    /// Where extremes are smooth.
    sharpness: Option<T>,
    integrals: T,
    extremes: [[Worst<T>; AGENTS]; TERMS_MAX],
}

/// Whether a term is about an agent at a time.
fn applies<T: Real>(term: &Term<T>, agent: usize, time: T) -> bool {
    term.weight != T::zero() && term.agents.contains(agent) && term.window.holds(time)
}

/// 1 where a term is minimised, -1 where it is maximised.
fn sign<T: Real>(term: &Term<T>) -> T {
    match term.sense {
        Sense::Minimize => T::one(),
        Sense::Maximize => -T::one(),
    }
}

fn agent_weight<T: Real, const DIM: usize>(scenario: &View<'_, T, DIM>, agent: usize) -> T {
    scenario.agents.get(agent).map_or(T::zero(), |agent| agent.weight)
}

/// What the terms need to know of an agent at a time.
pub(super) fn needs<T: Real, const DIM: usize>(
    scenario: &View<'_, T, DIM>,
    agent: usize,
    time: T,
    which: Which,
) -> Needs {
    let mut needs = Needs::default();
    if agent_weight(scenario, agent) == T::zero() {
        return needs;
    }
    for term in scenario.terms {
        let wanted = match which {
            Which::All => true,
            Which::Integrals => term.reduce == Reduce::Integral,
            Which::Extremes => term.reduce == Reduce::Extreme,
        };
        if wanted && applies(term, agent, time) {
            needs.add(term.metric);
        }
    }
    needs
}

/// Slopes of the integral terms at a time.
pub(super) fn integral_slopes<T: Real, const DIM: usize>(
    scenario: &View<'_, T, DIM>,
    agent: usize,
    time: T,
    interval: T,
    slopes: &mut Slopes<T>,
) {
    let weight = agent_weight(scenario, agent) * interval;
    for term in scenario.terms.iter().filter(|term| term.reduce == Reduce::Integral) {
        if applies(term, agent, time) {
            let first = sign(term) * term.weight * weight;
            // There is room for every term.
            let _ = slopes.push(Slope { metric: term.metric, first, second: T::zero() });
        }
    }
}

impl<T: Real, const AGENTS: usize> Tally<T, AGENTS> {
    /// Nothing seen.
    pub(super) fn new(merit: &Merit<T>) -> Self {
        let sharpness = match merit.extreme {
            Extreme::Smooth { sharpness } if sharpness > T::zero() => Some(sharpness),
            _ => None,
        };
        let unseen = Worst { value: T::zero(), node: 0, sum: T::zero() };
        Self { objective: merit.objective, sharpness, integrals: T::zero(), extremes: [[unseen; AGENTS]; TERMS_MAX] }
    }

    /// Adds a node to the integrals.
    pub(super) fn integrate<const DIM: usize>(
        &mut self,
        scenario: &View<'_, T, DIM>,
        agent: usize,
        time: T,
        interval: T,
        values: &Values<T>,
    ) {
        let weight = agent_weight(scenario, agent);
        for term in scenario.terms.iter().filter(|term| term.reduce == Reduce::Integral) {
            if let (true, Some(value)) = (applies(term, agent, time), values.get(term.metric)) {
                self.integrals += sign(term) * term.weight * weight * interval * value;
            }
        }
    }

    /// Compares a node with the worst so far.
    pub(super) fn compare<const DIM: usize>(
        &mut self,
        scenario: &View<'_, T, DIM>,
        agent: usize,
        node: usize,
        time: T,
        values: &Values<T>,
    ) {
        for (term, by_agent) in scenario.terms.iter().zip(&mut self.extremes) {
            if term.reduce != Reduce::Extreme || !applies(term, agent, time) {
                continue;
            }
            if let (Some(value), Some(worst)) = (values.get(term.metric), by_agent.get_mut(agent)) {
                worst.enter(sign(term) * value, node, self.sharpness);
            }
        }
    }

    /// Derivatives of the terms by the figures of a node, and by its interval.
    ///
    /// Extreme terms need all nodes to have been compared before.
    pub(super) fn adjoint<const DIM: usize>(
        &self,
        scenario: &View<'_, T, DIM>,
        agent: usize,
        node: usize,
        time: T,
        interval: T,
        values: &Values<T>,
    ) -> (Adjoint<T>, T) {
        let weight = agent_weight(scenario, agent);
        let mut adjoint = Adjoint::default();
        let mut by_interval = T::zero();
        for (term, by_agent) in scenario.terms.iter().zip(&self.extremes) {
            if !applies(term, agent, time) {
                continue;
            }
            let Some(value) = values.get(term.metric) else {
                continue;
            };
            let sign = sign(term);
            let scale = sign * term.weight * weight * self.objective;
            let share = match term.reduce {
                Reduce::Integral => {
                    by_interval += scale * value;
                    interval
                }
                Reduce::Extreme => {
                    by_agent.get(agent).map_or(T::zero(), |worst| worst.share(sign * value, node, self.sharpness))
                }
            };
            if share != T::zero() {
                adjoint.add(term.metric, scale * share, values);
            }
        }
        (adjoint, by_interval)
    }

    /// Slopes of the extreme terms at a node, and the bend that is the node's own.
    pub(super) fn extreme_slopes<const DIM: usize>(
        &self,
        scenario: &View<'_, T, DIM>,
        agent: usize,
        node: usize,
        time: T,
        values: &Values<T>,
        slopes: &mut Slopes<T>,
    ) {
        let weight = agent_weight(scenario, agent);
        for (term, by_agent) in scenario.terms.iter().zip(&self.extremes) {
            if term.reduce != Reduce::Extreme || !applies(term, agent, time) {
                continue;
            }
            if let (Some(value), Some(worst)) = (values.get(term.metric), by_agent.get(agent)) {
                let share = term.weight * weight * worst.share(sign(term) * value, node, self.sharpness);
                let second = share * self.sharpness.unwrap_or_default();
                let _ = slopes.push(Slope { metric: term.metric, first: sign(term) * share, second });
            }
        }
    }

    /// The objective without penalty.
    pub(super) fn total<const DIM: usize>(&self, scenario: &View<'_, T, DIM>) -> T {
        let mut total = self.integrals;
        for (term, by_agent) in scenario.terms.iter().zip(&self.extremes) {
            for (worst, agent) in by_agent.iter().zip(scenario.agents).filter(|(worst, _)| worst.node > 0) {
                // The worst value already has the sign of something that is minimised.
                total += term.weight * agent.weight * worst.bound(self.sharpness);
            }
        }
        total * self.objective
    }
}

impl<T: Real> Worst<T> {
    fn enter(&mut self, value: T, node: usize, sharpness: Option<T>) {
        if self.node == 0 {
            *self = Self { value, node, sum: T::one() };
            return;
        }
        let sharpness = sharpness.unwrap_or_default();
        if value > self.value {
            self.sum = self.sum * (sharpness * (self.value - value)).exp() + T::one();
            (self.value, self.node) = (value, node);
        } else {
            self.sum += (sharpness * (value - self.value)).exp();
        }
    }

    /// Derivative of the bound by the value of a node.
    fn share(&self, value: T, node: usize, sharpness: Option<T>) -> T {
        match sharpness {
            Some(sharpness) => (sharpness * (value - self.value)).exp() / self.sum,
            None if node == self.node => T::one(),
            None => T::zero(),
        }
    }

    fn bound(&self, sharpness: Option<T>) -> T {
        sharpness.map_or(self.value, |sharpness| self.value + self.sum.ln() / sharpness)
    }
}
