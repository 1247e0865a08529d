//! The sizes that the host is compiled for, in one place.
//!
//! The planning core has no heap: every list has a capacity that is part of its type. Firmware chooses its own;
//! everything on the host uses these. A scenario that exceeds one is refused by name and number.

use quietpath_core::horizon::Horizon;
use quietpath_core::{Scenario, Trajectory};

/// Nodes of the time grid.
pub const NODES: usize = 513;
/// Intervals of the time grid.
pub const INTERVALS: usize = NODES - 1;
/// Sensors.
pub const SENSORS: usize = 128;
/// Agents.
pub const AGENTS: usize = 8;
/// Entries of the tracks of all sensors together.
pub const KNOTS: usize = 4096;

/// A scenario of the core, host size.
pub type HostScenario<T, const DIM: usize> = Scenario<T, DIM, SENSORS, AGENTS, KNOTS>;
/// A trajectory of the core, host size.
pub type HostTrajectory<T, const DIM: usize> = Trajectory<T, DIM, NODES, AGENTS>;
/// A flight in steps of the core, host size.
pub type HostHorizon<T, const DIM: usize> = Horizon<T, DIM, NODES, AGENTS>;
