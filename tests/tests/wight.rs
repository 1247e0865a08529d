//! What section 4.5 of the paper says of the flight past two forbidden circles, planned in one piece, every track known.

use quietpath_bridge::file::ScenarioFile;
use quietpath_bridge::planning::{Options, Planned, Rollout, plan};
use quietpath_core::Metric;
use quietpath_tests::scenario;

fn flown(name: &str) -> (ScenarioFile, Planned) {
    let scenario = scenario(name);
    let options = Options { rollout: Rollout::Once, ..Options::default() };
    let planned = plan(&scenario, &options).unwrap_or_else(|error| panic!("{error}"));
    assert!(planned.assessment.feasible, "{name}: {:?}", planned.assessment.worst);
    (scenario, planned)
}

fn mean_log_aee(planned: &Planned) -> f64 {
    let values = &planned.assessment.agents[0].metric(Metric::LogAee).expect("the sensors range")[1..];
    values.iter().sum::<f64>() / values.len() as f64
}

/// Where a path crosses a line of constant x, its y there.
fn crossing(path: &[Vec<f64>], x: f64) -> f64 {
    let leg = path.windows(2).find(|leg| (leg[0][0] <= x) != (leg[1][0] <= x)).expect("the path goes past");
    let share = (x - leg[0][0]) / (leg[1][0] - leg[0][0]);
    leg[0][1] + share * (leg[1][1] - leg[0][1])
}

#[test]
fn the_path_goes_between_the_circles_and_arches_south() {
    let (_, planned) = flown("wight");
    let path = &planned.plan.agents[0].path;
    // The circles are centred at x = 8 and x = 7: north of 6.7 and south of 4.4 is forbidden there.
    let (north, south) = (crossing(path, 8.0), crossing(path, 7.0));
    let lowest = path.iter().map(|at| at[1]).fold(f64::INFINITY, f64::min);
    println!("y = {north:.2} below the northern circle, {south:.2} above the southern, {lowest:.2} at the lowest");
    assert!(north < 6.7 && south > 4.4, "between the circles: {north}, {south}");
    // Start and goal lie at y = 5.8 and 5.0.
    assert!(lowest < 3.5, "arches south: {lowest}");
}

#[test]
fn with_jamming_the_location_error_ends_larger() {
    let (scenario, jammed) = flown("wight-jam");
    let (_, plain) = flown("wight");
    let (with, without) = (mean_log_aee(&jammed), mean_log_aee(&plain));
    println!("mean ln AEE {with:.3} with jamming, {without:.3} without");
    assert!(with > without + 0.1, "{with} with, {without} without");
    let budget = scenario.agents[0].jammer.expect("a jammer").budget;
    let levels = jammed.plan.agents[0].jam.as_ref().expect("levels");
    let interval = jammed.plan.duration / (levels.len() - 1) as f64;
    let spent = levels[1..].iter().sum::<f64>() * interval;
    assert!(spent <= budget * (1.0 + 1e-9), "spends {spent} of {budget}");
    assert!(spent >= budget * (1.0 - 1e-6), "leaves some of {budget}, spends {spent}");
}
