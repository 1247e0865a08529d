//! Agents that must keep a distance keep it, between the nodes too, and lose little by it.

use quietpath_bridge::file::{PlanFile, ScenarioFile};
use quietpath_bridge::planning::{Options, Planned, plan};
use quietpath_core::constraints::TOLERANCE;

/// Samples of a segment, to find agents that come close between the nodes.
const SAMPLES: usize = 50;

/// Agents that fly between these ends among three sensors.
fn scenario(separation: Option<f64>, ends: &[([f64; 2], [f64; 2])]) -> ScenarioFile {
    let separation = separation.map_or_else(String::new, |least| format!("separation = {least}\n"));
    let agents: String = (ends.iter())
        .map(|(start, goal)| {
            format!("[[agent]]\nstart = {start:?}\ngoal = {goal:?}\nspeed_max = 0.1\naccel_max = 0.02\n")
        })
        .collect();
    let sensors: String = [[3.0, 3.5], [5.5, 6.5], [7.5, 3.0]]
        .map(|at| {
            format!(
                "[[sensor]]\nposition = {at:?}\n\
                detection = {{ model = \"proxy\", scale = 0.3, epsilon = 0.3, path_loss = 2.0 }}\n"
            )
        })
        .concat();
    let text = format!(
        "{separation}softening = 0.05\ngrid = {{ intervals = 40 }}\n\
        time = {{ max = 300.0, target = 110.0, penalty = 1.0 }}\n\
        domain = {{ min = [0.0, 0.0], max = [10.0, 10.0] }}\n{agents}{sensors}\
        [[objective.term]]\nmetric = \"detection\"\n"
    );
    ScenarioFile::parse("apart", &text).unwrap_or_else(|error| panic!("{error}")).scenario
}

fn planned(scenario: &ScenarioFile) -> Planned {
    let planned = plan(scenario, &Options::default()).unwrap_or_else(|error| panic!("{error}"));
    assert!(planned.assessment.feasible, "{:?} {:?}", planned.assessment.worst, planned.obstacle);
    planned
}

/// Least distance of any two agents at any time, length units; all fly straight from node to node at the same times.
fn closest(plan: &PlanFile) -> f64 {
    let mut least = f64::INFINITY;
    for (index, a) in plan.agents.iter().enumerate() {
        for b in &plan.agents[index + 1..] {
            for (p, q) in a.path.windows(2).zip(b.path.windows(2)) {
                for sample in 0..=SAMPLES {
                    let share = sample as f64 / SAMPLES as f64;
                    let apart = |axis: usize| {
                        let at = |leg: &[Vec<f64>]| leg[0][axis] + share * (leg[1][axis] - leg[0][axis]);
                        at(p) - at(q)
                    };
                    least = least.min(apart(0).hypot(apart(1)));
                }
            }
        }
    }
    least
}

/// Plans with and without the distance; it must matter, be kept, and cost at most this part of the objective.
fn assert_apart(what: &str, ends: &[([f64; 2], [f64; 2])], least: f64, cost_max: f64) {
    let free = planned(&scenario(None, ends));
    let apart = planned(&scenario(Some(least), ends));
    let (before, after) = (closest(&free.plan), closest(&apart.plan));
    let cost = apart.assessment.objective / free.assessment.objective - 1.0;
    let status = apart.status.name();
    println!(
        "{what}: {before:.3} apart without, {after:.3} with at least {least}, for {:+.2} %; {status}",
        100.0 * cost
    );
    assert!(before < least, "{what}: they stay apart as it is");
    assert!(after >= least * (1.0 - TOLERANCE), "{what}: {after} apart, {least} wanted");
    assert!(cost <= cost_max, "{what}: costs {cost}");
}

#[test]
fn two_that_swap_places_pass_each_other() {
    let ends = [([1.0, 5.0], [9.0, 5.0]), ([9.0, 5.0], [1.0, 5.0])];
    assert_apart("swap", &ends, 0.5, 0.035);
    // Who has to give way by far had better take another way altogether, and the search looks at the ways one by one.
    assert_apart("swap, far apart", &ends, 1.5, 0.2);
}

#[test]
fn two_whose_ways_cross_pass_each_other() {
    let ends = [([1.0, 1.0], [9.0, 9.0]), ([1.0, 9.0], [9.0, 1.0])];
    assert_apart("crossing", &ends, 0.8, 0.02);
}

#[test]
fn two_side_by_side_fly_in_parallel() {
    let ends = [([1.0, 4.5], [9.0, 4.5]), ([1.0, 5.5], [9.0, 5.5])];
    assert_apart("side by side", &ends, 0.9, 0.1);
}

#[test]
fn three_that_meet_pass_each_other() {
    let ends = [([1.0, 5.0], [9.0, 5.0]), ([9.0, 5.5], [1.0, 5.5]), ([5.0, 1.0], [5.0, 9.0])];
    assert_apart("three", &ends, 0.6, 0.05);
    assert_apart("three, far apart", &ends, 1.2, 0.1);
}
