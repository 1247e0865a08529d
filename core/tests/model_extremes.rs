//! Finite input gives finite figures and derivatives, in both precisions, and nothing panics.
//!
//! Scenes are made to hurt: on top of a sensor, very far, sensors in line or in one place, exponents and constants
//! of absurd size, controls at and beyond their bounds.

use quietpath_core::metrics::Sample;
use quietpath_core::objective::{Extreme, gradient, node_values, point_values, value};
use quietpath_core::scenario::*;
use quietpath_core::{Draft, Metric, Point, Real, Scenario, Trajectory};

const NODES: usize = 8;
type Plan<T> = Trajectory<T, 2, NODES, 2>;
type Stored<T> = Scenario<T, 2, 5, 2, 4>;

/// What is made absurd, by name.
const TWISTS: [&str; 16] = [
    "nothing",
    "sensors in line",
    "sensors in one place",
    "softening",
    "path loss",
    "small path loss",
    "small scales",
    "large scales",
    "jamming gain",
    "negative jamming exponent",
    "narrow beam",
    "log threshold",
    "negative log threshold",
    "samples",
    "q of 1",
    "large q",
];

fn sensor<T: Real>(index: usize, twist: &str) -> Sensor<'static, T, 2> {
    let real = T::real;
    let number = index as f64;
    let place = match twist {
        "sensors in line" => (number, number),
        "sensors in one place" => (3.0, 3.0),
        _ => (2.0 + 1.7 * number, 2.0 + (number * 2.3) % 5.0),
    };
    let path_loss = match twist {
        "path loss" => 25.0,
        "small path loss" => 1e-6,
        _ => [2.0, 1.0, 4.0, 2.7, 0.5][index % 5],
    };
    let scale = match twist {
        "small scales" => 1e-30,
        "large scales" => 1e30,
        _ => 0.3,
    };
    let log_threshold = match twist {
        "log threshold" => 1e6,
        "negative log threshold" => -1e6,
        _ => 0.0,
    };
    let samples = if twist == "samples" { 40_960 } else { 1 + index as u32 };
    let path_loss = real(path_loss);
    let ranging = if index.is_multiple_of(2) {
        Ranging::Toa { c1: real(scale), c2: real(scale), path_loss }
    } else {
        Ranging::Rss { scale: real(scale), path_loss }
    };
    let detection = if index.is_multiple_of(2) {
        Detection::Proxy { scale: real(scale), epsilon: T::zero(), path_loss }
    } else {
        let (signal, noise) = (real(scale), real(1.0));
        Detection::Energy { samples, signal, noise, log_threshold: real(log_threshold), path_loss }
    };
    let gain = real(if twist == "jamming gain" { 1e30 } else { 20.0 });
    let exponent = real(if twist == "negative jamming exponent" { -9.0 } else { 1.5 });
    let jam =
        Susceptibility { error_gain: gain, error_exponent: exponent, detect_gain: gain, detect_exponent: exponent };
    Sensor {
        motion: Motion::Fixed(Point::<T, 2>::new(real(place.0), real(place.1))),
        ranging: Some(ranging),
        detection: Some(detection),
        jam,
    }
}

fn scenario<T: Real>(twist: &str, betrayal: Betrayal<T>, reference_point: ReferencePoint) -> Stored<T> {
    let real = T::real;
    let beam_width = real(if twist == "narrow beam" { 1e-5 } else { 1.5 });
    let patterns = [BeamPattern::Cone { beam_width }, BeamPattern::Cosine];
    let agents = patterns.map(|pattern| Agent {
        start: Point::<T, 2>::new(real(1.0), real(1.0)),
        goal: Point::<T, 2>::new(real(9.0), real(1.0)),
        start_velocity: None,
        speed_max: T::one(),
        accel_max: T::one(),
        weight: T::one(),
        jammer: Some(Jammer { pattern, betrayal, budget: T::one() }),
        dropout: Some(Dropout { budget: T::one() }),
    });
    let terms: Vec<_> = [Metric::Detection, Metric::FalseAlarm, Metric::LogCep2, Metric::Cep, Metric::LogAee]
        .into_iter()
        .chain([Metric::Aee, Metric::LogGdop, Metric::Gdop])
        .enumerate()
        .map(|(index, metric)| Term {
            metric,
            sense: if index.is_multiple_of(2) { Sense::Minimize } else { Sense::Maximize },
            reduce: if index % 3 == 0 { Reduce::Extreme } else { Reduce::Integral },
            weight: T::one(),
            agents: AgentSet::ALL,
            window: Window::always(),
        })
        .collect();
    let sensors: Vec<_> = (0..5).map(|index| sensor(index, twist)).collect();
    Scenario::new(&Draft {
        softening: real(if twist == "softening" { 1e-25 } else { 0.05 }),
        reference_point,
        pooling: Pooling::None,
        intervals: NODES - 1,
        start_time: T::zero(),
        time: Timing { max: real(20.0), target: T::zero(), penalty: T::one() },
        domain: Domain { min: Point::repeat(T::zero()), max: Point::repeat(real(10.0)) },
        agents: &agents,
        sensors: &sensors,
        terms: &terms,
        separation: None,
        regions: &[],
        limits: &[],
    })
    .expect("a valid scenario")
}

fn plan<T: Real>(stored: &Stored<T>, level: f64, dropout: f64) -> Plan<T> {
    let mut plan = Plan::straight(&stored.view(), T::real(10.0)).expect("it fits");
    let places = [(2.0, 2.0), (3.7, 4.3), (3.0, 3.0), (1e-9, 1e-9), (2.0 + 1e-6, 2.0), (1e8, -1e8), (5.0, 5.0)];
    for (agent, track) in plan.active_mut().iter_mut().enumerate() {
        for (position, place) in track.path.iter_mut().skip(1).zip(places.iter().cycle().skip(2 * agent)) {
            *position = Point::<T, 2>::new(T::real(place.0), T::real(place.1));
        }
        track.jam = [T::real(level); NODES];
        track.dropout = [T::real(dropout); NODES];
    }
    plan
}

fn all_finite<T: Real>(name: &str) -> usize {
    let (one, large) = (T::one(), T::real(1e6));
    let mut checked = 0;
    for twist in TWISTS {
        let q = match twist {
            "q of 1" => one,
            "large q" => large,
            _ => T::real(15.0),
        };
        for betrayal in [Betrayal::None, Betrayal::Max { q }, Betrayal::Linear, Betrayal::Sigmoid] {
            for reference_point in [ReferencePoint::Current, ReferencePoint::Lagged] {
                let stored = scenario::<T>(twist, betrayal, reference_point);
                for (level, dropout) in [(0.0, 0.0), (1.0, 1.0), (0.5, 0.5), (1e-30, 1.0 - 1e-3), (-0.1, 1.1)] {
                    let plan = plan(&stored, level, dropout);
                    let at = format!("{name}: {twist}, {betrayal:?}, {reference_point:?}, {level}, {dropout}");
                    checked += assert_finite(&stored, &plan, &at);
                }
            }
        }
    }
    checked
}

fn assert_finite<T: Real>(stored: &Stored<T>, plan: &Plan<T>, at: &str) -> usize {
    let view = stored.view();
    let mut scratch = [Sample::default(); 5];
    let mut checked = 0;
    for (agent, node) in (0..2).flat_map(|agent| (0..NODES).map(move |node| (agent, node))) {
        let values = node_values(&view, plan, agent, node, &mut scratch);
        for metric in Metric::ALL {
            let value = values.get(metric).expect("enough sensors");
            assert!(value.finite(), "{at}: {} of agent {agent} at node {node} is {value}", metric.name());
            checked += 1;
        }
    }
    for extreme in [Extreme::Exact, Extreme::Smooth { sharpness: T::real(1e3) }] {
        let mut slope = Trajectory::empty();
        assert!(gradient(&view, plan, extreme, &mut scratch, &mut slope).finite(), "{at}");
        for (agent, track) in slope.active().iter().enumerate() {
            for node in 0..NODES {
                let entries = [track.jam[node], track.azimuth[node], track.dropout[node], slope.times[node]];
                let finite = track.path[node].iter().chain(&entries).all(|entry| entry.finite());
                assert!(
                    finite,
                    "{at}: derivatives of agent {agent} at node {node}: {:?} {entries:?}",
                    track.path[node]
                );
                checked += 1;
            }
        }
    }
    checked
}

#[test]
fn figures_are_finite() {
    let checked = all_finite::<f64>("f64") + all_finite::<f32>("f32");
    assert!(checked > 50_000, "{checked}");
}

#[test]
fn short_scratch_and_missing_nodes_do_not_panic() {
    let stored = scenario::<f64>("nothing", Betrayal::None, ReferencePoint::Lagged);
    let view = stored.view();
    let plan = plan(&stored, 0.5, 0.5);
    for length in 0..5 {
        let mut scratch = [Sample::default(); 5];
        let short = &mut scratch[..length];
        let mut slope = Trajectory::empty();
        let objective = gradient(&view, &plan, Extreme::Exact, short, &mut slope);
        assert_eq!(objective, value(&view, &plan, Extreme::Exact, short));
        let values = point_values(&view, 0.0, &Point::<f64, 2>::new(1.0, 2.0), short);
        assert_eq!(values.location.is_some(), length > 2);
        assert_eq!(values.detection > 0.0, length > 0);
    }
    let mut scratch = [Sample::default(); 5];
    for (agent, node) in [(2, 0), (0, NODES), (usize::MAX, usize::MAX)] {
        let values = node_values(&view, &plan, agent, node, &mut scratch);
        assert!(values.detection.is_nan() && values.location.is_none());
    }
    let none = Plan::empty();
    assert_eq!(value(&view, &none, Extreme::Exact, &mut scratch), 0.0);
}
