//! Metrics, objectives and violations against an independent NumPy/SciPy reading of the model.
//!
//! The figures and the scenarios behind them were written by `tests/tools/model_golden.py`: ten scenarios with
//! two plans each, nodes near a sensor, far away and in between.

mod made_up;

use made_up::{Made, scenarios};
use quietpath_core::Metric;
use quietpath_core::Trajectory;
use quietpath_core::constraints::violations;
use quietpath_core::metrics::Sample;
use quietpath_core::objective::{Extreme, gradient, node_values, value};

/// Largest relative difference allowed.
const RELATIVE: f64 = 1e-9;
/// The other reading loses small probabilities in `1 - product(1 - p)`.
const PROBABILITY_ABSOLUTE: f64 = 1e-14;

fn difference(ours: f64, theirs: f64, absolute: f64) -> f64 {
    ((ours - theirs).abs() - absolute).max(0.0) / theirs.abs().max(f64::MIN_POSITIVE)
}

fn metrics<const DIM: usize>(made: &Made<DIM>) -> (usize, f64) {
    let stored = made.stored().expect("a valid scenario");
    let mut scratch = [Sample::default(); 8];
    let (mut compared, mut worst) = (0, 0.0_f64);
    for golden in &made.plans {
        for (agent, node, theirs) in &golden.values {
            let values = node_values(&stored.view(), &golden.plan, *agent, *node, &mut scratch);
            for (metric, theirs) in Metric::ALL.into_iter().zip(theirs) {
                let ours = values.get(metric);
                assert_eq!(ours.is_some(), theirs.is_some(), "{} {}", made.name, metric.name());
                let (Some(ours), Some(theirs)) = (ours, *theirs) else { continue };
                let absolute = match metric {
                    Metric::Detection | Metric::FalseAlarm => PROBABILITY_ABSOLUTE,
                    // A logarithm has the relative error of its argument as absolute error.
                    _ if metric.name().starts_with("log_") => RELATIVE,
                    _ => 0.0,
                };
                let difference = difference(ours, theirs, absolute);
                let at = format!("{} agent {agent} node {node} {}", made.name, metric.name());
                assert!(difference <= RELATIVE, "{at}: {ours} is not {theirs}, {difference:.1e}");
                compared += 1;
                worst = worst.max(difference);
            }
        }
    }
    (compared, worst)
}

fn objectives<const DIM: usize>(made: &Made<DIM>) -> (usize, f64) {
    let stored = made.stored().expect("a valid scenario");
    let mut scratch = [Sample::default(); 8];
    let mut slope = Trajectory::empty();
    let mut worst = 0.0_f64;
    for golden in &made.plans {
        let ours = value(&stored.view(), &golden.plan, Extreme::Exact, &mut scratch);
        let again = gradient(&stored.view(), &golden.plan, Extreme::Exact, &mut scratch, &mut slope);
        assert_eq!(ours.to_bits(), again.to_bits(), "{}", made.name);
        let difference = difference(ours, golden.objective, 0.0);
        assert!(difference <= RELATIVE, "{}: {ours} is not {}", made.name, golden.objective);
        worst = worst.max(difference);
    }
    (made.plans.len(), worst)
}

fn constraints<const DIM: usize>(made: &Made<DIM>) -> (usize, f64) {
    let stored = made.stored().expect("a valid scenario");
    let mut scratch = [Sample::default(); 8];
    let (mut compared, mut worst) = (0, 0.0_f64);
    for golden in &made.plans {
        let ours = violations(&stored.view(), &golden.plan, &mut scratch);
        for (name, ours) in ours.iter() {
            let theirs = golden.violations.iter().find(|(theirs, _)| theirs == name).map_or(0.0, |entry| entry.1);
            let difference = difference(ours, theirs, 1e-12);
            assert!(difference <= RELATIVE, "{} {name}: {ours} is not {theirs}", made.name);
            compared += 1;
            worst = worst.max(difference);
        }
    }
    (compared, worst)
}

/// Runs a comparison over all scenarios and prints what it found.
fn over_all(what: &str, flat: fn(&Made<2>) -> (usize, f64), high: fn(&Made<3>) -> (usize, f64), least: usize) {
    let found = scenarios::<2>().iter().map(flat).chain(scenarios::<3>().iter().map(high)).collect::<Vec<_>>();
    let compared: usize = found.iter().map(|entry| entry.0).sum();
    let worst = found.iter().map(|entry| entry.1).fold(0.0, f64::max);
    println!("{what}: {compared} figures, worst relative difference {worst:.1e}");
    assert!(compared >= least, "only {compared} {what} compared");
}

#[test]
fn metrics_agree() {
    over_all("metrics", metrics::<2>, metrics::<3>, 2000);
}

#[test]
fn objectives_agree() {
    over_all("objectives", objectives::<2>, objectives::<3>, 20);
}

#[test]
fn violations_agree() {
    over_all("violations", constraints::<2>, constraints::<3>, 200);
}
