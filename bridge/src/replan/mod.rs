//! Planning anew in flight.
//!
//! | module | what |
//! |---|---|
//! | [`observation`] | where sensors were seen, as others write it |
//! | [`job`] | the problem of the rest of the flight, and when its answer may fly |
//! | [`seal`] | observations from other hosts, authenticated |
//! | [`worker`] | the thread that plans |
//!
//! The flying plan is only ever replaced by one that passes [`job::judge`]: feasible, finite, and in time for the seam at
//! which it takes over. Whatever goes wrong in planning, the plan that flies goes on until it has no time left to live.

pub mod job;
pub mod observation;
pub mod seal;
pub mod worker;

pub use job::{Answer, Job, Rejected, judge};
pub use observation::Observation;
pub use worker::Worker;
