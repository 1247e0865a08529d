//! A simulated autopilot: a MAVLink peer that flies.
//!
//! [`Machine`] has no input or output, and no clock: [`Machine::receive`] takes a message with its time, [`Machine::tick`] lets
//! time pass and gives what is to be sent. It is as strict as PX4 and ArduPilot are where the bridge has to know
//! it; what it does not have is what the bridge never touches.
//!
//! | module | what |
//! |---|---|
//! | [`body`] | how it moves |
//! | `command` | commands and their answers |
//! | `flight` | its modes, and the steps of its body |
//! | `guided` | setpoints |
//! | `mission` | missions in the air |
//! | `param` | parameters |
//! | [`payload`] | transmitters and jammers on board |
//! | `say`, `stream` | what it says, and how often |
//! | [`serve`] | a machine on a real link |
//! | `settings` | what to simulate |
//! | [`storage`] | missions, fences and rally points, and the transfers that change them |
//! | [`trouble`] | what goes wrong on purpose |
//!
//! Nobody arms or takes off by MAVLink unless it is told to: [`Pilot`] is the person who does.
//!
//! Limits: a multicopter; a point mass without wind or noise; flat ground; no battery, no radio control, no
//! pre-flight checks, no breach of a fence. Time is stepped by [`STEP`], whenever [`Machine::tick`] is called.

pub mod body;
mod command;
mod flight;
mod guided;
mod mission;
mod param;
pub mod payload;
mod say;
pub mod serve;
mod settings;
pub mod storage;
mod stream;
pub mod trouble;

use std::collections::BTreeMap;
use std::time::Duration;

use quietpath_bridge::clock::Time;
use quietpath_bridge::file::scenario::Origin;
use quietpath_bridge::frame::{LocalFrame, Place};
use quietpath_bridge::link::codec::plain_bytes;
use quietpath_bridge::link::dialect::*;
use quietpath_bridge::link::{Frame, Identity};
use quietpath_bridge::mission::{Item, List};
use quietpath_bridge::telemetry::{Autopilot, Mode};

pub use flight::STEP;
pub use settings::{Home, Pilot, Settings};

use body::{Body, Vector};
use guided::{Guided, Taken};
use mission::Run;
use param::Params;
use payload::Payload;
use storage::Storage;
use stream::Streams;
use trouble::{Rival, Station};

/// Time between heartbeats.
const HEARTBEAT: Duration = Duration::from_secs(1);

/// Whether it flies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Landed {
    /// It stands.
    Ground,
    /// It takes off.
    Rising,
    /// It flies.
    Air,
    /// It lands.
    Landing,
}

/// A message on its way out.
#[derive(Clone, Debug, PartialEq)]
pub struct Sent {
    /// Who says it: the autopilot or one of its payloads.
    pub from: Identity,
    /// What.
    pub message: MavMessage,
}

impl Sent {
    /// The frame: by `encode` where the vehicle `us` says it, unsigned where another system does.
    pub fn bytes(&self, us: Identity, encode: impl FnOnce(u8, &MavMessage) -> Vec<u8>) -> Vec<u8> {
        if self.from.system == us.system {
            encode(self.from.component, &self.message)
        } else {
            plain_bytes(self.from, &self.message)
        }
    }
}

/// A simulated autopilot. See the [module](self).
pub struct Machine {
    settings: Settings,
    us: Identity,
    frame: LocalFrame,
    now: Time,
    boot: Time,
    stepped: Option<Time>,
    body: Body,
    armed: bool,
    mode: Mode,
    landed: Landed,
    /// Where it stays when nobody says where to go.
    hold: Vector,
    /// A take-off under way: height, m, and the mode after it.
    lifting: Option<(f64, Mode)>,
    storage: Storage,
    run: Run,
    guided: Guided,
    streams: Streams,
    params: Params,
    payloads: Vec<Payload>,
    outputs: BTreeMap<u8, f32>,
    heartbeat: Option<Time>,
    heartbeats: u64,
    pilot_since: Option<Time>,
    down: Option<Time>,
    killed: Option<String>,
    stations: Vec<Station>,
    rivals: Vec<Rival>,
    /// What others said to everybody since the last tick.
    passed_on: Vec<(Identity, MavMessage)>,
    out: Vec<Sent>,
}

impl Machine {
    /// A vehicle that was just switched on.
    #[must_use]
    pub fn new(settings: Settings) -> Self {
        let us = Identity { system: settings.system, component: 1 };
        let Home { latitude_deg, longitude_deg, altitude_m } = settings.home;
        let frame = LocalFrame::around(Origin { latitude_deg, longitude_deg, altitude_m }, 1.0, 3);
        let mut storage = Storage::new(settings.like, us);
        let wire = quietpath_bridge::mission::item::wire_degrees;
        (storage.home.x, storage.home.y) = (wire(latitude_deg), wire(longitude_deg));
        storage.home.z = altitude_m as f32;
        Self {
            us,
            frame,
            now: Time::ZERO,
            boot: Time::ZERO,
            stepped: None,
            body: Body::default(),
            armed: false,
            mode: Mode::Hold,
            landed: Landed::Ground,
            hold: [0.0; 3],
            lifting: None,
            storage,
            run: Run::new(),
            guided: Guided::default(),
            streams: Streams::default(),
            params: Params::new(settings.like, settings.system, settings.limits.speed_max),
            payloads: settings.payloads.iter().map(|spec| Payload::new(*spec)).collect(),
            outputs: BTreeMap::new(),
            heartbeat: None,
            heartbeats: 0,
            pilot_since: None,
            down: None,
            killed: None,
            stations: Vec::new(),
            rivals: Vec::new(),
            passed_on: Vec::new(),
            out: Vec::new(),
            settings,
        }
    }

    /// Takes a message of the link.
    pub fn receive(&mut self, now: Time, frame: &Frame) {
        self.now = self.now.max(now);
        if self.is_deaf() {
            return;
        }
        self.hear(frame);
    }

    fn hear(&mut self, frame: &Frame) {
        let mut out = Vec::new();
        if !self.rivals.is_empty() && matches!(frame.message, MavMessage::HEARTBEAT(_)) {
            self.passed_on.push((frame.from, frame.message.clone()));
        }
        if self.storage.handle(self.now, frame, &mut out) {
            self.run.replaced(self.settings.like);
        }
        let us = self.us;
        let is_ours = |system, component| system == us.system && (component == us.component || component == 0);
        if let Some((system, component, seq)) = current_asked(&frame.message)
            && is_ours(system, component)
        {
            self.set_current(seq);
        }
        match &frame.message {
            message @ (MavMessage::COMMAND_LONG(_) | MavMessage::COMMAND_INT(_)) => self.command(frame.from, message),
            MavMessage::SET_POSITION_TARGET_GLOBAL_INT(data)
                if is_ours(data.target_system, data.target_component) =>
            {
                let (kind, home) = (self.settings.like, self.settings.home.altitude_m);
                if let Taken::Kills(why) = self.guided.take(self.now, kind, &self.frame, home, data) {
                    self.killed = Some(why);
                }
            }
            MavMessage::TIMESYNC(data) if data.tc1 == 0 => {
                let tc1 = i64::try_from(self.now.since(self.boot).as_nanos()).unwrap_or(i64::MAX).max(1);
                out.push(MavMessage::TIMESYNC(TIMESYNC_DATA { tc1, ts1: data.ts1, ..Default::default() }));
            }
            MavMessage::PARAM_REQUEST_READ(data) if is_ours(data.target_system, data.target_component) => {
                self.params.handle(&frame.message, &mut out);
            }
            MavMessage::PARAM_REQUEST_LIST(data) if is_ours(data.target_system, data.target_component) => {
                self.params.handle(&frame.message, &mut out);
            }
            MavMessage::PARAM_SET(data) if is_ours(data.target_system, data.target_component) => {
                self.params.handle(&frame.message, &mut out);
            }
            _ => {}
        }
        out.into_iter().for_each(|message| self.say(message));
    }

    /// Lets time pass up to now; what is to be sent, answers to what was received among it.
    pub fn tick(&mut self, now: Time) -> Vec<Sent> {
        self.now = self.now.max(now);
        self.suffer();
        self.move_on();
        // Payloads are boxes of their own: they notice that nobody speaks to them.
        self.payloads.iter_mut().for_each(|payload| payload.expire(self.now));
        if self.down.is_some() || self.killed.is_some() {
            self.out.clear();
            return Vec::new();
        }
        self.fly_by_hand();
        let mut out = Vec::new();
        self.storage.poll(self.now, &mut out);
        out.into_iter().for_each(|message| self.say(message));
        if self.heartbeat.is_none_or(|sent| self.now.since(sent) >= HEARTBEAT) {
            self.heartbeat = Some(self.now);
            // ArduPilot's first heartbeat comes before it knows its component.
            let is_first = self.heartbeats == 0;
            self.heartbeats += 1;
            let component = u8::from(!(is_first && self.settings.like == Autopilot::ArduPilot));
            self.say_as(Identity { component, ..self.us }, self.heartbeat());
        }
        for id in self.streams.due(self.now) {
            self.say_once(id);
        }
        let boot_ms = self.boot_ms();
        let mut payloads = std::mem::take(&mut self.payloads);
        for payload in &mut payloads {
            let mut out = Vec::new();
            payload.poll(self.now, boot_ms, &mut out);
            let from = payload.identity(self.us.system);
            out.into_iter().for_each(|message| self.say_as(from, message));
        }
        self.payloads = payloads;
        self.talk_to_stations();
        self.talk_to_rivals();
        let mut sent = std::mem::take(&mut self.out);
        self.distort(&mut sent);
        if self.is_deaf() { Vec::new() } else { sent }
    }

    fn say(&mut self, message: MavMessage) {
        self.say_as(self.us, message);
    }

    fn say_as(&mut self, from: Identity, message: MavMessage) {
        self.out.push(Sent { from, message });
    }

    /// What it is.
    #[must_use]
    pub const fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Who it is.
    #[must_use]
    pub const fn identity(&self) -> Identity {
        self.us
    }

    /// Position east, north and up of home, m, and velocity, m/s.
    #[must_use]
    pub const fn body(&self) -> &Body {
        &self.body
    }

    /// Where it is; altitude above the sea.
    #[must_use]
    pub fn place(&self) -> Place {
        self.frame.place(&self.body.position)
    }

    /// Whether its motors may turn.
    #[must_use]
    pub const fn is_armed(&self) -> bool {
        self.armed
    }

    /// Its mode; [`Mode::Other`] while a person takes off.
    #[must_use]
    pub const fn mode(&self) -> Mode {
        match self.lifting {
            Some((_, Mode::Guided)) | None => self.mode,
            Some(_) => Mode::Other,
        }
    }

    /// Whether it flies.
    #[must_use]
    pub const fn landed(&self) -> Landed {
        self.landed
    }

    /// What it holds.
    #[must_use]
    pub fn list(&self, list: List) -> &[Item] {
        let [mission, fence, rally] = &self.storage.lists;
        match list {
            List::Mission => mission,
            List::Fence => fence,
            List::Rally => rally,
        }
    }

    /// Its lists, to put something there or to spoil an upload.
    pub const fn storage_mut(&mut self) -> &mut Storage {
        &mut self.storage
    }

    /// The item of the mission that it flies to, or would.
    #[must_use]
    pub fn current(&self) -> u16 {
        self.run.current()
    }

    /// Whether the mission has come to its end.
    #[must_use]
    pub const fn is_mission_done(&self) -> bool {
        self.run.is_done()
    }

    /// A payload, by its component.
    #[must_use]
    pub fn payload(&self, component: u8) -> Option<&Payload> {
        self.payloads.iter().find(|payload| payload.spec().component == component)
    }

    /// The value of an output that was set by a mission or a command.
    #[must_use]
    pub fn output(&self, number: u8) -> Option<f32> {
        self.outputs.get(&number).copied()
    }

    /// A parameter's value.
    #[must_use]
    pub fn param(&self, name: &str) -> Option<f64> {
        self.params.number(name)
    }

    /// Setpoints that it took, and when the last one came.
    #[must_use]
    pub const fn setpoints(&self) -> (u64, Option<Time>) {
        (self.guided.count(), self.guided.heard())
    }

    /// Why the autopilot's process is gone; `None` while it runs.
    #[must_use]
    pub fn killed(&self) -> Option<&str> {
        self.killed.as_deref()
    }
}

/// Target and item of MISSION_SET_CURRENT.
#[expect(deprecated, reason = "ground stations still say so")]
const fn current_asked(message: &MavMessage) -> Option<(u8, u8, u16)> {
    match message {
        MavMessage::MISSION_SET_CURRENT(data) => Some((data.target_system, data.target_component, data.seq)),
        _ => None,
    }
}
