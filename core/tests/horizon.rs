//! The rolling horizon: what one step leaves to the next, in worlds that change.

use quietpath_core::constraints::{TOLERANCE, budget, violations};
use quietpath_core::error::{Fault, Item};
use quietpath_core::horizon::{Cadence, Choice, Horizon, NEAR_ITERATIONS, Reveal, Search, State, Step, reveal};
use quietpath_core::math::norm;
use quietpath_core::metrics::Sample;
use quietpath_core::objective::{Extreme, value};
use quietpath_core::scenario::*;
use quietpath_core::solver::{Settings, Start, Status, Workspace, plan};
use quietpath_core::{Draft, Metric, Point, Scenario, Trajectory};

type Flat = Point<f64, 2>;
type World = Scenario<f64, 2, 8, 1, 8>;
type Flight = Horizon<f64, 2, 33, 1>;
type Memory = Workspace<f64, 2, 33, 8, 1>;

const INTERVALS: usize = 24;
const BUDGET: f64 = 20.0;
const GOAL: [f64; 2] = [9.0, 5.0];

/// A scenario before it is checked.
#[derive(Clone)]
struct Mission {
    agent: Agent<f64, 2>,
    sensors: Vec<Sensor<'static, f64, 2>>,
    terms: Vec<Term<f64>>,
    limits: Vec<Limit<f64>>,
}

impl Mission {
    fn stored(&self) -> World {
        let draft = Draft {
            softening: 0.05,
            reference_point: ReferencePoint::Lagged,
            pooling: Pooling::None,
            intervals: INTERVALS,
            start_time: 10.0,
            time: Timing { max: 150.0, target: 100.0, penalty: 0.01 },
            domain: Domain { min: Flat::zeros(), max: Flat::new(10.0, 10.0) },
            agents: &[self.agent],
            sensors: &self.sensors,
            terms: &self.terms,
            separation: None,
            regions: &[],
            limits: &self.limits,
        };
        World::new(&draft).expect("a valid scenario")
    }
}

fn sensor(motion: Motion<'static, f64, 2>) -> Sensor<'static, f64, 2> {
    Sensor {
        motion,
        ranging: Some(Ranging::Toa { c1: 0.01, c2: 0.1, path_loss: 2.0 }),
        detection: Some(Detection::Proxy { scale: 0.3, epsilon: 0.3, path_loss: 2.0 }),
        jam: Susceptibility { error_gain: 20.0, error_exponent: 1.0, detect_gain: 0.0, detect_exponent: 1.0 },
    }
}

fn at(east: f64, north: f64) -> Sensor<'static, f64, 2> {
    sensor(Motion::Fixed(Flat::new(east, north)))
}

fn term(metric: Metric, sense: Sense) -> Term<f64> {
    Term { metric, sense, reduce: Reduce::Integral, weight: 1.0, agents: AgentSet::ALL, window: Window::always() }
}

/// From west to east past sensors, hidden from their detection.
fn hide(sensors: Vec<Sensor<'static, f64, 2>>) -> Mission {
    let agent = Agent {
        start: Flat::new(1.0, 5.0),
        goal: Flat::from(GOAL),
        start_velocity: None,
        speed_max: 0.15,
        accel_max: 0.012,
        weight: 1.0,
        jammer: None,
        dropout: None,
    };
    Mission { agent, sensors, terms: vec![term(Metric::Detection, Sense::Minimize)], limits: Vec::new() }
}

/// The same flight, jamming, to be located badly.
fn confuse() -> Mission {
    let sensors = vec![at(3.0, 4.0), at(5.0, 7.0), at(7.0, 3.5), at(6.0, 5.5)];
    let mut mission = hide(sensors);
    let jammer = Jammer { pattern: BeamPattern::Isotropic, betrayal: Betrayal::None, budget: BUDGET };
    mission.agent.jammer = Some(jammer);
    mission.terms = vec![term(Metric::LogAee, Sense::Maximize)];
    mission
}

/// A sensor that crosses the way.
fn crossing() -> Sensor<'static, f64, 2> {
    const TRACK: [Knot<f64, 2>; 2] =
        [Knot { time: 0.0, position: Flat::new(5.0, 8.5) }, Knot { time: 150.0, position: Flat::new(6.5, 1.0) }];
    sensor(Motion::Track(&TRACK))
}

fn replan(flight: &mut Flight, seen: &View<'_, f64, 2>, search: Search) -> Step<f64, 2> {
    let mut memory = Box::new(Memory::new());
    flight.replan(seen, &Settings::default(), search, &mut memory, &mut || false).expect("it can be planned")
}

/// Flies a whole mission; the steps, and the flight at its end.
fn roll(mission: &Mission, how: Reveal, steps: usize) -> (Vec<Step<f64, 2>>, Flight) {
    let world = mission.stored();
    let view = world.view();
    let mut flight = Flight::new(&view).expect("it fits");
    let mut done = Vec::new();
    while !flight.has_arrived() {
        let sensors = reveal::<_, 2, 8>(&view, how, flight.tail().start_time(), |_| true).expect("they fit");
        let step = replan(&mut flight, &view.with_sensors(&sensors), Search::Tail);
        let length = Cadence::Even { steps }.length(INTERVALS, done.len(), 0, step.change);
        assert_eq!(flight.fly(length), length);
        done.push(step);
    }
    (done, flight)
}

fn objective(view: &View<'_, f64, 2>, plan: &Trajectory<f64, 2, 33, 1>) -> f64 {
    value(view, plan, Extreme::Exact, &mut [Sample::default(); 8])
}

/// How near a path comes to a place.
fn nearest(plan: &Trajectory<f64, 2, 33, 1>, place: Flat) -> f64 {
    plan.tracks[0].path[..plan.nodes()].iter().map(|at| norm(&(at - place))).fold(f64::INFINITY, f64::min)
}

#[test]
fn a_flight_past_a_moving_sensor_arrives_within_all_bounds() {
    let mission = hide(vec![at(3.0, 5.2), at(7.0, 4.5), crossing()]);
    let (steps, flight) = roll(&mission, Reveal::Current, 8);
    assert_eq!(steps.len(), 8);
    assert!(steps.iter().all(|step| step.feasible), "{steps:?}");
    assert!(steps[1..].iter().any(|step| step.choice == Choice::New && step.change > 0.0), "{steps:?}");
    let flown = flight.flown();
    assert_eq!(flown.intervals(), INTERVALS);
    assert_eq!(flown.tracks[0].path[INTERVALS], Flat::from(GOAL));
    let world = mission.stored();
    let found = violations(&world.view(), flown, &mut [Sample::default(); 8]);
    assert!(found.worst().1 <= TOLERANCE, "{found:?}");
    // Interval lengths change at seams, and nowhere else.
    let intervals: Vec<f64> = (1..=INTERVALS).map(|node| flown.interval(node)).collect();
    let is_seam = |node: usize| node.is_multiple_of(3);
    let mut widest: f64 = 0.0;
    for node in 1..INTERVALS {
        let jump = (intervals[node] - intervals[node - 1]).abs() / intervals[0];
        if is_seam(node) {
            widest = widest.max(jump);
        } else {
            assert!(jump < 1e-9, "node {node}: {jump}");
        }
    }
    assert!(widest > 1e-4, "no step chose another flight time: {intervals:?}");
}

#[test]
fn velocity_is_continuous_at_seams_within_the_acceleration_bound() {
    let mission = hide(vec![at(3.0, 5.2), at(7.0, 4.5), crossing()]);
    let (_, flight) = roll(&mission, Reveal::Current, 12);
    let flown = flight.flown();
    let path = &flown.tracks[0].path;
    let velocity = |node: usize| (path[node] - path[node - 1]) / flown.interval(node);
    let mut largest: f64 = 0.0;
    for seam in (2..INTERVALS).step_by(2) {
        let bound = mission.agent.accel_max * (flown.interval(seam) + flown.interval(seam + 1)) / 2.0;
        let change = norm(&(velocity(seam + 1) - velocity(seam)));
        assert!(change <= bound * (1.0 + 1e-9), "node {seam}: {change} of {bound}");
        largest = largest.max(change / bound);
    }
    // The bound is not idle: some seam turns.
    assert!(largest > 0.3, "{largest}");
}

#[test]
fn budgets_carry_over() {
    let mission = confuse();
    let (steps, flight) = roll(&mission, Reveal::Current, 6);
    assert!(steps.iter().all(|step| step.feasible), "{steps:?}");
    let flown = flight.flown();
    let spent = budget::integral(&flown.times[..flown.nodes()], &flown.tracks[0].jam[..flown.nodes()]);
    assert!((spent - flight.spent(0).jam).abs() <= 1e-9 * BUDGET, "{spent} flown, {:?}", flight.spent(0));
    assert!(spent <= BUDGET * (1.0 + 1e-9), "{spent}");
    assert!(spent >= BUDGET * 0.99, "{spent}");
}

#[test]
fn a_budget_that_is_spent_leaves_a_silent_rest() {
    let mut mission = confuse();
    let world = mission.stored();
    let mut flight = Flight::new(&world.view()).expect("it fits");
    replan(&mut flight, &world.view(), Search::Tail);
    flight.fly(9);
    let spent = flight.spent(0).jam;
    assert!(spent > 0.1 * BUDGET && spent < 0.9 * BUDGET, "{spent}");
    // Less was on board than was thought.
    if let Some(jammer) = &mut mission.agent.jammer {
        jammer.budget = spent;
    }
    let empty = mission.stored();
    for _ in 0..2 {
        let step = replan(&mut flight, &empty.view(), Search::Tail);
        assert!(step.feasible && step.outcome.status != Status::NonFinite, "{step:?}");
        flight.fly(5);
    }
    assert!(flight.flown().tracks[0].jam[10..=19].iter().all(|&level| level == 0.0));
    assert_eq!(flight.spent(0).jam, spent);
}

#[test]
fn an_empty_budget_is_planned_with() {
    let mut mission = confuse();
    if let Some(jammer) = &mut mission.agent.jammer {
        jammer.budget = 0.0;
    }
    let (steps, flight) = roll(&mission, Reveal::Current, 4);
    assert!(steps.iter().all(|step| step.feasible), "{steps:?}");
    assert!(flight.flown().tracks[0].jam.iter().all(|&level| level == 0.0));
}

#[test]
fn a_sensor_that_appears_is_avoided_and_one_that_is_lost_is_not() {
    let without = hide(vec![at(5.0, 0.5)]).stored();
    let mut flight = Flight::new(&without.view()).expect("it fits");
    replan(&mut flight, &without.view(), Search::Tail);
    // In the middle of the way that was planned without it.
    let place = flight.tail().tracks[0].path[16] + Flat::new(0.0, 0.1);
    let with = hide(vec![at(5.0, 0.5), at(place[0], place[1])]).stored();
    let unaware = nearest(flight.tail(), place);
    flight.fly(6);
    let step = replan(&mut flight, &with.view(), Search::Tail);
    let aware = nearest(flight.tail(), place);
    assert!(step.change > 0.05 && step.choice == Choice::New, "{step:?}");
    assert!(aware > unaware + 0.5, "{aware} after {unaware}");
    flight.fly(2);
    let step = replan(&mut flight, &without.view(), Search::Tail);
    assert!(step.feasible && step.choice == Choice::New, "{step:?}");
    let again = nearest(flight.tail(), place);
    assert!(again < aware - 0.2, "{again} after {aware}");
}

#[test]
fn a_sensor_that_keeps_its_velocity_is_predicted_exactly() {
    let world = hide(vec![at(3.0, 5.2), at(7.0, 4.5), crossing()]).stored();
    let view = world.view();
    let told = |how| reveal::<_, 2, 8>(&view, how, 10.0, |_| true).expect("they fit");
    let (current, predicted, known) = (told(Reveal::Current), told(Reveal::Predicted), told(Reveal::Known));
    let place = |sensors: &[StoredSensor<f64, 2>], time| view.with_sensors(sensors).sensor_state(&sensors[2], time).0;
    for time in [10.0, 60.0, 140.0] {
        assert!(norm(&(place(&predicted, time) - place(&known, time))) < 1e-12);
        assert_eq!(place(&current, time), place(&known, 10.0));
    }
    let mut flights = [&current, &predicted, &known].map(|sensors| {
        let mut flight = Flight::new(&view).expect("it fits");
        replan(&mut flight, &view.with_sensors(sensors), Search::Tail);
        objective(&view, flight.tail())
    });
    assert!((flights[1] - flights[2]).abs() < 1e-6, "{flights:?}");
    assert!(flights[0] > flights[2] + 1e-3, "{flights:?}");
    flights.sort_by(f64::total_cmp);
    let hidden = reveal::<_, 2, 8>(&view, Reveal::Known, 10.0, |index| index != 1).expect("they fit");
    assert_eq!(hidden.len(), 2);
}

#[test]
fn the_objective_may_switch_between_steps() {
    let mut mission = confuse();
    let confusing = mission.stored();
    mission.terms = vec![term(Metric::Detection, Sense::Minimize)];
    let hiding = mission.stored();
    let mut flight = Flight::new(&confusing.view()).expect("it fits");
    replan(&mut flight, &confusing.view(), Search::Tail);
    flight.fly(8);
    let before = flight.tail().clone();
    let step = replan(&mut flight, &hiding.view(), Search::Tail);
    assert!(step.feasible && step.choice == Choice::New && step.change > 0.0, "{step:?}");
    let (old, new) = (objective(&hiding.view(), &before), objective(&hiding.view(), flight.tail()));
    assert!(new < old - 0.1, "{new} after {old}");
    assert!((step.outcome.objective - new).abs() <= 1e-9 * new.abs());
}

#[test]
fn a_step_without_a_feasible_plan_keeps_the_tail() {
    let mission = hide(vec![at(3.0, 5.2), at(7.0, 4.5)]);
    let open = mission.stored();
    let mut flight = Flight::new(&open.view()).expect("it fits");
    replan(&mut flight, &open.view(), Search::Tail);
    flight.fly(4);
    let before = flight.tail().clone();
    // No place is that quiet.
    let closed =
        Mission { limits: vec![Limit { metric: Metric::Detection, min: None, max: Some(1e-6) }], ..mission.clone() };
    let step = replan(&mut flight, &closed.stored().view(), Search::Tail);
    assert_eq!((step.choice, step.feasible, step.outcome.status), (Choice::Tail, false, Status::Infeasible));
    assert_eq!(flight.tail(), &before);
    // The way opens again, and the flight goes on.
    let step = replan(&mut flight, &open.view(), Search::Tail);
    assert!(step.feasible, "{step:?}");
}

#[test]
fn too_few_sensors_to_be_located_by_keep_the_tail() {
    let mission = confuse();
    let world = mission.stored();
    let mut flight = Flight::new(&world.view()).expect("it fits");
    let two = reveal::<_, 2, 8>(&world.view(), Reveal::Current, 10.0, |index| index < 2).expect("they fit");
    let blind = world.view().with_sensors(&two);
    let mut memory = Box::new(Memory::new());
    let refused = flight.replan(&blind, &Settings::default(), Search::Tail, &mut memory, &mut || false);
    let error = refused.expect_err("there is no tail to keep");
    assert_eq!((error.item, error.fault), (Item::Term(0), Fault::TooFewRanging { have: 2, need: 3 }));
    replan(&mut flight, &world.view(), Search::Tail);
    flight.fly(4);
    let before = flight.tail().clone();
    let step = replan(&mut flight, &blind, Search::Tail);
    assert_eq!((step.choice, step.outcome.status), (Choice::Tail, Status::NonFinite));
    assert_eq!(flight.tail(), &before);
}

#[test]
fn adaptive_steps_follow_the_change_that_is_seen() {
    let cadence = Cadence::Adaptive { shortest: 1, longest: 6, change: 0.05 };
    let mission = hide(vec![at(3.0, 5.2), at(7.0, 4.5)]);
    let calm = mission.stored();
    let moved = Mission { sensors: vec![at(3.0, 5.2), at(7.5, 6.0)], ..mission.clone() }.stored();
    let mut flight = Flight::new(&calm.view()).expect("it fits");
    let (mut lengths, mut before) = (Vec::new(), 0);
    while !flight.has_arrived() {
        // One sensor has moved when the fourth step begins.
        let seen = if lengths.len() < 3 { calm.view() } else { moved.view() };
        let step = replan(&mut flight, &seen, Search::Tail);
        before = cadence.length(INTERVALS, lengths.len(), before, step.change);
        lengths.push(flight.fly(before));
    }
    assert_eq!(lengths[..4], [1, 2, 4, 2], "{lengths:?}");
    assert_eq!(lengths.iter().sum::<usize>(), INTERVALS);
}

#[test]
fn a_vehicle_that_was_blown_off_is_planned_for_from_where_it_is() {
    let mission = hide(vec![at(3.0, 5.2), at(7.0, 4.5)]);
    let world = mission.stored();
    let mut flight = Flight::new(&world.view()).expect("it fits");
    replan(&mut flight, &world.view(), Search::Tail);
    let interval = flight.tail().interval(1);
    let (node, next) = (flight.tail().tracks[0].path[5], flight.tail().tracks[0].path[6]);
    let state = State {
        position: (node + next) / 2.0 + Flat::new(0.0, 0.15),
        velocity: (next - node) / interval * 0.9 + Flat::new(0.0, 0.01),
    };
    let time = 10.0 + 5.5 * interval;
    flight.resume(time, &[state]).expect("one state for one agent");
    assert_eq!(flight.flown().nodes(), 7);
    assert_eq!(flight.flown().tracks[0].path[6], state.position);
    let step = replan(&mut flight, &world.view(), Search::Tail);
    assert!(step.feasible, "{step:?}");
    let tail = flight.tail();
    assert_eq!((tail.intervals(), tail.start_time(), tail.tracks[0].path[0]), (INTERVALS - 5, time, state.position));
    let first = (tail.tracks[0].path[1] - state.position) / tail.interval(1);
    assert!(norm(&(first - state.velocity)) <= mission.agent.accel_max * tail.interval(1) * (1.0 + 1e-4));
    let mut there = mission.clone();
    (there.agent.start, there.agent.start_velocity) = (state.position, Some(state.velocity));
    let found = violations(&there.stored().view(), tail, &mut [Sample::default(); 8]);
    assert!(found.worst().1 <= TOLERANCE, "{found:?}");
    let wrong = flight.resume(time, &[state, state]).expect_err("two states for one agent");
    assert_eq!(wrong.fault, Fault::TooMany { count: 2, capacity: 1 });
}

#[test]
fn a_new_plan_is_never_worse_than_the_tail_and_anew_never_worse_than_near_it() {
    let mission = hide(vec![at(3.0, 5.2), at(7.0, 4.5), crossing()]);
    let world = mission.stored();
    let mut flight = Flight::new(&world.view()).expect("it fits");
    let cold = replan(&mut flight, &world.view(), Search::Tail);
    let mut memory = Box::new(Memory::new());
    let whole = plan(&world.view(), &Settings::default(), Start::Global, &mut memory, &mut || false).expect("a plan");
    assert_eq!(cold.outcome.objective, whole.objective);
    flight.fly(6);
    let mut other = flight.clone();
    let near = replan(&mut flight, &world.view(), Search::Tail);
    let anew = replan(&mut other, &world.view(), Search::Anew);
    assert!(anew.outcome.objective <= near.outcome.objective);
    assert!(anew.outcome.evaluations > near.outcome.evaluations);
}

#[test]
fn a_warm_step_iterates_little_where_it_can_refine_and_longer_where_it_cannot() {
    let mission = hide(vec![at(3.0, 5.2), at(7.0, 4.5), crossing()]);
    let world = mission.stored();
    let warm = |refinements| {
        let settings = Settings { refinements, ..Settings::default() };
        let mut memory = Box::new(Memory::new());
        let mut flight = Flight::new(&world.view()).expect("it fits");
        let mut step = |seen: &View<'_, f64, 2>| {
            flight.replan(seen, &settings, Search::Tail, &mut memory, &mut || false).expect("it can be planned");
            flight.fly(6)
        };
        step(&world.view());
        let sensors = reveal::<_, 2, 8>(&world.view(), Reveal::Current, 60.0, |_| true).expect("they fit");
        let seen = world.view().with_sensors(&sensors);
        flight.replan(&seen, &settings, Search::Tail, &mut memory, &mut || false).expect("it can be planned")
    };
    let (refined, unrefined) = (warm(120), warm(0));
    assert!(refined.outcome.iterations <= NEAR_ITERATIONS && refined.outcome.refinements > 0, "{refined:?}");
    assert!(unrefined.outcome.iterations > NEAR_ITERATIONS, "{unrefined:?}");
    assert_eq!([refined, unrefined].map(|step| step.outcome.status), [Status::Converged; 2]);
    let gap = unrefined.outcome.objective - refined.outcome.objective;
    assert!(gap.abs() <= 1e-3 * refined.outcome.objective.abs(), "{refined:?} {unrefined:?}");
}
