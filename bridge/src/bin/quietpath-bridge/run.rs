//! `run`: a flight on a real link.
//!
//! One thread decides, the one that runs this loop; it never waits for the planner, the link or the disk for longer
//! than [`TICK`]. A panic in it is caught, payloads are told level 0, and the program ends.

use std::io::{IsTerminal, Write as _};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use quietpath_bridge::clock::{SystemClock, Time};
use quietpath_bridge::flight::{End, Flight, Input, Level, Output};
use quietpath_bridge::link::codec::plain_bytes;
use quietpath_bridge::link::dialect::MavMessage;
use quietpath_bridge::link::{Event, Link};
use quietpath_bridge::record::{Beginning, Recorder};
use quietpath_bridge::replan::{Answer, Worker};
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGXFSZ};

use crate::Outcome;
use crate::cli::RunArgs;
use crate::config::Config;
use crate::observe::Observations;
use crate::state::State;

/// Longest that the loop waits for a frame.
const TICK: Duration = Duration::from_millis(4);
/// Time between two status lines.
const STATUS: Duration = Duration::from_secs(1);
/// Time between two lines of the log that say the same as the status line, where nobody watches.
const STATUS_LOG: Duration = Duration::from_secs(10);
/// How often level 0 is said at the end.
const SILENCES: usize = 3;

/// Flies a plan.
pub fn run(args: &RunArgs) -> Outcome {
    match Loop::new(args) {
        Ok((mut flight, mut around)) => {
            guarded(&mut flight, &mut around, Loop::fly, |around, message| around.link.send(message))
        }
        Err(outcome) => outcome,
    }
}

/// Flies, and tells payloads level 0 however that ends. More than once: a frame may be lost, and nobody is left to say
/// it again.
fn guarded<S>(
    flight: &mut Flight,
    around: &mut S,
    fly: impl FnOnce(&mut S, &mut Flight) -> Outcome,
    mut send: impl FnMut(&mut S, &MavMessage),
) -> Outcome {
    let flown = catch_unwind(AssertUnwindSafe(|| fly(around, flight)));
    for _ in 0..SILENCES {
        for message in flight.silence() {
            send(around, &message);
        }
    }
    flown.unwrap_or_else(|panic| Outcome::Fault(describe(panic.as_ref())))
}

fn describe(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().copied().or_else(|| panic.downcast_ref::<String>().map(String::as_str));
    format!("a fault in the program: {}; payloads were silenced", text.unwrap_or("no message"))
}

/// Everything around a flight.
struct Loop {
    link: Link,
    clock: SystemClock,
    observations: Observations,
    worker: Option<Worker>,
    recorder: Option<Recorder>,
    state: State,
    stop: Arc<AtomicBool>,
    status: Time,
    status_log: Time,
    end: Option<End>,
}

impl Loop {
    fn new(args: &RunArgs) -> Result<(Flight, Self), Outcome> {
        let fault = |error: std::io::Error| Outcome::Fault(error.to_string());
        // A file that may not grow any more is an error to who writes it, and not the end of the program.
        signal_hook::flag::register(SIGXFSZ, Arc::default()).map_err(fault)?;
        let config = Config::read(&args.link)?.with_files(&args.files).with_run(args);
        let (scenario, plan) = config.load()?;
        let settings = config.flight.clone();
        let new =
            || Flight::new(&scenario, &plan, settings.clone()).map_err(|error| Outcome::Input(error.to_string()));
        let state = State::new(config.state.clone());
        let (flight, journal) = match state.read() {
            None => (new()?, None),
            Some(journal) => match new()?.resuming(journal.clone()) {
                Ok(flight) => (flight, Some(journal)),
                Err(why) => {
                    tracing::warn!("the flight that was interrupted is not this one: {why}");
                    (new()?, None)
                }
            },
        };
        let clock = SystemClock::at_speed(args.speedup).ok_or_else(|| {
            Outcome::Input("--speedup is how many times faster than time to fly: a number above 0".into())
        })?;
        let observations = config.observed()?;
        let beginning =
            Beginning { scenario: &scenario, plan: &plan, settings: &settings, journal: journal.as_ref() };
        let recorder = match &config.record {
            None => None,
            Some(path) => Some(
                Recorder::create(path, &beginning, clock.now())
                    .map_err(|error| Outcome::Input(format!("{}: cannot be written: {error}", path.display())))?,
            ),
        };
        if let Some(recorder) = &recorder {
            tracing::info!("recording to {}", recorder.path().display());
        }
        let worker = match settings.replan {
            None => None,
            Some(replan) => {
                let deadline = Duration::try_from_secs_f64(replan.deadline_s)
                    .map_err(|_| Outcome::Input("flight.replan.deadline_s must be a time in seconds".into()))?;
                Some(Worker::start(clock.real(deadline)).map_err(fault)?)
            }
        };
        let stop = Arc::new(AtomicBool::new(false));
        for signal in [SIGINT, SIGTERM, SIGHUP] {
            signal_hook::flag::register(signal, Arc::clone(&stop)).map_err(fault)?;
        }
        let link = config.open(clock)?;
        let (status, status_log) = (Time::ZERO, Time::ZERO);
        let around = Self { link, clock, observations, worker, recorder, state, stop, status, status_log, end: None };
        Ok((flight, around))
    }

    fn fly(&mut self, flight: &mut Flight) -> Outcome {
        let mut is_stopping = false;
        loop {
            let input = match self.link.receive(TICK) {
                None => Input::Tick,
                Some((_, Event::Up)) => Input::LinkUp,
                Some((_, Event::Down(why))) => Input::LinkDown(why),
                Some((_, Event::Frame(frame))) => Input::Frame(frame),
            };
            self.feed(flight, input);
            for seen in self.observations.poll() {
                match seen {
                    Ok(observation) => self.feed(flight, Input::Observed(observation)),
                    Err(why) => tracing::warn!("an observation {why}"),
                }
            }
            if let Some(answer) = self.worker.as_ref().and_then(Worker::answer) {
                self.feed(flight, Input::Planned(answer));
            }
            if self.stop.load(Ordering::Relaxed) && !is_stopping {
                is_stopping = true;
                self.feed(flight, Input::Stop("ended by a signal".into()));
            }
            if let Some(end) = self.end.take() {
                return match end {
                    End::Done => Outcome::Done,
                    End::Released(why) => Outcome::Released(format!("let go: {why}")),
                    End::Stopped(why) => Outcome::Stopped(why),
                    End::Failed(why) => Outcome::Failed(why),
                };
            }
            self.tell(flight);
        }
    }

    /// Feeds an input, and does what comes out.
    fn feed(&mut self, flight: &mut Flight, input: Input) {
        let now = self.clock.now();
        let outputs = flight.step(now, input.clone());
        if let Some(recorder) = &mut self.recorder {
            recorder.write(now, &input, &outputs);
        }
        let mut failed = None;
        for output in outputs {
            match output {
                Output::Send(message) => self.send(now, &message),
                Output::Board(system) => self.link.board(system),
                Output::RoundTrip(span) => self.link.round_trip(span),
                Output::Keep(journal) => self.state.keep(journal.as_deref()),
                Output::Say(Level::Info, text) => tracing::info!("{text}"),
                Output::Say(Level::Warn, text) => tracing::warn!("{text}"),
                Output::End(end) => self.end = Some(end),
                Output::Plan(job) => {
                    let number = job.number;
                    if !self.worker.as_ref().is_some_and(|worker| worker.submit(*job)) {
                        failed = Some(Answer { number, result: Err("the planner has not come back".into()) });
                    }
                }
            }
        }
        if let Some(answer) = failed {
            self.feed(flight, Input::Planned(answer));
        }
    }

    fn send(&mut self, now: Time, message: &MavMessage) {
        self.link.send(message);
        if let Some(recorder) = &mut self.recorder {
            recorder.frame(now, &plain_bytes(self.link.endpoint().identity(), message));
        }
    }

    /// The status line: in place on a terminal, now and then in a log.
    fn tell(&mut self, flight: &Flight) {
        let now = self.clock.now();
        let is_terminal = std::io::stderr().is_terminal();
        let (due, interval) =
            if is_terminal { (&mut self.status, STATUS) } else { (&mut self.status_log, STATUS_LOG) };
        if now.since(*due) < interval {
            return;
        }
        *due = now;
        let line = self.line(flight);
        if is_terminal {
            // A terminal that is gone must not end a flight.
            let mut terminal = std::io::stderr();
            let _ = write!(terminal, "\r\x1b[2K{line}\r").and_then(|()| terminal.flush());
        } else {
            tracing::info!("{line}");
        }
    }

    fn line(&self, flight: &Flight) -> String {
        let statistics = self.link.statistics();
        let vehicle = flight.vehicle().map_or("no vehicle".to_owned(), |vehicle| {
            let height = vehicle.fix.map_or("?".to_owned(), |fix| format!("{:.0}", fix.above_home_m));
            format!("{:?} {:?} armed {} {height} m", vehicle.autopilot, vehicle.mode, vehicle.armed)
        });
        let jam = flight.emission().map_or(0.0, |emission| emission.level);
        let trip = statistics.round_trip.map_or("-".to_owned(), |span| format!("{:.0} ms", span.as_secs_f64() * 1e3));
        let loss = statistics.loss() * 100.0;
        format!("{} | {vehicle} | jam {jam:.2} | round trip {trip}, loss {loss:.1} %", flight.phase())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use quietpath_bridge::file::plan::AgentPlan;
    use quietpath_bridge::file::{PlanFile, ScenarioFile};
    use quietpath_bridge::flight::Settings;
    use quietpath_bridge::flight::settings::{PayloadEntry, PayloadKind};
    use quietpath_bridge::link::dialect::{HEARTBEAT_DATA, MavAutopilot, MavCmd, MavType};
    use quietpath_bridge::link::{Frame, Identity};

    #[test]
    fn a_panic_ends_in_level_0() {
        let text = include_str!("../../../../sim/scenarios/starter.toml");
        let mut scenario = ScenarioFile::parse("starter.toml", text).expect("a scenario").scenario;
        scenario.agents.truncate(1);
        scenario.agents[0].jammer_live = true;
        let (start, goal) = (scenario.agents[0].start.clone(), scenario.agents[0].goal.clone());
        let agent =
            AgentPlan { name: scenario.agents[0].name.clone(), path: vec![start, goal], ..AgentPlan::default() };
        let plan = PlanFile { duration: 100.0, agents: vec![agent], ..PlanFile::default() };
        let payload =
            vec![PayloadEntry { kind: PayloadKind::Jammer, component: 26, instance: 0, mission_output: None }];
        let settings = Settings { payload, jammer_armed: true, ..Settings::default() };
        let mut flight = Flight::new(&scenario, &plan, settings).expect("a flight");
        let (mavtype, autopilot) = (MavType::MAV_TYPE_QUADROTOR, MavAutopilot::MAV_AUTOPILOT_PX4);
        let message = MavMessage::HEARTBEAT(HEARTBEAT_DATA { mavtype, autopilot, ..Default::default() });
        let from = Identity { system: 1, component: 1 };
        let frame = Frame { from, sequence: 0, message, bytes: Vec::new() };
        let mut sent: Vec<MavMessage> = Vec::new();
        let body = |_: &mut Vec<MavMessage>, flight: &mut Flight| {
            flight.step(Time::ZERO, Input::Frame(Box::new(frame)));
            panic!("out of the blue")
        };
        let outcome = guarded(&mut flight, &mut sent, body, |sent, message| sent.push(message.clone()));
        assert!(matches!(&outcome, Outcome::Fault(why) if why.contains("out of the blue")), "{outcome:?}");
        let level = |message: &MavMessage| match message {
            MavMessage::COMMAND_LONG(data) => (data.command, data.param2),
            other => panic!("{other:?}"),
        };
        let levels: Vec<_> = sent.iter().map(level).collect();
        assert_eq!(levels, [(MavCmd::MAV_CMD_USER_2, 0.0); SILENCES]);
    }
}
