//! Whether somebody else replaced the mission.
//!
//! Three signs, none of which every autopilot gives: the mission's id or length in MISSION_CURRENT changes, or the
//! autopilot acknowledges a mission to somebody else. The first is proof; the others are a reason to read back.

use crate::link::Frame;
use crate::link::dialect::{MavMessage, MavMissionResult};

use super::{Delivered, List, Talk};

/// What a watch saw.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sign {
    /// The mission is another one.
    Replaced,
    /// It may be: read back.
    Suspicious,
}

/// Watches over a delivered mission.
#[derive(Clone, Copy, Debug)]
pub struct Watch {
    talk: Talk,
    delivered: Delivered,
}

impl Watch {
    /// A watch over what was delivered.
    #[must_use]
    pub const fn new(talk: Talk, delivered: Delivered) -> Self {
        Self { talk, delivered }
    }

    /// Takes a message of the link.
    pub fn handle(&mut self, frame: &Frame) -> Option<Sign> {
        if frame.from != self.talk.vehicle {
            return None;
        }
        match &frame.message {
            MavMessage::MISSION_CURRENT(data) if self.talk.list == List::Mission => {
                if data.mission_id != 0 {
                    // Not every autopilot gives an id in the transfer: then the first one seen is that of our mission.
                    if self.delivered.opaque_id == 0 {
                        self.delivered.opaque_id = data.mission_id;
                    }
                    return (data.mission_id != self.delivered.opaque_id).then_some(Sign::Replaced);
                }
                // ArduPilot counts without home; 0 and 65535 stand for "does not say".
                let says = !matches!(data.total, 0 | u16::MAX);
                let differs = data.total.abs_diff(self.delivered.count) > 1;
                (says && differs).then_some(Sign::Suspicious)
            }
            MavMessage::MISSION_ACK(data) => {
                let to_us = self.talk.is_ours(
                    frame.from,
                    data.target_system,
                    data.target_component,
                    self.talk.list.mission_type(),
                );
                let accepted = data.mavtype == MavMissionResult::MAV_MISSION_ACCEPTED;
                let ours = data.mission_type == self.talk.list.mission_type();
                (accepted && ours && !to_us).then_some(Sign::Suspicious)
            }
            _ => None,
        }
    }
}
