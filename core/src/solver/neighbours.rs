//! Challengers of a good path: the same with one decision changed that no local step can change.
//!
//! - *Sides*: a path passes a sensor, or a region, on one side; a challenger passes it on the other.
//! - *Times*: a term whose window opens or closes counts node by node, so that the objective jumps where a node crosses that
//!   instant; a challenger flies a little slower or faster, so that one does.
//!
//! | symbol | name | unit |
//! |---|---|---|
//! | k | node nearest to what is passed | |
//! | w | width of the detour | nodes |
//!
//! Limits: one decision at a time; sides are those in the horizontal plane; [`TIMES_MAX`] other times, those of the terms
//! that come first.

use heapless::Vec;

use crate::constraints::region::horizontal;
use crate::math::{Point, Real, keep_least, norm};
use crate::scenario::{View, Window};
use crate::trajectory::Trajectory;

/// Things whose other side is tried, nearest first.
pub(super) const SIDES_MAX: usize = 6;
/// Flight times that are tried at once, at most.
pub(super) const TIMES_MAX: usize = 8;
/// Largest distance from the path at which a side is a decision, over the length of the straight line.
const NEAR: f64 = 0.12;
/// Width of a detour over its height.
const WIDTH: f64 = 2.0;
/// Least distance beyond the edge of a region, over its radius.
const BEYOND: f64 = 0.1;
/// Part of the flight time by which a node goes beyond an instant.
const PAST: f64 = 1e-6;

/// Something that an agent passes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Passed<T> {
    agent: usize,
    by: By,
    /// Room between it and the path, length units.
    room: T,
}

#[derive(Clone, Copy, Debug)]
enum By {
    Sensor(usize),
    Region(usize),
}

/// What the agents pass, nearest first.
pub(super) fn passed<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    trajectory: &Trajectory<T, DIM, NODES, AGENTS>,
) -> Vec<Passed<T>, SIDES_MAX> {
    let mut all = Vec::new();
    for (agent, equipped) in scenario.agents.iter().enumerate() {
        let near = norm(&(equipped.goal - equipped.start)) * T::real(NEAR);
        let sensors = (0..scenario.sensors.len()).map(By::Sensor);
        for by in sensors.chain((0..scenario.regions.len()).map(By::Region)) {
            let Some(found) = nearest(scenario, trajectory, agent, by) else { continue };
            let room = norm(&found.offset) - found.radius;
            if room < near {
                keep_least(&mut all, Passed { agent, by, room }, |passed| passed.room);
            }
        }
    }
    all
}

/// Where a path is nearest to something.
struct Nearest<T> {
    node: usize,
    /// From the path to the middle of it, horizontally.
    offset: Point<T, 2>,
    radius: T,
}

fn nearest<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    trajectory: &Trajectory<T, DIM, NODES, AGENTS>,
    agent: usize,
    by: By,
) -> Option<Nearest<T>> {
    let track = trajectory.active().get(agent)?;
    let mut best: Option<Nearest<T>> = None;
    let places = track.path.iter().zip(&trajectory.times).enumerate();
    for (node, (place, &time)) in places.take(trajectory.intervals()).skip(1) {
        let (middle, radius) = match by {
            By::Sensor(sensor) => {
                let sensor = scenario.sensors.get(sensor)?;
                (horizontal(&scenario.sensor_state(sensor, time).0), T::zero())
            }
            By::Region(region) => scenario.regions.get(region)?.circle(),
        };
        let offset = middle - horizontal(place);
        if best.as_ref().is_none_or(|best| norm(&offset) < norm(&best.offset)) {
            best = Some(Nearest { node, offset, radius });
        }
    }
    best
}

/// Leads the path of an agent round the other side of what it passes; false where there is no other side.
pub(super) fn change_side<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    trajectory: &mut Trajectory<T, DIM, NODES, AGENTS>,
    passed: &Passed<T>,
) -> bool {
    let Some(found) = nearest(scenario, trajectory, passed.agent, passed.by) else { return false };
    let intervals = trajectory.intervals();
    let distance = norm(&found.offset);
    // Flown over, it has no sides.
    if distance <= passed.room.abs() * T::real(1e-3) || distance <= T::MIN_POSITIVE {
        return false;
    }
    let least = found.radius * T::real(1.0 + BEYOND);
    let height = distance + distance.max(least);
    let aside = found.offset * (height / distance);
    let Some(track) = trajectory.active_mut().get_mut(passed.agent) else { return false };
    let legs = track.path.iter().zip(track.path.iter().skip(1)).take(intervals);
    let length = legs.fold(T::zero(), |sum, (from, to)| sum + norm(&(to - from)));
    let width = height * T::real(WIDTH) * T::from_count(intervals) / length.max(T::MIN_POSITIVE);
    for (node, place) in track.path.iter_mut().enumerate().take(intervals).skip(1) {
        let (end, away) = if node < found.node {
            (found.node, T::from_count(found.node - node))
        } else {
            (intervals - found.node, T::from_count(node - found.node))
        };
        let side = width.min(T::from_count(end)).max(T::one());
        if away < side {
            // From 1 at the node to 0, level at both ends.
            let share = away / side;
            let part = (T::one() - share * share).squared();
            place.iter_mut().zip(aside.iter()).for_each(|(component, &aside)| *component += aside * part);
        }
    }
    true
}

/// Flight times, shorter and longer ones, at which one node more or less is before an instant at which terms change, s: half
/// way to where the next node is. A path that has just crossed would be brought back by the projection, which may take longer.
pub(super) fn other_times<T: Real, const DIM: usize>(scenario: &View<'_, T, DIM>, duration: T) -> Vec<T, TIMES_MAX> {
    crossings(scenario, duration, T::real(0.5))
}

/// The shortest and the longest flight time around `duration` at which no node crosses an instant at which terms change, s;
/// `None` where there is no such instant on that side.
pub(super) fn piece<T: Real, const DIM: usize>(scenario: &View<'_, T, DIM>, duration: T) -> [Option<T>; 2] {
    let edges = crossings(scenario, duration, T::zero());
    let shortest = edges.iter().copied().filter(|time| *time < duration).reduce(T::max);
    let longest = edges.iter().copied().filter(|time| *time > duration).reduce(T::min);
    // What is known is on the other side of the instants.
    let (above, below) = (T::real(1.0 + 2.0 * PAST), T::real(1.0 - 2.0 * PAST));
    [shortest.map(|time| time * above), longest.map(|time| time * below)]
}

/// Flight times at which a node has crossed an instant at which terms change, and is `beyond` it by a part of the way to the
/// node after, s; shorter and longer ones, one of each an instant.
fn crossings<T: Real, const DIM: usize>(scenario: &View<'_, T, DIM>, duration: T, beyond: T) -> Vec<T, TIMES_MAX> {
    let mut times = Vec::new();
    let count = T::from_count(scenario.frame.intervals.max(1));
    let start = scenario.frame.start_time;
    let ends = |window: &Window<T>| [window.from, window.until];
    for instant in scenario.terms.iter().flat_map(|term| ends(&term.window)) {
        let place = (instant - start) * count / duration;
        if !place.finite() || place <= T::one() || place >= count {
            continue;
        }
        let before = place.floor();
        let longer = (instant - start) * count / (before - beyond) * T::real(1.0 + PAST);
        let shorter = (instant - start) * count / (before + T::one() + beyond) * T::real(1.0 - PAST);
        for time in [shorter, longer] {
            let is_known = times.iter().any(|known: &T| (*known - time).abs() <= time * T::real(PAST));
            if !is_known {
                let _ = times.push(time);
            }
        }
    }
    times
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::{
        AgentSet, Domain, Draft, Metric, Pooling, Reduce, ReferencePoint, Scenario, Sense, Term, Timing,
    };

    #[test]
    fn the_nearest_are_kept_in_order() {
        let mut all = Vec::<_, SIDES_MAX>::new();
        for room in [5.0, 1.0, 4.0, 2.0, 9.0, 3.0, 0.5, 8.0] {
            keep_least(&mut all, Passed { agent: 0, by: By::Sensor(0), room }, |passed| passed.room);
        }
        let rooms: std::vec::Vec<f64> = all.iter().map(|passed| passed.room).collect();
        assert_eq!(rooms, [0.5, 1.0, 2.0, 3.0, 4.0, 5.0]);
    }

    /// Ten intervals, and a term that ends at 4.5 s.
    fn until(instant: f64) -> Scenario<f64, 2, 1, 1, 0> {
        let agent = crate::scenario::Agent {
            start: Point::<f64, 2>::new(0.0, 0.0),
            goal: Point::<f64, 2>::new(8.0, 0.0),
            start_velocity: None,
            speed_max: 10.0,
            accel_max: 100.0,
            weight: 1.0,
            jammer: None,
            dropout: None,
        };
        let term = Term {
            metric: Metric::Detection,
            sense: Sense::Minimize,
            reduce: Reduce::Integral,
            weight: 1.0,
            agents: AgentSet::ALL,
            window: Window { from: -f64::INFINITY, until: instant },
        };
        Scenario::new(&Draft {
            softening: 1e-3,
            reference_point: ReferencePoint::Current,
            intervals: 10,
            start_time: 0.0,
            time: Timing { max: 20.0, target: 0.0, penalty: 0.0 },
            domain: Domain { min: Point::<f64, 2>::new(-1.0, -1.0), max: Point::<f64, 2>::new(9.0, 9.0) },
            separation: None,
            agents: &[agent],
            sensors: &[],
            terms: &[term],
            pooling: Pooling::None,
            regions: &[],
            limits: &[],
        })
        .unwrap()
    }

    #[test]
    fn other_times_are_half_way_into_the_pieces_beside() {
        let scenario = until(4.5);
        let view = scenario.view();
        // Node 4 is before the instant and node 5 after it from 9 s to 11.25 s.
        let [shortest, longest] = piece(&view, 10.0).map(Option::unwrap);
        assert!((shortest - 9.0).abs() < 1e-4 && (longest - 11.25).abs() < 1e-4, "{shortest} to {longest} s");
        let [shorter, longer] = *other_times(&view, 10.0) else { panic!("two times") };
        assert!((shorter - 45.0 / 5.5).abs() < 1e-4 && (longer - 45.0 / 3.5).abs() < 1e-4, "{shorter}, {longer} s");
        let [_, edge] = piece(&view, shorter * 1.01);
        assert!(edge.is_some_and(|edge| edge < shortest), "a little slower is still beyond: {edge:?}");
    }
}
