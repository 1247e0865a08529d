//! Signs that somebody else replaced the mission.
//!
//! No sign is given by every autopilot, and none is proof: the mission's id in MISSION_CURRENT changes, its length there is
//! another one, the autopilot acknowledges a mission to somebody else. Each is a reason to read back, once: what was read
//! and found to be ours is [confirmed](Watch::confirm) and no sign any more.

use crate::link::Frame;
use crate::link::dialect::{MISSION_CURRENT_DATA, MavMessage, MavMissionResult};

use super::{Delivered, List, Talk};

/// Watches over a delivered mission.
#[derive(Clone, Copy, Debug)]
pub struct Watch {
    talk: Talk,
    /// The id that it is known by; 0 where the autopilot has given none yet.
    id: u32,
    /// The length that it is known by.
    count: u16,
    /// The id and length that MISSION_CURRENT said last.
    said: (u32, u16),
}

impl Watch {
    /// A watch over what was delivered.
    #[must_use]
    pub const fn new(talk: Talk, delivered: Delivered) -> Self {
        Self { talk, id: delivered.opaque_id, count: delivered.count, said: (0, 0) }
    }

    /// Takes a message of the link; true where it is a reason to read the mission back.
    pub fn handle(&mut self, frame: &Frame) -> bool {
        if frame.from != self.talk.vehicle {
            return false;
        }
        match &frame.message {
            MavMessage::MISSION_CURRENT(data) if self.talk.list == List::Mission => self.current(data),
            MavMessage::MISSION_ACK(data) => {
                let list = self.talk.list.mission_type();
                let to_us = self.talk.is_ours(frame.from, data.target_system, data.target_component, list);
                let accepted = data.mavtype == MavMissionResult::MAV_MISSION_ACCEPTED;
                accepted && data.mission_type == list && !to_us
            }
            _ => false,
        }
    }

    fn current(&mut self, data: &MISSION_CURRENT_DATA) -> bool {
        self.said = (data.mission_id, data.total);
        if data.mission_id != 0 {
            // Not every autopilot gives an id in the transfer: then the first one said is taken for that of our mission.
            if self.id == 0 {
                self.id = data.mission_id;
            }
            return data.mission_id != self.id;
        }
        // ArduPilot counts without home; 0 and 65535 stand for "does not say".
        let says = !matches!(data.total, 0 | u16::MAX);
        says && data.total.abs_diff(self.count) > 1
    }

    /// The mission was read back and is ours, whatever it is said to be.
    pub const fn confirm(&mut self) {
        let (id, total) = self.said;
        if id != 0 {
            self.id = id;
        }
        if !matches!(total, 0 | u16::MAX) {
            self.count = total;
        }
    }
}
