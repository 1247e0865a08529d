//! The objective: weighted terms of metrics along the paths, and the penalty on late arrival.
//!
//! | symbol | name | unit | shape |
//! |---|---|---|---|
//! | t_i, h_i = t_i - t_(i-1) | node times, intervals | s | N + 1, N |
//! | E(x_i) | metric at node i | | |
//! | M, t_F | `time.penalty`, `time.target` | 1/s^2, s | |
//!
//! J = sum over terms of +- weight * agent weight * (sum of h_i E(x_i), or the worst E(x_i)), over the nodes
//! 1 .. N whose time lies in the term's window, plus M max(0, t_N - t_F)^2. Minus where the term is maximised.
//!
//! Every node is visited once for all terms: [`gradient`] computes the figures of the node, collapses the terms
//! to one coefficient a figure, and goes back once. Extreme terms take a visit before that, to find the worst.
//!
//! Source: (3)-(5), (29), sections 2.1 and 4.1. Limits: a `scratch` shorter than the list of sensors leaves the
//! sensors past its end out; give it at least `scenario.sensors.len()` entries.
//!
//! ```
//! use quietpath_core::metrics::Sample;
//! use quietpath_core::objective::{Extreme, gradient, point_values, value};
//! use quietpath_core::scenario::*;
//! use quietpath_core::{Draft, Metric, Point, Scenario, Trajectory};
//!
//! let jam = Susceptibility { error_gain: 0.0, error_exponent: 2.0, detect_gain: 0.0, detect_exponent: 2.0 };
//! let sensor = Sensor {
//!     motion: Motion::Fixed(Point::<f64, 2>::new(5.0, 4.0)),
//!     ranging: None,
//!     detection: Some(Detection::Proxy { scale: 0.3, epsilon: 0.3, path_loss: 2.0 }),
//!     jam,
//! };
//! let agent = Agent {
//!     start: Point::<f64, 2>::new(1.0, 5.0),
//!     goal: Point::<f64, 2>::new(9.0, 5.0),
//!     start_velocity: None,
//!     speed_max: 0.1,
//!     accel_max: 0.02,
//!     weight: 1.0,
//!     jammer: None,
//!     dropout: None,
//! };
//! let term = Term {
//!     metric: Metric::Detection,
//!     sense: Sense::Minimize,
//!     reduce: Reduce::Integral,
//!     weight: 1.0,
//!     agents: AgentSet::ALL,
//!     window: Window::always(),
//! };
//! let scenario = Scenario::<f64, 2, 4, 1, 0>::new(&Draft {
//!     softening: 0.05,
//!     reference_point: ReferencePoint::Current,
//!     pooling: Pooling::None,
//!     intervals: 20,
//!     start_time: 0.0,
//!     time: Timing { max: 200.0, target: 100.0, penalty: 1.0 },
//!     domain: Domain { min: Point::<f64, 2>::new(0.0, 0.0), max: Point::<f64, 2>::new(10.0, 10.0) },
//!     agents: &[agent],
//!     sensors: &[sensor],
//!     terms: &[term],
//!     separation: None,
//!     regions: &[],
//!     limits: &[],
//! })?;
//! let view = scenario.view();
//! let mut scratch = [Sample::default(); 4];
//!
//! let line = Trajectory::<f64, 2, 21, 1>::straight(&view, 100.0)?;
//! let mut slope = Trajectory::empty();
//! let objective = gradient(&view, &line, Extreme::Exact, &mut scratch, &mut slope);
//! assert_eq!(objective, value(&view, &line, Extreme::Exact, &mut scratch));
//! // Half way, the sensor lies south of the path: the objective falls to the north.
//! assert!(slope.tracks[0].path[10][1] < 0.0);
//! assert!(point_values(&view, 0.0, &Point::<f64, 2>::new(5.0, 4.0), &mut scratch).detection > 0.9);
//! # Ok::<(), quietpath_core::Error>(())
//! ```

pub mod curvature;
pub(crate) mod merit;
mod tally;

use core::ops::AddAssign;

use heapless::Vec;

use crate::math::{Point, Real};
use crate::metrics::{Adjoint, Digits, Needs, Sample, Situation, Values, backward, figures, forward};
use crate::model::jamming::Emitter;
use crate::scenario::{Betrayal, Reduce, ReferencePoint, View};
use crate::trajectory::Trajectory;
use merit::Merit;
use tally::{Tally, Which};

/// What stands for the worst value along a path in terms that are reduced to it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Extreme<T> {
    /// The worst value itself; its gradient is that of the first node that has it.
    Exact,
    /// An upper bound with a gradient everywhere: `ln(sum of exp(sharpness * E)) / sharpness`, which exceeds the
    /// worst value by at most `ln(nodes) / sharpness`. Where the term is maximised E changes its sign, so that
    /// what is minimised is bounded from above in either case.
    Smooth {
        /// In reciprocals of the metric's unit; not greater than zero is taken as `Exact`.
        sharpness: T,
    },
}

/// All figures of `agent` at `node`, with every agent's jamming.
///
/// At node 0 the reference point is the position, whatever the scenario says. Figures of an agent or node that
/// does not exist are NaN, and its location errors `None`.
pub fn node_values<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    trajectory: &Trajectory<T, DIM, NODES, AGENTS>,
    agent: usize,
    node: usize,
    scratch: &mut [Sample<T, DIM>],
) -> Values<T> {
    needed_values(scenario, trajectory, (agent, node), Needs::ALL, scratch)
}

/// What [`node_values`] is, for the metrics that `needs` names; others are 0 or `None`.
pub(crate) fn needed_values<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    trajectory: &Trajectory<T, DIM, NODES, AGENTS>,
    (agent, node): (usize, usize),
    needs: Needs,
    scratch: &mut [Sample<T, DIM>],
) -> Values<T> {
    let Some(situation) = situation(scenario, trajectory, agent, node) else {
        let nothing = T::real(f64::NAN);
        return Values { detection: nothing, false_alarm: nothing, location: None };
    };
    let mut emitters = Emitters::<T, DIM, AGENTS>::new();
    lay_emitters(scenario, trajectory, node, &mut emitters);
    figures(scenario, &situation, &emitters, (needs, Digits::All), scratch)
}

/// All figures of an agent that stands at `position` (length units) at `time` (s): no jamming, no dropout, and
/// the reference point is the position. What landscapes are drawn from.
pub fn point_values<T: Real, const DIM: usize>(
    scenario: &View<'_, T, DIM>,
    time: T,
    position: &Point<T, DIM>,
    scratch: &mut [Sample<T, DIM>],
) -> Values<T> {
    let zero = T::zero();
    let situation = Situation {
        time,
        position: *position,
        reference: None,
        dropout: zero,
        level: zero,
        betrayal: Betrayal::None,
    };
    figures(scenario, &situation, &[], (Needs::ALL, Digits::All), scratch)
}

/// The objective, penalty on late arrival included.
pub fn value<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    trajectory: &Trajectory<T, DIM, NODES, AGENTS>,
    extreme: Extreme<T>,
    scratch: &mut [Sample<T, DIM>],
) -> T {
    merit_value(scenario, trajectory, &Merit::plain(extreme), scratch)
}

/// What [`value`] is to the objective, for what a solver puts in its place: regions and separations aside.
pub(crate) fn merit_value<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    trajectory: &Trajectory<T, DIM, NODES, AGENTS>,
    merit: &Merit<T>,
    scratch: &mut [Sample<T, DIM>],
) -> T {
    let (objective, limits) = merit_parts(scenario, trajectory, merit, scratch);
    objective + limits
}

/// The parts of [`merit_value`]: the objective, and what the limits add.
pub(crate) fn merit_parts<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    trajectory: &Trajectory<T, DIM, NODES, AGENTS>,
    merit: &Merit<T>,
    scratch: &mut [Sample<T, DIM>],
) -> (T, T) {
    let mut tally = Tally::new(merit);
    let mut limits = T::zero();
    survey(scenario, trajectory, Which::All, merit, (&mut tally, &mut limits), scratch);
    (tally.total(scenario) + merit.objective * lateness(scenario, trajectory).0, limits)
}

/// The objective, and its derivatives by everything a trajectory holds, written to `gradient`.
///
/// Every node time t_i is taken as free: intervals are differences of times, moving sensors move with them, and
/// the penalty depends on the last. A planner with equal intervals sums what it needs. Which node lies in which
/// window is taken as fixed. Node 0 is no part of the objective, except through t_0 and a lagged reference point.
pub fn gradient<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    trajectory: &Trajectory<T, DIM, NODES, AGENTS>,
    extreme: Extreme<T>,
    scratch: &mut [Sample<T, DIM>],
    gradient: &mut Trajectory<T, DIM, NODES, AGENTS>,
) -> T {
    merit_gradient(scenario, trajectory, &Merit::plain(extreme), scratch, gradient)
}

/// What [`gradient`] is to the objective, for what a solver puts in its place: regions and separations aside.
pub(crate) fn merit_gradient<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    trajectory: &Trajectory<T, DIM, NODES, AGENTS>,
    merit: &Merit<T>,
    scratch: &mut [Sample<T, DIM>],
    gradient: &mut Trajectory<T, DIM, NODES, AGENTS>,
) -> T {
    clear(gradient, trajectory);
    let mut tally = Tally::new(merit);
    let mut limits = T::zero();
    if scenario.terms.iter().any(|term| term.reduce == Reduce::Extreme) {
        survey(scenario, trajectory, Which::Extremes, merit, (&mut tally, &mut limits), scratch);
        limits = T::zero();
    }
    let mut emitters = Emitters::<T, DIM, AGENTS>::new();
    for node in 1..trajectory.nodes() {
        lay_emitters(scenario, trajectory, node, &mut emitters);
        for agent in 0..trajectory.agents() {
            let Some(situation) = situation(scenario, trajectory, agent, node) else {
                continue;
            };
            let mut needs = tally::needs(scenario, agent, situation.time, Which::All);
            merit.needs(scenario, &mut needs);
            if needs.nothing() {
                continue;
            }
            let outcome = forward(scenario, &situation, &emitters, needs, scratch);
            let interval = interval(trajectory, node);
            tally.integrate(scenario, agent, situation.time, interval, &outcome.values);
            let (mut adjoint, by_interval) =
                tally.adjoint(scenario, agent, node, situation.time, interval, &outcome.values);
            limits += merit.limits(scenario, &outcome.values, &mut adjoint);
            let derivative = backward(scenario, &situation, &mut emitters, &outcome, &adjoint, scratch);
            add_at(&mut gradient.times, node, derivative.time + by_interval);
            add_at(&mut gradient.times, node - 1, -by_interval);
            if let Some(track) = gradient.tracks.get_mut(agent) {
                add_at(&mut track.path, node, derivative.position);
                if situation.reference.is_some() {
                    add_at(&mut track.path, node - 1, derivative.reference);
                }
                add_at(&mut track.jam, node, derivative.level);
                add_at(&mut track.dropout, node, derivative.dropout);
            }
        }
        for emitter in &emitters {
            if let Some(track) = gradient.tracks.get_mut(emitter.agent) {
                add_at(&mut track.path, node, emitter.adjoint.position);
                add_at(&mut track.jam, node, emitter.adjoint.level);
                add_at(&mut track.azimuth, node, emitter.adjoint.azimuth);
            }
        }
    }
    let (penalty, by_arrival) = lateness(scenario, trajectory);
    add_at(&mut gradient.times, trajectory.intervals(), merit.objective * by_arrival);
    tally.total(scenario) + merit.objective * penalty + limits
}

/// Visits all nodes for their values, and enters them into the tally.
fn survey<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    trajectory: &Trajectory<T, DIM, NODES, AGENTS>,
    which: Which,
    merit: &Merit<T>,
    (tally, limits): (&mut Tally<T, AGENTS>, &mut T),
    scratch: &mut [Sample<T, DIM>],
) {
    let mut emitters = Emitters::<T, DIM, AGENTS>::new();
    for node in 1..trajectory.nodes() {
        lay_emitters(scenario, trajectory, node, &mut emitters);
        for agent in 0..trajectory.agents() {
            let Some(situation) = situation(scenario, trajectory, agent, node) else {
                continue;
            };
            let mut needs = tally::needs(scenario, agent, situation.time, which);
            if which == Which::All {
                merit.needs(scenario, &mut needs);
            }
            if needs.nothing() {
                continue;
            }
            let values = figures(scenario, &situation, &emitters, (needs, Digits::All), scratch);
            tally.compare(scenario, agent, node, situation.time, &values);
            if which == Which::All {
                tally.integrate(scenario, agent, situation.time, interval(trajectory, node), &values);
                *limits += merit.limits(scenario, &values, &mut Adjoint::default());
            }
        }
    }
}

/// M max(0, t_N - t_F)^2 and its derivative by t_N. Source: (29).
pub(crate) fn lateness<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    trajectory: &Trajectory<T, DIM, NODES, AGENTS>,
) -> (T, T) {
    let timing = &scenario.frame.time;
    let arrival = trajectory.times.get(trajectory.intervals()).copied().unwrap_or_default();
    let late = (arrival - timing.target).max(T::zero());
    (timing.penalty * late * late, T::real(2.0) * timing.penalty * late)
}

/// h_i, s.
#[inline]
fn interval<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize>(
    trajectory: &Trajectory<T, DIM, NODES, AGENTS>,
    node: usize,
) -> T {
    let time = |index: usize| trajectory.times.get(index).copied().unwrap_or_default();
    time(node) - time(node.saturating_sub(1))
}

#[inline]
fn add_at<V: AddAssign>(list: &mut [V], index: usize, added: V) {
    if let Some(entry) = list.get_mut(index) {
        *entry += added;
    }
}

/// Zeros of the size of `trajectory`.
fn clear<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize>(
    gradient: &mut Trajectory<T, DIM, NODES, AGENTS>,
    trajectory: &Trajectory<T, DIM, NODES, AGENTS>,
) {
    let used = gradient.nodes().max(trajectory.nodes());
    let agents = gradient.agents().max(trajectory.agents());
    // A trajectory of the same type fits.
    let _ = gradient.resize(trajectory.intervals(), trajectory.agents());
    gradient.times.iter_mut().take(used).for_each(|time| *time = T::zero());
    for track in gradient.tracks.iter_mut().take(agents) {
        track.path.iter_mut().take(used).for_each(|position| *position = Point::zeros());
        for control in [&mut track.jam, &mut track.azimuth, &mut track.dropout] {
            control.iter_mut().take(used).for_each(|entry| *entry = T::zero());
        }
    }
}

/// What the figures of `agent` at `node` depend on; `None` where there is no such agent or node.
#[inline]
fn situation<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    trajectory: &Trajectory<T, DIM, NODES, AGENTS>,
    agent: usize,
    node: usize,
) -> Option<Situation<T, DIM>> {
    if node > trajectory.intervals() {
        return None;
    }
    let track = trajectory.active().get(agent)?;
    let reference = match scenario.frame.reference_point {
        ReferencePoint::Lagged if node > 0 => Some(*track.path.get(node - 1)?),
        _ => None,
    };
    Some(Situation {
        time: *trajectory.times.get(node)?,
        position: *track.path.get(node)?,
        reference,
        dropout: *track.dropout.get(node)?,
        level: *track.jam.get(node)?,
        betrayal: scenario.agents.get(agent)?.jammer.map_or(Betrayal::None, |jammer| jammer.betrayal),
    })
}

/// All jammers at a node.
type Emitters<T, const DIM: usize, const AGENTS: usize> = Vec<Emitter<T, DIM>, AGENTS>;

/// All jammers at `node`, into a list that is made once: handed over, it would be copied in full, room and all.
fn lay_emitters<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    trajectory: &Trajectory<T, DIM, NODES, AGENTS>,
    node: usize,
    emitters: &mut Emitters<T, DIM, AGENTS>,
) {
    emitters.clear();
    for (index, (agent, track)) in scenario.agents.iter().zip(trajectory.active()).enumerate() {
        let at_node = (track.path.get(node), track.jam.get(node), track.azimuth.get(node));
        if let (Some(jammer), (Some(&position), Some(&level), Some(&azimuth))) = (&agent.jammer, at_node) {
            // One a track at most, so there is room.
            let _ = emitters.push(Emitter::new(index, jammer, position, level, azimuth));
        }
    }
}
