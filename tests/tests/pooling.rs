//! Sensors that pool their signals are planned for: feasibly, better than if each decided for itself, and to a rest.

use quietpath_bridge::file::{PlanFile, ScenarioFile};
use quietpath_bridge::planning::{Options, Planned, Status, assess, plan};

/// One agent past five energy detectors; `pooling` is a section of the file, or nothing.
fn scenario(pooling: &str) -> ScenarioFile {
    let sensors: String = [[2.5, 4.0], [4.0, 6.5], [5.5, 4.5], [7.0, 6.0], [8.0, 3.0]]
        .map(|at| {
            format!(
                "[[sensor]]\nposition = {at:?}\ndetection = {{ model = \"energy\", samples = 20, signal = 1.0, \
                noise = 1.0, log_threshold = 3.0, path_loss = 1.0 }}\n"
            )
        })
        .concat();
    let text = format!(
        "softening = 0.3\ngrid = {{ intervals = 40 }}\n\
        time = {{ max = 200.0, target = 95.0, penalty = 1.0 }}\n\
        domain = {{ min = [0.0, 0.0], max = [10.0, 10.0] }}\n\
        [[agent]]\nstart = [1.0, 5.0]\ngoal = [9.0, 5.0]\nspeed_max = 0.1\naccel_max = 0.02\n{sensors}\
        [[objective.term]]\nmetric = \"detection\"\n{pooling}"
    );
    ScenarioFile::parse("pooled", &text).unwrap_or_else(|error| panic!("{error}")).scenario
}

const POOLS: [(&str, &str); 2] = [
    ("uncorrelated", "[pooling]\nmodel = \"uncorrelated\"\nlog_threshold = 3.0\n"),
    ("correlated", "[pooling]\nmodel = \"correlated\"\ncorrelation = 0.5\nlog_threshold = 3.0\n"),
];

fn planned(scenario: &ScenarioFile) -> Planned {
    let planned = plan(scenario, &Options::default()).unwrap_or_else(|error| panic!("{error}"));
    assert!(planned.assessment.feasible, "{:?}", planned.assessment.worst);
    planned
}

fn objective(scenario: &ScenarioFile, plan: &PlanFile) -> f64 {
    assess(scenario, plan, "a plan").unwrap_or_else(|error| panic!("{error}")).objective
}

#[test]
fn pools_are_planned_better_than_by_whoever_takes_them_for_single_sensors() {
    let single = planned(&scenario(""));
    for (name, pooling) in POOLS {
        let pooled = scenario(pooling);
        let ours = planned(&pooled);
        let (best, other) = (ours.assessment.objective, objective(&pooled, &single.plan));
        println!("{name}: {best:.6}, and {other:.6} along the path for single sensors; {}", ours.status.name());
        assert_eq!(ours.status, Status::Converged, "{name}");
        assert!(best < other, "{name}: {best} is no better than {other}");
    }
}

/// Drawn towards any path nearby that is feasible as well, the objective rises: the gradient that led here is the right one.
#[test]
fn no_path_nearby_is_better() {
    for (name, pooling) in POOLS {
        let pooled = scenario(pooling);
        let ours = planned(&pooled);
        let best = ours.assessment.objective;
        let count = ours.plan.nodes() - 1;
        let mut tried = 0;
        for mode in 1..=4 {
            for (axis, size) in [(0, 0.003), (0, -0.003), (1, 0.003), (1, -0.003)] {
                // A little slower, so that a path a little longer keeps the speed.
                let mut moved = ours.plan.clone();
                moved.duration *= 1.002;
                for (node, place) in moved.agents[0].path.iter_mut().enumerate() {
                    place[axis] += size * (std::f64::consts::PI * f64::from(mode) * node as f64 / count as f64).sin();
                }
                let found = assess(&pooled, &moved, name).unwrap_or_else(|error| panic!("{error}"));
                if found.feasible {
                    tried += 1;
                    assert!(found.objective > best, "{name}: mode {mode} along {axis} gives {}", found.objective);
                }
            }
        }
        println!("{name}: {tried} paths tried");
        assert!(tried >= 8, "{name}: {tried} paths nearby are feasible");
    }
}
