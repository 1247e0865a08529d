//! Eight sensors around the way, and an agent that would not be seen: the square of the published scenarios, on a
//! coarser grid, with the sensor in the middle on its way north-west.

use quietpath_core::scenario::{
    Agent, AgentSet, Detection, Domain, Draft, Metric, Motion, Pooling, Ranging, Reduce, ReferencePoint, Scenario,
    Sense, Sensor, Sighting, Susceptibility, Term, Timing, Window,
};
use quietpath_core::{Error, Point};

use super::{INTERVALS, Problem, SENSORS};

/// Where the sensors are at first, length units.
const PLACES: [[f32; 2]; SENSORS] =
    [[2.0, 2.0], [5.0, 1.5], [8.0, 2.5], [1.5, 5.5], [4.8, 5.0], [8.2, 5.2], [3.0, 8.3], [7.0, 8.4]];
/// The one that moves, and its velocity, length units per s.
const MOVER: usize = 4;
const VELOCITY: [f32; 2] = [-0.02, 0.015];

/// The problem as it is seen at `time` (s).
///
/// # Errors
/// None: it is sound.
#[inline(never)]
pub fn problem(time: f32) -> Result<Problem, Error> {
    let still = |place: [f32; 2]| Sensor {
        motion: Motion::Fixed(Point::from(place)),
        ranging: Some(Ranging::Toa { c1: 0.01, c2: 0.1, path_loss: 2.0 }),
        detection: Some(Detection::Proxy { scale: 0.3, epsilon: 0.3, path_loss: 2.0 }),
        jam: Susceptibility { error_gain: 20.0, error_exponent: 1.0, detect_gain: 1.0, detect_exponent: 1.0 },
    };
    let mut sensors = PLACES.map(still);
    let velocity = Point::from(VELOCITY);
    for (sensor, place) in sensors.iter_mut().zip(PLACES).skip(MOVER).take(1) {
        sensor.motion = Motion::Steady(Sighting { time, position: Point::from(place) + velocity * time, velocity });
    }
    Scenario::new(&Draft {
        softening: 0.05,
        reference_point: ReferencePoint::Current,
        pooling: Pooling::None,
        intervals: INTERVALS,
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
        sensors: &sensors,
        terms: &[Term {
            metric: Metric::Detection,
            sense: Sense::Minimize,
            reduce: Reduce::Integral,
            weight: 1.0,
            agents: AgentSet::ALL,
            window: Window::always(),
        }],
        regions: &[],
        limits: &[],
    })
}
