//! A scenario, planned and flown over MAVLink by the bridge and the simulated autopilot, faster than time.
//!
//! The bridge knows where sensors are now ([`revealed`]), trackers tell it where they have moved every
//! [`SEEN_S`], and it plans anew in flight: that is the rolling horizon. Frames pass two UDP sockets on the loopback interface,
//! with the faults that were asked for. What comes out is what was flown, and everything about how.
//!
//! | module | what |
//! |---|---|
//! | [`wire`] | what went over the wire, for people to read |
//!
//! Limits: the first agent of a scenario flies; wind is calm ([`crate::study`] has it).

pub mod wire;

use std::cell::RefCell;
use std::rc::Rc;
use std::time::{Duration, Instant};

use quietpath_bridge::capacity::NODES;
use quietpath_bridge::file::plan::AgentPlan;
use quietpath_bridge::file::{PlanFile, ScenarioFile};
use quietpath_bridge::flight::settings::{PayloadEntry, PayloadKind, Replanning};
use quietpath_bridge::flight::{self, End, FlyMode, Level};
use quietpath_bridge::frame::LocalFrame;
use quietpath_bridge::link::memory::Faults;
use quietpath_bridge::planning::{self, Options, Rollout};
use quietpath_bridge::telemetry::Autopilot;

use crate::autopilot::payload::{Kind, Spec};
use crate::autopilot::{self, Pilot};
use crate::outcome::Failure;
use crate::page::Message;
use crate::rehearsal::{Event, Hop, Rehearsal, Setup, revealed, seen};
use wire::Wiretap;

/// Time between two sightings of the sensors that move, s.
pub const SEEN_S: f64 = 5.0;
/// Plans made in flight where the scenario does not say.
const STEPS: usize = 12;
/// Step of the simulation.
const TICK: Duration = Duration::from_millis(20);
/// How far ahead a new plan takes over, s.
const LEAD_S: f64 = 3.0;
/// Component ids of the payloads on board.
const JAMMER: u8 = 26;
const TRANSMITTER: u8 = 27;
/// How long a flight may take, as a multiple of `time.max`, and in addition, s.
const PATIENCE: (f64, f64) = (1.5, 900.0);
/// Time between two reports of progress.
const TELL: Duration = Duration::from_millis(150);

/// How to fly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Manner {
    /// Which autopilot is simulated.
    pub like: Autopilot,
    /// Who steers.
    pub mode: FlyMode,
    /// Share of the frames that are lost, in each direction.
    pub loss: f64,
    /// Seed of the faults.
    pub seed: u64,
    /// How many times faster than time; as fast as it goes where it is not given.
    pub speedup: Option<f64>,
}

/// Where a flight stands, for who looks on.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Progress {
    /// Phase of the flight.
    pub phase: &'static str,
    /// Time of the scenario, s; `None` before the plan is flown.
    pub time: Option<f64>,
    /// Where the vehicle is, length units.
    pub position: Vec<f64>,
    /// Probability of detection there and then.
    pub detection: f64,
    /// The largest so far.
    pub peak: f64,
    /// Plans that were taken over in flight.
    pub replans: usize,
    /// Frames sent, received, and lost.
    pub frames: [u64; 2],
    /// Share of the vehicle's frames that did not arrive.
    pub loss: f64,
}

/// What is known of a flight that goes on.
#[derive(Clone, Copy, Debug)]
pub struct Look<'a> {
    /// Where it stands.
    pub progress: &'a Progress,
    /// The way so far, as a plan.
    pub track: &'a PlanFile,
    /// The plans so far; the last one flies.
    pub steps: &'a [PlanFile],
    /// The world as the bridge knows it.
    pub world: &'a ScenarioFile,
}

/// What was flown.
#[derive(Clone, Debug)]
pub struct Flown {
    /// The way that was flown, with its times and jamming levels.
    pub track: PlanFile,
    /// The plan that it began with, and those that took over in flight.
    pub steps: Vec<PlanFile>,
    /// What went over the wire.
    pub wire: Vec<Message>,
    /// What the bridge said.
    pub log: Vec<(f64, Level, String)>,
    /// How it ended.
    pub end: End,
    /// How long it really took, s.
    pub seconds: f64,
    /// The last report of progress.
    pub last: Progress,
}

/// Plans the world as it is known at the start.
///
/// # Errors
/// What the planner refuses; no feasible plan.
pub fn first_plan(truth: &ScenarioFile) -> Result<(ScenarioFile, PlanFile), Failure> {
    let mut known = revealed(truth, truth.start_time);
    for agent in &mut known.agents {
        // A simulated jammer radiates nothing.
        agent.jammer_live = true;
    }
    let planned = planning::plan(&known, &Options { rollout: Rollout::Once, ..Options::default() })?;
    if let Some(obstacle) = planned.obstacle.as_ref().filter(|_| !planned.assessment.feasible) {
        return Err(Failure::Input(format!(
            "no feasible plan to begin with: {}\n  help: {}",
            obstacle.describe(truth),
            obstacle.remedy()
        )));
    }
    Ok((known, planned.plan))
}

/// How the bridge is told to fly a scenario.
#[must_use]
pub fn settings(truth: &ScenarioFile, plan: &PlanFile, mode: FlyMode) -> flight::Settings {
    let steps = truth.rolling.map_or(STEPS, |rolling| rolling.steps).max(1);
    let interval_s = plan.duration / steps as f64;
    let lead_s = LEAD_S.max(plan.duration / plan.nodes().max(2) as f64);
    let replan = (truth.agents.len() == 1).then(|| Replanning {
        interval_s,
        lead_s,
        time_to_live_s: 3.0 * (interval_s + lead_s),
        ..Replanning::default()
    });
    let entry = |kind, component| PayloadEntry { kind, component, instance: 0, mission_output: None };
    let first = truth.agents.first();
    let mut payload = Vec::new();
    if first.is_some_and(|agent| agent.jammer.is_some()) {
        payload.push(entry(PayloadKind::Jammer, JAMMER));
    }
    if first.is_some_and(|agent| agent.dropout.is_some()) {
        payload.push(entry(PayloadKind::Transmitter, TRANSMITTER));
    }
    flight::Settings { mode, replan, payload, jammer_armed: true, ..flight::Settings::default() }
}

/// The vehicle that flies it.
fn vehicle(truth: &ScenarioFile, manner: Manner, flight: &flight::Settings) -> Result<autopilot::Settings, Failure> {
    let nowhere = || {
        let help = "add latitude_deg, longitude_deg and altitude_m to [frame]";
        Failure::Input(format!("{} does not say where on the Earth it lies\n  help: {help}", truth.file_name()))
    };
    let mut vehicle = autopilot::Settings::for_agent(manner.like, truth, None).ok_or_else(nowhere)?;
    vehicle.pilot = match manner.mode {
        FlyMode::Guided => Pilot::TakesOff(vehicle.start_height(truth, None).ok_or_else(nowhere)?),
        FlyMode::Mission => Pilot::StartsMission,
    };
    vehicle.payloads.extend(flight.payload.iter().map(|entry| {
        let kind = match entry.kind {
            PayloadKind::Jammer => Kind::Jammer,
            PayloadKind::Transmitter => Kind::Transmitter,
        };
        Spec { kind, component: entry.component, instance: entry.instance }
    }));
    Ok(vehicle)
}

/// Flies a scenario; `tell` hears how it goes.
///
/// # Errors
/// A scenario that cannot be planned or flown, a loopback interface that does not carry.
pub fn fly(truth: &ScenarioFile, manner: Manner, mut tell: impl FnMut(Look<'_>) -> Result<(), Failure>) -> Result<Flown, Failure> {
    let (known, plan) = first_plan(truth)?;
    let settings = settings(truth, &plan, manner.mode);
    let vehicle = vehicle(truth, manner, &settings)?;
    let mut setup = Setup::new(known, plan.clone(), settings, vehicle);
    setup.faults = Faults { loss: manner.loss, ..Faults::NONE };
    setup.seed = manner.seed;
    setup.tick = TICK;
    setup.hop = Hop::loopback().map_err(|cause| Failure::Input(format!("no UDP on the loopback interface: {cause}")))?;
    let mut rehearsal = Rehearsal::new(setup)?;
    let tap = Rc::new(RefCell::new(Wiretap::default()));
    let ear = Rc::clone(&tap);
    rehearsal.listen(Box::new(move |time, way, message| ear.borrow_mut().hear(time, way, message)));
    let mut watch = Watch::new(truth, &plan)?;
    let begin = Instant::now();
    let mut told = begin;
    let until = PATIENCE.0 * (truth.time.max - truth.start_time) + PATIENCE.1;
    while rehearsal.end().is_none() {
        let events = rehearsal.step().map_err(|cause| Failure::Input(format!("the loopback interface: {cause}")))?;
        watch.note(&rehearsal, events);
        if let Some(time) = rehearsal.scenario_time().filter(|time| *time >= watch.look) {
            watch.look = time + SEEN_S;
            seen(truth, time).into_iter().for_each(|sighting| rehearsal.observe(sighting));
        }
        if rehearsal.now().seconds() > until {
            rehearsal.stop("it took too long");
        }
        if told.elapsed() >= TELL {
            told = Instant::now();
            watch.look_on(&rehearsal, &mut tell)?;
        }
        if let Some(speedup) = manner.speedup {
            let ahead = rehearsal.now().seconds() / speedup - begin.elapsed().as_secs_f64();
            std::thread::sleep(Duration::from_secs_f64(ahead.clamp(0.0, 1.0)));
        }
    }
    watch.look_on(&rehearsal, &mut tell)?;
    let end = rehearsal.end().cloned().unwrap_or(End::Done);
    let began = rehearsal.began().map_or(0.0, |began| began.seconds());
    drop(rehearsal);
    let zero = truth.start_time - began;
    let wire = tap.borrow().messages(zero);
    Ok(Flown {
        track: watch.track(),
        steps: watch.steps,
        wire,
        log: watch.log,
        end,
        seconds: begin.elapsed().as_secs_f64(),
        last: watch.last,
    })
}

/// Takes notes of a flight.
struct Watch<'a> {
    truth: &'a ScenarioFile,
    frame: LocalFrame,
    steps: Vec<PlanFile>,
    log: Vec<(f64, Level, String)>,
    times: Vec<f64>,
    path: Vec<Vec<f64>>,
    jam: Vec<f64>,
    dropout: Vec<f64>,
    /// Time between two places of the track, s.
    every: f64,
    /// When sensors are looked at next, s.
    look: f64,
    last: Progress,
}

impl<'a> Watch<'a> {
    fn new(truth: &'a ScenarioFile, plan: &PlanFile) -> Result<Self, Failure> {
        let frame = LocalFrame::of(truth).ok_or_else(|| Failure::input("the scenario lies nowhere on the Earth"))?;
        let longest = truth.time.max - truth.start_time;
        let every = (plan.duration / (4 * plan.nodes().max(2)) as f64).max(1.1 * longest / NODES as f64);
        Ok(Self {
            truth,
            frame,
            steps: vec![plan.clone()],
            log: Vec::new(),
            times: Vec::new(),
            path: Vec::new(),
            jam: Vec::new(),
            dropout: Vec::new(),
            every,
            look: truth.start_time,
            last: Progress::default(),
        })
    }

    /// After every step: what happened, and where the vehicle is.
    fn note(&mut self, rehearsal: &Rehearsal, events: Vec<Event>) {
        let now = rehearsal.now().seconds();
        for event in events {
            if let Event::Said(level, text) = event {
                self.log.push((now, level, text));
            }
        }
        let flies = rehearsal.flight().plan();
        if self.steps.last().is_some_and(|last| flies.start_time > last.start_time) {
            self.steps.push(flies.clone());
        }
        let Some(time) = rehearsal.scenario_time() else { return };
        if rehearsal.flight().phase() != "fly" || self.path.len() + 1 >= NODES {
            return;
        }
        if self.times.last().is_none_or(|last| time >= last + self.every) {
            self.times.push(time);
            self.path.push(self.position(rehearsal));
            let level = |component| rehearsal.machine().payload(component).map_or(0.0, |payload| payload.level());
            self.jam.push(f64::from(level(JAMMER)));
            self.dropout.push(f64::from(1.0 - rehearsal.machine().payload(TRANSMITTER).map_or(1.0, |payload| payload.level())));
        }
    }

    fn position(&self, rehearsal: &Rehearsal) -> Vec<f64> {
        self.frame.position(&rehearsal.machine().place()).unwrap_or_default()
    }

    fn look_on(
        &mut self,
        rehearsal: &Rehearsal,
        tell: &mut impl FnMut(Look<'_>) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        self.progress(rehearsal)?;
        let (progress, steps, world) = (&self.last, &self.steps, rehearsal.flight().world());
        tell(Look { progress, track: &self.track(), steps, world })
    }

    fn progress(&mut self, rehearsal: &Rehearsal) -> Result<(), Failure> {
        let position = self.position(rehearsal);
        let time = rehearsal.scenario_time();
        let at = time.unwrap_or(self.truth.start_time);
        let detection = planning::figures_at(self.truth, at, &position)?.detection;
        let statistics = rehearsal.endpoint().statistics();
        let is_flying = rehearsal.flight().phase() == "fly";
        self.last = Progress {
            phase: rehearsal.flight().phase(),
            time,
            position,
            detection,
            peak: if is_flying { self.last.peak.max(detection) } else { self.last.peak },
            replans: self.steps.len() - 1,
            frames: [statistics.frames_out, statistics.frames_in],
            loss: statistics.loss(),
        };
        Ok(())
    }

    /// What was flown, as a plan.
    fn track(&self) -> PlanFile {
        let start_time = self.times.first().copied().unwrap_or_default();
        let duration = self.times.last().copied().unwrap_or_default() - start_time;
        let entry = self.truth.agents.first();
        let agent = AgentPlan {
            name: entry.map(|agent| agent.name.clone()).unwrap_or_default(),
            path: self.path.clone(),
            jam: entry.and_then(|agent| agent.jammer).map(|_| self.jam.clone()),
            azimuth: None,
            dropout: entry.and_then(|agent| agent.dropout).map(|_| self.dropout.clone()),
        };
        PlanFile {
            scenario: self.truth.name.clone(),
            start_time,
            duration,
            status: Some("flown".into()),
            times: Some(self.times.clone()),
            agents: vec![agent],
            ..PlanFile::default()
        }
    }
}
