//! Files and lines that people and programs write.

use std::sync::LazyLock;

use quietpath_bridge::file::mission::missions;
use quietpath_bridge::file::plan::AgentPlan;
use quietpath_bridge::file::{PlanFile, ScenarioFile, geojson};
use quietpath_bridge::flight::{Flight, Settings};
use quietpath_bridge::planning::assess;
use quietpath_bridge::replan::Observation;
use quietpath_bridge::setpoint::Curve;

/// What plans and observations are held against.
const WORLD: &str = include_str!("../../../sim/scenarios/starter.toml");

/// Names that errors give the files.
const SCENARIO: &str = "fuzz.toml";
const PLAN: &str = "fuzz.json";

static STARTER: LazyLock<ScenarioFile> =
    LazyLock::new(|| ScenarioFile::parse("starter.toml", WORLD).expect("the starter scenario is one").scenario);

/// Errors are for people: they name the file and say something.
fn is_told(error: &str, name: &str) {
    assert!(error.contains(name) && error.len() > name.len() + 10, "an error that says little: {error}");
    assert!(error.len() < 20_000, "an error of {} bytes", error.len());
}

/// Reads a scenario; where it is one, weighs its straight line and exports it.
///
/// # Panics
/// A promise is broken.
pub fn scenario(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let loaded = match ScenarioFile::parse(SCENARIO, text) {
        Ok(loaded) => loaded,
        Err(error) => return is_told(&error.to_string(), SCENARIO),
    };
    for warning in &loaded.warnings {
        assert!(!warning.to_string().is_empty());
    }
    let scenario = &loaded.scenario;
    let plan = straight(scenario);
    match assess(scenario, &plan, PLAN) {
        Ok(assessment) => assert_eq!(assessment.violations.len(), 13),
        Err(error) => return is_told(&error.to_string(), ".toml"),
    }
    exports(scenario, &plan);
}

/// The straight lines of all agents, in all the time there is.
fn straight(scenario: &ScenarioFile) -> PlanFile {
    let agent = |agent: &quietpath_bridge::file::scenario::AgentEntry| AgentPlan {
        name: agent.name.clone(),
        path: vec![agent.start.clone(), agent.goal.clone()],
        ..AgentPlan::default()
    };
    PlanFile {
        scenario: scenario.name.clone(),
        start_time: scenario.start_time,
        duration: scenario.time.max - scenario.start_time,
        agents: scenario.agents.iter().map(agent).collect(),
        ..PlanFile::default()
    }
}

/// Everything that is made of a plan.
fn exports(scenario: &ScenarioFile, plan: &PlanFile) {
    match missions(scenario, plan) {
        Ok(all) => {
            assert_eq!(all.len(), plan.agents.len());
            assert!(all.iter().all(|mission| mission.to_waypoints().starts_with("QGC WPL 110")));
        }
        Err(error) => assert!(!error.to_string().is_empty()),
    }
    if let Ok(text) = geojson::to_geojson(scenario, plan) {
        assert!(text.starts_with("{"), "GeoJSON is an object");
    }
    for agent in &plan.agents {
        let Some(curve) = Curve::of(plan, &agent.name) else { continue };
        let middle = 0.5 * (curve.begin() + curve.end());
        assert_eq!(curve.sample(middle).position.len(), scenario.dimension);
    }
    if let Err(error) = Flight::new(scenario, plan, Settings::default()) {
        assert!(!error.to_string().is_empty());
    }
}

/// Reads a plan; where it is one of the starter scenario, weighs and exports it.
///
/// # Panics
/// A promise is broken.
pub fn plan(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let plan = match PlanFile::parse(PLAN, text) {
        Ok(plan) => plan,
        Err(error) => return is_told(&error.to_string(), PLAN),
    };
    let again = PlanFile::parse(PLAN, &plan.to_json()).expect("a plan that was written reads back");
    assert_eq!(again, plan, "a plan reads back as it was written");
    if let Err(error) = plan.fits(PLAN, &STARTER) {
        return is_told(&error.to_string(), PLAN);
    }
    let assessment = assess(&STARTER, &plan, PLAN).expect("a plan that fits is weighed");
    let is_finite = plan.agents.iter().flat_map(|agent| agent.path.iter().flatten()).all(|part| part.is_finite());
    assert!(is_finite || !assessment.feasible, "numbers that are not finite are not feasible");
    exports(&STARTER, &plan);
}

/// Puts observations into the starter scenario. It stays one, whatever they say.
///
/// # Panics
/// A promise is broken.
pub fn observations(bytes: &[u8]) {
    let text = String::from_utf8_lossy(bytes);
    let mut world = STARTER.clone();
    for line in text.lines().take(200) {
        let before = world.sensors.len();
        match Observation::parse(line) {
            Err(why) => assert!(!why.is_empty()),
            Ok(seen) => match seen.apply(&mut world, 12.5, 0.5) {
                Ok(()) => assert!(world.sensors.len() <= before + 1),
                Err(why) => assert!(!why.is_empty() && world.sensors.len() == before),
            },
        }
    }
    if let Err(error) = assess(&world, &straight(&world), PLAN) {
        panic!("the scenario was one before it was observed: {error}");
    }
}
