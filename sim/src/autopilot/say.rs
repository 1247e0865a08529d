//! What the autopilot says about itself.

use quietpath_bridge::link::dialect::*;
use quietpath_bridge::mission::List;
use quietpath_bridge::mission::item::wire_degrees;
use quietpath_bridge::telemetry::{Autopilot, Mode};

use super::{Landed, Machine};

/// A number that stands for "does not say".
const UNKNOWN: u16 = u16::MAX;

impl Machine {
    pub(super) fn boot_ms(&self) -> u32 {
        u32::try_from(self.now.since(self.boot).as_millis()).unwrap_or(u32::MAX)
    }

    pub(super) fn heartbeat(&self) -> MavMessage {
        let autopilot = match self.settings.like {
            Autopilot::Px4 => MavAutopilot::MAV_AUTOPILOT_PX4,
            Autopilot::ArduPilot => MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
        };
        let mut base_mode = MavModeFlag::MAV_MODE_FLAG_CUSTOM_MODE_ENABLED;
        if self.armed {
            base_mode |= MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED;
        }
        MavMessage::HEARTBEAT(HEARTBEAT_DATA {
            custom_mode: self.custom_mode(),
            mavtype: MavType::MAV_TYPE_QUADROTOR,
            autopilot,
            base_mode,
            system_status: if self.armed { MavState::MAV_STATE_ACTIVE } else { MavState::MAV_STATE_STANDBY },
            mavlink_version: 3,
        })
    }

    /// The mode as a heartbeat says it.
    fn custom_mode(&self) -> u32 {
        let (main, sub): (u32, u32) = match (self.settings.like, self.mode) {
            (Autopilot::Px4, _) if self.lifting.is_some() => (4, 2),
            (Autopilot::Px4, Mode::Guided) => (6, 0),
            (Autopilot::Px4, Mode::Mission) => (4, 4),
            (Autopilot::Px4, Mode::Hold) => (4, 3),
            (Autopilot::Px4, Mode::Return) => (4, 5),
            (Autopilot::Px4, Mode::Land) => (4, 6),
            (Autopilot::Px4, Mode::Other) => (3, 0),
            // A person who takes off does so by hand.
            (Autopilot::ArduPilot, Mode::Hold) if self.lifting.is_some() => return 2,
            (Autopilot::ArduPilot, Mode::Guided) => return 4,
            (Autopilot::ArduPilot, Mode::Mission) => return 3,
            (Autopilot::ArduPilot, Mode::Hold) => return 5,
            (Autopilot::ArduPilot, Mode::Return) => return 6,
            (Autopilot::ArduPilot, Mode::Land) => return 9,
            (Autopilot::ArduPilot, Mode::Other) => return 0,
        };
        main << 16 | sub << 24
    }

    /// Says a message once; false where it is none of its own.
    pub(super) fn say_once(&mut self, id: u32) -> bool {
        let Some(message) = self.message(id) else { return false };
        self.say(message);
        true
    }

    /// A message about itself, by its number.
    pub(super) fn message(&self, id: u32) -> Option<MavMessage> {
        let time_boot_ms = self.boot_ms();
        let time_usec = u64::from(time_boot_ms) * 1000;
        let place = self.place();
        let (latitude, longitude) = (wire_degrees(place.latitude_deg), wire_degrees(place.longitude_deg));
        let altitude = (self.altitude_m() * 1e3).round() as i32;
        let ([x, y, z], [vx, vy, vz]) = (self.body.position, self.body.velocity);
        let yaw = if vx.hypot(vy) > 0.5 { vx.atan2(vy) } else { 0.0 };
        Some(match id {
            1 => MavMessage::SYS_STATUS(SYS_STATUS_DATA {
                voltage_battery: 16_000,
                current_battery: -1,
                battery_remaining: 90,
                ..Default::default()
            }),
            24 => MavMessage::GPS_RAW_INT(GPS_RAW_INT_DATA {
                time_usec,
                lat: latitude,
                lon: longitude,
                alt: altitude,
                eph: 80,
                epv: 120,
                vel: (vx.hypot(vy) * 1e2).round() as u16,
                cog: UNKNOWN,
                fix_type: GpsFixType::GPS_FIX_TYPE_3D_FIX,
                satellites_visible: 14,
                ..Default::default()
            }),
            30 => MavMessage::ATTITUDE(ATTITUDE_DATA { time_boot_ms, yaw: yaw as f32, ..Default::default() }),
            32 => MavMessage::LOCAL_POSITION_NED(LOCAL_POSITION_NED_DATA {
                time_boot_ms,
                x: y as f32,
                y: x as f32,
                z: -z as f32,
                vx: vy as f32,
                vy: vx as f32,
                vz: -vz as f32,
            }),
            33 => MavMessage::GLOBAL_POSITION_INT(GLOBAL_POSITION_INT_DATA {
                time_boot_ms,
                lat: latitude,
                lon: longitude,
                alt: altitude,
                relative_alt: (z * 1e3).round() as i32,
                vx: (vy * 1e2).round() as i16,
                vy: (vx * 1e2).round() as i16,
                vz: (-vz * 1e2).round() as i16,
                hdg: (yaw.to_degrees().rem_euclid(360.0) * 1e2).round() as u16,
            }),
            42 => MavMessage::MISSION_CURRENT(self.mission_current()),
            148 => MavMessage::AUTOPILOT_VERSION(self.version()),
            242 => MavMessage::HOME_POSITION(HOME_POSITION_DATA {
                latitude: wire_degrees(self.settings.home.latitude_deg),
                longitude: wire_degrees(self.settings.home.longitude_deg),
                altitude: (self.settings.home.altitude_m * 1e3).round() as i32,
                q: [1.0, 0.0, 0.0, 0.0],
                time_usec,
                ..Default::default()
            }),
            245 => MavMessage::EXTENDED_SYS_STATE(EXTENDED_SYS_STATE_DATA {
                vtol_state: MavVtolState::MAV_VTOL_STATE_UNDEFINED,
                landed_state: match self.landed {
                    Landed::Ground => MavLandedState::MAV_LANDED_STATE_ON_GROUND,
                    Landed::Rising => MavLandedState::MAV_LANDED_STATE_TAKEOFF,
                    Landed::Air => MavLandedState::MAV_LANDED_STATE_IN_AIR,
                    Landed::Landing => MavLandedState::MAV_LANDED_STATE_LANDING,
                },
            }),
            _ => return None,
        })
    }

    /// ArduPilot counts without home, and has no ids.
    pub(super) fn mission_current(&self) -> MISSION_CURRENT_DATA {
        let items = u16::try_from(self.list(List::Mission).len()).unwrap_or(UNKNOWN);
        let is_px4 = self.settings.like == Autopilot::Px4;
        let [mission_id, fence_id, rally_points_id] = self.storage.ids;
        let mission_state = match self.mode {
            _ if items == 0 => MissionState::MISSION_STATE_NO_MISSION,
            _ if self.run.is_done() => MissionState::MISSION_STATE_COMPLETE,
            Mode::Mission => MissionState::MISSION_STATE_ACTIVE,
            _ => MissionState::MISSION_STATE_NOT_STARTED,
        };
        MISSION_CURRENT_DATA {
            seq: self.current(),
            total: if is_px4 { items } else { items.saturating_sub(1) },
            mission_state,
            mission_mode: if self.mode == Mode::Mission { 1 } else { 2 },
            mission_id,
            fence_id,
            rally_points_id,
        }
    }

    fn version(&self) -> AUTOPILOT_VERSION_DATA {
        type C = MavProtocolCapability;
        let encoding = match self.settings.like {
            Autopilot::Px4 => C::MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE,
            Autopilot::ArduPilot => C::MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST,
        };
        let capabilities = C::MAV_PROTOCOL_CAPABILITY_MISSION_INT
            | C::MAV_PROTOCOL_CAPABILITY_COMMAND_INT
            | C::MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_GLOBAL_INT
            | C::MAV_PROTOCOL_CAPABILITY_MAVLINK2
            | C::MAV_PROTOCOL_CAPABILITY_MISSION_FENCE
            | C::MAV_PROTOCOL_CAPABILITY_MISSION_RALLY
            | encoding;
        let uid = u64::from(self.us.system);
        AUTOPILOT_VERSION_DATA { capabilities, uid, ..Default::default() }
    }
}
