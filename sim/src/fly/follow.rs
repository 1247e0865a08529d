//! A flight of another program, followed by the record that it writes.

use std::fs::File;
use std::io::{BufRead as _, BufReader};
use std::path::Path;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use quietpath_bridge::clock::Time;
use quietpath_bridge::flight::{End, Flight, Input, Level, Output};
use quietpath_bridge::frame::Place;
use quietpath_bridge::link::Statistics;
use quietpath_bridge::payload::Emission;
use quietpath_bridge::record::Reader;
use quietpath_bridge::replan::Observation;

use super::craft::{Craft, SILENT};
use super::watch::Watch;
use super::{Look, TELL, signals};
use crate::outcome::Failure;
use crate::wiretap::{Direction, Wiretap};

/// Pause where nothing new has been written.
const PAUSE: Duration = Duration::from_millis(50);
/// Lines that are read in one go.
const LINES_MAX: usize = 4000;

/// Follows the record of a flight until a signal comes; `tell` hears of what is new. A record that has not begun is waited for.
///
/// # Errors
/// A file that is no record, a line that cannot be read, what `tell` fails with.
pub fn follow(record: &Path, mut tell: impl FnMut(Look<'_>) -> Result<(), Failure>) -> Result<(), Failure> {
    let signalled = signals()?;
    while !has_begun(record) {
        if signalled.load(Ordering::Relaxed) {
            return Ok(());
        }
        std::thread::sleep(PAUSE);
    }
    let mut craft = Recorded::open(record)?;
    let (scenario, plan) = (craft.reader.scenario().clone(), craft.flight().plan().clone());
    let agent = scenario.agents.iter().position(|agent| agent.name == craft.flight().agent()).unwrap_or_default();
    let mut watch = Watch::new(&scenario, &plan, agent)?;
    let mut told: Option<Instant> = None;
    let mut is_news = true;
    while !signalled.load(Ordering::Relaxed) {
        for _ in 0..LINES_MAX {
            let said = craft.step()?;
            if craft.has_caught_up {
                break;
            }
            is_news = true;
            watch.note(&craft, said);
        }
        if is_news && told.is_none_or(|told| told.elapsed() >= TELL) {
            (told, is_news) = (Some(Instant::now()), false);
            watch.look_on(&craft, &[], &mut tell)?;
        }
        if craft.has_caught_up {
            std::thread::sleep(PAUSE);
        }
    }
    Ok(())
}

/// Whether the first line of a record is complete.
fn has_begun(record: &Path) -> bool {
    let mut line = Vec::new();
    let read = File::open(record).and_then(|file| BufReader::new(file).read_until(b'\n', &mut line));
    read.is_ok() && line.ends_with(b"\n")
}

/// A flight as its record tells it.
struct Recorded {
    reader: Reader,
    wire: Wiretap,
    now: Time,
    began: Option<Time>,
    end: Option<End>,
    /// Whether the last step found nothing new.
    has_caught_up: bool,
}

impl Recorded {
    fn open(record: &Path) -> Result<Self, Failure> {
        let reader = Reader::open(record)?;
        let (wire, now) = (Wiretap::default(), Time::ZERO);
        Ok(Self { reader, wire, now, began: None, end: None, has_caught_up: false })
    }
}

impl Craft for Recorded {
    fn step(&mut self) -> Result<Vec<(Level, String)>, Failure> {
        let fed = self.reader.feed()?;
        self.has_caught_up = fed.is_none();
        let Some(fed) = fed else { return Ok(Vec::new()) };
        self.now = fed.time;
        if let Input::Frame(frame) = &fed.input {
            self.wire.hear(fed.time, Direction::Down, &frame.message);
        }
        let mut said = Vec::new();
        for output in fed.outputs {
            match output {
                Output::Send(message) => self.wire.hear(fed.time, Direction::Up, &message),
                Output::Say(level, text) => said.push((level, text)),
                Output::End(end) => self.end = Some(end),
                Output::Board(_) | Output::RoundTrip(_) | Output::Keep(_) | Output::Plan(_) => {}
            }
        }
        if self.began.is_none() && self.flight().phase() == "fly" {
            self.began = Some(fed.time);
        }
        Ok(said)
    }

    /// A record is over and done: nobody can tell it anything.
    fn observe(&mut self, _: Observation) {}

    fn stop(&mut self, _: &str) {}

    fn now(&self) -> Time {
        self.now
    }

    fn began(&self) -> Option<Time> {
        self.began
    }

    fn flight(&self) -> &Flight {
        self.reader.flight()
    }

    fn place(&self) -> Option<Place> {
        self.flight().vehicle().and_then(|vehicle| vehicle.fix).map(|fix| fix.place)
    }

    fn emission(&self) -> Emission {
        self.flight().emission().unwrap_or(SILENT)
    }

    fn statistics(&self) -> Statistics {
        Statistics::default()
    }

    fn wire(&self) -> &Wiretap {
        &self.wire
    }

    fn end(&self) -> Option<&End> {
        self.end.as_ref()
    }
}
