//! Prints what value, gradient and curvature of common objectives cost, in nanoseconds a node.
//!
//! `cargo run --release -p quietpath-core --example cost_per_node [-- PART OF A NAME]`
//!
//! Sixty intervals over sensors on a made-up plane; the smallest of many repetitions counts.

use std::hint::black_box;
use std::time::Instant;

use quietpath_core::jet::Jet;
use quietpath_core::metrics::Sample;
use quietpath_core::objective::curvature::{Integrals, Variables, node_curvature};
use quietpath_core::objective::{Extreme, gradient, value};
use quietpath_core::scenario::*;
use quietpath_core::{Draft, Metric, Point, Scenario, Trajectory};

const INTERVALS: usize = 60;
const SENSORS: usize = 8;
const REPETITIONS: usize = 3000;

fn main() {
    println!("{:24} {:>10} {:>10} {:>10} {:>10}", "ns a node", "value", "gradient", "curvature", "with time");
    let wanted = std::env::args().nth(1).unwrap_or_default();
    for (name, metric, ranging, detection) in cases().into_iter().filter(|case| case.0.contains(&wanted)) {
        let scenario = scenario(metric, ranging, detection).expect("a valid scenario");
        let view = scenario.view();
        let mut path = Trajectory::<f64, 2, 61, 1>::straight(&view, 100.0).expect("room");
        for (node, position) in path.tracks[0].path.iter_mut().enumerate() {
            position[1] += 1.5 * (node as f64 * 0.05236).sin();
        }
        let mut scratch = [Sample::default(); SENSORS];
        let mut slope = Trajectory::empty();
        let of_value = nanoseconds(|| value(&view, black_box(&path), Extreme::Exact, &mut scratch));
        let of_gradient = nanoseconds(|| gradient(&view, black_box(&path), Extreme::Exact, &mut scratch, &mut slope));
        let mut curvature = |variables| {
            let mut sum = 0.0;
            for node in 1..=INTERVALS {
                let weigh = Integrals { scenario: &view, time: path.times[node] };
                let jet: Jet<f64, 2> =
                    node_curvature(&view, black_box(&path), 0, node, &variables, &weigh, &mut scratch);
                sum += black_box(jet).value;
            }
            sum
        };
        let of_curvature = nanoseconds(|| curvature(Variables::POSITION));
        let of_time = nanoseconds(|| {
            let variables = Variables { time: Some(2), ..Variables::POSITION };
            let mut sum = 0.0;
            for node in 1..=INTERVALS {
                let weigh = Integrals { scenario: &view, time: path.times[node] };
                let jet: Jet<f64, 3> =
                    node_curvature(&view, black_box(&path), 0, node, &variables, &weigh, &mut scratch);
                sum += black_box(jet).value;
            }
            sum
        });
        println!("{name:24} {of_value:10.1} {of_gradient:10.1} {of_curvature:10.1} {of_time:10.1}");
    }
}

fn nanoseconds(mut figure: impl FnMut() -> f64) -> f64 {
    let mut least = f64::INFINITY;
    for _ in 0..REPETITIONS {
        let start = Instant::now();
        black_box(figure());
        least = least.min(start.elapsed().as_secs_f64());
    }
    least * 1e9 / INTERVALS as f64
}

type Case = (&'static str, Metric, Option<Ranging<f64>>, Option<Detection<f64>>);

fn cases() -> Vec<Case> {
    let proxy = Detection::Proxy { scale: 0.3, epsilon: 0.3, path_loss: 2.0 };
    let energy = |samples| Detection::Energy { samples, signal: 1.0, noise: 0.3, log_threshold: 2.0, path_loss: 2.0 };
    let toa = Ranging::Toa { c1: 0.01, c2: 0.1, path_loss: 2.0 };
    let rss = Ranging::Rss { scale: 0.01, path_loss: 0.5 };
    vec![
        ("proxy detection", Metric::Detection, None, Some(proxy)),
        ("energy detection, N=10", Metric::Detection, None, Some(energy(10))),
        ("energy detection, N=1000", Metric::Detection, None, Some(energy(1000))),
        ("log_aee, TOA", Metric::LogAee, Some(toa), None),
        ("log_aee, RSS", Metric::LogAee, Some(rss), None),
        ("cep, TOA", Metric::Cep, Some(toa), None),
        ("log_gdop, TOA", Metric::LogGdop, Some(toa), None),
    ]
}

fn scenario(
    metric: Metric,
    ranging: Option<Ranging<f64>>,
    detection: Option<Detection<f64>>,
) -> Result<Scenario<f64, 2, SENSORS, 1, 0>, quietpath_core::Error> {
    let jam = Susceptibility { error_gain: 0.0, error_exponent: 2.0, detect_gain: 0.0, detect_exponent: 2.0 };
    let places = [[2.0, 3.0], [3.5, 7.0], [5.0, 4.2], [6.5, 6.0], [8.0, 3.0], [4.2, 5.3], [7.3, 8.1], [1.8, 8.0]];
    let sensors = places.map(|place| Sensor { motion: Motion::Fixed(Point::from(place)), ranging, detection, jam });
    let agent = Agent {
        start: Point::<f64, 2>::new(1.0, 5.0),
        goal: Point::<f64, 2>::new(9.0, 5.0),
        start_velocity: None,
        speed_max: 0.2,
        accel_max: 0.05,
        weight: 1.0,
        jammer: None,
        dropout: None,
    };
    let term = Term {
        metric,
        sense: Sense::Minimize,
        reduce: Reduce::Integral,
        weight: 1.0,
        agents: AgentSet::ALL,
        window: Window::always(),
    };
    Scenario::new(&Draft {
        softening: 0.05,
        reference_point: ReferencePoint::Current,
        pooling: Pooling::None,
        intervals: INTERVALS,
        start_time: 0.0,
        time: Timing { max: 200.0, target: 100.0, penalty: 1.0 },
        domain: Domain { min: Point::<f64, 2>::new(0.0, 0.0), max: Point::<f64, 2>::new(10.0, 10.0) },
        agents: &[agent],
        sensors: &sensors,
        terms: &[term],
        separation: None,
        regions: &[],
        limits: &[],
    })
}
