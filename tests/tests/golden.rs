//! Objective and violations of 75 plans against an independent reading of the model: `tests/data/golden.json`.
//!
//! Three plans for each of the 25 scenarios: the reference plan, one disturbed by waves and noise, and one with
//! unequal steps, so that every constraint is violated somewhere. Jamming, dropout, teams, regions and limits are
//! among them, although the planner does not decide on these yet.

use std::collections::{BTreeMap, BTreeSet};

use quietpath_bridge::file::PlanFile;
use quietpath_bridge::planning::{Assessment, assess};
use quietpath_tests::figures::{GoldenCase, golden};
use quietpath_tests::scenario;

/// Relative difference of objectives allowed, and absolute difference of violations.
const TOLERANCE: f64 = 1e-9;

fn assessed(case: &GoldenCase) -> Assessment {
    let plan = PlanFile::parse("golden.json", &case.plan.to_string()).expect("a plan");
    assess(&scenario(&case.scenario), &plan, "golden.json").expect("a plan for this scenario")
}

#[test]
fn objectives_and_violations_match_the_independent_reading() {
    let cases = golden();
    let scenarios: BTreeSet<&str> = cases.iter().map(|case| case.scenario.as_str()).collect();
    assert_eq!((cases.len(), scenarios.len()), (75, 25));
    let (mut worst_objective, mut worst_violation) = (0.0_f64, 0.0_f64);
    for case in &cases {
        let ours = assessed(case);
        let name = format!("{} ({})", case.scenario, case.kind);
        let error = (ours.objective - case.objective).abs() / case.objective.abs().max(1.0);
        assert!(error <= TOLERANCE, "{name}: objective {} is not {}, {error:.1e}", ours.objective, case.objective);
        worst_objective = worst_objective.max(error);
        let found: BTreeMap<&str, f64> = ours.violations.into_iter().collect();
        for (constraint, golden) in &case.violations {
            let ours = found.get(constraint.as_str()).copied().unwrap_or(0.0);
            let error = (ours - golden).abs();
            assert!(error <= TOLERANCE, "{name}: {constraint} violated by {ours}, not by {golden}");
            worst_violation = worst_violation.max(error);
        }
        let known = |constraint: &&str| case.violations.contains_key(*constraint) || found[*constraint] == 0.0;
        assert!(found.keys().all(known), "{name}: violations that the other reading does not have: {found:?}");
    }
    println!("worst difference: objective {worst_objective:.1e} relative, violation {worst_violation:.1e}");
}

#[test]
fn every_constraint_is_violated_somewhere_in_the_golden_cases() {
    let mut violated = BTreeSet::new();
    for case in golden() {
        violated.extend(case.violations.into_iter().filter(|(_, violation)| *violation > 1e-3).map(|(name, _)| name));
    }
    let all = [
        "accel",
        "domain",
        "dropout_bounds",
        "dropout_budget",
        "duration",
        "goal",
        "jam_bounds",
        "jam_budget",
        "limit",
        "region",
        "speed",
        "start",
    ];
    assert_eq!(violated, all.map(String::from).into());
}
