//! A bridge dies in flight: its record is readable to the last byte, and the next bridge goes on.

mod world;

use std::path::Path;

use quietpath_bridge::clock::Time;
use quietpath_bridge::flight::settings::{FlyMode, Replanning};
use quietpath_bridge::flight::{End, Flight, Journal, Settings};
use quietpath_bridge::mission::item::first_difference;
use quietpath_bridge::record::{Beginning, Ending, Recorder, replay};
use quietpath_bridge::replan::Answer;
use quietpath_bridge::telemetry::{Autopilot, Mode};
use world::{World, plan, scenario, settings};

const KINDS: [Autopilot; 2] = [Autopilot::Px4, Autopilot::ArduPilot];

/// The same vehicle with a new bridge, which has a clock of its own and is told what to do like the one before it.
fn restarted(mut world: World, settings: Settings) -> World {
    let flight = Flight::new(&scenario(), &plan(), settings).expect("a flight");
    let journal = world.journal.clone();
    world.flight = match journal {
        None => flight,
        // As it comes back from its file.
        Some(journal) => {
            let text = serde_json::to_string(&journal).expect("written");
            let journal: Journal = serde_json::from_str(&text).expect("read");
            flight.resuming(journal).expect("the same flight")
        }
    };
    world.now = 0;
    world.setpoints.clear();
    world.said.clear();
    world.end = None;
    world
}

#[test]
fn a_steered_flight_goes_on_from_where_the_vehicle_is_without_jamming() {
    for kind in KINDS {
        let world = World::jamming(kind, settings(FlyMode::Guided));
        let mut world = restarted(world, settings(FlyMode::Guided));
        // It has come to rest a little off the plan, in its middle.
        world.position = vec![10.1, 1.05];
        world.level = None;
        world.pass(4.0);
        assert_eq!((world.flight.phase(), &world.end), ("fly", &None), "{:?}", world.said);
        assert!(world.said.iter().any(|text| text.contains("the plan goes on")), "{:?}", world.said);
        let place = world.setpoints.first().expect("steered").1.lon_int;
        let start = world.setpoints.iter().map(|(_, data)| data.lon_int).min();
        assert_eq!(start, Some(place), "it never goes back");
        let expected = quietpath_bridge::frame::LocalFrame::of(&scenario()).expect("located").place(&[10.1, 1.0]);
        let off = f64::from(place) * 1e-7 - expected.longitude_deg;
        assert!(off.abs() < 1e-5, "{off} degrees from where the vehicle is");
        assert_eq!(world.level, Some(0.0), "the plan jams here, and a bridge that died does not");
        // Power is reduced in the last quarter, as planned.
        world.position = vec![19.0, 1.0];
        world.pass(12.0);
        assert_eq!(world.power, Some(0.0));
        world.pass(14.0);
        assert_eq!(world.end, Some(End::Done), "{:?}", world.said);
        assert_eq!(world.journal, None, "there is nothing to go on with any more");
    }
}

#[test]
fn a_mission_goes_on_and_is_neither_uploaded_nor_started_again() {
    for kind in KINDS {
        let mut world = World::new(kind, settings(FlyMode::Mission));
        world.begin(FlyMode::Mission);
        world.current = Some(8);
        world.pass(3.0);
        let held = world.missions.lists[0].clone();
        let mut world = restarted(world, settings(FlyMode::Mission));
        world.level = None;
        world.pass(6.0);
        assert_eq!((world.flight.phase(), &world.end), ("fly", &None), "{:?}", world.said);
        assert_eq!(first_difference(kind, true, &held, &world.missions.lists[0]), None);
        assert!(!world.said.iter().any(|text| text.contains("holds the mission")), "{:?}", world.said);
        assert_eq!(world.level, Some(0.0));
        // Somebody else's mission is not gone on with.
        let mut other = restarted(world, settings(FlyMode::Mission));
        other.missions.lists[0].pop();
        other.pass(6.0);
        assert_eq!(other.end, Some(End::Released("another station replaced the mission".into())), "{:?}", other.said);
    }
}

#[test]
fn without_a_journal_a_running_mission_is_left_alone_and_another_mode_too() {
    let mut world = World::new(Autopilot::Px4, settings(FlyMode::Mission));
    world.begin(FlyMode::Mission);
    let kept = world.journal.take();
    let mut world = restarted(world, settings(FlyMode::Mission));
    world.pass(3.0);
    assert!(
        matches!(&world.end, Some(End::Failed(why)) if why.contains("flies a mission already")),
        "{:?}",
        world.end
    );
    world.journal = kept;
    world.mode(Mode::Hold);
    let mut world = restarted(world, settings(FlyMode::Mission));
    world.pass(3.0);
    assert!(matches!(&world.end, Some(End::Released(why)) if why.contains("does not take the vehicle back")));
    assert_eq!(world.journal, None);
}

#[test]
fn on_the_ground_the_flight_begins_anew_and_another_flights_journal_is_refused() {
    let mut world = World::new(Autopilot::Px4, settings(FlyMode::Guided));
    world.begin(FlyMode::Guided);
    let journal = world.journal.clone().expect("it flies");
    world.armed = false;
    let mut world = restarted(world, settings(FlyMode::Guided));
    world.pass(6.0);
    assert_eq!(world.flight.phase(), "ready", "{:?}", world.said);
    let mut other = plan();
    other.agents[0].path[3][1] += 0.5;
    let flight = Flight::new(&scenario(), &other, settings(FlyMode::Guided)).expect("a flight");
    let why = flight.resuming(journal).err().expect("another plan");
    assert!(why.contains("another scenario, plan, agent or mode"), "{why}");
}

#[test]
fn a_vehicle_far_from_its_plan_is_not_pulled_back() {
    let mut world = World::new(Autopilot::Px4, settings(FlyMode::Guided));
    world.begin(FlyMode::Guided);
    world.position = vec![10.0, 9.0];
    let mut world = restarted(world, settings(FlyMode::Guided));
    world.pass(2.0);
    assert!(matches!(&world.end, Some(End::Failed(why)) if why.contains("not where the plan is")), "{:?}", world.end);
    // It is told to stay where it is.
    assert!(world.setpoints.iter().all(|(_, data)| data.vx == 0.0 && data.vy == 0.0), "{:?}", world.setpoints);
}

/// What was emitted under one plan is off the budget of every later one.
#[test]
fn budgets_count_over_all_plans_and_over_a_restart() {
    let replan = Some(Replanning { interval_s: 5.0, lead_s: 2.0, ..Replanning::default() });
    let settings = Settings { replan, ..settings(FlyMode::Guided) };
    let mut world = World::new(Autopilot::Px4, settings.clone());
    world.begin(FlyMode::Guided);
    let budget = |world: &World| world.jobs.last().and_then(|job| job.scenario.agents[0].jammer).map(|it| it.budget);
    let mut budgets = Vec::new();
    for number in 1..=4 {
        for _ in 0..100 {
            if world.jobs.len() == number {
                break;
            }
            world.pass(0.1);
        }
        let job = world.jobs.last().expect("a job").clone();
        budgets.push(budget(&world).expect("a jammer"));
        world.input(quietpath_bridge::flight::Input::Planned(Answer {
            number: job.number,
            result: Ok((job.tail, true)),
        }));
        world.pass(3.0);
    }
    // The plan jams with 0.5 from node 5 to node 14, 2 s each, of a budget of 20 s.
    let jammed = |seam: f64| 0.5 * (seam - 8.0).clamp(0.0, 20.0);
    let expected: Vec<f64> = world.jobs.iter().map(|job| 20.0 - jammed(job.seam)).collect();
    for (found, expected) in budgets.iter().zip(&expected) {
        assert!((found - expected).abs() < 1e-9, "{budgets:?}, not {expected:?}");
    }
    assert!(expected[3] < expected[2] && expected[2] < 20.0, "{expected:?}");
    // A new bridge goes on with what is left.
    let at = world.flight.vehicle().and_then(|vehicle| vehicle.fix).expect("a place");
    assert!(at.above_home_m > 1.0);
    let jobs = world.jobs.len();
    let mut world = restarted(world, settings);
    for _ in 0..100 {
        if world.jobs.len() > jobs || world.end.is_some() {
            break;
        }
        world.pass(0.1);
    }
    assert!(budget(&world).is_some_and(|left| left < expected[2]), "{:?} {:?}", budget(&world), world.said);
}

/// A short flight with its record.
fn recorded(folder: &Path) -> Vec<u8> {
    let path = folder.join("flight.jsonl");
    let settings = settings(FlyMode::Guided);
    let mut world = World::new(Autopilot::Px4, settings.clone());
    let (scenario, plan) = (scenario(), plan());
    let beginning = Beginning { scenario: &scenario, plan: &plan, settings: &settings, journal: None };
    world.recorder = Some(Recorder::create(&path, &beginning, Time::ZERO).expect("a record"));
    world.begin(FlyMode::Guided);
    world.pass(1.0);
    // Nothing is closed or flushed: the program is killed here.
    let bytes = std::fs::read(&path).expect("a record");
    assert!(bytes.ends_with(b"\n"), "a line that was written is there");
    bytes
}

#[test]
fn a_record_that_is_cut_off_anywhere_replays_as_far_as_it_goes() {
    let folder = tempfile::tempdir().expect("a folder");
    let bytes = recorded(folder.path());
    let mut whole = Vec::new();
    let path = folder.path().join("flight.jsonl");
    let all = replay(&path, |time, outputs| whole.push((time, outputs.to_vec()))).expect("a record");
    assert_eq!(all.ending, Ending::Whole);
    let header = bytes.iter().position(|byte| *byte == b'\n').expect("a first line");
    let cut_path = folder.path().join("cut.jsonl");
    // Every byte of the last lines, and places in all of it, those of the first line among them.
    let near_the_end = bytes.len().saturating_sub(600)..bytes.len();
    let anywhere = (0..60).map(|index| index * bytes.len() / 60);
    let mut refused = 0;
    for end in near_the_end.chain(anywhere).chain([header, header + 1]) {
        std::fs::write(&cut_path, &bytes[..end]).expect("written");
        let mut found = Vec::new();
        match replay(&cut_path, |time, outputs| found.push((time, outputs.to_vec()))) {
            Ok(replayed) => {
                assert!(whole.starts_with(&found), "cut at {end}");
                let lines = bytes[..end].iter().filter(|byte| **byte == b'\n').count();
                // A line without its end counts if it is whole.
                assert!(found.len() + 1 == lines || found.len() == lines, "cut at {end}: {} of {lines}", found.len());
                let is_whole = end == header || found.len() == lines || bytes[end - 1] == b'\n';
                assert_eq!(replayed.ending == Ending::Whole, is_whole, "cut at {end}: {replayed:?}");
            }
            Err(error) => {
                refused += 1;
                let error = error.to_string();
                assert!(end < header && error.contains("ends before the flight begins"), "cut at {end}: {error}");
            }
        }
    }
    assert!(refused > 0);
}

#[test]
fn a_record_is_never_written_over() {
    let folder = tempfile::tempdir().expect("a folder");
    let first = recorded(folder.path());
    let (scenario, plan, settings) = (scenario(), plan(), settings(FlyMode::Guided));
    let beginning = Beginning { scenario: &scenario, plan: &plan, settings: &settings, journal: None };
    let path = folder.path().join("flight.jsonl");
    for number in 2..4 {
        let again = Recorder::create(&path, &beginning, Time::ZERO).expect("a record beside it");
        assert_eq!(again.path(), folder.path().join(format!("flight-{number}.jsonl")));
        assert!(again.path().with_extension("tlog").exists());
    }
    assert_eq!(std::fs::read(&path).expect("still there"), first);
}

#[test]
fn a_flight_that_was_picked_up_replays_too() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("second.jsonl");
    let world = World::jamming(Autopilot::Px4, settings(FlyMode::Guided));
    let journal = world.journal.clone().expect("it flies");
    let mut world = restarted(world, settings(FlyMode::Guided));
    let (scenario, plan, settings) = (scenario(), plan(), settings(FlyMode::Guided));
    let beginning = Beginning { scenario: &scenario, plan: &plan, settings: &settings, journal: Some(&journal) };
    world.recorder = Some(Recorder::create(&path, &beginning, Time::ZERO).expect("a record"));
    world.position = vec![10.0, 1.0];
    world.pass(3.0);
    assert_eq!(world.flight.phase(), "fly", "{:?}", world.said);
    let replayed = replay(&path, |_, _| {}).expect("the same again");
    assert!(replayed.outputs > 50, "{replayed:?}");
}
