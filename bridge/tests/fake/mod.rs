//! A strict stand-in for the mission side of an autopilot, of both kinds, for tests of the machines.
//!
//! | | PX4 | ArduPilot |
//! |---|---|---|
//! | asks with | MISSION_REQUEST_INT | MISSION_REQUEST |
//! | asks again after | 250 ms | 1 s |
//! | gives up after | 5 s | 8 s |
//! | item out of order | asks again | INVALID_SEQUENCE, and goes on |
//! | NaN | takes it | refuses it, and keeps what came before |
//! | item 0 | a waypoint | home, its own |
//! | keeps | everything | altitudes in cm, parameters of waypoints whole |
//! | gives ids | yes | no |

use std::time::Duration;

use quietpath_bridge::clock::Time;
use quietpath_bridge::link::dialect::*;
use quietpath_bridge::link::{Frame, Identity};
use quietpath_bridge::mission::{Item, List, Talk};
use quietpath_bridge::telemetry::Autopilot;

pub const VEHICLE: Identity = Identity { system: 1, component: 1 };

#[derive(Clone, Debug)]
struct Receiving {
    partner: Identity,
    list: usize,
    count: u16,
    items: Vec<Item>,
    heard: Time,
    asked: Time,
}

#[derive(Clone, Debug)]
pub struct FakeVehicle {
    pub kind: Autopilot,
    pub lists: [Vec<Item>; 3],
    pub ids: [u32; 3],
    /// Stores something else than it was sent, at this item.
    pub spoils: Option<usize>,
    receiving: Option<Receiving>,
    /// Partner, list, and items of the last good transfer.
    finished: Option<(Identity, usize, u16)>,
}

fn index(list: MavMissionType) -> Option<usize> {
    List::ALL.iter().position(|known| known.mission_type() == list)
}

impl FakeVehicle {
    pub fn new(kind: Autopilot) -> Self {
        let lists = [Vec::new(), Vec::new(), Vec::new()];
        Self { kind, lists, ids: [0; 3], spoils: None, receiving: None, finished: None }
    }

    fn is_ours(&self, system: u8, component: u8) -> bool {
        system == VEHICLE.system && component == VEHICLE.component
    }

    pub fn handle(&mut self, now: Time, frame: &Frame, out: &mut Vec<MavMessage>) {
        match &frame.message {
            MavMessage::MISSION_COUNT(data) if self.is_ours(data.target_system, data.target_component) => {
                let Some(list) = index(data.mission_type) else { return };
                if self.receiving.as_ref().is_some_and(|receiving| receiving.partner != frame.from) {
                    return out.push(ack(frame.from, list, MavMissionResult::MAV_MISSION_ERROR, 0));
                }
                if data.count > 650 {
                    return out.push(ack(frame.from, list, MavMissionResult::MAV_MISSION_NO_SPACE, 0));
                }
                let is_again = self.receiving.as_ref().is_some_and(|receiving| {
                    receiving.list == list && receiving.count == data.count && receiving.items.is_empty()
                });
                if !is_again {
                    let items = Vec::new();
                    let partner = frame.from;
                    self.receiving =
                        Some(Receiving { partner, list, count: data.count, items, heard: now, asked: now });
                }
                self.ask(now, out);
            }
            MavMessage::MISSION_ITEM_INT(data) if self.is_ours(data.target_system, data.target_component) => {
                self.item(now, frame.from, data, out);
            }
            MavMessage::MISSION_CLEAR_ALL(data) if self.is_ours(data.target_system, data.target_component) => {
                let Some(list) = index(data.mission_type) else { return };
                self.lists[list].clear();
                out.push(ack(frame.from, list, MavMissionResult::MAV_MISSION_ACCEPTED, 0));
            }
            MavMessage::MISSION_REQUEST_LIST(data) if self.is_ours(data.target_system, data.target_component) => {
                let Some(list) = index(data.mission_type) else { return };
                let count = self.lists[list].len() as u16;
                out.push(MavMessage::MISSION_COUNT(MISSION_COUNT_DATA {
                    count,
                    target_system: frame.from.system,
                    target_component: frame.from.component,
                    mission_type: data.mission_type,
                    opaque_id: self.ids[list],
                }));
            }
            MavMessage::MISSION_REQUEST_INT(data) if self.is_ours(data.target_system, data.target_component) => {
                let Some(list) = index(data.mission_type) else { return };
                let talk = Talk { us: VEHICLE, vehicle: frame.from, list: List::ALL[list] };
                match self.lists[list].get(usize::from(data.seq)) {
                    Some(item) => out.push(MavMessage::MISSION_ITEM_INT(item.message(&talk, data.seq))),
                    None => out.push(ack(frame.from, list, MavMissionResult::MAV_MISSION_INVALID_SEQUENCE, 0)),
                }
            }
            MavMessage::MISSION_ACK(data)
                if self.is_ours(data.target_system, data.target_component)
                    && data.mavtype == MavMissionResult::MAV_MISSION_OPERATION_CANCELLED =>
            {
                self.receiving = None;
            }
            _ => {}
        }
    }

    fn item(&mut self, now: Time, from: Identity, data: &MISSION_ITEM_INT_DATA, out: &mut Vec<MavMessage>) {
        let Some(list) = index(data.mission_type) else { return };
        let Some(receiving) = self.receiving.as_mut().filter(|receiving| receiving.partner == from) else {
            match (self.kind, self.finished) {
                (Autopilot::Px4, Some((partner, of, last))) if partner == from && of == list && data.seq == last => {
                    out.push(ack(from, list, MavMissionResult::MAV_MISSION_ACCEPTED, self.ids[list]));
                }
                (Autopilot::Px4, _) => {}
                _ => out.push(ack(from, list, MavMissionResult::MAV_MISSION_ERROR, 0)),
            }
            return;
        };
        receiving.heard = now;
        if usize::from(data.seq) != receiving.items.len() || receiving.list != list {
            if self.kind == Autopilot::ArduPilot {
                out.push(ack(from, list, MavMissionResult::MAV_MISSION_INVALID_SEQUENCE, 0));
            }
            return;
        }
        let item = Item::received(data);
        if self.kind == Autopilot::ArduPilot && item.params.iter().any(|param| param.is_nan()) {
            self.lists[list] = receiving.items.clone();
            self.receiving = None;
            return out.push(ack(from, list, MavMissionResult::MAV_MISSION_INVALID_PARAM4, 0));
        }
        let kept = keep(self.kind, list, receiving.items.len(), item);
        receiving.items.push(kept);
        if receiving.items.len() == usize::from(receiving.count) {
            self.lists[list] = std::mem::take(&mut receiving.items);
            self.ids[list] = if self.kind == Autopilot::Px4 { self.ids[list] + 7 } else { 0 };
            if let Some(item) = self.spoils.take().and_then(|item| self.lists[list].get_mut(item)) {
                item.x += 1000;
            }
            self.finished = Some((from, list, data.seq));
            self.receiving = None;
            return out.push(ack(from, list, MavMissionResult::MAV_MISSION_ACCEPTED, self.ids[list]));
        }
        self.ask(now, out);
    }

    #[expect(deprecated, reason = "ArduPilot asks in the old way")]
    fn ask(&mut self, now: Time, out: &mut Vec<MavMessage>) {
        let Some(receiving) = &mut self.receiving else { return };
        receiving.asked = now;
        let (seq, mission_type) = (receiving.items.len() as u16, List::ALL[receiving.list].mission_type());
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

    pub fn poll(&mut self, now: Time, out: &mut Vec<MavMessage>) {
        let Some(receiving) = &self.receiving else { return };
        let (again, gives_up) = match self.kind {
            Autopilot::Px4 => (Duration::from_millis(250), Duration::from_secs(5)),
            Autopilot::ArduPilot => (Duration::from_secs(1), Duration::from_secs(8)),
        };
        if now.since(receiving.heard) > gives_up {
            let (partner, list) = (receiving.partner, receiving.list);
            self.receiving = None;
            return out.push(ack(partner, list, MavMissionResult::MAV_MISSION_OPERATION_CANCELLED, 0));
        }
        if now.since(receiving.asked) >= again {
            self.ask(now, out);
        }
    }
}

fn keep(kind: Autopilot, list: usize, place: usize, item: Item) -> Item {
    if kind == Autopilot::Px4 {
        return item;
    }
    if list == 0 && place == 0 {
        return Item { x: 123, y: 456, z: 0.0, ..item };
    }
    let z = (item.z * 100.0).trunc() / 100.0;
    let params = if (item.command as u32) < 100 { item.params.map(f32::trunc) } else { item.params };
    Item { params, z, ..item }
}

pub fn ack(to: Identity, list: usize, mavtype: MavMissionResult, opaque_id: u32) -> MavMessage {
    MavMessage::MISSION_ACK(MISSION_ACK_DATA {
        target_system: to.system,
        target_component: to.component,
        mavtype,
        mission_type: List::ALL[list].mission_type(),
        opaque_id,
    })
}
