//! Flights on which something goes wrong, each with the outcome that is expected of it.
//!
//! | module | what |
//! |---|---|
//! | [`air`] | the bridge and the simulated autopilot in one process, under one clock |
//! | [`list`] | what goes wrong there |
//! | [`programs`] | what goes wrong with the programs: `quietpath-bridge` and `quietpath autopilot` over loopback UDP |
//!
//! `cargo xtask faults` flies all of them over many seeds and writes `docs/hardening/faults.md`; `tests/tests/faults.rs`
//! flies few. A seed decides the autopilot, the scenario, when the fault comes and how hard.
//!
//! **Promises**, whatever happens: the program does not panic; the autopilot's process goes on; jamming is sent while the
//! plan is flown and no longer than a payload's time to live after it; the vehicle stays in the domain, out of the region and
//! below its speed; the flight ends.

pub mod air;
pub mod list;
pub mod programs;

use std::collections::BTreeMap;
use std::fmt::{self, Write as _};
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use quietpath_bridge::flight::FlyMode;

/// How a flight comes out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Outcome {
    /// The vehicle is at the goal, and the bridge says so.
    Arrives,
    /// The bridge has given up steering, and the vehicle stands in the air.
    Holds,
    /// Somebody else has the vehicle: the bridge has let go of it.
    LetsGo,
    /// The plan is never flown.
    Refuses,
}

impl Outcome {
    /// As the table says it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Arrives => "arrives",
            Self::Holds => "holds",
            Self::LetsGo => "lets go",
            Self::Refuses => "refuses",
        }
    }
}

/// What became of a flight: how it came out, and which promises were broken.
#[derive(Clone, Debug)]
pub struct Flown {
    /// How it came out; `None` where it did not.
    pub outcome: Option<Outcome>,
    /// Promises that were broken.
    pub broken: Vec<String>,
    /// What the bridge said, to find out why.
    pub said: Vec<String>,
}

/// What goes wrong.
pub struct Fault {
    /// Its name, for the command line.
    pub name: &'static str,
    /// What happens.
    pub says: &'static str,
    /// What is expected where the bridge steers; `None` where it is not flown so.
    pub steered: Option<Outcome>,
    /// What is expected where the autopilot flies a mission.
    pub mission: Option<Outcome>,
    /// How it is flown.
    pub fly: Fly,
}

/// How a fault is flown.
pub enum Fly {
    /// In this process.
    Air(air::Trial),
    /// By the programs.
    Programs(programs::Trial),
}

impl Fault {
    /// What is expected in a mode.
    #[must_use]
    pub const fn expected(&self, mode: FlyMode) -> Option<Outcome> {
        match mode {
            FlyMode::Guided => self.steered,
            FlyMode::Mission => self.mission,
        }
    }

    /// Flies it once. A panic is a broken promise like any other.
    #[must_use]
    pub fn fly(&self, mode: FlyMode, seed: u64) -> Flown {
        let flown = catch_unwind(AssertUnwindSafe(|| match &self.fly {
            Fly::Air(trial) => air::fly(trial, mode, seed),
            Fly::Programs(trial) => programs::fly(*trial, mode, seed),
        }));
        flown.unwrap_or_else(|panic| {
            let text = panic.downcast_ref::<String>().cloned();
            let text = text.or_else(|| panic.downcast_ref::<&str>().map(|text| (*text).to_owned()));
            let broken = vec![format!("panics: {}", text.unwrap_or_default())];
            Flown { outcome: None, broken, said: Vec::new() }
        })
    }
}

/// Every fault.
#[must_use]
pub fn all() -> Vec<Fault> {
    list::faults().into_iter().chain(programs::faults()).collect()
}

/// The flights of one fault in one mode.
#[derive(Clone, Debug)]
pub struct Row {
    name: &'static str,
    says: &'static str,
    mode: FlyMode,
    expected: Outcome,
    flights: usize,
    /// Seeds of the flights that came out otherwise, and how.
    unexpected: BTreeMap<u64, String>,
}

impl Row {
    /// Flies a fault over some seeds, some at a time; `None` where it is not flown in that mode.
    ///
    /// # Panics
    /// Never: a flight that panics is a promise broken.
    #[must_use]
    pub fn fly(fault: &Fault, mode: FlyMode, seeds: Range<u64>, at_a_time: usize) -> Option<Self> {
        let expected = fault.expected(mode)?;
        let (flights, next) = (seeds.clone().count(), AtomicU64::new(seeds.start));
        let unexpected = Mutex::new(BTreeMap::new());
        std::thread::scope(|scope| {
            for _ in 0..at_a_time.max(1) {
                scope.spawn(|| {
                    loop {
                        let seed = next.fetch_add(1, Ordering::Relaxed);
                        if seed >= seeds.end {
                            break;
                        }
                        if let Some(why) = unexpected_of(&fault.fly(mode, seed), expected) {
                            unexpected.lock().expect("nobody panics with it").insert(seed, why);
                        }
                    }
                });
            }
        });
        let unexpected = unexpected.into_inner().expect("nobody panics with it");
        Some(Self { name: fault.name, says: fault.says, mode, expected, flights, unexpected })
    }

    /// Whether everything came out as expected.
    #[must_use]
    pub fn is_good(&self) -> bool {
        self.unexpected.is_empty()
    }
}

/// What is unexpected of a flight.
fn unexpected_of(flown: &Flown, expected: Outcome) -> Option<String> {
    if flown.outcome == Some(expected) && flown.broken.is_empty() {
        return None;
    }
    let outcome = flown.outcome.map_or("does not end", Outcome::name);
    Some(format!("{outcome}; {}\n{}", flown.broken.join("; "), flown.said.join("\n")))
}

const fn mode_name(mode: FlyMode) -> &'static str {
    match mode {
        FlyMode::Guided => "steered",
        FlyMode::Mission => "mission",
    }
}

impl fmt::Display for Row {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (name, mode, expected) = (self.name, mode_name(self.mode), self.expected.name());
        let good = self.flights - self.unexpected.len();
        writeln!(f, "{name} ({mode}): {good} of {} flights: {expected}", self.flights)?;
        let told = self.unexpected.iter();
        told.take(3).try_for_each(|(seed, why)| writeln!(f, "UNEXPECTED with --only {name} --seed {seed}: {why}"))
    }
}

/// The page of the outcomes.
#[must_use]
pub fn page(rows: &[Row], command: &str) -> String {
    let flights: usize = rows.iter().map(|row| row.flights).sum();
    let unexpected: usize = rows.iter().map(|row| row.unexpected.len()).sum();
    let mut out = format!(
        "# Faults\n\nWritten by `{command}`: {flights} flights on which something goes wrong, {unexpected} of them with an \
         outcome that is not the expected one. What is promised of every flight, and what a seed decides, stands in \
         `tests/src/faults/mod.rs`.\n\n\
         - *arrives*: the vehicle is at the goal, and the bridge says so.\n\
         - *holds*: the bridge has given up steering, and the vehicle stands in the air.\n\
         - *lets go*: somebody else has the vehicle, and the bridge has ended.\n\
         - *refuses*: the plan is never flown.\n\n\
         | what goes wrong | flown by | expected | flights | as expected | unexpected |\n|---|---|---|---|---|---|\n"
    );
    for row in rows {
        let (count, good) = (row.unexpected.len(), row.flights - row.unexpected.len());
        let (says, mode, expected) = (row.says, mode_name(row.mode), row.expected.name());
        let by = if mode == "steered" { "setpoints" } else { "mission" };
        let _ = writeln!(out, "| {says} | {by} | {expected} | {} | {good} | {count} |", row.flights);
    }
    out
}
