//! The global start: lattice paths, made feasible; the most promising are polished for a few iterations, and the best
//! of them is left to be polished to the end.
//!
//! Limits: [`CANDIDATES_MAX`] are polished, for [`POLISH_ITERATIONS`] each. A team is searched agent by agent, each with
//! the others frozen, in every order where it is small and its agents affect each other.


use crate::constraints::region::horizontal;
use crate::constraints::{Constraint, separation};
use crate::math::{Point, Real, norm};
use crate::objective::{self, Extreme};
use crate::scenario::View;
use crate::trajectory::Trajectory;
use crate::warm_start::{self, LARGE_TEAM, Prices, Variant};

use super::coordinates::Frame;
use super::feasible::largest_share;
use super::projection::Request;
use super::{Ledger, Obstacle, Settings, Status, Times, Workspace, guard, improve, neighbours, projected_gradient, refine};

/// Projected-gradient iterations of one candidate.
pub(super) const POLISH_ITERATIONS: usize = 12;
/// Refinement steps of one candidate.
pub(super) const POLISH_REFINEMENTS: usize = 10;
/// Candidates that are polished at most, of all that are laid.
pub(super) const CANDIDATES_MAX: usize = 8;
/// Part of what the champion gains in the end that the second may be behind it to be polished to the end too.
const SECOND_CHANCE: f64 = 2.0;
/// Lattice paths in a row that bring nothing, after which there are no more.
const IDLE_MAX: usize = 3;
/// Times that levels and directions are laid anew in the end, and the least part of the objective that it must bring.
const EQUIPS_MAX: usize = 2;
const EQUIPS_GAIN: f64 = 1e-6;
/// Times that the plan moves on to another flight time at which other nodes are before an instant.
const TIMES_MAX: usize = 4;
/// Largest distance of two paths that go the same way, over their length.
const ALIKE: f64 = 0.04;
/// Steps of the projection that makes a candidate feasible, and how exact it is.
pub(super) const PROJECTION_STEPS: usize = 300;
const PROJECTION_TOLERANCE: f64 = 1e-3;
/// How much more a change of the flight time weighs there.
const PUNCTUAL: f64 = 100.0;
/// Part of the least distance that agents who meet head-on miss.
const HEAD_ON: f64 = 0.8;
/// Part of the flight in which agents come to keep right, and cease to.
const RAMP: f64 = 0.1;
/// Largest team for which every order is tried.
const ORDERED_MAX: usize = 3;

/// Improves the feasible `workspace.best`, whose path may be any, by the best of all candidates.
///
/// Returns [`Status::Infeasible`] where no candidate comes clear of regions and limits, and what closes the way where the
/// lattice has none in any variant.
pub(super) fn search<T, const DIM: usize, const NODES: usize, const SENSORS: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    settings: &Settings<T>,
    workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
    ledger: &mut Ledger<T>,
    deadline: &mut dyn FnMut() -> bool,
) -> (Status, Option<Obstacle<T, DIM>>)
where
    T: Real,
{
    workspace.lattice.begin();
    let mut prices = [Prices::default(); AGENTS];
    if has_equipment(scenario) {
        workspace.trial.assign(&workspace.best);
        equip(scenario, workspace, &mut prices);
        workspace.best.assign(&workspace.trial);
    }
    workspace.base.assign(&workspace.best);
    let mut race = Race { scenario, settings, found: Found::nothing(), second: Found::nothing(), ways: Ways::All, promise: T::INFINITY, polished: 0, idle: 0 };
    race.run(workspace, ledger, deadline);
    let mut way = Way::Unknown;
    let mut hurried = warm_start::variants(scenario);
    hurried.truncate(settings.variants.max(1));
    for order in 0..orders(scenario) {
        race.idle = 0;
        for (number, variant) in
            hurried.iter().copied().chain(unhurried(scenario).take(settings.variants)).enumerate()
        {
            let is_settled = number > 0 && race.idle >= IDLE_MAX;
            if deadline() || is_settled || number >= hurried.len() && matches!(way, Way::Open) {
                break;
            }
            // What closes one variant's way may leave another's open, and the straight line competes in any case.
            let laid = lay(scenario, &variant, (order, &prices), workspace);
            way = way.after(laid, variant.duration);
            if laid.is_ok() && has_equipment(scenario) {
                let mut newer = prices;
                equip(scenario, workspace, &mut newer);
                if matches!(race.polished, 0) {
                    // Those of a straight line may be far off. From then on they stay, so that costs are the same.
                    prices = newer;
                }
            }
            race.idle += 1;
            if laid.is_ok()
                && let Some(objective) = project(scenario, settings, workspace, ledger)
                && race.admits(objective, workspace)
            {
                workspace.best.assign(&workspace.trial);
                race.run(workspace, ledger, deadline);
            }
        }
    }
    if race.found.status == Status::Infeasible {
        workspace.best.assign(&workspace.champion);
        let closing = if let Way::Closed { by, .. } = way { Some(by) } else { None };
        return (Status::Infeasible, closing);
    }
    if settings.candidates > 1 && !race.is_large() {
        race.change_sides(workspace, ledger, deadline);
    }
    let mut status = race.finish_both(workspace, ledger, deadline);
    if has_equipment(scenario) {
        for _ in 0..EQUIPS_MAX {
            let Some(again) = equip_anew(scenario, settings, workspace, ledger, deadline) else { break };
            status = again;
        }
    }
    (status, None)
}

/// Lays levels and directions of the plan anew, and polishes what comes of it; `None` where that is no better.
fn equip_anew<T, const DIM: usize, const NODES: usize, const SENSORS: usize, const AGENTS: usize>(
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
    (ledger.best, ledger.barrier) = (objective, T::zero());
    Some(polish(scenario, settings, workspace, ledger, deadline))
}

/// Whether there is anything to do besides flying.
fn has_equipment<T: Real, const DIM: usize>(scenario: &View<'_, T, DIM>) -> bool {
    scenario.agents.iter().any(|agent| agent.jammer.is_some() || agent.dropout.is_some())
}

/// Lays levels and directions of all agents along their paths in `workspace.trial`.
fn equip<T: Real, const DIM: usize, const NODES: usize, const SENSORS: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
    prices: &mut [Prices<T>; AGENTS],
) {
    let Workspace { trial, lattice, scratch, .. } = workspace;
    for (agent, prices) in prices.iter_mut().enumerate().take(scenario.agents.len()) {
        *prices = warm_start::equip(scenario, trial, agent, lattice, scratch);
    }
}

/// Improves `workspace.best`, whose objective is `ledger.best`: by the refinement where it may take the steps that it needs
/// from a lattice path, and led by the projected gradient otherwise.
fn polish<T, const DIM: usize, const NODES: usize, const SENSORS: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    settings: &Settings<T>,
    workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
    ledger: &mut Ledger<T>,
    deadline: &mut dyn FnMut() -> bool,
) -> Status
where
    T: Real,
{
    if settings.refinements >= POLISH_REFINEMENTS
        && !cfg!(feature = "first-order")
        && let Some(status) = refine::polish(scenario, settings, workspace, ledger, deadline)
    {
        return status;
    }
    improve(scenario, settings, workspace, ledger, deadline)
}

/// Flight times that no penalty on lateness speaks for, up to the last one allowed: where there is no way in time, a late
/// one is better than none. Empty where there is no such penalty.
fn unhurried<T: Real, const DIM: usize>(
    scenario: &View<'_, T, DIM>,
) -> impl Iterator<Item = Variant<T>> + use<T, DIM> {
    let is_urged = scenario.frame.time.penalty > T::zero();
    let mut frame = scenario.frame;
    frame.time.penalty = T::zero();
    warm_start::variants(&View { frame, ..*scenario }).into_iter().filter(move |_| is_urged)
}

/// The best candidate so far; while none is feasible, the one that comes nearest to that.
#[derive(Clone, Copy)]
struct Found<T> {
    status: Status,
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

/// What the lattice says of the way to the goal.
#[derive(Clone, Copy)]
enum Way<T, const DIM: usize> {
    Unknown,
    /// Closed in all variants so far; of these, the one with the most time to go round.
    Closed {
        by: Obstacle<T, DIM>,
        duration: T,
    },
    Open,
}

impl<T: Real, const DIM: usize> Way<T, DIM> {
    /// What is known after one more variant.
    fn after(self, laid: Result<(), Obstacle<T, DIM>>, duration: T) -> Self {
        match (self, laid) {
            (Self::Open, _) | (_, Ok(())) => Self::Open,
            (Self::Closed { by, duration: longest }, Err(other)) => {
                // That time is short says less than what it is too short to go round.
                let rank = |by: &Obstacle<T, DIM>| by.constraint != Constraint::Duration;
                let is_plainer = (rank(&other), duration) > (rank(&by), longest);
                if is_plainer { Self::Closed { by: other, duration } } else { self }
            }
            (Self::Unknown, Err(by)) => Self::Closed { by, duration },
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
struct Race<'a, T, const DIM: usize> {
    scenario: &'a View<'a, T, DIM>,
    settings: &'a Settings<T>,
    found: Found<T>,
    /// The best that goes another way.
    second: Found<T>,
    ways: Ways,
    /// Least objective of all that were laid, before they were polished.
    promise: T,
    /// Lattice paths polished.
    polished: usize,
    /// Lattice paths in a row that brought nothing.
    idle: usize,
}

impl<T: Real, const DIM: usize> Race<'_, T, DIM> {
    /// Whether `workspace.trial` is worth polishing: it is one of the first, or promises more than all before, and does not
    /// go where the champion goes.
    fn admits<const NODES: usize, const SENSORS: usize, const AGENTS: usize>(
        &mut self,
        objective: T,
        workspace: &Workspace<T, DIM, NODES, SENSORS, AGENTS>,
    ) -> bool {
        let is_record = objective < self.promise;
        self.promise = self.promise.min(objective);
        let is_known = self.found.status != Status::Infeasible && is_alike(&workspace.trial, &workspace.champion);
        let admits = (is_record || self.polished < self.settings.candidates) && !is_known;
        self.polished += usize::from(admits);
        admits
    }

    /// Polishes `workspace.best` for a few iterations; it becomes the champion if it is the best so far.
    fn run<const NODES: usize, const SENSORS: usize, const AGENTS: usize>(
        &mut self,
        workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
        ledger: &mut Ledger<T>,
        deadline: &mut dyn FnMut() -> bool,
    ) {
        let Self { scenario, settings, found, .. } = self;
        let short = Settings {
            iterations: settings.iterations.min(POLISH_ITERATIONS),
            refinements: settings.refinements.min(POLISH_REFINEMENTS),
            ..**settings
        };
        ledger.barrier = T::zero();
        ledger.best = objective::value(scenario, &workspace.best, Extreme::Exact, &mut workspace.scratch);
        ledger.evaluations += 1;
        let status = polish(scenario, &short, workspace, ledger, deadline);
        let is_alike = found.status != Status::Infeasible && is_alike(&workspace.best, &workspace.champion);
        let level = if is_alike { found.level } else { ledger.best };
        let new = Found { status, least: ledger.best, slack: T::zero(), barrier: ledger.barrier, level };
        if status != Status::Infeasible && (new.least < found.least || found.least == T::INFINITY) {
            if !is_alike && self.ways == Ways::All {
                self.second = *found;
                workspace.second.assign(&workspace.champion);
            }
            self.found = new;
            workspace.champion.assign(&workspace.best);
            self.idle = 0;
        } else if status != Status::Infeasible && new.least < self.second.least {
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
    /// Lets the champion pass what it passes on the other side.
    fn change_sides<const NODES: usize, const SENSORS: usize, const AGENTS: usize>(
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
            if is_changed && project(self.scenario, self.settings, workspace, ledger).is_some() {
                workspace.best.assign(&workspace.trial);
                self.run(workspace, ledger, deadline);
            }
        }
    }

    /// Polishes the champion to the end, in `workspace.best`, and the second too where it could gain as much and win.
    fn finish_both<const NODES: usize, const SENSORS: usize, const AGENTS: usize>(
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
        if !may_win || self.settings.candidates <= 1 || self.is_large() || deadline() {
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
        if self.settings.candidates <= 1 {
            return status;
        }
        self.change_times(workspace, ledger, deadline).unwrap_or(status)
    }

    fn is_large(&self) -> bool {
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
        for _ in 0..TIMES_MAX {
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

/// Whether two trajectories go the same way, side by side, in about the same time.
fn is_alike<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize>(
    one: &Trajectory<T, DIM, NODES, AGENTS>,
    other: &Trajectory<T, DIM, NODES, AGENTS>,
) -> bool {
    let nodes = one.nodes();
    one.active().iter().zip(other.active()).all(|(one, other)| {
        let steps = one.path.iter().zip(one.path.iter().skip(1)).take(nodes - 1);
        let length = steps.fold(T::zero(), |length, (from, to)| length + norm(&(to - from)));
        let apart = one.path.iter().zip(&other.path).take(nodes).map(|(one, other)| norm(&(one - other)));
        apart.fold(T::zero(), T::max) < length * T::real(ALIKE)
    })
}

/// Orders of so many agents to try at most.
pub(super) const fn orders_max(agents: usize) -> usize {
    let (mut orders, mut agent) = (1, 2);
    while agent <= agents && agents <= ORDERED_MAX {
        orders *= agent;
        agent += 1;
    }
    orders
}

/// Orders of the agents to try.
fn orders<T: Real, const DIM: usize>(scenario: &View<'_, T, DIM>) -> usize {
    let agents = scenario.agents.len();
    let has_jammers = scenario.agents.iter().any(|agent| agent.jammer.is_some());
    if has_jammers { orders_max(agents) } else { 1 }
}

/// Lattice paths of all agents, one after the other, into `workspace.trial`.
fn lay<T: Real, const DIM: usize, const NODES: usize, const SENSORS: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    variant: &Variant<T>,
    (order, prices): (usize, &[Prices<T>; AGENTS]),
    workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
) -> Result<(), Obstacle<T, DIM>> {
    let Workspace { base, trial, lattice, scratch, .. } = workspace;
    trial.assign(base);
    let agents = scenario.agents.len();
    for place in 0..agents {
        let agent = at_place(order, place, agents);
        let prices = prices.get(agent).copied().unwrap_or_default();
        let found = warm_start::search(scenario, trial, agent, (variant, prices), lattice, scratch);
        found.map_err(|obstruction| Obstacle::closing(agent, &obstruction))?;
    }
    keep_right(scenario, trial);
    Ok(())
}

/// Moves the paths of agents that meet head-on to their right by half of the least distance, less near their ends.
///
/// The lattice does not know of others' ways. Agents that fly through each other have no gradient that parts them; each a
/// little to its right, they have.
fn keep_right<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    trajectory: &mut Trajectory<T, DIM, NODES, AGENTS>,
) {
    let Some(separation) = scenario.frame.separation else { return };
    let nodes = trajectory.nodes();
    let mut meets = [false; AGENTS];
    let tracks = trajectory.active();
    for (index, (track, meets)) in tracks.iter().zip(&mut meets).enumerate() {
        let path = track.path.get(..nodes).unwrap_or_default();
        let others = tracks.iter().enumerate().filter(|(other, _)| *other != index);
        *meets = others
            .map(|(_, other)| separation::excess(separation, path, &other.path).amount)
            .any(|missing| missing > T::real(HEAD_ON));
    }
    for (track, _) in trajectory.active_mut().iter_mut().zip(meets).filter(|(_, meets)| *meets) {
        aside(&mut track.path, nodes - 1, separation * T::real(0.5));
    }
}

/// Moves a path to its right by `distance`, less near its ends.
fn aside<T: Real, const DIM: usize, const NODES: usize>(
    path: &mut [Point<T, DIM>; NODES],
    intervals: usize,
    distance: T,
) {
    let ramp = T::from_count(intervals) * T::real(RAMP);
    let original = *path;
    let legs = original.iter().zip(original.iter().skip(2)).take(intervals.saturating_sub(1));
    for (node, (place, (before, after))) in path.iter_mut().skip(1).zip(legs).enumerate() {
        let to_end = T::from_count((node + 1).min(intervals - node - 1));
        let along = horizontal(&(after - before));
        let length = norm(&along);
        if length > T::zero() {
            let part = distance * (to_end / ramp).min(T::one()) / length;
            let moves = [along[1] * part, -along[0] * part];
            place.iter_mut().zip(moves).for_each(|(component, aside)| *component += aside);
        }
    }
}

/// The agent at a place of an order, orders counted as digits of falling base.
fn at_place(order: usize, place: usize, agents: usize) -> usize {
    let mut rest = order;
    let mut used = 0_u32;
    let mut chosen = place;
    for step in 0..=place {
        let open = agents.saturating_sub(step).max(1);
        let wanted = rest % open;
        rest /= open;
        let free = (0..agents).filter(|&agent| used & (1 << (agent % 32)) == 0);
        chosen = free.clone().nth(wanted).unwrap_or(step);
        used |= 1 << (chosen % 32);
    }
    chosen
}

/// Makes `workspace.trial` feasible by projection, with `workspace.base` as what is known to be feasible; its
/// objective, or `None` where it is not feasible after all.
fn project<T: Real, const DIM: usize, const NODES: usize, const SENSORS: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    settings: &Settings<T>,
    workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
    ledger: &mut Ledger<T>,
) -> Option<T> {
    let mut frame = Frame::<T, DIM, AGENTS>::new(scenario, workspace.trial.duration());
    // A lattice path is longer than need be: it is to become shorter, not later.
    frame.inertia *= T::real(PUNCTUAL);
    let domain = &scenario.frame.domain;
    frame.collapse(&workspace.base, &mut workspace.anchor);
    frame.collapse(&workspace.trial, &mut workspace.iterate);
    projected_gradient::lay_anchor(scenario, &frame, &mut workspace.anchor);
    workspace.gradient.clear(&frame);
    workspace.projection.prepare(&frame);
    let request = Request {
        frame: &frame,
        domain,
        step: T::one(),
        margin: settings.margin.max(T::real(PROJECTION_TOLERANCE)),
        tolerance: T::real(PROJECTION_TOLERANCE),
        steps_max: PROJECTION_STEPS,
    };
    let Workspace { iterate, candidate, next, anchor, gradient, projection, .. } = workspace;
    ledger.projection_steps += projection.project(&request, iterate, gradient, candidate);
    projected_gradient::clamp_to_domain(&frame, domain, candidate);
    let share = largest_share(&frame, domain, anchor, candidate, anchor.pace);
    next.between(anchor, candidate, share, &frame);
    frame.expand(next, &mut workspace.trial);
    ledger.evaluations += 1;
    let objective = objective::value(scenario, &workspace.trial, Extreme::Exact, &mut workspace.scratch);
    objective.finite().then_some(objective)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn orders_are_all_orders() {
        let mut seen = std::collections::BTreeSet::new();
        for order in 0..6 {
            let agents = [0, 1, 2].map(|place| at_place(order, place, 3));
            let mut sorted = agents;
            sorted.sort_unstable();
            assert_eq!(sorted, [0, 1, 2]);
            seen.insert(agents);
        }
        assert_eq!(seen.len(), 6);
    }
}
