//! A flight past three sensors, planned by the core alone: all memory is the caller's, and every size is a number.

use quietpath_core::scenario::{Agent, Detection, Domain, Sense, Sensor, Term};
use quietpath_core::solver::{Settings, Start, Workspace, plan};
use quietpath_core::{Draft, Error, Metric, Point, Scenario};

fn main() -> Result<(), Error> {
    let detection = Detection::Proxy { scale: 0.3, epsilon: 0.3, path_loss: 2.0 };
    let sensors = [[3.0, 2.0], [5.0, 5.5], [8.0, 4.0]].map(|place| Sensor::detecting(place.into(), detection));
    let agents = [Agent::plain([1.0, 1.0].into(), [9.0, 7.0].into(), 0.1, 0.02)];
    let terms = [Term::integral(Metric::Detection, Sense::Minimize)];
    let domain = Domain { min: Point::zeros(), max: [10.0, 10.0].into() };
    let draft = Draft::plain(40, 150.0, domain, &agents, &sensors, &terms);
    // 2 dimensions, at most 8 sensors, 1 agent, 4 entries of tracks; 41 nodes are 40 intervals.
    let scenario: Scenario<f64, 2, 8, 1, 4> = Scenario::new(&draft)?;
    let mut workspace: Box<Workspace<f64, 2, 41, 8, 1>> = Box::new(Workspace::new());
    let outcome = plan(&scenario.view(), &Settings::default(), Start::Global, &mut workspace, &mut || false)?;
    println!("{}, objective {:.3}", outcome.status.name(), outcome.objective);
    for (node, position) in workspace.best().active()[0].path.iter().take(41).enumerate().step_by(8) {
        println!("node {node:2}: {:.2} east, {:.2} north", position.x, position.y);
    }
    Ok(())
}
