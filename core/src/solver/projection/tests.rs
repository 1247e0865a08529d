//! The projection against the definition of the nearest point.

use super::*;
use crate::scenario::{
    Agent, AgentSet, Detection, Draft, Metric, Motion, Pooling, Reduce, ReferencePoint, Scenario, Sense, Sensor,
    Susceptibility, Term, Timing, Window,
};
use crate::solver::feasible::largest_share;

type Small = Scenario<f64, 2, 1, 2, 0>;
type Path = Iterate<f64, 2, 32, 2>;

fn scenario(accel_max: f64, domain_height: f64, start_velocity: Option<Point<f64, 2>>) -> Small {
    let agent = Agent {
        start: Point::<f64, 2>::new(1.0, 2.0),
        goal: Point::<f64, 2>::new(9.0, 3.0),
        start_velocity,
        speed_max: 0.5,
        accel_max,
        weight: 1.0,
        jammer: None,
        dropout: None,
    };
    let other = Agent { start: Point::<f64, 2>::new(2.0, 4.0), goal: Point::<f64, 2>::new(5.0, 1.0), ..agent };
    let sensor = Sensor {
        motion: Motion::Fixed(Point::<f64, 2>::new(4.0, 3.0)),
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
    let draft = Draft {
        softening: 0.05,
        reference_point: ReferencePoint::Current,
        pooling: Pooling::None,
        intervals: 20,
        start_time: 0.0,
        time: Timing { max: 60.0, target: 20.0, penalty: 1.0 },
        domain: Domain { min: Point::<f64, 2>::zeros(), max: Point::<f64, 2>::new(10.0, domain_height) },
        agents: &[agent, other],
        sensors: &[sensor],
        terms: &[term],
        separation: None,
        regions: &[],
        limits: &[],
    };
    Scenario::new(&draft).expect("a valid scenario")
}

/// A small deterministic source of numbers in [-1, 1].
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 11) as f64) / ((1_u64 << 52) as f64) - 1.0
    }

    fn fill(&mut self, iterate: &mut Path, frame: &Frame<f64, 2, 2>, size: f64) {
        for offsets in iterate.interior_mut(frame) {
            for offset in offsets {
                *offset = Point::<f64, 2>::new(self.next(), self.next()) * size;
            }
        }
    }
}

/// The metric's inner product of `a - b` with `c - d`.
fn product(frame: &Frame<f64, 2, 2>, a: &Path, b: &Path, c: &Path, d: &Path) -> f64 {
    let mut sum = frame.inertia * (a.pace - b.pace) * (c.pace - d.pace);
    for agent in 0..2 {
        for node in 1..=frame.intervals {
            let step = |x: &Path| x.offset[agent][node] - x.offset[agent][node - 1];
            sum += (step(a) - step(b)).dot(&(step(c) - step(d)));
        }
    }
    sum
}

/// The projection is the point from which every feasible point lies at an obtuse angle to the target.
#[test]
fn is_the_nearest_feasible_point() {
    let velocity = Point::<f64, 2>::new(0.1, -0.2);
    for (name, accel_max, height, start_velocity, start_interval) in [
        ("speed", 1e3, 50.0, None, None),
        ("acceleration", 0.02, 50.0, None, None),
        ("box", 1e3, 4.2, None, None),
        ("all", 0.03, 4.2, Some(velocity), None),
        ("seam", 0.03, 50.0, Some(velocity), Some(3.0)),
    ] {
        let scenario = scenario(accel_max, height, start_velocity);
        let mut view = scenario.view();
        view.frame.start_interval = start_interval;
        let frame = Frame::<f64, 2, 2>::new(&view, 22.0);
        let mut numbers = Numbers(7);
        let mut projection = Projection::<f64, 2, 32, 2>::empty();
        projection.prepare(&frame);
        let request = Request {
            frame: &frame,
            domain: &view.frame.domain,
            step: 1.0,
            margin: 0.0,
            tolerance: 1e-9,
            steps_max: 4_000,
        };
        let (mut iterate, mut gradient, mut result) = (Path::zeros(), Path::zeros(), Path::zeros());
        iterate.pace = 1.0;
        numbers.fill(&mut gradient, &frame, 0.4);
        gradient.pace = 3.0 * frame.inertia * numbers.next();
        projection.project(&request, &iterate, &gradient, &mut result);
        // The unprojected target: the iterate less the gradient's representative.
        let mut target = Path::zeros();
        frame.steepest(&gradient, &mut target);
        let down = target.clone();
        target.between(&iterate, &down, 0.0, &frame);
        for (t, d) in target.interior_mut(&frame).zip(down.interior(&frame)) {
            for (t, d) in t.iter_mut().zip(d) {
                *t -= d;
            }
        }
        target.pace = iterate.pace - down.pace;
        // Another projection, of another gradient, is a feasible point that touches the bounds.
        for _ in 0..8 {
            let (mut other, mut feasible) = (Path::zeros(), Path::zeros());
            numbers.fill(&mut other, &frame, 0.4);
            other.pace = frame.inertia * numbers.next();
            let mut another = Projection::<f64, 2, 32, 2>::empty();
            another.prepare(&frame);
            another.project(&request, &iterate, &other, &mut feasible);
            let angle = product(&frame, &target, &result, &feasible, &result);
            let size = product(&frame, &target, &result, &target, &result);
            assert!(angle <= 1e-5 * (1.0 + size), "{name}: {angle} at distance^2 {size}");
            assert!(size > 1e-2, "{name}: nothing was projected");
        }
    }
}

#[test]
fn warm_multipliers_save_steps_and_the_share_is_whole() {
    let scenario = scenario(0.03, 50.0, None);
    let view = scenario.view();
    let frame = Frame::<f64, 2, 2>::new(&view, 22.0);
    let mut projection = Projection::<f64, 2, 32, 2>::empty();
    projection.prepare(&frame);
    let request = Request {
        frame: &frame,
        domain: &view.frame.domain,
        step: 1.0,
        margin: 1e-4,
        tolerance: 5e-6,
        steps_max: 5_000,
    };
    let (mut iterate, mut gradient, mut result) = (Path::zeros(), Path::zeros(), Path::zeros());
    iterate.pace = 1.0;
    Numbers(3).fill(&mut gradient, &frame, 0.3);
    let cold = projection.project(&request, &iterate, &gradient, &mut result);
    gradient.interior_mut(&frame).flatten().for_each(|slope| *slope *= 1.01);
    let warm = projection.project(&request, &iterate, &gradient, &mut result);
    assert!(warm * 3 < cold * 2, "{warm} steps warm, {cold} cold");
    let share = largest_share(&frame, &view.frame.domain, &iterate, &result, iterate.pace);
    assert_eq!(share, 1.0);
}
