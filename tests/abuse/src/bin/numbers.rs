//! Plans random problems in both precisions and dimensions, and writes what came of them.
//!
//! `cargo xtask numbers COUNT` runs it. Every problem is judged by [`quietpath_abuse::problem::judge`]: no number that is not
//! finite, no infeasible plan where a straight line is feasible, never worse with more time, a status that is right.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use clap::Parser;
use fastrand::Rng;
use quietpath_abuse::problem::{Broken, KINDS, Verdict, of_kind};

/// Bytes that a problem is drawn from: more than it takes.
const BYTES: usize = 2048;
/// Broken promises that are told in full.
const TOLD_MAX: usize = 10;

#[derive(Parser)]
#[command(about = "Plans random problems in f32 and f64, and judges the plans")]
struct Arguments {
    /// Problems
    #[arg(default_value_t = 10_000)]
    count: u64,
    /// Seed of the sequence
    #[arg(long, default_value_t = 8)]
    seed: u64,
    /// Threads
    #[arg(long, default_value_t = 2)]
    threads: usize,
    /// Page to write
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// What came of one kind of problem.
#[derive(Default)]
struct Tally {
    problems: u64,
    results: BTreeMap<&'static str, u64>,
    straight: u64,
    broken: Vec<String>,
}

/// Plans problem `index` of a sequence; which kind it is, and what came of it.
fn attempt(seed: u64, index: u64) -> (usize, Result<Verdict, Broken>) {
    // Neighbouring seeds must not give neighbouring sequences.
    let mut random = Rng::with_seed((seed << 32) ^ (index / 4).wrapping_mul(0x9e37_79b9_7f4a_7c15));
    let bytes: Vec<u8> = (0..BYTES).map(|_| random.u8(..)).collect();
    let kind = usize::try_from(index % 4).unwrap_or_default();
    (kind, of_kind(kind, &bytes))
}

fn enter(tallies: &mut [Tally], index: u64, (kind, verdict): (usize, Result<Verdict, Broken>)) {
    let Some(tally) = tallies.get_mut(kind) else { return };
    tally.problems += 1;
    match verdict {
        Ok(Verdict::Refused) => *tally.results.entry("refused").or_default() += 1,
        Ok(Verdict::Planned { status, is_straight }) => {
            *tally.results.entry(status.name()).or_default() += 1;
            tally.straight += u64::from(is_straight);
        }
        Err(Broken(what)) => tally.broken.push(format!("problem {index}: {what}")),
    }
}

fn page(tallies: &[Tally], arguments: &Arguments) -> String {
    const RESULTS: [&str; 6] = ["converged", "iteration_limit", "stalled", "infeasible", "non_finite", "refused"];
    let mut out = format!(
        "# Random problems\n\nWritten by `cargo xtask numbers {}`, seed {}. A problem is planned six times: with four deadlines \
         that come early, and with none, in a workspace that is new and in one that is used. Promises: a plan is feasible \
         and finite, and its objective is the one it claims; where a straight line is feasible there is a plan; more time \
         never gives a worse one; a plan that is infeasible says why; the workspace leaves no trace.\n\n\
         | | problems | {} | a straight line is feasible | broken promises |\n|---|---|{}---|---|\n",
        arguments.count,
        arguments.seed,
        RESULTS.join(" | "),
        "---|".repeat(RESULTS.len())
    );
    for (kind, tally) in KINDS.iter().zip(tallies) {
        let results =
            RESULTS.map(|name| tally.results.get(name).copied().unwrap_or_default().to_string()).join(" | ");
        let (straight, broken) = (tally.straight, tally.broken.len());
        let _ = writeln!(out, "| {kind} | {} | {results} | {straight} | {broken} |", tally.problems);
    }
    out
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let tallies: Mutex<Vec<Tally>> = Mutex::new(KINDS.iter().map(|_| Tally::default()).collect());
    let next = AtomicU64::new(0);
    std::thread::scope(|scope| {
        for _ in 0..arguments.threads.max(1) {
            scope.spawn(|| {
                loop {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    if index >= arguments.count {
                        break;
                    }
                    let outcome = attempt(arguments.seed, index);
                    if let Ok(mut tallies) = tallies.lock() {
                        enter(&mut tallies, index, outcome);
                    }
                    if index % 500 == 499 {
                        eprintln!("{} of {}", index + 1, arguments.count);
                    }
                }
            });
        }
    });
    let tallies = tallies.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
    let page = page(&tallies, &arguments);
    print!("{page}");
    if let Some(path) = &arguments.out
        && let Err(error) = std::fs::write(path, &page)
    {
        eprintln!("{}: cannot be written: {error}", path.display());
        return ExitCode::FAILURE;
    }
    let broken: Vec<&String> = tallies.iter().flat_map(|tally| &tally.broken).collect();
    for what in broken.iter().take(TOLD_MAX) {
        eprintln!("{what}");
    }
    if broken.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
