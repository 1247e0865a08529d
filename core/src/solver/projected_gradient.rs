//! Spectral projected gradient in the velocity metric, with a non-monotone line search.
//!
//! Each iteration projects the gradient step on the bounds, makes the result exactly feasible, and searches along
//! the segment to it, every point of which is feasible. The step length is the Barzilai-Borwein quotient in the
//! metric. Worst-case terms are smoothed by a log-sum-exp whose sharpness rises from stage to stage; the incumbent
//! is always judged by the exact objective.
//!
//! Limits: [`Settings::iterations`] over all stages, [`Settings::line_search_steps`] a search.

use crate::math::{Point, Real, norm};
use crate::metrics::Needs;
use crate::objective::merit::{Guard, Merit};
use crate::objective::{self, Extreme};
use crate::scenario::{Domain, Reduce, View};

use super::controls::Bound;
use super::coordinates::{Frame, Iterate};
use super::feasible::largest_share;
use super::projection::Request;
use super::{Keeps, Ledger, Settings, Status, Workspace, guard};

/// Earlier values that a new one is compared with; 1 would make the search monotone.
const MEMORY: usize = 8;
/// Part of the predicted decrease that a step must bring.
const SUFFICIENT: f64 = 1e-4;
/// Sharpness of worst-case terms by stage, over the spread of the metric along the first path.
const SHARPNESS: [f64; 4] = [10.0, 50.0, 250.0, 1250.0];
/// Stages of one descent, that which leads clear of regions and limits aside.
pub(super) const STAGES_MAX: usize = SHARPNESS.len();
/// Weight of the barriers by stage, over the objective.
const BARRIER: [f64; 4] = [1e-3, 1e-4, 1e-5, 1e-6];
/// Iterations by which [`clear`] goes on from where regions and limits are left.
const AWAY: usize = 3;
/// Slack of regions and limits that a restored start has.
const CLEAR: f64 = 1e-2;
/// Slack with which a start is not restored.
pub(super) const CLEAR_ENOUGH: f64 = CLEAR * 0.5;
/// Bounds on the spectral step, relative to the first.
const STEP_RANGE: f64 = 1e8;
/// The first step moves velocities by about this part of the largest speed.
const FIRST_CHANGE: f64 = 0.3;
/// No step moves them by more than this part, were there no bounds.
const LARGEST_CHANGE: f64 = 3.0;
/// Steps that bring nothing before a stage gives up.
const FAILURES_MAX: usize = 4;

/// How a stage ended.
enum Ending {
    Status(Status),
    Stop(Status),
}

/// Improves `workspace.best`, which must be feasible.
pub(super) fn descend<T, const DIM: usize, const NODES: usize, const SENSORS: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    settings: &Settings<T>,
    workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
    ledger: &mut Ledger<T>,
    deadline: &mut dyn FnMut() -> bool,
) -> Status
where
    T: Real,
{
    let frame = Frame::<T, DIM, AGENTS>::new(scenario, workspace.best.duration());
    begin(scenario, &frame, workspace, ledger);
    if !ledger.best.finite() {
        return Status::NonFinite;
    }
    Stages::of(scenario, settings, &frame, ledger).run(workspace, ledger, deadline)
}

/// Leads `workspace.best`, which must be feasible but for regions and limits, clear of these, and [`AWAY`] iterations away from
/// them, where a refinement can begin; `Some` if that fails.
pub(super) fn clear<T, const DIM: usize, const NODES: usize, const SENSORS: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    settings: &Settings<T>,
    workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
    ledger: &mut Ledger<T>,
    deadline: &mut dyn FnMut() -> bool,
) -> Option<Status>
where
    T: Real,
{
    let frame = Frame::<T, DIM, AGENTS>::new(scenario, workspace.best.duration());
    begin(scenario, &frame, workspace, ledger);
    if !ledger.best.finite() {
        return Some(Status::NonFinite);
    }
    let stages = Stages::of(scenario, settings, &frame, ledger);
    if let Some(status) = stages.restore(workspace, ledger, deadline) {
        return Some(status);
    }
    let quota = (ledger.iterations + AWAY).min(stages.before + settings.iterations);
    stages.descent(stages.merit(Extreme::Exact, BARRIER[0], ledger), quota).run(workspace, ledger, deadline);
    None
}

/// Takes `workspace.best` for what a descent begins with.
fn begin<T, const DIM: usize, const NODES: usize, const SENSORS: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    frame: &Frame<T, DIM, AGENTS>,
    workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
    ledger: &mut Ledger<T>,
) where
    T: Real,
{
    frame.collapse(&workspace.best, &mut workspace.iterate);
    workspace.trial.assign(&workspace.best);
    workspace.by_trajectory.assign(&workspace.best);
    workspace.anchor.assign(&workspace.iterate, frame);
    lay_anchor(scenario, frame, &mut workspace.anchor);
    workspace.projection.prepare(frame);
    ledger.best = objective::value(scenario, &workspace.best, Extreme::Exact, &mut workspace.scratch);
    ledger.evaluations += 1;
}

/// The order of merits: restoration where the start is not clear of regions and limits, then barriers that soften
/// and extremes that sharpen together.
struct Stages<'a, T, const DIM: usize, const AGENTS: usize> {
    scenario: &'a View<'a, T, DIM>,
    settings: &'a Settings<T>,
    frame: &'a Frame<T, DIM, AGENTS>,
    /// Whether there are regions or limits.
    is_guarded: bool,
    /// Iterations that were done before.
    before: usize,
}

impl<'a, T: Real, const DIM: usize, const AGENTS: usize> Stages<'a, T, DIM, AGENTS> {
    fn of(
        scenario: &'a View<'a, T, DIM>,
        settings: &'a Settings<T>,
        frame: &'a Frame<T, DIM, AGENTS>,
        ledger: &Ledger<T>,
    ) -> Self {
        Self { scenario, settings, frame, is_guarded: guard::is_needed(scenario), before: ledger.iterations }
    }

    fn run<const NODES: usize, const SENSORS: usize>(
        &self,
        workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
        ledger: &mut Ledger<T>,
        deadline: &mut dyn FnMut() -> bool,
    ) -> Status {
        let has_extremes = self.scenario.terms.iter().any(|term| term.reduce == Reduce::Extreme);
        if self.is_guarded
            && let Some(status) = self.restore(workspace, ledger, deadline)
        {
            return status;
        }
        let stages = if has_extremes || self.is_guarded { SHARPNESS.len() } else { 1 };
        let before = ledger.iterations;
        let mut status = Status::IterationLimit;
        for (stage, (sharpness, weight)) in SHARPNESS.into_iter().zip(BARRIER).take(stages).enumerate() {
            let extreme = if has_extremes {
                Extreme::Smooth { sharpness: T::real(sharpness) / spread(self.scenario, workspace) }
            } else {
                Extreme::Exact
            };
            let quota = before + self.settings.iterations * (stage + 1) / stages;
            let merit = self.merit(extreme, weight, ledger);
            match self.descent(merit, quota).run(workspace, ledger, deadline) {
                Ending::Status(ended) => status = ended,
                Ending::Stop(ended) => return ended,
            }
            // The next stage starts from the best path so far.
            self.frame.collapse(&workspace.best, &mut workspace.iterate);
        }
        status
    }

    /// Leads a start that is not clear of regions and limits to where it is; `Some` if that fails.
    fn restore<const NODES: usize, const SENSORS: usize>(
        &self,
        workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
        ledger: &mut Ledger<T>,
        deadline: &mut dyn FnMut() -> bool,
    ) -> Option<Status> {
        let margin = T::real(CLEAR);
        if guard::smallest_slack(self.scenario, &workspace.best, &mut workspace.scratch) >= T::real(CLEAR_ENOUGH) {
            return None;
        }
        let penalty = Guard::Penalty { weight: T::one(), margin };
        let merit = Merit { extreme: Extreme::Exact, objective: T::zero(), guard: penalty };
        ledger.best = T::INFINITY;
        ledger.keeps = Keeps::Clearer;
        self.descent(merit, self.before + self.settings.iterations).run(workspace, ledger, deadline);
        ledger.keeps = Keeps::Better;
        let slack = guard::smallest_slack(self.scenario, &workspace.best, &mut workspace.scratch);
        ledger.best = objective::value(self.scenario, &workspace.best, Extreme::Exact, &mut workspace.scratch);
        self.frame.collapse(&workspace.best, &mut workspace.iterate);
        if slack > T::zero() {
            return None;
        }
        // Cut off or not: what there is cannot be flown.
        Some(Status::Infeasible)
    }

    /// The objective, with a barrier of `weight` times it on regions and limits where there are any.
    fn merit(&self, extreme: Extreme<T>, weight: f64, ledger: &Ledger<T>) -> Merit<T> {
        let weight = T::real(weight) * ledger.best.abs().max(T::one());
        let guard = if self.is_guarded { Guard::Barrier { weight } } else { Guard::None };
        Merit { extreme, objective: T::one(), guard }
    }

    fn descent(&self, merit: Merit<T>, quota: usize) -> Descent<'_, T, DIM, AGENTS> {
        Descent { scenario: self.scenario, settings: self.settings, frame: self.frame, merit, quota }
    }
}

/// Moves the anchor inside the bounds: straight lines, a little slower than they could be.
///
/// With a start velocity the straight line may be out of bounds; the start itself, which keeps a margin, stays the
/// anchor then.
pub(super) fn lay_anchor<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    frame: &Frame<T, DIM, AGENTS>,
    anchor: &mut Iterate<T, DIM, NODES, AGENTS>,
) {
    if scenario.agents.iter().any(|agent| agent.start_velocity.is_some()) {
        return;
    }
    let count = T::from_count(frame.intervals);
    let fastest = frame.agent().map(|agent| count / norm(&agent.reach).max(T::MIN_POSITIVE));
    let pace_max = fastest.fold(anchor.pace * T::real(1.5), T::min);
    anchor.pace = anchor.pace.min(frame.pace_min + (pace_max - frame.pace_min) * T::real(0.9));
    for offsets in anchor.interior_mut(frame) {
        offsets.fill(Point::zeros());
    }
    for (slot, bound) in frame.equipment() {
        if let Bound::Level { .. } = bound {
            anchor.levels_mut(slot, frame.intervals).fill(T::zero());
        }
    }
}

/// Largest less smallest value of the worst-case metrics along the incumbent; 1 where they do not vary.
fn spread<T, const DIM: usize, const NODES: usize, const SENSORS: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
) -> T
where
    T: Real,
{
    let mut widest = T::zero();
    for term in scenario.terms.iter().filter(|term| term.reduce == Reduce::Extreme) {
        let needs = Needs::of([term.metric]);
        for agent in 0..workspace.best.agents() {
            let (mut low, mut high) = (T::INFINITY, -T::INFINITY);
            for node in 1..workspace.best.nodes() {
                let Workspace { best, scratch, .. } = &mut *workspace;
                let values = objective::needed_values(scenario, best, (agent, node), needs, scratch);
                if let Some(value) = values.get(term.metric) {
                    (low, high) = (low.min(value), high.max(value));
                }
            }
            widest = widest.max(high - low);
        }
    }
    if widest > T::zero() && widest.finite() { widest } else { T::one() }
}

/// One stage: a fixed smoothing of the objective.
struct Descent<'a, T, const DIM: usize, const AGENTS: usize> {
    scenario: &'a View<'a, T, DIM>,
    settings: &'a Settings<T>,
    frame: &'a Frame<T, DIM, AGENTS>,
    merit: Merit<T>,
    /// Iterations after which the stage ends, counted over the whole plan.
    quota: usize,
}

/// The last few values of the objective.
struct History<T> {
    values: [T; MEMORY],
    next: usize,
}

impl<T: Real> History<T> {
    fn of(value: T) -> Self {
        Self { values: [value; MEMORY], next: 0 }
    }

    fn push(&mut self, value: T) {
        if let Some(slot) = self.values.get_mut(self.next) {
            *slot = value;
        }
        self.next = (self.next + 1) % MEMORY;
    }

    fn largest(&self) -> T {
        self.values.iter().copied().fold(-T::INFINITY, T::max)
    }
}

impl<T: Real, const DIM: usize, const AGENTS: usize> Descent<'_, T, DIM, AGENTS> {
    fn run<const NODES: usize, const SENSORS: usize>(
        &mut self,
        workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
        ledger: &mut Ledger<T>,
        deadline: &mut dyn FnMut() -> bool,
    ) -> Ending {
        let mut value = self.differentiate_iterate(workspace, ledger);
        if !value.finite() {
            // The incumbent has an objective; it is derivatives, or barriers, that overflow there.
            return Ending::Stop(Status::Stalled);
        }
        let first_step = self.first_step(workspace);
        let mut step = first_step;
        let mut history = History::of(value);
        let mut failures = 0;
        while ledger.iterations < self.quota {
            if deadline() {
                return Ending::Stop(Status::Deadline);
            }
            ledger.iterations += 1;
            step = step.min(self.longest_step(workspace));
            let (slope, share) = self.aim(step, workspace, ledger);
            if ledger.keeps == Keeps::Clearer && value <= T::zero() {
                return Ending::Status(Status::Converged);
            }
            let is_flat = slope.abs() <= self.settings.tolerance * value.abs().max(T::one());
            if is_flat && share > T::real(0.5) {
                return Ending::Status(Status::Converged);
            }
            let found = if slope < T::zero() { self.search(slope, &history, workspace, ledger) } else { None };
            let Some(found) = found else {
                // A shorter step is easier to project exactly.
                failures += 1;
                if failures > FAILURES_MAX {
                    return Ending::Status(Status::Stalled);
                }
                step *= T::real(0.1);
                continue;
            };
            failures = 0;
            step = self.spectral_step(first_step, step, workspace);
            workspace.iterate.assign(&workspace.next, self.frame);
            workspace.gradient.assign(&workspace.gradient_next, self.frame);
            value = found;
            history.push(value);
        }
        Ending::Status(Status::IterationLimit)
    }

    /// Value and gradient at `workspace.iterate`.
    fn differentiate_iterate<const NODES: usize, const SENSORS: usize>(
        &self,
        workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
        ledger: &mut Ledger<T>,
    ) -> T {
        let Workspace { iterate, trial, by_trajectory, gradient, scratch, .. } = workspace;
        self.frame.expand(iterate, trial);
        ledger.evaluations += 1;
        let value = guard::gradient(self.scenario, trial, &self.merit, scratch, by_trajectory);
        self.frame.pull_back(iterate, by_trajectory, gradient);
        value
    }

    /// A step that moves velocities by about [`FIRST_CHANGE`] were there no bounds.
    fn first_step<const NODES: usize, const SENSORS: usize>(
        &self,
        workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
    ) -> T {
        let Workspace { candidate, gradient, .. } = workspace;
        let steepest = self.frame.steepest(gradient, candidate);
        let count = T::from_count(self.frame.intervals * self.frame.agents);
        if steepest > T::zero() { T::real(FIRST_CHANGE) * count.sqrt() / steepest } else { T::one() }
    }

    /// A step that moves velocities by about [`LARGEST_CHANGE`] were there no bounds.
    fn longest_step<const NODES: usize, const SENSORS: usize>(
        &self,
        workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
    ) -> T {
        self.first_step(workspace) * T::real(LARGEST_CHANGE / FIRST_CHANGE)
    }

    /// Projects the gradient step into `workspace.candidate`, exactly feasible; returns the slope towards it and the
    /// share of the projection that was kept.
    fn aim<const NODES: usize, const SENSORS: usize>(
        &self,
        step: T,
        workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
        ledger: &mut Ledger<T>,
    ) -> (T, T) {
        let Workspace { iterate, candidate, next, anchor, gradient, projection, .. } = workspace;
        let domain = &self.scenario.frame.domain;
        let request = Request {
            frame: self.frame,
            domain,
            step,
            margin: self.settings.margin,
            tolerance: self.settings.margin * T::real(0.5),
            steps_max: self.settings.projection_steps,
        };
        ledger.projection_steps += projection.project(&request, iterate, gradient, candidate);
        clamp_to_domain(self.frame, domain, candidate);
        let direct = largest_share(self.frame, domain, iterate, candidate, iterate.pace);
        let mut kept = T::one();
        if direct < T::one() {
            // Straight lines bend nowhere; another anchor keeps the bound on bends where it is the tangent to it.
            let is_straight = self.scenario.agents.iter().all(|agent| agent.start_velocity.is_none());
            let center = if is_straight { iterate.pace } else { anchor.pace };
            let around = largest_share(self.frame, domain, anchor, candidate, center);
            let (from, share) = if around > T::real(0.9) { (&*anchor, around) } else { (&*iterate, direct) };
            kept = share;
            next.between(from, candidate, share, self.frame);
            candidate.assign(next, self.frame);
        }
        (gradient.slope(iterate, candidate, self.frame), kept)
    }

    /// Searches the segment to the candidate; leaves the point and its gradient in `workspace.next` and
    /// `workspace.gradient_next`, and returns its value, or `None` if no point of the segment is better.
    fn search<const NODES: usize, const SENSORS: usize>(
        &self,
        slope: T,
        history: &History<T>,
        workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
        ledger: &mut Ledger<T>,
    ) -> Option<T> {
        let reference = history.largest();
        let mut share = T::one();
        for _ in 0..self.settings.line_search_steps {
            let Workspace { iterate, candidate, next, trial, by_trajectory, gradient_next, scratch, .. } = workspace;
            next.between(iterate, candidate, share, self.frame);
            self.frame.expand(next, trial);
            ledger.evaluations += 1;
            let value = guard::gradient(self.scenario, trial, &self.merit, scratch, by_trajectory);
            if value.finite() && value <= reference + T::real(SUFFICIENT) * share * slope {
                self.frame.pull_back(next, by_trajectory, gradient_next);
                self.keep_if_best(value, workspace, ledger);
                return Some(value);
            }
            // The parabola through value and slope here and value there, held away from both ends.
            let excess = value - reference - share * slope;
            let parabola = -slope * share * share / (excess + excess);
            let is_usable = parabola.finite() && excess > T::zero();
            let shorter = if is_usable { parabola } else { share * T::real(0.5) };
            share = shorter.clamp_to(share * T::real(0.1), share * T::real(0.5));
        }
        None
    }

    /// Takes `workspace.trial` as the incumbent if its exact objective is better.
    fn keep_if_best<const NODES: usize, const SENSORS: usize>(
        &self,
        value: T,
        workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
        ledger: &mut Ledger<T>,
    ) {
        let is_exact = self.merit == Merit::plain(Extreme::Exact) || ledger.keeps == Keeps::Clearer;
        let exact = if is_exact {
            value
        } else {
            ledger.evaluations += 1;
            objective::value(self.scenario, &workspace.trial, Extreme::Exact, &mut workspace.scratch)
        };
        if exact < ledger.best {
            ledger.best = exact;
            workspace.best.assign(&workspace.trial);
        }
    }

    /// The Barzilai-Borwein quotient |s|^2 / <s, y> of the last move.
    fn spectral_step<const NODES: usize, const SENSORS: usize>(
        &self,
        first: T,
        last: T,
        workspace: &Workspace<T, DIM, NODES, SENSORS, AGENTS>,
    ) -> T {
        let Workspace { iterate, next, gradient, gradient_next, .. } = workspace;
        let moved = self.frame.distance_squared(iterate, next);
        let bent = gradient_next.slope(iterate, next, self.frame) - gradient.slope(iterate, next, self.frame);
        let range = T::real(STEP_RANGE);
        let wanted = if bent > T::zero() { moved / bent } else { last * T::real(4.0) };
        let wanted = if wanted.finite() { wanted } else { first };
        wanted.clamp_to(first / range, first * range)
    }
}

/// Holds positions to the domain. This shortens steps, if anything, so that no speed bound is lost by it.
pub(super) fn clamp_to_domain<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize>(
    frame: &Frame<T, DIM, AGENTS>,
    domain: &Domain<T, DIM>,
    iterate: &mut Iterate<T, DIM, NODES, AGENTS>,
) {
    let count = T::from_count(frame.intervals);
    let pace = iterate.pace;
    for (offsets, agent) in iterate.interior_mut(frame).zip(frame.agent()) {
        let scale = pace / agent.stride;
        for (node, offset) in offsets.iter_mut().enumerate() {
            let line = agent.start + agent.line * (T::from_count(node + 1) / count);
            let low = (domain.min - line) * scale;
            let high = (domain.max - line) * scale;
            for ((component, &low), &high) in offset.iter_mut().zip(low.iter()).zip(high.iter()) {
                *component = component.clamp_to(low, high);
            }
        }
    }
}
