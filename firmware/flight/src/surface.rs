//! What firmware can ask of the core, besides the flight itself: every public entry point, for the flight's sizes.
//!
//! None of it is needed to fly. It is here so that an image can prove that no panic is reachable from any of it.

use quietpath_core::constraints::{Violations, violations};
use quietpath_core::horizon::{Search, State, Step};
use quietpath_core::metrics::{Sample, Values};
use quietpath_core::objective::{Extreme, gradient, point_values, value};
use quietpath_core::scenario::{Draft, Scenario};
use quietpath_core::solver::{Outcome, Settings, Start, plan};
use quietpath_core::{Error, Point, Trajectory};

use super::{Flight, Memory, NODES, Problem, SENSORS};

/// A plan.
pub type Path = Trajectory<f32, 2, NODES, 1>;
/// Scratch for a node.
pub type Scratch = [Sample<f32, 2>; SENSORS];

/// Checks a problem and copies it.
///
/// # Errors
/// What is wrong with it.
#[inline(never)]
pub fn check(draft: &Draft<'_, f32, 2>) -> Result<Problem, Error> {
    Scenario::new(draft)
}

/// Plans from anywhere.
///
/// # Errors
/// What the planner does not plan.
#[inline(never)]
pub fn plan_from(
    problem: &Problem,
    settings: &Settings<f32>,
    start: Start<'_, f32, 2, NODES, 1>,
    memory: &mut Memory,
    deadline: &mut dyn FnMut() -> bool,
) -> Result<Outcome<f32, 2>, Error> {
    plan(&problem.view(), settings, start, memory, deadline)
}

/// Plans the rest of a flight from where the agent was found.
///
/// # Errors
/// Another number of agents, or what the planner does not plan.
#[inline(never)]
pub fn resume(
    flight: &mut Flight,
    (time, states): (f32, &[State<f32, 2>]),
    (seen, settings): (&Problem, &Settings<f32>),
    memory: &mut Memory,
    deadline: &mut dyn FnMut() -> bool,
) -> Result<Step<f32, 2>, Error> {
    flight.resume(time, states)?;
    flight.replan(&seen.view(), settings, Search::Anew, memory, deadline)
}

/// Objective, its gradient, and violations of a plan.
#[inline(never)]
pub fn assess(problem: &Problem, path: &Path, by: &mut Path, scratch: &mut Scratch) -> (f32, Violations<f32>) {
    let view = problem.view();
    let found = value(&view, path, Extreme::Exact, scratch);
    gradient(&view, path, Extreme::Exact, scratch, by);
    (found, violations(&view, path, scratch))
}

/// All metrics at a place and time.
#[inline(never)]
pub fn look(problem: &Problem, time: f32, place: &Point<f32, 2>, scratch: &mut Scratch) -> Values<f32> {
    point_values(&problem.view(), time, place, scratch)
}
