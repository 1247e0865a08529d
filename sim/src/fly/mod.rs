//! A scenario, planned and flown over MAVLink by the bridge and the simulated autopilot, faster than time.
//!
//! The bridge knows where sensors are now ([`revealed`]), trackers tell it where they have moved every
//! [`SEEN_S`], and it plans anew in flight: that is the rolling horizon. Frames pass two UDP sockets on the loopback interface,
//! with the faults that were asked for. What comes out is what was flown, and everything about how. An autopilot elsewhere
//! can take the place of the simulated one; the sensors are the scenario's all the same.
//!
//! A team flies one agent after the other, each with a vehicle and a link of its own, on the plan that they have: the bridge plans
//! anew for one agent alone. What was flown is put together by the time of the scenario.
//!
//! Limits: wind is calm ([`crate::study`] has it). With an autopilot elsewhere one agent flies, and nothing is jammed:
//! `quietpath-bridge run --arm-jammer` is for that.

mod craft;
mod follow;
mod watch;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use quietpath_bridge::file::scenario::AgentEntry;
use quietpath_bridge::file::{PlanFile, ScenarioFile};
use quietpath_bridge::flight::settings::{PayloadEntry, PayloadKind, Replanning};
use quietpath_bridge::flight::{self, End, FlyMode, Level};
use quietpath_bridge::link::Address;
use quietpath_bridge::link::memory::Faults;
use quietpath_bridge::planning::{self, Options, Rollout};
use quietpath_bridge::telemetry::Autopilot;
use quietpath_core::horizon::Cadence;
use signal_hook::consts::{SIGINT, SIGTERM};

use crate::autopilot::payload::{Kind, Spec};
use crate::autopilot::{self, Pilot};
use crate::outcome::Failure;
use crate::page::Message;
use crate::rehearsal::{Hop, Rehearsal, Setup, revealed, seen};
use craft::{Craft, Remote, Simulated};
use watch::Watch;

pub use follow::follow;

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
/// How long a simulated flight may take, as a multiple of `time.max`, and in addition, s.
const PATIENCE: (f64, f64) = (1.5, 900.0);
/// Time between two reports of progress.
const TELL: Duration = Duration::from_millis(150);
/// Exit status of a program that a second signal ends at once.
const SIGNALLED: i32 = 130;

/// How to fly.
#[derive(Clone, Debug, PartialEq)]
pub struct Manner {
    /// Which autopilot is simulated, or expected.
    pub like: Autopilot,
    /// Who steers.
    pub mode: FlyMode,
    /// Share of the frames that are lost, in each direction.
    pub loss: f64,
    /// Seed of the faults.
    pub seed: u64,
    /// How many times faster than time; where it is not given, as fast as it goes in simulation, and 1 elsewhere.
    pub speedup: Option<f64>,
    /// Where the autopilot is, if it is not simulated in this process.
    pub connect: Option<Address>,
}

/// Where a flight stands, for who looks on.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Progress {
    /// Who flies, where there are several.
    pub agent: Option<String>,
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
    /// What went over the wire, with times of the scenario.
    pub wire: &'a [Message],
    /// How it ended; `None` while it goes on.
    pub end: Option<&'a End>,
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

/// How the bridge is told to fly an agent of a scenario.
fn settings(truth: &ScenarioFile, plan: &PlanFile, agent: &AgentEntry, manner: &Manner) -> flight::Settings {
    let steps = match truth.rolling.map(|rolling| rolling.cadence) {
        Some(Cadence::Even { steps }) => steps,
        // In flight plans come at even times: as often as the shortest step wants it.
        Some(Cadence::Adaptive { shortest, .. }) => truth.intervals.div_ceil(shortest.max(1)),
        None => STEPS,
    };
    let interval_s = plan.duration / steps.max(1) as f64;
    let lead_s = LEAD_S.min(0.5 * interval_s);
    let replan = (truth.agents.len() == 1).then(|| Replanning {
        interval_s,
        lead_s,
        time_to_live_s: plan.duration,
        ..Replanning::default()
    });
    let entry = |kind, component| PayloadEntry { kind, component, instance: 0, mission_output: None };
    let mut payload = Vec::new();
    if agent.jammer.is_some() {
        payload.push(entry(PayloadKind::Jammer, JAMMER));
    }
    if agent.dropout.is_some() {
        payload.push(entry(PayloadKind::Transmitter, TRANSMITTER));
    }
    // A simulated jammer radiates nothing.
    let jammer_armed = manner.connect.is_none();
    let (mode, agent) = (manner.mode, Some(agent.name.clone()));
    flight::Settings { mode, agent, replan, payload, jammer_armed, ..flight::Settings::default() }
}

/// The vehicle that flies it.
fn vehicle(truth: &ScenarioFile, manner: &Manner, flight: &flight::Settings) -> Result<autopilot::Settings, Failure> {
    let nowhere = || {
        let help = "add latitude_deg, longitude_deg and altitude_m to [frame]";
        Failure::Input(format!("{} does not say where on the Earth it lies\n  help: {help}", truth.file_name()))
    };
    let agent = flight.agent.as_deref();
    let mut vehicle = autopilot::Settings::for_agent(manner.like, truth, agent).ok_or_else(nowhere)?;
    vehicle.pilot = match manner.mode {
        FlyMode::Guided => Pilot::TakesOff(vehicle.start_height(truth, agent).ok_or_else(nowhere)?),
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

/// What flies an agent: an autopilot here or elsewhere, and the bridge.
fn craft(
    truth: &ScenarioFile,
    known: &ScenarioFile,
    plan: &PlanFile,
    agent: &AgentEntry,
    manner: &Manner,
) -> Result<Box<dyn Craft>, Failure> {
    let settings = settings(truth, plan, agent, manner);
    if let Some(address) = &manner.connect {
        let remote = Remote::new(address.clone(), manner.speedup.unwrap_or(1.0), known, plan, settings)?;
        return Ok(Box::new(remote));
    }
    let vehicle = vehicle(truth, manner, &settings)?;
    let mut setup = Setup::new(known.clone(), plan.clone(), settings, vehicle);
    setup.faults = Faults { loss: manner.loss, ..Faults::NONE };
    setup.seed = manner.seed;
    setup.tick = TICK;
    setup.hop =
        Hop::loopback().map_err(|cause| Failure::Input(format!("no UDP on the loopback interface: {cause}")))?;
    Ok(Box::new(Simulated::new(Rehearsal::new(setup)?, manner.speedup)))
}

/// A flag that the first signal raises; the second one ends the program.
fn signals() -> Result<Arc<AtomicBool>, Failure> {
    let raised = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        signal_hook::flag::register_conditional_shutdown(signal, SIGNALLED, Arc::clone(&raised))
            .and_then(|_| signal_hook::flag::register(signal, Arc::clone(&raised)))
            .map_err(Failure::input)?;
    }
    Ok(raised)
}

/// Flies a scenario; `tell` hears how it goes. A signal ends the flight, and what was flown until then comes out.
///
/// # Errors
/// A scenario that cannot be planned or flown, a loopback interface that does not carry, what `tell` fails with.
pub fn fly(
    truth: &ScenarioFile,
    manner: &Manner,
    mut tell: impl FnMut(Look<'_>) -> Result<(), Failure>,
) -> Result<Flown, Failure> {
    if manner.connect.is_some() && truth.agents.len() > 1 {
        let agents = truth.agents.len();
        return Err(Failure::Input(format!("--connect flies one agent, and {} has {agents}", truth.file_name())));
    }
    let (known, plan) = first_plan(truth)?;
    let signalled = signals()?;
    let mut team: Option<Flown> = None;
    let mut tracks = Vec::new();
    for (index, agent) in truth.agents.iter().enumerate() {
        let mut craft = craft(truth, &known, &plan, agent, manner)?;
        let mut watch = Watch::new(truth, &plan, index)?;
        let seconds = guide(truth, manner, craft.as_mut(), &mut watch, &tracks, &signalled, &mut tell)?;
        let zero = truth.start_time - craft.began().map_or(0.0, |began| began.seconds());
        let (track, mut wire) = (watch.track(&tracks), craft.wire().messages(zero));
        let end = craft.end().cloned().unwrap_or(End::Done);
        let Watch { steps, mut log, last, .. } = watch;
        if truth.agents.len() > 1 {
            wire.iter_mut().for_each(|message| message.way = format!("{}: {}", agent.name, message.way));
            log.iter_mut().for_each(|(_, _, text)| *text = format!("{}: {text}", agent.name));
        }
        tracks.push(track.clone());
        let one = Flown { track, steps, wire, log, end, seconds, last };
        team = Some(team.map_or(one.clone(), |before| before.and(one)));
        if signalled.load(Ordering::Relaxed) {
            break;
        }
    }
    team.ok_or_else(|| Failure::input("the scenario has no agent"))
}

impl Flown {
    /// With what the next agent of the team flew.
    fn and(mut self, next: Self) -> Self {
        // The way of who flew longest holds them all.
        let is_longest = next.track.duration > self.track.duration || next.end != End::Done;
        if is_longest && next.track.nodes() > 1 {
            self.track = next.track;
        } else if next.track.nodes() > 1 {
            let times = self.track.node_times();
            for (mine, its) in self.track.agents.iter_mut().zip(&next.track.agents) {
                if let Some(flown) = watch::sampled(&next.track, &its.name, &times) {
                    *mine = flown;
                }
            }
        }
        self.wire.extend(next.wire);
        self.log.extend(next.log);
        self.seconds += next.seconds;
        let (frames, loss) = (self.last.frames, self.last.loss);
        self.last = Progress { peak: self.last.peak.max(next.last.peak), ..next.last };
        self.last.loss = self.last.loss.max(loss);
        for (all, before) in self.last.frames.iter_mut().zip(frames) {
            *all += before;
        }
        if self.end == End::Done {
            self.end = next.end;
        }
        self
    }
}

/// Lets a craft fly to its end; how long that really took, s.
fn guide(
    truth: &ScenarioFile,
    manner: &Manner,
    craft: &mut dyn Craft,
    watch: &mut Watch<'_>,
    before: &[PlanFile],
    signalled: &AtomicBool,
    tell: &mut impl FnMut(Look<'_>) -> Result<(), Failure>,
) -> Result<f64, Failure> {
    let begin = Instant::now();
    let mut told = begin;
    let mut look = truth.start_time;
    let mut is_stopping = false;
    let until = PATIENCE.0 * (truth.time.max - truth.start_time) + PATIENCE.1;
    while craft.end().is_none() {
        let said = craft.step()?;
        watch.note(craft, said);
        if let Some(time) = watch.scenario_time(craft).filter(|time| *time >= look) {
            look = time + SEEN_S;
            seen(truth, time).into_iter().for_each(|sighting| craft.observe(sighting));
        }
        let is_late = manner.connect.is_none() && craft.now().seconds() > until;
        if !is_stopping && (is_late || signalled.load(Ordering::Relaxed)) {
            is_stopping = true;
            craft.stop(if is_late { "it took too long" } else { "ended by a signal" });
        }
        if told.elapsed() >= TELL {
            told = Instant::now();
            watch.look_on(craft, before, tell)?;
        }
    }
    watch.finish(craft);
    watch.look_on(craft, before, tell)?;
    Ok(begin.elapsed().as_secs_f64())
}

/// How a flight ended, in words.
#[must_use]
pub fn ended(end: &End) -> String {
    match end {
        End::Done => "at the goal".into(),
        End::Released(why) => format!("let go: {why}"),
        End::Stopped(why) => format!("stopped: {why}"),
        End::Failed(why) => format!("failed: {why}"),
    }
}
