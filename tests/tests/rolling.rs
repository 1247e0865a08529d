//! Section 4.5 as the paper flies it: in 18 steps, each of which knows where the moving sensor is and not where it goes.

use quietpath_bridge::file::{PlanFile, ScenarioFile};
use quietpath_bridge::planning::{Choice, Options, Precision, Rolled, Step, assess, roll};
use quietpath_core::Metric;
use quietpath_core::constraints::TOLERANCE;
use quietpath_tests::scenario;

/// Largest difference of the claimed objective from the recomputed one, relative to max(1, |objective|).
const CLAIM_ERROR_MAX: f64 = 1e-9;
/// How far a budget may be overdrawn, as a part of it.
const OVERDRAFT_MAX: f64 = 1e-9;
/// Steps of the scenarios.
const STEPS: usize = 18;

fn flown(name: &str, precision: Precision) -> (ScenarioFile, Rolled) {
    let scenario = scenario(name);
    let options = Options { precision, ..Options::default() };
    let rolled = roll(&scenario, &options, &mut |_| ()).unwrap_or_else(|error| panic!("{name}: {error}"));
    (scenario, rolled)
}

fn mean_log_aee(rolled: &Rolled) -> f64 {
    let values = rolled.assessment.agents[0].metric(Metric::LogAee).expect("the sensors range");
    let times = &rolled.assessment.times;
    let sum: f64 = times.windows(2).zip(&values[1..]).map(|(pair, value)| (pair[1] - pair[0]) * value).sum();
    sum / (times[times.len() - 1] - times[0])
}

/// All that holds of a flight in steps, whatever it is after.
fn assert_flown(name: &str, scenario: &ScenarioFile, rolled: &Rolled) {
    assert_eq!(rolled.steps.len(), STEPS, "{name}");
    for (index, step) in rolled.steps.iter().enumerate() {
        assert!(step.feasible, "{name}, step {}: {:?}", index + 1, step.obstacle);
    }
    let written = PlanFile::parse(name, &rolled.plan.to_json()).unwrap_or_else(|error| panic!("{name}: {error}"));
    let found = assess(scenario, &written, name).unwrap_or_else(|error| panic!("{name}: {error}"));
    for (constraint, size) in &found.violations {
        assert!(*size <= TOLERANCE, "{name}: {constraint} broken by {size:e}");
    }
    let claimed = written.objective.expect("a flown plan claims an objective");
    let error = (claimed - found.objective).abs() / found.objective.abs().max(1.0);
    assert!(error <= CLAIM_ERROR_MAX, "{name}: claims {claimed}, is {}", found.objective);
    assert_eq!(written.agents[0].path.last(), Some(&scenario.agents[0].goal), "{name} arrives");
    assert_eq!(written.nodes(), scenario.intervals + 1, "{name}");
    let (constraint, violation) = found.worst;
    println!(
        "{name}: objective {:.6}, {:.1} s, mean ln AEE {:.3}, {constraint} {violation:.1e}",
        found.objective,
        written.duration,
        mean_log_aee(rolled)
    );
}

#[test]
fn both_flights_arrive_in_18_steps_within_all_limits() {
    let (wight, plain) = flown("wight", Precision::F64);
    assert_flown("wight", &wight, &plain);
    let (jam, jammed) = flown("wight-jam", Precision::F64);
    assert_flown("wight-jam", &jam, &jammed);
    let budget = jam.agents[0].jammer.expect("a jammer").budget;
    let (times, levels) = (jammed.plan.node_times(), jammed.plan.agents[0].jam.as_ref().expect("levels"));
    let spent: f64 = times.windows(2).zip(&levels[1..]).map(|(pair, level)| (pair[1] - pair[0]) * level).sum();
    assert!(spent <= budget * (1.0 + OVERDRAFT_MAX), "spends {spent} of {budget}");
    assert!(spent >= budget * (1.0 - 1e-6), "leaves some of {budget}, spends {spent}");
    let (with, without) = (mean_log_aee(&jammed), mean_log_aee(&plain));
    assert!(with > without + 0.1, "mean ln AEE {with} with jamming, {without} without");
    // Most steps learn something: where the sensor is by then.
    for (name, rolled) in [("wight", &plain), ("wight-jam", &jammed)] {
        let new = rolled.steps.iter().filter(|step| step.choice == Choice::New).count();
        assert!(new > STEPS / 2, "{name}: {new} steps with a plan of their own");
        assert_warm(name, &rolled.steps);
    }
}

/// What planning a step costs, in thousands of instructions: counts of what the planner did, which do not depend on the
/// machine, each with what it cost in a run of `wight` under callgrind. The search from everywhere has a lattice besides,
/// which no count tells of.
fn cost(step: &Step) -> usize {
    54 * step.projection_steps + 1700 * step.factorizations + 240 * step.evaluations
}

/// The most that a warm step may cost, in thousands of instructions as counted. A bound of its own: against the first step
/// alone, a warm one would look dear whenever the first gets cheaper.
const WARM_MAX: usize = 200_000;

fn assert_warm(name: &str, steps: &[Step]) {
    let [cold, warm @ ..] = steps else { panic!("no steps") };
    let most = warm.iter().map(cost).max().unwrap_or_default();
    println!("{name}: {} thousand instructions cold, {most} at most warm", cost(cold));
    assert!(most < WARM_MAX, "{name}: {most} for a warm step");
    assert!(2 * most < cost(cold), "{name}: {most} for a warm step, {} for the cold one", cost(cold));
}

#[test]
fn single_precision_flies_nearly_as_well() {
    let (wight, single) = flown("wight", Precision::F32);
    assert_flown("wight in f32", &wight, &single);
}
