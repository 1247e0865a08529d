//! Before the flight: lists to the autopilot, and the way to the start.

use std::time::Duration;

use crate::clock::Time;
use crate::file::mission::{Mission, missions};
use crate::frame::{Altitude, Place};
use crate::link::Frame;
use crate::link::dialect::{MavCmd, MavMessage};
use crate::mission::item::{fence_items, mission_items, rally_items};
use crate::mission::{Delivery, Item, List, Watch};
use crate::setpoint::{Sample, Steering, target};
use crate::telemetry::{Airframe, Autopilot, Fix, Flying as InAir, LINK_TIMEOUT, Mode, Vehicle};

use super::settings::FlyMode;
use super::{End, Flight, Level, Phase, schedule};

/// Height above home from which on a vehicle that does not say so counts as flying, m.
const HEIGHT_MIN: f64 = 1.0;
/// How long setpoints are sent before the mode that follows them is asked for.
const STREAM_FIRST: Duration = Duration::from_secs(1);
/// Items at the beginning of a mission that a vehicle in the air has behind it: take-off and the first node.
const BEHIND: usize = 2;
/// How long a vehicle may take to go on at the item that it was told.
const EXPECT_MAX: Duration = Duration::from_secs(3);
/// How long others are listened for before a vehicle is steered: more than two of their heartbeats.
const LISTEN: Duration = Duration::from_millis(2500);
/// Speed below which a vehicle has arrived, m/s.
const SPEED_MAX: f64 = 1.0;

/// For each item of a mission on the wire the node that it flies to.
fn item_nodes(items: &[Item], has_home: bool, first: usize) -> Vec<usize> {
    let mut waypoints = 0;
    let node = |(index, item): (usize, &Item)| {
        let at = first + waypoints;
        if item.command == MavCmd::MAV_CMD_NAV_WAYPOINT && !(has_home && index == 0) {
            waypoints += 1;
        }
        at
    };
    items.iter().enumerate().map(node).collect()
}

impl Flight {
    /// The mission of our agent in the plan that flies.
    pub(super) fn mission_of(&self, plan: &crate::file::PlanFile) -> Result<Mission, String> {
        let all = missions(&self.world, plan).map_err(|error| error.to_string())?;
        all.into_iter().find(|mission| mission.agent == self.agent).ok_or_else(|| "has no such agent".to_owned())
    }

    /// A mission as the autopilot takes it, with the items that switch payloads, and for each item the node that it flies
    /// to. `first` is the node of the first waypoint.
    pub(super) fn wire_mission(
        &self,
        vehicle: &Vehicle,
        mission: &Mission,
        plan: &crate::file::PlanFile,
        first: usize,
    ) -> (Vec<Item>, Vec<usize>) {
        let has_home = vehicle.autopilot == Autopilot::ArduPilot;
        let items = mission_items(vehicle.autopilot, mission);
        let nodes = item_nodes(&items, has_home, first);
        let Some(agent) = plan.agents.iter().find(|agent| agent.name == self.agent) else { return (items, nodes) };
        let payloads = &self.settings.payload;
        let items = schedule::insert(vehicle.autopilot, items, &nodes, payloads, self.radiation, agent);
        let nodes = item_nodes(&items, has_home, first);
        (items, nodes)
    }

    /// The mission of a plan, or the rest of one that a vehicle in the air has begun, with the node that each item flies
    /// to.
    pub(super) fn items_of(
        &self,
        vehicle: &Vehicle,
        plan: &crate::file::PlanFile,
        is_rest: bool,
    ) -> Result<(Vec<Item>, Vec<usize>), String> {
        let mut mission = self.mission_of(plan)?;
        if is_rest {
            mission.items.drain(..BEHIND.min(mission.items.len()));
        }
        Ok(self.wire_mission(vehicle, &mission, plan, usize::from(is_rest)))
    }

    pub(super) fn begin_delivery(&mut self, vehicle: &Vehicle) {
        if self.settings.mode == FlyMode::Guided
            && (vehicle.autopilot, vehicle.airframe) == (Autopilot::ArduPilot, Airframe::Plane)
        {
            let why = "ArduPlane does not follow setpoints along a path: fly it with --mode mission";
            return self.end(End::Failed(why.into()));
        }
        if self.settings.mode == FlyMode::Mission && vehicle.armed && vehicle.mode == Mode::Mission {
            // It would go on in the middle of another mission.
            return self.end(End::Failed("the vehicle flies a mission already: change its mode first".into()));
        }
        if self.settings.mode == FlyMode::Guided && vehicle.armed && vehicle.mode == Mode::Guided {
            return self.end(End::Failed("somebody steers the vehicle already: change its mode first".into()));
        }
        let mission = match self.mission_of(&self.flying.plan) {
            Ok(mission) => mission,
            Err(why) => return self.end(End::Failed(why)),
        };
        let mut waiting = Vec::new();
        if self.settings.mode == FlyMode::Mission {
            let (items, nodes) = self.wire_mission(vehicle, &mission, &self.flying.plan, 0);
            self.flying.nodes = nodes;
            waiting.push((List::Mission, items));
        }
        if self.settings.rally {
            let start = self.frame.place(&self.flying.curve.sample(self.flying.curve.begin()).position);
            waiting.push((List::Rally, rally_items(&[above_home(start, vehicle)])));
        }
        // Without regions there is nothing to say: a fence that somebody else has set stays.
        if self.settings.fence && !mission.fences.is_empty() {
            waiting.push((List::Fence, fence_items(&mission.fences)));
        }
        self.next_delivery(vehicle, waiting);
    }

    fn next_delivery(&mut self, vehicle: &Vehicle, mut waiting: Vec<(List, Vec<Item>)>) {
        let Some((list, items)) = waiting.pop() else {
            self.say(Level::Info, "ready: arm, take off, and it begins");
            self.phase = Phase::Ready;
            return;
        };
        self.update_begun = self.now;
        let talk = self.talk(vehicle.identity, list);
        let delivery = Box::new(Delivery::new(talk, vehicle.autopilot, items, self.pace()));
        self.phase = Phase::Deliver { delivery, waiting };
    }

    pub(super) fn advance_delivery(&mut self, vehicle: &Vehicle) {
        let Phase::Deliver { delivery, waiting } = &mut self.phase else { return };
        let mut out = Vec::new();
        delivery.poll(self.now, &mut out);
        let (list, result, waiting) = (delivery.list(), delivery.result(), waiting.clone());
        let kept = delivery.items().to_vec();
        self.send(out);
        match result {
            None => {}
            Some(Ok(delivered)) => {
                self.say(Level::Info, format!("the autopilot holds the {list}: {} items", delivered.count));
                if list == List::Mission {
                    self.delivery_s = self.now.since(self.update_begun).as_secs_f64();
                    self.watch_over(Watch::new(self.talk(vehicle.identity, list), delivered), kept);
                }
                self.next_delivery(vehicle, waiting);
            }
            Some(Err(failure)) => self.end(End::Failed(format!("the {list} was not delivered: {failure}"))),
        }
    }

    pub(super) fn wait_for_flight(&mut self, vehicle: &Vehicle) {
        if !vehicle.armed || !Self::is_in_the_air(vehicle) {
            return;
        }
        match self.settings.mode {
            FlyMode::Guided if self.now.since(self.company.met) < LISTEN => {}
            FlyMode::Guided => {
                self.say(Level::Info, "in the air: flying to the start");
                self.phase = Phase::Approach { since: self.now };
            }
            FlyMode::Mission if vehicle.mode == Mode::Mission => self.take_off(),
            FlyMode::Mission => {}
        }
    }

    pub(super) fn is_in_the_air(vehicle: &Vehicle) -> bool {
        match vehicle.flying {
            InAir::Air => true,
            InAir::Unknown => vehicle.fix.is_some_and(|fix| fix.above_home_m > HEIGHT_MIN),
            InAir::Ground | InAir::Landing => false,
        }
    }

    /// The plan begins now.
    fn take_off(&mut self) {
        self.say(Level::Info, "flying the plan");
        self.zero = Some(self.now);
        self.flying.made = self.flying.curve.begin();
        self.phase = Phase::Fly;
        self.keep();
    }

    pub(super) fn approach(&mut self, vehicle: &Vehicle, since: Time) {
        if !vehicle.armed {
            return self.end(End::Released("the vehicle was disarmed".into()));
        }
        if self.telemetry.is_lost(self.now) {
            return;
        }
        let start = self.flying.curve.sample(self.flying.curve.begin());
        let start = Sample::rest(&start.position);
        self.steer(vehicle, &start, Steering::To);
        if self.now.since(since) < STREAM_FIRST {
            return;
        }
        self.ask_for(vehicle, Mode::Guided);
        let is_slow = vehicle.fix.is_some_and(|fix| fix.velocity.iter().all(|part| part.abs() < SPEED_MAX));
        if vehicle.mode == Mode::Guided
            && is_slow
            && self.distance_m(vehicle, &start.position) < self.settings.arrival_m
        {
            self.take_off();
        }
    }

    /// Where the vehicle is; `None` where it has not said so for a while.
    fn fresh(&self, vehicle: &Vehicle) -> Option<Fix> {
        vehicle.fix.filter(|fix| self.now.since(fix.heard) <= LINK_TIMEOUT)
    }

    /// Distance from a position, m; infinite where the vehicle does not say where it is.
    pub(super) fn distance_m(&self, vehicle: &Vehicle, position: &[f64]) -> f64 {
        let Some(fix) = self.fresh(vehicle) else { return f64::INFINITY };
        let wanted = self.frame.place(position);
        let Some(at) = self.frame.position(&fix.place) else { return f64::INFINITY };
        let unit = self.frame.unit_m();
        let level = at.iter().zip(position).take(2).map(|(a, b)| ((a - b) * unit).powi(2)).sum::<f64>().sqrt();
        let height = match wanted.altitude {
            Altitude::AboveHome(meters) => fix.above_home_m - meters,
            Altitude::AboveSeaLevel(meters) => fix.place.altitude.meters() - meters,
        };
        level.hypot(height)
    }

    /// A setpoint, when it is time for one.
    pub(super) fn steer(&mut self, vehicle: &Vehicle, sample: &Sample, steering: Steering) {
        if self.setpoint.is_some_and(|sent| self.now.since(sent) < self.settings.setpoint_interval()) {
            return;
        }
        self.setpoint = Some(self.now);
        match target(self.now, vehicle.identity, &self.frame, sample, steering) {
            Some(message) => self.send(vec![message]),
            None => self.say(Level::Warn, "a setpoint was not finite, and was not sent"),
        }
    }

    /// Setpoints to where the vehicle is: for as long as it is asked to leave the mode that needs them.
    pub(super) fn stay(&mut self, vehicle: &Vehicle) {
        if self.settings.mode == FlyMode::Mission {
            return;
        }
        if let Some(position) = self.fresh(vehicle).and_then(|fix| self.frame.position(&fix.place)) {
            self.steer(vehicle, &Sample::rest(&position), Steering::To);
        }
    }

    /// Takes note of where the mission is, and of others who replace it.
    pub(super) fn follow_mission(&mut self, frame: &Frame) {
        let is_vehicle = self.telemetry.vehicle().is_some_and(|vehicle| vehicle.identity == frame.from);
        if is_vehicle && matches!(self.phase, Phase::Fly) {
            match &frame.message {
                MavMessage::MISSION_CURRENT(data) => self.current_is(data.seq),
                // Some say what is flown to now when they next say it, and this at once.
                MavMessage::MISSION_ITEM_REACHED(data) => {
                    let next = data.seq.saturating_add(1);
                    let is_ahead = self.item.is_none_or(|(item, _)| next > item);
                    if is_ahead && self.node_of(next).is_some() {
                        self.current_is(next);
                    }
                }
                _ => {}
            }
        }
        self.watch_mission(frame);
    }

    fn node_of(&self, item: u16) -> Option<usize> {
        self.flying.nodes.get(usize::from(item)).copied()
    }

    /// The vehicle says which item it flies to.
    fn current_is(&mut self, seq: u16) {
        let node = self.node_of(seq);
        if let Some((first, since)) = self.expected {
            // Numbers of the list before are on their way still.
            if node != self.node_of(first) && self.now.since(since) < EXPECT_MAX {
                return;
            }
            self.expected = None;
        }
        let is_same = self.item.is_some_and(|(item, _)| item == seq || self.node_of(item) == node);
        if is_same {
            self.doubt = None;
            self.item = self.item.map(|(_, since)| (seq, since));
            return;
        }
        // Going back is believed when it is said twice: frames overtake each other. And never while a new list is on its
        // way: it may be there already, and begun anew.
        let is_back = self.item.is_some_and(|(item, _)| seq < item);
        if is_back && (self.next.is_some() || self.doubt.replace(seq) != Some(seq)) {
            return;
        }
        self.doubt = None;
        self.item = Some((seq, self.now));
    }
}

/// A place with an altitude above home.
fn above_home(place: Place, vehicle: &Vehicle) -> Place {
    let home = vehicle.fix.map_or(0.0, |fix| fix.place.altitude.meters() - fix.above_home_m);
    let altitude = match place.altitude {
        Altitude::AboveHome(meters) => meters,
        Altitude::AboveSeaLevel(meters) => meters - home,
    };
    Place { altitude: Altitude::AboveHome(altitude), ..place }
}
