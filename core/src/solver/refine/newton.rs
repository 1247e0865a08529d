//! One Newton step: the systems of all agents filled, factored and solved, with the pace that they share.
//!
//! | symbol | name |
//! |---|---|
//! | delta | `shift`: multiple of the metric that makes an indefinite system definite |
//!
//! The matrix does not depend on the barrier parameter that the step aims at, and the solution is linear in it.
//!
//! Limits: [`SHIFTS_MAX`] shifts are tried.

use heapless::Vec;

use super::super::controls::Bound;
use super::super::coordinates::Iterate;
use super::super::{Ledger, Workspace, guard};
use super::assemble::{self, Source};
use super::central_path::CentralPath;
use super::system::{BUDGETS, COLUMNS, Controls, EXTREMES, PACE, System, products};
use super::{Refinement, barrier};
use crate::math::Real;
use crate::metrics::Sample;
use crate::trajectory::Trajectory;

/// Factors tried for the shift of one system.
pub(in crate::solver) const SHIFTS_MAX: usize = 24;

/// What the solution of a system is besides the agents' parts, as coefficients of 1 and of mu.
pub(super) struct Solved<T, const AGENTS: usize> {
    pub(super) pace: [T; 2],
    pub(super) unknowns: Vec<[[T; COLUMNS]; 2], AGENTS>,
    /// Minus the predicted change of the merit, as coefficients of 1, mu and mu squared.
    pub(super) work: [T; 3],
}

impl<T: Real, const AGENTS: usize> Solved<T, AGENTS> {
    /// Predicted change of the merit with a barrier parameter, by the step that aims at it.
    pub(super) fn slope(&self, barrier: T) -> T {
        let [by_step, by_both, by_pull] = self.work;
        -(by_step + barrier * (by_both + barrier * by_pull))
    }

    /// The step that aims at a barrier parameter.
    pub(super) fn aim(&self, barrier: T) -> Move<T, AGENTS> {
        let mut step = Move { unknowns: Vec::new(), slope: self.slope(barrier) };
        for [unknowns, pulls] in &self.unknowns {
            let mut aimed = *unknowns;
            aimed.iter_mut().zip(pulls).for_each(|(aimed, &pull)| *aimed += barrier * pull);
            let _ = step.unknowns.push(aimed);
        }
        step
    }
}

/// A step of everything that is not in the iterate.
pub(super) struct Move<T, const AGENTS: usize> {
    pub(super) unknowns: Vec<[T; COLUMNS], AGENTS>,
    /// Predicted change of the merit.
    pub(super) slope: T,
}

impl<T: Real, const DIM: usize, const AGENTS: usize> CentralPath<'_, T, DIM, AGENTS> {
    /// Solves the Newton system; the iterate plus the step is left in `workspace.candidate`.
    pub(super) fn newton<const NODES: usize, const SENSORS: usize>(
        &mut self,
        workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
        ledger: &mut Ledger<T>,
    ) -> Option<Move<T, AGENTS>> {
        self.assemble(workspace);
        for (multiplier, slack) in
            self.pace_multipliers.iter_mut().zip(self.frame.pace_slacks(workspace.iterate.pace))
        {
            *multiplier =
                slack.map_or(T::zero(), |slack| barrier::held(*multiplier, self.barrier / slack, self.range));
        }
        let pace_equation = self.pace_equation(workspace);
        let smallest = T::real(1e-6) * (T::one() + self.barrier);
        let mut shift = if self.shift > T::zero() { self.shift * T::real(0.25) } else { T::zero() };
        for _ in 0..SHIFTS_MAX {
            ledger.factorizations += 1;
            if let Some(solved) = self.solve(shift, pace_equation, workspace) {
                self.shift = shift;
                return self.step(&solved, workspace);
            }
            shift = (shift * T::real(6.0)).max(smallest);
        }
        None
    }

    /// The step of a solved system, left in its systems too; the iterate plus it is left in `workspace.candidate`.
    fn step<const NODES: usize, const SENSORS: usize>(
        &mut self,
        solved: &Solved<T, AGENTS>,
        workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
    ) -> Option<Move<T, AGENTS>> {
        self.barrier = self.choose(solved, workspace);
        self.lay(solved, self.barrier, workspace);
        let refinement = workspace.turns.refinement()?;
        refinement.systems.iter_mut().take(self.frame.agents).for_each(|system| system.aim(self.barrier));
        let step = solved.aim(self.barrier);
        (step.slope.finite() && step.slope < T::zero()).then_some(step)
    }

    /// Fills the systems at the iterate, which `workspace.trial` holds written out.
    fn assemble<const NODES: usize, const SENSORS: usize>(
        &mut self,
        workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
    ) {
        let Workspace { iterate, trial, scratch, turns, .. } = workspace;
        let Some(Refinement { systems, multipliers }) = turns.refinement() else { return };
        let source = self.source(iterate, trial);
        if !self.is_laid {
            self.lay_nodes(&source, systems, scratch);
        }
        let agents = self.frame.agent().zip(systems.iter_mut()).zip(multipliers);
        for (index, ((agent, system), multipliers)) in agents.enumerate() {
            source.bounds(index, agent, multipliers, system);
        }
        if self.is_guarded {
            let pace = iterate.pace;
            guard::for_each_clearance(self.scenario, trial, |(index, node), slack, clearance| {
                let frame = self.frame.agent().nth(index);
                let parts = (systems.get_mut(index), iterate.offset.get(index), frame);
                if let (Some(system), Some(offsets), Some(agent)) = parts {
                    let ends = [clearance.by_from, clearance.by_to];
                    let scales = (offsets, agent.stride / pace, pace);
                    assemble::add_segment(system, scales, node, (self.barrier, slack), &ends);
                }
            });
        }
        // A system is used up by its solution.
        self.is_laid = false;
    }

    /// What systems are filled from at an iterate, which `trajectory` holds written out.
    pub(super) fn source<'b, const NODES: usize>(
        &'b self,
        iterate: &'b Iterate<T, DIM, NODES, AGENTS>,
        trajectory: &'b Trajectory<T, DIM, NODES, AGENTS>,
    ) -> Source<'b, T, DIM, NODES, AGENTS> {
        Source {
            plain: self.plain,
            frame: self.frame,
            iterate,
            trajectory,
            extremes: &self.extremes,
            barrier: self.barrier,
            range: self.range,
        }
    }

    /// Clears the systems and adds what the nodes bring, bounds aside; their integrals, where there is one agent.
    pub(super) fn lay_nodes<const NODES: usize>(
        &self,
        source: &Source<'_, T, DIM, NODES, AGENTS>,
        systems: &mut [System<T, DIM, NODES>],
        scratch: &mut [Sample<T, DIM>],
    ) -> T {
        let mut sum = T::zero();
        for (index, (agent, system)) in self.frame.agent().zip(systems).enumerate() {
            let [jam, azimuth, dropout] = agent.controls.map(|bound| bound != Bound::Off);
            let controls = if jam || azimuth || dropout { Controls::Some } else { Controls::None };
            let mut used = [false; COLUMNS];
            used[PACE] = true;
            used[BUDGETS] = jam;
            used[BUDGETS + 1] = dropout;
            for worst in self.extremes.of(index) {
                used.iter_mut().skip(EXTREMES + worst.slot).take(1).for_each(|used| *used = true);
            }
            system.clear(self.frame.intervals, controls, used);
            sum += source.nodes(index, agent, system, scratch);
            for worst in self.extremes.of(index) {
                let slot = system.border_right.get_mut(EXTREMES + worst.slot);
                slot.into_iter().for_each(|right| *right -= worst.weight);
            }
        }
        sum
    }

    /// What the pace's own equation has besides the agents' parts: the intervals, the penalty, its bounds. Its right-hand side
    /// is in coefficients of 1 and mu.
    fn pace_equation<const NODES: usize, const SENSORS: usize>(
        &self,
        workspace: &Workspace<T, DIM, NODES, SENSORS, AGENTS>,
    ) -> (T, [T; 2]) {
        let pace = workspace.iterate.pace;
        let timing = &self.scenario.frame.time;
        let duration = self.frame.duration(pace);
        let late = (self.frame.start_time + duration - timing.target).max(T::zero());
        let by_pace = -duration / pace;
        let two = T::real(2.0);
        let (mut weight, mut push, mut centre) = (T::zero(), T::zero(), T::zero());
        let sides = self.frame.pace_slacks(pace).into_iter().zip(self.pace_multipliers).zip([T::one(), -T::one()]);
        for ((slack, multiplier), side) in sides {
            let Some(slack) = slack else { continue };
            weight += multiplier / slack;
            centre += side / slack;
        }
        let penalty = timing.penalty * late * late;
        if late > T::zero() {
            weight += two * timing.penalty * (by_pace * by_pace - late * two * by_pace / pace);
            push -= two * timing.penalty * late * by_pace;
        }
        // Integrals are as 1 / r where nothing else moves.
        let integrals = self.objective - penalty;
        weight += two * integrals / (pace * pace);
        (weight, [push + integrals / pace, centre])
    }

    fn solve<const NODES: usize, const SENSORS: usize>(
        &self,
        shift: T,
        (global_weight, global_right): (T, [T; 2]),
        workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
    ) -> Option<Solved<T, AGENTS>> {
        let refinement = workspace.turns.refinement()?;
        let agents = self.frame.agents;
        let mut weight = global_weight + shift * self.frame.inertia;
        let mut right = global_right;
        let mut reduced = Vec::<_, AGENTS>::new();
        for system in refinement.systems.iter_mut().take(agents) {
            if !system.factor(shift) {
                return None;
            }
        }
        for system in refinement.systems.iter_mut().take(agents) {
            system.solve_all();
            let part = system.reduce()?;
            weight += part.weight();
            right.iter_mut().zip(part.right()).for_each(|(right, part)| *right += part);
            let _ = reduced.push(part);
        }
        if weight.is_not_a_number() || weight <= T::zero() {
            return None;
        }
        let pace = right.map(|right| right / weight);
        let mut solved = Solved { pace, unknowns: Vec::new(), work: products(&global_right, &pace) };
        for (system, part) in refinement.systems.iter_mut().zip(&reduced) {
            let unknowns = system.expand(part, pace);
            solved.work.iter_mut().zip(system.work(&unknowns)).for_each(|(work, part)| *work += part);
            let _ = solved.unknowns.push(unknowns);
        }
        let slope = solved.slope(self.barrier);
        (slope.finite() && slope < T::zero()).then_some(solved)
    }
}
