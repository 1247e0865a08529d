//! The planning core for C and C++: one agent in the plane, in single precision, in memory that the caller owns.
//!
//! A caller asks how much memory a planner needs, gives it, and gets a planner in it. From then on every call takes the
//! planner; nothing is allocated, and nothing needs to be freed. `include/quietpath.h` is made from this file.
//!
//! | C | here |
//! |---|---|
//! | `quietpath_create` | a planner in the caller's memory |
//! | `quietpath_set_agent`, `quietpath_set_sensors` | what is to be planned |
//! | `quietpath_plan`, `quietpath_replan` | from nothing, and from where the agent was found |
//! | `quietpath_read` | the plan in force |
//!
//! Limits: [`QUIETPATH_INTERVALS_MAX`], [`QUIETPATH_SENSORS_MAX`], one agent, no regions; not for several threads at once.
#![no_std]

// On a host the panic handler is that of the standard library.
#[cfg(not(target_os = "none"))]
extern crate std;

mod planner;

use core::mem::{align_of, size_of};
use core::slice;

use planner::Planner;

/// A planner, with all of its memory; its insides are its own.
pub struct QuietpathPlanner(Planner);

/// Most intervals of a plan; nodes are one more.
pub const QUIETPATH_INTERVALS_MAX: usize = 32;
/// Most sensors.
pub const QUIETPATH_SENSORS_MAX: usize = 8;

/// What a call came to.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum QuietpathResult {
    /// There is a feasible plan.
    Ok = 0,
    /// There is a plan, but it breaks a bound: the way is closed in the time there is.
    Infeasible = 1,
    /// A pointer is null, or memory too small or not aligned.
    Memory = 2,
    /// Numbers or counts that describe no problem.
    Invalid = 3,
    /// Something has to be called before: agent and sensors are set, then planned, then read.
    Order = 4,
}

/// What is to be small or large along the path.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum QuietpathObjective {
    /// Detected least.
    Detection = 0,
    /// Located worst: the area of the error ellipse, its logarithm. Needs three ranging sensors.
    Location = 1,
}

/// The flight: who flies, from where to where, in what time and what box.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct QuietpathAgent {
    /// East and north at the start, length units.
    pub start: [f32; 2],
    /// East and north at arrival, length units.
    pub goal: [f32; 2],
    /// Largest speed, length units per s.
    pub speed_max: f32,
    /// Largest acceleration, length units per s^2.
    pub accel_max: f32,
    /// Time at the start, s.
    pub start_time: f32,
    /// Wanted time of arrival, s: later ones are penalised.
    pub time_target: f32,
    /// Latest time of arrival, s.
    pub time_max: f32,
    /// Weight of lateness, objective unit per s^2.
    pub time_penalty: f32,
    /// Smallest coordinates of the box that the flight stays in, length units.
    pub domain_min: [f32; 2],
    /// Largest coordinates of that box, length units.
    pub domain_max: [f32; 2],
    /// Softening of every distance, length units, greater than 0.
    pub softening: f32,
    /// Intervals of the plan, 2 to `QUIETPATH_INTERVALS_MAX`.
    pub intervals: u32,
    /// What is wanted: a `QuietpathObjective`.
    pub objective: u32,
}

/// A sensor, as it was seen; it keeps its velocity.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct QuietpathSensor {
    /// East and north, length units.
    pub position: [f32; 2],
    /// Length units per s.
    pub velocity: [f32; 2],
    /// When it was seen, s.
    pub time: f32,
    /// Detection: `min(1, scale / (epsilon + d^path_loss))`; a scale of 0 for a sensor that does not detect.
    pub detect_scale: f32,
    /// See `detect_scale`.
    pub detect_epsilon: f32,
    /// Variance of its distance estimator: `c1 d^path_loss (1 + c2 d^path_loss)`; a c1 of 0 for a sensor that does not range.
    pub range_c1: f32,
    /// See `range_c1`.
    pub range_c2: f32,
    /// Path-loss exponent of both.
    pub path_loss: f32,
}

/// A node of a plan.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct QuietpathNode {
    /// s.
    pub time: f32,
    /// East and north, length units.
    pub position: [f32; 2],
}

/// Bytes that a planner needs.
#[unsafe(no_mangle)]
pub extern "C" fn quietpath_size() -> usize {
    size_of::<QuietpathPlanner>()
}

/// Alignment that a planner needs, bytes.
#[unsafe(no_mangle)]
pub extern "C" fn quietpath_alignment() -> usize {
    align_of::<QuietpathPlanner>()
}

/// Makes a planner in `memory`, which has `bytes` bytes and stays the planner's; null where it is too small or not aligned.
///
/// # Safety
/// `memory` is null, or `bytes` bytes from there on are the caller's to give.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn quietpath_create(memory: *mut core::ffi::c_void, bytes: usize) -> *mut QuietpathPlanner {
    let place = memory.cast::<QuietpathPlanner>();
    if place.is_null() || bytes < quietpath_size() || !place.is_aligned() {
        return core::ptr::null_mut();
    }
    // SAFETY: it is aligned, large enough and the caller's.
    unsafe { place.write(const { QuietpathPlanner(Planner::new()) }) };
    place
}

/// Says who flies where. What was planned before is forgotten.
///
/// # Safety
/// `planner` is null or from `quietpath_create`; `agent` is null or points to an agent.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn quietpath_set_agent(
    planner: *mut QuietpathPlanner,
    agent: *const QuietpathAgent,
) -> QuietpathResult {
    // SAFETY: by the caller.
    let (planner, agent) = unsafe { (planner.as_mut(), agent.as_ref()) };
    let (Some(planner), Some(agent)) = (planner, agent) else { return QuietpathResult::Memory };
    planner.0.set_agent(agent)
}

/// Says what sensors there are, or how they were seen last. A plan stays in force until the next one.
///
/// # Safety
/// `planner` is null or from `quietpath_create`; `sensors` is null or points to `count` sensors.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn quietpath_set_sensors(
    planner: *mut QuietpathPlanner,
    sensors: *const QuietpathSensor,
    count: usize,
) -> QuietpathResult {
    // SAFETY: by the caller.
    let Some(planner) = (unsafe { planner.as_mut() }) else { return QuietpathResult::Memory };
    if sensors.is_null() && count > 0 {
        return QuietpathResult::Memory;
    }
    if count > QUIETPATH_SENSORS_MAX {
        return QuietpathResult::Invalid;
    }
    // SAFETY: by the caller; no sensor is read where there is none.
    let sensors = if count == 0 { &[] } else { unsafe { slice::from_raw_parts(sensors, count) } };
    planner.0.set_sensors(sensors)
}

/// Plans the whole flight, from nothing.
///
/// # Safety
/// `planner` is null or from `quietpath_create`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn quietpath_plan(planner: *mut QuietpathPlanner) -> QuietpathResult {
    // SAFETY: by the caller.
    let Some(planner) = (unsafe { planner.as_mut() }) else { return QuietpathResult::Memory };
    planner.0.plan()
}

/// Plans the rest of the flight from where the agent was found at `time` (s): position in length units, velocity in length
/// units per s, east and north. The plan before is where it starts from, and stays in force where nothing better is found.
///
/// # Safety
/// `planner` is null or from `quietpath_create`; `position` and `velocity` are null or point to two numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn quietpath_replan(
    planner: *mut QuietpathPlanner,
    time: f32,
    position: *const f32,
    velocity: *const f32,
) -> QuietpathResult {
    // SAFETY: by the caller.
    let Some(planner) = (unsafe { planner.as_mut() }) else { return QuietpathResult::Memory };
    // SAFETY: by the caller; an array of two numbers is aligned as a number.
    let (position, velocity) =
        unsafe { (position.cast::<[f32; 2]>().as_ref(), velocity.cast::<[f32; 2]>().as_ref()) };
    let (Some(position), Some(velocity)) = (position, velocity) else { return QuietpathResult::Memory };
    planner.0.replan(time, *position, *velocity)
}

/// Copies the plan in force to `nodes`, which has room for `capacity`; returns how many there are, also where there is no
/// room for all.
///
/// # Safety
/// `planner` is null or from `quietpath_create`; `nodes` is null or has room for `capacity` nodes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn quietpath_read(
    planner: *const QuietpathPlanner,
    nodes: *mut QuietpathNode,
    capacity: usize,
) -> usize {
    // SAFETY: by the caller.
    let Some(planner) = (unsafe { planner.as_ref() }) else { return 0 };
    let mut count = 0;
    for node in planner.0.nodes() {
        if count < capacity && !nodes.is_null() {
            // SAFETY: by the caller, there is room for as many.
            unsafe { nodes.add(count).write(node) };
        }
        count += 1;
    }
    count
}

/// Objective of the rest of the plan in force; NaN where there is none.
///
/// # Safety
/// `planner` is null or from `quietpath_create`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn quietpath_objective(planner: *const QuietpathPlanner) -> f32 {
    // SAFETY: by the caller.
    unsafe { planner.as_ref() }.map_or(f32::NAN, |planner| planner.0.objective())
}

#[cfg(target_os = "none")]
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    // The core has no reachable panic: see the image `no_panic` of the firmware.
    loop {
        core::hint::spin_loop();
    }
}
