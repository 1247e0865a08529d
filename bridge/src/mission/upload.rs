//! One upload: COUNT, then whatever the autopilot asks for, then its ACK.
//!
//! The autopilot leads: it asks for items, in its own order and as often as it likes, and each request is answered with
//! the item asked for. Where it falls silent the last message is sent again. What does not advance: requests for other
//! lists or other stations, an acceptance before every item was asked for (it belongs to an earlier transfer),
//! `INVALID_SEQUENCE`, which ArduPilot sends for duplicates in the middle of a good transfer. A lost ACK is not
//! asked for for ever: the result is then [`Accepted::Unknown`], and reading back says what the autopilot holds.
//!
//! An empty list is uploaded as CLEAR_ALL, which is answered with an ACK too.

use std::time::Duration;

use crate::clock::Time;
use crate::link::Frame;
use crate::link::dialect::{
    MISSION_ACK_DATA, MISSION_CLEAR_ALL_DATA, MISSION_COUNT_DATA, MavMessage, MavMissionResult, MavMissionType,
};

use super::{Failure, Item, Pace, Talk};

/// How often the first message is sent before the autopilot counts as silent.
const STARTS_MAX: u32 = 6;
/// How often an item is sent again, in silence, before the autopilot counts as silent.
const NUDGES_MAX: u32 = 12;
/// How often the last item of all is sent again before the answer counts as lost.
const LAST_NUDGES_MAX: u32 = 4;
/// Errors without anything new before they count as an answer.
const ERRORS_MAX: u32 = 4;
/// Requests in a row that bring nothing new before an autopilot counts as stuck.
const REPEATS_MAX: u32 = 200;

/// What an autopilot said at the end of an upload.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Accepted {
    /// It took the list; the id that it gave it, 0 where it gives none.
    Yes {
        /// Changes with the list, on autopilots that have it.
        opaque_id: u32,
    },
    /// All items were sent, and the answer never came.
    Unknown,
}

/// An upload. See the [module](self).
#[derive(Clone, Debug)]
pub struct Upload {
    talk: Talk,
    items: Vec<Item>,
    pace: Pace,
    /// Which items have been asked for.
    asked: Vec<bool>,
    last: Option<u16>,
    repeats: u32,
    /// Errors since something new was asked for.
    errors: u32,
    sends: u32,
    sent: Option<Time>,
    result: Option<Result<Accepted, Failure>>,
}

impl Upload {
    /// An upload of a list; [`Upload::poll`] begins it.
    #[must_use]
    pub fn new(talk: Talk, items: Vec<Item>, pace: Pace) -> Self {
        let asked = vec![false; items.len()];
        let result = (items.len() > usize::from(u16::MAX)).then_some(Err(Failure::TooLong));
        Self { talk, items, pace, asked, last: None, repeats: 0, errors: 0, sends: 0, sent: None, result }
    }

    /// How it ended; `None` while it goes on.
    #[must_use]
    pub const fn result(&self) -> Option<Result<Accepted, Failure>> {
        self.result
    }

    /// Share of the items that have been asked for, 0 to 1.
    #[must_use]
    pub fn progress(&self) -> f64 {
        let asked = self.asked.iter().filter(|asked| **asked).count();
        if self.items.is_empty() { 0.0 } else { asked as f64 / self.items.len() as f64 }
    }

    /// The pace, with what this transfer measured.
    #[must_use]
    pub const fn pace(&self) -> Pace {
        self.pace
    }

    /// Takes a message of the link.
    pub fn handle(&mut self, now: Time, frame: &Frame, out: &mut Vec<MavMessage>) {
        if self.result.is_some() || self.sent.is_none() {
            return;
        }
        match &frame.message {
            MavMessage::MISSION_ACK(data)
                if self.talk.is_ours(frame.from, data.target_system, data.target_component, data.mission_type) =>
            {
                self.acknowledged(data);
            }
            message => {
                if let Some((system, component, list, seq)) = request(message)
                    && self.talk.is_ours(frame.from, system, component, list)
                {
                    self.answer(now, seq, out);
                }
            }
        }
    }

    fn answer(&mut self, now: Time, seq: u16, out: &mut Vec<MavMessage>) {
        // A request beyond the list belongs to an earlier, longer one.
        let Some(item) = self.items.get(usize::from(seq)) else { return };
        if let (Some(sent), 1) = (self.sent, self.sends) {
            self.pace.measured(now.since(sent));
        }
        let is_new = self.asked.get_mut(usize::from(seq)).is_some_and(|asked| !std::mem::replace(asked, true));
        (self.repeats, self.errors) = if is_new { (0, 0) } else { (self.repeats + 1, self.errors) };
        if self.repeats > REPEATS_MAX {
            self.result = Some(Err(Failure::Cancelled));
            return;
        }
        out.push(MavMessage::MISSION_ITEM_INT(item.message(&self.talk, seq)));
        (self.last, self.sends, self.sent) = (Some(seq), 1, Some(now));
    }

    fn acknowledged(&mut self, data: &MISSION_ACK_DATA) {
        let is_whole = self.asked.iter().all(|asked| *asked);
        self.result = match data.mavtype {
            MavMissionResult::MAV_MISSION_ACCEPTED if is_whole => {
                Some(Ok(Accepted::Yes { opaque_id: data.opaque_id }))
            }
            MavMissionResult::MAV_MISSION_ACCEPTED | MavMissionResult::MAV_MISSION_INVALID_SEQUENCE => return,
            MavMissionResult::MAV_MISSION_OPERATION_CANCELLED => Some(Err(Failure::Cancelled)),
            // An item sent again after the end of a transfer whose acceptance was lost is an error to ArduPilot.
            MavMissionResult::MAV_MISSION_ERROR if is_whole && !self.items.is_empty() => Some(Ok(Accepted::Unknown)),
            // Or an item of a transfer before this one, which came twice or late: an error that is meant stays.
            MavMissionResult::MAV_MISSION_ERROR if self.errors < ERRORS_MAX => return self.errors += 1,
            result => Some(Err(Failure::Rejected { result, item: self.last })),
        };
    }

    /// Sends what is due.
    pub fn poll(&mut self, now: Time, out: &mut Vec<MavMessage>) {
        if self.result.is_some() || self.sent.is_some_and(|sent| now.since(sent) < self.wait()) {
            return;
        }
        let is_whole = !self.items.is_empty() && self.asked.iter().all(|asked| *asked);
        let sends_max = match self.last {
            None => STARTS_MAX,
            Some(_) if is_whole => LAST_NUDGES_MAX,
            Some(_) => NUDGES_MAX,
        };
        if self.sends >= sends_max {
            self.result = Some(if is_whole { Ok(Accepted::Unknown) } else { Err(Failure::Silent) });
            return;
        }
        (self.sends, self.sent) = (self.sends + 1, Some(now));
        out.push(self.last_message());
    }

    /// How long the autopilot may say nothing.
    fn wait(&self) -> Duration {
        // It asks again by itself: it gets the time to do so twice before the item is sent again.
        if self.last.is_some() { self.pace.item() * 2 } else { self.pace.answer() }
    }

    fn last_message(&self) -> MavMessage {
        let (target_system, target_component) = (self.talk.vehicle.system, self.talk.vehicle.component);
        let mission_type = self.talk.list.mission_type();
        match self.last.and_then(|seq| Some((seq, self.items.get(usize::from(seq))?))) {
            Some((seq, item)) => MavMessage::MISSION_ITEM_INT(item.message(&self.talk, seq)),
            None if self.items.is_empty() => MavMessage::MISSION_CLEAR_ALL(MISSION_CLEAR_ALL_DATA {
                target_system,
                target_component,
                mission_type,
            }),
            None => MavMessage::MISSION_COUNT(MISSION_COUNT_DATA {
                count: u16::try_from(self.items.len()).unwrap_or(u16::MAX),
                target_system,
                target_component,
                mission_type,
                opaque_id: 0,
            }),
        }
    }

    /// The message that ends an upload which is given up.
    #[must_use]
    pub fn cancel(&self) -> MavMessage {
        MavMessage::MISSION_ACK(MISSION_ACK_DATA {
            target_system: self.talk.vehicle.system,
            target_component: self.talk.vehicle.component,
            mavtype: MavMissionResult::MAV_MISSION_OPERATION_CANCELLED,
            mission_type: self.talk.list.mission_type(),
            opaque_id: 0,
        })
    }
}

/// The address, list and item of a request, new or old.
#[expect(deprecated, reason = "ArduPilot asks in the old way")]
const fn request(message: &MavMessage) -> Option<(u8, u8, MavMissionType, u16)> {
    match message {
        MavMessage::MISSION_REQUEST_INT(data) => {
            Some((data.target_system, data.target_component, data.mission_type, data.seq))
        }
        MavMessage::MISSION_REQUEST(data) => {
            Some((data.target_system, data.target_component, data.mission_type, data.seq))
        }
        _ => None,
    }
}
