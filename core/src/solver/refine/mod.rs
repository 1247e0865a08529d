//! Second-order refinement: a feasible primal-dual interior point method with banded Newton systems.
//!
//! It starts from a feasible plan drawn a little inside its bounds and follows the central path of logarithmic
//! barriers: each step solves one Newton system in O(N), goes as far as bounds and the merit allow, and so stays
//! strictly feasible throughout. Flight time, budgets and worst values are the border of the system; agents are
//! coupled through the flight time exactly and through jamming by the gradient alone.
//!
//! | symbol | name |
//! |---|---|
//! | mu | `barrier` |
//! | g, lambda | slack, multiplier |
//! | delta | `shift`: multiple of the metric that makes an indefinite system definite |
//!
//! A system's matrix does not depend on the barrier parameter that its step aims at, and the step is linear in it. So mu is
//! chosen once the system is solved: where its step for the old mu would gain nothing to speak of, the same system gives the
//! step for a smaller one.
//!
//! The objective jumps where a node crosses an instant at which terms change. A step that would take the flight time across
//! is cut short again and again; after two, the flight time is held between its jumps.
//!
//! Limits: [`Settings::refinements`] steps, and a few more for a candidate of the race; local, from the basin of its start;
//! not used where a scenario has more than two worst-case terms an agent.

mod assemble;
mod barrier;
mod block;
mod extremes;
mod limits;
mod rows;
mod system;

use heapless::Vec;

use crate::math::Real;
use crate::objective::{self, Extreme};
use crate::scenario::{Reduce, TERMS_MAX, Term, View};

use super::controls::{Bound, Kind};
use super::coordinates::{Frame, Iterate};
use super::feasible::largest_share;
use super::{Ledger, Settings, Status, Times, Workspace, guard, neighbours};
use assemble::Source;
use barrier::Multipliers;
use extremes::Extremes;
use system::{BUDGETS, COLUMNS, Controls, EXTREMES, PACE, System, products};

/// Part of the pace that a start gives up to come inside its bounds.
const INSIDE: f64 = 0.02;
/// First barrier parameter over max(1, |objective|).
const FIRST_BARRIER: f64 = 1e-3;
/// Last barrier parameter over max(1, |objective|).
const LAST_BARRIER: f64 = 1e-11;
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
/// Factors tried for the shift of one system.
pub(super) const SHIFTS_MAX: usize = 24;
/// Halvings of one step.
pub(super) const HALVINGS_MAX: usize = 25;
/// Least part of a multiplier that one step leaves.
const MULTIPLIER_LEFT: f64 = 0.01;
/// Largest factor of a multiplier that one step brings.
const MULTIPLIER_RANGE: f64 = 1e8;
/// Multipliers stay within this factor of mu / g.
const CENTRAL_RANGE: f64 = 1e4;
/// A refinement is held up by an instant at which terms change when it goes less than this part of so many steps in a row.
const HELD_UP: (f64, usize) = (0.05, 2);

/// One for each agent; none where nothing is refined.
#[cfg(not(feature = "first-order"))]
type Each<V, const AGENTS: usize> = [V; AGENTS];
#[cfg(feature = "first-order")]
type Each<V, const AGENTS: usize> = [V; 0];

/// Memory of a refinement.
#[derive(Clone, Debug)]
pub(super) struct Refinement<T, const DIM: usize, const NODES: usize, const AGENTS: usize> {
    systems: Each<System<T, DIM, NODES>, AGENTS>,
    multipliers: Each<Multipliers<T, DIM, NODES>, AGENTS>,
}

impl<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize> Refinement<T, DIM, NODES, AGENTS> {
    /// All zeros.
    pub(super) const EMPTY: Self =
        Self { systems: [const { System::empty() }; _], multipliers: [const { Multipliers::zeros() }; _] };
}

/// Improves the incumbent `workspace.best`, which must be feasible and clear of regions and limits.
pub(super) fn polish<T, const DIM: usize, const NODES: usize, const SENSORS: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    settings: &Settings<T>,
    workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
    ledger: &mut Ledger<T>,
    deadline: &mut dyn FnMut() -> bool,
) -> Option<Status>
where
    T: Real,
{
    let mut frame = Frame::<T, DIM, AGENTS>::new(scenario, workspace.best.duration());
    if ledger.times == Times::Held {
        frame.hold(neighbours::piece(scenario, workspace.best.duration()));
    }
    let mut integral_terms = Vec::<Term<T>, TERMS_MAX>::new();
    for term in scenario.terms.iter().filter(|term| term.reduce == Reduce::Integral) {
        let _ = integral_terms.push(*term);
    }
    let plain = View { terms: &integral_terms, ..*scenario };
    frame.collapse(&workspace.best, &mut workspace.iterate);
    workspace.trial.assign(&workspace.best);
    let is_inside = ledger.barrier > T::zero()
        && barrier::log_slacks(&frame, &scenario.frame.domain, &workspace.iterate).finite()
        && guard::smallest_slack(scenario, &workspace.best, &mut workspace.scratch) > T::zero();
    if !is_inside && !draw_inside(scenario, &frame, workspace, ledger.inside) {
        return None;
    }
    frame.expand(&workspace.iterate, &mut workspace.trial);
    let extremes = Extremes::new(scenario, &workspace.trial, &mut workspace.scratch)?;
    let scale = ledger.best.abs().max(T::one());
    let first = T::real(FIRST_BARRIER) * scale * ledger.first;
    let mut path = CentralPath {
        scenario,
        plain: &plain,
        settings,
        frame: &frame,
        extremes,
        is_guarded: guard::is_needed(scenario),
        objective: T::zero(),
        logs: T::zero(),
        barrier: if is_inside { ledger.barrier.min(first) } else { first },
        barrier_last: T::real(LAST_BARRIER).max(T::EPSILON) * scale,
        pace_multipliers: [T::zero(); 2],
        range: T::one(),
        shift: T::zero(),
        times: ledger.times,
    };
    let status = path.follow_through(workspace, ledger, deadline);
    ledger.barrier = path.barrier;
    Some(status)
}

/// Draws the incumbent, in `workspace.iterate`, inside its bounds by `part` of the usual way; false if that fails.
fn draw_inside<T, const DIM: usize, const NODES: usize, const SENSORS: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    frame: &Frame<T, DIM, AGENTS>,
    workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
    part: T,
) -> bool
where
    T: Real,
{
    let domain = &scenario.frame.domain;
    workspace.candidate.assign(&workspace.iterate, frame);
    let mut inside = T::real(INSIDE) * part;
    for _ in 0..4 {
        let Workspace { iterate, candidate, trial, scratch, .. } = workspace;
        // The same path, flown a little slower.
        let slower = candidate.pace.min(frame.pace_max.unwrap_or(T::MAX)) * (T::one() - inside);
        let pace = slower.max(frame.pace_min + (candidate.pace - frame.pace_min) * T::real(0.5));
        let share = pace / candidate.pace;
        iterate.pace = pace;
        for ((mine, theirs), agent) in iterate.interior_mut(frame).zip(candidate.interior(frame)).zip(frame.agent()) {
            let count = T::from_count(frame.intervals);
            let gap = inside * T::real(0.2);
            for (node, (mine, theirs)) in mine.iter_mut().zip(theirs).enumerate() {
                *mine = theirs * share;
                let line = agent.start + agent.line * (T::from_count(node + 1) / count);
                let low = (domain.min - line) * (pace / agent.stride);
                let high = (domain.max - line) * (pace / agent.stride);
                for ((value, &low), &high) in mine.iter_mut().zip(low.iter()).zip(high.iter()) {
                    let gap = gap.min((high - low) * T::real(0.25));
                    *value = value.clamp_to(low + gap, high - gap);
                }
            }
        }
        for (slot, bound) in frame.equipment() {
            let Bound::Level { allowance } = bound else { continue };
            let levels = iterate.levels_mut(slot, frame.intervals);
            let mut sum = T::zero();
            for (mine, &theirs) in levels.iter_mut().zip(candidate.levels(slot, frame.intervals)) {
                *mine = inside + (T::one() - inside - inside) * theirs;
                sum += *mine;
            }
            let most = allowance * pace * (T::one() - inside);
            if sum > most {
                levels.iter_mut().for_each(|level| *level *= most / sum);
            }
        }
        let is_inside = barrier::log_slacks(frame, domain, iterate).finite();
        frame.expand(iterate, trial);
        if is_inside && guard::smallest_slack(scenario, trial, scratch) > T::zero() {
            return true;
        }
        inside *= T::real(0.2);
    }
    false
}

/// One refinement under way.
struct CentralPath<'a, T, const DIM: usize, const AGENTS: usize> {
    scenario: &'a View<'a, T, DIM>,
    /// The problem with its integral terms only.
    plain: &'a View<'a, T, DIM>,
    settings: &'a Settings<T>,
    frame: &'a Frame<T, DIM, AGENTS>,
    extremes: Extremes<T>,
    is_guarded: bool,
    /// Of the integral terms and the penalty, at the iterate.
    objective: T,
    /// Sum of -ln g over all slacks, at the iterate.
    logs: T,
    barrier: T,
    barrier_last: T,
    /// Of the smallest and of the largest pace.
    pace_multipliers: [T; 2],
    /// Multipliers are taken within this factor of mu / g: 1 at first, which is what they begin as.
    range: T,
    shift: T,
    times: Times,
}

/// How far a refinement came.
enum Followed {
    To(Status),
    /// To an instant at which terms change, where the objective jumps; so many steps are left.
    HeldUp {
        left: usize,
    },
}

/// What the solution of a system is besides the agents' parts, as coefficients of 1 and of mu.
struct Solved<T, const AGENTS: usize> {
    pace: [T; 2],
    unknowns: Vec<[[T; COLUMNS]; 2], AGENTS>,
    /// Minus the predicted change of the merit, as coefficients of 1, mu and mu squared.
    work: [T; 3],
}

impl<T: Real, const AGENTS: usize> Solved<T, AGENTS> {
    /// Predicted change of the merit with a barrier parameter, by the step that aims at it.
    fn slope(&self, barrier: T) -> T {
        let [by_step, by_both, by_pull] = self.work;
        -(by_step + barrier * (by_both + barrier * by_pull))
    }

    /// The step that aims at a barrier parameter.
    fn aim(&self, barrier: T) -> Move<T, AGENTS> {
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
struct Move<T, const AGENTS: usize> {
    unknowns: Vec<[T; COLUMNS], AGENTS>,
    /// Predicted change of the merit.
    slope: T,
}

impl<T: Real, const DIM: usize, const AGENTS: usize> CentralPath<'_, T, DIM, AGENTS> {
    /// Follows the path to the end; where an instant at which terms change holds it up, at flight times at which no node
    /// crosses one.
    fn follow_through<const NODES: usize, const SENSORS: usize>(
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
        self.range = T::one();
        self.frame.expand(&workspace.iterate, &mut workspace.trial);
        self.weigh(workspace);
        ledger.evaluations += 1;
        let (known, first) = (ledger.best, self.barrier);
        let mut short = 0;
        for step in 0..steps + ledger.patience {
            if step >= steps && ledger.best < known && self.barrier < first {
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
    fn choose<const NODES: usize, const SENSORS: usize>(
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
    fn lay<const NODES: usize, const SENSORS: usize>(
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
        let Workspace { iterate, trial, scratch, .. } = workspace;
        let (objective, logs) = guard::parts(self.plain, trial, scratch);
        self.objective = objective;
        self.logs = logs + self.bound_logs(iterate, &self.extremes, trial, scratch);
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

    /// Solves the Newton system; the iterate plus the step is left in `workspace.candidate`.
    fn newton<const NODES: usize, const SENSORS: usize>(
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

    fn assemble<const NODES: usize, const SENSORS: usize>(
        &self,
        workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
    ) {
        let Workspace { iterate, trial, scratch, turns, .. } = workspace;
        let Some(Refinement { systems, multipliers }) = turns.refinement() else { return };
        let source = Source {
            plain: self.plain,
            frame: self.frame,
            iterate,
            trajectory: trial,
            extremes: &self.extremes,
            barrier: self.barrier,
            range: self.range,
        };
        let agents = self.frame.agent().zip(systems.iter_mut()).zip(multipliers);
        for (index, ((agent, system), multipliers)) in agents.enumerate() {
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
            source.fill(index, agent, multipliers, system, scratch);
            for worst in self.extremes.of(index) {
                let slot = system.border_right.get_mut(EXTREMES + worst.slot);
                slot.into_iter().for_each(|right| *right -= worst.weight);
            }
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
        for _ in 0..HALVINGS_MAX {
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
            let (objective, guard_logs) =
                if bound_logs.finite() { guard::parts(self.plain, trial, scratch) } else { (T::zero(), T::INFINITY) };
            let logs = bound_logs + guard_logs;
            let value = self.merit(objective, &extremes, logs);
            if value.finite() && value <= merit + T::real(SUFFICIENT) * share * step.slope + rounding {
                (self.objective, self.logs) = (objective, logs);
                self.keep_if_best(workspace, ledger);
                self.move_multipliers(share, workspace);
                self.range = T::real(CENTRAL_RANGE);
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
