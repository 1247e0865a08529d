//! A scenario from its text, a plan, what it is worth, and a mission file: the bridge as a library.

use std::error::Error;

use quietpath_bridge::file::ScenarioFile;
use quietpath_bridge::file::mission::missions;
use quietpath_bridge::planning::{self, Options};
use quietpath_core::Metric;

const SCENARIO: &str = include_str!("../../sim/scenarios/square8-detection.toml");

fn main() -> Result<(), Box<dyn Error>> {
    // Errors name file, line and field, and say what would be right.
    let loaded = ScenarioFile::parse("square8-detection.toml", SCENARIO)?;
    let scenario = loaded.scenario;

    let planned = planning::plan(&scenario, &Options::default())?;
    if let Some(obstacle) = &planned.obstacle {
        println!("no feasible plan: {}", obstacle.describe(&scenario));
    }

    // Every figure is recomputed from the plan as it is written, in double precision.
    for agent in &planned.assessment.agents {
        let detection = agent.metric(Metric::Detection).unwrap_or_default();
        let peak = detection.iter().copied().fold(0.0, f64::max);
        let metres = agent.length * scenario.frame.unit_m;
        println!("{}: {metres:.0} m in {:.1} s, peak detection {peak:.3}", agent.name, planned.plan.duration);
    }

    // One mission an agent, for QGroundControl and for programs that read QGC WPL 110.
    for mission in missions(&scenario, &planned.plan)? {
        let waypoints = mission.to_waypoints();
        let first: Vec<&str> = waypoints.lines().take(3).collect();
        println!(
            "{}: {} lines of waypoints, the first:\n{}",
            mission.agent,
            waypoints.lines().count(),
            first.join("\n")
        );
    }
    Ok(())
}
