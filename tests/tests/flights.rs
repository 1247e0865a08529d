//! Whole flights over loopback UDP against the simulated autopilot, of both kinds and in both modes, planned anew at each
//! step while the mobile sensor is reported live.
//!
//! The scenario is wight-jam in a tenth of its space and a fiftieth of its time: 6 m/s over 1 km, as a small multicopter
//! flies. Its planning problem is the same in other units.

use std::time::Duration;

use quietpath_bridge::file::plan::AgentPlan;
use quietpath_bridge::file::{PlanFile, ScenarioFile};
use quietpath_bridge::flight::settings::{PayloadEntry, PayloadKind, Replanning};
use quietpath_bridge::flight::{self, End, FlyMode};
use quietpath_bridge::frame::LocalFrame;
use quietpath_bridge::link::memory::Faults;
use quietpath_bridge::planning::{Options, assess, plan};
use quietpath_bridge::replan::job::step_value;
use quietpath_bridge::telemetry::Autopilot;
use quietpath_sim::autopilot::payload::{Kind, Spec};
use quietpath_sim::autopilot::trouble::Trouble;
use quietpath_sim::autopilot::{Pilot, Settings};
use quietpath_sim::rehearsal::{self, Event, Hop, Rehearsal, Setup};

const WIGHT_JAM: &str = include_str!("../../sim/scenarios/wight-jam.toml");
/// Component of the jammer.
const JAMMER: u8 = 26;
/// Time between two reports of the mobile sensor, s.
const REPORTS: f64 = 0.5;
/// Longest that a flight may take, s.
const LONGEST: f64 = 900.0;

fn swift() -> ScenarioFile {
    let changes = [
        ("unit_m = 1000.0", "unit_m = 100.0"),
        ("max = 14000.0\n", "max = 280.0\n"),
        ("target = 11076.0", "target = 221.52"),
        ("penalty = 0.01", "penalty = 0.5"),
        ("speed_max = 0.0012", "speed_max = 0.06"),
        ("accel_max = 1e-05", "accel_max = 0.025"),
        ("budget = 1500.0", "budget = 30.0, live = true"),
        ("t = 4000.0", "t = 80.0"),
        ("t = 9000.0", "t = 180.0"),
        ("t = 14000.0", "t = 280.0"),
    ];
    let mut text = WIGHT_JAM.to_owned();
    for (from, to) in changes {
        assert_eq!(text.matches(from).count(), 1, "{from}");
        text = text.replace(from, to);
    }
    ScenarioFile::parse("wight-jam-swift.toml", &text).expect("a scenario").scenario
}

/// What was seen of a flight.
#[derive(Default)]
struct Flown {
    /// Scenario time, position, jamming level of the payload, at every step of the clock.
    track: Vec<(f64, Vec<f64>, f32)>,
    /// The plans that flew, each from its own begin on.
    plans: Vec<PlanFile>,
    /// In mission mode: scenario time at which the vehicle began to fly to a node.
    said: Vec<String>,
    end: Option<End>,
}

fn setup(truth: &ScenarioFile, first: &PlanFile, kind: Autopilot, mode: FlyMode) -> Setup {
    let mut vehicle = Settings::for_agent(kind, truth, None).expect("it lies on the Earth");
    vehicle.pilot = match mode {
        FlyMode::Guided => Pilot::TakesOff(vehicle.start_height(truth, None).expect("a start")),
        FlyMode::Mission => Pilot::StartsMission,
    };
    vehicle.payloads = vec![Spec { kind: Kind::Jammer, component: JAMMER, instance: 0 }];
    let jammer = PayloadEntry { kind: PayloadKind::Jammer, component: JAMMER, instance: 0, mission_output: None };
    // 18 steps of five intervals.
    let interval_s = truth.time.max / 18.0;
    let replan = Replanning { interval_s, lead_s: 3.0, deadline_s: 2.0, time_to_live_s: 60.0, sigma_max: 10.0 };
    let settings = flight::Settings {
        mode,
        replan: Some(replan),
        payload: vec![jammer],
        jammer_armed: true,
        ..flight::Settings::default()
    };
    let known = rehearsal::revealed(truth, truth.start_time);
    Setup { hop: Hop::loopback().expect("sockets"), ..Setup::new(known, first.clone(), settings, vehicle) }
}

fn fly(truth: &ScenarioFile, setup: Setup) -> Flown {
    let frame = LocalFrame::of(truth).expect("it lies on the Earth");
    let mut flown = Flown { plans: vec![setup.plan.clone()], ..Flown::default() };
    let mut flight = Rehearsal::new(setup).expect("a flight");
    let mut reported = f64::NEG_INFINITY;
    while flight.end().is_none() {
        for event in flight.step().expect("loopback carries") {
            match event {
                Event::Said(_, text) => flown.said.push(format!("{:.2} {text}", flight.now().seconds())),
                Event::Planned(answer) => {
                    let (plan, feasible) = answer.result.expect("a plan");
                    assert!(feasible, "plan {}", answer.number);
                    flown.plans.push(plan);
                }
                Event::Ended(_) => {}
            }
        }
        assert!(flight.now().seconds() < LONGEST, "{:#?}", flown.said);
        assert_eq!(flight.machine().killed(), None);
        let Some(time) = flight.scenario_time() else { continue };
        if time - reported >= REPORTS {
            reported = time;
            rehearsal::seen(truth, time).into_iter().for_each(|seen| flight.observe(seen));
        }
        let position = frame.position(&flight.machine().place()).expect("a position");
        let level = flight.machine().payload(JAMMER).expect("on board").level();
        flown.track.push((time, position, level));
    }
    flown.end = flight.end().cloned();
    flown
}

/// The plan that is meant to fly at a time: the last one that has begun.
fn plan_at(flown: &Flown, time: f64) -> &PlanFile {
    flown.plans.iter().rev().find(|plan| plan.start_time <= time).unwrap_or(&flown.plans[0])
}

fn agent(plan: &PlanFile) -> &AgentPlan {
    plan.agents.first().expect("an agent")
}

#[test]
fn look() {
    let truth = swift();
    let known = rehearsal::revealed(&truth, 0.0);
    let first = plan(&known, &Options::default()).expect("a plan");
    println!("{:?} {:?}", first.status, first.plan.duration);
    for kind in [Autopilot::Px4, Autopilot::ArduPilot] {
        for mode in [FlyMode::Guided, FlyMode::Mission] {
            let begin = std::time::Instant::now();
            let flown = fly(&truth, setup(&truth, &first.plan, kind, mode));
            println!("{kind:?} {mode:?} {:?} plans {} last {:?} {:?}", flown.end, flown.plans.len(), flown.track.last(), begin.elapsed());
            println!("{:#?}", flown.said);
            let mut worst = 0.0_f64;
            let limits = &truth.agents[0];
            for pair in flown.track.windows(2) {
                let speed = pair[0].1.iter().zip(&pair[1].1).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt() / (pair[1].0 - pair[0].0);
                worst = worst.max(speed / limits.speed_max);
            }
            println!("speed {worst}");
            let mut off = 0;
            let mut streak = 0.0_f64; let mut longest = 0.0_f64;
            for (time, _, level) in &flown.track {
                let plan = plan_at(&flown, *time);
                let agent = agent(plan);
                let expected = step_value(&plan.node_times(), agent.jam.as_deref().unwrap_or(&[0.0]), *time) as f32;
                if (expected - level).abs() > 1e-3 { off += 1; streak += 0.01; longest = longest.max(streak); } else { streak = 0.0; }
            }
            println!("jam off {off} of {}, longest {longest}", flown.track.len());
        }
    }
    let _ = (Duration::ZERO, Faults::NONE, Trouble::Restart { at: quietpath_bridge::clock::Time::ZERO }, assess(&truth, &first.plan, "a").is_ok());
}
