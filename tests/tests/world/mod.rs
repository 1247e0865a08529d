//! A vehicle that does what it is told at once, around a flight, under a clock of the test's own.

use quietpath_bridge::clock::Time;
use quietpath_bridge::file::plan::AgentPlan;
use quietpath_bridge::file::{PlanFile, ScenarioFile};
use quietpath_bridge::flight::settings::{FlyMode, PayloadEntry, PayloadKind};
use quietpath_bridge::flight::{End, Flight, Input, Journal, Output, Settings};
use quietpath_bridge::frame::LocalFrame;
use quietpath_bridge::link::codec::plain_bytes;
use quietpath_bridge::link::dialect::*;
use quietpath_bridge::link::{Frame, Identity};
use quietpath_bridge::record::Recorder;
use quietpath_bridge::replan::Job;
use quietpath_bridge::telemetry::{Airframe, Autopilot, Mode, mode_command};
use quietpath_sim::autopilot::storage::Storage;

pub const VEHICLE: Identity = Identity { system: 1, component: 1 };

pub const SCENARIO: &str = r#"
name = "line"
frame = { unit_m = 10.0, latitude_deg = 47.4, longitude_deg = 8.5, altitude_m = 40.0 }
grid = { intervals = 20 }
time = { max = 60.0 }
domain = { min = [0.0, 0.0], max = [20.0, 20.0] }
[[agent]]
start = [1.0, 1.0]
goal = [19.0, 1.0]
speed_max = 1.0
accel_max = 1.0
jammer = { budget = 20.0, live = true }
dropout = { budget = 20.0 }
[[sensor]]
name = "s1"
position = [10.0, 5.0]
detection = { model = "proxy", scale = 1.0, epsilon = 0.5, path_loss = 2.0 }
[[region]]
center = [10.0, 8.0]
radius = 2.0
[[objective.term]]
metric = "detection"
"#;
pub const TICK: u64 = 20;

pub fn scenario() -> ScenarioFile {
    ScenarioFile::parse("line.toml", SCENARIO).expect("a scenario").scenario
}

/// 18 length units in 40 s along the south; jamming in the middle, quiet in the last quarter.
pub fn plan() -> PlanFile {
    let path: Vec<Vec<f64>> = (0..=20).map(|node| vec![1.0 + 0.9 * f64::from(node), 1.0]).collect();
    let control = |from: i32, until: i32, value: f64| -> Option<Vec<f64>> {
        Some((0..=20).map(|node| if (from..until).contains(&node) { value } else { 0.0 }).collect())
    };
    let agent = AgentPlan {
        name: "uav1".into(),
        path,
        jam: control(5, 15, 0.5),
        azimuth: control(0, 21, std::f64::consts::FRAC_PI_2),
        dropout: control(15, 21, 1.0),
    };
    PlanFile { scenario: "line".into(), duration: 40.0, agents: vec![agent], ..PlanFile::default() }
}

pub fn settings(mode: FlyMode) -> Settings {
    let entry = |kind, component| PayloadEntry { kind, component, instance: 0, mission_output: None };
    let payload = vec![entry(PayloadKind::Transmitter, 25), entry(PayloadKind::Jammer, 26)];
    Settings { mode, payload, jammer_armed: true, ..Settings::default() }
}

/// A vehicle that does what it is told at once.
pub struct World {
    pub flight: Flight,
    pub kind: Autopilot,
    pub now: u64,
    pub missions: Storage,
    pub armed: bool,
    pub landed: MavLandedState,
    pub custom_mode: u32,
    pub refuses_modes: bool,
    pub position: Vec<f64>,
    pub current: Option<u16>,
    pub silent: bool,
    /// Heartbeats alone.
    pub mute: bool,
    pub level: Option<f32>,
    pub power: Option<f32>,
    pub servo: Option<f32>,
    pub setpoints: Vec<(u64, SET_POSITION_TARGET_GLOBAL_INT_DATA)>,
    pub jobs: Vec<Job>,
    pub said: Vec<String>,
    pub end: Option<End>,
    pub recorder: Option<Recorder>,
    pub journal: Option<Journal>,
}

impl World {
    pub fn new(kind: Autopilot, settings: Settings) -> Self {
        let flight = Flight::new(&scenario(), &plan(), settings).expect("a flight");
        Self {
            flight,
            kind,
            now: 0,
            missions: Storage::new(kind, VEHICLE),
            armed: false,
            landed: MavLandedState::MAV_LANDED_STATE_ON_GROUND,
            custom_mode: 0,
            refuses_modes: false,
            position: vec![0.5, 0.5],
            current: None,
            silent: false,
            mute: false,
            level: None,
            power: None,
            servo: None,
            setpoints: Vec::new(),
            jobs: Vec::new(),
            said: Vec::new(),
            end: None,
            recorder: None,
            journal: None,
        }
    }

    pub fn mode(&mut self, mode: Mode) {
        let command = mode_command(self.kind, Airframe::Copter, mode).expect("a mode");
        let [_, main, sub, ..] = command.params.map(|param| param as u32);
        self.custom_mode = if self.kind == Autopilot::Px4 { main << 16 | sub << 24 } else { main };
    }

    fn telemetry(&self) -> Vec<MavMessage> {
        let autopilot = match self.kind {
            Autopilot::Px4 => MavAutopilot::MAV_AUTOPILOT_PX4,
            Autopilot::ArduPilot => MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
        };
        let armed = MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED;
        let heartbeat = HEARTBEAT_DATA {
            custom_mode: self.custom_mode,
            mavtype: MavType::MAV_TYPE_QUADROTOR,
            autopilot,
            base_mode: if self.armed { armed } else { MavModeFlag::empty() },
            system_status: MavState::MAV_STATE_ACTIVE,
            mavlink_version: 3,
        };
        let place = LocalFrame::of(&scenario()).expect("located").place(&self.position);
        let position = GLOBAL_POSITION_INT_DATA {
            lat: (place.latitude_deg * 1e7).round() as i32,
            lon: (place.longitude_deg * 1e7).round() as i32,
            alt: 440_000,
            relative_alt: 40_000,
            ..Default::default()
        };
        let landed = EXTENDED_SYS_STATE_DATA { landed_state: self.landed, ..Default::default() };
        let current =
            self.current.map(|seq| MavMessage::MISSION_CURRENT(MISSION_CURRENT_DATA { seq, ..Default::default() }));
        let rest = [
            MavMessage::HEARTBEAT(heartbeat),
            MavMessage::GLOBAL_POSITION_INT(position),
            MavMessage::EXTENDED_SYS_STATE(landed),
        ];
        let said = if self.mute { 1 } else { rest.len() };
        rest.into_iter().take(said).chain(current).collect()
    }

    pub fn input(&mut self, input: Input) {
        let now = Time::from_millis(self.now);
        let outputs = self.flight.step(now, input.clone());
        if let Some(recorder) = &mut self.recorder {
            recorder.write(now, &input, &outputs);
        }
        let mut answers = Vec::new();
        for output in outputs {
            match output {
                Output::Send(message) => self.hear(*message, &mut answers),
                Output::Plan(job) => self.jobs.push(*job),
                Output::Say(_, text) => self.said.push(text),
                Output::End(end) => self.end = Some(end),
                Output::Keep(journal) => self.journal = journal.map(|journal| *journal),
                Output::Board(_) | Output::RoundTrip(_) => {}
            }
        }
        if self.silent {
            return;
        }
        for message in answers {
            self.frame(message);
        }
    }

    pub fn frame(&mut self, message: MavMessage) {
        let bytes = plain_bytes(VEHICLE, &message);
        self.input(Input::Frame(Box::new(Frame { from: VEHICLE, sequence: 0, message, bytes })));
    }

    fn hear(&mut self, message: MavMessage, answers: &mut Vec<MavMessage>) {
        match &message {
            MavMessage::COMMAND_LONG(data) => self.command(data, answers),
            MavMessage::SET_POSITION_TARGET_GLOBAL_INT(data) => self.setpoints.push((self.now, data.clone())),
            _ => {}
        }
        let from = Identity::COMPANION;
        let frame = Frame { from, sequence: 0, message, bytes: Vec::new() };
        self.missions.handle(Time::from_millis(self.now), &frame, answers);
    }

    fn command(&mut self, data: &COMMAND_LONG_DATA, answers: &mut Vec<MavMessage>) {
        match data.command {
            MavCmd::MAV_CMD_USER_1 => return self.power = Some(data.param2),
            MavCmd::MAV_CMD_USER_2 => {
                assert!(data.param2 == 0.0 || data.param3 == 0.0, "to the north");
                return self.level = Some(data.param2);
            }
            MavCmd::MAV_CMD_DO_SET_SERVO => self.servo = Some(data.param2),
            MavCmd::MAV_CMD_DO_SET_MODE if !self.refuses_modes => {
                let (main, sub) = (data.param2 as u32, data.param3 as u32);
                self.custom_mode = if self.kind == Autopilot::Px4 { main << 16 | sub << 24 } else { main };
            }
            MavCmd::MAV_CMD_DO_SET_MISSION_CURRENT => self.current = Some(data.param1 as u16),
            _ => {}
        }
        let result = MavResult::MAV_RESULT_ACCEPTED;
        answers.push(MavMessage::COMMAND_ACK(COMMAND_ACK_DATA {
            command: data.command,
            result,
            ..Default::default()
        }));
    }

    /// Lets time pass, s.
    pub fn pass(&mut self, seconds: f64) {
        let until = self.now + (seconds * 1000.0) as u64;
        while self.now < until && self.end.is_none() {
            self.now += TICK;
            if !self.silent && self.now.is_multiple_of(100) {
                for message in self.telemetry() {
                    self.frame(message);
                }
            }
            self.input(Input::Tick);
            let mut due = Vec::new();
            self.missions.poll(Time::from_millis(self.now), &mut due);
            for message in due {
                self.frame(message);
            }
        }
    }

    /// Up to the moment at which the plan is flown.
    pub fn begin(&mut self, mode: FlyMode) {
        self.pass(5.0);
        assert!(self.setpoints.is_empty() && self.level.is_none_or(|level| level == 0.0));
        (self.armed, self.landed) = (true, MavLandedState::MAV_LANDED_STATE_IN_AIR);
        match mode {
            FlyMode::Guided => {
                self.pass(2.0);
                self.position = vec![1.0, 1.0];
            }
            FlyMode::Mission => {
                self.current = Some(1);
                self.mode(Mode::Mission);
            }
        }
        for _ in 0..20 {
            if self.flight.phase() == "fly" {
                break;
            }
            self.pass(0.02);
        }
        assert_eq!(self.flight.phase(), "fly", "{:?}", self.said);
    }

    /// Up to the middle of the plan, where it jams.
    pub fn jamming(kind: Autopilot, settings: Settings) -> Self {
        let mut world = Self::new(kind, settings);
        world.begin(FlyMode::Guided);
        world.pass(20.0);
        assert_eq!((world.level, world.power), (Some(0.5), Some(1.0)), "{:?}", world.said);
        world
    }
}
