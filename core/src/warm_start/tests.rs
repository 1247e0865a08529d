use super::*;
use crate::metrics::{Digits, Needs, Situation, figures};
use crate::model::jamming::Emitter;
use crate::scenario::{
    Agent, AgentSet, BeamPattern, Betrayal, Detection, Domain, Draft, Jammer, Knot, Limit, Metric, Motion, Pooling,
    Ranging, ReferencePoint, Region, Scenario, Sense, Sensor, Shape, Side, Susceptibility, Term, Timing, Window,
};
use std::boxed::Box;
use std::vec::Vec as List;

type Place = Point<f64, 2>;
type Path = Trajectory<f64, 2, 41, 1>;
type Found = Result<f64, Obstruction<f64, 2>>;

const JAM: Susceptibility<f64> =
    Susceptibility { error_gain: 0.0, error_exponent: 2.0, detect_gain: 0.0, detect_exponent: 2.0 };

fn sensor(motion: Motion<'_, f64, 2>) -> Sensor<'_, f64, 2> {
    Sensor {
        motion,
        ranging: Some(Ranging::Toa { c1: 0.01, c2: 0.1, path_loss: 2.0 }),
        detection: Some(Detection::Proxy { scale: 0.3, epsilon: 0.3, path_loss: 2.0 }),
        jam: JAM,
    }
}

fn region(x: f64, y: f64, radius: f64) -> Region<f64> {
    let shape = Shape::Circle { center: Place::new(x, y), radius };
    Region { shape, side: Side::Outside, window: Window::always() }
}

/// From (1, 5) to (9, 5) at speed 0.1.
fn agent() -> Agent<f64, 2> {
    Agent {
        start: Place::new(1.0, 5.0),
        goal: Place::new(9.0, 5.0),
        start_velocity: None,
        speed_max: 0.1,
        accel_max: 0.02,
        weight: 1.0,
        jammer: None,
        dropout: None,
    }
}

fn term(reduce: Reduce) -> Term<f64> {
    Term {
        metric: Metric::Detection,
        sense: Sense::Minimize,
        reduce,
        weight: 1.0,
        agents: AgentSet::ALL,
        window: Window::always(),
    }
}

/// A square of 10.
fn draft<'a>(
    agents: &'a [Agent<f64, 2>],
    sensors: &'a [Sensor<'a, f64, 2>],
    terms: &'a [Term<f64>],
) -> Draft<'a, f64, 2> {
    Draft {
        softening: 0.05,
        reference_point: ReferencePoint::Current,
        pooling: Pooling::None,
        intervals: 40,
        start_time: 0.0,
        time: Timing { max: 400.0, target: 400.0, penalty: 0.0 },
        domain: Domain { min: Place::new(0.0, 0.0), max: Place::new(10.0, 10.0) },
        agents,
        sensors,
        terms,
        separation: None,
        regions: &[],
        limits: &[],
    }
}

/// From (1, 5) to (9, 5) in a square of 10 at speed 0.1, in `duration` seconds.
fn find(
    sensors: &[Sensor<'_, f64, 2>],
    (regions, limits): (&[Region<f64>], &[Limit<f64>]),
    reduce: Reduce,
    duration: f64,
) -> (Path, Found) {
    find_with((4.0, 0.0), sensors, (regions, limits), reduce, duration)
}

/// The same with slices that reach so many cells, in memory that holds such rates.
fn find_with(
    (reach, rate): (f64, f64),
    sensors: &[Sensor<'_, f64, 2>],
    (regions, limits): (&[Region<f64>], &[Limit<f64>]),
    reduce: Reduce,
    duration: f64,
) -> (Path, Found) {
    let variant = Variant { reach, inflation: 1.12, duration, span: duration, others: None };
    let (path, found) = search_with((variant, rate), sensors, (regions, limits), reduce);
    (path, found.map(|routes| routes.cost()))
}

/// The same for a variant.
fn search_with(
    (variant, rate): (Variant<f64>, f64),
    sensors: &[Sensor<'_, f64, 2>],
    (regions, limits): (&[Region<f64>], &[Limit<f64>]),
    reduce: Reduce,
) -> (Path, Result<Routes<f64, 2>, Obstruction<f64, 2>>) {
    let (agents, terms) = ([agent()], [term(reduce)]);
    let draft = Draft { regions, limits, ..draft(&agents, sensors, &terms) };
    let scenario = Scenario::<f64, 2, 32, 1, 8>::new(&draft).unwrap();
    let view = scenario.view();
    let mut path = Path::straight(&view, variant.duration).unwrap();
    let mut landscape = Box::new(Landscape::EMPTY);
    landscape.rates.fill(rate as f32);
    let mut tables = Box::new(Tables::<1024, 32768>::EMPTY);
    let lattice = &mut Lattice { landscape: &mut landscape, tables: &mut tables };
    let mut scratch = [Sample::default(); 32];
    let found = search(&view, &mut path, 0, (&variant, Prices::default()), lattice, &mut scratch);
    (path, found)
}

/// A sweep for many flight times finds for each what a sweep for that one alone finds.
#[test]
fn one_sweep_finds_the_ways_of_all_flight_times() {
    let sensors = wall(2.0, 10.0);
    let all = Variant { reach: 4.0, inflation: 1.12, duration: 140.0, span: 140.0, others: Some([100.0, 140.0]) };
    let (_, routes) = search_with((all, 0.0), &sensors, (&[], &[]), Reduce::Integral);
    let routes = routes.expect("there is a way round");
    let mut compared = 0;
    for route in &routes.list {
        let alone = Variant { duration: routes.plan.duration(route.slices), others: None, ..all };
        let (path, found) = search_with((alone, 0.0), &sensors, (&[], &[]), Reduce::Integral);
        let found = found.expect("there is a way round");
        assert!((path.duration() - alone.duration).abs() < 1e-9);
        if found.plan.slices == route.slices {
            assert_eq!(found.list[0].cells, route.cells);
            assert!((found.cost() - route.cost).abs() < 1e-5 * route.cost, "{} and {}", found.cost(), route.cost);
            compared += 1;
        }
    }
    assert!(compared >= routes::ROUTES_MAX.min(3), "{compared} of {}", routes.len());
    let costs: List<f64> = routes.list.iter().map(|route| route.cost).collect();
    assert!(costs.is_sorted(), "{costs:?}");
}

fn nodes(path: &Path) -> &[Place] {
    &path.tracks[0].path[..path.nodes()]
}

/// A column of sensors at x = 5 from `low` to `high`.
fn wall(low: f64, high: f64) -> List<Sensor<'static, f64, 2>> {
    let count = ((high - low) / 0.5) as usize;
    (0..=count).map(|index| sensor(Motion::Fixed(Place::new(5.0, low + 0.5 * index as f64)))).collect()
}

#[test]
fn goes_around_a_wall_of_sensors() {
    for reduce in [Reduce::Integral, Reduce::Extreme] {
        let (path, found) = find(&wall(2.0, 10.0), (&[], &[]), reduce, 140.0);
        assert!(found.is_ok(), "{found:?}");
        let crossing = nodes(&path).iter().find(|place| place[0] > 5.0).unwrap();
        assert!(crossing[1] < 1.2, "{reduce:?}: crosses at {crossing}");
        assert_eq!((nodes(&path)[0], nodes(&path)[40]), (Place::new(1.0, 5.0), Place::new(9.0, 5.0)));
    }
}

#[test]
fn estimates_what_the_path_costs() {
    let (path, found) = find(&wall(2.0, 10.0), (&[], &[]), Reduce::Integral, 140.0);
    let sensors = wall(2.0, 10.0);
    let cost: f64 = nodes(&path)[1..]
        .iter()
        .map(|place| {
            let missed: f64 = sensors
                .iter()
                .map(|sensor| {
                    let Motion::Fixed(at) = sensor.motion else { return 1.0 };
                    1.0 - (0.3 / (0.3 + crate::math::norm_squared(&(place - at)) + 0.0025)).min(1.0)
                })
                .product();
            (1.0 - missed) * 140.0 / 40.0
        })
        .sum();
    let estimate = found.unwrap();
    assert!((estimate - cost).abs() < 0.05 * cost, "{estimate} for {cost}");
}

#[test]
fn keeps_out_of_a_region() {
    let across = region(5.0, 5.5, 2.0);
    let (path, found) =
        find(&[sensor(Motion::Fixed(Place::new(5.0, 1.0)))], (&[across], &[]), Reduce::Integral, 120.0);
    assert!(found.is_ok(), "{found:?}");
    let excess = crate::constraints::region::excess(&across, &path.times[..41], nodes(&path)).amount;
    // Nodes cut the corners of the lattice path by little.
    assert!(excess < 0.05, "{excess}");
    assert!(nodes(&path).iter().any(|place| (place[1] - 5.0).abs() > 1.4));
}

#[test]
fn names_the_region_that_closes_the_way() {
    let closed = [region(2.0, 9.0, 0.5), region(5.0, 2.0, 2.2), region(5.0, 5.0, 1.4), region(5.0, 8.2, 2.2)];
    let (_, found) = find(&[sensor(Motion::Fixed(Place::new(5.0, 1.0)))], (&closed, &[]), Reduce::Integral, 160.0);
    let obstruction = found.unwrap_err();
    assert!(matches!(obstruction.by, Blocked::Region(1..=3)), "{obstruction:?}");
    assert!((obstruction.position[0] - 5.0).abs() < 2.2, "{obstruction:?}");
}

#[test]
fn names_the_limit_that_closes_the_way() {
    let limit = Limit { metric: Metric::Detection, min: None, max: Some(0.5) };
    let (_, found) = find(&wall(0.0, 10.0), (&[], &[limit]), Reduce::Integral, 160.0);
    let obstruction = found.unwrap_err();
    assert_eq!(obstruction.by, Blocked::Limit(0));
    assert!((obstruction.position[0] - 5.0).abs() < 2.0, "{obstruction:?}");
}

#[test]
fn a_limit_that_leaves_a_gap_sends_the_path_there() {
    let limit = Limit { metric: Metric::Detection, min: None, max: Some(0.5) };
    let (path, found) = find(&wall(3.0, 10.0), (&[], &[limit]), Reduce::Integral, 160.0);
    assert!(found.is_ok(), "{found:?}");
    let crossing = nodes(&path).iter().find(|place| place[0] > 5.0).unwrap();
    assert!(crossing[1] < 2.2, "crosses at {crossing}");
}

#[test]
fn says_that_time_is_too_short() {
    let across = region(5.0, 5.0, 3.0);
    let (_, found) = find(&[sensor(Motion::Fixed(Place::new(5.0, 1.0)))], (&[across], &[]), Reduce::Integral, 82.0);
    let obstruction = found.unwrap_err();
    assert_eq!(obstruction.by, Blocked::Region(0), "{obstruction:?}");
    let (_, found) = find(&[sensor(Motion::Fixed(Place::new(5.0, 1.0)))], (&[], &[]), Reduce::Integral, 60.0);
    assert_eq!(found.unwrap_err().by, Blocked::Time);
}

#[test]
fn gives_way_to_a_moving_sensor_when_it_comes() {
    // It crosses the straight line at x = 5 when the agent is there, from south to north, or the other way.
    for (from, to) in [(1.0, 9.0), (9.0, 1.0)] {
        let track = [
            Knot { time: 0.0, position: Place::new(5.0, from) },
            Knot { time: 110.0, position: Place::new(5.0, to) },
        ];
        let (path, found) = find(&[sensor(Motion::Track(&track))], (&[], &[]), Reduce::Integral, 110.0);
        assert!(found.is_ok(), "{found:?}");
        let closest = nodes(&path)
            .iter()
            .zip(&path.times)
            .map(|(place, time)| norm(&(place - Place::new(5.0, from + (to - from) * time / 110.0))))
            .fold(f64::INFINITY, f64::min);
        assert!(closest > 2.0, "closest {closest}");
    }
}

/// Slices that reach farther than any move look at more cells from the start.
#[test]
fn what_the_memory_held_before_does_not_count() {
    let track =
        [Knot { time: 0.0, position: Place::new(5.0, 2.0) }, Knot { time: 110.0, position: Place::new(5.0, 8.0) }];
    for reach in [4.0, 9.0, 14.0] {
        let with = |rate: f64| {
            find_with((reach, rate), &[sensor(Motion::Track(&track))], (&[], &[]), Reduce::Integral, 110.0)
        };
        let (clean, used) = (with(0.0), with(-1e6));
        assert_eq!(clean.1, used.1, "reach {reach}");
        assert_eq!(nodes(&clean.0), nodes(&used.0), "reach {reach}");
    }
}

#[test]
fn finds_its_way_in_three_dimensions() {
    let agent = Agent {
        start: Point::<f64, 3>::new(1.0, 5.0, 0.3),
        goal: Point::<f64, 3>::new(9.0, 5.0, 0.3),
        start_velocity: None,
        speed_max: 0.1,
        accel_max: 0.02,
        weight: 1.0,
        jammer: None,
        dropout: None,
    };
    let term = Term {
        metric: Metric::Detection,
        sense: Sense::Minimize,
        reduce: Reduce::Integral,
        weight: 1.0,
        agents: AgentSet::ALL,
        window: Window::always(),
    };
    let below = Sensor {
        motion: Motion::Fixed(Point::<f64, 3>::new(5.0, 5.0, 0.0)),
        ranging: None,
        detection: Some(Detection::Proxy { scale: 0.3, epsilon: 0.3, path_loss: 2.0 }),
        jam: JAM,
    };
    let scenario = Scenario::<f64, 3, 4, 1, 0>::new(&Draft {
        softening: 0.05,
        reference_point: ReferencePoint::Current,
        pooling: Pooling::None,
        intervals: 40,
        start_time: 0.0,
        time: Timing { max: 400.0, target: 400.0, penalty: 0.0 },
        domain: Domain { min: Point::<f64, 3>::new(0.0, 4.9, 0.0), max: Point::<f64, 3>::new(10.0, 5.1, 3.0) },
        agents: &[agent],
        sensors: &[below],
        terms: &[term],
        separation: None,
        regions: &[],
        limits: &[],
    })
    .unwrap();
    let view = scenario.view();
    let mut path = Trajectory::<f64, 3, 41, 1>::straight(&view, 110.0).unwrap();
    let mut landscape = Box::new(Landscape::EMPTY);
    let mut tables = Box::new(Tables::<1024, 32768>::EMPTY);
    let lattice = &mut Lattice { landscape: &mut landscape, tables: &mut tables };
    let mut scratch = [Sample::default(); 4];
    let variant = Variant { reach: 4.0, inflation: 1.12, duration: 110.0, span: 110.0, others: None };
    search(&view, &mut path, 0, (&variant, Prices::default()), lattice, &mut scratch).unwrap();
    // The domain is a sheet: over it is the only way around.
    let highest = path.tracks[0].path[..41].iter().map(|place| place[2]).fold(0.0, f64::max);
    assert!(highest > 1.5, "highest {highest}");
}

/// In three dimensions there are more moves within reach than the list holds; every one that leads from a block to another
/// stays in the grid.
#[test]
fn a_full_list_of_moves_stays_in_the_grid() {
    let corner = Point::<f64, 3>::new(10.0, 10.0, 10.0);
    let domain = Domain { min: Point::zeros(), max: corner };
    let grid = grid::Grid::new(&domain, (&Point::zeros(), &corner), 30.0, 1024);
    let mut moves = grid::Moves::none();
    moves.collect(&grid, 10.0 * grid.size());
    assert!(moves.all().len() > 200, "{}", moves.all().len());
    let (mut cost, mut next) = (List::from([1.0; 1024]), List::from([f32::INFINITY; 1024]));
    let (landscape, mut parents) = (List::from([1.0; 1024]), List::from([0_u8; 1024]));
    let whole = sweep::Patch::whole(sweep::Block::whole(&grid.counts));
    let cells = grid.cells();
    cost.truncate(cells);
    let mut sweep =
        Sweep { landscape: &landscape, cost: &cost, next: &mut next, parents: &mut parents, interval: 2.0 };
    sweep.run(&grid.counts, moves.all(), (&whole, &whole), None::<fn(usize, usize) -> bool>);
    // The landscape is level: all that counts is that every cell is reached, and from a cell.
    assert!(next[..cells].iter().all(|&total| total == 3.0), "{next:?}");
    for (cell, &parent) in parents.iter().enumerate().take(cells) {
        assert!(moves.origin(parent, cell) < cells);
    }
}

/// Rows that end at different borders, and moves that see cells between, come out as the definition has it.
#[test]
fn a_sweep_takes_the_least_of_all_moves() {
    let domain = Domain { min: Place::zeros(), max: Place::new(10.0, 7.0) };
    let grid = grid::Grid::new(&domain, (&Place::zeros(), &Place::new(10.0, 7.0)), 30.0, 400);
    let mut moves = grid::Moves::none();
    moves.collect(&grid, 4.2 * grid.size());
    let mut random = 1_u32;
    let mut draw = || {
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (random >> 8) as f32 / (1 << 24) as f32
    };
    let cells = grid.cells();
    let landscape: List<f32> = (0..cells).map(|_| draw()).collect();
    let cost: List<f32> = (0..cells).map(|_| draw()).collect();
    let (mut next, mut parents) = (List::from([f32::INFINITY; 400]), List::from([0_u8; 400]));
    let whole = sweep::Patch::whole(sweep::Block::whole(&grid.counts));
    let mut sweep =
        Sweep { landscape: &landscape, cost: &cost, next: &mut next, parents: &mut parents, interval: 0.5 };
    sweep.run(&grid.counts, moves.all(), (&whole, &whole), None::<fn(usize, usize) -> bool>);
    for to in 0..cells {
        let at = grid.coordinates(to);
        let least = moves.all().iter().filter_map(|step| {
            let from = [0, 1].map(|axis| at[axis] as i64 - i64::from(step.offset()[axis]));
            let inside = (0..2).all(|axis| (0..grid.counts[axis] as i64).contains(&from[axis]));
            inside.then(|| {
                let between: List<f32> = step.between().map(|back| landscape[to.wrapping_add_signed(back)]).collect();
                let from = step.origin(to);
                let sum = f32::midpoint(landscape[from], landscape[to]) + between.iter().sum::<f32>();
                cost[from] + 0.5 * sum / (between.len() + 1) as f32
            })
        });
        let least = least.fold(f32::INFINITY, f32::min);
        assert!((next[to] - least).abs() < 1e-6, "{to}: {} for {least}", next[to]);
    }
}

/// Location errors of a lattice are those of a plan, to more digits than it stores, with jamming and silence; without enough
/// sensors there are none.
#[test]
fn a_lattice_knows_location_errors() {
    let jam = Susceptibility { error_gain: 3.0, error_exponent: 2.0, ..JAM };
    let places = [(1.0, 2.0), (4.0, 7.0), (6.0, 3.0), (8.0, 8.0), (9.0, 1.0)];
    let sensors = places.map(|(x, y)| Sensor { jam, ..sensor(Motion::Fixed(Place::new(x, y))) });
    let (agents, terms) = ([agent()], [term(Reduce::Integral)]);
    let known = |count: usize| Scenario::<f64, 2, 32, 1, 8>::new(&draft(&agents, &sensors[..count], &terms)).unwrap();
    let (scenario, few_sensors) = (known(5), known(2));
    let jammer = Jammer { pattern: BeamPattern::Isotropic, budget: 10.0, betrayal: Betrayal::None };
    let emitters = [Emitter::new(0, &jammer, Place::new(5.0, 5.0), 0.7, 0.0)];
    let mut scratch = [Sample::default(); 32];
    let mut located = |scenario: &Scenario<_, 2, 32, 1, 8>, emitters: &[_], (position, dropout), digits| {
        let (reference, betrayal) = (None, Betrayal::None);
        let here = Situation { time: 0.0, position, reference, dropout, level: 0.0, betrayal };
        let needs = Needs { location: true, ..Needs::default() };
        figures(&scenario.view(), &here, emitters, (needs, digits), &mut scratch).location
    };
    for (x, y, dropout) in [(5.0, 5.0, 0.0), (0.5, 9.5, 0.5), (4.0, 7.01, 0.9), (9.5, 0.2, 0.0)] {
        let at = (Place::new(x, y), dropout);
        for emitters in [&emitters[..], &[]] {
            let all = located(&scenario, emitters, at, Digits::All).expect("enough sensors");
            let few = located(&scenario, emitters, at, Digits::Few).expect("enough sensors");
            let pairs = [(all.trace, few.trace), (all.ln_det, few.ln_det), (all.variance_sum, few.variance_sum)];
            for (all, few) in pairs {
                assert!((all - few).abs() < 1e-8 * all.abs().max(1.0), "({x}, {y}): {few} for {all}");
            }
        }
        assert!(located(&few_sensors, &[], at, Digits::Few).is_none());
    }
}
