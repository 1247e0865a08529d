//! Missions, fences and rally points, as strictly as each kind of autopilot keeps them.
//!
//! | | PX4 | ArduPilot |
//! |---|---|---|
//! | asks with | MISSION_REQUEST_INT | MISSION_REQUEST |
//! | asks again after | 250 ms | 1 s |
//! | gives up after | 5 s | 8 s |
//! | item out of order | asks again | INVALID_SEQUENCE, and goes on |
//! | another station in the middle | ERROR | DENIED |
//! | NaN in a parameter | takes it | refuses it |
//! | a refused item | the old list stays | the old list is gone, what came before the item stays |
//! | item 0 of a mission | a waypoint | home, its own |
//! | keeps | everything | altitudes in cm, parameters of waypoints whole |
//! | items | 2000 | 650 |
//! | sets an output by | DO_SET_ACTUATOR (187) | DO_SET_SERVO (183) |
//! | gives ids | yes | no |

use std::time::Duration;

use quietpath_bridge::clock::Time;
use quietpath_bridge::link::dialect::*;
use quietpath_bridge::link::{Frame, Identity};
use quietpath_bridge::mission::{Item, List, Talk};
use quietpath_bridge::telemetry::Autopilot;

use MavMissionResult as R;

/// An upload under way.
#[derive(Clone, Debug)]
struct Receiving {
    partner: Identity,
    list: usize,
    count: u16,
    items: Vec<Item>,
    heard: Time,
    asked: Time,
}

/// The three lists of an autopilot, and the transfers that change them.
#[derive(Clone, Debug)]
pub struct Storage {
    kind: Autopilot,
    us: Identity,
    /// Mission, fence and rally points, in the order of [`List::ALL`].
    pub lists: [Vec<Item>; 3],
    /// The id of each list: changes with it on PX4, 0 on ArduPilot.
    pub ids: [u32; 3],
    /// A fault at will: the next upload stores something else at this item.
    pub spoils: Option<usize>,
    /// Home: what ArduPilot keeps as item 0 of its mission.
    pub home: Item,
    receiving: Option<Receiving>,
    /// Partner, list and last item of the last good upload.
    finished: Option<(Identity, usize, u16)>,
    /// When a message of a transfer came last.
    heard: Time,
}

fn index(list: MavMissionType) -> Option<usize> {
    List::ALL.iter().position(|known| known.mission_type() == list)
}

/// A place to start from where nobody says another.
const NOWHERE: Item = Item {
    command: MavCmd::MAV_CMD_NAV_WAYPOINT,
    frame: MavFrame::MAV_FRAME_GLOBAL,
    params: [0.0; 4],
    x: 123,
    y: 456,
    z: 0.0,
    autocontinue: true,
};

impl Storage {
    /// Empty lists of an autopilot that speaks as `us`.
    #[must_use]
    pub const fn new(kind: Autopilot, us: Identity) -> Self {
        let lists = [Vec::new(), Vec::new(), Vec::new()];
        let (ids, spoils, home) = ([0; 3], None, NOWHERE);
        Self { kind, us, lists, ids, spoils, home, receiving: None, finished: None, heard: Time::ZERO }
    }

    /// The kind of autopilot.
    #[must_use]
    pub const fn kind(&self) -> Autopilot {
        self.kind
    }

    /// Whether an upload is under way.
    #[must_use]
    pub const fn is_receiving(&self) -> bool {
        self.receiving.is_some()
    }

    /// When a message of a transfer came last.
    #[must_use]
    pub const fn heard(&self) -> Time {
        self.heard
    }

    /// Largest number of items in a list.
    const fn items_max(&self) -> u16 {
        match self.kind {
            Autopilot::Px4 => 2000,
            Autopilot::ArduPilot => 650,
        }
    }

    /// Forgets transfers under way: the lists stay, as they do over a restart.
    pub fn restart(&mut self) {
        (self.receiving, self.finished) = (None, None);
    }

    /// Takes a message; true where a list changed.
    pub fn handle(&mut self, now: Time, frame: &Frame, out: &mut Vec<MavMessage>) -> bool {
        let Some((system, component, list)) = address(&frame.message) else { return false };
        if system != self.us.system || (component != self.us.component && component != 0) {
            return false;
        }
        self.heard = now;
        if let MavMessage::MISSION_CLEAR_ALL(_) = &frame.message {
            return self.clear(frame.from, list, out);
        }
        let Some(list) = index(list) else {
            out.push(ack(frame.from, list, R::MAV_MISSION_UNSUPPORTED, 0));
            return false;
        };
        match &frame.message {
            MavMessage::MISSION_COUNT(data) => return self.count(now, frame.from, list, data.count, out),
            MavMessage::MISSION_ITEM_INT(data) => return self.item(now, frame.from, list, data, out),
            MavMessage::MISSION_REQUEST_LIST(data) => {
                out.push(MavMessage::MISSION_COUNT(MISSION_COUNT_DATA {
                    count: u16::try_from(self.lists[list].len()).unwrap_or(u16::MAX),
                    target_system: frame.from.system,
                    target_component: frame.from.component,
                    mission_type: data.mission_type,
                    opaque_id: self.ids[list],
                }));
            }
            MavMessage::MISSION_REQUEST_INT(data) => {
                let talk = Talk { us: self.us, vehicle: frame.from, list: List::ALL[list] };
                out.push(match self.lists[list].get(usize::from(data.seq)) {
                    Some(item) => MavMessage::MISSION_ITEM_INT(item.message(&talk, data.seq)),
                    None => ack(frame.from, data.mission_type, R::MAV_MISSION_INVALID_SEQUENCE, 0),
                });
            }
            MavMessage::MISSION_ACK(data) if data.mavtype == R::MAV_MISSION_OPERATION_CANCELLED => {
                self.receiving = None;
            }
            _ => {}
        }
        false
    }

    fn clear(&mut self, from: Identity, list: MavMissionType, out: &mut Vec<MavMessage>) -> bool {
        let lists = if list == MavMissionType::MAV_MISSION_TYPE_ALL {
            vec![0, 1, 2]
        } else {
            index(list).into_iter().collect()
        };
        for list in &lists {
            self.lists[*list].clear();
            self.renumber(*list);
        }
        let result = if lists.is_empty() { R::MAV_MISSION_UNSUPPORTED } else { R::MAV_MISSION_ACCEPTED };
        out.push(ack(from, list, result, 0));
        !lists.is_empty()
    }

    fn renumber(&mut self, list: usize) {
        if self.kind == Autopilot::Px4 {
            self.ids[list] += 7;
        }
    }

    fn count(&mut self, now: Time, from: Identity, list: usize, count: u16, out: &mut Vec<MavMessage>) -> bool {
        let mission_type = List::ALL[list].mission_type();
        if self.receiving.as_ref().is_some_and(|receiving| receiving.partner != from) {
            let busy = match self.kind {
                Autopilot::Px4 => R::MAV_MISSION_ERROR,
                Autopilot::ArduPilot => R::MAV_MISSION_DENIED,
            };
            out.push(ack(from, mission_type, busy, 0));
            return false;
        }
        if count > self.items_max() {
            out.push(ack(from, mission_type, R::MAV_MISSION_NO_SPACE, 0));
            return false;
        }
        if count == 0 {
            self.receiving = None;
            return self.clear(from, mission_type, out);
        }
        let is_again = self.receiving.as_ref().is_some_and(|receiving| {
            receiving.list == list && receiving.count == count && receiving.items.is_empty()
        });
        if !is_again {
            self.receiving =
                Some(Receiving { partner: from, list, count, items: Vec::new(), heard: now, asked: now });
        }
        self.ask(now, out);
        false
    }

    fn item(
        &mut self,
        now: Time,
        from: Identity,
        list: usize,
        data: &MISSION_ITEM_INT_DATA,
        out: &mut Vec<MavMessage>,
    ) -> bool {
        let Some(receiving) = self.receiving.as_mut().filter(|receiving| receiving.partner == from) else {
            match (self.kind, self.finished) {
                (Autopilot::Px4, Some(last)) if last == (from, list, data.seq) => {
                    out.push(ack(from, data.mission_type, R::MAV_MISSION_ACCEPTED, self.ids[list]));
                }
                (Autopilot::Px4, _) => {}
                _ => out.push(ack(from, data.mission_type, R::MAV_MISSION_ERROR, 0)),
            }
            return false;
        };
        receiving.heard = now;
        if usize::from(data.seq) != receiving.items.len() || receiving.list != list {
            if self.kind == Autopilot::ArduPilot {
                out.push(ack(from, data.mission_type, R::MAV_MISSION_INVALID_SEQUENCE, 0));
            }
            return false;
        }
        let item = Item::received(data);
        if let Some(why) = refusal(self.kind, List::ALL[list], &item) {
            let came = std::mem::take(&mut receiving.items);
            self.receiving = None;
            out.push(ack(from, data.mission_type, why, 0));
            if self.kind == Autopilot::ArduPilot {
                self.lists[list] = came;
            }
            return self.kind == Autopilot::ArduPilot;
        }
        let kept = match (self.kind, List::ALL[list], data.seq) {
            (Autopilot::Px4, ..) => item,
            (Autopilot::ArduPilot, List::Mission, 0) => self.home,
            (Autopilot::ArduPilot, ..) => rounded(item),
        };
        receiving.items.push(kept);
        if receiving.items.len() < usize::from(receiving.count) {
            self.ask(now, out);
            return false;
        }
        self.lists[list] = std::mem::take(&mut receiving.items);
        self.renumber(list);
        if let Some(item) = self.spoils.take().and_then(|item| self.lists[list].get_mut(item)) {
            item.x += 1000;
        }
        (self.finished, self.receiving) = (Some((from, list, data.seq)), None);
        out.push(ack(from, data.mission_type, R::MAV_MISSION_ACCEPTED, self.ids[list]));
        true
    }

    #[expect(deprecated, reason = "ArduPilot asks in the old way")]
    fn ask(&mut self, now: Time, out: &mut Vec<MavMessage>) {
        let Some(receiving) = &mut self.receiving else { return };
        receiving.asked = now;
        let seq = u16::try_from(receiving.items.len()).unwrap_or(u16::MAX);
        let mission_type = List::ALL[receiving.list].mission_type();
        let Identity { system: target_system, component: target_component } = receiving.partner;
        out.push(match self.kind {
            Autopilot::Px4 => MavMessage::MISSION_REQUEST_INT(MISSION_REQUEST_INT_DATA {
                seq,
                target_system,
                target_component,
                mission_type,
            }),
            Autopilot::ArduPilot => MavMessage::MISSION_REQUEST(MISSION_REQUEST_DATA {
                seq,
                target_system,
                target_component,
                mission_type,
            }),
        });
    }

    /// Asks again, or gives up, when it is time.
    pub fn poll(&mut self, now: Time, out: &mut Vec<MavMessage>) {
        let Some(receiving) = &self.receiving else { return };
        let (again, gives_up) = match self.kind {
            Autopilot::Px4 => (Duration::from_millis(250), Duration::from_secs(5)),
            Autopilot::ArduPilot => (Duration::from_secs(1), Duration::from_secs(8)),
        };
        if now.since(receiving.heard) > gives_up {
            let (partner, list) = (receiving.partner, List::ALL[receiving.list].mission_type());
            self.receiving = None;
            return out.push(ack(partner, list, R::MAV_MISSION_OPERATION_CANCELLED, 0));
        }
        if now.since(receiving.asked) >= again {
            self.ask(now, out);
        }
    }
}

/// Target and list of a message of the mission protocol.
const fn address(message: &MavMessage) -> Option<(u8, u8, MavMissionType)> {
    match message {
        MavMessage::MISSION_COUNT(data) => Some((data.target_system, data.target_component, data.mission_type)),
        MavMessage::MISSION_ITEM_INT(data) => Some((data.target_system, data.target_component, data.mission_type)),
        MavMessage::MISSION_CLEAR_ALL(data) => Some((data.target_system, data.target_component, data.mission_type)),
        MavMessage::MISSION_REQUEST_LIST(data) => {
            Some((data.target_system, data.target_component, data.mission_type))
        }
        MavMessage::MISSION_REQUEST_INT(data) => Some((data.target_system, data.target_component, data.mission_type)),
        MavMessage::MISSION_ACK(data) => Some((data.target_system, data.target_component, data.mission_type)),
        _ => None,
    }
}

/// Why an autopilot does not take an item; `None` where it does.
#[expect(deprecated, reason = "autopilots take these names too")]
fn refusal(kind: Autopilot, list: List, item: &Item) -> Option<R> {
    let command = item.command as u32;
    let is_place = match list {
        List::Mission => match item.command {
            MavCmd::MAV_CMD_NAV_WAYPOINT
            | MavCmd::MAV_CMD_NAV_LOITER_UNLIM
            | MavCmd::MAV_CMD_NAV_LOITER_TIME
            | MavCmd::MAV_CMD_NAV_LAND
            | MavCmd::MAV_CMD_NAV_TAKEOFF => true,
            MavCmd::MAV_CMD_NAV_RETURN_TO_LAUNCH | MavCmd::MAV_CMD_DO_CHANGE_SPEED => false,
            MavCmd::MAV_CMD_DO_SET_SERVO if kind == Autopilot::ArduPilot => false,
            MavCmd::MAV_CMD_DO_SET_ACTUATOR if kind == Autopilot::Px4 => false,
            _ => return Some(R::MAV_MISSION_UNSUPPORTED),
        },
        List::Fence if (5001..=5004).contains(&command) => true,
        List::Rally if command == 5100 => true,
        List::Fence | List::Rally => return Some(R::MAV_MISSION_UNSUPPORTED),
    };
    let is_global = matches!(
        item.frame,
        MavFrame::MAV_FRAME_GLOBAL
            | MavFrame::MAV_FRAME_GLOBAL_INT
            | MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT
            | MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT_INT
    );
    if is_place && !is_global {
        return Some(R::MAV_MISSION_UNSUPPORTED_FRAME);
    }
    if is_place && (item.x.unsigned_abs() > 900_000_000 || item.y.unsigned_abs() > 1_800_000_000) {
        return Some(R::MAV_MISSION_INVALID_PARAM5_X);
    }
    let names = [
        R::MAV_MISSION_INVALID_PARAM1,
        R::MAV_MISSION_INVALID_PARAM2,
        R::MAV_MISSION_INVALID_PARAM3,
        R::MAV_MISSION_INVALID_PARAM4,
    ];
    if kind == Autopilot::ArduPilot {
        if item.z.is_nan() {
            return Some(R::MAV_MISSION_INVALID_PARAM7);
        }
        return item.params.iter().zip(names).find(|(param, _)| param.is_nan()).map(|(_, name)| name);
    }
    None
}

/// What ArduPilot keeps of an item.
fn rounded(item: Item) -> Item {
    let z = (item.z * 100.0).trunc() / 100.0;
    let params = if (item.command as u32) < 100 { item.params.map(f32::trunc) } else { item.params };
    Item { params, z, ..item }
}

/// MISSION_ACK.
#[must_use]
pub const fn ack(to: Identity, mission_type: MavMissionType, mavtype: R, opaque_id: u32) -> MavMessage {
    let Identity { system: target_system, component: target_component } = to;
    MavMessage::MISSION_ACK(MISSION_ACK_DATA { target_system, target_component, mavtype, mission_type, opaque_id })
}
