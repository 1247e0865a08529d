//! The whole core, instantiated for a microcontroller in `f32` and in `f64`, in two and three dimensions.
//!
//! `quietpath-core` is generic over its number type and its sizes, so building it alone compiles hardly anything.
//! These functions name every type, and so make the compiler generate all of it: without standard library, and
//! without allocator, which a static library may not lack. Sizes are those of a small flight.
#![no_std]
#![forbid(unsafe_code)]

use quietpath_core::constraints::{Violations, violations};
use quietpath_core::horizon::{Horizon, Search, State, Step};
use quietpath_core::metrics::{Sample, Values};
use quietpath_core::objective::{Extreme, point_values, value};
use quietpath_core::scenario::{Draft, Scenario};
use quietpath_core::solver::{Outcome, Settings, Start, Workspace, plan};
use quietpath_core::{Error, Point, Trajectory};

/// Nodes of the time grid, one more than intervals.
pub const NODES: usize = 65;
/// Sensors.
pub const SENSORS: usize = 16;
/// Agents.
pub const AGENTS: usize = 2;
/// Entries of all sensor tracks together.
pub const KNOTS: usize = 32;

macro_rules! flight {
    ($module:ident, $real:ty, $dim:literal) => {
        /// Everything that firmware asks of the core, for one number type and dimension.
        pub mod $module {
            use super::*;

            /// A checked scenario.
            pub type FlightScenario = Scenario<$real, $dim, SENSORS, AGENTS, KNOTS>;
            /// A plan.
            pub type Flight = Trajectory<$real, $dim, NODES, AGENTS>;
            /// The planner's memory.
            pub type FlightWorkspace = Workspace<$real, $dim, NODES, SENSORS, AGENTS>;

            /// A flight that is planned in steps.
            pub type FlightHorizon = Horizon<$real, $dim, NODES, AGENTS>;

            /// Bytes of the planner's memory, to be read off the image.
            pub static WORKSPACE_BYTES: usize = size_of::<FlightWorkspace>();

            /// Checks a scenario and copies it.
            ///
            /// # Errors
            /// What is wrong with it.
            pub fn check(draft: &Draft<'_, $real, $dim>) -> Result<FlightScenario, Error> {
                Scenario::new(draft)
            }

            /// Plans from the straight line, or from an earlier plan.
            ///
            /// # Errors
            /// What the planner does not plan.
            pub fn fly(
                scenario: &FlightScenario,
                earlier: Option<&Flight>,
                workspace: &mut FlightWorkspace,
                deadline: &mut dyn FnMut() -> bool,
            ) -> Result<Outcome<$real, $dim>, Error> {
                let start = earlier.map_or(Start::Straight, Start::Given);
                plan(&scenario.view(), &Settings::default(), start, workspace, deadline)
            }

            /// Plans the rest of a flight from where the agents were found.
            ///
            /// # Errors
            /// Another number of agents, or what the planner does not plan.
            pub fn step(
                horizon: &mut FlightHorizon,
                (time, states): ($real, &[State<$real, $dim>]),
                seen: &FlightScenario,
                workspace: &mut FlightWorkspace,
                deadline: &mut dyn FnMut() -> bool,
            ) -> Result<Step<$real, $dim>, Error> {
                horizon.resume(time, states)?;
                horizon.replan(&seen.view(), &Settings::default(), Search::Tail, workspace, deadline)
            }

            /// Objective and violations of a plan.
            pub fn assess(
                scenario: &FlightScenario,
                flight: &Flight,
                scratch: &mut [Sample<$real, $dim>; SENSORS],
            ) -> ($real, Violations<$real>) {
                let view = scenario.view();
                (value(&view, flight, Extreme::Exact, scratch), violations(&view, flight, scratch))
            }

            /// All metrics at a place and time.
            pub fn look(
                scenario: &FlightScenario,
                time: $real,
                place: &Point<$real, $dim>,
                scratch: &mut [Sample<$real, $dim>; SENSORS],
            ) -> Values<$real> {
                point_values(&scenario.view(), time, place, scratch)
            }
        }
    };
}

flight!(plane_f32, f32, 2);
flight!(plane_f64, f64, 2);
flight!(volume_f32, f32, 3);
flight!(volume_f64, f64, 3);

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    loop {}
}
