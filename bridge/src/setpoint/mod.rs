//! Setpoints: a plan, steered live.
//!
//! A [`Curve`] says where the vehicle is meant to be at any time of the plan, with velocity and acceleration; [`target`]
//! puts a [`Sample`] of it on the wire as SET_POSITION_TARGET_GLOBAL_INT, which PX4 takes in offboard mode and ArduCopter
//! in guided mode.
//!
//! | rule | why |
//! |---|---|
//! | all three of position, velocity and acceleration, or position alone | position with acceleration stops ArduCopter; a single ignored axis drops the vector |
//! | heading never | the plan has none |
//! | a number that is not finite: nothing is sent | one in an active field can end the autopilot's process |
//!
//! North is taken to be the same direction everywhere in the scenario: 50 km east of the origin, at 50 degrees of
//! latitude, the velocity is off by half a degree.

mod curve;

pub use curve::{Curve, Sample};

use crate::clock::Time;
use crate::frame::{Altitude, LocalFrame};
use crate::link::Identity;
use crate::link::dialect::{MavFrame, MavMessage, PositionTargetTypemask, SET_POSITION_TARGET_GLOBAL_INT_DATA};
use crate::mission::item::wire_degrees;

/// Heading and its rate are ignored.
const HEADING: u16 = 1024 | 2048;
/// Velocity and acceleration are ignored too.
const POSITION_ONLY: u16 = HEADING | 8 | 16 | 32 | 64 | 128 | 256;

/// What of a sample is steered by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Steering {
    /// Position, velocity and acceleration: to fly along the plan.
    Along,
    /// Position alone: to go somewhere and stay there.
    To,
}

/// A setpoint; `None` where any of its numbers is not finite.
#[must_use]
pub fn target(
    now: Time,
    vehicle: Identity,
    frame: &LocalFrame,
    sample: &Sample,
    steering: Steering,
) -> Option<MavMessage> {
    let all = [&sample.position, &sample.velocity, &sample.acceleration];
    if !all.into_iter().flatten().all(|number| number.is_finite()) {
        return None;
    }
    let place = frame.place(&sample.position);
    let meters =
        |vector: &[f64], axis: usize| (vector.get(axis).copied().unwrap_or_default() * frame.unit_m()) as f32;
    #[expect(deprecated, reason = "autopilots know these names")]
    let (coordinate_frame, altitude) = match place.altitude {
        Altitude::AboveHome(meters) => (MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT_INT, meters),
        Altitude::AboveSeaLevel(meters) => (MavFrame::MAV_FRAME_GLOBAL_INT, meters),
    };
    let mask = match steering {
        Steering::Along => HEADING,
        Steering::To => POSITION_ONLY,
    };
    let (velocity, acceleration) = (&sample.velocity, &sample.acceleration);
    let data = SET_POSITION_TARGET_GLOBAL_INT_DATA {
        time_boot_ms: (now.micros() / 1000) as u32,
        lat_int: wire_degrees(place.latitude_deg),
        lon_int: wire_degrees(place.longitude_deg),
        alt: altitude as f32,
        // North, east, down; the scenario counts east, north, up.
        vx: meters(velocity, 1),
        vy: meters(velocity, 0),
        vz: -meters(velocity, 2),
        afx: meters(acceleration, 1),
        afy: meters(acceleration, 0),
        afz: -meters(acceleration, 2),
        yaw: 0.0,
        yaw_rate: 0.0,
        type_mask: PositionTargetTypemask::from_bits_retain(mask),
        target_system: vehicle.system,
        target_component: vehicle.component,
        coordinate_frame,
    };
    let numbers = [data.alt, data.vx, data.vy, data.vz, data.afx, data.afy, data.afz];
    // A large number may still be none in single precision.
    numbers.iter().all(|number| number.is_finite()).then_some(MavMessage::SET_POSITION_TARGET_GLOBAL_INT(data))
}
