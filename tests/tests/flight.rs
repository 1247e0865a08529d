//! Flights against a stand-in for a vehicle, under a clock of the test's own.

mod world;

use quietpath_bridge::clock::Time;
use quietpath_bridge::file::ScenarioFile;
use quietpath_bridge::flight::settings::{FlyMode, MissionOutput, PayloadEntry, PayloadKind, Replanning};
use quietpath_bridge::flight::{End, Flight, Input, OnFailure, Settings};
use quietpath_bridge::frame::LocalFrame;
use quietpath_bridge::link::dialect::*;
use quietpath_bridge::link::{Frame, Identity};
use quietpath_bridge::mission::{Item, List};
use quietpath_bridge::record::{Beginning, Recorder, replay};
use quietpath_bridge::replan::{Answer, Observation};
use quietpath_bridge::telemetry::{Autopilot, Mode};
use quietpath_sim::autopilot::storage::ack;

use world::{SCENARIO, World, plan, scenario, settings};

const KINDS: [Autopilot; 2] = [Autopilot::Px4, Autopilot::ArduPilot];

#[test]
fn a_guided_flight_streams_before_it_asks_and_follows_the_plan_to_its_end() {
    for kind in KINDS {
        let mut world = World::new(kind, settings(FlyMode::Guided));
        world.begin(FlyMode::Guided);
        let begin = world.now;
        assert_eq!(world.missions.lists[1].len(), 1, "the region is a fence");
        let first = &world.setpoints[0].1;
        assert_eq!((first.type_mask.bits(), first.alt), (3576, 40.0));
        world.pass(10.0);
        let (at, data) = world.setpoints.last().expect("setpoints").clone();
        let time = (at - begin) as f64 * 1e-3;
        let expected = LocalFrame::of(&scenario()).expect("located").place(&[1.0 + 0.45 * time, 1.0]);
        assert!((f64::from(data.lon_int) * 1e-7 - expected.longitude_deg).abs() < 3e-6, "{data:?}");
        assert_eq!(data.type_mask.bits(), 3072);
        assert!((data.vy - 4.5).abs() < 1e-4 && data.vx.abs() < 1e-4 && data.vz == 0.0, "{data:?}");
        let rate = world.setpoints.iter().filter(|(at, _)| *at > world.now - 1000).count();
        assert!((10..=20).contains(&rate), "{rate} setpoints in a second");
        world.pass(27.0);
        assert_eq!((world.level, world.power), (Some(0.0), Some(0.0)), "silent in the last quarter");
        world.pass(10.0);
        assert_eq!(world.end, None, "it is not at the goal");
        world.position = vec![19.0, 1.0];
        world.pass(1.0);
        assert_eq!(world.end, Some(End::Done));
        assert_eq!((world.level, world.power), (Some(0.0), Some(1.0)));
    }
}

#[test]
fn a_mission_is_delivered_flown_and_scheduled_by_its_items() {
    for kind in KINDS {
        let mut world = World::new(kind, settings(FlyMode::Mission));
        world.begin(FlyMode::Mission);
        let home = usize::from(kind == Autopilot::ArduPilot);
        let items = world.missions.lists[0].clone();
        assert_eq!(items.len(), home + 1 + 1 + 21, "take-off, one speed, nodes");
        assert!(world.setpoints.is_empty());
        world.pass(3.0);
        assert_eq!(world.level, Some(0.0));
        // The waypoint of node 10: home, take-off, node 0, speed, nodes 1 to 10.
        world.current = Some((home + 2 + 10) as u16);
        world.pass(1.0);
        assert_eq!(world.level, Some(0.5), "{:?}", world.said);
        world.current = Some((items.len() - 1) as u16);
        world.pass(1.0);
        assert_eq!((world.level, world.power), (Some(0.0), Some(0.0)));
        world.position = vec![19.0, 1.0];
        world.pass(1.0);
        assert_eq!(world.end, Some(End::Done));
    }
}

#[test]
fn a_payload_on_an_output_is_switched_by_the_mission_and_off_at_the_end() {
    let output = MissionOutput { output: 9, off: 1000.0, full: 2000.0 };
    let entry = PayloadEntry { kind: PayloadKind::Jammer, component: 26, instance: 0, mission_output: Some(output) };
    let settings = Settings { payload: vec![entry], ..settings(FlyMode::Mission) };
    let mut world = World::new(Autopilot::ArduPilot, settings);
    world.begin(FlyMode::Mission);
    let servo = |item: &&Item| item.command == MavCmd::MAV_CMD_DO_SET_SERVO;
    let set: Vec<f32> = world.missions.lists[0].iter().filter(servo).map(|item| item.params[1]).collect();
    assert_eq!(set, [1500.0, 1000.0]);
    // The waypoint of node 10 is one further down: the jammer was switched on before node 5.
    world.current = Some(1 + 2 + 10 + 1);
    world.pass(1.0);
    assert_eq!((world.level, world.servo), (Some(0.5), None), "{:?}", world.said);
    world.mode(Mode::Hold);
    world.pass(1.0);
    assert_eq!((world.level, world.servo), (Some(0.0), Some(1000.0)), "a person took over");
}

/// Every way in which jamming must end, each from the middle of a flight that jams.
#[test]
fn level_0_whatever_happens() {
    type Spoil = fn(&mut World);
    let spoils: [(&str, Spoil); 7] = [
        ("link loss", |world| world.silent = true),
        ("disarm", |world| world.armed = false),
        ("landing", |world| world.landed = MavLandedState::MAV_LANDED_STATE_LANDING),
        ("on the ground", |world| world.landed = MavLandedState::MAV_LANDED_STATE_ON_GROUND),
        ("another mode", |world| world.mode(Mode::Hold)),
        ("return", |world| world.mode(Mode::Return)),
        ("signal", |world| world.input(Input::Stop("SIGTERM".into()))),
    ];
    for kind in KINDS {
        for (name, spoil) in spoils {
            let mut world = World::jamming(kind, settings(FlyMode::Guided));
            spoil(&mut world);
            world.pass(3.3);
            assert_eq!((world.level, world.power), (Some(0.0), Some(1.0)), "{kind:?}: {name}");
            let ended = world.end.is_some();
            assert_eq!(ended, name != "link loss", "{name}: {:?}", world.end);
        }
    }
}

#[test]
fn nothing_is_emitted_on_the_way_to_the_plan_nor_on_the_way_out() {
    let mut loud = plan();
    loud.agents[0].jam = Some(vec![1.0; 21]);
    let mut world = World::new(Autopilot::Px4, settings(FlyMode::Guided));
    world.flight = Flight::new(&scenario(), &loud, settings(FlyMode::Guided)).expect("a flight");
    world.pass(5.0);
    (world.armed, world.landed) = (true, MavLandedState::MAV_LANDED_STATE_IN_AIR);
    world.pass(5.0);
    assert_eq!((world.flight.phase(), world.flight.vehicle().expect("heard").mode), ("approach", Mode::Guided));
    assert_eq!(world.level, Some(0.0), "not at the start yet");
    world.position = vec![1.0, 1.0];
    world.pass(1.0);
    assert_eq!((world.flight.phase(), world.level), ("fly", Some(1.0)));
    world.refuses_modes = true;
    world.input(Input::Stop("enough".into()));
    world.pass(0.1);
    assert_eq!((world.flight.phase(), world.level), ("leave", Some(0.0)));
}

#[test]
fn silence_is_at_hand_for_a_panic() {
    let mut world = World::jamming(Autopilot::Px4, settings(FlyMode::Guided));
    let silence = world.flight.silence();
    let levels: Vec<f32> = (silence.iter())
        .filter_map(|message| match message {
            MavMessage::COMMAND_LONG(data) if data.command == MavCmd::MAV_CMD_USER_2 => Some(data.param2),
            _ => None,
        })
        .collect();
    assert_eq!(levels, [0.0]);
}

#[test]
fn a_vehicle_that_does_not_get_on_does_not_jam_for_ever() {
    let mut world = World::new(Autopilot::Px4, settings(FlyMode::Mission));
    world.begin(FlyMode::Mission);
    world.current = Some(2 + 10);
    world.pass(41.0);
    assert_eq!(world.level, Some(0.5), "20 s at full power are 40 s at half of it");
    world.pass(2.0);
    assert_eq!((world.flight.phase(), world.level), ("fly", Some(0.0)));
}

#[test]
fn jamming_needs_the_switch_and_the_scenario() {
    for (armed, live) in [(false, true), (true, false), (false, false)] {
        let text = SCENARIO.replace("live = true", &format!("live = {live}"));
        let scenario = ScenarioFile::parse("line.toml", &text).expect("a scenario").scenario;
        let settings = Settings { jammer_armed: armed, ..settings(FlyMode::Guided) };
        let mut world = World::new(Autopilot::Px4, settings.clone());
        world.flight = Flight::new(&scenario, &plan(), settings).expect("a flight");
        world.begin(FlyMode::Guided);
        world.position = vec![19.0, 1.0];
        world.pass(45.0);
        assert_eq!((world.level, world.power), (None, Some(1.0)), "armed {armed}, live {live}");
        assert_eq!(world.end, Some(End::Done));
    }
}

fn replanning(mode: FlyMode) -> Settings {
    let replan = Replanning {
        interval_s: 5.0,
        lead_s: 2.0,
        deadline_s: 1.0,
        time_to_live_s: 12.0,
        sigma_max: 1.0,
        prompt_lead_s: None,
    };
    Settings { replan: Some(replan), ..settings(mode) }
}

/// Answers the last job with a plan that bends north by `bend` in the middle.
fn answer(world: &World, bend: f64) -> Answer {
    let job = world.jobs.last().expect("a job");
    let mut plan = job.tail.clone();
    let last = plan.agents[0].path.len() - 1;
    for (node, position) in plan.agents[0].path.iter_mut().enumerate() {
        let share = node as f64 / last as f64;
        position[1] += bend * (share * (1.0 - share)).powi(2);
    }
    Answer { number: job.number, result: Ok((plan, true)) }
}

#[test]
fn a_new_plan_takes_over_at_its_seam_without_a_jump() {
    let mut world = World::new(Autopilot::Px4, replanning(FlyMode::Guided));
    world.begin(FlyMode::Guided);
    world.pass(5.0);
    assert_eq!(world.jobs.len(), 1, "{:?}", world.said);
    let reply = answer(&world, 8.0);
    world.input(Input::Planned(reply));
    let from = world.setpoints.len();
    world.pass(9.0);
    let flown: Vec<_> = world.setpoints[from..].iter().map(|(_, data)| (data.lat_int, data.lon_int)).collect();
    let jumps = flown.windows(2).map(|pair| (pair[1].0 - pair[0].0).abs().max((pair[1].1 - pair[0].1).abs()));
    // 4.5 m/s at 16 setpoints a second: 0.3 m, 40 units of 1e-7 degrees of longitude.
    assert!(jumps.max().expect("setpoints") < 60, "{:?}", world.said);
    let north = flown.iter().map(|(lat, _)| lat).max().expect("setpoints") - flown[0].0;
    assert!(north > 100, "the new plan is flown: {north}");
}

#[test]
fn an_observation_asks_for_a_plan_at_once_where_it_may() {
    for prompt_lead_s in [None, Some(0.25)] {
        let mut settings = replanning(FlyMode::Guided);
        settings.replan = settings.replan.map(|replan| Replanning { prompt_lead_s, ..replan });
        let mut world = World::new(Autopilot::Px4, settings);
        world.begin(FlyMode::Guided);
        world.pass(1.0);
        assert_eq!(world.jobs.len(), 0);
        let seen = Observation::parse("{\"id\": \"s1\", \"position\": [9.5, 5.5]}").expect("an observation");
        world.input(Input::Observed(seen));
        assert_eq!(world.jobs.len(), usize::from(prompt_lead_s.is_some()));
        let Some(job) = world.jobs.last() else { continue };
        assert!((job.seam - 1.25).abs() < 0.05, "between two nodes: {}", job.seam);
        let reply = answer(&world, 8.0);
        world.input(Input::Planned(reply));
        let before = world.setpoints.len();
        world.pass(0.3);
        assert!(world.said.iter().any(|text| text.contains("the plan of 1.2 s flies")), "{:?}", world.said);
        assert!(world.setpoints.len() > before);
    }
}

#[test]
fn a_goal_that_is_not_reached_is_a_failure() {
    let mut world = World::new(Autopilot::Px4, settings(FlyMode::Guided));
    world.begin(FlyMode::Guided);
    world.pass(75.0);
    assert!(
        matches!(&world.end, Some(End::Failed(why)) if why.contains("did not come to the goal")),
        "{:?}",
        world.end
    );
}

#[test]
fn a_vehicle_that_began_anew_is_asked_again() {
    let mut world = World::new(Autopilot::ArduPilot, settings(FlyMode::Guided));
    world.begin(FlyMode::Guided);
    world.mute = true;
    world.pass(3.0);
    assert!(world.said.iter().any(|text| text.contains("asking again")), "{:?}", world.said);
    assert_eq!(world.flight.phase(), "fly");
}

#[test]
fn a_plan_that_is_late_infeasible_not_finite_stale_or_elsewhere_never_flies() {
    type Spoil = fn(&mut Answer, &mut World);
    let spoils: [(&str, Spoil); 6] = [
        ("after the time at which", |_, world| world.pass(4.5)),
        ("breaks a constraint", |answer, _| answer.result.as_mut().expect("a plan").1 = false),
        ("not finite", |answer, _| answer.result.as_mut().expect("a plan").0.agents[0].path[3][1] = f64::NAN),
        ("not finite", |answer, _| answer.result.as_mut().expect("a plan").0.duration = f64::INFINITY),
        ("does not begin where", |answer, _| {
            answer.result.as_mut().expect("a plan").0.agents[0].path[0][1] += 1.0;
        }),
        ("failed: why", |answer, _| answer.result = Err("why".into())),
    ];
    for (says, spoil) in spoils {
        let mut world = World::new(Autopilot::Px4, replanning(FlyMode::Guided));
        world.begin(FlyMode::Guided);
        world.pass(5.0);
        let mut reply = answer(&world, 8.0);
        spoil(&mut reply, &mut world);
        world.input(Input::Planned(reply));
        assert!(world.said.iter().any(|text| text.contains(says)), "{says}: {:?}", world.said);
        world.pass(2.2);
        let (_, data) = world.setpoints.last().expect("setpoints");
        assert!(data.vx.abs() < 1e-3 && data.vy > 4.0, "the plan before flies on: {data:?}");
    }
    let mut world = World::new(Autopilot::Px4, replanning(FlyMode::Guided));
    world.begin(FlyMode::Guided);
    world.pass(5.0);
    let stale = Answer { number: 99, ..answer(&world, 8.0) };
    world.input(Input::Planned(stale));
    let good = answer(&world, 8.0);
    world.input(Input::Planned(good));
    world.pass(8.0);
    assert!(world.said.iter().any(|text| text.contains("flies")), "{:?}", world.said);
}

#[test]
fn a_stalled_planner_means_level_0_then_no_setpoint_beyond_the_time_to_live() {
    for (policy, mode) in
        [(OnFailure::Hold, Mode::Hold), (OnFailure::Return, Mode::Return), (OnFailure::Continue, Mode::Hold)]
    {
        let settings = Settings { on_failure: policy, ..replanning(FlyMode::Guided) };
        let mut world = World::new(Autopilot::ArduPilot, settings);
        world.begin(FlyMode::Guided);
        let begin = world.now;
        // It jams from 8 s on; asked at 5 s, the planner is stalled from 7 s on.
        world.pass(9.5);
        assert_eq!(world.level, Some(0.0), "stalled");
        world.pass(5.0);
        let mut wanted = World::new(Autopilot::ArduPilot, Settings::default());
        wanted.mode(mode);
        assert_eq!(world.custom_mode, wanted.custom_mode, "{policy:?}");
        assert!(matches!(&world.end, Some(End::Failed(why)) if why.contains("time to live")), "{:?}", world.end);
        let along = world.setpoints.iter().filter(|(_, data)| data.type_mask.bits() == 3072);
        let last = along.map(|(at, _)| *at).max().expect("setpoints");
        assert!(last <= begin + 12_100, "{last} {begin}");
    }
}

#[test]
fn the_rest_of_a_mission_is_replaced_and_its_first_item_said() {
    for kind in KINDS {
        let mut world = World::new(kind, replanning(FlyMode::Mission));
        world.begin(FlyMode::Mission);
        let home = u16::from(kind == Autopilot::ArduPilot);
        world.current = Some(home + 2 + 3);
        world.pass(1.0);
        let before = world.missions.lists[0].len();
        for _ in 0..40 {
            world.pass(0.1);
            if !world.jobs.is_empty() {
                break;
            }
        }
        // The clock waits at node 3, 6 s into the plan: past the interval.
        assert_eq!(world.jobs.len(), 1, "{:?}", world.said);
        let reply = answer(&world, 8.0);
        world.input(Input::Planned(reply));
        world.pass(2.0);
        let after = world.missions.lists[0].clone();
        assert!(after.len() < before, "{:?}", world.said);
        assert!(after.iter().all(|item| item.command != MavCmd::MAV_CMD_NAV_TAKEOFF));
        assert_eq!(world.current, Some(home), "{:?}", world.said);
        assert_eq!(world.flight.phase(), "fly");
    }
}

#[test]
fn another_stations_mission_ends_ours() {
    let mut world = World::new(Autopilot::Px4, settings(FlyMode::Mission));
    world.begin(FlyMode::Mission);
    let current = |mission_id| MISSION_CURRENT_DATA { seq: 1, mission_id, ..Default::default() };
    world.frame(MavMessage::MISSION_CURRENT(current(4711)));
    world.pass(2.0);
    assert_eq!(world.end, None, "another id, and the mission is ours all the same");
    world.missions.lists[0].pop();
    world.frame(MavMessage::MISSION_CURRENT(current(4712)));
    world.pass(2.0);
    assert!(matches!(&world.end, Some(End::Released(why)) if why.contains("another station")), "{:?}", world.end);
}

#[test]
fn an_overheard_acceptance_is_looked_into() {
    for replaced in [false, true] {
        let mut world = World::new(Autopilot::ArduPilot, settings(FlyMode::Mission));
        world.begin(FlyMode::Mission);
        if replaced {
            world.missions.lists[0][5].x += 5000;
        }
        let station = Identity { system: 255, component: 190 };
        world.frame(ack(station, List::Mission.mission_type(), MavMissionResult::MAV_MISSION_ACCEPTED, 0));
        world.pass(3.0);
        let released = matches!(&world.end, Some(End::Released(why)) if why.contains("another station"));
        assert_eq!(released, replaced, "{:?} {:?}", world.end, world.said);
    }
}

#[test]
fn guided_needs_a_mode_that_the_autopilot_grants() {
    let mut world = World::new(Autopilot::Px4, settings(FlyMode::Guided));
    world.refuses_modes = true;
    world.pass(5.0);
    (world.armed, world.landed) = (true, MavLandedState::MAV_LANDED_STATE_IN_AIR);
    world.position = vec![1.0, 1.0];
    world.pass(20.0);
    assert_eq!(world.flight.phase(), "approach");
    assert_eq!(world.level, Some(0.0));
}

#[test]
fn a_recorded_flight_replays_bit_for_bit_and_a_changed_one_does_not() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("flight.jsonl");
    let settings = replanning(FlyMode::Guided);
    let mut world = World::new(Autopilot::Px4, settings.clone());
    let (scenario, plan) = (scenario(), plan());
    let beginning = Beginning { scenario: &scenario, plan: &plan, settings: &settings, journal: None };
    let recorder = Recorder::create(&path, &beginning, Time::ZERO);
    world.recorder = Some(recorder.expect("a record"));
    world.begin(FlyMode::Guided);
    let seen = Observation::parse("{\"id\": \"s1\", \"position\": [9.5, 5.5]}").expect("an observation");
    world.input(Input::Observed(seen));
    world.pass(5.0);
    let reply = answer(&world, 8.0);
    world.input(Input::Planned(reply));
    world.pass(5.0);
    world.input(Input::LinkDown("pulled".into()));
    world.pass(3.0);
    world.input(Input::Stop("enough".into()));
    world.pass(5.0);
    assert_eq!(world.end, Some(End::Stopped("enough".into())));
    drop(world.recorder.take());
    let mut sent = 0;
    let replayed = replay(&path, |_, outputs| {
        sent += outputs.iter().filter(|output| output.starts_with("send ")).count();
    });
    let replayed = replayed.expect("the same again");
    assert!(replayed.inputs > 500 && replayed.outputs > sent && sent > 200, "{replayed:?} {sent}");
    // The tlog: a time of this century before every frame.
    let tlog = std::fs::read(path.with_extension("tlog")).expect("a tlog");
    let time = u64::from_be_bytes(tlog[..8].try_into().expect("8 bytes"));
    assert!((1.7e15..4e15).contains(&(time as f64)) && tlog[8] == 0xFD, "{time}");
    let text = std::fs::read_to_string(&path).expect("a record");
    let changed = text.replacen("9.5,5.5", "9.5,5.6", 1);
    assert_ne!(changed, text);
    std::fs::write(&path, changed).expect("written");
    let error = replay(&path, |_, _| {}).expect_err("another world, another plan");
    assert!(error.to_string().contains("came out differently"), "{error}");
    std::fs::write(&path, text.get(..text.len() - 30).expect("long")).expect("written");
    replay(&path, |_, _| {}).expect("cut off in the middle of a line");
    std::fs::write(&path, "{}").expect("written");
    let error = replay(&path, |_, _| {}).expect_err("no record").to_string();
    assert!(error.contains("is no record: missing field `quietpath_record`"), "{error}");
}

#[test]
fn a_vehicle_that_was_not_heard_does_not_chase_the_plan() {
    let mut world = World::new(Autopilot::ArduPilot, settings(FlyMode::Guided));
    world.begin(FlyMode::Guided);
    world.pass(5.0);
    world.silent = true;
    world.pass(4.0);
    let before = world.setpoints.len();
    world.pass(4.0);
    assert_eq!(world.setpoints.len(), before, "nothing is steered blindly");
    world.silent = false;
    world.pass(2.0);
    assert!(matches!(&world.end, Some(End::Failed(why)) if why.contains("not heard")), "{:?}", world.end);
    let along = world.setpoints[before..].iter().filter(|(_, data)| data.type_mask.bits() == 3072);
    assert_eq!(along.count(), 0);
}

/// The first thing that a bridge finds when its computer goes on is what the vehicle has said meanwhile.
#[test]
fn a_bridge_that_slept_does_not_chase_the_plan() {
    for seconds in [4, 3600] {
        let mut world = World::new(Autopilot::ArduPilot, settings(FlyMode::Guided));
        world.begin(FlyMode::Guided);
        world.pass(5.0);
        let before = world.setpoints.len();
        world.now += seconds * 1000;
        world.pass(2.0);
        assert!(matches!(&world.end, Some(End::Failed(why)) if why.contains("stood still")), "{:?}", world.end);
        let along = world.setpoints[before..].iter().filter(|(_, data)| data.type_mask.bits() == 3072);
        assert_eq!((along.count(), world.level), (0, Some(0.0)));
    }
}

#[test]
fn two_programs_never_fly_one_vehicle() {
    let heartbeat = quietpath_bridge::link::codec::companion_heartbeat();
    let say = |world: &mut World| {
        let frame = Frame { from: Identity::COMPANION, sequence: 0, message: heartbeat.clone(), bytes: Vec::new() };
        world.input(Input::Frame(Box::new(frame)));
    };
    let mut world = World::new(Autopilot::Px4, settings(FlyMode::Guided));
    world.pass(3.0);
    say(&mut world);
    world.pass(0.3);
    say(&mut world);
    assert_eq!(world.end, None, "the last words of a bridge that has died");
    world.pass(0.3);
    say(&mut world);
    assert!(matches!(&world.end, Some(End::Failed(why)) if why.contains("another program")), "{:?}", world.end);
    // One that flies goes on.
    let mut world = World::new(Autopilot::Px4, settings(FlyMode::Guided));
    world.begin(FlyMode::Guided);
    for _ in 0..5 {
        say(&mut world);
        world.pass(1.0);
    }
    assert_eq!((world.flight.phase(), &world.end), ("fly", &None));
    assert_eq!(world.said.iter().filter(|text| text.contains("another program")).count(), 1);
    // One that is steered already is left alone.
    let mut world = World::new(Autopilot::Px4, settings(FlyMode::Guided));
    world.armed = true;
    world.mode(Mode::Guided);
    world.pass(1.0);
    assert!(matches!(&world.end, Some(End::Failed(why)) if why.contains("steers")), "{:?}", world.end);
}

#[test]
fn a_running_mission_and_a_foreign_fence_are_left_alone() {
    let mut world = World::new(Autopilot::Px4, settings(FlyMode::Mission));
    (world.armed, world.missions.lists[0]) = (true, Vec::new());
    world.mode(Mode::Mission);
    world.pass(1.0);
    assert!(
        matches!(&world.end, Some(End::Failed(why)) if why.contains("flies a mission already")),
        "{:?}",
        world.end
    );
    let start = SCENARIO.find("[[region]]").expect("a region");
    let end = SCENARIO.find("[[objective.term]]").expect("an objective");
    let text = format!("{}{}", &SCENARIO[..start], &SCENARIO[end..]);
    let open = ScenarioFile::parse("open.toml", &text).expect("a scenario").scenario;
    let mut world = World::new(Autopilot::Px4, settings(FlyMode::Guided));
    world.flight = Flight::new(&open, &plan(), settings(FlyMode::Guided)).expect("a flight");
    let circle = MavCmd::MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION;
    let frame = MavFrame::MAV_FRAME_GLOBAL;
    world.missions.lists[1] =
        vec![Item { command: circle, frame, params: [9.0; 4], x: 1, y: 2, z: 0.0, autocontinue: true }];
    world.pass(3.0);
    assert_eq!((world.flight.phase(), world.missions.lists[1].len()), ("ready", 1));
}
