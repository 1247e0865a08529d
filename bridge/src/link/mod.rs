//! The link: MAVLink frames over serial lines, datagrams, streams, or a wire in memory.
//!
//! | module | what |
//! |---|---|
//! | [`address`] | `serial:/dev/ttyACM0:921600`, `udpin:HOST:PORT` and their kin |
//! | [`codec`] | bytes to frames and back, by the `mavlink` crate |
//! | [`signing`] | MAVLink 2 signatures: key files, timestamps that survive a restart, replays |
//! | [`endpoint`] | one end of a link without any input or output: codec, signing, whom to answer, statistics |
//! | [`statistics`] | what was received, lost and refused |
//! | [`memory`] | a wire in memory with loss, duplicates, delay and reordering from a seed |
//! | [`thread`] | the end of a link on a real device, with its threads |
//!
//! Sockets and serial ports are opened in `socket.rs` and nowhere else. An [`Endpoint`] takes bytes with a time and
//! gives frames; who carries the bytes does not matter to it. So a test joins two endpoints by two wires, one for each
//! direction, and lets time pass as it likes:
//!
//! ```
//! use std::time::Duration;
//! use quietpath_bridge::clock::Time;
//! use quietpath_bridge::link::memory::{Faults, Wire};
//! use quietpath_bridge::link::{Accept, Endpoint, Identity, Source, codec};
//!
//! let mut companion = Endpoint::new(Identity::COMPANION, Accept::Anyone);
//! let mut vehicle = Endpoint::new(Identity { system: 1, component: 1 }, Accept::Anyone);
//! // A fifth is lost, what arrives takes 40 to 60 ms; the same seed always loses the same frames.
//! let faults = Faults { loss: 0.2, delay: Duration::from_millis(40), jitter: Duration::from_millis(20), ..Faults::NONE };
//! let mut up = Wire::new(faults, 7);
//!
//! let mut heard = 0;
//! for tick in 0..200 {
//!     let now = Time::from_millis(tick * 10);
//!     if tick < 100 {
//!         up.send(now, &companion.encode(now, &codec::companion_heartbeat()));
//!     }
//!     while let Some(bytes) = up.receive(now) {
//!         heard += vehicle.decode(now, Source::Line, &bytes).len();
//!     }
//! }
//! assert!((70..=90).contains(&heard));
//! // Losses show as gaps in the sequence numbers, once a first frame is there.
//! assert!((0.1..0.3).contains(&vehicle.statistics().loss()));
//! ```

pub mod address;
pub mod codec;
pub mod endpoint;
pub mod memory;
pub mod signing;
mod socket;
pub mod statistics;
pub mod thread;

pub use address::Address;
pub use codec::{Frame, Identity};
pub use endpoint::{Accept, Endpoint};
pub use signing::Signing;
pub use socket::{Source, listen};
pub use statistics::Statistics;
pub use thread::{Event, Link};

/// The messages: those of ArduPilot's dialect, which contains all common ones.
pub use mavlink::dialects::ardupilotmega as dialect;
