//! Where there is no feasible plan, the planner says which constraint stands in the way, whom it stops, and where.

use quietpath_core::constraints::Constraint;
use quietpath_core::math::norm;
use quietpath_core::scenario::*;
use quietpath_core::solver::{Extent, Obstacle, Outcome, Settings, Start, Status, Workspace, plan};
use quietpath_core::{Draft, Metric, Point, Scenario};

type Flat = Point<f64, 2>;
type Memory = Workspace<f64, 2, 31, 1, 2>;

/// Agents at 0.1 a second through a domain of 10 by `height` with one sensor in the south.
struct Problem<'a> {
    ends: &'a [([f64; 2], [f64; 2])],
    height: f64,
    regions: &'a [Region<f64>],
    limits: &'a [Limit<f64>],
    separation: Option<f64>,
    time_max: f64,
    start_velocity: Option<Flat>,
    /// Arrival from which on lateness costs its square.
    target: Option<f64>,
}

/// One agent flies east through the middle.
const EAST: Problem<'static> = Problem {
    ends: &[([1.0, 5.0], [8.0, 5.0])],
    height: 10.0,
    regions: &[],
    limits: &[],
    separation: None,
    time_max: 250.0,
    start_velocity: None,
    target: None,
};

impl Problem<'_> {
    fn planned(&self, start: Start<'_, f64, 2, 31, 2>, is_late: bool) -> (Outcome<f64, 2>, Box<Memory>) {
        let agents: Vec<_> = (self.ends.iter())
            .map(|(start, goal)| Agent {
                start: Flat::from(*start),
                goal: Flat::from(*goal),
                start_velocity: self.start_velocity,
                speed_max: 0.1,
                accel_max: 0.02,
                weight: 1.0,
                jammer: None,
                dropout: None,
            })
            .collect();
        let sensor = Sensor {
            motion: Motion::Fixed(Flat::new(5.0, 0.0)),
            ranging: None,
            detection: Some(Detection::Proxy { scale: 0.3, epsilon: 0.3, path_loss: 2.0 }),
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
        let scenario = Scenario::<f64, 2, 1, 2, 0>::new(&Draft {
            softening: 0.05,
            reference_point: ReferencePoint::Current,
            intervals: 30,
            start_time: 0.0,
            time: Timing {
                max: self.time_max,
                target: self.target.unwrap_or_default(),
                penalty: if self.target.is_some() { 1.0 } else { 0.0 },
            },
            domain: Domain { min: Flat::new(0.0, 0.0), max: Flat::new(10.0, self.height) },
            separation: self.separation,
            agents: &agents,
            sensors: &[sensor],
            terms: &[term],
            pooling: Pooling::None,
            regions: self.regions,
            limits: self.limits,
        })
        .expect("a valid scenario");
        let mut memory = Box::new(Memory::new());
        let outcome = plan(&scenario.view(), &Settings::default(), start, &mut memory, &mut || is_late);
        (outcome.expect("it fits"), memory)
    }

    /// What stands in the way from the global start.
    fn obstacle(&self) -> Obstacle<f64, 2> {
        let (outcome, _) = self.planned(Start::Global, false);
        assert_eq!(outcome.status, Status::Infeasible);
        outcome.obstacle.expect("an obstacle")
    }
}

fn circle(center: [f64; 2], radius: f64) -> Region<f64> {
    let shape = Shape::Circle { center: Flat::from(center), radius };
    Region { shape, side: Side::Outside, window: Window::always() }
}

fn wall(west: f64, east: f64, (south, north): (f64, f64)) -> Region<f64> {
    let corners = [[west, south], [east, south], [east, north], [west, north]].map(Flat::from);
    let shape = Shape::Polygon(Polygon::new(&corners).expect("convex"));
    Region { shape, side: Side::Outside, window: Window::always() }
}

/// Regions that overlap all around a place.
fn ring(center: [f64; 2]) -> Vec<Region<f64>> {
    let eighth = std::f64::consts::FRAC_PI_4;
    let at = |turn: f64| [center[0] + 1.2 * turn.cos(), center[1] + 1.2 * turn.sin()];
    (0..8).map(|index| circle(at(f64::from(index) * eighth), 0.6)).collect()
}

#[test]
fn a_ring_around_the_goal_is_named_where_it_is_crossed() {
    let found = Problem { regions: &ring([8.0, 5.0]), ..EAST }.obstacle();
    assert_eq!((found.constraint, found.agent, found.extent), (Constraint::Region, 0, Extent::EveryWay));
    let index = found.index.expect("a region");
    let Shape::Circle { center, radius } = ring([8.0, 5.0])[index].shape else { panic!("a ring of circles") };
    assert!(norm(&(found.position - center)) < 2.0 * radius, "{found:?} for {center}");
    assert!(found.time > 0.0 && found.time <= 250.0, "{found:?}");
}

#[test]
fn a_wall_thinner_than_a_step_is_named_and_not_the_gate_that_leaves_a_way() {
    let closed = [circle([2.0, 8.5], 0.5), wall(4.0, 4.05, (-1.0, 11.0))];
    let found = Problem { regions: &closed, ..EAST }.obstacle();
    assert_eq!((found.constraint, found.index, found.agent), (Constraint::Region, Some(1), 0));
    assert!((found.position[0] - 4.0).abs() < 0.5, "{found:?}");
    let open = [wall(4.0, 4.05, (-1.0, 7.0)), wall(4.0, 4.05, (8.0, 11.0))];
    let (outcome, _) = Problem { regions: &open, ..EAST }.planned(Start::Global, false);
    assert_ne!(outcome.status, Status::Infeasible);
    assert_eq!(outcome.obstacle, None);
}

#[test]
fn a_limit_that_no_way_keeps_is_named_where_it_is_broken_first() {
    // Detection at the north end of the line x = 5 is about 0.003.
    let limit = Limit { metric: Metric::Detection, min: None, max: Some(0.002) };
    let found = Problem { limits: &[limit], ..EAST }.obstacle();
    assert_eq!((found.constraint, found.index, found.agent), (Constraint::Limit, Some(0), 0));
    assert_eq!(found.extent, Extent::EveryWay);
}

#[test]
fn the_agent_that_is_stopped_is_named() {
    let ends = [([1.0, 2.0], [8.0, 2.0]), ([1.0, 6.0], [8.0, 6.0])];
    let found = Problem { ends: &ends, regions: &ring([8.0, 6.0]), ..EAST }.obstacle();
    assert_eq!((found.constraint, found.agent), (Constraint::Region, 1), "{found:?}");
    assert!(norm(&(found.position - Flat::new(8.0, 6.0))) < 2.5, "{found:?}");
}

#[test]
fn agents_that_cannot_pass_each_other_are_named() {
    let ends = [([1.0, 0.2], [8.0, 0.2]), ([8.0, 0.2], [1.0, 0.2])];
    let found = Problem { ends: &ends, height: 0.4, separation: Some(0.6), ..EAST }.obstacle();
    assert_eq!((found.constraint, found.agent, found.index), (Constraint::Separation, 0, Some(1)));
    assert_eq!(found.extent, Extent::BestPath);
}

#[test]
fn a_straight_line_that_is_all_there_is_has_to_be_feasible_too() {
    let regions = [circle([4.0, 5.0], 1.0)];
    let found = Problem { regions: &regions, time_max: 70.0, ..EAST }.obstacle();
    assert_eq!((found.constraint, found.index), (Constraint::Region, Some(0)));
    let (outcome, _) = Problem { time_max: 70.0, ..EAST }.planned(Start::Global, false);
    assert_eq!((outcome.status, outcome.obstacle), (Status::Converged, None));
}

#[test]
fn a_plan_that_is_cut_off_in_a_region_is_not_called_feasible() {
    let regions = [circle([4.0, 5.0], 1.0)];
    for start in [Start::Straight, Start::Global] {
        let (outcome, _) = Problem { regions: &regions, ..EAST }.planned(start, true);
        assert_eq!(outcome.status, Status::Infeasible, "{start:?}");
        assert_eq!(outcome.obstacle.map(|found| found.constraint), Some(Constraint::Region));
    }
}

/// The first path may cross a region: the planner leads it out again.
#[test]
fn a_start_velocity_is_not_blamed_for_a_region() {
    let regions = [circle([4.0, 5.3], 1.0)];
    let start_velocity = Some(Flat::new(0.05, 0.0));
    for start in [Start::Straight, Start::Global] {
        let (outcome, _) = Problem { regions: &regions, start_velocity, ..EAST }.planned(start, false);
        assert_eq!(outcome.obstacle, None, "{start:?}");
        assert!(!matches!(outcome.status, Status::Infeasible | Status::NonFinite), "{start:?} {:?}", outcome.status);
    }
}

#[test]
fn a_way_that_makes_late_is_better_than_none() {
    // Around the south end of the wall it takes about 107 s.
    let regions = [wall(4.0, 4.05, (1.0, 11.0))];
    let (outcome, memory) = Problem { regions: &regions, target: Some(75.0), ..EAST }.planned(Start::Global, false);
    assert_eq!(outcome.obstacle, None, "{:?}", outcome.status);
    let duration = memory.best().duration();
    assert!((100.0..115.0).contains(&duration), "{duration}");
}
