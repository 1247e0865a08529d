//! quietpath-bridge: what stands around the planning core on a computer with an operating system.
//!
//! | module | what |
//! |---|---|
//! | [`capacity`] | the sizes that the host is compiled for |
//! | [`mod@file`] | scenario files, plan files, mission files |
//! | [`frame`] | scenario coordinates to latitude and longitude, and back |
//! | [`clock`] | time as an argument |
//! | [`command`] | commands, sent until they are answered |
//! | [`link`] | MAVLink over serial lines, datagrams, streams, or a wire in memory |
//! | [`mission`] | missions on their way to an autopilot and back |
//! | [`telemetry`] | what the vehicle says about itself |
//! | [`planning`] | the door to the core: plan, assess a plan, draw a landscape |

pub mod capacity;
pub mod clock;
pub mod command;
pub mod file;
pub mod frame;
pub mod link;
pub mod mission;
pub mod planning;
pub mod telemetry;
