//! The rest of a flight, planned anew by the planner itself.

use std::time::{Duration, Instant};

use quietpath_bridge::file::{PlanFile, ScenarioFile};
use quietpath_bridge::planning::{Memory, Options, assess, plan};
use quietpath_bridge::replan::job::{Rejected, rest, rest_at};
use quietpath_bridge::replan::worker::carry_out;
use quietpath_bridge::replan::{Answer, Job, Observation, Worker, judge};
use quietpath_bridge::setpoint::Curve;

const SCENARIO: &str = r#"
grid = { intervals = 20 }
time = { max = 40.0 }
domain = { min = [0.0, 0.0], max = [20.0, 20.0] }
[[agent]]
start = [1.0, 10.0]
goal = [19.0, 10.0]
speed_max = 1.0
accel_max = 0.5
[[sensor]]
name = "s1"
position = [10.0, 9.0]
detection = { model = "proxy", scale = 1.0, epsilon = 0.5, path_loss = 2.0 }
[[region]]
center = [6.0, 14.0]
radius = 1.0
[[objective.term]]
metric = "detection"
"#;

fn begin() -> (ScenarioFile, PlanFile) {
    let scenario = ScenarioFile::parse("s.toml", SCENARIO).expect("a scenario").scenario;
    let planned = plan(&scenario, &Options::default()).expect("a plan");
    assert!(planned.assessment.feasible);
    (scenario, planned.plan)
}

fn job(world: &ScenarioFile, flying: &PlanFile, seam: f64) -> Job {
    rest(1, world, flying, seam).expect("enough is left")
}

fn answer(job: &Job) -> Answer {
    Answer { number: job.number, result: carry_out(job, Duration::from_secs(60), &mut Memory::default()) }
}

#[test]
fn the_rest_is_planned_around_a_sensor_that_moved_and_takes_over_smoothly() {
    let (mut world, mut flying) = begin();
    let seen = "{\"id\": \"s1\", \"position\": [14.0, 18.0]}";
    for (step, seam) in [8.0, 15.0, 22.0].into_iter().enumerate() {
        if step == 1 {
            Observation::parse(seen).expect("read").apply(&mut world, seam, 1.0).expect("applied");
        }
        let before = Curve::of(&flying, "uav1").expect("a curve");
        let job = job(&world, &flying, seam);
        assert!((seam..seam + 2.5).contains(&job.seam), "{}", job.seam);
        let seam = job.seam;
        let answer = answer(&job);
        let (plan, after) = judge(&job, &answer, seam - 2.0, &before).expect("it flies");
        let (there, here) = (after.sample(seam), before.sample(seam));
        for axis in 0..2 {
            assert!((there.position[axis] - here.position[axis]).abs() < 1e-9, "step {step}");
            assert!((there.velocity[axis] - here.velocity[axis]).abs() < 1e-9, "step {step}: {there:?} {here:?}");
        }
        assert!(after.end() <= 40.0 + 1e-9, "the deadline is the flight's");
        let assessed = assess(&job.scenario, &plan, "the new plan").expect("it fits");
        let tail = assess(&job.scenario, &job.tail, "the tail").expect("it fits");
        assert!(assessed.feasible, "{:?}", assessed.worst);
        assert!(tail.feasible, "flying on is a plan: {:?}", tail.worst);
        assert!(assessed.objective <= tail.objective + 1e-9, "no worse than flying on");
        if step == 1 {
            assert!(assessed.objective < 0.95 * tail.objective, "{} {}", assessed.objective, tail.objective);
        }
        flying = plan;
    }
    assert!(rest(9, &world, &flying, 39.0).is_none());
}

#[test]
fn plans_that_follow_each_other_within_an_interval_keep_its_length() {
    let (world, first) = begin();
    let end = first.duration;
    let mut flying = first;
    for number in 1..=80 {
        let seam = 0.15 * number as f64;
        let job = rest_at(number, &world, &flying, seam).expect("enough is left");
        let share = (end - seam) / end;
        assert_eq!(job.scenario.intervals, (20.0 * share) as usize, "at {seam:.2} s");
        flying = job.tail;
    }
}

#[test]
fn a_worker_answers_while_others_go_on_and_a_late_answer_does_not_fly() {
    let (world, flying) = begin();
    let job = job(&world, &flying, 10.0);
    let worker = Worker::start(Duration::from_secs(60)).expect("a thread");
    assert!(worker.answer().is_none());
    assert!(worker.submit(job.clone()));
    let begin = Instant::now();
    let answer = loop {
        if let Some(answer) = worker.answer() {
            break answer;
        }
        assert!(begin.elapsed() < Duration::from_secs(60));
        std::thread::sleep(Duration::from_millis(5));
    };
    let curve = Curve::of(&flying, "uav1").expect("a curve");
    assert!(judge(&job, &answer, job.seam - 0.1, &curve).is_ok());
    assert_eq!(judge(&job, &answer, job.seam + 0.1, &curve), Err(Rejected::Late));
}

#[test]
fn budgets_of_the_rest_are_what_is_left() {
    let text = SCENARIO.replace("accel_max = 0.5", "accel_max = 0.5\njammer = { budget = 30.0 }");
    let world = ScenarioFile::parse("s.toml", &text).expect("a scenario").scenario;
    let (_, mut flying) = begin();
    let interval = flying.duration / 20.0;
    flying.agents[0].jam = Some((0..=20).map(|node| if node <= 4 { 1.0 } else { 0.25 }).collect());
    let job = job(&world, &flying, 5.9 * interval);
    let left = job.scenario.agents[0].jammer.expect("a jammer").budget;
    assert!((left - (30.0 - 4.5 * interval)).abs() < 1e-9, "{left}");
    assert_eq!(job.tail.agents[0].jam.as_deref().map(|jam| jam[1]), Some(0.25));
}

#[test]
fn memory_that_is_kept_holds_nothing_of_earlier_plans() {
    let (mut world, flying) = begin();
    let mut memory = Memory::default();
    for (seam, place) in [(8.0, 18.0), (15.0, 6.0), (8.0, 11.0)] {
        let seen = format!("{{\"id\": \"s1\", \"position\": [14.0, {place}]}}");
        Observation::parse(&seen).expect("read").apply(&mut world, 0.0, 1.0).expect("applied");
        let job = job(&world, &flying, seam);
        let (mut kept, _) = carry_out(&job, Duration::from_secs(60), &mut memory).expect("a plan");
        let Ok((mut fresh, _)) = answer(&job).result else { panic!("a plan") };
        (kept.timing, fresh.timing) = (None, None);
        assert_eq!(kept, fresh);
    }
}
