//! A flight past three sensors, planned by the core alone.

use quietpath_core::scenario::*;
use quietpath_core::solver::{Settings, Start, Workspace, plan};
use quietpath_core::{Draft, Metric, Point, Scenario};

fn main() -> Result<(), quietpath_core::Error> {
    let detection = Some(Detection::Proxy { scale: 0.3, epsilon: 0.3, path_loss: 2.0 });
    let jam = Susceptibility { error_gain: 0.0, error_exponent: 2.0, detect_gain: 0.0, detect_exponent: 2.0 };
    let at = |east, north| Sensor { motion: Motion::Fixed(Point::new(east, north)), ranging: None, detection, jam };
    let agent = Agent {
        start: Point::new(1.0, 1.0),
        goal: Point::new(9.0, 7.0),
        start_velocity: None,
        speed_max: 0.1,
        accel_max: 0.02,
        weight: 1.0,
        jammer: None,
        dropout: None,
    };
    let draft = Draft {
        softening: 0.05,
        reference_point: ReferencePoint::Current,
        pooling: Pooling::None,
        intervals: 40,
        start_time: 0.0,
        time: Timing { max: 150.0, target: 110.0, penalty: 1.0 },
        domain: Domain { min: Point::zeros(), max: Point::new(10.0, 10.0) },
        agents: &[agent],
        sensors: &[at(3.0, 2.0), at(5.0, 5.5), at(8.0, 4.0)],
        terms: &[Term {
            metric: Metric::Detection,
            sense: Sense::Minimize,
            reduce: Reduce::Integral,
            weight: 1.0,
            agents: AgentSet::ALL,
            window: Window::always(),
        }],
        separation: None,
        regions: &[],
        limits: &[],
    };
    // Sizes: 2 dimensions, 8 sensors, 1 agent, 4 entries of tracks; 41 nodes. All memory is the caller's.
    let scenario: Scenario<f64, 2, 8, 1, 4> = Scenario::new(&draft)?;
    let mut workspace: Box<Workspace<f64, 2, 41, 8, 1>> = Box::new(Workspace::new());
    let outcome = plan(&scenario.view(), &Settings::default(), Start::Global, &mut workspace, &mut || false)?;
    println!("{}, objective {:.3}", outcome.status.name(), outcome.objective);
    for (node, position) in workspace.best().active()[0].path.iter().take(41).enumerate().step_by(8) {
        println!("node {node:2}: {:.2} east, {:.2} north", position.x, position.y);
    }
    Ok(())
}
