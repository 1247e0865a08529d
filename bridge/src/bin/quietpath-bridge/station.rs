//! What the shorter commands have in common: waiting for the autopilot, and saying who is there.

use std::time::Duration;

use quietpath_bridge::clock::{SystemClock, Time};
use quietpath_bridge::link::codec::companion_heartbeat;
use quietpath_bridge::link::dialect::MavMessage;
use quietpath_bridge::link::{Event, Frame, Link};
use quietpath_bridge::mission::Pace;
use quietpath_bridge::telemetry::param::ReadParam;
use quietpath_bridge::telemetry::timesync::Timesync;
use quietpath_bridge::telemetry::{Telemetry, Vehicle};

use crate::Outcome;
use crate::cli::StatusArgs;
use crate::config::Config;

/// How long to wait for an autopilot.
const WAIT: Duration = Duration::from_secs(10);
/// How often machines are asked what is due.
const TICK: Duration = Duration::from_millis(10);
/// Time between heartbeats.
const HEARTBEAT: Duration = Duration::from_secs(1);

/// A link with an autopilot at its other end.
pub struct Station {
    pub link: Link,
    pub vehicle: Vehicle,
    clock: SystemClock,
    heartbeat: Time,
    timesync: Timesync,
    telemetry: Telemetry,
}

impl Station {
    /// Opens the link and waits for the autopilot.
    pub fn find(config: &Config) -> Result<Self, Outcome> {
        let clock = SystemClock::start();
        let mut link = config.open(clock)?;
        let mut telemetry = Telemetry::new(config.flight.autopilot.choice(), config.flight.system);
        let mut last = String::from("nothing was received");
        let mut heartbeat = None;
        while clock.now().since(Time::ZERO) < WAIT {
            let now = clock.now();
            if heartbeat.is_none_or(|sent| now.since(sent) >= HEARTBEAT) {
                heartbeat = Some(now);
                link.send(&companion_heartbeat());
            }
            match link.receive(TICK) {
                Some((_, Event::Down(why))) => last = why,
                Some((time, Event::Frame(frame))) => {
                    telemetry.handle(time, &frame);
                    last = "frames come, and no heartbeat of the autopilot asked for is among them".into();
                }
                _ => {}
            }
            if let Some(vehicle) = telemetry.vehicle().copied() {
                link.board(vehicle.identity.system);
                let timesync = Timesync::default();
                return Ok(Self { link, vehicle, clock, heartbeat: clock.now(), timesync, telemetry });
            }
        }
        let statistics = link.statistics();
        let more = match (statistics.unsigned, statistics.stray) {
            (0, 0) => String::new(),
            (0, stray) => format!("; {stray} frames of others"),
            (unsigned, _) => {
                format!("; {unsigned} frames were refused for their signature: do both ends have the key?")
            }
        };
        Err(Outcome::Failed(format!("no autopilot within {} s: {last}{more}", WAIT.as_secs())))
    }

    /// Lets a machine work until it says that it is done. It gets frames, and nothing when time has passed.
    pub fn work(&mut self, mut machine: impl FnMut(Time, Option<&Frame>, &mut Vec<MavMessage>) -> bool) {
        loop {
            let now = self.clock.now();
            let mut out = Vec::new();
            if now.since(self.heartbeat) >= HEARTBEAT {
                self.heartbeat = now;
                out.push(companion_heartbeat());
            }
            self.timesync.poll(now, self.vehicle.identity, &mut out);
            let mut done = machine(now, None, &mut out);
            if let Some((time, Event::Frame(frame))) = self.link.receive(TICK) {
                if let MavMessage::TIMESYNC(data) = &frame.message
                    && let Some(span) = self.timesync.handle(time, data, &mut out)
                {
                    self.link.round_trip(span);
                }
                self.telemetry.handle(time, &frame);
                self.vehicle = self.telemetry.vehicle().copied().unwrap_or(self.vehicle);
                done |= machine(time, Some(&frame), &mut out);
            }
            for message in &out {
                self.link.send(message);
            }
            if done {
                return;
            }
        }
    }
}

/// Says who is there and how good the link is.
pub fn status(args: &StatusArgs) -> Outcome {
    let found = Config::read(&args.link).and_then(|config| Station::find(&config));
    let mut station = match found {
        Ok(station) => station,
        Err(outcome) => return outcome,
    };
    let Vehicle { identity, autopilot, .. } = station.vehicle;
    let mut missing = Vec::new();
    for name in &args.params {
        let mut read = ReadParam::new(identity, autopilot, name, Pace::default());
        station.work(|now, frame, out| {
            match frame {
                Some(frame) => read.handle(frame),
                None => read.poll(now, out),
            }
            read.result().is_some()
        });
        match read.result().flatten() {
            Some(value) => println!("{name} = {value}"),
            None => missing.push(name.as_str()),
        }
    }
    let mut begin = None;
    station.work(|now, _, _| now.since(*begin.get_or_insert(now)).as_secs_f64() >= args.seconds);
    let (vehicle, statistics) = (station.vehicle, station.link.statistics());
    println!("{autopilot:?}, {:?}, system {}", vehicle.airframe, identity.system);
    println!("armed {}, mode {:?}, {:?}", vehicle.armed, vehicle.mode, vehicle.flying);
    match vehicle.fix {
        Some(fix) => println!(
            "at {:.7}, {:.7}, {:.1} m above home",
            fix.place.latitude_deg, fix.place.longitude_deg, fix.above_home_m
        ),
        None => println!("position not told"),
    }
    let round_trip =
        statistics.round_trip.map_or("not answered".into(), |span| format!("{:.1} ms", span.as_secs_f64() * 1e3));
    println!("round trip {round_trip}, loss {:.1} %", statistics.loss() * 100.0);
    println!(
        "frames {} in, {} out; junk {} bytes, unreadable {}, refused {}, of others {}",
        statistics.frames_in,
        statistics.frames_out,
        statistics.junk(),
        statistics.unreadable,
        statistics.unsigned + statistics.replayed,
        statistics.stray
    );
    if missing.is_empty() {
        Outcome::Done
    } else {
        Outcome::Failed(format!("the autopilot has no {}", missing.join(", ")))
    }
}
