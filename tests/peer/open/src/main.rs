//! The peer: OpEn (PANOC in an augmented Lagrangian loop) on quietpath's scenario files, from the straight line.
//!
//! Requests and answers are those of `tests/peer/ipopt.py`.
//!
//! | symbol | name | unit | shape |
//! |---|---|---|---|
//! | u | decision | 1 | DIM (N - 1) + 1, the last is for flight time |
//! | L | factor of D1' D1 = L L' | | N - 1 |
//! | c | distance flown in one interval at full speed | length units | |
//!
//! How the peer is treated:
//! - x = line + c L^-T u: in these coordinates, a gradient step is one in the velocity metric. In node positions PANOC
//!   crawls.
//! - The gradient is the analytic one of quietpath's own core; cost and constraints are scaled to order one.
//! - Speed, acceleration and domain are constraints of the augmented Lagrangian; flight time is a box.
//! - `seconds` is OpEn's call alone. Three penalties to begin with, as variants.
//!
//! Limits: one agent without jamming, dropout, regions, limits, start velocity, or worst-case terms.

mod problem;

use std::io::{BufRead, Write};
use std::time::Instant;

use optimization_engine::alm::{AlmCache, AlmFactory, AlmOptimizer, AlmProblem, NO_JACOBIAN_MAPPING, NO_MAPPING};
use optimization_engine::constraints::{Ball2, Rectangle};
use optimization_engine::panoc::PANOCCache;
use quietpath_bridge::file::ScenarioFile;
use serde_json::{Value, json};

use problem::Problem;

const TOLERANCE: f64 = 1e-5;
const MEMORY: usize = 20;
const OUTER_MAX: usize = 60;
const INNER_MAX: usize = 3000;
const SECONDS_MAX: u64 = 60;
const STACK_BYTES: usize = 256 << 20;

/// Penalty to begin with, by variant.
const VARIANTS: [(&str, f64); 3] = [("penalty-1", 1.0), ("penalty-10", 10.0), ("penalty-100", 100.0)];

fn main() -> std::io::Result<()> {
    let thread = std::thread::Builder::new().stack_size(STACK_BYTES).spawn(serve)?;
    thread.join().unwrap_or_else(|_| Err(std::io::Error::other("the peer panicked")))
}

fn serve() -> std::io::Result<()> {
    for line in std::io::stdin().lock().lines() {
        let request: Value = serde_json::from_str(&line?).unwrap_or_default();
        let answer = answered(&request).unwrap_or_else(|error| json!({ "error": error }));
        let mut out = std::io::stdout().lock();
        writeln!(out, "{answer}")?;
        out.flush()?;
    }
    Ok(())
}

fn answered(request: &Value) -> Result<Value, String> {
    if request["versions"] == true {
        let names: Vec<&str> = VARIANTS.iter().map(|(name, _)| *name).collect();
        let versions = format!("optimization_engine 0.12, tolerance {TOLERANCE:e}, memory {MEMORY}, H1 coordinates");
        return Ok(json!({ "versions": versions, "variants": names }));
    }
    let path = request["scenario"].as_str().unwrap_or_default();
    let variant = VARIANTS.iter().find(|(name, _)| request["variant"] == **name).ok_or("no such variant")?;
    let scenario = ScenarioFile::read(path).map_err(|error| error.to_string())?.scenario;
    match scenario.dimension {
        3 => solve::<3>(&scenario, variant.1),
        _ => solve::<2>(&scenario, variant.1),
    }
}

fn solve<const DIM: usize>(scenario: &ScenarioFile, penalty: f64) -> Result<Value, String> {
    let begin = Instant::now();
    let problem = Problem::<DIM>::new(scenario)?;
    let (low, high) = problem.bounds();
    let (row_low, row_high) = problem.row_bounds();
    let rows = row_low.len();
    let panoc = PANOCCache::new(low.len(), TOLERANCE, MEMORY);
    let mut cache = AlmCache::new(panoc, rows, 0);
    let set = Rectangle::new(Some(&row_low), Some(&row_high));
    let cost = |u: &[f64], cost: &mut f64| problem.cost(u, cost);
    let slope = |u: &[f64], slope: &mut [f64]| problem.slope(u, slope);
    let constraints = |u: &[f64], rows: &mut [f64]| problem.rows(u, rows);
    let back = |u: &[f64], weights: &[f64], out: &mut [f64]| problem.rows_back(u, weights, out);
    let factory =
        AlmFactory::new(cost, slope, Some(constraints), Some(back), NO_MAPPING, NO_JACOBIAN_MAPPING, Some(set), 0);
    let alm = AlmProblem::new(
        Rectangle::new(Some(&low), Some(&high)),
        Some(Rectangle::new(Some(&row_low), Some(&row_high))),
        Some(Ball2::new(None, 1e12)),
        |u: &[f64], xi: &[f64], cost: &mut f64| factory.psi(u, xi, cost),
        |u: &[f64], xi: &[f64], slope: &mut [f64]| factory.d_psi(u, xi, slope),
        Some(constraints),
        NO_MAPPING,
        rows,
        0,
    );
    let mut optimizer = AlmOptimizer::new(&mut cache, alm)
        .with_delta_tolerance(TOLERANCE)
        .with_epsilon_tolerance(TOLERANCE)
        .with_initial_inner_tolerance(1e-2)
        .with_inner_tolerance_update_factor(0.1)
        .with_initial_penalty(penalty)
        .with_penalty_update_factor(5.0)
        .with_max_outer_iterations(OUTER_MAX)
        .with_max_inner_iterations(INNER_MAX)
        .with_max_duration(std::time::Duration::from_secs(SECONDS_MAX));
    let build_seconds = begin.elapsed().as_secs_f64();
    let mut u = problem.first();
    let begin = Instant::now();
    let status = optimizer.solve(&mut u).map_err(|error| format!("{error:?}"))?;
    let seconds = begin.elapsed().as_secs_f64();
    Ok(json!({
        "seconds": [seconds],
        "build_seconds": build_seconds,
        "iterations": status.num_inner_iterations(),
        "status": format!("{:?}", status.exit_status()),
        "plan": problem.plan(&u, scenario),
    }))
}
