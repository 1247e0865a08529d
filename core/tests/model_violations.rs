//! Violations of trajectories made by hand, one constraint at a time.

use quietpath_core::constraints::{TOLERANCE, violations};
use quietpath_core::metrics::Sample;
use quietpath_core::scenario::*;
use quietpath_core::{Draft, Metric, Point, Scenario, Trajectory};

type Flat = Point<f64, 2>;
type Plan = Trajectory<f64, 2, 11, 1>;
type Stored = Scenario<f64, 2, 1, 1, 0>;

/// One agent from (1, 1) to (9, 1) past a sensor, in 10 intervals of 1 s at speed 0.8.
fn scenario() -> Stored {
    let jammer = Jammer { pattern: BeamPattern::Isotropic, betrayal: Betrayal::None, budget: 2.0 };
    let agent = Agent {
        start: Flat::new(1.0, 1.0),
        goal: Flat::new(9.0, 1.0),
        start_velocity: Some(Flat::new(0.8, 0.0)),
        speed_max: 1.0,
        accel_max: 0.5,
        weight: 1.0,
        jammer: Some(jammer),
        dropout: Some(Dropout { budget: 0.5 }),
    };
    let sensor = Sensor {
        motion: Motion::Fixed(Flat::new(5.0, 9.0)),
        ranging: None,
        detection: Some(Detection::Proxy { scale: 1.0, epsilon: 0.0, path_loss: 2.0 }),
        jam: Susceptibility { error_gain: 0.0, error_exponent: 2.0, detect_gain: 0.0, detect_exponent: 2.0 },
    };
    let term = Term {
        metric: Metric::Detection,
        sense: Sense::Minimize,
        reduce: Reduce::Integral,
        weight: 1.0,
        agents: AgentSet::ALL,
        window: Window::always(),
    };
    let circle = |east, north, radius, window| {
        let shape = Shape::Circle { center: Flat::new(east, north), radius };
        Region { shape, side: Side::Outside, window }
    };
    let always = circle(5.0, 3.0, 1.0, Window::always());
    let late = circle(3.0, 0.0, 0.5, Window { from: 5.0, until: 8.0 });
    Scenario::new(&Draft {
        softening: 1e-3,
        reference_point: ReferencePoint::Current,
        pooling: Pooling::None,
        intervals: 10,
        start_time: 0.0,
        time: Timing { max: 20.0, target: 0.0, penalty: 0.0 },
        domain: Domain { min: Flat::new(0.0, 0.0), max: Flat::new(10.0, 5.0) },
        agents: &[agent],
        sensors: &[sensor],
        terms: &[term],
        separation: None,
        regions: &[always, late],
        limits: &[Limit { metric: Metric::Detection, min: Some(0.0), max: Some(0.04) }],
    })
    .expect("a valid scenario")
}

/// What `change` makes of the straight flight: the constraint it breaks and by how much.
fn broken(change: impl Fn(&mut Plan)) -> Vec<(&'static str, f64)> {
    let stored = scenario();
    let mut plan = Plan::straight(&stored.view(), 10.0).expect("it fits");
    change(&mut plan);
    let found = violations(&stored.view(), &plan, &mut [Sample::default()]);
    assert_eq!(found.feasible(), found.iter().all(|(_, value)| value <= TOLERANCE));
    found.iter().filter(|(_, value)| *value > 1e-9).collect()
}

/// Checks that exactly the constraints listed are broken, and by how much.
fn assert_broken(expected: &[(&str, f64)], change: impl Fn(&mut Plan)) {
    let found = broken(change);
    assert_eq!(found.len(), expected.len(), "{found:?} is not {expected:?}");
    for ((name, value), (expected_name, expected)) in found.iter().zip(expected) {
        assert_eq!(name, expected_name);
        assert!((value - expected).abs() < 1e-9, "{name}: {value} is not {expected}");
    }
}

#[test]
fn a_straight_flight_breaks_nothing() {
    assert_broken(&[], |_| {});
}

#[test]
fn late_arrival() {
    // 5 s more than 20 s.
    assert_broken(&[("duration", 0.25)], |plan| plan.set_duration(0.0, 25.0));
}

#[test]
fn ends_that_are_missed() {
    // 0.1 of a domain 10 wide; speeds and accelerations stay within their bounds.
    assert_broken(&[("start", 0.01)], |plan| plan.tracks[0].path[0][1] += 0.1);
    assert_broken(&[("goal", 0.02)], |plan| plan.tracks[0].path[10][0] += 0.2);
}

#[test]
fn nodes_outside_the_domain() {
    let outside = |plan: &mut Plan| plan.tracks[0].path.iter_mut().for_each(|position| position[1] -= 1.3);
    assert_broken(&[("start", 0.13), ("goal", 0.13), ("domain", 0.03)], outside);
}

#[test]
fn speed_and_acceleration() {
    // The last interval takes 0.5 s: 1.6 / s, and 0.8 / s more within the mean of 1 s and 0.5 s.
    let hurried = |plan: &mut Plan| plan.times[10] = 9.5;
    assert_broken(&[("speed", 0.6), ("accel", 0.8 / 0.75 / 0.5 - 1.0)], hurried);
    // A first interval of 4 s: 0.2 / s, that is 0.6 / s less within 4 s of the start, then 0.6 / s more within 2.5 s.
    let slow = |plan: &mut Plan| plan.times.iter_mut().skip(1).for_each(|time| *time += 3.0);
    assert_broken(&[], slow);
    // A start at 0.8 / s northward of what is asked for.
    let aside = |plan: &mut Plan| plan.tracks[0].path[1][1] += 0.3;
    // |(0, 0.3) - (0, -0.3)| / 1 s^2.
    assert_broken(&[("accel", 0.6 / 0.5 - 1.0)], aside);
}

#[test]
fn the_start_velocity_counts_as_a_velocity() {
    let stored = scenario();
    let mut plan = Plan::straight(&stored.view(), 10.0).expect("it fits");
    // Standing still for the first 0.5 s: 1.6 / s^2 from the start velocity, more than from there to 0.8 / s.
    for (node, time) in plan.times.iter_mut().enumerate().skip(1) {
        *time = 0.5 + 1.1 * (node - 1) as f64;
    }
    plan.tracks[0].path[1] = plan.tracks[0].path[0];
    plan.tracks[0].path[2][0] = 1.8;
    let found = violations(&stored.view(), &plan, &mut [Sample::default()]);
    assert!((found.accel - (0.8 / 0.5 / 0.5 - 1.0)).abs() < 1e-9, "{found:?}");
}

#[test]
fn at_a_seam_the_interval_before_counts_too() {
    let stored = scenario();
    let mut view = stored.view();
    let mut plan = Plan::straight(&view, 10.0).expect("it fits");
    // 0.3 / s northward of the start velocity, and back again: 0.6 / s^2 over a first interval of 0.5 s.
    plan.tracks[0].path[1][1] += 0.15;
    for (node, time) in plan.times.iter_mut().enumerate().skip(1) {
        *time = 0.5 + 2.0 * (node - 1) as f64;
    }
    plan.tracks[0].path[1][0] = 1.4;
    let mut accel = |before| {
        view.frame.start_interval = before;
        violations(&view, &plan, &mut [Sample::default()]).accel
    };
    assert!((accel(None) - (0.3 / 0.5 / 0.5 - 1.0)).abs() < 1e-9);
    assert!((accel(Some(0.6)) - (0.3 / 0.55 / 0.5 - 1.0)).abs() < 1e-9);
    assert_eq!(accel(Some(2.0)), 0.0);
}

#[test]
fn intervals_that_do_not_advance() {
    let found = broken(|plan| plan.times[4] = plan.times[3]);
    assert!(found.contains(&("speed", f64::INFINITY)), "{found:?}");
}

#[test]
fn controls_and_budgets() {
    assert_broken(&[("jam_bounds", 0.2)], |plan| plan.tracks[0].jam[0] = 1.2);
    assert_broken(&[("dropout_bounds", 0.1)], |plan| plan.tracks[0].dropout[3] = -0.1);
    // 10 s at 0.5 are 3 s more than 2 s; 10 s at 0.1 are 0.5 s more than 0.5 s, and the scale is at least 1 s.
    assert_broken(&[("jam_budget", 1.5)], |plan| plan.tracks[0].jam = [0.5; 11]);
    assert_broken(&[("dropout_budget", 0.5)], |plan| plan.tracks[0].dropout = [0.1; 11]);
}

#[test]
fn limits_count_from_the_first_node() {
    let near = |node: usize| {
        // At distance 4 the probability is 1/16, above 0.04 by 0.5625 of it.
        broken(move |plan| plan.tracks[0].path[node] = Flat::new(5.0, 5.0))
    };
    let limit = |found: Vec<(&str, f64)>| found.iter().find(|(name, _)| *name == "limit").map(|entry| entry.1);
    assert!((limit(near(5)).expect("a violation") - 0.5625).abs() < 1e-5);
    assert_eq!(limit(near(0)), None);
}

#[test]
fn corners_of_regions_may_not_be_cut() {
    // Both ends are outside, the segment between them passes 0.4 from the centre.
    let cut = |plan: &mut Plan| {
        plan.tracks[0].path[5] = Flat::new(3.0, 2.6);
        plan.tracks[0].path[6] = Flat::new(7.0, 2.6);
    };
    let found = broken(cut);
    let depth = found.iter().find(|(name, _)| *name == "region").map(|entry| entry.1);
    assert!((depth.expect("a violation") - 0.6).abs() < 1e-9, "{found:?}");
}

#[test]
fn regions_concern_segments_that_end_in_their_window() {
    // Through the region that is there from 5 s to 8 s, at 4 s and at 5 s.
    let through = |node: usize| {
        let found = broken(move |plan| plan.tracks[0].path[node] = Flat::new(3.0, 0.1));
        found.iter().find(|(name, _)| *name == "region").map(|entry| entry.1)
    };
    assert_eq!(through(3), None);
    assert!((through(5).expect("a violation") - 0.8).abs() < 1e-9);
}

#[test]
fn what_is_not_a_number_is_not_feasible() {
    for change in [
        (|plan: &mut Plan| plan.tracks[0].path[3][0] = f64::NAN) as fn(&mut Plan),
        |plan| plan.tracks[0].jam[3] = f64::NAN,
        |plan| plan.tracks[0].dropout[3] = f64::NAN,
        |plan| plan.times[3] = f64::NAN,
    ] {
        let worst = broken(change).iter().map(|entry| entry.1).fold(0.0, f64::max);
        assert_eq!(worst, f64::INFINITY);
    }
}
