//! Pooled sensors against full matrices, and against what they must come to in the limit.
//!
//! `data/pooled.txt` is written by `tools/weighted_chi_square.py pooled`.

use quietpath_core::error::{Error, Fault, Item};
use quietpath_core::metrics::{Sample, Values};
use quietpath_core::objective::{node_values, point_values};
use quietpath_core::scenario::*;
use quietpath_core::{Draft, Metric, Point, Scenario, Trajectory};

const GOLDEN: &str = include_str!("data/pooled.txt");
type Stored = Scenario<f64, 2, 8, 2, 0>;

/// An energy detector with its position.
#[derive(Clone, Copy)]
struct Made {
    position: [f64; 2],
    detection: Detection<f64>,
}

fn energy(position: [f64; 2], samples: u32, signal: f64) -> Made {
    let detection = Detection::Energy { samples, signal, noise: 0.5, log_threshold: 1.5, path_loss: 1.0 };
    Made { position, detection }
}

fn proxy(position: [f64; 2]) -> Made {
    Made { position, detection: Detection::Proxy { scale: 0.3, epsilon: 0.3, path_loss: 2.0 } }
}

fn stored(sensors: &[Made], pooling: Pooling<f64>, betrayal: Betrayal<f64>) -> Result<Stored, Error> {
    let jam = Susceptibility { error_gain: 0.0, error_exponent: 2.0, detect_gain: 1.0, detect_exponent: 2.0 };
    let point = |at: [f64; 2]| Point::<f64, 2>::new(at[0], at[1]);
    let sensors: Vec<_> = sensors
        .iter()
        .map(|made| Sensor {
            motion: Motion::Fixed(point(made.position)),
            ranging: None,
            detection: Some(made.detection),
            jam,
        })
        .collect();
    let agent = Agent {
        start: point([-9.0, 0.0]),
        goal: point([9.0, 0.0]),
        start_velocity: None,
        speed_max: 1.0,
        accel_max: 1.0,
        weight: 1.0,
        jammer: Some(Jammer { pattern: BeamPattern::Isotropic, betrayal, budget: 1.0 }),
        dropout: Some(Dropout { budget: 5.0 }),
    };
    let term = Term {
        metric: Metric::Detection,
        sense: Sense::Minimize,
        reduce: Reduce::Integral,
        weight: 1.0,
        agents: AgentSet::ALL,
        window: Window::always(),
    };
    Scenario::new(&Draft {
        softening: 4.0,
        reference_point: ReferencePoint::Current,
        pooling,
        intervals: 4,
        start_time: 0.0,
        time: Timing { max: 90.0, target: 0.0, penalty: 0.0 },
        domain: Domain { min: point([-50.0, -50.0]), max: point([50.0, 50.0]) },
        agents: &[agent],
        sensors: &sensors,
        terms: &[term],
        separation: None,
        regions: &[],
        limits: &[],
    })
}

fn at(sensors: &[Made], pooling: Pooling<f64>, position: [f64; 2]) -> Values<f64> {
    let stored = stored(sensors, pooling, Betrayal::None).expect("a valid scenario");
    let position = Point::<f64, 2>::new(position[0], position[1]);
    point_values(&stored.view(), 0.0, &position, &mut [Sample::default(); 8])
}

fn near(ours: f64, other: f64, relative: f64) -> bool {
    (ours - other).abs() <= relative * other.abs()
}

const PLACES: [[f64; 2]; 6] = [[0.0, 0.0], [1.0, 0.3], [-3.0, 4.0], [10.0, 2.0], [0.0, 25.0], [-45.0, 45.0]];
const UNCORRELATED: Pooling<f64> = Pooling::Uncorrelated { log_threshold: 1.5 };

fn correlated(correlation: f64) -> Pooling<f64> {
    Pooling::Correlated { log_threshold: 1.5, correlation }
}

#[test]
fn pools_match_full_matrices() {
    let (mut worst, mut count) = (0.0_f64, 0);
    for line in GOLDEN.lines().filter(|line| !line.starts_with('#')) {
        let (left, right) = line.split_once(" ; ").expect("two halves");
        let numbers: Vec<f64> = right.split(' ').map(|field| field.parse().expect("a number")).collect();
        let &[correlation, log_threshold, detection, false_alarm] = numbers.as_slice() else { panic!("{line}") };
        let sensor = |text: &str| {
            let (samples, ratio) = text.split_once(':').expect("two numbers");
            // 3 away, softened by 4, path loss 1: a 25th of the signal arrives.
            energy([3.0, 0.0], samples.parse().expect("a count"), 12.5 * ratio.parse::<f64>().expect("a number"))
        };
        let sensors: Vec<Made> = left.split(' ').map(sensor).collect();
        let pooling = if correlation == 0.0 {
            Pooling::Uncorrelated { log_threshold }
        } else {
            Pooling::Correlated { log_threshold, correlation }
        };
        let found = at(&sensors, pooling, [0.0, 0.0]);
        for (ours, exact) in [(found.detection, detection), (found.false_alarm, false_alarm)] {
            let error = (ours / exact - 1.0).abs();
            // Far out the error is that of the degrees of the largest eigenvalue alone, 1 / (6 N) at most.
            assert!(error < if exact > 1e-13 { 2e-3 } else { 9e-3 }, "{line}: {ours} is not {exact}");
            if exact > 1e-13 {
                worst = worst.max(error);
            }
            count += 1;
            if correlation == 1.0 {
                assert!(error < 1e-9, "one eigenvalue is exact: {line}: {ours} is not {exact}");
            }
        }
    }
    println!("{count} probabilities of pools, worst relative error above 1e-13 {worst:.1e}");
    assert!(count > 200);
}

#[test]
fn one_sensor_pooled_is_that_sensor() {
    let sensors = [energy([0.5, -1.0], 40, 3.0)];
    for place in PLACES {
        let alone = at(&sensors, Pooling::None, place);
        for pooling in [UNCORRELATED, correlated(0.0), correlated(0.4), correlated(1.0)] {
            let pooled = at(&sensors, pooling, place);
            assert!(near(pooled.detection, alone.detection, 1e-12), "{pooling:?} {place:?} {pooled:?} {alone:?}");
            assert!(near(pooled.false_alarm, alone.false_alarm, 1e-12), "{pooling:?} {place:?} {pooled:?} {alone:?}");
        }
    }
}

#[test]
fn no_correlation_is_the_uncorrelated_test_and_order_does_not_matter() {
    let sensors = [energy([0.0, 0.0], 40, 3.0), energy([5.0, 1.0], 40, 2.0), energy([-2.0, 7.0], 40, 9.0)];
    let mut turned = sensors;
    turned.reverse();
    for place in PLACES {
        let plain = at(&sensors, UNCORRELATED, place);
        let none = at(&sensors, correlated(0.0), place);
        assert_eq!((plain.detection, plain.false_alarm), (none.detection, none.false_alarm));
        for pooling in [UNCORRELATED, correlated(0.6)] {
            let (one, other) = (at(&sensors, pooling, place), at(&turned, pooling, place));
            assert!(near(one.detection, other.detection, 1e-11), "{place:?} {one:?} {other:?}");
            assert!(near(one.false_alarm, other.false_alarm, 1e-11), "{place:?} {one:?} {other:?}");
        }
        // Little correlation changes little, and much changes much.
        let little = at(&sensors, correlated(1e-9), place);
        assert!(near(little.detection, plain.detection, 1e-6), "{place:?}");
    }
    let (none, much) = (at(&sensors, UNCORRELATED, [0.0, 0.0]), at(&sensors, correlated(0.9), [0.0, 0.0]));
    assert!((none.detection - much.detection).abs() > 1e-6, "{none:?} {much:?}");
}

/// Uncorrelated sensors at one place are one sensor with all their samples; fully correlated ones are one with the sum of
/// their signals.
#[test]
fn sensors_at_one_place_are_one_sensor() {
    for place in PLACES {
        let apart = at(&[energy([1.0, 2.0], 30, 3.0), energy([1.0, 2.0], 70, 3.0)], UNCORRELATED, place);
        let one = at(&[energy([1.0, 2.0], 100, 3.0)], Pooling::None, place);
        assert!(near(apart.detection, one.detection, 1e-9), "{place:?} {apart:?} {one:?}");
        assert!(near(apart.false_alarm, one.false_alarm, 1e-9), "{place:?} {apart:?} {one:?}");
        let apart = at(&[energy([1.0, 2.0], 50, 3.0), energy([1.0, 2.0], 50, 4.0)], correlated(1.0), place);
        let one = at(&[energy([1.0, 2.0], 50, 7.0)], Pooling::None, place);
        assert!(near(apart.detection, one.detection, 1e-12), "{place:?} {apart:?} {one:?}");
        assert!(near(apart.false_alarm, one.false_alarm, 1e-12), "{place:?} {apart:?} {one:?}");
    }
}

/// A proxy decides for itself, and has no false alarms; dropout takes its share of both.
#[test]
fn the_pool_stands_beside_other_sensors_as_one_more() {
    let pool = [energy([0.0, 0.0], 40, 0.6), energy([5.0, 1.0], 40, 0.4)];
    let mixed = [pool[0], proxy([3.0, 3.0]), pool[1], proxy([-3.0, 3.0])];
    let proxies = [proxy([3.0, 3.0]), proxy([-3.0, 3.0])];
    for pooling in [UNCORRELATED, correlated(0.5)] {
        for place in PLACES {
            let (both, pooled, alone) =
                (at(&mixed, pooling, place), at(&pool, pooling, place), at(&proxies, pooling, place));
            let product = 1.0 - (1.0 - pooled.detection) * (1.0 - alone.detection);
            assert!(near(both.detection, product, 1e-12), "{place:?} {both:?} {pooled:?} {alone:?}");
            assert_eq!((both.false_alarm, alone.false_alarm), (pooled.false_alarm, 0.0));
        }
    }
    let (alone, heard) = (stored(&pool, UNCORRELATED, Betrayal::None).expect("valid"), 0.25);
    let mut plan = Trajectory::<f64, 2, 5, 1>::straight(&alone.view(), 20.0).expect("fits");
    let scratch = &mut [Sample::default(); 8];
    let loud = node_values(&alone.view(), &plan, 0, 2, scratch);
    plan.tracks[0].dropout[2] = 1.0 - heard;
    let quiet = node_values(&alone.view(), &plan, 0, 2, scratch);
    assert!(near(quiet.detection, heard * loud.detection, 1e-14), "{quiet:?} {loud:?}");
    assert_eq!(quiet.false_alarm, loud.false_alarm);
}

#[test]
fn an_empty_pool_detects_nothing() {
    let found = at(&[], Pooling::Uncorrelated { log_threshold: -3.0 }, [0.0, 0.0]);
    assert_eq!((found.detection, found.false_alarm), (0.0, 0.0));
}

#[test]
fn what_has_no_meaning_is_refused() {
    let sensors = [proxy([0.0, 0.0]), energy([0.0, 0.0], 40, 3.0), energy([5.0, 1.0], 41, 2.0)];
    let fails = |pooling, betrayal| stored(&sensors, pooling, betrayal).map(|_| ()).expect_err("invalid");
    let none = Betrayal::None;
    stored(&sensors, UNCORRELATED, none).expect("samples may differ where signals are uncorrelated");
    let unequal = Fault::UnequalSamples { samples: 41, others: 40 };
    assert_eq!(fails(correlated(0.5), none), Error::new(Item::Sensor(2), "detection.samples", unequal));
    for (correlation, value) in [(-0.1, -0.1), (1.5, 1.5)] {
        let range = Fault::OutOfRange { value, min: 0.0, max: 1.0 };
        assert_eq!(fails(correlated(correlation), none), Error::new(Item::Scenario, "pooling.correlation", range));
    }
    let nan = Pooling::Uncorrelated { log_threshold: f64::NAN };
    assert_eq!(fails(nan, none), Error::new(Item::Scenario, "pooling.log_threshold", Fault::NotFinite));
    for betrayal in [Betrayal::Linear, Betrayal::Sigmoid, Betrayal::Max { q: 2.0 }] {
        let refused = Error::new(Item::Agent(0), "jammer.detection_model", Fault::NotWithPooling);
        assert_eq!(fails(UNCORRELATED, betrayal), refused);
        stored(&sensors, Pooling::None, betrayal).expect("betrayal is fine where sensors decide alone");
    }
}
