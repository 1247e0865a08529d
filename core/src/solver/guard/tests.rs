use std::vec;

use super::*;
use crate::objective::Extreme;
use crate::scenario::{
    Agent, AgentSet, Detection, Domain, Draft, Limit, Metric, Motion, Pooling, Reduce, ReferencePoint, Region,
    Scenario, Sense, Sensor, Shape, Side, Susceptibility, Term, Timing, Window,
};

type Flat = Point<f64, 2>;
type Path = Trajectory<f64, 2, 9, 3>;

/// Three agents side by side past a circle, within a box, held apart and to a limit.
fn scenario() -> Scenario<f64, 2, 1, 3, 0> {
    let agents = [1.0, 2.0, 3.0].map(|north| Agent {
        start: Flat::new(0.0, north),
        goal: Flat::new(8.0, north),
        start_velocity: None,
        speed_max: 10.0,
        accel_max: 100.0,
        weight: 1.0,
        jammer: None,
        dropout: None,
    });
    let sensor = Sensor {
        motion: Motion::Fixed(Flat::new(5.0, 5.0)),
        ranging: None,
        detection: Some(Detection::Proxy { scale: 1.0, epsilon: 1.0, path_loss: 2.0 }),
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
    let shape = Shape::Circle { center: Flat::new(4.0, 4.3), radius: 0.8 };
    let region = Region { shape, side: Side::Outside, window: Window::always() };
    Scenario::new(&Draft {
        softening: 1e-3,
        reference_point: ReferencePoint::Current,
        intervals: 8,
        start_time: 0.0,
        time: Timing { max: 10.0, target: 0.0, penalty: 0.0 },
        domain: Domain { min: Flat::new(-1.0, -1.0), max: Flat::new(9.0, 9.0) },
        separation: Some(0.6),
        agents: &agents,
        sensors: &[sensor],
        terms: &[term],
        pooling: Pooling::None,
        regions: &[region],
        limits: &[Limit { metric: Metric::Detection, min: None, max: Some(0.6) }],
    })
    .unwrap()
}

/// Straight lines with waves of the given size, which differ from agent to agent.
fn wavy(view: &View<'_, f64, 2>, size: f64) -> Path {
    let mut path = Path::straight(view, 8.0).unwrap();
    for (agent, track) in path.active_mut().iter_mut().enumerate() {
        for (node, place) in track.path.iter_mut().enumerate().take(8).skip(1) {
            let phase = (node * (agent + 1)) as f64;
            *place += Flat::new((0.7 * phase).sin(), (1.3 * phase).cos()) * size;
        }
    }
    path
}

/// Lines are laid in memory that was used before.
#[test]
fn a_straight_line_is_laid_over_what_was_there() {
    let stored = scenario();
    let view = stored.view();
    let mut used = wavy(&view, 0.4);
    for track in used.active_mut() {
        for controls in [&mut track.jam, &mut track.azimuth, &mut track.dropout] {
            controls.fill(0.5);
        }
    }
    used.lay_straight(&view, 9.0).unwrap();
    assert_eq!(used, Path::straight(&view, 9.0).unwrap());
}

#[test]
fn gradients_are_those_of_differences() {
    let stored = scenario();
    let view = stored.view();
    let mut scratch = vec![Sample::default(); 1];
    // A barrier is infinite where a constraint is broken, and a penalty nothing where none is: small waves and large.
    let barrier = Guard::Barrier { weight: 0.1 };
    let penalty = Guard::Penalty { weight: 1.0, margin: 1e-2 };
    for (guard, size, is_broken) in [(barrier, 0.05, false), (penalty, 0.5, true)] {
        let merit = Merit { extreme: Extreme::Exact, objective: 1.0, guard };
        let path = wavy(&view, size);
        assert_eq!(smallest_slack(&view, &path, &mut scratch) < 0.0, is_broken);
        let mut found = path.clone();
        let at = gradient(&view, &path, &merit, &mut scratch, &mut found);
        let value = |path: &Path, merit: &Merit<f64>, scratch: &mut [Sample<f64, 2>]| {
            let mut gradient = path.clone();
            super::gradient(&view, path, merit, scratch, &mut gradient)
        };
        let (objective, logs) = parts(&view, &path, &mut scratch);
        if let Guard::Barrier { weight } = guard {
            assert!((at - objective - weight * logs).abs() < 1e-12, "the parts of {at}");
        } else {
            assert_eq!(logs, f64::INFINITY, "outside");
        }
        let without = Merit { guard: Guard::None, ..merit };
        assert!((at - value(&path, &without, &mut scratch)).abs() > 1e-3, "the guard counts");
        for agent in 0..3 {
            for node in 1..8 {
                for axis in 0..2 {
                    let mut moved = |step: f64| {
                        let mut path = path.clone();
                        path.tracks[agent].path[node][axis] += step;
                        value(&path, &merit, &mut scratch)
                    };
                    let difference = (moved(1e-6) - moved(-1e-6)) / 2e-6;
                    let ours = found.tracks[agent].path[node][axis];
                    let error = (ours - difference).abs() / difference.abs().max(1.0);
                    assert!(error < 1e-6, "{guard:?} agent {agent} node {node}: {ours} for {difference}");
                }
            }
        }
    }
}
