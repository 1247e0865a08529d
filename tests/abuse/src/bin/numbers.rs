//! Plans random problems in both precisions and dimensions, and writes what came of them.
//!
//! `cargo xtask numbers COUNT` runs it twice: as programs are released, and, for some of the problems, with assertions and
//! overflow checks. Every problem is judged by [`quietpath_abuse::problem::judge`]: no number that is not
//! finite, no infeasible plan where a straight line is feasible, never worse with more time, a status that is right.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use clap::Parser;
use quietpath_abuse::problem::{Broken, KINDS, Verdict, numbered, of_kind};

/// Problems that are drawn at most for one that is planned.
const DRAWS_MAX: u64 = 1000;

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
    /// First problem: to plan one of a campaign again
    #[arg(long, default_value_t = 0)]
    first: u64,
    /// Page to write
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Page to write on
    #[arg(long, value_name = "FILE", conflicts_with = "out")]
    append: Option<PathBuf>,
}

/// What came of one kind of problem.
#[derive(Default)]
struct Tally {
    problems: u64,
    refused: u64,
    results: BTreeMap<&'static str, u64>,
    straight: u64,
    broken: Vec<String>,
}

/// Plans problem `index` of a sequence; which kind it is, what came of it, and how many were drawn before it that are none.
fn attempt(seed: u64, index: u64) -> (usize, Result<Verdict, Broken>, u64) {
    let (kind, draws) = numbered(seed, index);
    for (refused, bytes) in (0..DRAWS_MAX).zip(draws) {
        // A panic is a broken promise like any other.
        let verdict = catch_unwind(AssertUnwindSafe(|| of_kind(kind, &bytes)));
        let verdict = verdict.unwrap_or_else(|panic| Err(Broken(format!("panics: {}", said(&*panic)))));
        if verdict != Ok(Verdict::Refused) {
            return (kind, verdict, refused);
        }
    }
    (kind, Err(Broken(format!("{DRAWS_MAX} problems in a row are refused"))), DRAWS_MAX)
}

fn said(panic: &(dyn std::any::Any + Send)) -> &str {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("no message")
}

fn enter(tallies: &mut [Tally], index: u64, (kind, verdict, refused): (usize, Result<Verdict, Broken>, u64)) {
    let Some(tally) = tallies.get_mut(kind) else { return };
    tally.problems += 1;
    tally.refused += refused;
    match verdict {
        Ok(Verdict::Refused) => tally.refused += 1,
        Ok(Verdict::Planned { status, is_straight }) => {
            *tally.results.entry(status.name()).or_default() += 1;
            tally.straight += u64::from(is_straight);
        }
        Err(Broken(what)) => tally.broken.push(format!("problem {index}: {what}")),
    }
}

const INTRODUCTION: &str = "# Random problems\n\nWritten by `cargo xtask numbers`. A problem is planned seven times: in one \
    workspace with four deadlines that come early, with none, and with none again, and with none in a new workspace. \
    Promises: a plan is feasible and finite, and its objective is the one it claims; where a straight line is feasible there \
    is a plan; more time never gives a worse one; a plan that is infeasible says why; the workspace leaves no trace. *refused* were drawn besides: they are no problems, or \
    begin with a velocity that cannot be followed.\n";

fn section(tallies: &[Tally], arguments: &Arguments, minutes: f64) -> String {
    const RESULTS: [&str; 5] = ["converged", "iteration_limit", "stalled", "infeasible", "non_finite"];
    let title = if cfg!(debug_assertions) { "With assertions and overflow checks" } else { "As released" };
    let broken: usize = tallies.iter().map(|tally| tally.broken.len()).sum();
    let mut out = format!(
        "\n## {title}\n\n{} problems of seed {}, in {minutes:.1} minutes with {} threads: {broken} broken promises.\n\n\
         | | refused | planned | {} | a straight line is feasible | broken promises |\n|---|---|---|{}---|---|\n",
        arguments.count,
        arguments.seed,
        arguments.threads,
        RESULTS.join(" | "),
        "---|".repeat(RESULTS.len())
    );
    for (kind, tally) in KINDS.iter().zip(tallies) {
        let results =
            RESULTS.map(|name| tally.results.get(name).copied().unwrap_or_default().to_string()).join(" | ");
        let (straight, broken) = (tally.straight, tally.broken.len());
        let _ =
            writeln!(out, "| {kind} | {} | {} | {results} | {straight} | {broken} |", tally.refused, tally.problems);
    }
    out
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let begin = Instant::now();
    let tallies = campaign(&arguments);
    let section = section(&tallies, &arguments, begin.elapsed().as_secs_f64() / 60.0);
    print!("{section}");
    let written = match (&arguments.out, &arguments.append) {
        (Some(path), _) => std::fs::write(path, format!("{INTRODUCTION}{section}")),
        (None, Some(path)) => {
            let page = std::fs::read_to_string(path).map(|page| format!("{page}{section}"));
            page.and_then(|page| std::fs::write(path, page))
        }
        (None, None) => Ok(()),
    };
    if let Err(error) = written {
        eprintln!("the page cannot be written: {error}");
        return ExitCode::FAILURE;
    }
    if tallies.iter().all(|tally| tally.broken.is_empty()) { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// Plans all problems; what came of each kind.
fn campaign(arguments: &Arguments) -> Vec<Tally> {
    let tallies: Mutex<Vec<Tally>> = Mutex::new(KINDS.iter().map(|_| Tally::default()).collect());
    let next = AtomicU64::new(arguments.first);
    let end = arguments.first.saturating_add(arguments.count);
    std::thread::scope(|scope| {
        for _ in 0..arguments.threads.max(1) {
            scope.spawn(|| {
                loop {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    if index >= end {
                        break;
                    }
                    let outcome = attempt(arguments.seed, index);
                    if let (_, Err(Broken(what)), _) = &outcome {
                        eprintln!("problem {index}: {what}");
                    }
                    if let Ok(mut tallies) = tallies.lock() {
                        enter(&mut tallies, index, outcome);
                    }
                    if index % 500 == 499 {
                        eprintln!("{} of {end}", index + 1);
                    }
                }
            });
        }
    });
    tallies.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner)
}
