//! A whole flight in one process: the bridge, a simulated autopilot, the wires between them, and one clock.
//!
//! Nobody waits for time to pass: each [`Rehearsal::step`] moves the clock by [`Setup::tick`], so a flight takes as long as
//! its arithmetic, and the same setup flies the same flight, bit for bit. What goes over the wires are real frames with
//! faults from a seed, in memory or over UDP sockets on the loopback interface ([`Hop`]).
//!
//! Planning takes [`Setup::planning`] of the flight's time, however long it really took.

use std::collections::VecDeque;
use std::io;
use std::net::UdpSocket;
use std::time::Duration;

use quietpath_bridge::clock::Time;
use quietpath_bridge::file::scenario::{KnotEntry, MotionEntry};
use quietpath_bridge::file::{FileError, PlanFile, ScenarioFile};
use quietpath_bridge::flight::{self, End, Flight, Input, Level, Output};
use quietpath_bridge::link::memory::{Faults, Wire};
use quietpath_bridge::link::{Accept, Endpoint, Identity, Source, codec};
use quietpath_bridge::planning::Memory;
use quietpath_bridge::record::Recorder;
use quietpath_bridge::replan::worker::carry_out;
use quietpath_bridge::replan::{Answer, Observation};

use crate::autopilot::{self, Machine};
use crate::wiretap::{Direction, Wiretap};

/// Longest that planning may really take.
const DEADLINE: Duration = Duration::from_secs(120);
/// Longest that a datagram may take over the loopback interface.
const HOP_MAX: Duration = Duration::from_secs(10);
/// Largest datagram.
const DATAGRAM_MAX: usize = 512;

/// How frames get from one end to the other.
#[derive(Debug)]
pub enum Hop {
    /// They are handed over.
    Memory,
    /// They pass two UDP sockets on 127.0.0.1.
    Loopback(UdpSocket, UdpSocket),
}

impl Hop {
    /// Two UDP sockets on the loopback interface.
    ///
    /// # Errors
    /// The operating system gives none.
    pub fn loopback() -> io::Result<Self> {
        let (a, b) = (UdpSocket::bind("127.0.0.1:0")?, UdpSocket::bind("127.0.0.1:0")?);
        a.connect(b.local_addr()?)?;
        b.connect(a.local_addr()?)?;
        for socket in [&a, &b] {
            socket.set_read_timeout(Some(HOP_MAX))?;
        }
        Ok(Self::Loopback(a, b))
    }

    fn up(&self, bytes: Vec<u8>) -> io::Result<Vec<u8>> {
        match self {
            Self::Memory => Ok(bytes),
            Self::Loopback(a, b) => carry(a, b, &bytes),
        }
    }

    fn down(&self, bytes: Vec<u8>) -> io::Result<Vec<u8>> {
        match self {
            Self::Memory => Ok(bytes),
            Self::Loopback(a, b) => carry(b, a, &bytes),
        }
    }
}

fn carry(from: &UdpSocket, to: &UdpSocket, bytes: &[u8]) -> io::Result<Vec<u8>> {
    from.send(bytes)?;
    let mut buffer = [0; DATAGRAM_MAX];
    let count = to.recv(&mut buffer)?;
    Ok(buffer.get(..count).unwrap_or_default().to_vec())
}

/// What to fly.
#[derive(Debug)]
pub struct Setup {
    /// The world as the bridge knows it when it begins: see [`revealed`].
    pub scenario: ScenarioFile,
    /// The plan that it begins with.
    pub plan: PlanFile,
    /// How to fly it.
    pub flight: flight::Settings,
    /// The vehicle.
    pub autopilot: autopilot::Settings,
    /// Faults of the wires, in each direction.
    pub faults: Faults,
    /// Their seed.
    pub seed: u64,
    /// How frames get across.
    pub hop: Hop,
    /// How much time passes in a step.
    pub tick: Duration,
    /// How much of the flight's time planning takes.
    pub planning: Duration,
}

impl Setup {
    /// A flight over perfect wires in memory, in steps of 10 ms, with planning in half a second.
    #[must_use]
    pub fn new(
        scenario: ScenarioFile,
        plan: PlanFile,
        flight: flight::Settings,
        autopilot: autopilot::Settings,
    ) -> Self {
        let (tick, planning) = (Duration::from_millis(10), Duration::from_millis(500));
        Self { scenario, plan, flight, autopilot, faults: Faults::NONE, seed: 0, hop: Hop::Memory, tick, planning }
    }
}

/// What happens.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// The bridge says something.
    Said(Level, String),
    /// A plan was made; whether it flies is what the bridge says.
    Planned(Answer),
    /// The flight is over.
    Ended(End),
}

/// A flight. See the [module](self).
pub struct Rehearsal {
    flight: Flight,
    machine: Machine,
    ours: Endpoint,
    theirs: Endpoint,
    up: Wire,
    down: Wire,
    hop: Hop,
    now: Time,
    /// How far the bridge's clock is ahead.
    ahead: Duration,
    tick: Duration,
    planning: Duration,
    answers: VecDeque<(Time, Answer)>,
    memory: Memory,
    began: Option<Time>,
    start_time: f64,
    recorder: Option<Recorder>,
    wire: Wiretap,
    events: Vec<Event>,
    end: Option<End>,
}

impl Rehearsal {
    /// A flight that is about to begin.
    ///
    /// # Errors
    /// A scenario and plan that the bridge cannot fly.
    pub fn new(setup: Setup) -> Result<Self, Box<FileError>> {
        let Setup { scenario, plan, flight, autopilot, faults, seed, hop, tick, planning } = setup;
        let start_time = scenario.start_time;
        let flight = Flight::new(&scenario, &plan, flight)?;
        let machine = Machine::new(autopilot);
        let theirs = Endpoint::new(machine.identity(), Accept::Anyone);
        Ok(Self {
            flight,
            machine,
            ours: Endpoint::new(Identity::COMPANION, Accept::Autopilot(None)),
            theirs,
            up: Wire::new(faults, seed),
            down: Wire::new(faults, seed.wrapping_add(1)),
            hop,
            now: Time::ZERO,
            ahead: Duration::ZERO,
            tick,
            planning,
            answers: VecDeque::new(),
            memory: Memory::default(),
            began: None,
            start_time,
            recorder: None,
            wire: Wiretap::default(),
            events: Vec::new(),
            end: None,
        })
    }

    /// Records everything from now on.
    pub fn record(&mut self, recorder: Recorder) {
        self.recorder = Some(recorder);
    }

    /// Lets [`Setup::tick`] pass; what happened.
    ///
    /// # Errors
    /// The loopback interface does not carry.
    pub fn step(&mut self) -> io::Result<Vec<Event>> {
        self.now = self.now + self.tick;
        while let Some(bytes) = self.down.receive(self.now) {
            let bytes = self.hop.down(bytes)?;
            let now = self.bridge_now();
            for frame in self.ours.decode(now, Source::Line, &bytes) {
                if let Some(recorder) = &mut self.recorder {
                    recorder.frame(now, &frame.bytes);
                }
                self.wire.hear(self.now, Direction::Down, &frame.message);
                self.feed(Input::Frame(Box::new(frame)));
            }
        }
        while let Some((_, answer)) = self.answers.pop_front_if(|(due, _)| *due <= self.now) {
            self.events.push(Event::Planned(answer.clone()));
            self.feed(Input::Planned(answer));
        }
        self.feed(Input::Tick);
        if self.began.is_none() && self.flight.phase() == "fly" {
            self.began = Some(self.now);
        }
        while let Some(bytes) = self.up.receive(self.now) {
            let bytes = self.hop.up(bytes)?;
            for frame in self.theirs.decode(self.now, Source::Line, &bytes) {
                self.machine.receive(self.now, &frame);
            }
        }
        for sent in self.machine.tick(self.now) {
            let us = self.machine.identity();
            let bytes = sent.bytes(us, |component, message| self.theirs.encode_as(self.now, component, message));
            self.down.send(self.now, &bytes);
        }
        Ok(std::mem::take(&mut self.events))
    }

    /// A tracker saw a sensor.
    pub fn observe(&mut self, observation: Observation) {
        self.feed(Input::Observed(observation));
    }

    /// Somebody ends the bridge.
    pub fn stop(&mut self, why: &str) {
        self.feed(Input::Stop(why.to_owned()));
    }

    /// The bridge's clock leaps ahead, as where its computer slept.
    pub fn leap(&mut self, span: Duration) {
        self.ahead += span;
    }

    /// From now on planning takes so long.
    pub const fn plan_in(&mut self, planning: Duration) {
        self.planning = planning;
    }

    fn bridge_now(&self) -> Time {
        self.now + self.ahead
    }

    fn feed(&mut self, input: Input) {
        let now = self.bridge_now();
        let outputs = self.flight.step(now, input.clone());
        if let Some(recorder) = &mut self.recorder {
            recorder.write(now, &input, &outputs);
        }
        for output in outputs {
            match output {
                Output::Send(message) => {
                    self.wire.hear(self.now, Direction::Up, &message);
                    let bytes = self.ours.encode(now, &message);
                    if let Some(recorder) = &mut self.recorder {
                        recorder.frame(now, &codec::plain_bytes(self.ours.identity(), &message));
                    }
                    self.up.send(self.now, &bytes);
                }
                Output::Board(system) => self.ours.board(system),
                Output::RoundTrip(_) | Output::Keep(_) => {}
                Output::Plan(job) => {
                    let answer = Answer { number: job.number, result: carry_out(&job, DEADLINE, &mut self.memory) };
                    self.answers.push_back((self.now + self.planning, answer));
                }
                Output::Say(level, text) => self.events.push(Event::Said(level, text)),
                Output::End(end) => {
                    self.end = Some(end.clone());
                    self.events.push(Event::Ended(end));
                }
            }
        }
    }

    /// The time.
    #[must_use]
    pub const fn now(&self) -> Time {
        self.now
    }

    /// The bridge's flight.
    #[must_use]
    pub const fn flight(&self) -> &Flight {
        &self.flight
    }

    /// The vehicle.
    #[must_use]
    pub const fn machine(&self) -> &Machine {
        &self.machine
    }

    /// The vehicle, to do something to it.
    pub const fn machine_mut(&mut self) -> &mut Machine {
        &mut self.machine
    }

    /// The bridge's end of the link.
    #[must_use]
    pub const fn endpoint(&self) -> &Endpoint {
        &self.ours
    }

    /// What went over the wire.
    #[must_use]
    pub const fn wire(&self) -> &Wiretap {
        &self.wire
    }

    /// When the plan began to be flown.
    #[must_use]
    pub const fn began(&self) -> Option<Time> {
        self.began
    }

    /// Time of the scenario since the plan is flown, s; `None` before.
    #[must_use]
    pub fn scenario_time(&self) -> Option<f64> {
        self.began.map(|began| self.start_time + self.now.since(began).as_secs_f64())
    }

    /// How it ended; `None` while it goes on.
    #[must_use]
    pub const fn end(&self) -> Option<&End> {
        self.end.as_ref()
    }
}

/// The position of a sensor at a time, s, by its motion.
#[must_use]
pub fn sensor_at(motion: &MotionEntry, time: f64) -> Vec<f64> {
    match motion {
        MotionEntry::Fixed(position) => position.clone(),
        MotionEntry::Track(knots) => along(knots, time),
    }
}

fn along(knots: &[KnotEntry], time: f64) -> Vec<f64> {
    let after = knots.iter().position(|knot| knot.time > time).unwrap_or(knots.len());
    let before = after.checked_sub(1).and_then(|index| knots.get(index));
    match (before, knots.get(after)) {
        (Some(from), Some(to)) => {
            let share = (time - from.time) / (to.time - from.time);
            from.position.iter().zip(&to.position).map(|(a, b)| a + share * (b - a)).collect()
        }
        (Some(only), None) | (None, Some(only)) => only.position.clone(),
        (None, None) => Vec::new(),
    }
}

/// A scenario as it is known at a time, s: sensors stand where they are, and nothing is said about steps.
#[must_use]
pub fn revealed(truth: &ScenarioFile, time: f64) -> ScenarioFile {
    let mut known = truth.clone();
    known.rolling = None;
    for sensor in &mut known.sensors {
        sensor.motion = MotionEntry::Fixed(sensor_at(&sensor.motion, time));
    }
    known
}

/// What a tracker says about the sensors that move, at a time, s.
#[must_use]
pub fn seen(truth: &ScenarioFile, time: f64) -> Vec<Observation> {
    let moves = truth.sensors.iter().filter(|sensor| matches!(sensor.motion, MotionEntry::Track(_)));
    let observation = |position, id: &str| Observation {
        id: id.to_owned(),
        time: None,
        position: Some(position),
        latitude_deg: None,
        longitude_deg: None,
        altitude_m: None,
        velocity: None,
        covariance: None,
        ranging: None,
        detection: None,
    };
    moves.map(|sensor| observation(sensor_at(&sensor.motion, time), &sensor.name)).collect()
}
