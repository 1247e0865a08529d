//! Plans through the door: both precisions and dimensions, the claim, and what is refused.

use std::time::Duration;

use quietpath_bridge::file::{PlanFile, ScenarioFile};
use quietpath_bridge::planning::{Options, Precision, Rollout, Status, assess, plan};

fn scenario(name: &str) -> ScenarioFile {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../sim/scenarios");
    ScenarioFile::read(&format!("{folder}/{name}.toml")).expect("scenario").scenario
}

#[test]
fn plans_are_feasible_and_claim_what_their_file_is_worth() {
    for name in ["square8-detection", "volume8-detection"] {
        let scenario = scenario(name);
        let mut objectives = Vec::new();
        for precision in [Precision::F64, Precision::F32] {
            let planned = plan(&scenario, &Options { precision, ..Options::default() }).expect("a plan");
            assert!(planned.assessment.feasible, "{name} {precision:?}: {:?}", planned.assessment.worst);
            assert!(planned.iterations > 0 && planned.evaluations > 0);
            let text = planned.plan.to_json();
            let read = PlanFile::parse("plan.json", &text).expect("own plan");
            assert_eq!(read, planned.plan);
            let found = assess(&scenario, &read, "plan.json").expect("assessment");
            assert_eq!(Some(found.objective), read.objective);
            assert_eq!(read.status.as_deref(), Some(planned.status.name()));
            assert!(read.timing.is_some_and(|timing| timing.plan_seconds > 0.0));
            assert_eq!((&read.agents[0].path[0], read.nodes()), (&scenario.agents[0].start, scenario.intervals + 1));
            assert_eq!(read.agents[0].path.last(), Some(&scenario.agents[0].goal));
            objectives.push(found.objective);
        }
        // The descents part ways by rounding; they end in the same valley.
        assert!((objectives[0] / objectives[1] - 1.0).abs() < 1e-2, "{name}: {objectives:?}");
    }
}

#[test]
fn controls_are_written_where_the_agent_has_them() {
    for (name, jams, falls_silent) in [("square8-jam", true, false), ("dropout4-17", false, true)] {
        let planned = plan(&scenario(name), &Options::default()).expect("a plan");
        assert!(planned.assessment.feasible, "{name}: {:?}", planned.assessment.worst);
        let agent = &planned.plan.agents[0];
        let is_used = |control: &Option<Vec<f64>>| {
            control.as_ref().map(|values| values.len() == agent.path.len() && values.iter().any(|value| *value > 0.0))
        };
        assert_eq!(is_used(&agent.jam), jams.then_some(true), "{name}");
        assert_eq!(is_used(&agent.dropout), falls_silent.then_some(true), "{name}");
        assert_eq!(agent.azimuth.is_some(), jams, "{name}");
    }
}

#[test]
fn limits_on_work_end_with_a_feasible_plan_that_says_so() {
    let scenario = scenario("square8-energy");
    let few = Options { iterations: Some(3), ..Options::default() };
    let now = Options { deadline: Some(Duration::ZERO), ..Options::default() };
    for (options, status) in [(few, Status::IterationLimit), (now, Status::Deadline)] {
        let planned = plan(&scenario, &options).expect("a plan");
        assert_eq!(planned.status, status);
        assert!(planned.assessment.feasible);
    }
}

#[test]
fn regions_and_limits_are_kept() {
    for name in ["wight", "square8-limit"] {
        let options = Options { rollout: Rollout::Once, ..Options::default() };
        let planned = plan(&scenario(name), &options).expect(name);
        assert!(planned.assessment.feasible, "{name}: {:?}", planned.assessment.worst);
    }
}
