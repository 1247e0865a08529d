//! One download: REQUEST_LIST, COUNT, then a REQUEST_INT for each item, then our ACK.
//!
//! We lead: each item is asked for until it comes. Items that were not asked for are those of an earlier question and do
//! not advance; a second COUNT is one that was sent twice.

use std::time::Duration;

use crate::clock::Time;
use crate::link::Frame;
use crate::link::dialect::{
    MISSION_ACK_DATA, MISSION_REQUEST_INT_DATA, MISSION_REQUEST_LIST_DATA, MavMessage, MavMissionResult,
};

use super::{Failure, Item, Pace, Talk};

/// How often the list is asked for before the autopilot counts as silent.
const STARTS_MAX: u32 = 6;
/// How often an item is asked for before the autopilot counts as silent.
const ASKS_MAX: u32 = 25;

/// A download. See the [module](self).
#[derive(Clone, Debug)]
pub struct Download {
    talk: Talk,
    pace: Pace,
    count: Option<u16>,
    opaque_id: u32,
    items: Vec<Item>,
    sends: u32,
    sent: Option<Time>,
    result: Option<Result<(), Failure>>,
}

impl Download {
    /// A download of a list; [`Download::poll`] begins it.
    #[must_use]
    pub const fn new(talk: Talk, pace: Pace) -> Self {
        Self { talk, pace, count: None, opaque_id: 0, items: Vec::new(), sends: 0, sent: None, result: None }
    }

    /// What the autopilot holds, or why that is not known; `None` while the download goes on.
    #[must_use]
    pub fn result(&self) -> Option<Result<&[Item], Failure>> {
        self.result.map(|result| result.map(|()| self.items.as_slice()))
    }

    /// How many items the autopilot says that it holds, once it has.
    #[must_use]
    pub const fn count(&self) -> Option<u16> {
        self.count
    }

    /// The id that the autopilot gives the list, 0 where it gives none.
    #[must_use]
    pub const fn opaque_id(&self) -> u32 {
        self.opaque_id
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
            MavMessage::MISSION_COUNT(data)
                if self.count.is_none()
                    && self.talk.is_ours(
                        frame.from,
                        data.target_system,
                        data.target_component,
                        data.mission_type,
                    ) =>
            {
                (self.count, self.opaque_id) = (Some(data.count), data.opaque_id);
                self.advance(now, out);
            }
            MavMessage::MISSION_ITEM_INT(data)
                if self.count.is_some()
                    && usize::from(data.seq) == self.items.len()
                    && self.talk.is_ours(
                        frame.from,
                        data.target_system,
                        data.target_component,
                        data.mission_type,
                    ) =>
            {
                self.items.push(Item::received(data));
                self.advance(now, out);
            }
            MavMessage::MISSION_ACK(data)
                if self.talk.is_ours(frame.from, data.target_system, data.target_component, data.mission_type) =>
            {
                // Acceptances belong to an upload before; refusals are about this question.
                self.result = match data.mavtype {
                    MavMissionResult::MAV_MISSION_ACCEPTED | MavMissionResult::MAV_MISSION_INVALID_SEQUENCE => return,
                    // An item of that upload came twice or late. Where it is meant, nothing else comes.
                    MavMissionResult::MAV_MISSION_ERROR => return,
                    MavMissionResult::MAV_MISSION_OPERATION_CANCELLED => Some(Err(Failure::Cancelled)),
                    result => Some(Err(Failure::Rejected { result, item: None })),
                };
            }
            _ => {}
        }
    }

    /// Asks for the next item, or ends.
    fn advance(&mut self, now: Time, out: &mut Vec<MavMessage>) {
        if let (Some(sent), 1) = (self.sent, self.sends) {
            self.pace.measured(now.since(sent));
        }
        (self.sends, self.sent) = (1, Some(now));
        if self.count.is_some_and(|count| self.items.len() >= usize::from(count)) {
            self.result = Some(Ok(()));
            out.push(MavMessage::MISSION_ACK(MISSION_ACK_DATA {
                target_system: self.talk.vehicle.system,
                target_component: self.talk.vehicle.component,
                mavtype: MavMissionResult::MAV_MISSION_ACCEPTED,
                mission_type: self.talk.list.mission_type(),
                opaque_id: 0,
            }));
            return;
        }
        out.push(self.question());
    }

    fn question(&self) -> MavMessage {
        let (target_system, target_component) = (self.talk.vehicle.system, self.talk.vehicle.component);
        let mission_type = self.talk.list.mission_type();
        if self.count.is_none() {
            let data = MISSION_REQUEST_LIST_DATA { target_system, target_component, mission_type };
            return MavMessage::MISSION_REQUEST_LIST(data);
        }
        let seq = u16::try_from(self.items.len()).unwrap_or(u16::MAX);
        let data = MISSION_REQUEST_INT_DATA { seq, target_system, target_component, mission_type };
        MavMessage::MISSION_REQUEST_INT(data)
    }

    /// Sends what is due.
    pub fn poll(&mut self, now: Time, out: &mut Vec<MavMessage>) {
        if self.result.is_some() || self.sent.is_some_and(|sent| now.since(sent) < self.wait()) {
            return;
        }
        if self.sends >= if self.count.is_none() { STARTS_MAX } else { ASKS_MAX } {
            self.result = Some(Err(Failure::Silent));
            return;
        }
        (self.sends, self.sent) = (self.sends + 1, Some(now));
        out.push(self.question());
    }

    fn wait(&self) -> Duration {
        if self.count.is_some() { self.pace.item() } else { self.pace.answer() }
    }
}
