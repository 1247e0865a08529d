//! What the paper says of its own plans holds for ours: section 4.3 (what each objective is after) and 4.4 (deadlines).

use quietpath_bridge::file::scenario::MotionEntry;
use quietpath_bridge::file::{PlanFile, ScenarioFile};
use quietpath_bridge::planning::{Assessment, Options, plan};
use quietpath_core::Metric;
use quietpath_tests::scenario;

/// A scenario, its plan, and what the plan is worth.
struct Flown {
    scenario: ScenarioFile,
    plan: PlanFile,
    assessment: Assessment,
}

impl Flown {
    fn new(name: &str) -> Self {
        Self::plan(scenario(name))
    }

    fn plan(scenario: ScenarioFile) -> Self {
        let planned = plan(&scenario, &Options::default()).unwrap_or_else(|error| panic!("{error}"));
        Self { scenario, plan: planned.plan, assessment: planned.assessment }
    }

    /// A metric at nodes 1 to N of the first agent.
    fn along(&self, metric: Metric) -> &[f64] {
        let series = self.assessment.agents[0].metric(metric).expect("the sensors give this metric");
        &series[1..]
    }

    fn mean(&self, metric: Metric) -> f64 {
        let values = self.along(metric);
        values.iter().sum::<f64>() / values.len() as f64
    }

    fn peak(&self, metric: Metric) -> f64 {
        self.along(metric).iter().copied().fold(f64::NEG_INFINITY, f64::max)
    }

    /// Largest distance of a node from the straight line between start and goal, length units.
    fn bulge(&self) -> f64 {
        let agent = &self.scenario.agents[0];
        let (start, goal) = ([agent.start[0], agent.start[1]], [agent.goal[0], agent.goal[1]]);
        let along = [goal[0] - start[0], goal[1] - start[1]];
        let length = along[0].hypot(along[1]);
        let off = |p: &Vec<f64>| ((p[0] - start[0]) * along[1] - (p[1] - start[1]) * along[0]).abs() / length;
        self.plan.agents[0].path.iter().map(off).fold(0.0, f64::max)
    }

    /// Mean over the nodes of the distance to the nearest sensor, length units.
    fn mean_distance(&self) -> f64 {
        let nearest = |p: &Vec<f64>| {
            let distance = |sensor: &quietpath_bridge::file::scenario::SensorEntry| match &sensor.motion {
                MotionEntry::Fixed(y) => (p[0] - y[0]).hypot(p[1] - y[1]),
                MotionEntry::Track(_) => f64::INFINITY,
            };
            self.scenario.sensors.iter().map(distance).fold(f64::INFINITY, f64::min)
        };
        let path = &self.plan.agents[0].path;
        path.iter().map(nearest).sum::<f64>() / path.len() as f64
    }
}

#[test]
fn a_hard_deadline_at_the_shortest_time_leaves_the_straight_line() {
    let mut scenario = scenario("square8-detection");
    let agent = &scenario.agents[0];
    let length = (agent.goal[0] - agent.start[0]).hypot(agent.goal[1] - agent.start[1]);
    scenario.time.max = length / agent.speed_max;
    let flown = Flown::plan(scenario);
    assert!(flown.assessment.feasible, "{:?}", flown.assessment.worst);
    assert!(flown.bulge() <= 1e-6 * length, "{} length units off the straight line", flown.bulge());
}

#[test]
fn the_earliest_deadline_is_met_by_nearly_the_straight_line() {
    let earliest = Flown::new("square8-deadline-100");
    let later = Flown::new("square8-deadline-105");
    let (straight, bent) = (earliest.bulge(), later.bulge());
    println!("bulge: {straight:.4} at the earliest deadline, {bent:.4} with 5 % more time");
    // The target is 0.05 % after the shortest time, and lateness a soft penalty: that buys a little room.
    assert!(straight <= 0.2, "{straight} length units off the straight line");
    assert!(bent >= 5.0 * straight, "time is there to be used: {bent} with 5 % more");
}

#[test]
fn deadlines_are_met() {
    for percent in ["100", "105", "110", "115"] {
        let flown = Flown::new(&format!("square8-deadline-{percent}"));
        let late = flown.plan.duration / flown.scenario.time.target - 1.0;
        println!("{percent} %: {:+.3} % late", 100.0 * late);
        // The paper arrives on time to the second. From the straight line one ends in basins where the best flight is
        // shorter than it might be; the reference does so too from this start.
        assert!((-0.03..=0.001).contains(&late), "{percent} %: {:+.3} % late", 100.0 * late);
    }
}

#[test]
fn later_deadlines_lower_the_mean_detection() {
    let flights = ["100", "105", "110", "115"].map(|percent| Flown::new(&format!("square8-deadline-{percent}")));
    let means = flights.each_ref().map(|flown| flown.mean(Metric::Detection));
    println!("mean detection by deadline: {means:.4?}");
    for pair in means.windows(2) {
        assert!(pair[1] < 0.99 * pair[0], "mean detection does not fall: {means:?}");
    }
}

#[test]
fn each_objective_gets_what_it_is_after() {
    let hidden = Flown::new("square8-detection");
    let worst = Flown::new("square8-worst-detection");
    let confusing = Flown::new("square8-cep");
    assert!(worst.peak(Metric::Detection) < hidden.peak(Metric::Detection));
    assert!(hidden.mean(Metric::Detection) < confusing.mean(Metric::Detection));
    assert!(confusing.mean(Metric::LogCep) > hidden.mean(Metric::LogCep));
    let (away, near) = (hidden.mean_distance(), confusing.mean_distance());
    println!("mean distance to the nearest sensor: {away:.3} hiding, {near:.3} confusing");
    assert!(near < away, "who confuses sensors hugs them: {near} against {away}");
}

#[test]
fn the_switch_of_objectives_is_taken() {
    let switched = Flown::new("square8-mixed");
    let until = switched.scenario.terms[0].window.until;
    let first = |values: &[f64], times: &[f64]| {
        let early: Vec<f64> = values.iter().zip(times).filter(|(_, t)| **t < until).map(|(v, _)| *v).collect();
        early.iter().sum::<f64>() / early.len() as f64
    };
    let late = |values: &[f64], times: &[f64]| {
        let late: Vec<f64> = values.iter().zip(times).filter(|(_, t)| **t >= until).map(|(v, _)| *v).collect();
        late.iter().sum::<f64>() / late.len() as f64
    };
    let times = &switched.assessment.times[1..];
    let (before, after) =
        (first(switched.along(Metric::Detection), times), late(switched.along(Metric::Detection), times));
    println!("mean detection {before:.3} before {until} s, {after:.3} after");
    assert!(before < after, "hidden first, then located worst");
}
