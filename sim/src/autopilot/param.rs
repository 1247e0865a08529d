//! Parameters: the few that matter to a companion, under each autopilot's names.
//!
//! ArduPilot sends every number as floating point, PX4 integers as their bits.

use quietpath_bridge::link::dialect::*;
use quietpath_bridge::telemetry::Autopilot;

/// A value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value {
    /// A whole number.
    Int(i32),
    /// Any number.
    Real(f32),
}

impl Value {
    /// The number.
    #[must_use]
    pub fn number(self) -> f64 {
        match self {
            Self::Int(value) => f64::from(value),
            Self::Real(value) => f64::from(value),
        }
    }
}

/// The parameters of one autopilot.
#[derive(Clone, Debug)]
pub(super) struct Params {
    kind: Autopilot,
    list: Vec<(&'static str, Value)>,
}

impl Params {
    /// Those of a kind, with its system id and largest speed, m/s.
    pub(super) fn new(kind: Autopilot, system: u8, speed_max: f64) -> Self {
        let system = i32::from(system);
        let list = match kind {
            Autopilot::Px4 => vec![
                ("COM_OBL_RC_ACT", Value::Int(0)),
                ("COM_OF_LOSS_T", Value::Real(1.0)),
                ("MAV_SYS_ID", Value::Int(system)),
                ("MPC_XY_VEL_MAX", Value::Real(speed_max as f32)),
                ("NAV_ACC_RAD", Value::Real(2.0)),
            ],
            Autopilot::ArduPilot => vec![
                ("FS_GCS_ENABLE", Value::Int(0)),
                ("GUID_TIMEOUT", Value::Real(3.0)),
                ("SYSID_THISMAV", Value::Int(system)),
                ("WPNAV_RADIUS", Value::Real(200.0)),
                ("WPNAV_SPEED", Value::Real(100.0 * speed_max as f32)),
            ],
        };
        Self { kind, list }
    }

    /// A parameter's number.
    pub(super) fn number(&self, name: &str) -> Option<f64> {
        self.list.iter().find(|(known, _)| *known == name).map(|(_, value)| value.number())
    }

    /// Takes a message.
    pub(super) fn handle(&mut self, message: &MavMessage, out: &mut Vec<MavMessage>) {
        match message {
            MavMessage::PARAM_REQUEST_LIST(_) => {
                out.extend((0..self.list.len()).filter_map(|index| self.value(index)))
            }
            MavMessage::PARAM_REQUEST_READ(data) => {
                let index = match usize::try_from(data.param_index) {
                    Ok(index) => Some(index),
                    Err(_) => self.index(data.param_id.to_str().unwrap_or_default()),
                };
                out.extend(index.and_then(|index| self.value(index)));
            }
            MavMessage::PARAM_SET(data) => {
                let Some(index) = self.index(data.param_id.to_str().unwrap_or_default()) else { return };
                if let Some((_, value)) = self.list.get_mut(index) {
                    *value = match (self.kind, *value) {
                        (_, Value::Real(_)) if data.param_value.is_finite() => Value::Real(data.param_value),
                        (Autopilot::Px4, Value::Int(_)) => Value::Int(data.param_value.to_bits().cast_signed()),
                        (Autopilot::ArduPilot, Value::Int(_)) => Value::Int(data.param_value as i32),
                        (_, kept) => kept,
                    };
                }
                out.extend(self.value(index));
            }
            _ => {}
        }
    }

    fn index(&self, name: &str) -> Option<usize> {
        self.list.iter().position(|(known, _)| *known == name)
    }

    fn value(&self, index: usize) -> Option<MavMessage> {
        let (name, value) = self.list.get(index)?;
        let (param_value, param_type) = match (self.kind, *value) {
            (_, Value::Real(value)) => (value, MavParamType::MAV_PARAM_TYPE_REAL32),
            (Autopilot::Px4, Value::Int(value)) => {
                (f32::from_bits(value.cast_unsigned()), MavParamType::MAV_PARAM_TYPE_INT32)
            }
            (Autopilot::ArduPilot, Value::Int(value)) => (value as f32, MavParamType::MAV_PARAM_TYPE_INT32),
        };
        Some(MavMessage::PARAM_VALUE(PARAM_VALUE_DATA {
            param_value,
            param_count: u16::try_from(self.list.len()).unwrap_or(u16::MAX),
            param_index: u16::try_from(index).unwrap_or(u16::MAX),
            param_id: (*name).into(),
            param_type,
        }))
    }
}
