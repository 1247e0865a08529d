//! Flights in one process: bridge, simulated autopilot, wires and planner under one clock.

use std::sync::LazyLock;
use std::time::Duration;

use fastrand::Rng;
use quietpath_bridge::file::{PlanFile, ScenarioFile};
use quietpath_bridge::flight::settings::{PayloadEntry, PayloadKind, Replanning};
use quietpath_bridge::flight::{self, End, FlyMode};
use quietpath_bridge::frame::LocalFrame;
use quietpath_bridge::link::memory::Faults;
use quietpath_bridge::planning::{Options, plan};
use quietpath_bridge::telemetry::Autopilot;
use quietpath_sim::autopilot::body::Vector;
use quietpath_sim::autopilot::payload::{Kind, Spec};
use quietpath_sim::autopilot::{Landed, Pilot, Settings};
use quietpath_sim::rehearsal::{Event, Rehearsal, Setup};

use super::{Flown, Outcome};

/// Component of the jammer.
pub const JAMMER: u8 = 26;
/// Longest that a flight may take, s.
const LONGEST: f64 = 240.0;
/// How long the vehicle is watched after the bridge has ended, s: its own answer to silence takes some of it.
const WATCHED: f64 = 8.0;
/// How long a payload may go on without the bridge, s: its time to live, and what is on its way.
const ECHO: f64 = 1.6;
/// Speed of a vehicle that stands, m/s.
const STANDS: f64 = 0.5;
/// How near the goal is reached, m.
const NEAR: f64 = 5.0;

/// Centre and radius of the region, length units.
const REGION: ([f64; 2], f64) = ([10.0, 9.0], 2.0);
/// Part of the radius that is not flown into: a vehicle that follows a mission cuts corners.
const CORNERS: f64 = 0.95;
/// Side of the domain, length units.
const SIDE: f64 = 20.0;
/// Largest speed, length units a second.
const SPEED_MAX: f64 = 0.8;

/// From west to east around a region, with two sensors; where they stand is for the seed.
const SCENARIO: &str = r#"
name = "faults"
softening = 0.05
frame = { unit_m = 10.0, latitude_deg = 47.4, longitude_deg = 8.5, altitude_m = 40.0 }
grid = { intervals = 20 }
time = { max = 32.0 }
domain = { min = [0.0, 0.0], max = [20.0, 20.0] }
[[agent]]
start = [1.0, 8.5]
goal = [19.0, 9.5]
speed_max = 0.8
accel_max = 0.4
jammer = { budget = 12.0, live = true }
[[sensor]]
name = "s1"
position = [SOUTH]
ranging = { model = "toa", c1 = 0.01, c2 = 0.1, path_loss = 2.0 }
jam = { error_gain = 20.0, error_exponent = 1.0, detect_gain = 1.0, detect_exponent = 1.0 }
[[sensor]]
name = "s2"
position = [NORTH]
ranging = { model = "toa", c1 = 0.01, c2 = 0.1, path_loss = 2.0 }
jam = { error_gain = 20.0, error_exponent = 1.0, detect_gain = 1.0, detect_exponent = 1.0 }
[[sensor]]
name = "s3"
position = [3.0, 17.0]
ranging = { model = "toa", c1 = 0.01, c2 = 0.1, path_loss = 2.0 }
jam = { error_gain = 20.0, error_exponent = 1.0, detect_gain = 1.0, detect_exponent = 1.0 }
[[region]]
center = [10.0, 9.0]
radius = 2.0
[[objective.term]]
metric = "log_aee"
sense = "max"
"#;

/// Scenarios that seeds choose from, with their plans: planning each flight's own would take longer than flying it.
static WORLDS: LazyLock<Vec<(ScenarioFile, PlanFile)>> = LazyLock::new(|| (0..4).map(world).collect());

fn world(seed: u64) -> (ScenarioFile, PlanFile) {
    let mut random = Rng::with_seed(seed);
    let mut at = |north: f64| format!("{:.2}, {:.2}", 6.0 + 8.0 * random.f64(), north + 3.0 * random.f64());
    let text = SCENARIO.replace("SOUTH", &at(2.0)).replace("NORTH", &at(14.0));
    let scenario = ScenarioFile::parse("faults.toml", &text).unwrap_or_else(|error| panic!("{error}")).scenario;
    let planned = plan(&scenario, &Options::default()).unwrap_or_else(|error| panic!("{error}")).plan;
    (scenario, planned)
}

/// What goes wrong on a flight, and when.
pub struct Trial {
    /// Changes the setup: wires, settings, what is on board.
    pub prepare: fn(&mut Setup, &mut Rng),
    /// Does something to a flight, at a moment that the seed chooses while the plan is flown.
    pub strike: fn(&mut Rehearsal, &mut Around),
    /// For how long it does so, at every step; 0 is once.
    pub span_s: f64,
    /// For how long after it the speed does not count, s: a vehicle that has missed setpoints hurries after them, as fast as
    /// its own limits let it.
    pub hurry_s: f64,
    /// When it strikes: while the plan is flown, or before.
    pub when: When,
    /// Whether anything may be jammed after it.
    pub after: After,
}

/// What a flight began with, for who strikes at it.
#[derive(Debug)]
pub struct Around {
    /// Chance, by the seed.
    pub random: Rng,
    /// The scenario.
    pub scenario: ScenarioFile,
    /// The plan.
    pub plan: PlanFile,
    /// How it is flown.
    pub settings: flight::Settings,
}

/// When something happens.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum When {
    /// While the plan is flown.
    Flying,
    /// Before the plan is flown.
    Before,
}

/// Whether a flight may jam after its fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum After {
    /// It goes on as planned.
    Jams,
    /// Never any more.
    Silent,
}

impl Trial {
    /// Nothing goes wrong.
    pub const NONE: Self = Self {
        prepare: |_, _| {},
        strike: |_, _| {},
        span_s: 0.0,
        hurry_s: 0.0,
        when: When::Flying,
        after: After::Jams,
    };
}

fn setup(mode: FlyMode, seed: u64) -> Setup {
    let (scenario, plan) = WORLDS[(seed / 2) as usize % WORLDS.len()].clone();
    let kind = if seed.is_multiple_of(2) { Autopilot::Px4 } else { Autopilot::ArduPilot };
    let mut vehicle = Settings::for_agent(kind, &scenario, None).expect("it lies on the Earth");
    vehicle.pilot = match mode {
        FlyMode::Guided => Pilot::TakesOff(vehicle.start_height(&scenario, None).expect("a start")),
        FlyMode::Mission => Pilot::StartsMission,
    };
    // It could be faster than any plan, so that one that chases a setpoint shows.
    vehicle.limits.speed_max = 2.0 * SPEED_MAX * scenario.frame.unit_m;
    vehicle.payloads = vec![Spec { kind: Kind::Jammer, component: JAMMER, instance: 0 }];
    let jammer = PayloadEntry { kind: PayloadKind::Jammer, component: JAMMER, instance: 0, mission_output: None };
    let replan =
        Replanning { interval_s: 6.0, lead_s: 2.0, deadline_s: 1.0, time_to_live_s: 22.0, ..Replanning::default() };
    let flight = flight::Settings {
        mode,
        replan: Some(replan),
        payload: vec![jammer],
        jammer_armed: true,
        ..flight::Settings::default()
    };
    Setup { seed, tick: Duration::from_millis(20), ..Setup::new(scenario, plan, flight, vehicle) }
}

/// A flight that is watched.
struct Watched {
    flight: Rehearsal,
    frame: LocalFrame,
    /// When the plan was flown last, s.
    flown: f64,
    /// When the fault struck, s.
    struck: Option<f64>,
    /// For how long after that its speed does not count, s.
    hurry: f64,
    after: After,
    /// How much was jammed, s.
    jammed: f64,
    speed: f64,
    /// Late and reordered setpoints make a vehicle hurry: its speed counts on a clean wire alone.
    is_clean: bool,
    broken: Vec<String>,
    said: Vec<String>,
}

impl Watched {
    fn break_once(&mut self, promise: String) {
        // The first of a kind tells enough.
        let kind = |text: &str| text.split(':').next().unwrap_or_default().to_owned();
        if !self.broken.iter().any(|known| kind(known) == kind(&promise)) {
            self.broken.push(promise);
        }
    }

    /// Lets a tick pass, and looks whether the promises are kept.
    fn step(&mut self) {
        let before = self.flight.now();
        for event in self.flight.step().expect("wires in memory carry") {
            if let Event::Said(_, text) = event {
                self.said.push(format!("{:8.2} s  {text}", self.flight.now().seconds()));
            }
        }
        let now = self.flight.now().seconds();
        if self.flight.end().is_none() && self.flight.flight().phase() == "fly" {
            self.flown = now;
        }
        let machine = self.flight.machine();
        let level = f64::from(machine.payload(JAMMER).expect("on board").level());
        self.jammed += level * self.flight.now().since(before).as_secs_f64();
        let position = self.frame.position(&machine.place()).expect("a position");
        let [east, north, _] = machine.body().velocity;
        let (landed, killed) = (machine.landed(), machine.killed().map(str::to_owned));
        let rival = machine.rivals().find(|(phase, _)| matches!(*phase, "fly" | "approach"));
        let rival = rival.map(|(phase, _)| phase);
        // On the way to the start it may fly as fast as it can.
        let is_on_plan = self.flight.began().is_some_and(|began| now > began.seconds() + 2.0) && now == self.flown;
        let hurries = self.struck.is_some_and(|struck| now < struck + self.hurry);
        if is_on_plan && self.is_clean && !hurries {
            self.speed = self.speed.max(east.hypot(north));
        }
        if let Some(phase) = rival {
            self.break_once(format!("two bridges at once: the second is in phase {phase} at {now:.2} s"));
        }
        if level > 0.0 && now - self.flown > ECHO {
            self.break_once(format!("jams without flying the plan: at {now:.2} s"));
        }
        let is_silenced = self.after == After::Silent && self.struck.is_some_and(|struck| now - struck > ECHO);
        if level > 0.0 && is_silenced {
            self.break_once(format!("jams after the fault: at {now:.2} s"));
        }
        if let Some(why) = killed {
            self.break_once(format!("ends the autopilot's process: {why}"));
        }
        let (center, radius) = REGION;
        let from_center = (position[0] - center[0]).hypot(position[1] - center[1]);
        // A person, and the autopilot on its own, may fly where they like.
        let is_ours = now == self.flown && landed == Landed::Air;
        if is_ours && from_center < CORNERS * radius {
            self.break_once(format!("is in the region: {from_center:.2} from its centre at {now:.2} s"));
        }
        if is_ours && position[..2].iter().any(|part| !(-0.1..=SIDE + 0.1).contains(part)) {
            self.break_once(format!("leaves the domain: {position:?} at {now:.2} s"));
        }
    }

    fn has_timed_out(&self) -> bool {
        self.flight.now().seconds() > LONGEST
    }
}

/// Flies a trial once.
///
/// # Panics
/// The bridge, the autopilot or the planner does.
#[must_use]
pub fn fly(trial: &Trial, mode: FlyMode, seed: u64) -> Flown {
    let mut random = Rng::with_seed(seed ^ 0x5eed_0000);
    let mut setup = setup(mode, seed);
    (trial.prepare)(&mut setup, &mut random);
    // A plan takes 23 s or more, and nobody takes off in the first 3.
    let at = if trial.when == When::Flying { 1.0 + 17.0 * random.f64() } else { 0.5 + 1.3 * random.f64() };
    let (scenario, plan, settings) = (setup.scenario.clone(), setup.plan.clone(), setup.flight.clone());
    let mut around = Around { random, scenario, plan, settings };
    let is_clean = setup.faults == Faults::NONE;
    let frame = LocalFrame::of(&setup.scenario).expect("it lies on the Earth");
    let goal = setup.scenario.agents[0].goal.clone();
    let (unit, budget) = (setup.scenario.frame.unit_m, setup.scenario.agents[0].jammer.expect("a jammer").budget);
    let flight = Rehearsal::new(setup).unwrap_or_else(|error| panic!("{error}"));
    let (flown, struck, hurry, after) = (0.0, None, trial.hurry_s, trial.after);
    let (jammed, speed) = (0.0, 0.0);
    let (broken, said) = (Vec::new(), Vec::new());
    let mut watched = Watched { flight, frame, flown, struck, hurry, after, jammed, speed, is_clean, broken, said };
    while watched.flight.end().is_none() && !watched.has_timed_out() {
        watched.step();
        let now = watched.flight.now().seconds();
        let since = match trial.when {
            When::Flying => watched.flight.began().map(|began| now - began.seconds()),
            When::Before => Some(now),
        };
        let is_due =
            since.is_some_and(|since| since >= at && (watched.struck.is_none() || since < at + trial.span_s));
        if is_due {
            watched.struck.get_or_insert(now);
            (trial.strike)(&mut watched.flight, &mut around);
        }
    }
    let ended = watched.flight.now().seconds();
    while watched.flight.end().is_some() && watched.flight.now().seconds() < ended + WATCHED {
        watched.step();
    }
    judge(watched, &goal, unit, budget)
}

fn judge(mut watched: Watched, goal: &[f64], unit: f64, budget: f64) -> Flown {
    let machine = watched.flight.machine();
    let position = watched.frame.position(&machine.place()).expect("a position");
    let (speed, is_flying) = (norm(machine.body().velocity), machine.landed() == Landed::Air);
    let began = watched.flight.began().is_some();
    let end = watched.flight.end().cloned();
    let outcome = match &end {
        None => None,
        Some(End::Done) => Some(Outcome::Arrives),
        Some(_) if !began => Some(Outcome::Refuses),
        Some(End::Released(_)) => Some(Outcome::LetsGo),
        Some(End::Failed(_) | End::Stopped(_)) => Some(Outcome::Holds),
    };
    let off = (position[0] - goal[0]).hypot(position[1] - goal[1]) * unit;
    if outcome == Some(Outcome::Arrives) && off > NEAR {
        watched.break_once(format!("is not where it says: {off:.1} m from the goal"));
    }
    if matches!(outcome, Some(Outcome::Arrives | Outcome::Holds)) && (speed > STANDS || !is_flying) {
        watched.break_once(format!("does not stand in the air: {speed:.2} m/s"));
    }
    let fastest = watched.speed;
    if fastest > 1.3 * SPEED_MAX * unit {
        watched.break_once(format!("is too fast: {fastest:.2} m/s"));
    }
    let jammed = watched.jammed;
    if jammed > 1.1 * budget + ECHO {
        watched.break_once(format!("jams too much: {jammed:.2} s of {budget} s"));
    }
    watched.said.push(format!("{:8.2} s  {end:?}", watched.flight.now().seconds()));
    Flown { outcome, broken: watched.broken, said: watched.said }
}

fn norm(vector: Vector) -> f64 {
    vector.iter().map(|part| part * part).sum::<f64>().sqrt()
}
