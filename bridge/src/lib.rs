//! quietpath-bridge: what stands around the planning core on a computer with an operating system.
//!
//! | module | what |
//! |---|---|
//! | [`capacity`] | the sizes that the host is compiled for |
//! | [`mod@file`] | scenario files, plan files, mission files |
//! | [`frame`] | scenario coordinates to latitude and longitude, and back |
//! | [`clock`] | time as an argument |
//! | [`link`] | MAVLink over serial lines, datagrams, streams, or a wire in memory |
//! | [`planning`] | the door to the core: plan, assess a plan, draw a landscape |

pub mod capacity;
pub mod clock;
pub mod file;
pub mod frame;
pub mod link;
pub mod planning;
