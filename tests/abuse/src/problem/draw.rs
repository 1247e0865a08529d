//! Draws problems.

use quietpath_core::math::norm;
use quietpath_core::scenario::{
    Agent, AgentSet, BeamPattern, Betrayal, Detection, Domain, Dropout, Jammer, Knot, Limit, Motion, Polygon,
    Pooling, Ranging, Reduce, ReferencePoint, Region, Sense, Sensor, Shape, Side, Sighting, Susceptibility, Term,
    Timing, Window,
};
use quietpath_core::{Draft, Error, Metric, Point, Real, Scenario};

use crate::dice::Dice;

/// Nodes of the time grid.
pub const NODES: usize = 21;
/// Sensors.
pub const SENSORS: usize = 6;
/// Agents.
pub const AGENTS: usize = 2;
/// Entries of all tracks.
pub const KNOTS: usize = 8;

/// Side of the domain, length units.
const SIDE: f64 = 10.0;
/// One problem in this many has something that no problem may have, of each kind: what is refused teaches little.
const WRONG_ONE_IN: usize = 60;

/// A sensor with a track of its own.
#[derive(Clone, Debug)]
struct Station<T, const DIM: usize> {
    motion: Path<T, DIM>,
    ranging: Option<Ranging<T>>,
    detection: Option<Detection<T>>,
    jam: Susceptibility<T>,
}

#[derive(Clone, Debug)]
enum Path<T, const DIM: usize> {
    Fixed(Point<T, DIM>),
    Track(Vec<Knot<T, DIM>>),
    Steady(Sighting<T, DIM>),
}

/// A problem before it is checked.
#[derive(Clone, Debug)]
pub struct Problem<T, const DIM: usize> {
    softening: T,
    reference_point: ReferencePoint,
    pooling: Pooling<T>,
    intervals: usize,
    start_time: T,
    time: Timing<T>,
    domain: Domain<T, DIM>,
    separation: Option<T>,
    agents: Vec<Agent<T, DIM>>,
    stations: Vec<Station<T, DIM>>,
    terms: Vec<Term<T>>,
    regions: Vec<Region<T>>,
    limits: Vec<Limit<T>>,
}

impl<T: Real, const DIM: usize> Problem<T, DIM> {
    /// Draws a problem.
    pub fn draw(dice: &mut Dice<'_>) -> Self {
        let is_wrong = |dice: &mut Dice<'_>| dice.one_in(WRONG_ONE_IN);
        let sizes: &[usize] = if is_wrong(dice) { &[0, NODES] } else { &[16, 8, 1, 2, 3, 4, 12, 19, NODES - 1] };
        let intervals = dice.of(sizes).unwrap_or(16);
        let earliest = if is_wrong(dice) { -50.0 } else { 0.0 };
        let start_time = if dice.one_in(4) { dice.real(earliest, 50.0) } else { T::zero() };
        let count = 1 + usize::from(dice.one_in(4)) + usize::from(is_wrong(dice));
        let agents: Vec<_> = (0..count).map(|_| agent(dice)).collect();
        let times: &[f64] = if is_wrong(dice) { &[0.9, 0.0] } else { &[1.5, 1.0, 1.001, 1.1, 2.0, 4.0] };
        let allowed = dice.of(times).unwrap_or(1.5);
        let fastest = |agent: &Agent<T, DIM>| (norm(&(agent.goal - agent.start)) / agent.speed_max).to_f64();
        let shortest = agents.iter().map(fastest).fold(0.0, f64::max);
        let shortest = if shortest > 0.0 { shortest } else { 10.0 };
        let max = start_time + T::real(shortest * allowed);
        let stations: Vec<_> = {
            let counts: &[usize] = if is_wrong(dice) { &[0, SENSORS + 1] } else { &[3, 4, 5, SENSORS, 1, 2] };
            let count = dice.of(counts).unwrap_or(3);
            let line = dice.one_in(6);
            (0..count).map(|index| station(dice, line.then_some(index), agents.first())).collect()
        };
        let ranging = stations.iter().filter(|station| station.ranging.is_some()).count();
        let terms = (0..1 + dice.below(2)).map(|_| term(dice, ranging > DIM)).collect();
        let ends: Vec<_> = agents.iter().flat_map(|agent| [agent.start, agent.goal]).collect();
        let regions = (0..dice.of(&[0, 0, 0, 1, 2]).unwrap_or(0)).filter_map(|_| region(dice, &ends)).collect();
        let limits = (0..usize::from(dice.one_in(8))).map(|_| limit(dice, ranging > DIM)).collect();
        Self {
            softening: dice.real(0.01, 0.2),
            reference_point: if dice.one_in(3) { ReferencePoint::Lagged } else { ReferencePoint::Current },
            pooling: pooling(dice),
            intervals,
            start_time,
            time: Timing { max, target: start_time + dice.real(0.0, shortest * 1.5), penalty: penalty(dice) },
            domain: Domain { min: Point::zeros(), max: Point::repeat(T::real(SIDE)) },
            separation: if dice.one_in(8) { Some(dice.real(0.1, 1.0)) } else { None },
            agents,
            stations,
            terms,
            regions,
            limits,
        }
    }

    /// Checks it.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn stored(&self) -> Result<Scenario<T, DIM, SENSORS, AGENTS, KNOTS>, Error> {
        let sensors: Vec<Sensor<'_, T, DIM>> = self.stations.iter().map(borrowed).collect();
        Scenario::new(&Draft {
            softening: self.softening,
            reference_point: self.reference_point,
            pooling: self.pooling,
            intervals: self.intervals,
            start_time: self.start_time,
            time: self.time,
            domain: self.domain,
            separation: self.separation,
            agents: &self.agents,
            sensors: &sensors,
            terms: &self.terms,
            regions: &self.regions,
            limits: &self.limits,
        })
    }
}

fn borrowed<T: Real, const DIM: usize>(station: &Station<T, DIM>) -> Sensor<'_, T, DIM> {
    let motion = match &station.motion {
        Path::Fixed(position) => Motion::Fixed(*position),
        Path::Track(knots) => Motion::Track(knots),
        Path::Steady(sighting) => Motion::Steady(*sighting),
    };
    Sensor { motion, ranging: station.ranging, detection: station.detection, jam: station.jam }
}

fn penalty<T: Real>(dice: &mut Dice<'_>) -> T {
    if dice.one_in(3) { dice.real(0.0, 0.1) } else { T::zero() }
}

fn agent<T: Real, const DIM: usize>(dice: &mut Dice<'_>) -> Agent<T, DIM> {
    let start = dice.point(0.0, SIDE);
    let goal = if dice.one_in(20) { start } else { dice.point(0.0, SIDE) };
    let speed_max = dice.real(0.05, 0.5);
    Agent {
        start,
        goal,
        start_velocity: start_velocity(dice, goal - start, speed_max),
        speed_max,
        accel_max: dice.real(0.005, 0.2),
        weight: if dice.one_in(8) { T::zero() } else { T::one() },
        jammer: if dice.one_in(3) { Some(jammer(dice)) } else { None },
        dropout: if dice.one_in(4) { Some(Dropout { budget: budget(dice) }) } else { None },
    }
}

/// Mostly slow and towards the goal: another may not be followed in what time there is.
fn start_velocity<T: Real, const DIM: usize>(
    dice: &mut Dice<'_>,
    way: Point<T, DIM>,
    speed_max: T,
) -> Option<Point<T, DIM>> {
    let distance = norm(&way);
    match dice.below(20) {
        17 => Some(dice.point(-0.2, 0.2)),
        18 => Some(Point::zeros()),
        19 if distance > T::zero() => Some(way * (speed_max * dice.real(0.0, 1.0) / distance)),
        _ => None,
    }
}

fn budget<T: Real>(dice: &mut Dice<'_>) -> T {
    if dice.one_in(6) { T::zero() } else { dice.real(0.0, 60.0) }
}

fn jammer<T: Real>(dice: &mut Dice<'_>) -> Jammer<T> {
    let beam_width = dice.real(0.05, 3.0);
    let q = dice.real(1.0, 20.0);
    let patterns = [BeamPattern::Isotropic, BeamPattern::Cosine, BeamPattern::Cone { beam_width }];
    let betrayals = [Betrayal::None, Betrayal::Linear, Betrayal::Sigmoid, Betrayal::Max { q }];
    Jammer {
        pattern: dice.of(&patterns).unwrap_or(BeamPattern::Isotropic),
        betrayal: dice.of(&betrayals).unwrap_or(Betrayal::None),
        budget: budget(dice),
    }
}

/// A sensor; one of several in a line, by its index, or anywhere, now and then at a start.
fn station<T: Real, const DIM: usize>(
    dice: &mut Dice<'_>,
    line: Option<usize>,
    agent: Option<&Agent<T, DIM>>,
) -> Station<T, DIM> {
    let at = match (line, agent) {
        (Some(index), _) => Point::repeat(T::from_count(index + 1)),
        (None, Some(agent)) if dice.one_in(16) => agent.start,
        (None, _) if dice.one_in(16) => Point::repeat(T::real(SIDE / 2.0)),
        (None, _) => dice.point(0.0, SIDE),
    };
    let velocity = || T::real(0.02);
    let motion = match dice.below(8) {
        6 => Path::Steady(Sighting { time: dice.real(-10.0, 10.0), position: at, velocity: dice.point(-0.1, 0.1) }),
        7 => Path::Track(
            (0..1 + dice.below(4))
                .map(|index| {
                    let time = T::real(20.0 * index as f64);
                    Knot { time, position: at + Point::repeat(velocity() * time) }
                })
                .collect(),
        ),
        _ => Path::Fixed(at),
    };
    let path_loss = dice.of(&[2.0, 1.0, 0.5, 3.0, 4.0, 2.7]).unwrap_or(2.0);
    let path_loss = T::real(path_loss);
    let ranging = match dice.below(8) {
        0 => None,
        1..=3 => Some(Ranging::Rss { scale: dice.real(1e-4, 0.1), path_loss }),
        _ => Some(Ranging::Toa { c1: dice.real(1e-4, 0.1), c2: dice.real(0.0, 1.0), path_loss }),
    };
    let detection = match dice.below(8) {
        0 => None,
        1..=4 => Some(Detection::Proxy { scale: dice.real(0.0, 2.0), epsilon: dice.real(0.0, 1.0), path_loss }),
        _ => Some(Detection::Energy {
            samples: samples(dice),
            signal: dice.real(0.01, 10.0),
            noise: dice.real(0.01, 2.0),
            log_threshold: dice.real(-3.0, 3.0),
            path_loss,
        }),
    };
    let gain = |dice: &mut Dice<'_>| if dice.one_in(3) { T::zero() } else { dice.real(0.0, 50.0) };
    let jam = Susceptibility {
        error_gain: gain(dice),
        error_exponent: dice.real(0.5, 3.0),
        detect_gain: gain(dice),
        detect_exponent: dice.real(0.5, 3.0),
    };
    Station { motion, ranging, detection, jam }
}

fn samples(dice: &mut Dice<'_>) -> u32 {
    let counts: &[u32] = if dice.one_in(WRONG_ONE_IN) { &[0, 40_961] } else { &[100, 1, 39, 40, 41, 1001, 40_960] };
    dice.of(counts).unwrap_or(100)
}

fn pooling<T: Real>(dice: &mut Dice<'_>) -> Pooling<T> {
    match dice.below(16) {
        14 => Pooling::Uncorrelated { log_threshold: dice.real(-3.0, 3.0) },
        15 => Pooling::Correlated { log_threshold: dice.real(-3.0, 3.0), correlation: dice.real(0.0, 1.0) },
        _ => Pooling::None,
    }
}

fn window<T: Real>(dice: &mut Dice<'_>) -> Window<T> {
    if dice.one_in(5) {
        let from = dice.real(0.0, 40.0);
        let least = if dice.one_in(WRONG_ONE_IN) { T::zero() } else { from };
        Window { from, until: least + dice.real(0.01, 160.0) }
    } else {
        Window::always()
    }
}

fn metric(dice: &mut Dice<'_>, can_locate: bool) -> Metric {
    let all: Vec<Metric> =
        Metric::ALL.into_iter().filter(|metric| can_locate || !metric.is_location_error()).collect();
    dice.of(&all).unwrap_or(Metric::Detection)
}

fn term<T: Real>(dice: &mut Dice<'_>, can_locate: bool) -> Term<T> {
    let metric = metric(dice, can_locate);
    let hides = matches!(metric, Metric::Detection | Metric::FalseAlarm);
    Term {
        metric,
        sense: if hides == dice.one_in(10) { Sense::Maximize } else { Sense::Minimize },
        reduce: if dice.one_in(4) { Reduce::Extreme } else { Reduce::Integral },
        weight: dice.real(0.0, 2.0),
        agents: if dice.one_in(6) { AgentSet(1) } else { AgentSet::ALL },
        window: window(dice),
    }
}

/// A region; mostly none that an end of an agent's path is on the wrong side of.
fn region<T: Real, const DIM: usize>(dice: &mut Dice<'_>, ends: &[Point<T, DIM>]) -> Option<Region<T>> {
    let center: Point<T, 2> = dice.point(0.0, SIDE);
    let radius: T = dice.real(0.1, 3.0);
    let side = if dice.one_in(10) { Side::Inside } else { Side::Outside };
    // A polygon reaches to its corners.
    let reach = if side == Side::Outside { radius * T::real(1.5) } else { radius };
    let is_near = |end: &Point<T, DIM>| norm(&(end.fixed_rows::<2>(0) - center)) < reach;
    let is_right = ends.iter().all(|end| is_near(end) == (side == Side::Inside));
    if !is_right && !dice.one_in(WRONG_ONE_IN) {
        return None;
    }
    let shape = if dice.one_in(3) {
        let corner = |east: f64, north: f64| center + Point::<T, 2>::new(T::real(east), T::real(north)) * radius;
        Shape::Polygon(Polygon::new(&[corner(-1.0, -1.0), corner(1.0, -1.0), corner(0.3, 1.0)]).ok()?)
    } else {
        Shape::Circle { center, radius }
    };
    Some(Region { shape, side, window: window(dice) })
}

fn limit<T: Real>(dice: &mut Dice<'_>, can_locate: bool) -> Limit<T> {
    let metric = metric(dice, can_locate);
    let bound = dice.real(0.0, 1.0);
    if dice.one_in(3) {
        Limit { metric, min: Some(bound), max: None }
    } else {
        Limit { metric, min: None, max: Some(bound) }
    }
}
