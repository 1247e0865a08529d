//! Setpoints: what each kind of autopilot makes of SET_POSITION_TARGET_GLOBAL_INT.
//!
//! | | PX4 offboard | ArduCopter guided |
//! |---|---|---|
//! | the mode is granted | to a stream of setpoints of more than 2 Hz | always |
//! | the stream ends | after `COM_OF_LOSS_T`, 1 s, the vehicle holds | velocities end after `GUID_TIMEOUT`, 3 s; a position stays |
//! | a vector with one ignored axis | is dropped | is dropped |
//! | position with acceleration, without velocity | follows the position | stops |
//! | a number in a field in use that is not finite | the process is gone | the process is gone |
//!
//! Limits: PX4 really mixes axes; acceleration alone is not followed.

use std::time::Duration;

use quietpath_bridge::clock::Time;
use quietpath_bridge::frame::{Altitude, LocalFrame, Place};
use quietpath_bridge::link::dialect::*;
use quietpath_bridge::telemetry::Autopilot;

use super::body::{Aim, Vector};

/// Longest pause in a stream that PX4 takes for one.
const STREAM_PAUSE: Duration = Duration::from_millis(500);
/// Setpoints before PX4 believes in a stream.
const STREAM_MIN: u32 = 3;

/// What a setpoint says.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Target {
    Position(Vector),
    Along { position: Vector, velocity: Vector, acceleration: Vector },
    Velocity(Vector),
    Stop,
}

/// What a message did.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Taken {
    /// It is a setpoint.
    Yes,
    /// It is none that this autopilot follows.
    Ignored,
    /// It ends the autopilot's process, and why.
    Kills(String),
}

/// The setpoints of one autopilot.
#[derive(Clone, Debug, Default)]
pub(super) struct Guided {
    target: Option<Target>,
    heard: Option<Time>,
    streak: u32,
    count: u64,
}

impl Guided {
    /// Setpoints taken so far.
    pub(super) const fn count(&self) -> u64 {
        self.count
    }

    /// When the last setpoint came.
    pub(super) const fn heard(&self) -> Option<Time> {
        self.heard
    }

    /// Forgets what was wanted; counts go on.
    pub(super) const fn forget(&mut self) {
        (self.target, self.streak) = (None, 0);
    }

    /// Waits for the stream anew: the autopilot was away.
    pub(super) fn wait(&mut self, now: Time) {
        self.heard = self.heard.map(|_| now);
    }

    /// Takes a setpoint. `frame` is that of home, in metres.
    pub(super) fn take(
        &mut self,
        now: Time,
        kind: Autopilot,
        frame: &LocalFrame,
        home_altitude: f64,
        data: &SET_POSITION_TARGET_GLOBAL_INT_DATA,
    ) -> Taken {
        let mask = data.type_mask.bits();
        let has = |bits: u16| mask & bits == 0;
        let (position, velocity, acceleration) = (has(7), has(7 << 3), has(7 << 6));
        let used = |used: bool, numbers: &[f32]| used && !numbers.iter().all(|number| number.is_finite());
        if used(position, &[data.alt])
            || used(velocity, &[data.vx, data.vy, data.vz])
            || used(acceleration, &[data.afx, data.afy, data.afz])
        {
            return Taken::Kills(format!("a setpoint that is not finite, mask {mask}"));
        }
        let velocity_of = [f64::from(data.vy), f64::from(data.vx), -f64::from(data.vz)];
        let acceleration_of = [f64::from(data.afy), f64::from(data.afx), -f64::from(data.afz)];
        let Some(place) = place(frame, home_altitude, data) else { return Taken::Ignored };
        let target = match (position, velocity, acceleration) {
            (true, true, _) => Target::Along {
                position: place,
                velocity: velocity_of,
                acceleration: if acceleration { acceleration_of } else { [0.0; 3] },
            },
            (true, false, true) if kind == Autopilot::ArduPilot => Target::Stop,
            (true, false, _) => Target::Position(place),
            (false, true, _) => Target::Velocity(velocity_of),
            (false, false, _) => return Taken::Ignored,
        };
        let is_stream = self.heard.is_some_and(|heard| now.since(heard) < STREAM_PAUSE);
        self.streak = if is_stream { self.streak.saturating_add(1) } else { 1 };
        (self.target, self.heard, self.count) = (Some(target), Some(now), self.count + 1);
        Taken::Yes
    }

    /// Whether the mode that follows setpoints is granted.
    pub(super) fn is_granted(&self, now: Time, kind: Autopilot) -> bool {
        let is_fresh = self.heard.is_some_and(|heard| now.since(heard) < STREAM_PAUSE);
        kind == Autopilot::ArduPilot || (is_fresh && self.streak >= STREAM_MIN)
    }

    /// Whether PX4's stream has ended.
    pub(super) fn has_ended(&self, now: Time, timeout: Duration) -> bool {
        self.heard.is_none_or(|heard| now.since(heard) > timeout)
    }

    /// What to steer by; `None` where there is no target. `timeout` is ArduCopter's.
    pub(super) fn aim(&self, now: Time, kind: Autopilot, timeout: Duration) -> Option<Aim> {
        let is_old = kind == Autopilot::ArduPilot && self.has_ended(now, timeout);
        Some(match self.target? {
            Target::Position(position) => Aim::Rest(position),
            _ if is_old => Aim::Velocity([0.0; 3]),
            Target::Along { position, velocity, acceleration } => {
                // Between two setpoints the autopilot goes on as the last one said.
                let ahead = self.heard.map_or(0.0, |heard| now.since(heard).as_secs_f64()).min(0.5);
                let at = |axis: usize| position[axis] + ahead * (velocity[axis] + 0.5 * ahead * acceleration[axis]);
                let speed = |axis: usize| velocity[axis] + ahead * acceleration[axis];
                let (position, velocity) = ([at(0), at(1), at(2)], [speed(0), speed(1), speed(2)]);
                Aim::Along { position, velocity, acceleration }
            }
            Target::Velocity(velocity) => Aim::Velocity(velocity),
            Target::Stop => Aim::Velocity([0.0; 3]),
        })
    }
}

/// The position of a setpoint, m from home; `None` in a frame that is not known.
#[expect(deprecated, reason = "companions still say so")]
fn place(frame: &LocalFrame, home_altitude: f64, data: &SET_POSITION_TARGET_GLOBAL_INT_DATA) -> Option<Vector> {
    let above = match data.coordinate_frame {
        MavFrame::MAV_FRAME_GLOBAL | MavFrame::MAV_FRAME_GLOBAL_INT => 0.0,
        MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT | MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT_INT => home_altitude,
        _ => return None,
    };
    local(frame, data.lat_int, data.lon_int, f64::from(data.alt) + above)
}

/// A place on the wire, m from home.
pub(super) fn local(frame: &LocalFrame, latitude: i32, longitude: i32, above_sea_m: f64) -> Option<Vector> {
    let place = Place {
        latitude_deg: f64::from(latitude) * 1e-7,
        longitude_deg: f64::from(longitude) * 1e-7,
        altitude: Altitude::AboveSeaLevel(above_sea_m),
    };
    frame.position(&place)?.try_into().ok()
}
