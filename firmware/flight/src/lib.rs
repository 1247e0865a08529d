//! The built-in flight: a cold plan among eight sensors, then a warm replan every few intervals while one of them moves.
//!
//! Firmware and host run this same code in single precision, so that the bits of every path can be compared. Nothing
//! here is generic: the core is compiled here once for its sizes, and images link it as it is.
//!
//! Limits: one agent, [`INTERVALS`], [`SENSORS`].
#![no_std]

mod problem;
pub mod surface;

use quietpath_core::horizon::{Horizon, Search, Step};
use quietpath_core::scenario::Scenario;
use quietpath_core::solver::{Settings, Workspace};

pub use problem::problem;
pub use quietpath_core::{Error, solver::Status};

/// Intervals of the first plan.
pub const INTERVALS: usize = 32;
/// Nodes, one more than intervals.
pub const NODES: usize = INTERVALS + 1;
/// Sensors.
pub const SENSORS: usize = 8;
/// Intervals that are flown between two plans.
pub const INTERVALS_FLOWN: usize = 4;

/// A checked problem.
pub type Problem = Scenario<f32, 2, SENSORS, 1, 1>;
/// The planner's memory.
pub type Memory = Workspace<f32, 2, NODES, SENSORS, 1>;
/// The flight, as planned and as flown.
pub type Flight = Horizon<f32, 2, NODES, 1>;
/// What a plan did.
pub type Planned = Step<f32, 2>;

/// The flight before its first plan.
///
/// # Errors
/// None: the problem is sound.
#[inline(never)]
pub fn begin() -> Result<Flight, Error> {
    // Borrowed, not moved: a problem is too large for a second copy on the stack.
    match &problem(0.0) {
        Ok(seen) => Flight::new(&seen.view()),
        Err(error) => Err(*error),
    }
}

/// Plans what is left of the flight among the sensors as they are now: the first time everywhere, later near the plan
/// before.
///
/// # Errors
/// None: the problem is sound.
#[inline(never)]
pub fn replan(flight: &mut Flight, memory: &mut Memory) -> Result<Planned, Error> {
    match &problem(flight.tail().start_time()) {
        Ok(seen) => flight.replan(&seen.view(), &settings(), Search::Tail, memory, &mut || false),
        Err(error) => Err(*error),
    }
}

/// Flies on to the next plan; false at the end of the flight.
#[inline(never)]
pub fn fly(flight: &mut Flight) -> bool {
    flight.fly(INTERVALS_FLOWN);
    !flight.has_arrived()
}

/// How precisely it plans.
#[must_use]
pub fn settings() -> Settings<f32> {
    Settings::default()
}

/// Nodes of the plan in force, as bits: east, then north.
pub fn bits(flight: &Flight) -> impl Iterator<Item = [u32; 2]> {
    let tail = flight.tail();
    let path = tail.active().iter().flat_map(|track| track.path.iter());
    path.take(tail.nodes()).map(|place| [0, 1].map(|axis| place.get(axis).copied().unwrap_or_default().to_bits()))
}
