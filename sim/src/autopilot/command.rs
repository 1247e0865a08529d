//! Commands, and what each kind of autopilot answers.
//!
//! | command | PX4 | ArduPilot |
//! |---|---|---|
//! | SET_MESSAGE_INTERVAL, REQUEST_MESSAGE | yes | yes |
//! | COMPONENT_ARM_DISARM | on the ground, or by force | the same |
//! | DO_SET_MODE | offboard only to a stream of setpoints | every mode |
//! | NAV_TAKEOFF | armed; altitude above the sea | armed and guided; altitude above home |
//! | NAV_LAND, NAV_RETURN_TO_LAUNCH | yes | yes |
//! | MISSION_START, DO_SET_MISSION_CURRENT | with such a mission | the same |
//! | DO_CHANGE_SPEED | yes | yes |
//! | DO_REPOSITION | yes | COMMAND_INT only |
//! | DO_SET_ACTUATOR | COMMAND_LONG only | no |
//! | DO_SET_SERVO | no | COMMAND_LONG only |
//! | anything else | UNSUPPORTED | UNSUPPORTED |

use quietpath_bridge::frame::Altitude;
use quietpath_bridge::link::Identity;
use quietpath_bridge::link::dialect::*;
use quietpath_bridge::mission::List;
use quietpath_bridge::mission::item::wire_degrees;
use quietpath_bridge::telemetry::{Airframe, Autopilot, Mode};

use super::guided::local;
use super::{Landed, Machine};

use MavResult as R;

/// Parameter of COMPONENT_ARM_DISARM that forces it.
const FORCE: f32 = 21_196.0;

/// The message that a command came in.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Form {
    Long,
    Int(MavFrame),
}

/// A command without its addresses.
#[derive(Clone, Copy, Debug)]
struct Asked {
    command: MavCmd,
    params: [f32; 4],
    x: i32,
    y: i32,
    z: f32,
    form: Form,
}

impl Machine {
    /// Answers a command to the autopilot or to a payload.
    pub(super) fn command(&mut self, from: Identity, message: &MavMessage) {
        let (asked, system, component) = match message {
            MavMessage::COMMAND_LONG(data) => {
                let params = [data.param1, data.param2, data.param3, data.param4];
                let (x, y) = (wire_degrees(f64::from(data.param5)), wire_degrees(f64::from(data.param6)));
                let asked = Asked { command: data.command, params, x, y, z: data.param7, form: Form::Long };
                (asked, data.target_system, data.target_component)
            }
            MavMessage::COMMAND_INT(data) => {
                let params = [data.param1, data.param2, data.param3, data.param4];
                let form = Form::Int(data.frame);
                let asked = Asked { command: data.command, params, x: data.x, y: data.y, z: data.z, form };
                (asked, data.target_system, data.target_component)
            }
            _ => return,
        };
        if system != self.us.system {
            return;
        }
        let now = self.now;
        let payload = self.payloads.iter_mut().find(|payload| payload.spec().component == component);
        let (answers, result) = match (payload, message) {
            (Some(payload), MavMessage::COMMAND_LONG(data)) => {
                (payload.identity(self.us.system), payload.command(now, data))
            }
            (Some(payload), _) => (payload.identity(self.us.system), R::MAV_RESULT_COMMAND_LONG_ONLY),
            (None, _) if component == self.us.component || component == 0 => (self.us, self.carry_out(&asked)),
            _ => return,
        };
        let ack = COMMAND_ACK_DATA {
            command: asked.command,
            result,
            target_system: from.system,
            target_component: from.component,
            ..Default::default()
        };
        self.say_as(answers, MavMessage::COMMAND_ACK(ack));
    }

    fn carry_out(&mut self, asked: &Asked) -> R {
        if let Some(other) = self.wrong_form(asked) {
            return other;
        }
        let [p1, p2, p3, _] = asked.params;
        match asked.command {
            MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL => {
                yes(p1 >= 0.0 && self.streams.set(p1 as u32, p2), R::MAV_RESULT_FAILED)
            }
            MavCmd::MAV_CMD_REQUEST_MESSAGE => yes(self.say_once(p1 as u32), R::MAV_RESULT_UNSUPPORTED),
            MavCmd::MAV_CMD_COMPONENT_ARM_DISARM if p1 >= 0.5 => {
                self.arm();
                R::MAV_RESULT_ACCEPTED
            }
            MavCmd::MAV_CMD_COMPONENT_ARM_DISARM => {
                let may = self.landed == Landed::Ground || p2 == FORCE;
                if may {
                    self.disarm();
                }
                yes(may, R::MAV_RESULT_FAILED)
            }
            MavCmd::MAV_CMD_DO_SET_MODE => {
                let custom = match self.settings.like {
                    Autopilot::Px4 => (p2 as u32) << 16 | (p3 as u32) << 24,
                    Autopilot::ArduPilot => p2 as u32,
                };
                let mode = Mode::of(self.settings.like, Airframe::Copter, custom);
                yes(p1 as u32 & 1 == 1 && self.change_mode(mode), R::MAV_RESULT_DENIED)
            }
            MavCmd::MAV_CMD_NAV_TAKEOFF => self.take_off_commanded(asked.z),
            MavCmd::MAV_CMD_NAV_LAND => yes(self.change_mode(Mode::Land), R::MAV_RESULT_DENIED),
            MavCmd::MAV_CMD_NAV_RETURN_TO_LAUNCH => yes(self.change_mode(Mode::Return), R::MAV_RESULT_DENIED),
            MavCmd::MAV_CMD_MISSION_START => {
                let has = !self.list(List::Mission).is_empty();
                yes(has && self.armed && self.change_mode(Mode::Mission), R::MAV_RESULT_DENIED)
            }
            MavCmd::MAV_CMD_DO_SET_MISSION_CURRENT => {
                yes(p1 >= 0.0 && self.set_current(p1 as u16), R::MAV_RESULT_DENIED)
            }
            MavCmd::MAV_CMD_DO_CHANGE_SPEED => {
                self.run.ask_speed(f64::from(p2));
                yes(p2 > 0.0, R::MAV_RESULT_DENIED)
            }
            MavCmd::MAV_CMD_DO_REPOSITION => self.reposition(asked),
            MavCmd::MAV_CMD_DO_SET_ACTUATOR | MavCmd::MAV_CMD_DO_SET_SERVO => self.set_output(asked),
            _ => R::MAV_RESULT_UNSUPPORTED,
        }
    }

    /// The answer to a command in the wrong message.
    fn wrong_form(&self, asked: &Asked) -> Option<R> {
        let is_ardupilot = self.settings.like == Autopilot::ArduPilot;
        let int_only = self.settings.int_only.contains(&asked.command)
            || (is_ardupilot && asked.command == MavCmd::MAV_CMD_DO_REPOSITION);
        let long_only = self.settings.long_only.contains(&asked.command)
            || matches!(asked.command, MavCmd::MAV_CMD_DO_SET_ACTUATOR | MavCmd::MAV_CMD_DO_SET_SERVO);
        match asked.form {
            Form::Long if int_only => Some(R::MAV_RESULT_COMMAND_INT_ONLY),
            Form::Int(_) if long_only => Some(R::MAV_RESULT_COMMAND_LONG_ONLY),
            Form::Int(frame) if !is_global(frame) => Some(R::MAV_RESULT_COMMAND_UNSUPPORTED_MAV_FRAME),
            _ => None,
        }
    }

    fn take_off_commanded(&mut self, altitude: f32) -> R {
        let altitude = f64::from(altitude);
        let (is_ready, height) = match self.settings.like {
            Autopilot::Px4 if altitude.is_nan() => (self.armed, 2.5),
            Autopilot::Px4 => (self.armed, altitude - self.settings.home.altitude_m),
            Autopilot::ArduPilot => (self.armed && self.mode == Mode::Guided, altitude),
        };
        let may = is_ready && height.is_finite() && height > 0.0;
        if may {
            self.lift(height, self.mode_after_take_off());
        }
        yes(may, R::MAV_RESULT_FAILED)
    }

    const fn mode_after_take_off(&self) -> Mode {
        match self.settings.like {
            Autopilot::Px4 => Mode::Hold,
            Autopilot::ArduPilot => Mode::Guided,
        }
    }

    fn reposition(&mut self, asked: &Asked) -> R {
        let above = match asked.form {
            Form::Int(frame) if is_relative(frame) => self.settings.home.altitude_m,
            _ => 0.0,
        };
        let to = local(&self.frame, asked.x, asked.y, f64::from(asked.z) + above);
        let to = to.filter(|to| to.iter().all(|part| part.is_finite()) && self.landed == Landed::Air);
        let may = to.is_some() && self.change_mode(Mode::Hold);
        if let (Some(to), true) = (to, may) {
            self.hold = to;
        }
        yes(may, R::MAV_RESULT_DENIED)
    }

    fn set_output(&mut self, asked: &Asked) -> R {
        match (self.settings.like, asked.command) {
            (Autopilot::Px4, MavCmd::MAV_CMD_DO_SET_ACTUATOR) => {
                let set = (1_u8..).zip(asked.params).filter(|(_, value)| value.is_finite());
                self.outputs.extend(set);
                R::MAV_RESULT_ACCEPTED
            }
            (Autopilot::ArduPilot, MavCmd::MAV_CMD_DO_SET_SERVO) => {
                self.outputs.insert(asked.params[0] as u8, asked.params[1]);
                R::MAV_RESULT_ACCEPTED
            }
            _ => R::MAV_RESULT_UNSUPPORTED,
        }
    }

    /// Altitude of the vehicle above the sea, m.
    pub(super) fn altitude_m(&self) -> f64 {
        match self.place().altitude {
            Altitude::AboveSeaLevel(meters) | Altitude::AboveHome(meters) => meters,
        }
    }
}

const fn yes(done: bool, otherwise: R) -> R {
    if done { R::MAV_RESULT_ACCEPTED } else { otherwise }
}

#[expect(deprecated, reason = "companions still say so")]
const fn is_relative(frame: MavFrame) -> bool {
    matches!(frame, MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT | MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT_INT)
}

#[expect(deprecated, reason = "companions still say so")]
const fn is_global(frame: MavFrame) -> bool {
    is_relative(frame) || matches!(frame, MavFrame::MAV_FRAME_GLOBAL | MavFrame::MAV_FRAME_GLOBAL_INT)
}
