//! Flight modes, in the words of each autopilot.
//!
//! | | PX4: main, sub | ArduCopter | ArduPlane |
//! |---|---|---|---|
//! | [`Mode::Mission`] | 4, 4 | 3 | 10 |
//! | [`Mode::Guided`] | 6 (offboard) | 4 | 15 |
//! | [`Mode::Hold`] | 4, 3 | 5 (loiter), 17 (brake) | 12 |
//! | [`Mode::Return`] | 4, 5 | 6, 21 | 11, 21 |
//! | [`Mode::Land`] | 4, 6 | 9 | 20 (quadplanes) |

use crate::command::Command;
use crate::link::dialect::{MavCmd, MavType};

/// The kind of autopilot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Autopilot {
    /// PX4.
    Px4,
    /// ArduPilot.
    ArduPilot,
}

/// What flies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Airframe {
    /// Something that can stand still in the air.
    Copter,
    /// Something that cannot.
    Plane,
}

impl Airframe {
    /// By MAVLink's type.
    #[must_use]
    pub const fn of(kind: MavType) -> Self {
        match kind {
            MavType::MAV_TYPE_FIXED_WING
            | MavType::MAV_TYPE_VTOL_TAILSITTER_DUOROTOR
            | MavType::MAV_TYPE_VTOL_TAILSITTER_QUADROTOR
            | MavType::MAV_TYPE_VTOL_TILTROTOR
            | MavType::MAV_TYPE_VTOL_FIXEDROTOR
            | MavType::MAV_TYPE_VTOL_TAILSITTER
            | MavType::MAV_TYPE_VTOL_TILTWING => Self::Plane,
            _ => Self::Copter,
        }
    }
}

/// A flight mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Flies the mission.
    Mission,
    /// Follows setpoints.
    Guided,
    /// Stays where it is.
    Hold,
    /// Returns.
    Return,
    /// Lands.
    Land,
    /// Any other, above all those in which a person flies.
    Other,
}

/// PX4's main mode that flies by itself.
const PX4_AUTO: u32 = 4;
/// PX4's main mode that follows setpoints.
const PX4_OFFBOARD: u32 = 6;

impl Mode {
    /// By the number in a heartbeat.
    #[must_use]
    pub const fn of(autopilot: Autopilot, airframe: Airframe, custom_mode: u32) -> Self {
        match (autopilot, airframe) {
            (Autopilot::Px4, _) => match ((custom_mode >> 16) & 0xFF, custom_mode >> 24) {
                (PX4_OFFBOARD, _) => Self::Guided,
                (PX4_AUTO, 4) => Self::Mission,
                (PX4_AUTO, 3) => Self::Hold,
                (PX4_AUTO, 5) => Self::Return,
                (PX4_AUTO, 6) => Self::Land,
                _ => Self::Other,
            },
            (Autopilot::ArduPilot, Airframe::Copter) => match custom_mode {
                3 => Self::Mission,
                4 => Self::Guided,
                5 | 17 => Self::Hold,
                6 | 21 => Self::Return,
                9 => Self::Land,
                _ => Self::Other,
            },
            (Autopilot::ArduPilot, Airframe::Plane) => match custom_mode {
                10 => Self::Mission,
                15 => Self::Guided,
                12 => Self::Hold,
                11 | 21 => Self::Return,
                20 => Self::Land,
                _ => Self::Other,
            },
        }
    }
}

/// The command that asks for a mode; `None` for [`Mode::Other`].
#[must_use]
pub fn mode_command(autopilot: Autopilot, airframe: Airframe, mode: Mode) -> Option<Command> {
    /// `MAV_MODE_FLAG_CUSTOM_MODE_ENABLED`.
    const CUSTOM: f32 = 1.0;
    let (main, sub) = match (autopilot, airframe, mode) {
        (_, _, Mode::Other) => return None,
        (Autopilot::Px4, _, Mode::Guided) => (6.0, 0.0),
        (Autopilot::Px4, _, Mode::Mission) => (4.0, 4.0),
        (Autopilot::Px4, _, Mode::Hold) => (4.0, 3.0),
        (Autopilot::Px4, _, Mode::Return) => (4.0, 5.0),
        (Autopilot::Px4, _, Mode::Land) => (4.0, 6.0),
        (Autopilot::ArduPilot, Airframe::Copter, Mode::Mission) => (3.0, 0.0),
        (Autopilot::ArduPilot, Airframe::Copter, Mode::Guided) => (4.0, 0.0),
        (Autopilot::ArduPilot, Airframe::Copter, Mode::Hold) => (5.0, 0.0),
        (Autopilot::ArduPilot, Airframe::Copter, Mode::Return) => (6.0, 0.0),
        (Autopilot::ArduPilot, Airframe::Copter, Mode::Land) => (9.0, 0.0),
        (Autopilot::ArduPilot, Airframe::Plane, Mode::Mission) => (10.0, 0.0),
        (Autopilot::ArduPilot, Airframe::Plane, Mode::Guided) => (15.0, 0.0),
        (Autopilot::ArduPilot, Airframe::Plane, Mode::Hold) => (12.0, 0.0),
        (Autopilot::ArduPilot, Airframe::Plane, Mode::Return) => (11.0, 0.0),
        (Autopilot::ArduPilot, Airframe::Plane, Mode::Land) => (20.0, 0.0),
    };
    Some(Command::new(MavCmd::MAV_CMD_DO_SET_MODE, [CUSTOM, main, sub, 0.0, 0.0, 0.0, 0.0]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_mode_that_can_be_asked_for_is_recognised() {
        for autopilot in [Autopilot::Px4, Autopilot::ArduPilot] {
            for airframe in [Airframe::Copter, Airframe::Plane] {
                for mode in [Mode::Mission, Mode::Guided, Mode::Hold, Mode::Return, Mode::Land] {
                    let command = mode_command(autopilot, airframe, mode).expect("a command");
                    let [_, main, sub, ..] = command.params.map(|param| param as u32);
                    let custom = if autopilot == Autopilot::Px4 { main << 16 | sub << 24 } else { main };
                    assert_eq!(Mode::of(autopilot, airframe, custom), mode, "{autopilot:?} {airframe:?}");
                }
            }
        }
        assert_eq!(mode_command(Autopilot::Px4, Airframe::Copter, Mode::Other), None);
    }
}
