//! Pieces of planning by themselves, on grids and among sensors of several sizes: what instructions are counted of.
//!
//! Limits: capacities are the largest size's, so that copies of whole trajectories cost the small ones more than they need.

use quietpath_core::horizon::{Horizon, Search};
use quietpath_core::metrics::Sample;
use quietpath_core::objective::{Extreme, gradient, value};
use quietpath_core::scenario::{
    Agent, AgentSet, Detection, Domain, Draft, Metric, Motion, Pooling, Ranging, Reduce, ReferencePoint, Scenario,
    Sense, Sensor, Susceptibility, Term, Timing, Window,
};
use quietpath_core::solver::{Settings, Start, Workspace, plan};
use quietpath_core::{Error, Point, Trajectory};

/// Intervals and sensors of the sizes that are measured.
pub const INTERVALS: [usize; 3] = [16, 32, 64];
/// Sensors of the sizes that are measured.
pub const SENSORS: [usize; 3] = [4, 8, 16];

const NODES: usize = 65;
const SENSORS_MAX: usize = 16;

/// A checked problem.
pub type Problem = Scenario<f32, 2, SENSORS_MAX, 1, 1>;
/// The planner's memory.
pub type Memory = Workspace<f32, 2, NODES, SENSORS_MAX, 1>;
/// A path, or a derivative by it.
pub type Path = Trajectory<f32, 2, NODES, 1>;
/// A flight.
pub type Flight = Horizon<f32, 2, NODES, 1>;
/// Scratch for a node.
pub type Scratch = [Sample<f32, 2>; SENSORS_MAX];

/// Who detects how.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Detector {
    /// The rational proxy.
    Proxy,
    /// An energy detector of 100 samples.
    Energy,
}

/// A problem of a size, whose objective is one metric.
///
/// # Errors
/// None for the sizes that are measured.
#[inline(never)]
pub fn problem(intervals: usize, sensors: usize, metric: Metric, detector: Detector) -> Result<Problem, Error> {
    let detection = match detector {
        Detector::Proxy => Detection::Proxy { scale: 0.3, epsilon: 0.3, path_loss: 2.0 },
        Detector::Energy => {
            Detection::Energy { samples: 100, signal: 1.0, noise: 1.0, log_threshold: 1.0, path_loss: 2.0 }
        }
    };
    // Around the way, ring by ring of four.
    let all: [Sensor<'_, f32, 2>; SENSORS_MAX] = core::array::from_fn(|index| {
        let (ring, side) = ((index / 4) as f32, index % 4);
        let off = 1.5 + 0.8 * ring;
        let [east, north] = [[off, 0.3 * ring], [-0.4 * ring, off], [-off, -0.2 * ring], [0.5 * ring, -off]][side];
        Sensor {
            motion: Motion::Fixed(Point::from([5.0 + east, 5.0 + north])),
            ranging: Some(Ranging::Toa { c1: 0.01, c2: 0.1, path_loss: 2.0 }),
            detection: Some(detection),
            jam: Susceptibility { error_gain: 0.0, error_exponent: 1.0, detect_gain: 0.0, detect_exponent: 1.0 },
        }
    });
    Scenario::new(&Draft {
        softening: 0.05,
        reference_point: ReferencePoint::Current,
        pooling: Pooling::None,
        intervals,
        start_time: 0.0,
        time: Timing { max: 300.0, target: 115.0, penalty: 1.0 },
        domain: Domain { min: Point::from([0.0, 0.0]), max: Point::from([10.0, 10.0]) },
        separation: None,
        agents: &[Agent {
            start: Point::from([0.8, 1.0]),
            goal: Point::from([8.5, 6.7]),
            start_velocity: None,
            speed_max: 0.1,
            accel_max: 0.02,
            weight: 1.0,
            jammer: None,
            dropout: None,
        }],
        sensors: all.get(..sensors).unwrap_or(&all),
        terms: &[Term {
            metric,
            sense: if metric.is_location_error() { Sense::Maximize } else { Sense::Minimize },
            reduce: Reduce::Integral,
            weight: 1.0,
            agents: AgentSet::ALL,
            window: Window::always(),
        }],
        regions: &[],
        limits: &[],
    })
}

/// The straight path.
///
/// # Errors
/// None for the sizes that are measured.
#[inline(never)]
pub fn straight(problem: &Problem) -> Result<Path, Error> {
    Trajectory::straight(&problem.view(), 110.0)
}

/// The objective of a path: its metric at every node but the first.
#[inline(never)]
pub fn evaluate(problem: &Problem, path: &Path, scratch: &mut Scratch) -> f32 {
    value(&problem.view(), path, Extreme::Exact, scratch)
}

/// Objective and gradient.
#[inline(never)]
pub fn differentiate(problem: &Problem, path: &Path, by: &mut Path, scratch: &mut Scratch) -> f32 {
    gradient(&problem.view(), path, Extreme::Exact, scratch, by)
}

/// One iteration of the descent from the straight line: a gradient, a projection, a line search. Returns the steps of the
/// projection.
///
/// # Errors
/// None for the sizes that are measured.
#[inline(never)]
pub fn descend(problem: &Problem, memory: &mut Memory) -> Result<usize, Error> {
    let once = Settings { iterations: 1, refinements: 0, line_search_steps: 1, ..Settings::frugal() };
    Ok(plan(&problem.view(), &once, Start::Straight, memory, &mut || false)?.projection_steps)
}

/// A flight before its first plan.
///
/// # Errors
/// None for the sizes that are measured.
#[inline(never)]
pub fn begin(problem: &Problem) -> Result<Flight, Error> {
    Flight::new(&problem.view())
}

/// A plan: the first everywhere, later ones near what is left of it. The next eighth of it is then flown.
///
/// # Errors
/// None for the sizes that are measured.
#[inline(never)]
pub fn replan(problem: &Problem, flight: &mut Flight, memory: &mut Memory) -> Result<f32, Error> {
    let step = flight.replan(&problem.view(), &Settings::frugal(), Search::Tail, memory, &mut || false)?;
    flight.fly(flight.tail().intervals() / 8);
    Ok(step.outcome.objective)
}

/// Metrics that are measured, with their names.
pub const METRICS: [(Metric, Detector, &str); 6] = [
    (Metric::Detection, Detector::Proxy, "detection, proxy"),
    (Metric::Detection, Detector::Energy, "detection, energy"),
    (Metric::FalseAlarm, Detector::Energy, "false alarm"),
    (Metric::Cep, Detector::Proxy, "CEP"),
    (Metric::Aee, Detector::Proxy, "AEE"),
    (Metric::Gdop, Detector::Proxy, "GDOP"),
];
