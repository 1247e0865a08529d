//! The built-in flight: a cold plan among eight sensors, then a warm replan every few intervals while one of them moves.
//!
//! Firmware and host run this same code in single precision, so that the bits of every path can be compared. Nothing
//! here is generic: the core is compiled here once for its sizes, and images link it as it is.
//!
//! Limits: one agent, [`INTERVALS`], [`SENSORS`].
#![no_std]

mod problem;
pub mod surface;
#[cfg(feature = "yardstick")]
pub mod yardstick;

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
    Settings::frugal()
}

/// Where a vehicle should be, and how fast.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setpoint {
    /// East and north, length units.
    pub position: [f32; 2],
    /// Length units per s.
    pub velocity: [f32; 2],
}

/// Whether what is flown of the plan in force before the next one lies behind at `time` (s).
#[must_use]
pub fn is_over(flight: &Flight, time: f32) -> bool {
    let tail = flight.tail();
    let last = INTERVALS_FLOWN.min(tail.intervals());
    tail.times.get(last).is_some_and(|&end| end <= time) && tail.intervals() > 0
}

/// Where the plan in force has the agent at `time` (s): on a segment, or at rest at an end.
#[must_use]
pub fn setpoint(flight: &Flight, time: f32) -> Setpoint {
    let tail = flight.tail();
    let path = tail.active().first().map(|track| track.path.as_slice()).unwrap_or_default();
    let nodes = || path.iter().zip(&tail.times).take(tail.nodes());
    let mut at = nodes().next().map(|(place, _)| Setpoint { position: (*place).into(), velocity: [0.0; 2] });
    for ((from, &begin), (to, &end)) in nodes().zip(nodes().skip(1)) {
        let velocity = (to - from) / (end - begin);
        if time >= end {
            at = Some(Setpoint { position: (*to).into(), velocity: [0.0; 2] });
        } else if time >= begin {
            at = Some(Setpoint { position: (from + velocity * (time - begin)).into(), velocity: velocity.into() });
        }
    }
    at.unwrap_or(Setpoint { position: [0.0; 2], velocity: [0.0; 2] })
}

/// Nodes of the plan in force, as bits: east, then north.
pub fn bits(flight: &Flight) -> impl Iterator<Item = [u32; 2]> {
    let tail = flight.tail();
    let path = tail.active().iter().flat_map(|track| track.path.iter());
    path.take(tail.nodes()).map(|place| [0, 1].map(|axis| place.get(axis).copied().unwrap_or_default().to_bits()))
}
