//! The door between files and the core: precision and dimension become type parameters here, and nowhere else.
//!
//! | function | what |
//! |---|---|
//! | [`plan`] | a plan of a scenario |
//! | [`roll()`] | a plan in steps, with every step |
//! | [`improve`] | the same, from an earlier plan |
//! | [`renew`] | the same for the rest of a flight, from what is left of the plan that flies |
//! | [`assess()`] | objective, violations and series of a plan, in double precision, from its written numbers alone |
//! | [`landscape()`], [`landscapes`], [`detection_at`] | a metric over the domain at one time, all of them, one at one place |
//!
//! The core keeps everything in fixed-size structures of the host's capacities, hundreds of kilobytes each. They
//! live on the heap, but pass through the stack while they are built, several times over without optimisation. All
//! work therefore runs in a thread of its own whose stack has [`STACK_BYTES`].

mod assess;
mod landscape;
mod obstacle;
mod roll;
mod solve;

pub use assess::{AgentSeries, Assessment, assess};
pub use landscape::{Grid, View, detection_at, landscape, landscapes};
pub use obstacle::Obstacle;
pub use roll::{Rolled, Step, roll, roll_through};
pub use solve::{HostWorkspace, Memory, Options, Planned, Precision, Rollout, improve, plan, renew};

pub use quietpath_core::horizon::Choice;
pub use quietpath_core::solver::{Extent, Status};

use quietpath_core::metrics::Sample;

use crate::capacity;

/// Stack of a planning thread, bytes: more than ten times the largest structures, host size in three dimensions and
/// double precision, for the copies that unoptimised builds make. Pages that are not touched cost nothing.
pub const STACK_BYTES: usize = 256 << 20;

/// What planning uses of its stack at the most in optimised builds, and some more, bytes.
const USED_BYTES: usize = 128 << 10;

/// Has the system give the part of the stack that planning uses, which it does page by page as it is first touched: a plan's time
/// is that of planning, as with the memory of the planner.
#[inline(never)]
fn touch_stack() {
    std::hint::black_box(&mut [0_u8; USED_BYTES]);
}

/// Runs `work` on a stack of [`STACK_BYTES`].
fn on_large_stack<V: Send>(work: impl FnOnce() -> V + Send) -> V {
    std::thread::scope(|scope| {
        let work = || {
            touch_stack();
            work()
        };
        let thread = std::thread::Builder::new().stack_size(STACK_BYTES).spawn_scoped(scope, work);
        let done = thread.map(std::thread::ScopedJoinHandle::join);
        match done {
            Ok(Ok(value)) => value,
            Ok(Err(panic)) => std::panic::resume_unwind(panic),
            Err(error) => panic!("the operating system gives no thread with {STACK_BYTES} bytes of stack: {error}"),
        }
    })
}

/// Scratch for all sensors.
fn scratch<const DIM: usize>() -> Vec<Sample<f64, DIM>> {
    vec![Sample::default(); capacity::SENSORS]
}
