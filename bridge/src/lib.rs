//! quietpath-bridge: what stands around the planning core on a computer with an operating system.
//!
//! | module | what |
//! |---|---|
//! | [`capacity`] | the sizes that the host is compiled for |
//! | [`mod@file`] | scenario files, plan files, mission files |
//! | [`frame`] | scenario coordinates to latitude and longitude, and back |
//! | [`clock`] | time as an argument |
//! | [`command`] | commands, sent until they are answered |
//! | [`flight`] | a flight, from the first heartbeat to the last |
//! | [`link`] | MAVLink over serial lines, datagrams, streams, or a wire in memory |
//! | [`mission`] | missions on their way to an autopilot and back |
//! | [`payload`] | transmit power and jamming, relayed to payloads |
//! | [`record`] | the record of a flight, and its replay |
//! | [`replan`] | planning anew in flight: observations in, plans out |
//! | [`setpoint`] | a plan, steered live |
//! | [`telemetry`] | what the vehicle says about itself |
//! | [`planning`] | the door to the core: plan, assess a plan, draw a landscape |

pub mod capacity;
pub mod clock;
pub mod command;
pub mod file;
pub mod flight;
pub mod frame;
pub mod link;
pub mod mission;
pub mod payload;
pub mod planning;
pub mod record;
pub mod replan;
pub mod setpoint;
pub mod telemetry;
