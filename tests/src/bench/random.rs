//! Made-up scenarios: the default plan against the best of many starts of the same solver.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use fastrand::Rng;
use quietpath_bridge::planning::{Options, improve};

use super::figure::{gap, median, quantile};
use super::published::ours;
use super::{machine, page};
use crate::instances::{Instance, instance};
use crate::starts;

/// How to measure.
#[derive(Clone, Copy, Debug)]
pub struct Request {
    /// Number of scenarios.
    pub count: u64,
    /// Seed of the sequence.
    pub seed: u64,
    /// Random starts of each.
    pub starts: usize,
}

/// What came of one scenario.
struct Outcome {
    index: u64,
    features: Vec<&'static str>,
    /// Objective and feasibility of the default plan, its seconds, its status.
    ours: Result<(f64, bool, f64, &'static str), String>,
    /// Best of all feasible random starts.
    best: Option<f64>,
    /// Random starts that were found.
    starts: usize,
}

impl Outcome {
    /// Gap of a feasible default plan to the best of all, itself included.
    fn gap(&self) -> Option<f64> {
        let (objective, is_feasible, ..) = *self.ours.as_ref().ok()?;
        is_feasible.then(|| gap(objective, self.best.map_or(objective, |best| best.min(objective))))
    }

    /// How much better the default plan is than the best random start.
    fn lead(&self) -> Option<f64> {
        let (objective, is_feasible, ..) = *self.ours.as_ref().ok()?;
        is_feasible.then_some(gap(objective, self.best?))
    }
}

/// Measures on all cores, prints, and writes the section.
///
/// # Errors
/// The page cannot be written.
///
/// # Panics
/// A drawn scenario is not valid.
pub fn run(request: &Request) -> std::io::Result<()> {
    let opening = machine::described();
    let (next, done) = (AtomicU64::new(0), Mutex::new(Vec::new()));
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(|| {
                loop {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    if index >= request.count {
                        break;
                    }
                    let outcome = attempt(&instance(request.seed, index), index, request);
                    println!("{}", line(&outcome));
                    if let Ok(mut done) = done.lock() {
                        done.push(outcome);
                    }
                }
            });
        }
    });
    let mut outcomes = done.into_inner().unwrap_or_default();
    outcomes.sort_by_key(|outcome| outcome.index);
    let body = section(&opening, &outcomes, request);
    println!("\n{body}");
    page::write("Random instances", &body)
}

fn attempt(instance: &Instance, index: u64, request: &Request) -> Outcome {
    let scenario = instance.scenario();
    let ours = caught(|| ours(&scenario)).map(|(planned, seconds)| {
        (planned.assessment.objective, planned.assessment.feasible, seconds, planned.status.name())
    });
    let mut random = Rng::with_seed(request.seed ^ (index << 20) ^ 0x5eed);
    let (mut best, mut found) = (None::<f64>, 0);
    for _ in 0..request.starts {
        let Some(start) = starts::random(&scenario, &mut random) else { continue };
        found += 1;
        let again = caught(|| improve(&scenario, &start, &Options::default()).map_err(|error| error.to_string()));
        let Ok(planned) = again else { continue };
        if planned.assessment.feasible {
            best = Some(best.map_or(planned.assessment.objective, |best| best.min(planned.assessment.objective)));
        }
    }
    Outcome { index, features: instance.features.clone(), ours, best, starts: found }
}

/// The same, a panic being one more error: it must not end the run, but stand on the page.
fn caught<V>(work: impl FnOnce() -> Result<V, String>) -> Result<V, String> {
    let done = std::panic::catch_unwind(std::panic::AssertUnwindSafe(work));
    done.unwrap_or_else(|_| Err("PANIC, see standard error".into()))
}

fn line(outcome: &Outcome) -> String {
    let result = match &outcome.ours {
        Ok((objective, is_feasible, seconds, status)) => {
            let gap = outcome.lead().map_or_else(|| "none".into(), |gap| format!("{gap:+.2e}"));
            let feasible = if *is_feasible { "feasible" } else { "INFEASIBLE" };
            format!("{objective:13.5} gap {gap:>9} {feasible} {status} {:.0} ms", 1e3 * seconds)
        }
        Err(error) => format!("error: {}", error.lines().next().unwrap_or_default()),
    };
    format!("{:4} {result}  ({} starts) {}", outcome.index, outcome.starts, outcome.features.join(", "))
}

fn section(opening: &str, outcomes: &[Outcome], request: &Request) -> String {
    let mut text = format!(
        "{opening} `cargo xtask bench --random {} --seed {} --starts {}`.\n\n\
         Gap: of the default plan to the best of itself and of the same solver from random detours.\n\n",
        request.count, request.seed, request.starts
    );
    text.push_str(&table(outcomes));
    let feasible = |wanted: bool| {
        outcomes.iter().filter(|outcome| matches!(&outcome.ours, Ok((_, is, ..)) if *is == wanted)).count()
    };
    let worse: Vec<f64> = outcomes.iter().filter_map(Outcome::lead).collect();
    let times: Vec<f64> =
        outcomes.iter().filter_map(|outcome| outcome.ours.as_ref().ok().map(|found| 1e3 * found.2)).collect();
    let _ = writeln!(
        text,
        "\n{} planned feasibly, {} infeasible, {} errors. The default plan is the best, to 1e-6, in {} of {} that random \
         starts solved too,\nand {} random starts an instance were feasible to begin with. Planning time: median {:.1} ms, 90 % {:.1} ms, \
         worst {:.1} ms (all cores busy).",
        feasible(true),
        feasible(false),
        outcomes.iter().filter(|outcome| outcome.ours.is_err()).count(),
        worse.iter().filter(|gap| **gap <= 1e-6).count(),
        worse.len(),
        median(&outcomes.iter().map(|outcome| outcome.starts as f64).collect::<Vec<_>>()),
        median(&times),
        quantile(&times, 0.9),
        quantile(&times, 1.0),
    );
    for outcome in outcomes {
        let trouble = match &outcome.ours {
            Ok((_, true, ..)) => continue,
            Ok((_, false, _, status)) => format!("infeasible, {status}"),
            Err(error) => error.lines().next().unwrap_or_default().to_owned(),
        };
        let solved = if outcome.best.is_some() { "random starts solve it" } else { "random starts do not either" };
        let _ = writeln!(text, "- {} ({}): {trouble}; {solved}", outcome.index, outcome.features.join(", "));
    }
    let mut worst: Vec<(f64, &Outcome)> = outcomes
        .iter()
        .filter_map(|outcome| Some((outcome.gap()?, outcome)))
        .filter(|(gap, _)| *gap > 1e-3)
        .collect();
    worst.sort_by(|a, b| b.0.total_cmp(&a.0));
    if !worst.is_empty() {
        text.push_str("\nLargest gaps:\n");
    }
    for (gap, outcome) in worst.iter().take(12) {
        let _ = writeln!(text, "- {} ({}): {gap:+.1e}", outcome.index, outcome.features.join(", "));
    }
    text
}

/// The distribution of gaps, over all and by feature.
fn table(outcomes: &[Outcome]) -> String {
    let mut groups: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    let mut all = Vec::new();
    for outcome in outcomes {
        let Some(gap) = outcome.gap() else { continue };
        all.push(gap);
        for feature in &outcome.features {
            groups.entry(feature).or_default().push(gap);
        }
    }
    let mut text = String::from(
        "| instances | count | median gap | 90 % | worst | above 1e-3 |\n|---|---:|---:|---:|---:|---:|\n",
    );
    for (name, gaps) in std::iter::once(("all", all)).chain(groups) {
        let _ = writeln!(
            text,
            "| {name} | {} | {:+.1e} | {:+.1e} | {:+.1e} | {} |",
            gaps.len(),
            median(&gaps),
            quantile(&gaps, 0.9),
            quantile(&gaps, 1.0),
            gaps.iter().filter(|gap| **gap > 1e-3).count()
        );
    }
    text
}
