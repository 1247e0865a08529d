//! Planning all cases of a sweep, on every core.
//!
//! First each case is planned on its own. Then every plan is handed to both neighbours as a start, as long as
//! that makes some plan better (continuation): a plan for less time or a smaller budget is feasible with more, and
//! one for a larger budget is made to fit by lowering its controls in proportion. In the end no case is worse than
//! the one before it. The result does not depend on the number of cores: a round uses the plans of the round before.

use std::sync::atomic::{AtomicUsize, Ordering};

use quietpath_bridge::file::{FileError, PlanFile};
use quietpath_bridge::planning::{self, Options, Planned, assess};

use super::{Case, Over};

/// A plan is better when its objective is lower by this part of max(1, |objective|).
const BETTER: f64 = 1e-9;
/// Rounds of handing plans to neighbours, as a multiple of the number of cases.
const ROUNDS: usize = 2;

/// A case and its plan.
#[derive(Clone, Debug, PartialEq)]
pub struct Point {
    /// The case.
    pub case: Case,
    /// Its plan.
    pub planned: Planned,
}

/// All points, in ascending order of what was swept.
#[derive(Clone, Debug, PartialEq)]
pub struct Swept {
    /// What was swept.
    pub over: Over,
    /// The points.
    pub points: Vec<Point>,
}

/// Plans all cases; `done` hears of the plans made and those to make so far.
///
/// # Errors
/// What the planner refuses.
pub fn sweep(
    cases: Vec<Case>,
    over: Over,
    options: &Options,
    done: &(dyn Fn(usize, usize) + Sync),
) -> Result<Swept, Box<FileError>> {
    let (made, wanted) = (AtomicUsize::new(0), AtomicUsize::new(cases.len()));
    let count = || done(made.fetch_add(1, Ordering::Relaxed) + 1, wanted.load(Ordering::Relaxed));
    let alone = in_parallel(&cases, |case| {
        let planned = planning::plan(&case.scenario, options);
        count();
        planned
    });
    let mut best: Vec<Planned> = alone.into_iter().collect::<Result<_, _>>()?;
    // For each case, whether its plan is new to its neighbours.
    let mut fresh = vec![true; cases.len()];
    for _ in 0..ROUNDS * cases.len() {
        let jobs: Vec<[usize; 2]> = (0..cases.len())
            .flat_map(|case| [case.checked_sub(1), Some(case + 1)].map(|neighbour| (case, neighbour)))
            .filter_map(|(case, neighbour)| neighbour.map(|neighbour| [case, neighbour]))
            .filter(|[_, neighbour]| fresh.get(*neighbour).copied().unwrap_or(false))
            .collect();
        if jobs.is_empty() {
            break;
        }
        wanted.fetch_add(jobs.len(), Ordering::Relaxed);
        let tried = in_parallel(&jobs, |[case, neighbour]| {
            let found = cases.get(*case).zip(best.get(*neighbour)).map(|(case, neighbour)| {
                let start = fitted(case, &neighbour.plan);
                planning::improve(&case.scenario, &start, options)
            });
            count();
            found.transpose()
        });
        fresh.fill(false);
        for ([case, _], found) in jobs.iter().zip(tried) {
            let slots = best.get_mut(*case).zip(fresh.get_mut(*case));
            if let (Some((best, fresh)), Some(found)) = (slots, found?)
                && is_better(&found, best)
            {
                (*best, *fresh) = (found, true);
            }
        }
    }
    hand_on(&cases, &mut best)?;
    let points = cases.into_iter().zip(best).map(|(case, planned)| Point { case, planned }).collect();
    Ok(Swept { over, points })
}

/// Takes over the plan of the case before as it is, wherever that is better still.
fn hand_on(cases: &[Case], best: &mut [Planned]) -> Result<(), Box<FileError>> {
    for index in 1..cases.len() {
        let (before, from) = best.split_at_mut(index);
        let (Some(before), Some(own), Some(case)) = (before.last(), from.first_mut(), cases.get(index)) else {
            break;
        };
        let assessment = assess(&case.scenario, &before.plan, "the plan before")?;
        let plan = PlanFile { objective: Some(assessment.objective), ..before.plan.clone() };
        let taken = Planned { plan, assessment, ..before.clone() };
        if taken.assessment.feasible && (!own.assessment.feasible || objective(&taken) < objective(own)) {
            *own = taken;
        }
    }
    Ok(())
}

fn objective(planned: &Planned) -> f64 {
    planned.assessment.objective
}

fn is_better(found: &Planned, best: &Planned) -> bool {
    let gain = objective(best) - objective(found);
    found.assessment.feasible && (!best.assessment.feasible || gain > BETTER * objective(best).abs().max(1.0))
}

/// A plan of another case with its controls lowered to the budgets of this one.
fn fitted(case: &Case, plan: &PlanFile) -> PlanFile {
    let mut plan = plan.clone();
    let times = plan.node_times();
    for (agent, entry) in plan.agents.iter_mut().zip(&case.scenario.agents) {
        let budgets = [entry.jammer.map(|jammer| jammer.budget), entry.dropout.map(|dropout| dropout.budget)];
        for (levels, budget) in [&mut agent.jam, &mut agent.dropout].into_iter().zip(budgets) {
            if let (Some(levels), Some(budget)) = (levels, budget) {
                let spent = spent(levels, &times);
                let share = if spent > budget { budget / spent } else { 1.0 };
                levels.iter_mut().for_each(|level| *level *= share);
            }
        }
    }
    plan
}

/// What a control spends of its budget: (49), (55), s.
#[must_use]
pub fn spent(levels: &[f64], times: &[f64]) -> f64 {
    let intervals = times.iter().zip(times.iter().skip(1)).map(|(a, b)| b - a);
    levels.iter().skip(1).zip(intervals).map(|(level, interval)| level * interval).sum()
}

/// Does all jobs, each once, on as many threads as there are cores; results in the order of the jobs.
fn in_parallel<J: Sync, R: Send>(jobs: &[J], work: impl Fn(&J) -> R + Sync) -> Vec<R> {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let next = AtomicUsize::new(0);
    let worker = || {
        let mut results = Vec::new();
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            let Some(job) = jobs.get(index) else { return results };
            results.push((index, work(job)));
        }
    };
    let mut results: Vec<(usize, R)> = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..cores.min(jobs.len())).map(|_| scope.spawn(worker)).collect();
        let joined = threads.into_iter().map(std::thread::ScopedJoinHandle::join);
        joined.flat_map(|results| results.unwrap_or_else(|panic| std::panic::resume_unwind(panic))).collect()
    });
    results.sort_by_key(|(index, _)| *index);
    results.into_iter().map(|(_, result)| result).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_come_in_the_order_of_the_jobs() {
        let jobs: Vec<u64> = (0..100).collect();
        let squares = in_parallel(&jobs, |job| job * job);
        assert_eq!(squares, jobs.iter().map(|job| job * job).collect::<Vec<_>>());
    }

    #[test]
    fn node_0_spends_nothing() {
        assert!((spent(&[1.0, 0.5, 0.25], &[0.0, 2.0, 6.0]) - 2.0).abs() < 1e-12);
    }
}
