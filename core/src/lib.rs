//! quietpath-core: plans how UAVs fly between known radio sensors so that they are detected least, or located
//! worst.
//!
//! No standard library, no heap, no unsafe code: every size is a const generic, every loop has a named bound, and
//! time is an argument. The same source plans in `f32` on a Cortex-M and in `f64` on a workstation.
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

pub mod constraints;
pub mod error;
pub mod horizon;
pub mod jet;
pub mod math;
pub mod metrics;
pub mod model;
pub mod objective;
pub mod scenario;
pub mod solver;
pub mod special;
pub mod trajectory;
pub mod warm_start;

pub use error::Error;
pub use math::{Point, Real};
pub use scenario::{Draft, Metric, Scenario, View};
pub use trajectory::Trajectory;
