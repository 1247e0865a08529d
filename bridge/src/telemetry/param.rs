//! Reading a parameter of the autopilot by its name.
//!
//! ArduPilot sends every parameter as a number in floating point, PX4 sends integers as their bits in the same field.

use crate::clock::Time;
use crate::link::dialect::{MavMessage, MavParamType, PARAM_REQUEST_READ_DATA, PARAM_VALUE_DATA};
use crate::link::{Frame, Identity};
use crate::mission::Pace;

use super::Autopilot;

/// How often to ask before the parameter counts as unknown.
const ASKS_MAX: u32 = 6;
/// Longest name of a parameter.
pub const NAME_MAX: usize = 16;

/// Reads one parameter.
#[derive(Clone, Debug)]
pub struct ReadParam {
    vehicle: Identity,
    autopilot: Autopilot,
    name: String,
    pace: Pace,
    sends: u32,
    sent: Option<Time>,
    result: Option<Option<f64>>,
}

impl ReadParam {
    /// A reading; [`ReadParam::poll`] begins it.
    #[must_use]
    pub fn new(vehicle: Identity, autopilot: Autopilot, name: &str, pace: Pace) -> Self {
        // A name that does not fit cannot exist.
        let result = (name.len() > NAME_MAX).then_some(None);
        Self { vehicle, autopilot, name: name.to_owned(), pace, sends: 0, sent: None, result }
    }

    /// The value, or `Some(None)` where the autopilot has no such parameter; `None` while the reading goes on.
    #[must_use]
    pub const fn result(&self) -> Option<Option<f64>> {
        self.result
    }

    /// Takes a message of the link.
    pub fn handle(&mut self, frame: &Frame) {
        if let MavMessage::PARAM_VALUE(data) = &frame.message
            && frame.from == self.vehicle
            && self.result.is_none()
            && data.param_id.to_str() == Ok(&self.name)
        {
            self.result = Some(Some(value(self.autopilot, data)));
        }
    }

    /// Sends what is due.
    pub fn poll(&mut self, now: Time, out: &mut Vec<MavMessage>) {
        if self.result.is_some() || self.sent.is_some_and(|sent| now.since(sent) < self.pace.answer()) {
            return;
        }
        if self.sends >= ASKS_MAX {
            self.result = Some(None);
            return;
        }
        (self.sends, self.sent) = (self.sends + 1, Some(now));
        out.push(MavMessage::PARAM_REQUEST_READ(PARAM_REQUEST_READ_DATA {
            param_index: -1,
            target_system: self.vehicle.system,
            target_component: self.vehicle.component,
            param_id: self.name.as_str().into(),
        }));
    }
}

fn value(autopilot: Autopilot, data: &PARAM_VALUE_DATA) -> f64 {
    let bits = data.param_value.to_bits();
    match (autopilot, data.param_type) {
        (Autopilot::Px4, MavParamType::MAV_PARAM_TYPE_INT32) => f64::from(bits.cast_signed()),
        (Autopilot::Px4, MavParamType::MAV_PARAM_TYPE_UINT32) => f64::from(bits),
        _ => f64::from(data.param_value),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parameter_is_asked_for_until_it_comes_or_is_unknown() {
        let vehicle = Identity { system: 1, component: 1 };
        let mut read = ReadParam::new(vehicle, Autopilot::Px4, "COM_OBL_RC_ACT", Pace::default());
        let mut out = Vec::new();
        read.poll(Time::ZERO, &mut out);
        read.poll(Time::from_millis(1499), &mut out);
        read.poll(Time::from_millis(1500), &mut out);
        assert_eq!(out.len(), 2);
        let data = PARAM_VALUE_DATA {
            param_value: f32::from_bits(0xFFFF_FFFF),
            param_id: "COM_OBL_RC_ACT".into(),
            param_type: MavParamType::MAV_PARAM_TYPE_INT32,
            ..Default::default()
        };
        let mut frame =
            Frame { from: vehicle, sequence: 0, message: MavMessage::PARAM_VALUE(data.clone()), bytes: Vec::new() };
        let other = PARAM_VALUE_DATA { param_id: "COM_OBL_RC_AC".into(), ..data };
        read.handle(&Frame { message: MavMessage::PARAM_VALUE(other), ..frame.clone() });
        assert_eq!(read.result(), None);
        read.handle(&frame);
        assert_eq!(read.result(), Some(Some(-1.0)), "bits of an integer");
        let mut unknown = ReadParam::new(vehicle, Autopilot::Px4, "NO_SUCH", Pace::default());
        frame.from.component = 2;
        unknown.handle(&frame);
        for tick in 0..100 {
            unknown.poll(Time::from_millis(tick * 500), &mut out);
        }
        assert_eq!(unknown.result(), Some(None));
        let long = ReadParam::new(vehicle, Autopilot::Px4, "A_NAME_THAT_IS_TOO_LONG", Pace::default());
        assert_eq!(long.result(), Some(None));
    }
}
