//! The simulated autopilot under a clock of the test's own: what each kind grants, refuses and does.

use std::time::Duration;

use quietpath_bridge::clock::Time;
use quietpath_bridge::link::dialect::*;
use quietpath_bridge::link::{Frame, Identity};
use quietpath_bridge::mission::{Item, List};
use quietpath_bridge::telemetry::{Airframe, Autopilot, Mode, mode_command};
use quietpath_sim::autopilot::payload::{Kind, Spec};
use quietpath_sim::autopilot::trouble::{STATION, Trouble, stay};
use quietpath_sim::autopilot::{Home, Landed, Machine, Pilot, Settings};

const KINDS: [Autopilot; 2] = [Autopilot::Px4, Autopilot::ArduPilot];
const HOME: Home = Home { latitude_deg: 47.4, longitude_deg: 8.5, altitude_m: 400.0 };
const US: Identity = Identity { system: 1, component: 191 };
const MASK_ALL: u16 = 3072;

/// A vehicle and who listens to it.
struct Bench {
    machine: Machine,
    now: u64,
    heard: Vec<(u64, u8, MavMessage)>,
}

impl Bench {
    fn new(settings: Settings) -> Self {
        Self { machine: Machine::new(settings), now: 0, heard: Vec::new() }
    }

    fn like(kind: Autopilot) -> Self {
        Self::new(Settings::new(kind, HOME))
    }

    /// In the air, 20 m above home.
    fn flying(kind: Autopilot) -> Self {
        let mut bench = Self::new(Settings { pilot: Pilot::TakesOff(20.0), ..Settings::new(kind, HOME) });
        bench.pass(20.0);
        assert_eq!((bench.machine.landed(), bench.machine.mode()), (Landed::Air, Mode::Hold), "{kind:?}");
        bench
    }

    fn say(&mut self, message: MavMessage) {
        let frame = Frame { from: US, sequence: 0, message, bytes: Vec::new() };
        self.machine.receive(Time::from_millis(self.now), &frame);
        self.tick();
    }

    fn tick(&mut self) {
        let sent = self.machine.tick(Time::from_millis(self.now));
        self.heard.extend(sent.into_iter().map(|sent| (self.now, sent.from.component, sent.message)));
    }

    fn pass(&mut self, seconds: f64) {
        let until = self.now + (seconds * 1e3) as u64;
        while self.now < until {
            self.now += 10;
            self.tick();
        }
    }

    /// Commands something by COMMAND_LONG; the answer.
    fn command(&mut self, component: u8, command: MavCmd, params: [f32; 7]) -> MavResult {
        let [param1, param2, param3, param4, param5, param6, param7] = params;
        self.ask(MavMessage::COMMAND_LONG(COMMAND_LONG_DATA {
            param1,
            param2,
            param3,
            param4,
            param5,
            param6,
            param7,
            command,
            target_system: 1,
            target_component: component,
            confirmation: 0,
        }))
    }

    fn ask(&mut self, message: MavMessage) -> MavResult {
        self.heard.clear();
        self.say(message);
        let ack = self.heard.iter().find_map(|(_, _, message)| match message {
            MavMessage::COMMAND_ACK(data) => Some(data),
            _ => None,
        });
        let ack = ack.expect("an answer");
        assert_eq!((ack.target_system, ack.target_component), (US.system, US.component));
        ack.result
    }

    fn mode(&mut self, mode: Mode) -> MavResult {
        let kind = self.machine.settings().like;
        let command = mode_command(kind, Airframe::Copter, mode).expect("a mode");
        self.command(1, command.command, command.params)
    }

    /// A setpoint: position east, north, up of home by its mask, velocity, acceleration to the north.
    fn setpoint(&mut self, mask: u16, position: [f64; 3], north: f32, acceleration: f32) {
        let place = self.machine.place();
        let east_m = 1e-7 * 111_319.5 * place.latitude_deg.to_radians().cos();
        let data = SET_POSITION_TARGET_GLOBAL_INT_DATA {
            lat_int: 474_000_000 + (position[1] / (1e-7 * 111_200.0)) as i32,
            lon_int: 85_000_000 + (position[0] / east_m) as i32,
            alt: position[2] as f32,
            vx: north,
            afx: acceleration,
            type_mask: PositionTargetTypemask::from_bits_retain(mask),
            target_system: 1,
            target_component: 1,
            coordinate_frame: MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT,
            ..Default::default()
        };
        self.say(MavMessage::SET_POSITION_TARGET_GLOBAL_INT(data));
    }

    fn heard(&self, matches: impl Fn(&MavMessage) -> bool) -> usize {
        self.heard.iter().filter(|(_, _, message)| matches(message)).count()
    }
}

#[test]
fn nothing_but_heartbeats_until_it_is_asked_for_and_ardupilots_first_one_has_no_component() {
    for kind in KINDS {
        let mut bench = Bench::like(kind);
        bench.pass(5.0);
        assert!(bench.heard.iter().all(|(_, _, message)| matches!(message, MavMessage::HEARTBEAT(_))), "{kind:?}");
        let components: Vec<u8> = bench.heard.iter().map(|(_, component, _)| *component).collect();
        let first = u8::from(kind == Autopilot::Px4);
        assert_eq!(components, [first, 1, 1, 1, 1], "{kind:?}");
        let interval = MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL;
        let accepted = MavResult::MAV_RESULT_ACCEPTED;
        assert_eq!(bench.command(1, interval, [33.0, 1e5, 0.0, 0.0, 0.0, 0.0, 0.0]), accepted);
        assert_eq!(bench.command(1, interval, [9999.0, 1e5, 0.0, 0.0, 0.0, 0.0, 0.0]), MavResult::MAV_RESULT_FAILED);
        bench.heard.clear();
        bench.pass(2.0);
        assert_eq!(bench.heard(|message| matches!(message, MavMessage::GLOBAL_POSITION_INT(_))), 20);
        bench.machine.restart();
        bench.pass(5.0);
        bench.heard.clear();
        bench.pass(2.0);
        assert_eq!(
            bench.heard(|message| matches!(message, MavMessage::GLOBAL_POSITION_INT(_))),
            0,
            "a restart forgets"
        );
    }
}

#[test]
fn guided_is_granted_and_ends_as_each_kind_has_it() {
    // PX4: no stream, no offboard; a stream that ends is left for hold.
    let mut px4 = Bench::flying(Autopilot::Px4);
    assert_eq!(px4.mode(Mode::Guided), MavResult::MAV_RESULT_DENIED);
    for _ in 0..10 {
        px4.setpoint(MASK_ALL, [0.0, 0.0, 20.0], 0.0, 0.0);
        px4.pass(0.1);
    }
    assert_eq!(px4.mode(Mode::Guided), MavResult::MAV_RESULT_ACCEPTED);
    px4.pass(0.8);
    assert_eq!(px4.machine.mode(), Mode::Guided);
    px4.pass(0.5);
    assert_eq!(px4.machine.mode(), Mode::Hold, "the stream ended");
    // ArduCopter: granted at once; a velocity ends after 3 s, and the mode stays.
    let mut copter = Bench::flying(Autopilot::ArduPilot);
    assert_eq!(copter.mode(Mode::Guided), MavResult::MAV_RESULT_ACCEPTED);
    copter.setpoint(3527, [0.0; 3], 3.0, 0.0);
    copter.pass(2.8);
    assert!((copter.machine.body().velocity[1] - 3.0).abs() < 0.1, "{:?}", copter.machine.body());
    copter.pass(3.0);
    assert!(copter.machine.body().velocity[1].abs() < 0.1 && copter.machine.mode() == Mode::Guided);
}

#[test]
fn what_a_setpoint_means_depends_on_its_mask() {
    for kind in KINDS {
        // Position alone; position and acceleration without velocity; a velocity with one axis ignored.
        for (mask, moves) in [(3576, true), (3128, kind == Autopilot::Px4), (3527 | 8, false), (3520 | 8, true)] {
            let mut bench = Bench::flying(kind);
            for _ in 0..40 {
                bench.setpoint(mask, [0.0, 30.0, 20.0], 0.0, 0.0);
                bench.pass(0.1);
                if bench.machine.mode() != Mode::Guided {
                    bench.mode(Mode::Guided);
                }
            }
            let north = bench.machine.body().position[1];
            assert_eq!(north > 5.0, moves, "{kind:?} {mask}: {north}");
        }
        let mut bench = Bench::flying(kind);
        bench.setpoint(3576, [0.0, 30.0, 20.0], f32::NAN, 0.0);
        assert_eq!(bench.machine.killed(), None, "a number in a field that is ignored");
        bench.setpoint(MASK_ALL, [0.0, 30.0, 20.0], f32::NAN, 0.0);
        assert!(bench.machine.killed().is_some(), "a number in a field in use");
        bench.heard.clear();
        bench.pass(3.0);
        assert!(bench.heard.is_empty(), "its process is gone");
    }
}

#[test]
fn commands_have_the_answers_of_their_kind() {
    let accepted = MavResult::MAV_RESULT_ACCEPTED;
    for kind in KINDS {
        let is_px4 = kind == Autopilot::Px4;
        let mut bench = Bench::flying(kind);
        let (servo, actuator) = (MavCmd::MAV_CMD_DO_SET_SERVO, MavCmd::MAV_CMD_DO_SET_ACTUATOR);
        let unsupported = MavResult::MAV_RESULT_UNSUPPORTED;
        let nan = f32::NAN;
        let expected = if is_px4 { [unsupported, accepted] } else { [accepted, unsupported] };
        let one = bench.command(1, servo, [9.0, 1500.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        let other = bench.command(1, actuator, [nan, 0.5, nan, nan, nan, nan, 0.0]);
        assert_eq!([one, other], expected, "{kind:?}");
        assert_eq!(
            (bench.machine.output(9), bench.machine.output(2)),
            if is_px4 { (None, Some(0.5)) } else { (Some(1500.0), None) }
        );
        let reposition = bench.command(1, MavCmd::MAV_CMD_DO_REPOSITION, [0.0, 0.0, 0.0, 0.0, 47.4, 8.5, 430.0]);
        assert_eq!(reposition, if is_px4 { accepted } else { MavResult::MAV_RESULT_COMMAND_INT_ONLY });
        let int = |command, frame| {
            MavMessage::COMMAND_INT(COMMAND_INT_DATA {
                command,
                frame,
                target_system: 1,
                target_component: 1,
                param1: 2.0,
                ..Default::default()
            })
        };
        let terrain = int(MavCmd::MAV_CMD_NAV_LAND, MavFrame::MAV_FRAME_GLOBAL_TERRAIN_ALT);
        assert_eq!(bench.ask(terrain), MavResult::MAV_RESULT_COMMAND_UNSUPPORTED_MAV_FRAME);
        let set = if is_px4 { actuator } else { servo };
        assert_eq!(bench.ask(int(set, MavFrame::MAV_FRAME_GLOBAL)), MavResult::MAV_RESULT_COMMAND_LONG_ONLY);
        assert_eq!(bench.command(1, MavCmd::MAV_CMD_DO_PARACHUTE, [0.0; 7]), unsupported);
        assert_eq!(bench.mode(Mode::Mission), MavResult::MAV_RESULT_DENIED, "it has no mission");
        assert_eq!(bench.command(1, MavCmd::MAV_CMD_COMPONENT_ARM_DISARM, [0.0; 7]), MavResult::MAV_RESULT_FAILED);
        assert_eq!(bench.mode(Mode::Land), accepted);
        bench.pass(40.0);
        assert_eq!((bench.machine.landed(), bench.machine.is_armed()), (Landed::Ground, false), "{kind:?}");
    }
}

fn waypoint(north: f64, height: f32) -> Item {
    let item = stay(&HOME, 0.0);
    Item { x: item.x + (north / (1e-7 * 111_200.0)) as i32, z: height, ..item }
}

#[test]
fn a_mission_is_flown_item_by_item_and_its_outputs_set_on_the_way() {
    for kind in KINDS {
        let mut bench = Bench::like(kind);
        let take_off = Item { command: MavCmd::MAV_CMD_NAV_TAKEOFF, ..waypoint(0.0, 20.0) };
        let speed = Item { command: MavCmd::MAV_CMD_DO_CHANGE_SPEED, params: [1.0, 4.0, -1.0, 0.0], ..take_off };
        let (command, params) = match kind {
            Autopilot::Px4 => (MavCmd::MAV_CMD_DO_SET_ACTUATOR, [0.5, f32::NAN, f32::NAN, f32::NAN]),
            Autopilot::ArduPilot => (MavCmd::MAV_CMD_DO_SET_SERVO, [1.0, 0.5, 0.0, 0.0]),
        };
        let output = Item { command, params, ..take_off };
        let mut items =
            vec![take_off, waypoint(0.0, 20.0), speed, waypoint(60.0, 20.0), output, waypoint(100.0, 20.0)];
        if kind == Autopilot::ArduPilot {
            items.insert(0, stay(&HOME, 0.0));
        }
        let last = items.len() as u16 - 1;
        bench.machine.storage_mut().lists[0] = items;
        bench.machine.arm();
        assert!(bench.machine.change_mode(Mode::Mission));
        bench.pass(18.0);
        assert!((bench.machine.body().velocity[1] - 4.0).abs() < 0.2, "{kind:?}: {:?}", bench.machine.body());
        assert_eq!((bench.machine.landed(), bench.machine.output(1)), (Landed::Air, None));
        bench.pass(40.0);
        let at = bench.machine.body().position;
        assert!((at[1] - 100.0).abs() < 1.5 && (at[2] - 20.0).abs() < 1.0, "{kind:?}: {at:?}");
        assert_eq!((bench.machine.output(1), bench.machine.is_mission_done()), (Some(0.5), true));
        let reached =
            |message: &MavMessage| matches!(message, MavMessage::MISSION_ITEM_REACHED(data) if data.seq == last);
        assert_eq!(bench.heard(reached), 1);
    }
}

#[test]
fn a_replaced_mission_leaves_the_running_item_and_goes_on_as_each_kind_does() {
    for (kind, north) in [(Autopilot::Px4, 10.0), (Autopilot::ArduPilot, 90.0)] {
        let mut bench = Bench::flying(kind);
        bench.machine.storage_mut().lists[0] = [0.0, 20.0, 60.0, 61.0].map(|north| waypoint(north, 20.0)).to_vec();
        assert!(bench.machine.change_mode(Mode::Mission) && bench.machine.set_current(2));
        bench.pass(2.0);
        let at = Time::from_millis(bench.now + 10);
        let replaced = [10.0, 20.0, 30.0, 90.0].map(|north| waypoint(north, 20.0)).to_vec();
        let station = Trouble::Station { at, items: replaced };
        let mut settings = bench.machine.settings().clone();
        settings.troubles.push(station);
        // The trouble is known beforehand: fly the same flight again with it.
        let mut bench = Bench::new(Settings { pilot: Pilot::TakesOff(20.0), ..settings });
        bench.pass(20.0);
        bench.machine.storage_mut().lists[0] = [0.0, 20.0, 60.0, 61.0].map(|north| waypoint(north, 20.0)).to_vec();
        assert!(bench.machine.change_mode(Mode::Mission) && bench.machine.set_current(2));
        bench.pass(4.0);
        let to_station = |message: &MavMessage| matches!(message, MavMessage::MISSION_ACK(data) if data.target_system == STATION.system);
        assert_eq!(bench.heard(to_station), 1, "overheard");
        let mut highest = 0.0_f64;
        while bench.heard(|message| matches!(message, MavMessage::MISSION_ITEM_REACHED(_))) < 2 && bench.now < 90_000
        {
            bench.pass(0.1);
            highest = highest.max(bench.machine.body().position[1]);
        }
        assert!(highest > 57.0, "{kind:?}: the running item is flown to its end: {highest}");
        assert!((bench.machine.body().position[1] - north).abs() < 3.0, "{kind:?}: {:?}", bench.machine.body());
    }
}

#[test]
fn payloads_answer_for_themselves_and_fall_silent() {
    let jammer = Spec { kind: Kind::Jammer, component: 26, instance: 0 };
    let mut bench = Bench::new(Settings { payloads: vec![jammer], ..Settings::new(Autopilot::Px4, HOME) });
    let user = MavCmd::MAV_CMD_USER_2;
    assert_eq!(bench.command(26, user, [0.0, 0.7, 90.0, 0.0, 1.0, 0.0, 0.0]), MavResult::MAV_RESULT_ACCEPTED);
    assert!(
        bench
            .heard
            .iter()
            .any(|(_, component, message)| *component == 26 && matches!(message, MavMessage::COMMAND_ACK(_)))
    );
    assert_eq!(bench.machine.payload(26).expect("on board").level(), 0.7);
    assert_eq!(bench.command(1, user, [0.0; 7]), MavResult::MAV_RESULT_UNSUPPORTED, "not the autopilot's");
    bench.pass(1.1);
    assert_eq!(bench.machine.payload(26).expect("on board").level(), 0.0);
}

#[test]
fn silence_and_restarts_pass_and_the_flight_goes_on() {
    let at = Time::from_millis;
    for kind in KINDS {
        let troubles =
            vec![Trouble::Silence { from: at(30_000), until: at(34_000) }, Trouble::Restart { at: at(40_000) }];
        let settings = Settings { pilot: Pilot::TakesOff(20.0), troubles, ..Settings::new(kind, HOME) };
        let mut bench = Bench::new(settings);
        bench.pass(60.0);
        let gaps: Vec<u64> =
            (bench.heard.iter().filter(|(_, _, message)| matches!(message, MavMessage::HEARTBEAT(_))))
                .map(|(at, _, _)| *at)
                .collect::<Vec<_>>()
                .windows(2)
                .map(|pair| pair[1] - pair[0])
                .filter(|gap| *gap > 1100)
                .collect();
        assert_eq!(gaps.len(), 2, "{gaps:?}");
        assert!(gaps[0] >= 4000 && (1500..3000).contains(&gaps[1]), "{gaps:?}");
        assert_eq!((bench.machine.landed(), bench.machine.is_armed()), (Landed::Air, true));
        assert!((bench.machine.body().position[2] - 20.0).abs() < 1.0);
        assert!(bench.machine.list(List::Mission).is_empty());
    }
}

#[test]
fn the_clock_may_stand_or_leap() {
    let mut bench = Bench::flying(Autopilot::Px4);
    let before = *bench.machine.body();
    bench.machine.tick(Time::from_millis(bench.now));
    bench.machine.tick(Time::ZERO);
    assert_eq!(*bench.machine.body(), before);
    bench.machine.tick(Time::from_millis(bench.now) + Duration::from_secs(86_400));
    assert!((bench.machine.body().position[2] - 20.0).abs() < 1.0);
}
