//! The global start: lattice paths, made feasible, for [`super::race`] to find the best of.
//!
//! Limits: lattice paths end once [`IDLE_MAX`] in a row brought nothing. A team is searched agent by agent, each with
//! the others frozen: in every order where it is small and its agents affect each other, and once more where it is large.

use heapless::Vec;

use crate::constraints::region::horizontal;
use crate::constraints::{Constraint, separation};
use crate::math::{Point, Real, norm};
use crate::objective::{self, Extreme};
use crate::scenario::View;
use crate::trajectory::Trajectory;
use crate::warm_start::{self, Lattice, Prices, ROUTES_MAX, Routes, Variant};

use super::coordinates::Frame;
use super::feasible::largest_share;
use super::projection::Request;
use super::race::{EQUIPS_MAX, Race, equip, equip_anew, has_equipment};
use super::sides::Sides;
use super::{Ledger, Obstacle, Settings, Status, Workspace, guard, projected_gradient};

/// Candidates that are polished at most, of all that are laid.
pub(super) const CANDIDATES_MAX: usize = 8;
/// Lattice paths in a row that bring nothing, after which there are no more.
const IDLE_MAX: usize = 3;
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
    workspace.landscape.begin();
    let mut prices = [Prices::default(); AGENTS];
    if has_equipment(scenario) {
        workspace.trial.assign(&workspace.best);
        equip(scenario, workspace, &mut prices);
        // What is laid may break a limit that a line without it keeps.
        let before = guard::smallest_slack(scenario, &workspace.best, &mut workspace.scratch);
        let after = guard::smallest_slack(scenario, &workspace.trial, &mut workspace.scratch);
        if after > T::zero() || before <= T::zero() {
            workspace.best.assign(&workspace.trial);
        }
    }
    workspace.base.assign(&workspace.best);
    let mut race = Race::new(scenario, settings);
    let mut hurried = warm_start::variants(scenario);
    hurried.truncate(settings.variants.max(1));
    // A line that is clear waits for ways that are laid: where one of them passes everything on the same sides, it is better.
    let is_clear = guard::smallest_slack(scenario, &workspace.best, &mut workspace.scratch) > T::zero();
    let line_waits = is_clear && hurried.iter().all(|variant| variant.others.is_some());
    if !line_waits {
        race.run(workspace, ledger, deadline);
    }
    let mut way = Way::Unknown;
    for order in 0..orders(scenario) {
        (race.idle, race.laid) = (0, 0);
        for (number, variant) in
            hurried.iter().copied().chain(unhurried(scenario).take(settings.variants)).enumerate()
        {
            let is_settled = race.found.status != Status::Infeasible && race.idle >= IDLE_MAX;
            // Late ones are for where there is no way in time, or none that could be polished.
            let is_late = number >= hurried.len() && race.found.status != Status::Infeasible;
            if deadline() || is_settled || is_late {
                break;
            }
            if number == hurried.len() {
                race.laid = 0;
            }
            // What closes one variant's way may leave another's open, and the straight line competes in any case.
            let laid = lay(scenario, &variant, (order, &prices), workspace);
            way = way.after(laid.as_ref().map(|_| ()).map_err(|by| *by), variant.duration);
            let Ok(Some(routes)) = laid else {
                race.idle += 1;
                continue;
            };
            race_routes(scenario, &mut race, &routes, &mut prices, workspace, ledger, deadline);
        }
    }
    if line_waits {
        race.run_line(workspace, ledger, deadline);
    }
    if race.found.status == Status::Infeasible && matches!(way, Way::Open) {
        race.clear(workspace, ledger, deadline);
    }
    if race.found.status == Status::Infeasible {
        workspace.best.assign(&workspace.champion);
        let closing = if let Way::Closed { by, .. } = way { Some(by) } else { None };
        return (Status::Infeasible, closing);
    }
    if race.is_thorough() {
        challenge(scenario, &mut race, (&hurried, &prices), workspace, ledger, deadline);
    }
    let mut status = race.finish_both(workspace, ledger, deadline);
    if has_equipment(scenario) && race.is_thorough() {
        for _ in 0..EQUIPS_MAX {
            let Some(again) = equip_anew(scenario, settings, workspace, ledger, deadline) else { break };
            status = again;
        }
    }
    (status, None)
}

/// Polishes what is new of the ways of one search; the cheapest is in `workspace.trial` already.
fn race_routes<T, const DIM: usize, const NODES: usize, const SENSORS: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    race: &mut Race<'_, T, DIM>,
    routes: &Routes<T, DIM>,
    prices: &mut [Prices<T>; AGENTS],
    workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
    ledger: &mut Ledger<T>,
    deadline: &mut dyn FnMut() -> bool,
) where
    T: Real,
{
    let mut seen = Vec::<Sides, ROUTES_MAX>::new();
    for number in 0..routes.len() {
        if deadline() || race.laid >= race.settings.variants.max(1) {
            return;
        }
        if number > 0 {
            // Only an agent that is alone has more than one.
            let alone = prices.first().copied().unwrap_or_default();
            let Workspace { base, trial, scratch, .. } = &mut *workspace;
            trial.assign(base);
            routes.lay(number, scenario, trial, (0, alone, 0), scratch);
        }
        let sides = Sides::of(scenario, &workspace.trial);
        // More than one way there is only where sides tell them apart; where none has come clear yet, another flight time may.
        let is_open = race.found.status != Status::Infeasible;
        if is_open && seen.contains(&sides) {
            continue;
        }
        let _ = seen.push(sides);
        (race.idle, race.laid) = (race.idle + 1, race.laid + 1);
        if has_equipment(scenario) {
            let mut newer = *prices;
            equip(scenario, workspace, &mut newer);
            if matches!(race.polished, 0) {
                // Those of a straight line may be far off. From then on they stay, so that costs are the same.
                *prices = newer;
            }
        }
        if let Some(objective) = project(scenario, race.settings, workspace, ledger)
            && race.admits(objective, workspace)
        {
            workspace.best.assign(&workspace.trial);
            race.run(workspace, ledger, deadline);
        }
    }
}

/// Challenges the champion by what is near it; in a large team, where that is much, by ways that know the others'.
fn challenge<T, const DIM: usize, const NODES: usize, const SENSORS: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    race: &mut Race<'_, T, DIM>,
    (variants, prices): (&[Variant<T>], &[Prices<T>; AGENTS]),
    workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
    ledger: &mut Ledger<T>,
    deadline: &mut dyn FnMut() -> bool,
) where
    T: Real,
{
    if race.is_large() {
        return lay_again(scenario, race, (variants, prices), workspace, ledger, deadline);
    }
    race.change_sides(workspace, ledger, deadline);
    if has_equipment(scenario) {
        race.change_levels(workspace, ledger, deadline);
    }
}

/// Lays the ways of a team once more, each with the others on theirs: before, they were on straight lines. Better ways become
/// the champion.
fn lay_again<T, const DIM: usize, const NODES: usize, const SENSORS: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    race: &mut Race<'_, T, DIM>,
    (variants, prices): (&[Variant<T>], &[Prices<T>; AGENTS]),
    workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
    ledger: &mut Ledger<T>,
    deadline: &mut dyn FnMut() -> bool,
) where
    T: Real,
{
    let Some(variant) = variants.first() else { return };
    workspace.base.assign(&workspace.champion);
    if deadline() || lay(scenario, variant, (0, prices), workspace).is_err() {
        return;
    }
    if has_equipment(scenario) {
        equip(scenario, workspace, &mut [Prices::default(); AGENTS]);
    }
    if project(scenario, race.settings, workspace, ledger).is_some() {
        workspace.best.assign(&workspace.trial);
        race.run(workspace, ledger, deadline);
    }
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

/// Lattice paths of all agents, one after the other, into `workspace.trial`; the last one's ways, of which there may be more
/// than one where it is alone.
fn lay<T: Real, const DIM: usize, const NODES: usize, const SENSORS: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    variant: &Variant<T>,
    (order, prices): (usize, &[Prices<T>; AGENTS]),
    workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
) -> Result<Option<Routes<T, DIM>>, Obstacle<T, DIM>> {
    let Workspace { base, trial, landscape, turns, scratch, .. } = workspace;
    trial.assign(base);
    let mut routes = None;
    let Some(tables) = turns.lattice() else { return Ok(routes) };
    let mut lattice = Lattice { landscape, tables };
    let agents = scenario.agents.len();
    for place in 0..agents {
        let agent = at_place(order, place, agents);
        let prices = prices.get(agent).copied().unwrap_or_default();
        let found = warm_start::search(scenario, trial, agent, (variant, prices), &mut lattice, scratch);
        routes = Some(found.map_err(|obstruction| Obstacle::closing(agent, &obstruction))?);
    }
    keep_right(scenario, trial);
    Ok(routes)
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
pub(super) fn project<T: Real, const DIM: usize, const NODES: usize, const SENSORS: usize, const AGENTS: usize>(
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
