//! How far figures and derivatives in `f32` are from those in `f64`, over the made-up scenarios.
//!
//! Limits: detection by the energy detector is left out where it is below 1e-6: there a small error of the argument
//! is a large one of the tail.

mod made_up;

use made_up::{Made, MadeSensor, Plan, Stored, scenarios};
use quietpath_core::metrics::Sample;
use quietpath_core::objective::{Extreme, gradient, node_values};
use quietpath_core::scenario::*;
use quietpath_core::{Draft, Metric, Point, Scenario, Trajectory};

fn point<const DIM: usize>(point: &Point<f64, DIM>) -> Point<f32, DIM> {
    point.map(|component| component as f32)
}

fn ranging(ranging: Ranging<f64>) -> Ranging<f32> {
    match ranging {
        Ranging::Rss { scale, path_loss } => Ranging::Rss { scale: scale as f32, path_loss: path_loss as f32 },
        Ranging::Toa { c1, c2, path_loss } => {
            Ranging::Toa { c1: c1 as f32, c2: c2 as f32, path_loss: path_loss as f32 }
        }
    }
}

fn detection(detection: Detection<f64>) -> Detection<f32> {
    match detection {
        Detection::Proxy { scale, epsilon, path_loss } => {
            Detection::Proxy { scale: scale as f32, epsilon: epsilon as f32, path_loss: path_loss as f32 }
        }
        Detection::Energy { samples, signal, noise, log_threshold, path_loss } => Detection::Energy {
            samples,
            signal: signal as f32,
            noise: noise as f32,
            log_threshold: log_threshold as f32,
            path_loss: path_loss as f32,
        },
    }
}

fn jammer(jammer: Jammer<f64>) -> Jammer<f32> {
    Jammer {
        pattern: match jammer.pattern {
            BeamPattern::Isotropic => BeamPattern::Isotropic,
            BeamPattern::Cosine => BeamPattern::Cosine,
            BeamPattern::Cone { beam_width } => BeamPattern::Cone { beam_width: beam_width as f32 },
        },
        betrayal: match jammer.betrayal {
            Betrayal::None => Betrayal::None,
            Betrayal::Max { q } => Betrayal::Max { q: q as f32 },
            Betrayal::Linear => Betrayal::Linear,
            Betrayal::Sigmoid => Betrayal::Sigmoid,
        },
        budget: jammer.budget as f32,
    }
}

fn agent<const DIM: usize>(agent: &Agent<f64, DIM>) -> Agent<f32, DIM> {
    Agent {
        start: point(&agent.start),
        goal: point(&agent.goal),
        start_velocity: None,
        speed_max: agent.speed_max as f32,
        accel_max: agent.accel_max as f32,
        weight: agent.weight as f32,
        jammer: agent.jammer.map(jammer),
        dropout: None,
    }
}

fn knots<const DIM: usize>(sensor: &MadeSensor<DIM>) -> Vec<Knot<f32, DIM>> {
    let knot = |knot: &Knot<f64, DIM>| Knot { time: knot.time as f32, position: point(&knot.position) };
    sensor.knots.iter().map(knot).collect()
}

/// The scenario in single precision, with one term.
fn single<const DIM: usize>(made: &Made<DIM>, metric: Metric) -> Stored<f32, DIM> {
    let tracks: Vec<_> = made.sensors.iter().map(knots).collect();
    let susceptibility = |jam: &Susceptibility<f64>| Susceptibility {
        error_gain: jam.error_gain as f32,
        error_exponent: jam.error_exponent as f32,
        detect_gain: jam.detect_gain as f32,
        detect_exponent: jam.detect_exponent as f32,
    };
    let sensors: Vec<_> = made
        .sensors
        .iter()
        .zip(&tracks)
        .map(|(sensor, track)| Sensor {
            motion: sensor.position.map_or(Motion::Track(track), |position| Motion::Fixed(point(&position))),
            ranging: sensor.ranging.map(ranging),
            detection: sensor.detection.map(detection),
            jam: susceptibility(&sensor.jam),
        })
        .collect();
    let agents: Vec<_> = made.agents.iter().map(agent).collect();
    Scenario::new(&Draft {
        softening: made.softening as f32,
        reference_point: made.reference_point,
        pooling: Pooling::None,
        intervals: made.intervals,
        start_time: 0.0,
        time: Timing { max: made.time.max as f32, target: 0.0, penalty: 0.0 },
        domain: Domain { min: point(&made.domain.min), max: point(&made.domain.max) },
        agents: &agents,
        sensors: &sensors,
        terms: &[term(metric)],
        separation: None,
        regions: &[],
        limits: &[],
    })
    .expect("a valid scenario")
}

fn term<T: quietpath_core::Real>(metric: Metric) -> Term<T> {
    Term {
        metric,
        sense: Sense::Minimize,
        reduce: Reduce::Integral,
        weight: T::one(),
        agents: AgentSet::ALL,
        window: Window::always(),
    }
}

fn single_plan<const DIM: usize>(plan: &Plan<f64, DIM>) -> Plan<f32, DIM> {
    let mut single = Plan::zeros(plan.intervals(), plan.agents()).expect("it fits");
    single.times = plan.times.map(|time| time as f32);
    for (single, track) in single.tracks.iter_mut().zip(&plan.tracks) {
        single.path = track.path.map(|position| point(&position));
        single.jam = track.jam.map(|entry| entry as f32);
        single.azimuth = track.azimuth.map(|entry| entry as f32);
        single.dropout = track.dropout.map(|entry| entry as f32);
    }
    single
}

/// Relative differences of values and of position derivatives, collected by metric.
#[derive(Default)]
struct Differences {
    values: Vec<f64>,
    slopes: Vec<f64>,
}

fn compare<const DIM: usize>(made: &Made<DIM>, metric: Metric, differences: &mut Differences) {
    let mut double = made.clone();
    double.time.penalty = 0.0;
    double.terms = vec![term(metric)];
    let (Ok(double), single) = (double.stored(), single(made, metric)) else { return };
    let mut scratch = ([Sample::default(); 8], [Sample::default(); 8]);
    for golden in &made.plans {
        let plan = single_plan(&golden.plan);
        // Rounding the plan must not count: both see the rounded one.
        let mut rounded = golden.plan.clone();
        for (rounded, track) in rounded.tracks.iter_mut().zip(&plan.tracks) {
            rounded.path = track.path.map(|position| position.map(f64::from));
            rounded.dropout = track.dropout.map(f64::from);
        }
        let mut slopes = (Trajectory::empty(), Trajectory::empty());
        gradient(&double.view(), &rounded, Extreme::Exact, &mut scratch.0, &mut slopes.0);
        gradient(&single.view(), &plan, Extreme::Exact, &mut scratch.1, &mut slopes.1);
        for &(agent, node, _) in golden.values.iter().filter(|(_, node, _)| *node > 0) {
            let exact = node_values(&double.view(), &rounded, agent, node, &mut scratch.0).get(metric);
            let ours = node_values(&single.view(), &plan, agent, node, &mut scratch.1).get(metric);
            let (Some(exact), Some(ours)) = (exact, ours) else { continue };
            if !metric.is_location_error() && exact < 1e-6 {
                continue;
            }
            let scale = if metric.name().starts_with("log_") { exact.abs().max(1.0) } else { exact.abs() };
            differences.values.push((f64::from(ours) - exact).abs() / scale);
            let exact = slopes.0.tracks[agent].path[node];
            let ours = slopes.1.tracks[agent].path[node].map(f64::from);
            if exact.amax() > 0.0 {
                differences.slopes.push((ours - exact).amax() / exact.amax());
            }
        }
    }
}

#[test]
fn single_precision_follows_double() {
    println!("{:12} {:>10} {:>10} {:>10} {:>10}", "", "value p95", "worst", "slope p95", "worst");
    for metric in Metric::ALL {
        let mut found = Differences::default();
        scenarios::<2>().iter().filter(|made| made.name != "few").for_each(|made| compare(made, metric, &mut found));
        scenarios::<3>()
            .iter()
            .filter(|made| made.name != "few" || !metric.is_location_error())
            .for_each(|made| compare(made, metric, &mut found));
        let summary = |list: &mut Vec<f64>| {
            list.sort_by(f64::total_cmp);
            (list.get(list.len() * 95 / 100).copied().unwrap_or_default(), list.last().copied().unwrap_or_default())
        };
        let (value, slope) = (summary(&mut found.values), summary(&mut found.slopes));
        println!("{:12} {:10.1e} {:10.1e} {:10.1e} {:10.1e}", metric.name(), value.0, value.1, slope.0, slope.1);
        assert!(value.0 < 1e-4 && value.1 < 1e-3 && slope.0 < 3e-4, "{}", metric.name());
        // A probability of detection that is 1 to the last bit of `f32` has no slope left.
        assert!(slope.1 < 1e-2 || metric == Metric::Detection, "{}", metric.name());
        assert!(found.values.len() > 10 && found.slopes.len() > 10, "{}", metric.name());
    }
}
