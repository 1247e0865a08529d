//! What a flight is flown with: the simulated autopilot in this process, or one elsewhere, on a link.

use std::time::{Duration, Instant};

use quietpath_bridge::clock::{SystemClock, Time};
use quietpath_bridge::file::{PlanFile, ScenarioFile};
use quietpath_bridge::flight::{self, End, Flight, Input, Level, Output};
use quietpath_bridge::frame::Place;
use quietpath_bridge::link::{Accept, Address, Endpoint, Event, Identity, Link, Statistics};
use quietpath_bridge::payload::Emission;
use quietpath_bridge::replan::{Answer, Observation, Worker};

use crate::outcome::Failure;
use crate::rehearsal::{self, Rehearsal};
use crate::wiretap::{Direction, Wiretap};

use super::{JAMMER, TRANSMITTER};

/// Longest wait for a frame of an autopilot elsewhere.
const WAIT: Duration = Duration::from_millis(4);
/// Longest wait for the clock of a simulation that must not run ahead.
const NAP_MAX: Duration = Duration::from_millis(100);
/// Nothing is emitted but what the transmitter always does.
pub(super) const SILENT: Emission = Emission { level: 0.0, azimuth: 0.0, dropout: 0.0 };
/// How often payloads are told level 0 at the end: a frame may be lost.
const SILENCES: usize = 3;

/// A vehicle, the bridge that flies it, and the clock of both.
pub(super) trait Craft {
    /// Lets some time pass; what the bridge said.
    fn step(&mut self) -> Result<Vec<(Level, String)>, Failure>;
    /// A tracker saw a sensor.
    fn observe(&mut self, seen: Observation);
    /// Somebody ends the flight.
    fn stop(&mut self, why: &str);
    /// The time.
    fn now(&self) -> Time;
    /// When the plan began to be flown.
    fn began(&self) -> Option<Time>;
    /// The bridge's flight.
    fn flight(&self) -> &Flight;
    /// Where the vehicle is.
    fn place(&self) -> Option<Place>;
    /// What payloads emit.
    fn emission(&self) -> Emission;
    /// Counters of the link.
    fn statistics(&self) -> Statistics;
    /// What went over the wire.
    fn wire(&self) -> &Wiretap;
    /// How it ended.
    fn end(&self) -> Option<&End>;
}

/// The simulated autopilot in this process, as fast as it goes or in step with a clock.
pub(super) struct Simulated {
    rehearsal: Rehearsal,
    begin: Instant,
    speedup: Option<f64>,
}

impl Simulated {
    pub(super) fn new(rehearsal: Rehearsal, speedup: Option<f64>) -> Self {
        Self { rehearsal, begin: Instant::now(), speedup }
    }
}

impl Craft for Simulated {
    fn step(&mut self) -> Result<Vec<(Level, String)>, Failure> {
        if let Some(speedup) = self.speedup {
            let due = Duration::try_from_secs_f64(self.now().seconds() / speedup).unwrap_or_default();
            std::thread::sleep(due.saturating_sub(self.begin.elapsed()).min(NAP_MAX));
            if due > self.begin.elapsed() {
                return Ok(Vec::new());
            }
        }
        let events = self
            .rehearsal
            .step()
            .map_err(|cause| Failure::Input(format!("the loopback interface fails: {cause}")))?;
        let said = events.into_iter().filter_map(|event| match event {
            rehearsal::Event::Said(level, text) => Some((level, text)),
            rehearsal::Event::Planned(_) | rehearsal::Event::Ended(_) => None,
        });
        Ok(said.collect())
    }

    fn observe(&mut self, seen: Observation) {
        self.rehearsal.observe(seen);
    }

    fn stop(&mut self, why: &str) {
        self.rehearsal.stop(why);
    }

    fn now(&self) -> Time {
        self.rehearsal.now()
    }

    fn began(&self) -> Option<Time> {
        self.rehearsal.began()
    }

    fn flight(&self) -> &Flight {
        self.rehearsal.flight()
    }

    fn place(&self) -> Option<Place> {
        Some(self.rehearsal.machine().place())
    }

    fn emission(&self) -> Emission {
        let payload = |component| self.rehearsal.machine().payload(component);
        let level = |component| payload(component).map(|payload| f64::from(payload.level()));
        let bearing_deg = payload(JAMMER).map_or(0.0, |payload| f64::from(payload.direction_deg()[0]));
        Emission {
            level: level(JAMMER).unwrap_or(0.0),
            azimuth: (90.0 - bearing_deg).to_radians(),
            dropout: 1.0 - level(TRANSMITTER).unwrap_or(1.0),
        }
    }

    fn statistics(&self) -> Statistics {
        self.rehearsal.endpoint().statistics().clone()
    }

    fn wire(&self) -> &Wiretap {
        self.rehearsal.wire()
    }

    fn end(&self) -> Option<&End> {
        self.rehearsal.end()
    }
}

/// An autopilot elsewhere.
pub(super) struct Remote {
    flight: Flight,
    link: Link,
    clock: SystemClock,
    worker: Option<Worker>,
    wire: Wiretap,
    began: Option<Time>,
    said: Vec<(Level, String)>,
    end: Option<End>,
}

impl Remote {
    /// Opens the link.
    ///
    /// # Errors
    /// A plan that the bridge cannot fly; no threads.
    pub(super) fn new(
        address: Address,
        speedup: f64,
        scenario: &ScenarioFile,
        plan: &PlanFile,
        settings: flight::Settings,
    ) -> Result<Self, Failure> {
        let clock =
            SystemClock::at_speed(speedup).ok_or_else(|| Failure::input("the speed of the clock is no speed"))?;
        let deadline =
            settings.replan.map(|replan| Duration::try_from_secs_f64(replan.deadline_s).unwrap_or_default());
        let worker =
            deadline.map(|deadline| Worker::start(clock.real(deadline))).transpose().map_err(Failure::input)?;
        let flight = Flight::new(scenario, plan, settings)?;
        let endpoint = Endpoint::new(Identity::COMPANION, Accept::Autopilot(None));
        let link = Link::open(address, endpoint, clock).map_err(Failure::input)?;
        let (wire, began, said, end) = (Wiretap::default(), None, Vec::new(), None);
        Ok(Self { flight, link, clock, worker, wire, began, said, end })
    }

    fn feed(&mut self, input: Input) {
        let now = self.clock.now();
        for output in self.flight.step(now, input) {
            match output {
                Output::Send(message) => {
                    self.wire.hear(now, Direction::Up, &message);
                    self.link.send(&message);
                }
                Output::Board(system) => self.link.board(system),
                Output::RoundTrip(span) => self.link.round_trip(span),
                Output::Keep(_) => {}
                Output::Say(level, text) => self.said.push((level, text)),
                Output::End(end) => self.end = Some(end),
                Output::Plan(job) => {
                    let number = job.number;
                    if !self.worker.as_ref().is_some_and(|worker| worker.submit(*job)) {
                        let result = Err("the planner has not come back".into());
                        return self.feed(Input::Planned(Answer { number, result }));
                    }
                }
            }
        }
    }
}

impl Craft for Remote {
    fn step(&mut self) -> Result<Vec<(Level, String)>, Failure> {
        let input = match self.link.receive(WAIT) {
            None => Input::Tick,
            Some((_, Event::Up)) => Input::LinkUp,
            Some((_, Event::Down(why))) => Input::LinkDown(why),
            Some((time, Event::Frame(frame))) => {
                self.wire.hear(time, Direction::Down, &frame.message);
                Input::Frame(frame)
            }
        };
        self.feed(input);
        if let Some(answer) = self.worker.as_ref().and_then(Worker::answer) {
            self.feed(Input::Planned(answer));
        }
        if self.began.is_none() && self.flight.phase() == "fly" {
            self.began = Some(self.clock.now());
        }
        Ok(std::mem::take(&mut self.said))
    }

    fn observe(&mut self, seen: Observation) {
        self.feed(Input::Observed(seen));
    }

    fn stop(&mut self, why: &str) {
        self.feed(Input::Stop(why.to_owned()));
    }

    fn now(&self) -> Time {
        self.clock.now()
    }

    fn began(&self) -> Option<Time> {
        self.began
    }

    fn flight(&self) -> &Flight {
        &self.flight
    }

    fn place(&self) -> Option<Place> {
        self.flight.vehicle().and_then(|vehicle| vehicle.fix).map(|fix| fix.place)
    }

    fn emission(&self) -> Emission {
        self.flight.emission().unwrap_or(SILENT)
    }

    fn statistics(&self) -> Statistics {
        self.link.statistics()
    }

    fn wire(&self) -> &Wiretap {
        &self.wire
    }

    fn end(&self) -> Option<&End> {
        self.end.as_ref()
    }
}

impl Drop for Remote {
    /// However it ends: payloads are told level 0.
    fn drop(&mut self) {
        for _ in 0..SILENCES {
            for message in self.flight.silence() {
                self.link.send(&message);
            }
        }
    }
}
