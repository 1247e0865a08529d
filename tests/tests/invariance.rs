//! Whole plans move with the scenario: translated, rotated, and in another unit of length.
//!
//! The planner sees no coordinate but relative to start, goal and sensors, and measures lengths in its own scale, so that a
//! plan of a moved scenario is the moved plan. Domains are boxes along the axes: those of the scenarios here are widened
//! until they do not matter. Detection does not change with the unit once the sensors' scales are converted.

use quietpath_bridge::file::ScenarioFile;
use quietpath_bridge::file::scenario::{MotionEntry, Outline};
use quietpath_bridge::planning::{Options, Planned, plan};
use quietpath_core::scenario::{Detection, Ranging};
use quietpath_tests::scenario;

/// A motion of the plane, and a change of the unit.
#[derive(Clone, Copy)]
struct Motion {
    turn: f64,
    shift: [f64; 2],
    /// New units in an old one.
    scale: f64,
}

impl Motion {
    fn turned(&self, v: &[f64]) -> Vec<f64> {
        let (sin, cos) = self.turn.sin_cos();
        vec![self.scale * (cos * v[0] - sin * v[1]), self.scale * (sin * v[0] + cos * v[1])]
    }

    fn moved(&self, p: &[f64]) -> Vec<f64> {
        let turned = self.turned(p);
        vec![turned[0] + self.shift[0], turned[1] + self.shift[1]]
    }

    fn scenario(&self, original: &ScenarioFile) -> ScenarioFile {
        let mut moved = original.clone();
        let length = self.scale;
        moved.softening *= length;
        moved.domain.min = vec![self.shift[0] - 1e3 * length, self.shift[1] - 1e3 * length];
        moved.domain.max = vec![self.shift[0] + 1e3 * length, self.shift[1] + 1e3 * length];
        for agent in &mut moved.agents {
            agent.start = self.moved(&agent.start);
            agent.goal = self.moved(&agent.goal);
            agent.speed_max *= length;
            agent.accel_max *= length;
        }
        for region in &mut moved.regions {
            let place = |at: &[f64; 2]| -> [f64; 2] { self.moved(at).try_into().expect("two coordinates") };
            match &mut region.outline {
                Outline::Circle { center, radius } => (*center, *radius) = (place(center), *radius * length),
                Outline::Polygon(corners) => corners.iter_mut().for_each(|corner| *corner = place(corner)),
            }
        }
        for sensor in &mut moved.sensors {
            match &mut sensor.motion {
                MotionEntry::Fixed(position) => *position = self.moved(position),
                MotionEntry::Track(track) => {
                    track.iter_mut().for_each(|knot| knot.position = self.moved(&knot.position))
                }
            }
            // Variances are squares of lengths; detection is a number without a unit.
            sensor.ranging = sensor.ranging.map(|ranging| match ranging {
                Ranging::Toa { c1, c2, path_loss } => Ranging::Toa {
                    c1: c1 * length.powf(2.0 - path_loss),
                    c2: c2 * length.powf(-path_loss),
                    path_loss,
                },
                Ranging::Rss { scale, path_loss } => {
                    Ranging::Rss { scale: scale * length.powf(2.0 * path_loss), path_loss }
                }
            });
            sensor.detection = sensor.detection.map(|detection| match detection {
                Detection::Proxy { scale, epsilon, path_loss } => {
                    let factor = length.powf(path_loss);
                    Detection::Proxy { scale: scale * factor, epsilon: epsilon * factor, path_loss }
                }
                Detection::Energy { samples, signal, noise, log_threshold, path_loss } => {
                    let signal = signal * length.powf(2.0 * path_loss);
                    Detection::Energy { samples, signal, noise, log_threshold, path_loss }
                }
            });
            sensor.jam.error_gain *= length.powf(sensor.jam.error_exponent);
            sensor.jam.detect_gain *= length.powf(sensor.jam.detect_exponent);
        }
        moved
    }
}

const STAY: Motion = Motion { turn: 0.0, shift: [0.0, 0.0], scale: 1.0 };
const MOTIONS: [(&str, Motion); 4] = [
    ("translated", Motion { shift: [-37.0, 211.0], ..STAY }),
    ("rotated", Motion { turn: 1.0, ..STAY }),
    ("in another unit", Motion { scale: 100.0, ..STAY }),
    ("all three", Motion { turn: -2.5, shift: [512.0, -90.0], scale: 0.03 }),
];

/// How far a moved plan may be from the plan moved.
#[derive(Clone, Copy)]
struct Tolerance {
    /// Largest difference of objectives, relative to max(1, |objective|).
    objective: f64,
    /// Largest distance of a node from where the motion takes it, as a part of the path's length.
    path: f64,
}

/// The same plan, but for rounding.
const SAME: Tolerance = Tolerance { objective: 1e-6, path: 1e-3 };

fn planned(scenario: &ScenarioFile) -> Planned {
    let planned = plan(scenario, &Options::default()).unwrap_or_else(|error| panic!("{error}"));
    assert!(planned.assessment.feasible, "{:?}", planned.assessment.worst);
    planned
}

/// Plans scenarios as they are and moved; returns what does not agree.
fn disagreements(names: &[&str], motions: &[(&str, Motion)], tolerance: Tolerance) -> Vec<String> {
    let mut wrong = Vec::new();
    for name in names {
        let original = STAY.scenario(&scenario(name));
        let here = planned(&original);
        for (what, motion) in motions {
            let there = planned(&motion.scenario(&original));
            let (objective, length) = (here.assessment.objective, here.assessment.agents[0].length * motion.scale);
            let error = (there.assessment.objective - objective) / objective.abs().max(1.0);
            let mut off = 0.0_f64;
            for (a, b) in here.plan.agents.iter().zip(&there.plan.agents) {
                for (p, q) in a.path.iter().zip(&b.path) {
                    let image = motion.moved(p);
                    off = off.max((image[0] - q[0]).hypot(image[1] - q[1]) / length);
                }
            }
            let status = [here.status.name(), there.status.name()].join(", ");
            println!("{name:20} {what:16} objective {error:+9.1e}  path {off:9.1e}  {status}");
            if error.abs() > tolerance.objective || off > tolerance.path {
                wrong.push(format!("{name} {what}: objective {error:e}, path {off:e}"));
            }
        }
    }
    wrong
}

#[test]
fn plans_move_with_the_scenario() {
    let names = ["square8-detection", "square8-deadline-115", "square8-energy", "dropout4-35"];
    let wrong = disagreements(&names, &MOTIONS, SAME);
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// In another unit, ln(AEE) gains a constant for every second of the flight, and another flight time is the best.
#[test]
fn plans_for_location_errors_move_with_the_scenario() {
    let names = ["square8-aee", "square8-jam", "square8-jam-risk", "square8-team"];
    let wrong = disagreements(&names, &MOTIONS[..2], SAME);
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// The flown path of all steps, past regions and a sensor that moves.
#[test]
fn flights_in_steps_move_with_the_scenario() {
    let wrong = disagreements(&["wight", "wight-jam"], &MOTIONS[..2], SAME);
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Where the optimum is flat, rounding decides where on it the planner stops: the smallest worst case is held at a few nodes,
/// and the path between them is nearly free; which nodes are silent is one choice of many that are nearly as good.
#[test]
fn plans_of_flat_optima_are_as_good_wherever_they_are() {
    let wrong = disagreements(&["square8-worst-detection"], &MOTIONS, Tolerance { objective: 1e-4, path: 0.01 });
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    let wrong = disagreements(&["dropout4-17"], &MOTIONS, Tolerance { objective: 5e-3, path: 0.03 });
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
