//! What the vehicle says about itself.
//!
//! [`Telemetry`] finds the autopilot by its heartbeat and keeps to it: one system, one component. Everything else on the
//! link is somebody else. ArduPilot's first heartbeat may come from component 0; it is addressed as component 1.
//!
//! No autopilot sends all of this by itself: [`INTERVALS`] lists what has to be asked for.
//!
//! | name | unit |
//! |---|---|
//! | positions | degrees, m, as [`crate::frame`] says |
//! | velocities | m/s: north, east, down |

mod mode;
pub mod param;
pub mod timesync;

pub use mode::{Airframe, Autopilot, Mode, mode_command};

use std::time::Duration;

use crate::clock::Time;
use crate::frame::{Altitude, Place};
use crate::link::dialect::{HEARTBEAT_DATA, MavAutopilot, MavLandedState, MavMessage, MavModeFlag, MavType};
use crate::link::{Frame, Identity};

/// Messages to ask for, and how often, Hz: GLOBAL_POSITION_INT, MISSION_CURRENT, EXTENDED_SYS_STATE. Payloads are switched
/// where the mission is, so where it is must be known to a tenth of a second.
pub const INTERVALS: [(u32, f32); 3] = [(33, 10.0), (42, 20.0), (245, 2.0)];

/// Silence after which the link to the autopilot counts as lost.
pub const LINK_TIMEOUT: Duration = Duration::from_secs(3);

/// Time without a heartbeat after which it counts as lost too: mode and arming are known by heartbeats alone. A link that
/// loses every tenth frame loses three of them in a row every quarter of an hour.
pub const HEARTBEAT_TIMEOUT: Duration = Duration::from_secs(6);

/// Where the vehicle is, and how it moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fix {
    /// When it was heard.
    pub heard: Time,
    /// Place, altitude above sea level.
    pub place: Place,
    /// Altitude above home, m.
    pub above_home_m: f64,
    /// Velocity north, east and down, m/s.
    pub velocity: [f64; 3],
}

/// Whether it flies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Flying {
    /// It does not say.
    #[default]
    Unknown,
    /// On the ground.
    Ground,
    /// In the air, or taking off.
    Air,
    /// Landing.
    Landing,
}

/// The autopilot, as it presents itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vehicle {
    /// Whom to address.
    pub identity: Identity,
    /// Its kind.
    pub autopilot: Autopilot,
    /// What it flies.
    pub airframe: Airframe,
    /// Whether its motors may turn.
    pub armed: bool,
    /// Its mode.
    pub mode: Mode,
    /// When it was heard last, whatever it said.
    pub heard: Time,
    /// When its last heartbeat came.
    pub heartbeat: Time,
    /// Whether it flies.
    pub flying: Flying,
    /// Where it is.
    pub fix: Option<Fix>,
    /// Mission item that it flies to.
    pub current: Option<u16>,
}

/// Which autopilot to take.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Choice {
    /// By its heartbeat.
    #[default]
    Auto,
    /// Only this kind, and one that does not say its kind: another one is not taken.
    Only(Autopilot),
}

/// Follows an autopilot. See the [module](self).
#[derive(Clone, Debug)]
pub struct Telemetry {
    choice: Choice,
    system: Option<u8>,
    vehicle: Option<Vehicle>,
}

impl Telemetry {
    /// Nobody heard yet; `system` restricts whom to take.
    #[must_use]
    pub const fn new(choice: Choice, system: Option<u8>) -> Self {
        Self { choice, system, vehicle: None }
    }

    /// The vehicle; `None` before its first heartbeat.
    #[must_use]
    pub const fn vehicle(&self) -> Option<&Vehicle> {
        self.vehicle.as_ref()
    }

    /// Whether the vehicle has been heard, and has fallen silent.
    #[must_use]
    pub fn is_lost(&self, now: Time) -> bool {
        self.vehicle.is_some_and(|vehicle| {
            now.since(vehicle.heard) > LINK_TIMEOUT || now.since(vehicle.heartbeat) > HEARTBEAT_TIMEOUT
        })
    }

    /// Takes a message of the link. True where it comes from the vehicle.
    pub fn handle(&mut self, now: Time, frame: &Frame) -> bool {
        if let MavMessage::HEARTBEAT(data) = &frame.message {
            return self.heartbeat(now, frame.from, data);
        }
        let Some(vehicle) = self.vehicle.as_mut().filter(|vehicle| vehicle.identity == frame.from) else {
            return false;
        };
        vehicle.heard = now;
        match &frame.message {
            MavMessage::GLOBAL_POSITION_INT(data) => {
                let place = Place {
                    latitude_deg: f64::from(data.lat) * 1e-7,
                    longitude_deg: f64::from(data.lon) * 1e-7,
                    altitude: Altitude::AboveSeaLevel(f64::from(data.alt) * 1e-3),
                };
                let velocity = [data.vx, data.vy, data.vz].map(|part| f64::from(part) * 1e-2);
                let above_home_m = f64::from(data.relative_alt) * 1e-3;
                if is_on_earth(&place) {
                    vehicle.fix = Some(Fix { heard: now, place, above_home_m, velocity });
                }
            }
            MavMessage::EXTENDED_SYS_STATE(data) => {
                vehicle.flying = match data.landed_state {
                    MavLandedState::MAV_LANDED_STATE_UNDEFINED => Flying::Unknown,
                    MavLandedState::MAV_LANDED_STATE_ON_GROUND => Flying::Ground,
                    MavLandedState::MAV_LANDED_STATE_IN_AIR | MavLandedState::MAV_LANDED_STATE_TAKEOFF => Flying::Air,
                    MavLandedState::MAV_LANDED_STATE_LANDING => Flying::Landing,
                };
            }
            MavMessage::MISSION_CURRENT(data) => vehicle.current = Some(data.seq),
            _ => {}
        }
        true
    }

    fn heartbeat(&mut self, now: Time, from: Identity, data: &HEARTBEAT_DATA) -> bool {
        let autopilot = match (data.autopilot, self.choice) {
            (MavAutopilot::MAV_AUTOPILOT_PX4, _) => Autopilot::Px4,
            (MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA, _) => Autopilot::ArduPilot,
            // One that does not say is what it is chosen to be.
            (MavAutopilot::MAV_AUTOPILOT_GENERIC, Choice::Only(autopilot)) => autopilot,
            _ => return false,
        };
        let is_vehicle = !matches!(data.mavtype, MavType::MAV_TYPE_GCS | MavType::MAV_TYPE_ONBOARD_CONTROLLER);
        let is_chosen = self.choice == Choice::Auto || self.choice == Choice::Only(autopilot);
        // Component 0 is ArduPilot's before it has read its own parameters; 1 is an autopilot.
        let identity = Identity { system: from.system, component: from.component.max(1) };
        let is_wanted = self.system.is_none_or(|system| system == from.system) && identity.component == 1;
        let is_known = self.vehicle.is_none_or(|vehicle| vehicle.identity == identity);
        if !(is_vehicle && is_chosen && is_wanted && is_known) {
            return false;
        }
        let airframe = Airframe::of(data.mavtype);
        let before = self.vehicle;
        self.vehicle = Some(Vehicle {
            identity,
            autopilot,
            airframe,
            armed: data.base_mode.contains(MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED),
            mode: Mode::of(autopilot, airframe, data.custom_mode),
            heard: now,
            heartbeat: now,
            flying: before.map(|vehicle| vehicle.flying).unwrap_or_default(),
            fix: before.and_then(|vehicle| vehicle.fix),
            current: before.and_then(|vehicle| vehicle.current),
        });
        true
    }
}

/// Whether a place is one: autopilots that do not know where they are say zero, or the largest number.
fn is_on_earth(place: &Place) -> bool {
    let is_unknown = place.latitude_deg == 0.0 && place.longitude_deg == 0.0;
    place.latitude_deg.abs() <= 90.0 && place.longitude_deg.abs() <= 180.0 && !is_unknown
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::link::codec::companion_heartbeat;
    use crate::link::dialect::GLOBAL_POSITION_INT_DATA;

    fn heartbeat(mavtype: MavType, autopilot: MavAutopilot, custom_mode: u32) -> MavMessage {
        let MavMessage::HEARTBEAT(data) = companion_heartbeat() else { panic!("a heartbeat") };
        MavMessage::HEARTBEAT(HEARTBEAT_DATA { mavtype, autopilot, custom_mode, ..data })
    }

    fn frame(system: u8, component: u8, message: MavMessage) -> Frame {
        Frame { from: Identity { system, component }, sequence: 0, message, bytes: Vec::new() }
    }

    #[test]
    fn the_first_autopilot_is_kept_and_others_are_ignored() {
        let quad = |mode| heartbeat(MavType::MAV_TYPE_QUADROTOR, MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA, mode);
        let mut telemetry = Telemetry::new(Choice::Auto, None);
        let now = Time::from_millis;
        assert!(!telemetry.handle(now(0), &frame(255, 190, companion_heartbeat())), "a ground station");
        let gimbal = heartbeat(MavType::MAV_TYPE_GIMBAL, MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA, 0);
        assert!(!telemetry.handle(now(0), &frame(3, 154, gimbal)));
        assert!(telemetry.handle(now(10), &frame(3, 0, quad(4))), "ArduPilot's first heartbeat");
        assert!(!telemetry.handle(now(20), &frame(4, 1, quad(3))), "another vehicle");
        let vehicle = telemetry.vehicle().expect("heard");
        assert_eq!((vehicle.identity, vehicle.mode), (Identity { system: 3, component: 1 }, Mode::Guided));
        assert!(!vehicle.armed);
        assert!(!telemetry.is_lost(now(3010)) && telemetry.is_lost(now(3011)));
        let ours = MavMessage::GLOBAL_POSITION_INT(Default::default());
        let mut heard = telemetry.clone();
        heard.handle(now(2000), &frame(3, 1, ours.clone()));
        assert!(!heard.is_lost(now(5000)) && heard.is_lost(now(5001)));
        heard.handle(now(5000), &frame(3, 1, ours));
        assert!(!heard.is_lost(now(6010)) && heard.is_lost(now(6011)), "no heartbeat");
        assert!(!telemetry.handle(now(30), &frame(4, 1, MavMessage::GLOBAL_POSITION_INT(Default::default()))));
        assert_eq!(telemetry.vehicle().expect("heard").fix, None);
    }

    #[test]
    fn what_is_no_place_is_not_believed() {
        let mut telemetry = Telemetry::new(Choice::Auto, None);
        let px4 = heartbeat(MavType::MAV_TYPE_QUADROTOR, MavAutopilot::MAV_AUTOPILOT_PX4, 0);
        telemetry.handle(Time::ZERO, &frame(1, 1, px4));
        let mut say = |lat, lon| {
            let data = GLOBAL_POSITION_INT_DATA { lat, lon, ..Default::default() };
            telemetry.handle(Time::ZERO, &frame(1, 1, MavMessage::GLOBAL_POSITION_INT(data)));
            telemetry.vehicle().and_then(|vehicle| vehicle.fix).map(|fix| fix.place.latitude_deg)
        };
        assert_eq!(say(0, 0), None);
        assert_eq!(say(i32::MAX, i32::MAX), None);
        assert_eq!(say(470_000_000, i32::MIN), None);
        assert_eq!(say(470_000_000, 85_000_000), Some(47.0));
        assert_eq!(say(0, 0), Some(47.0), "the last place that was one stays");
    }

    #[test]
    fn a_choice_keeps_the_other_kind_out() {
        let px4 = heartbeat(MavType::MAV_TYPE_QUADROTOR, MavAutopilot::MAV_AUTOPILOT_PX4, 0);
        let mut telemetry = Telemetry::new(Choice::Only(Autopilot::ArduPilot), None);
        assert!(!telemetry.handle(Time::ZERO, &frame(1, 1, px4.clone())));
        assert!(!Telemetry::new(Choice::Auto, Some(2)).handle(Time::ZERO, &frame(1, 1, px4.clone())));
        assert!(Telemetry::new(Choice::Only(Autopilot::Px4), Some(1)).handle(Time::ZERO, &frame(1, 1, px4)));
        let silent = frame(1, 1, heartbeat(MavType::MAV_TYPE_GENERIC, MavAutopilot::MAV_AUTOPILOT_GENERIC, 0));
        assert!(!Telemetry::new(Choice::Auto, None).handle(Time::ZERO, &silent), "it may be anything");
        assert!(Telemetry::new(Choice::Only(Autopilot::ArduPilot), None).handle(Time::ZERO, &silent));
    }
}
