//! Plans in steps through the door: what a scenario file asks for, and a world that changes on the way.

use quietpath_bridge::file::scenario::{MotionEntry, SensorEntry};
use quietpath_bridge::file::{PlanFile, ScenarioFile};
use quietpath_bridge::planning::{
    Choice, Options, Planned, Precision, Rolled, Rollout, Status, assess, plan, roll, roll_through,
};
use quietpath_core::horizon::Reveal;
use quietpath_core::{Metric, scenario::Sense};

/// Past three sensors, one of which crosses the way.
const SCENARIO: &str = r#"
name = "crossing"
grid = { intervals = 20 }
time = { max = 60.0, target = 30.0, penalty = 0.1 }
domain = { min = [0.0, 0.0], max = [20.0, 20.0] }
softening = 0.05
[[agent]]
start = [1.0, 10.0]
goal = [19.0, 10.0]
speed_max = 1.0
accel_max = 0.5
jammer = { budget = 5.0 }
[[sensor]]
name = "west"
position = [6.0, 9.0]
ranging = { model = "toa", c1 = 0.01, c2 = 0.1, path_loss = 2.0 }
detection = { model = "proxy", scale = 1.0, epsilon = 1.0, path_loss = 2.0 }
jam = { error_gain = 5.0 }
[[sensor]]
name = "east"
position = [14.0, 11.0]
ranging = { model = "toa", c1 = 0.01, c2 = 0.1, path_loss = 2.0 }
detection = { model = "proxy", scale = 1.0, epsilon = 1.0, path_loss = 2.0 }
jam = { error_gain = 5.0 }
[[sensor]]
name = "patrol"
track = [{ t = 0.0, position = [10.0, 18.0] }, { t = 30.0, position = [12.0, 5.0] }]
ranging = { model = "toa", c1 = 0.01, c2 = 0.1, path_loss = 2.0 }
detection = { model = "proxy", scale = 1.0, epsilon = 1.0, path_loss = 2.0 }
jam = { error_gain = 5.0 }
[[objective.term]]
metric = "detection"
[rolling]
steps = 5
"#;

fn scenario() -> ScenarioFile {
    ScenarioFile::parse("crossing.toml", SCENARIO).expect("a scenario").scenario
}

/// The same, with other words in place of some.
fn with(old: &str, new: &str) -> ScenarioFile {
    assert!(SCENARIO.contains(old), "{old}");
    ScenarioFile::parse("crossing.toml", &SCENARIO.replacen(old, new, 1)).expect("a scenario").scenario
}

fn rolled(scenario: &ScenarioFile, options: &Options) -> Rolled {
    roll(scenario, options, &mut |_| ()).unwrap_or_else(|error| panic!("{error}"))
}

/// Distance of the nearest node of a path from a place.
fn nearest(plan: &PlanFile, place: [f64; 2]) -> f64 {
    plan.agents[0].path.iter().map(|at| (at[0] - place[0]).hypot(at[1] - place[1])).fold(f64::INFINITY, f64::min)
}

#[test]
fn the_flown_plan_is_what_was_flown_of_each_step() {
    for precision in [Precision::F64, Precision::F32] {
        let scenario = scenario();
        let mut heard = Vec::new();
        let options = Options { precision, ..Options::default() };
        let flown = roll(&scenario, &options, &mut |step| heard.push(step.clone())).expect("a flight");
        assert_eq!(heard, flown.steps);
        let lengths: Vec<usize> = flown.steps.iter().map(|step| step.intervals).collect();
        assert_eq!(lengths, [4; 5], "{precision:?}");
        let (path, times) = (&flown.plan.agents[0].path, flown.plan.times.as_ref().expect("times"));
        assert_eq!((path.len(), times.len()), (21, 21));
        assert_eq!((&path[0], path.last()), (&scenario.agents[0].start, Some(&scenario.agents[0].goal)));
        for step in &flown.steps {
            assert!(step.feasible && step.plan_seconds() > 0.0, "{step:?}");
            assert_eq!(step.plan.nodes(), 21 - step.node);
            assert!((step.time() - times[step.node]).abs() < 1e-5 && step.end() > step.time());
            let planned = step.plan.node_times();
            for node in 0..=step.intervals {
                assert_eq!(path[step.node + node], step.plan.agents[0].path[node], "{precision:?}");
                assert!((times[step.node + node] - planned[node]).abs() < 1e-5);
            }
        }
        assert!((times[20] - times[0] - flown.plan.duration).abs() < 1e-9);
        let is_even = times.windows(2).all(|pair| (pair[1] - pair[0] - flown.plan.duration / 20.0).abs() < 1e-3);
        assert!(!is_even, "no step chose another flight time: {times:?}");
        let written = PlanFile::parse("plan.json", &flown.plan.to_json()).expect("own plan");
        assert_eq!(written, flown.plan);
        let found = assess(&scenario, &written, "plan.json").expect("assessment");
        assert!(found.feasible, "{:?}", found.worst);
        assert_eq!((Some(found.objective), written.status.as_deref()), (written.objective, Some("flown")));
    }
}

#[test]
fn a_plan_is_in_steps_where_the_scenario_says_so_unless_it_is_to_be_in_one_piece() {
    let scenario = scenario();
    let planned = plan(&scenario, &Options::default()).expect("a plan");
    let flown = Planned::from(rolled(&scenario, &Options::default()));
    assert_eq!((&planned.plan.agents, &planned.plan.times), (&flown.plan.agents, &flown.plan.times));
    assert_eq!((planned.status, planned.evaluations), (flown.status, flown.evaluations));
    let once = plan(&scenario, &Options { rollout: Rollout::Once, ..Options::default() }).expect("a plan");
    assert!(once.plan.times.is_none() && once.assessment.objective < planned.assessment.objective);
    let whole = with("[rolling]\nsteps = 5\n", "");
    let error = roll(&whole, &Options::default(), &mut |_| ()).expect_err("no steps").to_string();
    assert!(error.contains("crossing.toml: rolling is missing") && error.contains("help: add [rolling]"), "{error}");
}

#[test]
fn a_step_knows_what_is_revealed_to_it() {
    let objectives = [Reveal::Current, Reveal::Predicted, Reveal::Known].map(|reveal| {
        let mut scenario = scenario();
        scenario.rolling.as_mut().expect("steps").reveal = reveal;
        rolled(&scenario, &Options::default()).steps[0].plan.clone()
    });
    let whole = |plan: &PlanFile| assess(&scenario(), plan, "the first step").expect("it fits").objective;
    let [current, predicted, known] = objectives.each_ref().map(whole);
    // The patrol keeps its velocity, so that it is predicted for as long as it moves.
    assert!(predicted < current && known < current, "{current} {predicted} {known}");
    // With every track known, the first step expects what it meets.
    assert!((objectives[2].objective.expect("a claim") - known).abs() < 1e-9 * known);
    assert!((objectives[0].objective.expect("a claim") - current).abs() > 1e-3 * current);
}

#[test]
fn adaptive_steps_shorten_while_the_world_changes() {
    let calm = "track = [{ t = 0.0, position = [10.0, 18.0] }, { t = 12.0, position = [10.0, 18.0] }, { t = 14.0, position = [10.0, 8.0] }";
    let mut scenario = with("track = [{ t = 0.0, position = [10.0, 18.0] }", calm);
    let lengths = |scenario: &ScenarioFile| -> Vec<usize> {
        rolled(scenario, &Options::default()).steps.iter().map(|step| step.intervals).collect()
    };
    let adaptive = |change| quietpath_core::horizon::Cadence::Adaptive { shortest: 1, longest: 6, change };
    scenario.rolling.as_mut().expect("steps").cadence = adaptive(0.02);
    // The patrol sets out at 12 s, and steps are longest when that is seen.
    assert_eq!(lengths(&scenario), [1, 2, 4, 6, 3, 1, 1, 2]);
    scenario.rolling.as_mut().expect("steps").cadence = adaptive(10.0);
    assert_eq!(lengths(&scenario), [1, 2, 4, 6, 6, 1]);
}

#[test]
fn sensors_are_found_lost_and_moved_on_the_way() {
    let scenario = with("steps = 5", "steps = 10");
    let quiet = rolled(&scenario, &Options::default());
    let path = &quiet.plan.agents[0].path;
    let (found, lost) = ([path[14][0], path[14][1] + 0.2], [6.0, 9.0]);
    let appears = |world: &mut ScenarioFile| {
        let like = world.sensors[0].clone();
        let motion = MotionEntry::Fixed(found.to_vec());
        world.sensors.push(SensorEntry { name: "new".into(), motion, ..like });
    };
    let through = |change: &(dyn Fn(f64, &mut ScenarioFile) + Sync)| {
        let mut world = |time: f64| {
            let mut world = scenario.clone();
            change(time, &mut world);
            Some(world)
        };
        let flown = roll_through(&scenario, &Options::default(), &mut world, &mut |_| ()).expect("a flight");
        assert!(flown.assessment.feasible && flown.steps.iter().all(|step| step.feasible));
        flown
    };
    assert_eq!(through(&|_, _| ()).plan.agents, quiet.plan.agents);
    let aware = through(&|time, world| {
        if time >= 10.0 {
            appears(world)
        }
    });
    let (before, after) = (nearest(&quiet.plan, found), nearest(&aware.plan, found));
    assert!(after > before + 0.3, "{after} from a new sensor, {before} where it is not known");
    let step = aware.steps.iter().find(|step| step.time() >= 10.0).expect("a step after that");
    assert!(step.change > 0.02 && step.choice == Choice::New, "{step:?}");
    // Never known, so never avoided.
    let free = through(&|_, world| drop(world.sensors.remove(0)));
    let (before, after) = (nearest(&quiet.plan, lost), nearest(&free.plan, lost));
    assert!(after < before - 0.3, "{after} from a lost sensor, {before} where it is known");
    let place = [14.0, 3.0];
    let moved = through(&|time, world| {
        if time >= 5.0 {
            world.sensors[1].motion = MotionEntry::Fixed(place.to_vec());
        }
    });
    let (before, after) = (nearest(&quiet.plan, place), nearest(&moved.plan, place));
    assert!(after > before + 0.3, "{after} from a sensor that came near, {before} where it stays");
}

#[test]
fn objectives_and_limits_switch_between_steps() {
    let scenario = scenario();
    let mut world = |time: f64| {
        let mut world = scenario.clone();
        if time >= 12.0 {
            (world.terms[0].metric, world.terms[0].sense) = (Metric::LogAee, Sense::Maximize);
        }
        Some(world)
    };
    let flown = roll_through(&scenario, &Options::default(), &mut world, &mut |_| ()).expect("a flight");
    assert!(flown.assessment.feasible, "{:?}", flown.assessment.worst);
    let (hidden, levels) =
        (rolled(&scenario, &Options::default()), flown.plan.agents[0].jam.as_ref().expect("levels"));
    let late = |found: &Rolled| {
        let values = found.assessment.agents[0].metric(Metric::LogAee).expect("the sensors range");
        values[12..].iter().sum::<f64>() / 9.0
    };
    assert!(late(&flown) > late(&hidden) + 0.2, "{} {}", late(&flown), late(&hidden));
    // Jamming pays from the switch on, and its budget is the flight's.
    let times = flown.plan.node_times();
    let spent: f64 = times.windows(2).zip(&levels[1..]).map(|(pair, level)| (pair[1] - pair[0]) * level).sum();
    assert!(spent <= 5.0 * (1.0 + 1e-9) && spent > 4.9, "{spent}");
    // No place is that quiet: the steps from then on have no feasible plan, and the one before stays in force.
    let mut world = |time: f64| {
        let mut world = scenario.clone();
        if time >= 12.0 {
            world.limits.push(quietpath_core::scenario::Limit {
                metric: Metric::Detection,
                min: None,
                max: Some(1e-6),
            });
        }
        Some(world)
    };
    let shut = roll_through(&scenario, &Options::default(), &mut world, &mut |_| ()).expect("a flight");
    let stopped: Vec<_> = shut.steps.iter().filter(|step| !step.feasible).collect();
    assert!(!stopped.is_empty() && stopped.iter().all(|step| step.choice == Choice::Tail && step.time() >= 12.0));
    assert!(stopped.iter().all(|step| step.status == Status::Infeasible));
    let says = shut.obstacle().expect("an obstacle");
    assert_eq!((says.constraint.name(), says.index), ("limit", Some(0)));
    assert_eq!(Planned::from(shut).status, Status::Infeasible);
}
