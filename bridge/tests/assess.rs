//! The series of an assessment and the cells of a landscape; that their figures are right is for `tests/tests/golden.rs`.

use quietpath_bridge::file::{PlanFile, ScenarioFile};
use quietpath_bridge::planning::{View, assess, landscape};
use quietpath_core::Metric;

/// Largest difference of an objective from the sum of its series, relative to max(1, |figure|).
const TOLERANCE: f64 = 1e-9;

fn scenario(name: &str) -> ScenarioFile {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../sim/scenarios");
    ScenarioFile::read(&format!("{folder}/{name}.toml")).expect("scenario").scenario
}

fn close(a: f64, b: f64) -> bool {
    (a - b).abs() <= TOLERANCE * b.abs().max(1.0)
}

#[test]
fn series_hold_one_value_a_node_and_agree_with_the_bounds() {
    let scenario = scenario("square8-detection");
    let agent = &scenario.agents[0];
    let line = |s: f64| -> Vec<f64> { agent.start.iter().zip(&agent.goal).map(|(a, b)| a + (b - a) * s).collect() };
    let path: Vec<Vec<f64>> = (0..=20).map(|node| line(f64::from(node) / 20.0)).collect();
    let plan = PlanFile {
        duration: 100.0,
        agents: vec![quietpath_bridge::file::plan::AgentPlan { name: "uav1".into(), path, ..Default::default() }],
        ..PlanFile::default()
    };
    let found = assess(&scenario, &plan, "line.json").expect("assessment");
    assert!(found.feasible, "{:?}", found.worst);
    let series = &found.agents[0];
    assert_eq!(series.metrics.len(), Metric::ALL.len());
    let detection = series.metric(Metric::Detection).expect("detection");
    assert_eq!((detection.len(), series.speed.len(), series.accel.len()), (21, 20, 19));
    assert_eq!((found.sensors.len(), found.sensors[0].len()), (8, 21));
    assert!((series.length - 9.580_187_889_597_989).abs() < 1e-12, "{}", series.length);
    assert!(series.speed.iter().all(|speed| (speed - 0.0958).abs() < 1e-4));
    // The objective is the right Riemann sum of the series, and the flight is in time.
    let integral: f64 = detection[1..].iter().map(|value| 5.0 * value).sum();
    assert!(close(found.objective, integral), "{} {integral}", found.objective);
}

#[test]
fn a_landscape_peaks_at_the_sensors() {
    let view = View { metric: Metric::Detection, time: 0.0, columns: 50, rows: 40, height: None };
    let grid = landscape(&scenario("square8-detection"), &view).expect("grid");
    assert_eq!((grid.east.len(), grid.north.len(), grid.values.len()), (50, 40, 2000));
    assert!((grid.east[0] - 0.1).abs() < 1e-12 && (grid.north[39] - 9.875).abs() < 1e-12);
    let peak = (0..grid.values.len()).max_by(|a, b| grid.values[*a].total_cmp(&grid.values[*b])).expect("values");
    let (x, y) = (grid.east[peak % 50], grid.north[peak / 50]);
    let sensors = [[2.0, 2.0], [5.0, 1.5], [8.0, 2.5], [1.5, 5.5], [4.8, 5.0], [8.2, 5.2], [3.0, 8.3], [7.0, 8.4]];
    assert!(sensors.iter().any(|sensor| (sensor[0] - x).hypot(sensor[1] - y) < 0.2), "{x} {y}");
    let volume = landscape(&scenario("volume8-detection"), &view).expect("grid");
    assert_eq!(volume.height, Some(0.3));
    let mut few = scenario("square8-detection");
    few.sensors.truncate(2);
    let error = landscape(&few, &View { metric: Metric::Aee, ..view }).expect_err("too few").to_string();
    assert!(error.contains("has 2 sensors with `ranging`, and `aee` needs at least 3"), "{error}");
}
