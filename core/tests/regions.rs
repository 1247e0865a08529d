//! Regions, separation and places in whole scenarios: what is refused, what is broken, and where.

use quietpath_core::constraints::{Constraint, Place, TOLERANCE, violations, worst_place};
use quietpath_core::error::{Error, Fault, Item};
use quietpath_core::metrics::Sample;
use quietpath_core::scenario::*;
use quietpath_core::{Draft, Metric, Point, Scenario, Trajectory};

type Flat = Point<f64, 2>;
type Plan = Trajectory<f64, 2, 11, 3>;
type Stored = Scenario<f64, 2, 1, 3, 0>;

/// Two agents fly east side by side, 1 apart, from x = 1 to x = 9 in 10 intervals; a third far north of them.
fn with(regions: &[Region<f64>], separation: Option<f64>, time_max: f64) -> Result<Stored, Error> {
    let agent = |north: f64| Agent {
        start: Flat::new(1.0, north),
        goal: Flat::new(9.0, north),
        start_velocity: None,
        speed_max: 10.0,
        accel_max: 100.0,
        weight: 1.0,
        jammer: None,
        dropout: None,
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
    Scenario::new(&Draft {
        softening: 1e-3,
        reference_point: ReferencePoint::Current,
        intervals: 10,
        start_time: 0.0,
        time: Timing { max: time_max, target: 0.0, penalty: 0.0 },
        domain: Domain { min: Flat::new(0.0, 0.0), max: Flat::new(10.0, 10.0) },
        separation,
        agents: &[agent(1.0), agent(2.0), agent(8.0)],
        sensors: &[sensor],
        terms: &[term],
        pooling: Pooling::None,
        regions,
        limits: &[],
    })
}

fn polygon(corners: &[[f64; 2]], side: Side) -> Region<f64> {
    let corners: Vec<_> = corners.iter().map(|&[x, y]| Flat::new(x, y)).collect();
    Region { shape: Shape::Polygon(Polygon::new(&corners).expect("convex")), side, window: Window::always() }
}

fn circle(center: [f64; 2], radius: f64, side: Side) -> Region<f64> {
    let shape = Shape::Circle { center: Flat::new(center[0], center[1]), radius };
    Region { shape, side, window: Window::always() }
}

/// What a change makes of the straight flights in 10 s: the violations above rounding, and the worst place.
fn broken(stored: &Stored, change: impl Fn(&mut Plan)) -> (Vec<(&'static str, f64)>, Option<Place<f64>>) {
    let view = stored.view();
    let mut plan = Plan::straight(&view, 10.0).expect("it fits");
    change(&mut plan);
    let found = violations(&view, &plan, &mut [Sample::default()]);
    let place = worst_place(&view, &plan, &mut [Sample::default()]);
    let (name, amount) = found.worst();
    match place {
        Some(place) => {
            assert_eq!((place.constraint.name(), place.amount), (name, amount));
            assert_eq!(found.of(place.constraint), amount);
        }
        None => assert_eq!(amount, 0.0),
    }
    (found.iter().filter(|(_, value)| *value > 1e-9).collect(), place)
}

fn assert_place(place: Option<Place<f64>>, expected: (Constraint, Option<usize>, usize, usize), amount: f64) {
    let place = place.expect("something is broken");
    assert_eq!((place.constraint, place.index, place.agent, place.node), expected);
    assert!((place.amount - amount).abs() < 1e-9, "{} is not {amount}", place.amount);
}

/// A square of side 2: its scale is the radius 1 of the circle inside.
const SQUARE: [[f64; 2]; 4] = [[4.0, 4.0], [6.0, 4.0], [6.0, 6.0], [4.0, 6.0]];

#[test]
fn a_polygon_is_entered_between_nodes_and_its_place_is_told() {
    let far = circle([5.0, 9.5], 0.2, Side::Outside);
    let stored = with(&[far, polygon(&SQUARE, Side::Outside)], None, 20.0).expect("valid");
    assert_eq!(broken(&stored, |_| {}), (vec![], None));
    // Agent 1 flies from (3, 3) to (7, 6): both outside, the way between cuts through.
    let (found, place) = broken(&stored, |plan| {
        plan.tracks[1].path[6] = Flat::new(3.0, 3.0);
        plan.tracks[1].path[7] = Flat::new(7.0, 6.0);
    });
    // Direction (4, 3) / 5, left normal (-3, 4) / 5: the corner (6, 4) lies 1 to the right, (4, 6) 1.8 to the left.
    assert_eq!(found.iter().map(|entry| entry.0).collect::<Vec<_>>(), ["region"]);
    assert_place(place, (Constraint::Region, Some(1), 1, 7), 1.0);
}

#[test]
fn regions_to_stay_in_hold_both_ends() {
    let yard = polygon(&[[0.5, 0.5], [9.5, 0.5], [9.5, 8.5], [0.5, 8.5]], Side::Inside);
    let stored = with(&[yard, circle([5.0, 5.0], 6.0, Side::Inside)], None, 20.0).expect("valid");
    assert_eq!(broken(&stored, |_| {}), (vec![], None));
    // 0.3 beyond the northern edge; twice the area over the perimeter is 144 / 34.
    let (_, place) = broken(&stored, |plan| plan.tracks[2].path[4].y = 8.8);
    assert_place(place, (Constraint::Region, Some(0), 2, 4), 0.3 / (144.0 / 34.0));
    // 6.6 from the centre of the circle, 10 % too far; out of the yard by 2.1.
    let (found, _) = broken(&stored, |plan| plan.tracks[2].path[10] = Flat::new(5.0, 11.6));
    let region = found.iter().find(|(name, _)| *name == "region").expect("left").1;
    assert!((region - 3.1 / (144.0 / 34.0)).abs() < 1e-9, "{region}");
    let only = with(&[circle([5.0, 5.0], 6.0, Side::Inside)], None, 20.0).expect("valid");
    let (found, _) = broken(&only, |plan| plan.tracks[2].path[10] = Flat::new(5.0, 11.6));
    assert!(found.iter().any(|(name, value)| *name == "region" && (value - 0.1).abs() < 1e-9), "{found:?}");
}

#[test]
fn agents_meet_between_nodes() {
    let stored = with(&[], Some(0.8), 20.0).expect("valid");
    assert_eq!(broken(&stored, |_| {}), (vec![], None));
    // Agents 0 and 1 change sides within one interval: apart at both nodes, and through each other in between.
    let (found, place) = broken(&stored, |plan| {
        for node in 5..=9 {
            plan.tracks[0].path[node].y = 2.0;
            plan.tracks[1].path[node].y = 1.0;
        }
    });
    assert_eq!(found.iter().map(|entry| entry.0).collect::<Vec<_>>(), ["separation"]);
    assert_place(place, (Constraint::Separation, Some(1), 0, 5), 1.0);
    // 0.2 apart at one node.
    let (_, place) = broken(&stored, |plan| plan.tracks[1].path[3].y = 1.2);
    assert_place(place, (Constraint::Separation, Some(1), 0, 3), 0.75);
    assert_eq!(place.expect("a place").to_string(), "agent[0] and agent[1] come closer than separation at node 3");
    let (_, place) = broken(&stored, |plan| plan.tracks[1].path[3].y = f64::NAN);
    assert_eq!(place.expect("a place").amount, f64::INFINITY);
}

#[test]
fn places_of_the_other_constraints() {
    let stored = with(&[], None, 20.0).expect("valid");
    let place = |change: fn(&mut Plan)| broken(&stored, change).1.expect("something is broken");
    let told = |change: fn(&mut Plan)| {
        let place = place(change);
        (place.constraint, place.agent, place.node)
    };
    assert_eq!(told(|plan| plan.set_duration(0.0, 30.0)), (Constraint::Duration, 0, 10));
    assert_eq!(told(|plan| plan.tracks[1].path[0].x -= 0.5), (Constraint::Start, 1, 0));
    assert_eq!(told(|plan| plan.tracks[2].path[10].x -= 0.5), (Constraint::Goal, 2, 10));
    assert_eq!(told(|plan| plan.tracks[2].path[3].y += 4.0), (Constraint::Domain, 2, 3));
    assert_eq!(told(|plan| plan.tracks[1].path[4].y = f64::INFINITY).0, Constraint::Domain);
    assert_eq!(told(|plan| plan.times[6] = plan.times[5] + 0.01), (Constraint::Speed, 0, 6));
    assert_eq!(told(|plan| plan.tracks[2].jam[8] = 1.5), (Constraint::JamBudget, 2, 10));
    assert_eq!(told(|plan| plan.tracks[1].dropout[7] = -0.5), (Constraint::DropoutBounds, 1, 7));
    let said = place(|plan| plan.tracks[2].path[3].y += 4.0).to_string();
    assert_eq!(said, "domain is broken by agent[2] at node 3");
}

#[test]
fn ends_on_the_wrong_side_are_refused_where_no_plan_could_help() {
    let refused = |region: Region<f64>| with(&[region], None, 20.0).err();
    let fault = |index, field, fault| Some(Error::new(Item::Agent(index), field, fault));
    let block = polygon(&[[0.2, 1.5], [2.0, 1.5], [2.0, 3.0], [0.2, 3.0]], Side::Outside);
    let inside = Fault::InsideRegion { region: 0 };
    assert_eq!(refused(block), fault(1, "start", inside));
    assert_eq!(refused(circle([9.0, 8.0], 0.5, Side::Outside)), fault(2, "goal", inside));
    let outside = Fault::OutsideRegion { region: 0 };
    assert_eq!(refused(circle([5.0, 2.0], 5.0, Side::Inside)), fault(2, "start", outside));
    // On the boundary is allowed, and so is a depth that counts as feasible.
    assert_eq!(refused(circle([9.0, 9.0], 1.0, Side::Outside)), None);
    assert_eq!(refused(circle([9.0, 9.0], 1.0 + 0.5 * TOLERANCE, Side::Outside)), None);
    assert!(refused(circle([9.0, 9.0], 1.0 + 2.0 * TOLERANCE, Side::Outside)).is_some());
}

#[test]
fn ends_in_a_region_that_comes_or_goes_are_refused_only_where_that_is_sure() {
    // Flights take 0.8 s to 20 s, the first interval 0.08 s to 2 s.
    let start = |from: f64, until: f64| {
        let region = Region { window: Window { from, until }, ..circle([1.0, 8.0], 0.5, Side::Outside) };
        with(&[region], None, 20.0).is_err()
    };
    assert!(start(f64::NEG_INFINITY, 2.1) && start(0.05, 2.1));
    assert!(!start(f64::NEG_INFINITY, 1.9) && !start(0.1, 30.0));
    let goal = |from: f64, until: f64| {
        let region = Region { window: Window { from, until }, ..circle([9.0, 8.0], 0.5, Side::Outside) };
        with(&[region], None, 20.0).is_err()
    };
    assert!(goal(0.7, 20.1));
    assert!(!goal(0.9, 20.1) && !goal(0.7, 19.9));
}

#[test]
fn agents_too_close_at_the_ends_are_refused() {
    assert!(with(&[], Some(1.0), 20.0).is_ok());
    let close = Fault::TooClose { other: 0, distance: 1.0, least: 1.25 };
    assert_eq!(with(&[], Some(1.25), 20.0).err(), Some(Error::new(Item::Agent(1), "start", close)));
    let said = with(&[], Some(1.25), 20.0).err().map(|error| error.to_string());
    assert_eq!(
        said.as_deref(),
        Some("agent[1].start is 1 from that of agent[0], closer than `separation`, which is 1.25")
    );
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let error = with(&[], Some(bad), 20.0).expect_err("refused");
        assert_eq!((error.item, error.field), (Item::Scenario, "separation"));
    }
}
