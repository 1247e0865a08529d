//! Nothing depends on where the origin is, which way is east, or how long a unit of length is.

mod made_up;

use made_up::{Made, Plan, scenarios};
use quietpath_core::metrics::Sample;
use quietpath_core::objective::{Extreme, gradient, node_values};
use quietpath_core::scenario::{Detection, Ranging};
use quietpath_core::{Metric, Point, Trajectory};

/// A turn about the vertical, a shift, and a change of unit.
#[derive(Clone, Copy)]
struct Change {
    angle: f64,
    shift: [f64; 3],
    unit: f64,
}

impl Change {
    fn turned<const DIM: usize>(&self, vector: &Point<f64, DIM>) -> Point<f64, DIM> {
        let (sin, cos) = self.angle.sin_cos();
        let mut turned = *vector;
        turned[0] = cos * vector[0] - sin * vector[1];
        turned[1] = sin * vector[0] + cos * vector[1];
        turned
    }

    fn point<const DIM: usize>(&self, point: &Point<f64, DIM>) -> Point<f64, DIM> {
        (self.turned(point) + Point::from_fn(|axis, _| self.shift[axis])) * self.unit
    }

    fn plan<const DIM: usize>(&self, plan: &Plan<f64, DIM>) -> Plan<f64, DIM> {
        let mut changed = plan.clone();
        for track in changed.active_mut() {
            for position in &mut track.path {
                *position = self.point(position);
            }
            for azimuth in &mut track.azimuth {
                *azimuth += self.angle;
            }
        }
        changed
    }

    fn scenario<const DIM: usize>(&self, made: &Made<DIM>) -> Made<DIM> {
        let mut changed = made.clone();
        let power = |exponent: f64| self.unit.powf(exponent);
        changed.softening *= self.unit;
        changed.domain.min = Point::repeat(-1e6);
        changed.domain.max = Point::repeat(1e6);
        changed.regions.clear();
        for agent in &mut changed.agents {
            agent.start = self.point(&agent.start);
            agent.goal = self.point(&agent.goal);
            agent.speed_max *= self.unit;
        }
        for sensor in &mut changed.sensors {
            sensor.position = sensor.position.map(|position| self.point(&position));
            for knot in &mut sensor.knots {
                knot.position = self.point(&knot.position);
            }
            match &mut sensor.ranging {
                Some(Ranging::Rss { scale, path_loss }) => *scale *= power(2.0 * *path_loss),
                Some(Ranging::Toa { c1, c2, path_loss }) => {
                    *c1 *= power(2.0 - *path_loss);
                    *c2 *= power(-*path_loss);
                }
                None => {}
            }
            match &mut sensor.detection {
                Some(Detection::Proxy { scale, epsilon, path_loss }) => {
                    *scale *= power(*path_loss);
                    *epsilon *= power(*path_loss);
                }
                Some(Detection::Energy { signal, path_loss, .. }) => *signal *= power(2.0 * *path_loss),
                None => {}
            }
            sensor.jam.error_gain *= power(sensor.jam.error_exponent);
            sensor.jam.detect_gain *= power(sensor.jam.detect_exponent);
        }
        changed
    }

    /// Power of the unit that a metric has; `None` for a logarithm, to which that many logarithms are added.
    fn factor(&self, metric: Metric, dimension: i32) -> f64 {
        let exponent = match metric {
            Metric::Detection | Metric::FalseAlarm => 0,
            Metric::Cep2 | Metric::LogCep2 => 2,
            Metric::Cep | Metric::LogCep => 1,
            Metric::Aee | Metric::LogAee => dimension,
            Metric::Gdop | Metric::LogGdop => -1,
        };
        self.unit.powi(exponent)
    }
}

/// Compares all metrics; returns how many.
fn compare<const DIM: usize>(made: &Made<DIM>, change: Change) -> usize {
    let (stored, changed) = (made.stored().expect("valid"), change.scenario(made).stored().expect("valid"));
    let mut scratch = [Sample::default(); 8];
    let mut compared = 0;
    for golden in &made.plans {
        let plan = change.plan(&golden.plan);
        for &(agent, node, _) in &golden.values {
            let before = node_values(&stored.view(), &golden.plan, agent, node, &mut scratch);
            let after = node_values(&changed.view(), &plan, agent, node, &mut scratch);
            // The floor of the information matrix has a unit: where it is felt, figures depend on theirs.
            let floored = before.location.is_some_and(|location| location.trace > 1e2);
            for metric in Metric::ALL {
                let (Some(before), Some(after)) = (before.get(metric), after.get(metric)) else { continue };
                if floored && change.unit != 1.0 && metric.is_location_error() {
                    continue;
                }
                let factor = change.factor(metric, DIM as i32);
                let (expected, scale) = if metric.name().starts_with("log_") {
                    (before + factor.ln(), 1.0)
                } else {
                    (before * factor, before * factor)
                };
                let at = format!("{} agent {agent} node {node} {}", made.name, metric.name());
                assert!((after - expected).abs() <= 1e-8 * scale + 1e-14, "{at}: {after} is not {expected}");
                compared += 1;
            }
        }
    }
    compared
}

fn compare_all(change: Change, least: usize) {
    let flat: usize = scenarios::<2>().iter().map(|made| compare(made, change)).sum();
    let high: usize = scenarios::<3>().iter().map(|made| compare(made, change)).sum();
    println!("{} figures compared", flat + high);
    assert!(flat + high >= least, "only {} figures compared", flat + high);
}

#[test]
fn metrics_do_not_depend_on_the_origin() {
    compare_all(Change { angle: 0.0, shift: [113.0, -57.0, 31.0], unit: 1.0 }, 2000);
}

#[test]
fn metrics_do_not_depend_on_where_east_is() {
    compare_all(Change { angle: 0.7, shift: [0.0; 3], unit: 1.0 }, 2000);
}

#[test]
fn metrics_do_not_depend_on_the_unit_of_length() {
    compare_all(Change { angle: 0.0, shift: [0.0; 3], unit: 4.0 }, 1000);
}

/// Derivatives by positions turn with the scene, all others stay.
fn gradient_turns<const DIM: usize>(made: &Made<DIM>) {
    let change = Change { angle: 2.1, shift: [5.0, -3.0, 1.0], unit: 1.0 };
    let (stored, changed) = (made.stored().expect("valid"), change.scenario(made).stored().expect("valid"));
    let mut scratch = [Sample::default(); 8];
    for golden in &made.plans {
        let (mut before, mut after) = (Trajectory::empty(), Trajectory::empty());
        gradient(&stored.view(), &golden.plan, Extreme::Exact, &mut scratch, &mut before);
        let plan = change.plan(&golden.plan);
        gradient(&changed.view(), &plan, Extreme::Exact, &mut scratch, &mut after);
        let close = |a: f64, b: f64| (a - b).abs() <= 1e-6 * a.abs() + 1e-9;
        for (before, after) in before.active().iter().zip(after.active()) {
            for (before, after) in before.path.iter().zip(&after.path) {
                let difference = (change.turned(before) - after).amax();
                assert!(difference <= 1e-6 * after.amax() + 1e-9, "{}: {after} is not {before} turned", made.name);
            }
            let pairs = [(before.jam, after.jam), (before.azimuth, after.azimuth), (before.dropout, after.dropout)];
            for (before, after) in pairs.iter().flat_map(|(before, after)| before.iter().zip(after)) {
                assert!(close(*before, *after), "{}: {after} is not {before}", made.name);
            }
        }
        for (before, after) in before.times.iter().zip(&after.times) {
            assert!(close(*before, *after), "{}: {after} is not {before}", made.name);
        }
    }
}

#[test]
fn gradients_turn_with_the_scene() {
    scenarios::<2>().iter().for_each(gradient_turns);
    scenarios::<3>().iter().for_each(gradient_turns);
}
