//! The central path: which barrier parameter a step aims at, how far the iterate goes along it, and what becomes of the
//! multipliers.
//!
//! | symbol | name |
//! |---|---|
//! | mu | `barrier` |
//! | g, lambda | slack, multiplier |
//!
//! Limits: as those of the refinement.

use super::super::controls::{Bound, Kind};
use super::super::coordinates::{Frame, Iterate};
use super::super::feasible::largest_share;
use super::super::{Ledger, Settings, Status, Times, Workspace, guard, neighbours, race};
use super::barrier::Range;
use super::extremes::Extremes;
use super::newton::{Move, Solved};
use super::system::EXTREMES;
use super::{Refinement, barrier, rows};
use crate::math::Real;
use crate::objective::{self, Extreme};
use crate::scenario::View;

/// Factor between barrier parameters.
const BARRIER_FACTOR: f64 = 0.1;
/// The barrier parameter falls when a step predicts a decrease of less than this many of it for every slack.
const CENTERED: f64 = 0.0055;
/// It may fall by more than one factor when a step predicts less than this many of it for every slack,
const WELL_CENTERED: f64 = 0.0003;
/// to the least of these parts of it
const LEAPS: [f64; 2] = [1e-3, 1e-2];
/// at which bounds leave this much of the step.
const CLEAR_WAY: f64 = 0.95;
/// Part of the way to the boundary that a step may go.
const TO_BOUNDARY: f64 = 0.97;
/// Part of the predicted decrease that a step must bring.
const SUFFICIENT: f64 = 1e-4;
/// Halvings of one step.
pub(in crate::solver) const HALVINGS_MAX: usize = 25;
/// Least part of a multiplier that one step leaves.
const MULTIPLIER_LEFT: f64 = 0.01;
/// Largest factor of a multiplier that one step brings.
const MULTIPLIER_RANGE: f64 = 1e8;
/// Multipliers stay within this factor of mu / g.
const CENTRAL_RANGE: f64 = 1e4;
/// Steps in a row that gain no more than rounding, after which the barrier parameter falls, whatever they predict.
const SPENT: usize = 2;
/// Steps after which a candidate may have come to the champion's way.
const JOIN_AFTER: usize = 2;
/// A candidate is given up once what its step predicts, and this part of its barrier parameter for every slack, is too little
/// to come to what the champion is worth.
const LEFT: f64 = 0.5;
/// Barrier parameter over max(1, |objective|) from which on a candidate goes on to the end, and the most steps that it takes
/// for that: it would take as many to come back there later.
const NEAR_END: f64 = 1e-7;
const LAST_STEPS: usize = 6;
/// A refinement is held up by an instant at which terms change when it goes less than this part of so many steps in a row.
const HELD_UP: (f64, usize) = (0.05, 2);

/// One refinement under way.
pub(super) struct CentralPath<'a, T, const DIM: usize, const AGENTS: usize> {
    pub(super) scenario: &'a View<'a, T, DIM>,
    /// The problem with its integral terms only.
    pub(super) plain: &'a View<'a, T, DIM>,
    pub(super) settings: &'a Settings<T>,
    pub(super) frame: &'a Frame<T, DIM, AGENTS>,
    pub(super) extremes: Extremes<T>,
    pub(super) is_guarded: bool,
    /// Whether the systems hold what the nodes of the iterate bring, bounds aside.
    pub(super) is_laid: bool,
    /// Whether the last step gained no more than rounding.
    pub(super) is_spent: bool,
    /// Of the integral terms and the penalty, at the iterate.
    pub(super) objective: T,
    /// Sum of -ln g over all slacks, at the iterate.
    pub(super) logs: T,
    pub(super) barrier: T,
    pub(super) barrier_last: T,
    /// Of the smallest and of the largest pace.
    pub(super) pace_multipliers: [T; 2],
    /// Multipliers are taken within this factor of mu / g: 1 at first, which is what they begin as.
    pub(super) range: Range<T>,
    pub(super) shift: T,
    pub(super) times: Times,
}

/// How far a refinement came.
enum Followed {
    To(Status),
    /// To an instant at which terms change, where the objective jumps; so many steps are left.
    HeldUp {
        left: usize,
    },
}

impl<T: Real, const DIM: usize, const AGENTS: usize> CentralPath<'_, T, DIM, AGENTS> {
    /// Follows the path to the end; where an instant at which terms change holds it up, at flight times at which no node
    /// crosses one.
    pub(super) fn follow_through<const NODES: usize, const SENSORS: usize>(
        &mut self,
        workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
        ledger: &mut Ledger<T>,
        deadline: &mut dyn FnMut() -> bool,
    ) -> Status {
        let steps = self.settings.refinements;
        let left = match self.follow(steps, workspace, ledger, deadline) {
            Followed::To(status) => return status,
            Followed::HeldUp { left } => left,
        };
        let mut held = *self.frame;
        held.hold(neighbours::piece(self.scenario, self.frame.duration(workspace.iterate.pace)));
        // At the very instant there is no room on one side.
        let is_inside = held.pace_slacks(workspace.iterate.pace).into_iter().flatten().all(|slack| slack > T::zero());
        let mut rest = CentralPath {
            frame: if is_inside { &held } else { self.frame },
            extremes: self.extremes.clone(),
            times: Times::Held,
            ..*self
        };
        let followed = rest.follow(left, workspace, ledger, deadline);
        self.barrier = rest.barrier;
        match followed {
            Followed::To(status) => status,
            Followed::HeldUp { .. } => Status::Stalled,
        }
    }

    fn follow<const NODES: usize, const SENSORS: usize>(
        &mut self,
        steps: usize,
        workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
        ledger: &mut Ledger<T>,
        deadline: &mut dyn FnMut() -> bool,
    ) -> Followed {
        self.range = Range::of(T::one());
        self.frame.expand(&workspace.iterate, &mut workspace.trial);
        self.weigh(workspace);
        ledger.evaluations += 1;
        let (known, first) = (ledger.best, self.barrier);
        let (mut short, mut spent) = (0, 0);
        let near_end = T::real(NEAR_END) * known.abs().max(T::one());
        for step in 0..steps + ledger.patience {
            let is_ending = self.barrier <= near_end && step < steps + LAST_STEPS && !cfg!(feature = "compact");
            if step >= steps && ledger.best < known && self.barrier < first && !is_ending {
                break;
            }
            if deadline() {
                return Followed::To(Status::Deadline);
            }
            ledger.refinements += 1;
            let Some(newton) = self.newton(workspace, ledger) else { return Followed::To(Status::Stalled) };
            let is_centered = -newton.slope <= self.little(CENTERED);
            let Some(share) = self.advance(&newton, workspace, ledger) else {
                if self.barrier <= self.barrier_last {
                    return Followed::To(Status::Converged);
                }
                self.frame.expand(&workspace.iterate, &mut workspace.trial);
                self.barrier = self.lower();
                continue;
            };
            spent = if self.is_spent { spent + 1 } else { 0 };
            if spent >= SPENT && self.barrier > self.barrier_last {
                (spent, self.barrier) = (0, self.lower());
            }
            let rival = ledger.rival.filter(|_| step >= JOIN_AFTER && !cfg!(feature = "compact"));
            if let Some(rival) = rival
                && (share > T::real(0.5) && self.barrier < first && self.promise(&newton) > rival
                    || race::has_joined(self.scenario, &workspace.trial, &workspace.champion))
            {
                return Followed::To(Status::IterationLimit);
            }
            short = if share < T::real(HELD_UP.0) { short + 1 } else { 0 };
            if short >= HELD_UP.1 && self.may_be_held_up(workspace.iterate.pace) {
                let taken = step + 1;
                ledger.patience = ledger.patience.min(steps + ledger.patience - taken);
                return Followed::HeldUp { left: steps.saturating_sub(taken) };
            }
            if is_centered && share > T::real(0.5) && self.barrier <= self.barrier_last {
                return Followed::To(Status::Converged);
            }
        }
        Followed::To(Status::IterationLimit)
    }

    /// Whether there is an instant at which terms change that nodes may cross.
    fn may_be_held_up(&self, pace: T) -> bool {
        self.times == Times::Free
            && neighbours::piece(self.scenario, self.frame.duration(pace)).iter().any(Option::is_some)
    }

    /// A decrease of the merit that is so many barrier parameters for every slack of bounds on the path.
    fn little(&self, part: f64) -> T {
        let slacks = self.frame.agents * self.frame.intervals * (2 + 2 * DIM);
        T::from_count(slacks) * T::real(part) * self.barrier
    }

    /// What the objective comes to at the best, as far as the last step tells, which has been taken.
    fn promise(&self, step: &Move<T, AGENTS>) -> T {
        self.objective + self.extremes.total() + step.slope - self.little(LEFT)
    }

    /// The next barrier parameter.
    fn lower(&self) -> T {
        self.part(BARRIER_FACTOR)
    }

    /// A part of the barrier parameter, not below the last.
    fn part(&self, part: f64) -> T {
        (self.barrier * T::real(part)).max(self.barrier_last)
    }

    /// The barrier parameter that the step of the system just solved aims at: the one there was, or, where its own step would
    /// gain nothing to speak of, a smaller one.
    pub(super) fn choose<const NODES: usize, const SENSORS: usize>(
        &self,
        solved: &Solved<T, AGENTS>,
        workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
    ) -> T {
        let predicted = -solved.slope(self.barrier);
        if predicted > self.little(CENTERED) {
            return self.barrier;
        }
        if predicted <= self.little(WELL_CENTERED) {
            let domain = &self.scenario.frame.domain;
            for barrier in LEAPS.map(|part| self.part(part)) {
                self.lay(solved, barrier, workspace);
                let Workspace { iterate, candidate, .. } = workspace;
                let share = largest_share(self.frame, domain, iterate, candidate, iterate.pace)
                    .min(barrier::level_share(self.frame, iterate, candidate));
                if share >= T::real(CLEAR_WAY) {
                    return barrier;
                }
            }
        }
        self.lower()
    }

    /// Leaves the iterate plus the whole step for a barrier parameter in `workspace.candidate`.
    pub(super) fn lay<const NODES: usize, const SENSORS: usize>(
        &self,
        solved: &Solved<T, AGENTS>,
        barrier: T,
        workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
    ) {
        let Workspace { iterate, candidate, turns, .. } = workspace;
        let Some(refinement) = turns.refinement() else { return };
        let [pace, pull] = solved.pace;
        candidate.assign(iterate, self.frame);
        candidate.pace = iterate.pace + pace + barrier * pull;
        for (offsets, system) in candidate.interior_mut(self.frame).zip(&refinement.systems) {
            let steps = system.step.path.iter().zip(&system.pull.path);
            for (offset, (change, pull)) in offsets.iter_mut().zip(steps) {
                *offset += change + pull * barrier;
            }
        }
        for ((agent, kind), _) in self.frame.equipment() {
            let Some(system) = refinement.systems.get(agent) else { continue };
            let levels = candidate.levels_mut((agent, kind), self.frame.intervals);
            let steps = system.step.control.iter().zip(&system.pull.control);
            for (level, (change, pull)) in levels.iter_mut().zip(steps) {
                *level += change[kind as usize] + barrier * pull[kind as usize];
            }
        }
    }

    /// What a step is to lower: objective and worst values, and the barriers of all slacks.
    fn merit(&self, objective: T, extremes: &Extremes<T>, logs: T) -> T {
        objective + extremes.total() + self.barrier * logs
    }

    /// Sum of -ln g over the slacks of bounds and worst values; infinite outside.
    fn bound_logs<const NODES: usize>(
        &self,
        at: &Iterate<T, DIM, NODES, AGENTS>,
        extremes: &Extremes<T>,
        trial: &crate::Trajectory<T, DIM, NODES, AGENTS>,
        scratch: &mut [crate::metrics::Sample<T, DIM>],
    ) -> T {
        let domain = &self.scenario.frame.domain;
        let mut logs = barrier::log_slacks(self.frame, domain, at);
        for worst in &extremes.0 {
            let mut sum = barrier::LogSum::new();
            worst.for_each(self.scenario, trial, scratch, |_, signed| sum.add(worst.value - signed));
            logs += sum.total();
        }
        if logs.finite() { -logs } else { T::INFINITY }
    }

    /// Objective and slacks of the iterate, which `workspace.trial` holds written out.
    fn weigh<const NODES: usize, const SENSORS: usize>(
        &mut self,
        workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
    ) {
        let Workspace { iterate, next, trial, scratch, .. } = workspace;
        let bound_logs = self.bound_logs(iterate, &self.extremes, trial, scratch);
        next.assign(iterate, self.frame);
        let (objective, logs);
        (objective, logs, self.is_laid) = self.parts(workspace);
        (self.objective, self.logs) = (objective, logs + bound_logs);
    }

    /// What [`guard::parts`] says of `workspace.next`, which `workspace.trial` holds written out, and whether the systems then
    /// hold what its nodes bring. They do where the objective is a sum over the nodes of one agent, which comes with its
    /// derivatives: an iterate that is kept is not looked at twice.
    fn parts<const NODES: usize, const SENSORS: usize>(
        &self,
        workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
    ) -> (T, T, bool) {
        let Workspace { next, trial, scratch, turns, .. } = workspace;
        let is_sum = self.frame.agents == 1 && self.extremes.0.is_empty() && self.scenario.limits.is_empty();
        let refinement = turns.refinement().filter(|_| is_sum);
        let Some(Refinement { systems, .. }) = refinement else {
            let (objective, logs) = guard::parts(self.plain, trial, scratch);
            return (objective, logs, false);
        };
        let logs = guard::clearance_logs(self.plain, trial);
        if !logs.finite() {
            return (T::zero(), logs, false);
        }
        let integrals = self.lay_nodes(&self.source(next, trial), systems, scratch);
        (integrals + objective::lateness(self.plain, trial).0, logs, true)
    }

    /// Moves every multiplier along the whole step, which `workspace.candidate` is at, as far as the iterate is going to.
    fn move_multipliers<const NODES: usize, const SENSORS: usize>(
        &mut self,
        share: T,
        workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
    ) {
        let Workspace { iterate, candidate, turns, .. } = workspace;
        let (frame, barrier) = (self.frame, self.barrier);
        let Some(Refinement { systems, multipliers }) = turns.refinement() else { return };
        let share = share.max(T::real(0.1));
        let (left, range) = (T::real(MULTIPLIER_LEFT), T::real(MULTIPLIER_RANGE));
        // At the end of the step it is (mu - lambda dg) / g.
        let update = |multiplier: &mut T, slack: T, change: T| {
            let old = *multiplier;
            let target = (barrier - old * change) / slack;
            *multiplier = (old + (target - old) * share).max(old * left).min(old * range);
        };
        let pace_step = candidate.pace - iterate.pace;
        let agents = iterate.interior(frame).zip(frame.agent()).zip(systems.iter().zip(multipliers));
        for (index, ((offsets, agent), (system, multipliers))) in agents.enumerate() {
            let direction = system.step.path.get(..frame.intervals.saturating_sub(1)).unwrap_or_default();
            rows::for_each_ball(frame, agent, offsets, iterate.pace, |place, ball| {
                let Some(multiplier) = multipliers.of_ball(place, frame.intervals) else { return };
                update(multiplier, ball.slack(), ball.slack_change(direction, pace_step));
            });
            let domain = &self.scenario.frame.domain;
            barrier::for_each_wall(frame, domain, agent, (offsets, iterate.pace), |wall| {
                let moved = direction.get(wall.node).and_then(|node| node.get(wall.component)).copied();
                let change = wall.by_offset * moved.unwrap_or_default() + wall.by_pace * pace_step;
                let Some(multiplier) = multipliers.of_wall(wall) else { return };
                update(multiplier, wall.slack, change);
            });
            for (kind, bound) in Kind::ALL.into_iter().zip(agent.controls) {
                let Bound::Level { allowance } = bound else { continue };
                let kind_index = kind as usize;
                let levels = iterate.levels((index, kind), frame.intervals);
                let there = candidate.levels((index, kind), frame.intervals);
                let [low, high] = &mut multipliers.level;
                let (mut rest, mut rest_change) = (allowance * iterate.pace, allowance * pace_step);
                let sides = low[kind_index].iter_mut().zip(high[kind_index].iter_mut());
                for ((low, high), (&level, &there)) in sides.zip(levels.iter().zip(there)) {
                    let change = there - level;
                    update(low, level, change);
                    update(high, T::one() - level, -change);
                    (rest, rest_change) = (rest - level, rest_change - change);
                }
                update(&mut multipliers.budget[kind_index], rest, rest_change);
            }
        }
        let slacks = frame.pace_slacks(iterate.pace).into_iter().zip([pace_step, -pace_step]);
        for (multiplier, (slack, change)) in self.pace_multipliers.iter_mut().zip(slacks) {
            if let Some(slack) = slack {
                update(multiplier, slack, change);
            }
        }
    }

    /// Goes along the step as far as bounds and merit allow; returns the share, or `None` if nothing was gained.
    fn advance<const NODES: usize, const SENSORS: usize>(
        &mut self,
        step: &Move<T, AGENTS>,
        workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
        ledger: &mut Ledger<T>,
    ) -> Option<T> {
        let domain = &self.scenario.frame.domain;
        let merit = self.merit(self.objective, &self.extremes, self.logs);
        let Workspace { iterate, candidate, .. } = workspace;
        let bounds = largest_share(self.frame, domain, iterate, candidate, iterate.pace)
            .min(barrier::level_share(self.frame, iterate, candidate));
        let mut share = if bounds < T::one() { bounds * T::real(TO_BOUNDARY) } else { T::one() };
        let rounding = T::EPSILON * T::real(16.0) * merit.abs();
        for halving in 0..HALVINGS_MAX {
            let mut extremes = self.extremes.clone();
            for worst in &mut extremes.0 {
                let change = step.unknowns.get(worst.agent).and_then(|unknowns| unknowns.get(EXTREMES + worst.slot));
                worst.value += share * change.copied().unwrap_or_default();
            }
            let Workspace { iterate, candidate, next, trial, scratch, .. } = workspace;
            next.between(iterate, candidate, share, self.frame);
            self.frame.expand(next, trial);
            let bound_logs = self.bound_logs(next, &extremes, trial, scratch);
            ledger.evaluations += 1;
            let (objective, guard_logs, is_laid) = if !bound_logs.finite() {
                (T::zero(), T::INFINITY, false)
            } else if halving == 0 {
                self.parts(workspace)
            } else {
                let (objective, logs) = guard::parts(self.plain, trial, scratch);
                (objective, logs, false)
            };
            let logs = bound_logs + guard_logs;
            let value = self.merit(objective, &extremes, logs);
            if value.finite() && value <= merit + T::real(SUFFICIENT) * share * step.slope + rounding {
                (self.objective, self.logs, self.is_laid) = (objective, logs, is_laid);
                self.is_spent = merit - value <= rounding;
                self.keep_if_best(workspace, ledger);
                self.move_multipliers(share, workspace);
                self.range = Range::of(T::real(CENTRAL_RANGE));
                workspace.iterate.assign(&workspace.next, self.frame);
                self.extremes = extremes;
                return Some(share);
            }
            share *= T::real(0.5);
        }
        None
    }

    /// Takes `workspace.trial`, strictly feasible, as the incumbent if its objective is better.
    fn keep_if_best<const NODES: usize, const SENSORS: usize>(
        &self,
        workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
        ledger: &mut Ledger<T>,
    ) {
        // Terms without an unknown of their own count too: a node may have come into the window of one.
        let objective = if self.plain.terms.len() == self.scenario.terms.len() {
            self.objective
        } else {
            ledger.evaluations += 1;
            objective::value(self.scenario, &workspace.trial, Extreme::Exact, &mut workspace.scratch)
        };
        if objective < ledger.best {
            ledger.best = objective;
            workspace.best.assign(&workspace.trial);
        }
    }
}
