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
//! | `guided` | setpoints |
//! | `mission` | missions in the air |
//! | `param` | parameters |
//! | [`payload`] | transmitters and jammers on board |
//! | `say`, `stream` | what it says, and how often |
//! | [`serve`] | a machine on a real link |
//! | [`storage`] | missions, fences and rally points, and the transfers that change them |
//! | [`trouble`] | what goes wrong on purpose |
//!
//! Nobody arms or takes off by MAVLink unless it is told to: [`Pilot`] is the person who does.
//!
//! Limits: a multicopter; a point mass without wind or noise; flat ground; no battery, no radio control, no
//! pre-flight checks, no breach of a fence. Time is stepped by [`STEP`], whenever [`Machine::tick`] is called.

pub mod body;
mod command;
mod guided;
mod mission;
mod param;
pub mod payload;
mod say;
pub mod serve;
pub mod storage;
mod stream;
pub mod trouble;

use std::collections::BTreeMap;
use std::time::Duration;

use quietpath_bridge::clock::Time;
use quietpath_bridge::file::ScenarioFile;
use quietpath_bridge::file::scenario::{AgentEntry, Origin};
use quietpath_bridge::frame::{Altitude, LocalFrame, Place};
use quietpath_bridge::link::codec::plain_bytes;
use quietpath_bridge::link::dialect::*;
use quietpath_bridge::link::{Frame, Identity};
use quietpath_bridge::mission::{Item, List};
use quietpath_bridge::telemetry::{Autopilot, Mode};

use body::{Aim, Body, Limits, Vector};
use guided::{Guided, Taken};
use mission::{Event, Run, Surroundings};
use param::Params;
use payload::{Payload, Spec};
use storage::Storage;
use stream::Streams;
use trouble::{Rival, Station, Trouble};

/// Step of the body.
pub const STEP: Duration = Duration::from_millis(20);
/// Time between heartbeats.
const HEARTBEAT: Duration = Duration::from_secs(1);
/// Longest time that is made up for in one go.
const CATCH_UP_MAX: Duration = Duration::from_secs(10);
/// How fast it descends to land, m/s.
const DESCENT: f64 = 1.0;
/// How near a height, or home, is reached, m.
const NEAR: f64 = 0.5;
/// Speed of a vehicle over that of its plans.
const SPEED_RESERVE: f64 = 1.05;
/// Acceleration of a vehicle over that of its plans.
const ACCEL_RESERVE: f64 = 2.0;
/// Least acceleration of a vehicle, m/s^2.
const ACCEL_MIN: f64 = 1.0;
/// How long a pilot waits before doing something.
const PATIENCE: Duration = Duration::from_secs(3);

/// Where the vehicle stands when it is switched on, and what it counts altitudes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Home {
    /// Latitude, WGS-84 degrees.
    pub latitude_deg: f64,
    /// Longitude, WGS-84 degrees.
    pub longitude_deg: f64,
    /// Altitude above mean sea level, m.
    pub altitude_m: f64,
}

/// The person with the remote control.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Pilot {
    /// Nobody: the vehicle stands on the ground until MAVLink, or a caller, moves it.
    #[default]
    Nobody,
    /// Arms, takes off to a height above home, m, and leaves the vehicle there.
    TakesOff(f64),
    /// Waits for a mission, arms and starts it.
    StartsMission,
}

/// What to simulate.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Which autopilot it is like.
    pub like: Autopilot,
    /// Its system id.
    pub system: u8,
    /// Where it stands.
    pub home: Home,
    /// What it is capable of.
    pub limits: Limits,
    /// What is on board.
    pub payloads: Vec<Spec>,
    /// Who flies it.
    pub pilot: Pilot,
    /// What goes wrong.
    pub troubles: Vec<Trouble>,
    /// Commands that it takes in COMMAND_INT only, on top of its kind's.
    pub int_only: Vec<MavCmd>,
    /// Commands that it takes in COMMAND_LONG only, on top of its kind's.
    pub long_only: Vec<MavCmd>,
}

impl Settings {
    /// A vehicle for an agent of a scenario: it stands on the ground below the agent's start, and its speed and acceleration
    /// leave a little for catching up. `None` where the scenario says neither where it lies nor of such an agent.
    #[must_use]
    pub fn for_agent(like: Autopilot, scenario: &ScenarioFile, agent: Option<&str>) -> Option<Self> {
        let is_it = |entry: &&AgentEntry| agent.is_none_or(|name| entry.name == name);
        let entry = scenario.agents.iter().find(is_it)?;
        let start = LocalFrame::of(scenario)?.place(&entry.start);
        let altitude_m = if scenario.dimension == 3 { scenario.frame.origin?.altitude_m } else { 0.0 };
        let Place { latitude_deg, longitude_deg, .. } = start;
        let unit = scenario.frame.unit_m;
        let limits = Limits {
            speed_max: SPEED_RESERVE * entry.speed_max * unit,
            accel_max: (ACCEL_RESERVE * entry.accel_max * unit).max(ACCEL_MIN),
            ..Limits::default()
        };
        Some(Self { limits, ..Self::new(like, Home { latitude_deg, longitude_deg, altitude_m }) })
    }

    /// The height above home of an agent's start, m: where a pilot takes off to.
    #[must_use]
    pub fn start_height(&self, scenario: &ScenarioFile, agent: Option<&str>) -> Option<f64> {
        let entry = scenario.agents.iter().find(|entry| agent.is_none_or(|name| entry.name == name))?;
        Some(match LocalFrame::of(scenario)?.place(&entry.start).altitude {
            Altitude::AboveHome(meters) => meters,
            Altitude::AboveSeaLevel(meters) => meters - self.home.altitude_m,
        })
    }

    /// A vehicle like one of a kind, at home, without payloads, pilot or trouble.
    #[must_use]
    pub fn new(like: Autopilot, home: Home) -> Self {
        let (payloads, troubles, int_only, long_only) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let (limits, pilot) = (Limits::default(), Pilot::Nobody);
        Self { like, system: 1, home, limits, payloads, pilot, troubles, int_only, long_only }
    }
}

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

    /// Moves the body up to now.
    fn move_on(&mut self) {
        let mut at = self.stepped.unwrap_or(self.now);
        if self.now.since(at) > CATCH_UP_MAX {
            at = Time::from_micros(self.now.micros().saturating_sub(CATCH_UP_MAX.as_micros() as u64));
        }
        while self.now.since(at) >= STEP {
            at = at + STEP;
            self.step(at);
        }
        self.stepped = Some(at);
    }

    fn step(&mut self, at: Time) {
        let aim = self.aim(at);
        // On the ground nothing moves that does not take off.
        if self.landed == Landed::Ground {
            (self.body.velocity, self.hold) = ([0.0; 3], self.body.position);
            return;
        }
        let mut limits = self.settings.limits;
        if let Some(speed) = self.speed_max() {
            limits.speed_max = limits.speed_max.min(speed);
        }
        self.body.step(STEP.as_secs_f64(), &aim, &limits);
        let height = self.body.position[2];
        match self.landed {
            Landed::Rising if self.lifting.is_none() && height > NEAR => self.landed = Landed::Air,
            Landed::Landing if height <= 0.0 => {
                self.landed = Landed::Ground;
                self.disarm();
            }
            _ => {}
        }
        if let Some((target, after)) = self.lifting
            && height > target - NEAR
        {
            self.lifting = None;
            self.landed = Landed::Air;
            self.hold = [self.hold[0], self.hold[1], target];
            self.mode = after;
        }
    }

    /// The largest speed that the parameters allow, m/s.
    fn speed_max(&self) -> Option<f64> {
        match self.settings.like {
            Autopilot::Px4 => self.params.number("MPC_XY_VEL_MAX"),
            Autopilot::ArduPilot => self.params.number("WPNAV_SPEED").map(|speed| speed / 100.0),
        }
    }

    fn seconds(&self, name: &str) -> Duration {
        Duration::try_from_secs_f64(self.params.number(name).unwrap_or(1.0)).unwrap_or_default()
    }

    /// What the body is steered by at a time.
    fn aim(&mut self, at: Time) -> Aim {
        if self.down.is_some() || self.killed.is_some() {
            return Aim::Nothing;
        }
        if let Some((height, _)) = self.lifting {
            return Aim::Rest([self.hold[0], self.hold[1], height]);
        }
        match self.mode {
            Mode::Guided => self.aim_guided(at),
            Mode::Mission => self.aim_mission(at),
            Mode::Return => {
                let [east, north, height] = self.body.position;
                if east.hypot(north) < NEAR {
                    self.change_mode(Mode::Land);
                }
                Aim::Rest([0.0, 0.0, height.max(self.hold[2])])
            }
            Mode::Land => {
                if self.landed == Landed::Air || self.landed == Landed::Rising {
                    self.landed = Landed::Landing;
                }
                Aim::Velocity([0.0, 0.0, -DESCENT])
            }
            Mode::Hold | Mode::Other => Aim::Rest(self.hold),
        }
    }

    fn aim_guided(&mut self, at: Time) -> Aim {
        let kind = self.settings.like;
        if kind == Autopilot::Px4 && self.guided.has_ended(at, self.seconds("COM_OF_LOSS_T")) {
            self.change_mode(Mode::Hold);
            return Aim::Rest(self.hold);
        }
        if kind == Autopilot::Px4 && self.armed && self.landed == Landed::Ground {
            self.landed = Landed::Rising;
        }
        let timeout = if kind == Autopilot::ArduPilot { self.seconds("GUID_TIMEOUT") } else { Duration::MAX };
        self.guided.aim(at, kind, timeout).unwrap_or(Aim::Rest(self.hold))
    }

    fn aim_mission(&mut self, at: Time) -> Aim {
        let acceptance = match self.settings.like {
            Autopilot::Px4 => self.params.number("NAV_ACC_RAD"),
            Autopilot::ArduPilot => self.params.number("WPNAV_RADIUS").map(|radius| radius / 100.0),
        };
        let around = Surroundings {
            kind: self.settings.like,
            items: &self.storage.lists[0],
            frame: &self.frame,
            home_altitude: self.settings.home.altitude_m,
            acceptance: acceptance.unwrap_or(2.0),
        };
        let mut events = Vec::new();
        let aim = self.run.fly(at, &self.body, &around, &mut events);
        if self.armed && self.landed == Landed::Ground && matches!(aim, Aim::Leg { .. }) {
            self.landed = Landed::Rising;
        }
        let is_news = !events.is_empty();
        for event in events {
            match event {
                Event::Reached(seq) => {
                    self.say(MavMessage::MISSION_ITEM_REACHED(MISSION_ITEM_REACHED_DATA { seq }));
                }
                Event::Output(output, value) => {
                    self.outputs.insert(output, value);
                }
                Event::Wants(mode) => {
                    self.change_mode(mode);
                }
            }
        }
        if is_news {
            self.say(MavMessage::MISSION_CURRENT(self.mission_current()));
        }
        aim
    }

    /// What a pilot does.
    fn fly_by_hand(&mut self) {
        let is_time = match self.settings.pilot {
            Pilot::Nobody => false,
            Pilot::TakesOff(_) => true,
            // Not in the middle of a transfer, nor right behind it: companions read back.
            Pilot::StartsMission => {
                !self.list(List::Mission).is_empty()
                    && !self.storage.is_receiving()
                    && self.now.since(self.storage.heard()) > PATIENCE
            }
        };
        if !is_time || self.landed != Landed::Ground {
            return;
        }
        let since = *self.pilot_since.get_or_insert(self.now);
        if self.now.since(since) < PATIENCE {
            return;
        }
        match self.settings.pilot {
            Pilot::Nobody => {}
            Pilot::TakesOff(height) => {
                self.take_off(height);
            }
            Pilot::StartsMission => {
                self.arm();
                self.change_mode(Mode::Mission);
            }
        }
        // Once: a vehicle that has landed stays on the ground.
        self.settings.pilot = Pilot::Nobody;
    }

    /// Arms.
    pub const fn arm(&mut self) {
        self.armed = true;
    }

    /// Disarms; in the air the motors stop, and it stands on the ground.
    pub fn disarm(&mut self) {
        (self.armed, self.landed, self.lifting) = (false, Landed::Ground, None);
        self.body.position[2] = 0.0;
        self.run.go_on_at(0, self.body.position);
    }

    /// A person arms and takes off by hand, to a height above home, m, and leaves it there.
    pub fn take_off(&mut self, height: f64) {
        self.arm();
        self.lift(height, Mode::Hold);
    }

    fn lift(&mut self, height: f64, after: Mode) {
        if self.landed != Landed::Ground {
            return;
        }
        self.landed = Landed::Rising;
        self.hold = self.body.position;
        self.mode = if after == Mode::Guided { after } else { Mode::Hold };
        self.lifting = Some((height, after));
    }

    /// Changes the mode, as a person or a companion may; false where it is not granted.
    pub fn change_mode(&mut self, mode: Mode) -> bool {
        let is_granted = match mode {
            Mode::Guided => self.guided.is_granted(self.now, self.settings.like),
            Mode::Mission => !self.list(List::Mission).is_empty(),
            Mode::Return | Mode::Land | Mode::Hold | Mode::Other => true,
        };
        if !is_granted || mode == self.mode {
            return is_granted;
        }
        if self.settings.like == Autopilot::ArduPilot {
            self.guided.forget();
        }
        if mode == Mode::Mission {
            self.run.resume(self.body.position);
        }
        self.lifting = None;
        (self.mode, self.hold) = (mode, self.body.position);
        true
    }

    /// Goes on with the mission at an item; false where there is none.
    pub fn set_current(&mut self, item: u16) -> bool {
        let is_there = usize::from(item) < self.list(List::Mission).len();
        if is_there {
            self.run.go_on_at(item, self.body.position);
        }
        is_there
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
