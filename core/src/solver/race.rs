//! The race of candidates: each is polished for a few iterations, the best is challenged, and the best two are polished to
//! the end.
//!
//! Limits: [`POLISH_ITERATIONS`] or [`POLISH_REFINEMENTS`], and at most [`PATIENCE`] more, a candidate; one second; two ways
//! are alike where they are side by side, with levels in about the same places.

use heapless::Vec;

use crate::math::{Real, norm};
use crate::objective::{self, Extreme};
use crate::scenario::View;
use crate::trajectory::Trajectory;
use crate::warm_start::{self, LARGE_TEAM, Level, Prices};

use super::global::project;
use super::sides::Sides;
use super::{Ledger, Settings, Status, Times, Workspace, guard, improve, neighbours, projected_gradient, refine};

/// Projected-gradient iterations of one candidate.
pub(super) const POLISH_ITERATIONS: usize = 12;
/// Refinement steps of one candidate.
pub(super) const POLISH_REFINEMENTS: usize = 10;
/// Steps that a candidate has beyond these while it is no better than it was laid, or has not come to a second barrier
/// parameter: what draws it inside its bounds makes it worse at first, and one that was stopped there would be compared by
/// what it was laid with, and one that is still on its way to the centre by how far it has come.
pub(super) const PATIENCE: usize = 15;
/// Part of what the champion gains in the end that the second may be behind it to be polished to the end too.
const SECOND_CHANCE: f64 = 2.0;
/// Times that levels and directions are laid anew in the end, and the least part of the objective that it must bring.
pub(super) const EQUIPS_MAX: usize = 2;
const EQUIPS_GAIN: f64 = 1e-6;
/// Part of the usual barrier parameter that begins the refinement of a candidate: a larger one draws it further from the way
/// that it was laid.
const CANDIDATE: f64 = 0.4;
/// Part of the usual barrier parameter that begins a refinement of levels laid anew, and of levels laid elsewhere.
const ANEW: f64 = 0.01;
const ELSEWHERE: f64 = 0.1;
/// Times that a plan moves on to another flight time at which other nodes are before an instant.
pub(super) const RETIMES_MAX: usize = 4;
/// Ways polished that are remembered.
const KNOWN_MAX: usize = 32;
/// Largest distance of two paths that go the same way, over their length,
const ALIKE: f64 = 0.04;
/// and of one that has come to the other's.
const JOINED: f64 = 0.01;
/// Largest difference of their levels, over the larger ones.
const ALIKE_LEVELS: f64 = 0.5;

/// The best candidate so far; while none is feasible, the one that comes nearest to that.
#[derive(Clone, Copy)]
pub(super) struct Found<T> {
    pub(super) status: Status,
    least: T,
    slack: T,
    /// Where its refinement goes on.
    barrier: T,
    /// What it was worth when its way had been polished once.
    level: T,
}

impl<T: Real> Found<T> {
    fn nothing() -> Self {
        Self {
            status: Status::Infeasible,
            least: T::INFINITY,
            slack: -T::INFINITY,
            barrier: T::zero(),
            level: T::INFINITY,
        }
    }
}

/// What a race looks for.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Ways {
    /// The best way, and the best other.
    All,
    /// The best of one.
    One,
}

/// Candidates, one after the other.
pub(super) struct Race<'a, T, const DIM: usize> {
    scenario: &'a View<'a, T, DIM>,
    pub(super) settings: &'a Settings<T>,
    pub(super) found: Found<T>,
    /// The best that goes another way.
    second: Found<T>,
    ways: Ways,
    /// Least objective of all that were laid, before they were polished.
    promise: T,
    /// On which sides of things all passed that were polished, before and after, with the least objective as they were laid.
    known: Vec<(Sides, T), KNOWN_MAX>,
    /// Lattice paths polished.
    pub(super) polished: usize,
    /// Lattice paths in a row that brought nothing.
    pub(super) idle: usize,
    /// Lattice paths laid, of as many as the settings allow.
    pub(super) laid: usize,
}

impl<'a, T: Real, const DIM: usize> Race<'a, T, DIM> {
    /// A race that nobody has run in.
    pub(super) fn new(scenario: &'a View<'a, T, DIM>, settings: &'a Settings<T>) -> Self {
        let none = Found::nothing();
        Self {
            scenario,
            settings,
            found: none,
            second: none,
            ways: Ways::All,
            promise: T::INFINITY,
            known: Vec::new(),
            polished: 0,
            idle: 0,
            laid: 0,
        }
    }

    /// Whether `workspace.trial`, whose objective it is, is worth polishing: it is one of the first, or promises more than all
    /// before, and is new.
    pub(super) fn admits<const NODES: usize, const SENSORS: usize, const AGENTS: usize>(
        &mut self,
        objective: T,
        workspace: &Workspace<T, DIM, NODES, SENSORS, AGENTS>,
    ) -> bool {
        let is_record = objective < self.promise;
        self.promise = self.promise.min(objective);
        let is_wanted = is_record || self.polished < self.settings.candidates;
        let admits = is_wanted && !self.is_alike(&workspace.trial, workspace) && self.is_new(objective, workspace);
        if admits {
            self.polished += 1;
        }
        admits
    }

    /// Whether `workspace.trial`, whose objective it is, goes a way that was not polished before, or goes it better than what was.
    /// Where sides do not tell ways apart, only the same once more is not new, as where two flight times or two orders of a team
    /// come out alike.
    fn is_new<const NODES: usize, const SENSORS: usize, const AGENTS: usize>(
        &self,
        objective: T,
        workspace: &Workspace<T, DIM, NODES, SENSORS, AGENTS>,
    ) -> bool {
        let sides = Sides::of(self.scenario, &workspace.trial);
        let is_avoiding = self.scenario.is_avoiding();
        let is_better = |laid: T| if is_avoiding { objective < laid } else { objective != laid };
        self.known.iter().all(|&(known, laid)| known != sides || is_better(laid))
    }

    /// Whether a trajectory goes where the champion goes.
    fn is_alike<const NODES: usize, const SENSORS: usize, const AGENTS: usize>(
        &self,
        trajectory: &Trajectory<T, DIM, NODES, AGENTS>,
        workspace: &Workspace<T, DIM, NODES, SENSORS, AGENTS>,
    ) -> bool {
        self.found.status != Status::Infeasible && is_alike(trajectory, &workspace.champion, ALIKE)
    }

    /// Polishes `workspace.best` for a few iterations; it becomes the champion if it is the best so far.
    pub(super) fn run<const NODES: usize, const SENSORS: usize, const AGENTS: usize>(
        &mut self,
        workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
        ledger: &mut Ledger<T>,
        deadline: &mut dyn FnMut() -> bool,
    ) {
        self.run_for(self.settings.iterations.min(POLISH_ITERATIONS), workspace, ledger, deadline);
    }

    /// Polishes the line `workspace.base`, where nothing was found, or nothing that passes everything on the same sides.
    pub(super) fn run_line<const NODES: usize, const SENSORS: usize, const AGENTS: usize>(
        &mut self,
        workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
        ledger: &mut Ledger<T>,
        deadline: &mut dyn FnMut() -> bool,
    ) {
        workspace.trial.assign(&workspace.base);
        ledger.evaluations += 1;
        let objective = objective::value(self.scenario, &workspace.trial, Extreme::Exact, &mut workspace.scratch);
        if self.found.status == Status::Infeasible || self.is_new(objective, workspace) {
            workspace.best.assign(&workspace.trial);
            self.run(workspace, ledger, deadline);
        }
    }

    fn run_for<const NODES: usize, const SENSORS: usize, const AGENTS: usize>(
        &mut self,
        iterations: usize,
        workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
        ledger: &mut Ledger<T>,
        deadline: &mut dyn FnMut() -> bool,
    ) {
        let is_large = self.is_large();
        let Self { scenario, settings, found, .. } = self;
        let short = Settings { iterations, refinements: settings.refinements.min(POLISH_REFINEMENTS), ..**settings };
        ledger.barrier = T::zero();
        ledger.best = objective::value(scenario, &workspace.best, Extreme::Exact, &mut workspace.scratch);
        ledger.evaluations += 1;
        ledger.patience = if settings.refinements > POLISH_REFINEMENTS && !is_large { PATIENCE } else { 0 };
        let first = ledger.first;
        ledger.first = first * T::real(CANDIDATE);
        ledger.rival = (found.status != Status::Infeasible).then_some(found.least);
        let (sides, laid) = (Sides::of(scenario, &workspace.best), ledger.best);
        let status = polish(scenario, &short, workspace, ledger, deadline);
        (ledger.first, ledger.patience, ledger.rival) = (first, 0, None);
        let is_alike = found.status != Status::Infeasible && is_alike(&workspace.best, &workspace.champion, ALIKE);
        let level = if is_alike { found.level } else { ledger.best };
        let new = Found { status, least: ledger.best, slack: T::zero(), barrier: ledger.barrier, level };
        let has_plan = !matches!(status, Status::Infeasible | Status::NonFinite);
        if has_plan {
            remember(&mut self.known, sides, laid);
            remember(&mut self.known, Sides::of(scenario, &workspace.best), laid);
        }
        if has_plan && (new.least < found.least || found.least == T::INFINITY) {
            if !is_alike && self.ways == Ways::All {
                self.second = *found;
                workspace.second.assign(&workspace.champion);
            }
            self.found = new;
            workspace.champion.assign(&workspace.best);
            self.idle = 0;
        } else if has_plan && new.least < self.second.least {
            if !is_alike && self.ways == Ways::All {
                self.second = new;
                workspace.second.assign(&workspace.best);
            }
        } else if found.status == Status::Infeasible {
            let slack = guard::smallest_slack(scenario, &workspace.best, &mut workspace.scratch);
            if slack > found.slack {
                found.slack = slack;
                workspace.champion.assign(&workspace.best);
            }
        }
    }
}

impl<T: Real, const DIM: usize> Race<'_, T, DIM> {
    /// Leads the candidate that comes nearest to feasible out of what is in its way, with all the iterations that there are.
    pub(super) fn clear<const NODES: usize, const SENSORS: usize, const AGENTS: usize>(
        &mut self,
        workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
        ledger: &mut Ledger<T>,
        deadline: &mut dyn FnMut() -> bool,
    ) {
        workspace.best.assign(&workspace.champion);
        self.run_for(self.settings.iterations, workspace, ledger, deadline);
    }

    /// Lets the champion pass what it passes on the other side.
    pub(super) fn change_sides<const NODES: usize, const SENSORS: usize, const AGENTS: usize>(
        &mut self,
        workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
        ledger: &mut Ledger<T>,
        deadline: &mut dyn FnMut() -> bool,
    ) {
        for passed in neighbours::passed(self.scenario, &workspace.champion) {
            if deadline() {
                return;
            }
            workspace.trial.assign(&workspace.champion);
            let is_changed = neighbours::change_side(self.scenario, &mut workspace.trial, &passed);
            if is_changed
                && let Some(objective) = project(self.scenario, self.settings, workspace, ledger)
                && self.is_new(objective, workspace)
            {
                workspace.best.assign(&workspace.trial);
                self.run(workspace, ledger, deadline);
            }
        }
    }

    /// Lets the champion jam, or be silent, elsewhere.
    pub(super) fn change_levels<const NODES: usize, const SENSORS: usize, const AGENTS: usize>(
        &mut self,
        workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
        ledger: &mut Ledger<T>,
        deadline: &mut dyn FnMut() -> bool,
    ) {
        ledger.first = T::real(ELSEWHERE);
        for agent in 0..self.scenario.agents.len() {
            for level in Level::ALL {
                workspace.best.assign(&workspace.champion);
                let Workspace { best, turns, scratch, .. } = workspace;
                let Some(tables) = turns.lattice() else { return };
                if !deadline() && warm_start::equip_elsewhere(self.scenario, best, (agent, level), tables, scratch) {
                    self.run(workspace, ledger, deadline);
                }
            }
        }
        ledger.first = T::one();
    }

    /// Polishes the champion to the end, in `workspace.best`, and the second too where it could gain as much and win.
    pub(super) fn finish_both<const NODES: usize, const SENSORS: usize, const AGENTS: usize>(
        &mut self,
        workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
        ledger: &mut Ledger<T>,
        deadline: &mut dyn FnMut() -> bool,
    ) -> Status {
        let (champion, second) = (self.found, self.second);
        self.ways = Ways::One;
        let status = self.complete(workspace, ledger, deadline);
        let gained = champion.level - ledger.best;
        let may_win = second.level - champion.level < gained * T::real(SECOND_CHANCE);
        if !may_win || !self.is_thorough() || self.is_large() || deadline() {
            return status;
        }
        let first = Found { status, least: ledger.best, barrier: ledger.barrier, ..champion };
        // The second becomes the champion, and the plan there is takes its place.
        workspace.champion.assign(&workspace.second);
        workspace.second.assign(&workspace.best);
        self.found = second;
        let again = self.complete(workspace, ledger, deadline);
        if ledger.best < first.least {
            return again;
        }
        workspace.best.assign(&workspace.second);
        (ledger.best, ledger.barrier) = (first.least, first.barrier);
        status
    }

    /// Polishes the champion to the end, in `workspace.best`, at whatever flight time is best.
    fn complete<const NODES: usize, const SENSORS: usize, const AGENTS: usize>(
        &mut self,
        workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
        ledger: &mut Ledger<T>,
        deadline: &mut dyn FnMut() -> bool,
    ) -> Status {
        let status = self.finish(workspace, ledger, deadline);
        if !self.is_thorough() {
            return status;
        }
        self.change_times(workspace, ledger, deadline).unwrap_or(status)
    }

    /// Whether the champion is challenged; where code is to be small it never is.
    pub(super) fn is_thorough(&self) -> bool {
        self.settings.candidates > 1 && !cfg!(feature = "compact")
    }

    pub(super) fn is_large(&self) -> bool {
        self.scenario.agents.len() >= LARGE_TEAM
    }

    /// Polishes the champion to the end, in `workspace.best`.
    fn finish<const NODES: usize, const SENSORS: usize, const AGENTS: usize>(
        &mut self,
        workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
        ledger: &mut Ledger<T>,
        deadline: &mut dyn FnMut() -> bool,
    ) -> Status {
        workspace.best.assign(&workspace.champion);
        (ledger.best, ledger.barrier) = (self.found.least, self.found.barrier);
        ledger.times = Times::Held;
        // A candidate that has come to the end is there, unless an instant at which terms change may have held it up.
        let is_done = self.found.status == Status::Converged && !cfg!(feature = "compact");
        if is_done && neighbours::piece(self.scenario, workspace.best.duration()).iter().all(Option::is_none) {
            return Status::Converged;
        }
        polish(self.scenario, self.settings, workspace, ledger, deadline)
    }

    /// Flies the plan a little slower or faster, so that other nodes are before the instants at which terms change; the
    /// status of the last that was better.
    fn change_times<const NODES: usize, const SENSORS: usize, const AGENTS: usize>(
        &mut self,
        workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
        ledger: &mut Ledger<T>,
        deadline: &mut dyn FnMut() -> bool,
    ) -> Option<Status> {
        let mut status = None;
        let allowed = self.scenario.frame.time.max - self.scenario.frame.start_time;
        for _ in 0..RETIMES_MAX {
            workspace.champion.assign(&workspace.best);
            (self.found.least, self.found.barrier) = (ledger.best, ledger.barrier);
            let known = self.found.least;
            for duration in neighbours::other_times(self.scenario, workspace.champion.duration()) {
                if deadline() || duration > allowed {
                    continue;
                }
                workspace.trial.assign(&workspace.champion);
                workspace.trial.set_duration(self.scenario.frame.start_time, duration);
                if project(self.scenario, self.settings, workspace, ledger).is_some() {
                    workspace.best.assign(&workspace.trial);
                    self.run(workspace, ledger, deadline);
                }
            }
            let is_better = self.found.least < known - known.abs().max(T::one()) * T::real(EQUIPS_GAIN);
            if !is_better {
                workspace.best.assign(&workspace.champion);
                (ledger.best, ledger.barrier) = (self.found.least, self.found.barrier);
                break;
            }
            status = Some(self.finish(workspace, ledger, deadline));
        }
        status
    }
}

/// Remembers a way that was polished, and what it was worth as it was laid.
fn remember<T: Real>(known: &mut Vec<(Sides, T), KNOWN_MAX>, sides: Sides, laid: T) {
    if let Some((_, least)) = known.iter_mut().find(|(known, _)| *known == sides) {
        *least = least.min(laid);
        return;
    }
    // What is not remembered may be polished twice.
    let _ = known.push((sides, laid));
}

/// Whether a refinement has come to the way of the champion, so that there is no more to learn from it.
pub(super) fn has_joined<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    trajectory: &Trajectory<T, DIM, NODES, AGENTS>,
    champion: &Trajectory<T, DIM, NODES, AGENTS>,
) -> bool {
    is_alike(trajectory, champion, JOINED) && Sides::of(scenario, trajectory) == Sides::of(scenario, champion)
}

/// Whether two trajectories go the same way, side by side, in about the same time, no farther apart than `part` of their
/// length, and do about the same on it.
fn is_alike<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize>(
    one: &Trajectory<T, DIM, NODES, AGENTS>,
    other: &Trajectory<T, DIM, NODES, AGENTS>,
    part: f64,
) -> bool {
    let nodes = one.nodes();
    one.active().iter().zip(other.active()).all(|(one, other)| {
        let steps = one.path.iter().zip(one.path.iter().skip(1)).take(nodes - 1);
        let length = steps.fold(T::zero(), |length, (from, to)| length + norm(&(to - from)));
        let apart = one.path.iter().zip(&other.path).take(nodes).map(|(one, other)| norm(&(one - other)));
        let is_aside = apart.fold(T::zero(), T::max) < length * T::real(part);
        let is_equipped = |one: &[T; NODES], other: &[T; NODES]| {
            let levels = one.iter().zip(other).take(nodes);
            let differ = levels.clone().fold(T::zero(), |sum, (&one, &other)| sum + (one - other).abs());
            differ <= levels.fold(T::zero(), |sum, (&one, &other)| sum + one.max(other)) * T::real(ALIKE_LEVELS)
        };
        is_aside && is_equipped(&one.dropout, &other.dropout) && is_equipped(&one.jam, &other.jam)
    })
}

/// Lays levels and directions of the plan anew, and polishes what comes of it; `None` where that is no better.
pub(super) fn equip_anew<T, const DIM: usize, const NODES: usize, const SENSORS: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    settings: &Settings<T>,
    workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
    ledger: &mut Ledger<T>,
    deadline: &mut dyn FnMut() -> bool,
) -> Option<Status>
where
    T: Real,
{
    if deadline() {
        return None;
    }
    workspace.trial.assign(&workspace.best);
    equip(scenario, workspace, &mut [Prices::default(); AGENTS]);
    ledger.evaluations += 1;
    let objective = objective::value(scenario, &workspace.trial, Extreme::Exact, &mut workspace.scratch);
    let gain = ledger.best - objective;
    let slack = guard::smallest_slack(scenario, &workspace.trial, &mut workspace.scratch);
    let is_better = gain > T::real(EQUIPS_GAIN) * ledger.best.abs().max(T::one()) && slack > T::zero();
    if !is_better {
        return None;
    }
    workspace.best.assign(&workspace.trial);
    (ledger.best, ledger.barrier, ledger.first) = (objective, T::zero(), T::real(ANEW));
    let status = polish(scenario, settings, workspace, ledger, deadline);
    ledger.first = T::one();
    Some(status)
}

/// Whether there is anything to do besides flying that is laid with the paths; without room for that, levels stay even.
pub(super) fn has_equipment<T: Real, const DIM: usize>(scenario: &View<'_, T, DIM>) -> bool {
    !cfg!(feature = "compact")
        && scenario.agents.iter().any(|agent| agent.jammer.is_some() || agent.dropout.is_some())
}

/// Lays levels and directions of all agents along their paths in `workspace.trial`.
pub(super) fn equip<T: Real, const DIM: usize, const NODES: usize, const SENSORS: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
    prices: &mut [Prices<T>; AGENTS],
) {
    let Workspace { trial, turns, scratch, .. } = workspace;
    let Some(tables) = turns.lattice() else { return };
    for (agent, prices) in prices.iter_mut().enumerate().take(scenario.agents.len()) {
        *prices = warm_start::equip(scenario, trial, agent, tables, scratch);
    }
}

/// Improves `workspace.best`, whose objective is `ledger.best`: by the refinement where it may take the steps that it needs
/// from a lattice path, once that is clear of regions and limits, and led by the projected gradient otherwise.
pub(super) fn polish<T, const DIM: usize, const NODES: usize, const SENSORS: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    settings: &Settings<T>,
    workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
    ledger: &mut Ledger<T>,
    deadline: &mut dyn FnMut() -> bool,
) -> Status
where
    T: Real,
{
    if settings.refinements >= POLISH_REFINEMENTS && !cfg!(feature = "first-order") {
        if let Some(status) = refine::polish(scenario, settings, workspace, ledger, deadline) {
            return status;
        }
        // What keeps the refinement from beginning, as a rule, are regions and limits alone.
        if guard::is_needed(scenario) && !cfg!(feature = "compact") {
            if let Some(status) = projected_gradient::clear(scenario, settings, workspace, ledger, deadline) {
                return status;
            }
            if let Some(status) = refine::polish(scenario, settings, workspace, ledger, deadline) {
                return status;
            }
            // Iterations were taken to come here: with half of them for what is left, there are no more than of one descent.
            let rest = Settings { iterations: settings.iterations / 2, ..*settings };
            return improve(scenario, &rest, workspace, ledger, deadline);
        }
    }
    improve(scenario, settings, workspace, ledger, deadline)
}
