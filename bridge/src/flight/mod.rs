//! A flight, from the first heartbeat to the last: what the bridge does with a plan, a vehicle and time.
//!
//! [`Flight`] is a machine without input or output. Everything that happens goes into [`Flight::step`] with its time, and
//! everything that is to be done comes out; so a test is the vehicle, the planner and the clock, and a record of the
//! inputs replays bit for bit.
//!
//! ```text
//! Connect -> Deliver -> Ready -> Approach (guided only) -> Fly -> Leave -> ended
//! ```
//!
//! | phase | what happens | ends when |
//! |---|---|---|
//! | Connect | heartbeats; the autopilot is found | it is heard |
//! | PickUp | only after the bridge died in flight: see [`Journal`] | the vehicle is looked at |
//! | Deliver | fence, rally points and, in mission mode, the mission are uploaded and read back | the autopilot holds them |
//! | Ready | a person arms, takes off, or starts the mission | it flies |
//! | Approach | setpoints to the start, the mode is asked for | it is there and slow |
//! | Fly | the plan is flown; setpoints, payloads, new plans | goal, failure, or a person takes over |
//! | Leave | the vehicle is asked to hold or return | it does, or 3 s later |
//!
//! The bridge neither arms nor takes off: a person does. A mode that is neither asked for nor left by the bridge means
//! that a person has taken over: it lets go at once and does not come back.
//!
//! **Emission.** [`Flight::emission`] is the one place that decides whether payloads emit. All of its conditions must hold
//! at the moment; there is nothing to switch off.

mod emission;
mod fly;
mod guard;
mod prepare;
mod resume;
mod schedule;
pub mod settings;

use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::clock::Time;
use crate::command::{Command, Commands};
use crate::file::{FileError, PlanFile, ScenarioFile};
use crate::frame::LocalFrame;
use crate::link::codec::companion_heartbeat;
use crate::link::dialect::MavMessage;
use crate::link::{Frame, Identity};
use crate::mission::{Delivery, Download, Item, List, Pace, Talk, Watch};
use crate::payload::{Radiation, Relay};
use crate::replan::job::Budgets;
use crate::replan::{Answer, Job, Observation};
use crate::setpoint::Curve;
use crate::telemetry::timesync::Timesync;
use crate::telemetry::{INTERVALS, LINK_TIMEOUT, Mode, Telemetry, Vehicle, mode_command};

use emission::Spending;
use guard::Company;
pub use resume::Journal;
pub use settings::{FlyMode, OnFailure, Settings};

/// Time between heartbeats.
const HEARTBEAT: Duration = Duration::from_secs(1);
/// Time between two requests of the same mode.
const MODE_AGAIN: Duration = Duration::from_secs(1);
/// How old a position may be before it is asked for again.
const FIX_MAX: Duration = Duration::from_secs(2);
/// Time between two heartbeats of another program that show that it lives.
const OTHER_LIVES: Duration = Duration::from_millis(500);
/// Longest that leaving takes.
const LEAVE_MAX: Duration = Duration::from_secs(3);

/// What happens to a flight.
#[derive(Clone, Debug, PartialEq)]
pub enum Input {
    /// Time passes.
    Tick,
    /// A message of the link.
    Frame(Box<Frame>),
    /// The device is open.
    LinkUp,
    /// The device is gone, and why.
    LinkDown(String),
    /// A sensor was seen.
    Observed(Observation),
    /// The planner answered.
    Planned(Answer),
    /// Somebody wants the bridge to end, and why.
    Stop(String),
}

/// How loud a line of the log is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Level {
    /// As expected.
    Info,
    /// Worth a look.
    Warn,
}

/// What is to be done.
#[derive(Clone, Debug)]
pub enum Output {
    /// Send a message.
    Send(Box<MavMessage>),
    /// From now on speak with this system id.
    Board(u8),
    /// The link's round trip was measured.
    RoundTrip(Duration),
    /// Plan.
    Plan(Box<Job>),
    /// Keep this for a bridge that picks the flight up if this one dies; nothing any more where it is `None`.
    Keep(Option<Box<Journal>>),
    /// Tell people.
    Say(Level, String),
    /// The flight is over.
    End(End),
}

/// How a flight ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum End {
    /// At the goal.
    Done,
    /// A person took over.
    Released(String),
    /// Somebody ended the bridge.
    Stopped(String),
    /// It could not be flown, and why.
    Failed(String),
}

/// Where a flight stands.
#[derive(Clone, Debug)]
enum Phase {
    Connect,
    PickUp { since: Time },
    Deliver { delivery: Box<Delivery>, waiting: Vec<(List, Vec<Item>)> },
    Ready,
    Approach { since: Time },
    Fly,
    Leave { mode: Mode, end: End, since: Time },
    Ended,
}

/// A plan that flies or is about to.
#[derive(Clone, Debug)]
struct Flying {
    plan: PlanFile,
    curve: Curve,
    /// When it was made, s of the scenario.
    made: f64,
    /// For each item of the mission the node that it flies to; empty where the bridge steers.
    nodes: Vec<usize>,
    /// Jammer and dropout with what is left of their budgets where the plan begins; the scenario's own where not given.
    budgets: Option<Budgets>,
    /// Whether it is the rest of a mission that was replaced in flight.
    is_rest: bool,
}

/// A flight. See the [module](self).
pub struct Flight {
    settings: Settings,
    /// The scenario as it is known now.
    world: ScenarioFile,
    frame: LocalFrame,
    agent: String,
    /// Which flight this is.
    digest: String,
    /// A flight to go on with, and the curve of its plan.
    picked_up: Option<Box<(Journal, Curve)>>,
    /// Whether it was picked up in flight.
    is_resumed: bool,
    us: Identity,
    now: Time,
    telemetry: Telemetry,
    commands: Commands,
    timesync: Timesync,
    round_trip: Option<Duration>,
    relay: Relay,
    radiation: Radiation,
    watch: Option<Watch>,
    /// What the autopilot holds of ours, and a look whether it still does.
    kept: Vec<Item>,
    check: Option<Download>,
    phase: Phase,
    flying: Flying,
    next: Option<Flying>,
    /// A mission on its way while the one before it is flown.
    update: Option<Box<Delivery>>,
    update_begun: Time,
    /// How long the last mission took to be delivered, s.
    delivery_s: f64,
    /// The clock's time at the start time of the scenario.
    zero: Option<Time>,
    /// How far the scenario had got at that time, s.
    passed: f64,
    /// In mission mode: the item that is flown to, and since when.
    item: Option<(u16, Time)>,
    /// An item that the vehicle was told to go on at, and when.
    expected: Option<(u16, Time)>,
    /// An item before the one that is flown to, said once.
    doubt: Option<u16>,
    job: Option<(Box<Job>, Time)>,
    jobs: u64,
    /// An observation came that no plan knows of.
    is_news: bool,
    heartbeat: Option<Time>,
    setpoint: Option<Time>,
    mode_asked: Option<Time>,
    intervals_asked: Time,
    company: Company,
    spending: Spending,
    link_lost: bool,
    out: Vec<Output>,
}

impl Flight {
    /// A flight of a plan.
    ///
    /// # Errors
    /// A scenario that does not say where it lies, an agent that it does not have, a plan that does not fit it, planning
    /// anew with more than one agent.
    pub fn new(scenario: &ScenarioFile, plan: &PlanFile, settings: Settings) -> Result<Self, Box<FileError>> {
        let fail = |message: String, help: &str| FileError::whole(scenario.file_name(), message, help);
        plan.fits("the plan", scenario)?;
        let frame = LocalFrame::of(scenario).ok_or_else(|| {
            fail(
                "does not say where on the Earth it lies".into(),
                "add latitude_deg, longitude_deg and altitude_m to [frame]",
            )
        })?;
        let names: Vec<&str> = scenario.agents.iter().map(|agent| agent.name.as_str()).collect();
        let agent =
            settings.agent.clone().or_else(|| names.first().map(|name| (*name).to_owned())).unwrap_or_default();
        let Some(entry) = scenario.agents.iter().find(|entry| entry.name == agent) else {
            return Err(Box::new(fail(
                format!("has no agent `{agent}`"),
                &format!("its agents are {}", names.join(", ")),
            )));
        };
        if settings.replan.is_some() && scenario.agents.len() > 1 {
            let message = format!("has {} agents, and planning anew in flight plans for one", scenario.agents.len());
            return Err(Box::new(fail(message, "fly a team with the plan that it has: leave [replan] out")));
        }
        let curve = Curve::of(plan, &agent)
            .ok_or_else(|| fail("has a plan with numbers that are not finite".into(), "plan it again"))?;
        let radiation = settings.radiation(entry.jammer_live);
        let relay = Relay::new(settings.payloads(), radiation);
        let telemetry = Telemetry::new(settings.autopilot.choice(), settings.system);
        let made = scenario.start_time;
        let digest = resume::digest(scenario, plan, &settings);
        Ok(Self {
            settings,
            world: scenario.clone(),
            frame,
            agent,
            digest,
            picked_up: None,
            is_resumed: false,
            us: Identity::COMPANION,
            now: Time::ZERO,
            telemetry,
            commands: Commands::default(),
            timesync: Timesync::default(),
            round_trip: None,
            relay,
            radiation,
            watch: None,
            kept: Vec::new(),
            check: None,
            phase: Phase::Connect,
            flying: Flying { plan: plan.clone(), curve, made, nodes: Vec::new(), budgets: None, is_rest: false },
            next: None,
            update: None,
            update_begun: Time::ZERO,
            delivery_s: 0.0,
            zero: None,
            passed: 0.0,
            item: None,
            expected: None,
            doubt: None,
            job: None,
            jobs: 0,
            is_news: false,
            heartbeat: None,
            setpoint: None,
            mode_asked: None,
            intervals_asked: Time::ZERO,
            company: Company::default(),
            spending: Spending::new(entry.jammer.map(|jammer| jammer.budget)),
            link_lost: false,
            out: Vec::new(),
        })
    }

    /// The vehicle, once it has been heard.
    #[must_use]
    pub const fn vehicle(&self) -> Option<&Vehicle> {
        self.telemetry.vehicle()
    }

    /// The phase, for the status line.
    #[must_use]
    pub const fn phase(&self) -> &'static str {
        match self.phase {
            Phase::Connect => "connect",
            Phase::PickUp { .. } => "pick up",
            Phase::Deliver { .. } => "deliver",
            Phase::Ready => "ready",
            Phase::Approach { .. } => "approach",
            Phase::Fly => "fly",
            Phase::Leave { .. } => "leave",
            Phase::Ended => "ended",
        }
    }

    /// Something happened, or time passed.
    pub fn step(&mut self, now: Time, input: Input) -> Vec<Output> {
        let asleep = now.since(self.now);
        // Time does not go backwards, whatever a caller says.
        self.now = self.now.max(now);
        if matches!(self.phase, Phase::Ended) {
            return Vec::new();
        }
        if asleep > LINK_TIMEOUT && matches!(self.phase, Phase::Fly) && self.settings.mode == FlyMode::Guided {
            // As where the vehicle was not heard: the plan has gone on without it.
            let seconds = asleep.as_secs_f64();
            self.give_up(format!("the bridge's computer stood still for {seconds:.1} s while it steered"));
        }
        match input {
            Input::Tick | Input::LinkUp => {}
            Input::LinkDown(why) => self.say(Level::Warn, format!("the link is down: {why}")),
            Input::Frame(frame) => self.hear(&frame),
            Input::Observed(observation) => self.observe(&observation),
            Input::Planned(answer) => self.planned(&answer),
            Input::Stop(why) => self.stop(why),
        }
        self.advance();
        std::mem::take(&mut self.out)
    }

    /// Level 0 for all payloads: what to send when there is no time for anything else.
    #[must_use]
    pub fn silence(&mut self) -> Vec<MavMessage> {
        let mut out = Vec::new();
        if let Some(vehicle) = self.telemetry.vehicle() {
            self.relay.silence(vehicle.identity, &mut out);
            let quiet = schedule::quiet(vehicle.autopilot, &self.settings.payload, self.radiation);
            out.extend(quiet.iter().map(|command| command.long(vehicle.identity, 0)));
        }
        out
    }

    fn say(&mut self, level: Level, text: impl Into<String>) {
        self.out.push(Output::Say(level, text.into()));
    }

    fn send(&mut self, messages: Vec<MavMessage>) {
        self.out.extend(messages.into_iter().map(|message| Output::Send(Box::new(message))));
    }

    fn talk(&self, vehicle: Identity, list: List) -> Talk {
        Talk { us: self.us, vehicle, list }
    }

    fn pace(&self) -> Pace {
        Pace::new(self.round_trip)
    }

    /// Time of the scenario, s, as far as the flight has got.
    fn scenario_time(&self) -> f64 {
        match (self.settings.mode, self.zero) {
            (_, None) => self.flying.curve.begin(),
            (FlyMode::Guided, Some(zero)) => self.world.start_time + self.passed + self.now.since(zero).as_secs_f64(),
            (FlyMode::Mission, Some(_)) => self.mission_time(),
        }
    }

    fn hear(&mut self, frame: &Frame) {
        let was_known = self.telemetry.vehicle().is_some();
        self.telemetry.handle(self.now, frame);
        let Some(vehicle) = self.telemetry.vehicle().copied() else { return };
        if !was_known {
            self.us.system = vehicle.identity.system;
            self.company.met = self.now;
            self.out.push(Output::Board(vehicle.identity.system));
            let text = format!("{:?} on system {}", vehicle.autopilot, vehicle.identity.system);
            self.say(Level::Info, text);
            self.ask_for_intervals(vehicle.identity);
        }
        if frame.from == self.us && matches!(frame.message, MavMessage::HEARTBEAT(_)) {
            return self.meet_another();
        }
        let mut out = Vec::new();
        if let MavMessage::TIMESYNC(data) = &frame.message
            && frame.from == vehicle.identity
            && let Some(span) = self.timesync.handle(self.now, data, &mut out)
        {
            self.round_trip = Some(self.round_trip.map_or(span, |before| (before * 7 + span) / 8));
            self.out.push(Output::RoundTrip(span));
        }
        if let MavMessage::FOLLOW_TARGET(data) = &frame.message
            && frame.from.system == vehicle.identity.system
            && let Some(observation) = Observation::from_mavlink(data, &self.world)
        {
            self.observe(&observation);
        }
        if let Some(ended) = self.commands.handle(self.now, self.us, frame)
            && !ended.outcome.is_done()
        {
            self.say(Level::Warn, format!("{:?} was answered with {:?}", ended.command.command, ended.outcome));
        }
        if let Some(answer) = self.relay.handle(frame) {
            self.say(Level::Info, answer);
        }
        if let Phase::Deliver { delivery, .. } = &mut self.phase {
            delivery.handle(self.now, frame, &mut out);
        }
        if let Some(update) = &mut self.update {
            update.handle(self.now, frame, &mut out);
        }
        self.send(out);
        self.follow_mission(frame);
    }

    fn observe(&mut self, observation: &Observation) {
        let sigma_max = self.settings.replan.map_or(f64::MAX, |replan| replan.sigma_max);
        let now = self.scenario_time();
        match observation.apply(&mut self.world, now, sigma_max) {
            Ok(()) => self.is_news = true,
            Err(why) => self.say(Level::Warn, format!("an observation of {why}")),
        }
    }

    fn stop(&mut self, why: String) {
        match (&self.phase, self.settings.mode) {
            (Phase::Approach { .. } | Phase::Fly, FlyMode::Guided) => self.leave(Mode::Hold, End::Stopped(why)),
            (Phase::Leave { .. }, _) => {}
            _ => self.end(End::Stopped(why)),
        }
    }

    fn leave(&mut self, mode: Mode, end: End) {
        match &end {
            End::Done => self.say(Level::Info, format!("at the goal: leaving for {mode:?}")),
            End::Released(why) | End::Stopped(why) | End::Failed(why) => {
                self.say(Level::Warn, format!("leaving for {mode:?}: {why}"));
            }
        }
        self.mode_asked = None;
        self.phase = Phase::Leave { mode, end, since: self.now };
    }

    fn end(&mut self, end: End) {
        let silence = self.silence();
        self.send(silence);
        self.phase = Phase::Ended;
        self.out.push(Output::Keep(None));
        self.out.push(Output::End(end));
    }

    fn ask_for_intervals(&mut self, vehicle: Identity) {
        self.intervals_asked = self.now;
        for (message, hertz) in INTERVALS {
            self.commands.submit(self.now, vehicle, Command::interval(message, hertz));
        }
    }

    /// A vehicle that is heard and does not say where it is has begun anew, or never heard the question.
    fn ask_again_for_intervals(&mut self, vehicle: &Vehicle) {
        let is_stale = vehicle.fix.is_none_or(|fix| self.now.since(fix.heard) > FIX_MAX);
        let is_due = self.now.since(self.intervals_asked) > FIX_MAX;
        if is_stale && is_due && self.now.since(vehicle.heard) < FIX_MAX && self.commands.under_way() == 0 {
            self.say(Level::Warn, "the vehicle does not say where it is: asking again");
            self.ask_for_intervals(vehicle.identity);
        }
    }

    /// Asks for a mode, again and again until the vehicle has it.
    fn ask_for(&mut self, vehicle: &Vehicle, mode: Mode) {
        if vehicle.mode == mode || self.mode_asked.is_some_and(|asked| self.now.since(asked) < MODE_AGAIN) {
            return;
        }
        self.mode_asked = Some(self.now);
        if let Some(command) = mode_command(vehicle.autopilot, vehicle.airframe, mode) {
            self.commands.supersede(self.now, vehicle.identity, command);
        }
    }

    /// What is due at this time, whatever happened.
    fn advance(&mut self) {
        if self.heartbeat.is_none_or(|sent| self.now.since(sent) >= HEARTBEAT) {
            self.heartbeat = Some(self.now);
            self.send(vec![companion_heartbeat()]);
        }
        let Some(vehicle) = self.telemetry.vehicle().copied() else { return };
        let lost = self.telemetry.is_lost(self.now);
        if lost != self.link_lost {
            self.link_lost = lost;
            self.say(Level::Warn, if lost { "the vehicle is silent" } else { "the vehicle is heard again" });
            if !lost && matches!(self.phase, Phase::Fly) && self.settings.mode == FlyMode::Guided {
                // The plan has gone on without the vehicle: its setpoints are far ahead by now.
                self.give_up("the vehicle was not heard while it was steered".into());
            }
        }
        let mut out = Vec::new();
        self.timesync.poll(self.now, vehicle.identity, &mut out);
        self.ask_again_for_intervals(&vehicle);
        let unanswered = self.commands.poll(self.now, self.round_trip, &mut out);
        self.send(out);
        for ended in unanswered {
            self.say(Level::Warn, format!("{:?} was not answered", ended.command.command));
        }
        self.advance_check(&vehicle);
        self.advance_phase(&vehicle);
        if matches!(self.phase, Phase::Ended) {
            return;
        }
        let mut out = Vec::new();
        let emission = self.emission();
        self.count_emission(emission);
        self.relay.poll(self.now, vehicle.identity, emission, &mut out);
        self.send(out);
    }

    fn advance_phase(&mut self, vehicle: &Vehicle) {
        match &self.phase {
            Phase::Connect if self.picked_up.is_some() => self.phase = Phase::PickUp { since: self.now },
            Phase::Connect => self.begin_delivery(vehicle),
            Phase::PickUp { since } => self.pick_up(vehicle, *since),
            Phase::Deliver { .. } => self.advance_delivery(vehicle),
            Phase::Ready => self.wait_for_flight(vehicle),
            Phase::Approach { since } => self.approach(vehicle, *since),
            Phase::Fly => self.fly(vehicle),
            Phase::Leave { mode, end, since } => {
                let (mode, end, since) = (*mode, end.clone(), *since);
                if vehicle.mode == mode || self.now.since(since) >= LEAVE_MAX {
                    return self.end(end);
                }
                self.stay(vehicle);
                self.ask_for(vehicle, mode);
            }
            Phase::Ended => {}
        }
    }
}
