//! The planner behind the C functions, in safe Rust.

use quietpath_core::horizon::{Horizon, Search, State};
use quietpath_core::scenario::{
    Agent, AgentSet, Detection, Domain, Draft, Metric, Motion, Pooling, Ranging, Reduce, ReferencePoint, Scenario,
    Sense, Sensor, Sighting, Susceptibility, Term, Timing, Window,
};
use quietpath_core::solver::{Settings, Workspace};
use quietpath_core::{Error, Point};

use crate::{
    QUIETPATH_INTERVALS_MAX, QUIETPATH_SENSORS_MAX, QuietpathAgent, QuietpathNode, QuietpathObjective,
    QuietpathResult, QuietpathSensor,
};

/// Nodes that a plan can have.
const NODES: usize = QUIETPATH_INTERVALS_MAX + 1;

/// A checked problem.
type Problem = Scenario<f32, 2, QUIETPATH_SENSORS_MAX, 1, 1>;
/// The flight, as planned and as flown.
type Flight = Horizon<f32, 2, NODES, 1>;

/// A flight, once there is one. The tag is a number of its own, so that nothing is all zeros.
#[repr(u8)]
#[expect(clippy::large_enum_variant, reason = "memory is set aside for a flight in any case")]
enum Flown {
    Nothing,
    Flight(Flight),
}

impl Flown {
    const fn get(&self) -> Option<&Flight> {
        if let Self::Flight(flight) = self { Some(flight) } else { None }
    }

    const fn get_mut(&mut self) -> Option<&mut Flight> {
        if let Self::Flight(flight) = self { Some(flight) } else { None }
    }
}

/// A planner, with all of its memory.
pub(crate) struct Planner {
    workspace: Workspace<f32, 2, NODES, QUIETPATH_SENSORS_MAX, 1>,
    agent: Option<QuietpathAgent>,
    sensors: [Option<QuietpathSensor>; QUIETPATH_SENSORS_MAX],
    flight: Flown,
    objective: f32,
}

impl Planner {
    pub(crate) const fn new() -> Self {
        Self {
            workspace: Workspace::new(),
            agent: None,
            sensors: [None; QUIETPATH_SENSORS_MAX],
            flight: Flown::Nothing,
            // All zeros, so that memory is cleared and not copied.
            objective: 0.0,
        }
    }

    pub(crate) fn set_agent(&mut self, agent: &QuietpathAgent) -> QuietpathResult {
        self.flight = Flown::Nothing;
        let is_known = wanted(agent.objective).is_some();
        if !is_known || agent.intervals < 2 || agent.intervals as usize > QUIETPATH_INTERVALS_MAX {
            return QuietpathResult::Invalid;
        }
        self.agent = Some(*agent);
        QuietpathResult::Ok
    }

    pub(crate) fn set_sensors(&mut self, sensors: &[QuietpathSensor]) -> QuietpathResult {
        self.sensors = [None; QUIETPATH_SENSORS_MAX];
        for (slot, sensor) in self.sensors.iter_mut().zip(sensors) {
            *slot = Some(*sensor);
        }
        QuietpathResult::Ok
    }

    pub(crate) fn plan(&mut self) -> QuietpathResult {
        let Some(agent) = &self.agent else { return QuietpathResult::Order };
        let made = match problem(agent, &self.sensors) {
            Ok(problem) => Flight::new(&problem.view()),
            Err(error) => Err(error),
        };
        match made {
            Ok(flight) => self.flight = Flown::Flight(flight),
            Err(_) => return QuietpathResult::Invalid,
        }
        self.step()
    }

    pub(crate) fn replan(&mut self, time: f32, position: [f32; 2], velocity: [f32; 2]) -> QuietpathResult {
        let Some(flight) = self.flight.get_mut() else { return QuietpathResult::Order };
        let state = State { position: Point::from(position), velocity: Point::from(velocity) };
        if flight.resume(time, &[state]).is_err() {
            return QuietpathResult::Invalid;
        }
        self.step()
    }

    /// Plans what is left of the flight.
    fn step(&mut self) -> QuietpathResult {
        let (Some(agent), Some(flight)) = (&self.agent, self.flight.get_mut()) else { return QuietpathResult::Order };
        let settings = Settings::frugal();
        let step = match &problem(agent, &self.sensors) {
            Ok(problem) => {
                flight.replan(&problem.view(), &settings, Search::Tail, &mut self.workspace, &mut || false)
            }
            Err(error) => Err(*error),
        };
        let Ok(step) = step else { return QuietpathResult::Invalid };
        self.objective = step.outcome.objective;
        if step.feasible { QuietpathResult::Ok } else { QuietpathResult::Infeasible }
    }

    pub(crate) fn nodes(&self) -> impl Iterator<Item = QuietpathNode> {
        self.flight.get().into_iter().flat_map(|flight| {
            let tail = flight.tail();
            let path = tail.active().iter().flat_map(|track| track.path.iter());
            let nodes = path.zip(&tail.times).take(tail.nodes());
            nodes.map(|(place, &time)| QuietpathNode { time, position: (*place).into() })
        })
    }

    pub(crate) fn objective(&self) -> f32 {
        if self.flight.get().is_some() { self.objective } else { f32::NAN }
    }
}

/// Metric and sense of a number that C has for an objective.
fn wanted(objective: u32) -> Option<(Metric, Sense)> {
    [
        (QuietpathObjective::Detection, (Metric::Detection, Sense::Minimize)),
        (QuietpathObjective::Location, (Metric::LogAee, Sense::Maximize)),
    ]
    .into_iter()
    .find_map(|(known, wanted)| (known as u32 == objective).then_some(wanted))
}

/// The core's problem out of C's.
fn problem(flies: &QuietpathAgent, seen: &[Option<QuietpathSensor>]) -> Result<Problem, Error> {
    let nobody = Sensor {
        motion: Motion::Fixed(Point::from([0.0, 0.0])),
        ranging: None,
        detection: None,
        jam: Susceptibility { error_gain: 0.0, error_exponent: 1.0, detect_gain: 0.0, detect_exponent: 1.0 },
    };
    let mut sensors = [nobody; QUIETPATH_SENSORS_MAX];
    let mut count = 0;
    for (sensor, seen) in sensors.iter_mut().zip(seen.iter().flatten()) {
        let path_loss = seen.path_loss;
        sensor.motion = Motion::Steady(Sighting {
            time: seen.time,
            position: Point::from(seen.position),
            velocity: Point::from(seen.velocity),
        });
        sensor.detection = (seen.detect_scale != 0.0).then_some(Detection::Proxy {
            scale: seen.detect_scale,
            epsilon: seen.detect_epsilon,
            path_loss,
        });
        sensor.ranging =
            (seen.range_c1 != 0.0).then_some(Ranging::Toa { c1: seen.range_c1, c2: seen.range_c2, path_loss });
        count += 1;
    }
    let (metric, sense) = wanted(flies.objective).unwrap_or((Metric::Detection, Sense::Minimize));
    Scenario::new(&Draft {
        softening: flies.softening,
        reference_point: ReferencePoint::Current,
        pooling: Pooling::None,
        intervals: flies.intervals as usize,
        start_time: flies.start_time,
        time: Timing { max: flies.time_max, target: flies.time_target, penalty: flies.time_penalty },
        domain: Domain { min: Point::from(flies.domain_min), max: Point::from(flies.domain_max) },
        separation: None,
        agents: &[Agent {
            start: Point::from(flies.start),
            goal: Point::from(flies.goal),
            start_velocity: None,
            speed_max: flies.speed_max,
            accel_max: flies.accel_max,
            weight: 1.0,
            jammer: None,
            dropout: None,
        }],
        sensors: sensors.get(..count).unwrap_or_default(),
        terms: &[Term {
            metric,
            sense,
            reduce: Reduce::Integral,
            weight: 1.0,
            agents: AgentSet::ALL,
            window: Window::always(),
        }],
        regions: &[],
        limits: &[],
    })
}
