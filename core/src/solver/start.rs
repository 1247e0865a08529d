//! Where planning starts: a feasible iterate, and an anchor strictly inside the bounds.
//!
//! Without start velocities the straight line at constant speed is feasible whenever the goal can be reached, and
//! strictly so for any flight time longer than the shortest. With them, the straight line is projected on the
//! bounds at one flight time after another until a feasible path comes out. A straight line that is not clear of regions,
//! separations and limits is tried at other flight times; one that is at none, or bends, is led clear by the planner.

use crate::constraints;
use crate::error::{Error, Fault, Item};
use crate::math::Real;
use crate::metrics::Sample;
use crate::scenario::View;
use crate::trajectory::Trajectory;
use crate::warm_start::azimuth_of_nearest;

use super::coordinates::Frame;
use super::projection::Request;
use super::{Settings, Workspace, guard};

/// Flight times tried, as multiples of the shortest, until a path that follows the start velocity is found.
const STRETCHES: [f64; 6] = [1.05, 1.2, 1.5, 2.0, 3.0, 5.0];

/// The first flight time where none is wanted, as a multiple of the shortest.
const USUAL: f64 = 1.3;
/// Flight times, evenly up to the longest, that are tried where what is in the way of a straight line may pass.
const TIMES: usize = 8;

/// Part of a budget that the first controls use, and the largest first level.
const FIRST_SHARE: f64 = 0.5;

/// Where a plan begins.
#[derive(Clone, Copy, Debug)]
pub enum Start<'a, T, const DIM: usize, const NODES: usize, const AGENTS: usize> {
    /// Straight lines at constant speed.
    Straight,
    /// The best of several lattice searches over the whole domain and of the straight lines.
    Global,
    /// A trajectory of the caller, such as an earlier plan. It is used if it keeps all bounds but regions, separations
    /// and limits, which the planner leads it clear of. Where agents have start velocities, it is otherwise projected
    /// on the bounds; if that fails, the straight lines are used.
    Given(&'a Trajectory<T, DIM, NODES, AGENTS>),
}

/// Whether the time there is is the shortest flight time itself: then the straight line is all there is, and the
/// feasible set has no interior to search.
pub(super) fn is_straight_only<T: Real, const DIM: usize>(scenario: &View<'_, T, DIM>) -> bool {
    let allowed = scenario.frame.time.max - scenario.frame.start_time;
    let has_free_start = scenario.agents.iter().all(|agent| agent.start_velocity.is_none());
    let slack = allowed - scenario.shortest_flight();
    has_free_start && slack <= allowed * T::EPSILON * T::real(16.0) || scenario.frame.intervals < 2
}

/// A sensible flight time to begin with: the target, if there is one that can be met, and a little more than the
/// shortest otherwise.
fn first_duration<T: Real, const DIM: usize>(scenario: &View<'_, T, DIM>) -> T {
    let frame = &scenario.frame;
    let allowed = frame.time.max - frame.start_time;
    let shortest = scenario.shortest_flight();
    let wanted = if frame.time.penalty > T::zero() && frame.time.target > frame.start_time {
        frame.time.target - frame.start_time
    } else {
        shortest * T::real(USUAL)
    };
    let least = shortest * T::real(1.05);
    if wanted.max(least) < allowed { wanted.max(least) } else { (shortest + allowed) * T::real(0.5) }
}

/// Fills `workspace.best` and `workspace.iterate` with a feasible start, `workspace.anchor` with a strictly
/// feasible iterate, and returns the frame that they are measured in.
pub(super) fn lay<T, const DIM: usize, const NODES: usize, const SENSORS: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    settings: &Settings<T>,
    start: Start<'_, T, DIM, NODES, AGENTS>,
    workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
) -> Result<(), Error>
where
    T: Real,
{
    let allowed = scenario.frame.time.max - scenario.frame.start_time;
    let has_velocity = scenario.agents.iter().any(|agent| agent.start_velocity.is_some());
    if is_straight_only(scenario) {
        workspace.best.lay_straight(scenario, allowed)?;
        return Ok(());
    }
    if let Start::Given(given) = start {
        let fits = given.intervals() == scenario.frame.intervals && given.agents() == scenario.agents.len();
        if fits && bounds_excess(scenario, given, &mut workspace.scratch) <= T::real(constraints::TOLERANCE) {
            workspace.best.assign(given);
            return Ok(());
        }
        if fits && has_velocity {
            workspace.trial.assign(given);
            if bring_within(scenario, settings, given.duration().min(allowed), workspace) {
                workspace.best.assign(&workspace.trial);
                return Ok(());
            }
        }
    }
    let first = first_duration(scenario);
    if !has_velocity {
        workspace.best.lay_straight(scenario, first)?;
        lay_controls(scenario, &mut workspace.best);
        if guard::smallest_slack(scenario, &workspace.best, &mut workspace.scratch) <= T::zero() {
            avoid_by_time(scenario, workspace)?;
        }
        return Ok(());
    }
    let shortest = scenario.shortest_flight().max(first * T::real(0.1));
    for stretch in STRETCHES {
        let duration = (shortest * T::real(stretch)).min(allowed);
        workspace.trial.lay_straight(scenario, duration)?;
        if bring_within(scenario, settings, duration, workspace) {
            workspace.best.assign(&workspace.trial);
            lay_controls(scenario, &mut workspace.best);
            return Ok(());
        }
    }
    let agent = scenario.agents.iter().position(|agent| agent.start_velocity.is_some()).unwrap_or_default();
    Err(Error::new(Item::Agent(agent), "start_velocity", Fault::StartVelocity))
}

/// Replaces `workspace.best` by the first straight line, without jamming or dropout, that regions and limits are clear of
/// at one of [`TIMES`] flight times; leaves it where there is none.
///
/// The planner would lead it out of their way too, but has no plan until it has, and a deadline may come first.
fn avoid_by_time<T: Real, const DIM: usize, const NODES: usize, const SENSORS: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
) -> Result<(), Error> {
    let allowed = scenario.frame.time.max - scenario.frame.start_time;
    let shortest = scenario.shortest_flight();
    let usual = (shortest * T::real(USUAL)).min(allowed);
    let between =
        (0..TIMES).map(|time| shortest + (allowed - shortest) * (T::from_count(time + 1) / T::from_count(TIMES)));
    for duration in core::iter::once(usual).chain(between) {
        workspace.trial.lay_straight(scenario, duration)?;
        if guard::smallest_slack(scenario, &workspace.trial, &mut workspace.scratch) > T::zero() {
            workspace.best.assign(&workspace.trial);
            break;
        }
    }
    Ok(())
}

/// The largest violation of what the projection knows: everything but regions, separations and limits.
fn bounds_excess<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    trajectory: &Trajectory<T, DIM, NODES, AGENTS>,
    scratch: &mut [Sample<T, DIM>],
) -> T {
    let found = constraints::violations(scenario, trajectory, scratch);
    let zero = T::zero();
    constraints::Violations { limit: zero, region: zero, separation: zero, ..found }.worst().1
}

/// Projects `workspace.trial`, flown in `duration` seconds, on the bounds; whether it keeps them then.
fn bring_within<T, const DIM: usize, const NODES: usize, const SENSORS: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    settings: &Settings<T>,
    duration: T,
    workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
) -> bool
where
    T: Real,
{
    let frame = Frame::<T, DIM, AGENTS>::new(scenario, duration);
    workspace.trial.set_duration(scenario.frame.start_time, duration);
    frame.collapse(&workspace.trial, &mut workspace.iterate);
    workspace.gradient.clear(&frame);
    workspace.projection.prepare(&frame);
    let request = Request {
        frame: &frame,
        domain: &scenario.frame.domain,
        step: T::one(),
        margin: settings.margin * T::real(100.0),
        tolerance: settings.margin * T::real(10.0),
        steps_max: settings.projection_steps * 10,
    };
    workspace.projection.project(&request, &workspace.iterate, &workspace.gradient, &mut workspace.candidate);
    frame.expand(&workspace.candidate, &mut workspace.trial);
    bounds_excess(scenario, &workspace.trial, &mut workspace.scratch) <= T::zero()
}

/// Spreads a part of each budget evenly over the flight, and points beams at the nearest ranging sensor.
///
/// A beam that emits nothing, or that reaches no sensor, has no gradient to improve it by.
fn lay_controls<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    trajectory: &mut Trajectory<T, DIM, NODES, AGENTS>,
) {
    let (nodes, duration) = (trajectory.nodes(), trajectory.duration());
    let times = trajectory.times;
    let level = |budget: T| (budget * T::real(FIRST_SHARE) / duration).min(T::real(FIRST_SHARE));
    for (track, agent) in trajectory.active_mut().iter_mut().zip(scenario.agents) {
        if let Some(jammer) = agent.jammer {
            track.jam.get_mut(1..nodes).unwrap_or_default().fill(level(jammer.budget));
            let places = track.path.iter().zip(&times).take(nodes);
            for (azimuth, (position, &time)) in track.azimuth.iter_mut().zip(places) {
                *azimuth = azimuth_of_nearest(scenario, position, time);
            }
        }
        if let Some(dropout) = agent.dropout {
            track.dropout.get_mut(1..nodes).unwrap_or_default().fill(level(dropout.budget));
        }
    }
}
