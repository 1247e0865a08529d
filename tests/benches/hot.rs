//! The routines that planning spends its time in: `cargo bench -p quietpath-tests`.
//!
//! | group | what |
//! |---|---|
//! | `value`, `gradient` | the objective along a straight line of 64 intervals among 8 sensors, by metric and detector |
//! | `chi_square_tail` | Q_N, by form: finite sum and uniform expansion |
//! | `constraints` | all violations of the same line |
//! | `plan` | whole plans, by scenario |
//! | `step` | the first step of a flight in steps, and the second: a warm step is to cost less than a fifth of the cold one |
//!
//! Limits: projection and banded factor are the solver's own and cannot be called from here; `cargo xtask count`
//! says what they cost inside a plan.

use std::hint::black_box;

use criterion::{BatchSize, BenchmarkId, Criterion, criterion_group, criterion_main};
use quietpath_bridge::file::ScenarioFile;
use quietpath_bridge::planning::{Options, Rollout, plan};
use quietpath_core::constraints::violations;
use quietpath_core::horizon::{Horizon, Reveal, Search, reveal};
use quietpath_core::metrics::Sample;
use quietpath_core::objective::{Extreme, gradient, value};
use quietpath_core::solver::{Settings, Workspace};
use quietpath_core::special::chi_square_tail;
use quietpath_core::{Metric, Trajectory};
use quietpath_tests::scenario;

type Line = Trajectory<f64, 2, 65, 1>;
type Flight = Horizon<f64, 2, 96, 1>;

/// The scenario file with its first term about another metric, and 64 intervals.
fn about(name: &str, metric: Metric) -> ScenarioFile {
    let published = scenario(name);
    let mut lines: Vec<String> = published.text().lines().map(str::to_owned).collect();
    for line in &mut lines {
        if line.starts_with("metric = ") {
            *line = format!("metric = \"{}\"", metric.name());
        } else if line.starts_with("intervals = ") {
            *line = "intervals = 64".to_owned();
        }
    }
    ScenarioFile::parse(name, &lines.join("\n")).expect("a published scenario stays valid").scenario
}

/// Values and gradients of the objective, and all violations.
fn model(criterion: &mut Criterion) {
    let cases = [
        ("proxy", "square8-detection", Metric::Detection),
        ("energy", "square8-energy", Metric::Detection),
        ("energy", "square8-energy", Metric::FalseAlarm),
        ("toa", "square8-detection", Metric::LogCep2),
        ("toa", "square8-detection", Metric::LogAee),
        ("toa", "square8-detection", Metric::LogGdop),
    ];
    for (sensors, name, metric) in cases {
        let stored = about(name, metric).to_core::<f64, 2>().expect("it fits the host");
        let view = stored.view();
        let line = Line::straight(&view, 115.0).expect("it fits");
        let mut slope = Line::empty();
        let mut scratch = vec![Sample::default(); 8];
        let id = format!("{}/{sensors}", metric.name());
        criterion.benchmark_group("value").bench_function(BenchmarkId::from_parameter(&id), |bencher| {
            bencher.iter(|| value(&view, black_box(&line), Extreme::Exact, &mut scratch));
        });
        criterion.benchmark_group("gradient").bench_function(BenchmarkId::from_parameter(&id), |bencher| {
            bencher.iter(|| gradient(&view, black_box(&line), Extreme::Exact, &mut scratch, &mut slope));
        });
        if metric == Metric::LogAee {
            criterion.bench_function("constraints", |bencher| {
                bencher.iter(|| violations(&view, black_box(&line), &mut scratch));
            });
        }
    }
}

fn tails(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("chi_square_tail");
    for degrees in [1_u32, 8, 39, 100, 1001, 40_960] {
        group.bench_function(BenchmarkId::from_parameter(degrees), |bencher| {
            bencher.iter(|| chi_square_tail(black_box(degrees), black_box(1.1 * f64::from(degrees))));
        });
    }
}

fn plans(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("plan");
    group.sample_size(10);
    for name in ["square8-detection", "square8-energy", "square8-aee-lagged", "dropout4-17"] {
        let scenario = scenario(name);
        let options = Options { rollout: Rollout::Once, ..Options::default() };
        group.bench_function(BenchmarkId::from_parameter(name), |bencher| {
            bencher.iter(|| plan(black_box(&scenario), &options));
        });
    }
}

/// The first two steps of a flight: from nothing, and from the rest of the first plan where the world has moved on.
fn steps(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("step");
    group.sample_size(10);
    for name in ["wight", "wight-jam"] {
        let stored = scenario(name).to_core::<f64, 2>().expect("it fits the host");
        let world = stored.view();
        let mut workspace: Box<Workspace<f64, 2, 96, 16, 1>> = Box::new(Workspace::new());
        let begun: Box<Flight> = Box::new(Horizon::new(&world).expect("it fits"));
        let mut replan = |flight: &mut Flight| {
            let time = flight.tail().start_time();
            let told = reveal::<_, 2, 16>(&world, Reveal::Current, time, |_| true).expect("they fit");
            let seen = world.with_sensors(&told);
            let step = flight.replan(&seen, &Settings::default(), Search::Tail, &mut workspace, &mut || false);
            assert!(step.expect("it can be planned").feasible);
        };
        group.bench_function(BenchmarkId::new("cold", name), |bencher| {
            bencher.iter_batched_ref(|| begun.clone(), |flight| replan(flight), BatchSize::LargeInput);
        });
        let mut flown = begun.clone();
        replan(&mut flown);
        flown.fly(5);
        group.bench_function(BenchmarkId::new("warm", name), |bencher| {
            bencher.iter_batched_ref(|| flown.clone(), |flight| replan(flight), BatchSize::LargeInput);
        });
    }
}

criterion_group!(benches, model, tails, plans, steps);
criterion_main!(benches);
