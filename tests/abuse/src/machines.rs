//! Messages in any order, with any content, at any time, into every machine.

use std::sync::LazyLock;

use mavlink::{MavlinkVersion, Message};
use quietpath_bridge::clock::Time;
use quietpath_bridge::command::{Command, Commands};
use quietpath_bridge::file::plan::AgentPlan;
use quietpath_bridge::file::{PlanFile, ScenarioFile};
use quietpath_bridge::flight::settings::{OnFailure, PayloadEntry, PayloadKind, Replanning};
use quietpath_bridge::flight::{Flight, FlyMode, Input, Output, Settings};
use quietpath_bridge::link::dialect::{
    HEARTBEAT_DATA, MavAutopilot, MavCmd, MavFrame, MavMessage, MavModeFlag, MavState, MavType,
};
use quietpath_bridge::link::{Frame, Identity};
use quietpath_bridge::mission::{Delivered, Delivery, Download, Item, List, Pace, Talk, Watch};
use quietpath_bridge::record::written;
use quietpath_bridge::replan::{Answer, Observation};
use quietpath_bridge::telemetry::param::ReadParam;
use quietpath_bridge::telemetry::timesync::Timesync;
use quietpath_bridge::telemetry::{Autopilot, Choice, Telemetry, Vehicle};

use crate::dice::{Dice, Mood};

const VEHICLE: Identity = Identity { system: 1, component: 1 };
const STRANGER: Identity = Identity { system: 255, component: 190 };
/// Messages that some machine listens to.
const IDS: [u32; 17] = [0, 1, 22, 33, 39, 40, 42, 43, 44, 47, 51, 73, 76, 77, 111, 144, 245];
/// Messages that one input may cause: a list of items is asked for one by one.
const OUTPUTS_MAX: usize = 64;
/// Longest that a transfer goes on when nothing is heard any more, s: five tries, each with its resends.
const SILENCE_MAX: u64 = 600;

const SCENARIO: &str = r#"
frame = { unit_m = 10.0, latitude_deg = 47.4, longitude_deg = 8.5, altitude_m = 40.0 }
grid = { intervals = 12 }
time = { max = 60.0 }
domain = { min = [0.0, 0.0], max = [20.0, 20.0] }
[[agent]]
start = [1.0, 1.0]
goal = [19.0, 1.0]
speed_max = 1.0
accel_max = 1.0
jammer = { budget = 20.0, live = true }
dropout = { budget = 20.0 }
[[sensor]]
name = "s1"
position = [10.0, 5.0]
detection = { model = "proxy", scale = 1.0, epsilon = 0.5, path_loss = 2.0 }
[[region]]
center = [10.0, 8.0]
radius = 2.0
[[objective.term]]
metric = "detection"
"#;

static WORLD: LazyLock<ScenarioFile> =
    LazyLock::new(|| ScenarioFile::parse("fuzz.toml", SCENARIO).expect("a scenario").scenario);

/// 18 length units in 40 s, jamming all the way.
fn plan() -> PlanFile {
    let path = (0..=12).map(|node| vec![1.0 + 1.5 * f64::from(node), 1.0]).collect();
    let agent = AgentPlan { name: "uav1".into(), path, jam: Some(vec![0.5; 13]), ..AgentPlan::default() };
    PlanFile { duration: 40.0, agents: vec![agent], ..PlanFile::default() }
}

/// A message that some machine listens to, with any content; `None` where that is none.
pub fn message(dice: &mut Dice<'_>) -> Option<MavMessage> {
    if dice.one_in(3) {
        return Some(MavMessage::HEARTBEAT(heartbeat(dice)));
    }
    let id = dice.of(&IDS)?;
    let length = dice.below(64);
    MavMessage::parse(MavlinkVersion::V2, id, dice.some(length)).ok()
}

/// A heartbeat that is likely to be listened to.
fn heartbeat(dice: &mut Dice<'_>) -> HEARTBEAT_DATA {
    let px4 = [4 << 16 | 4 << 24, 4 << 16 | 3 << 24, 6 << 16, 4 << 16 | 5 << 24];
    let ardupilot = [3, 4, 5, 6];
    let is_px4 = dice.one_in(2);
    let modes = if is_px4 { px4 } else { ardupilot };
    let flags = [MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED, MavModeFlag::empty()];
    HEARTBEAT_DATA {
        custom_mode: dice.of(&modes).unwrap_or_default(),
        mavtype: MavType::MAV_TYPE_QUADROTOR,
        autopilot: if is_px4 { MavAutopilot::MAV_AUTOPILOT_PX4 } else { MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA },
        base_mode: dice.of(&flags).unwrap_or_default(),
        system_status: MavState::MAV_STATE_ACTIVE,
        mavlink_version: 3,
    }
}

fn frame(dice: &mut Dice<'_>) -> Option<Frame> {
    let from = if dice.one_in(6) { STRANGER } else { VEHICLE };
    Some(Frame { from, sequence: dice.byte(), message: message(dice)?, bytes: Vec::new() })
}

/// Time goes on by anything from nothing to an hour, mostly by little.
fn later(now: Time, dice: &mut Dice<'_>) -> Time {
    let span = match dice.below(16) {
        15 => 3_600_000_000,
        14 => 5_000_000,
        kind => kind as u64 * u64::from(dice.byte()) * 500,
    };
    Time::from_micros(now.micros().saturating_add(span))
}

/// Feeds a machine, or a whole flight, with messages.
///
/// # Panics
/// A promise is broken.
pub fn messages(bytes: &[u8]) {
    let mut dice = Dice::new(bytes, Mood::Sane);
    match dice.below(6) {
        0 => flight(&mut dice),
        1 => delivery(&mut dice),
        2 => download(&mut dice),
        3 => commands(&mut dice),
        4 => listeners(&mut dice),
        _ => flight(&mut dice),
    }
}

fn talk(dice: &mut Dice<'_>) -> Talk {
    let list = dice.of(&List::ALL).unwrap_or(List::Mission);
    Talk { us: Identity::COMPANION, vehicle: VEHICLE, list }
}

fn items(count: usize) -> Vec<Item> {
    let item = |index: usize| Item {
        command: MavCmd::MAV_CMD_NAV_WAYPOINT,
        frame: MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT,
        params: [0.0; 4],
        x: 473_977_420 + index as i32,
        y: 85_455_940,
        z: 40.0,
        autocontinue: true,
    };
    (0..count).map(item).collect()
}

/// Lets a machine hear what the bytes say, then nothing; whether it has ended is for `step` to say.
fn until_silence(dice: &mut Dice<'_>, mut step: impl FnMut(Time, Option<&Frame>, &mut Vec<MavMessage>) -> bool) {
    let mut now = Time::ZERO;
    while !dice.is_empty() {
        now = later(now, dice);
        let mut out = Vec::new();
        step(now, None, &mut out);
        if let Some(frame) = frame(dice) {
            step(now, Some(&frame), &mut out);
        }
        assert!(out.len() <= OUTPUTS_MAX, "{} messages at once", out.len());
    }
    for _ in 0..SILENCE_MAX * 4 {
        now = Time::from_micros(now.micros() + 250_000);
        if step(now, None, &mut Vec::new()) {
            return;
        }
    }
    panic!("goes on after {SILENCE_MAX} s of silence");
}

fn delivery(dice: &mut Dice<'_>) {
    let kind = if dice.one_in(2) { Autopilot::Px4 } else { Autopilot::ArduPilot };
    let (talk, count) = (talk(dice), dice.below(6));
    let mut delivery = Delivery::new(talk, kind, items(count), Pace::default());
    until_silence(dice, |now, frame, out| {
        match frame {
            Some(frame) => delivery.handle(now, frame, out),
            None => delivery.poll(now, out),
        }
        delivery.result().is_some()
    });
    assert!(delivery.result().is_some_and(|result| result.is_err() || delivery.tries() > 0));
}

fn download(dice: &mut Dice<'_>) {
    let mut download = Download::new(talk(dice), Pace::default());
    until_silence(dice, |now, frame, out| {
        match frame {
            Some(frame) => download.handle(now, frame, out),
            None => download.poll(now, out),
        }
        download.result().is_some()
    });
}

fn commands(dice: &mut Dice<'_>) {
    let mut commands = Commands::default();
    let count = 1 + dice.below(5);
    for index in 0..count {
        let kinds = [MavCmd::MAV_CMD_DO_SET_MODE, MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL];
        let kind = dice.of(&kinds).unwrap_or(MavCmd::MAV_CMD_DO_SET_MODE);
        commands.submit(Time::ZERO, VEHICLE, Command::new(kind, [index as f32; 7]));
    }
    let mut ended = 0;
    until_silence(dice, |now, frame, out| {
        match frame {
            Some(frame) => ended += usize::from(commands.handle(now, Identity::COMPANION, frame).is_some()),
            None => ended += commands.poll(now, None, out).len(),
        }
        ended == count
    });
}

fn listeners(dice: &mut Dice<'_>) {
    let mut telemetry = Telemetry::new(Choice::Auto, None);
    let mut timesync = Timesync::default();
    let mut watch = Watch::new(talk(dice), Delivered { count: 5, opaque_id: 7 });
    let mut read = ReadParam::new(VEHICLE, Autopilot::Px4, "COM_OF_LOSS_T", Pace::default());
    until_silence(dice, |now, frame, out| {
        let Some(frame) = frame else {
            timesync.poll(now, VEHICLE, out);
            read.poll(now, out);
            return read.result().is_some();
        };
        telemetry.handle(now, frame);
        watch.handle(frame);
        read.handle(frame);
        if let MavMessage::TIMESYNC(data) = &frame.message {
            timesync.handle(now, data, out);
        }
        let is_finite = |vehicle: &Vehicle| {
            vehicle.fix.is_none_or(|fix| {
                let place = fix.place;
                [place.latitude_deg, place.longitude_deg, place.altitude.meters(), fix.above_home_m]
                    .iter()
                    .chain(&fix.velocity)
                    .all(|number| number.is_finite())
            })
        };
        assert!(telemetry.vehicle().is_none_or(is_finite), "the vehicle is at no place");
        read.result().is_some()
    });
}

fn settings(dice: &mut Dice<'_>) -> Settings {
    let entry = |kind, component| PayloadEntry { kind, component, instance: 0, mission_output: None };
    Settings {
        mode: if dice.one_in(2) { FlyMode::Mission } else { FlyMode::Guided },
        on_failure: dice.of(&[OnFailure::Hold, OnFailure::Return, OnFailure::Continue]).unwrap_or_default(),
        replan: if dice.one_in(2) { Some(Replanning::default()) } else { None },
        rally: dice.one_in(4),
        fence: dice.one_in(2),
        payload: vec![entry(PayloadKind::Transmitter, 25), entry(PayloadKind::Jammer, 26)],
        jammer_armed: !dice.one_in(8),
        ..Settings::default()
    }
}

fn answer(dice: &mut Dice<'_>) -> Answer {
    let mut plan = plan();
    plan.start_time = dice.number(0.0, 40.0);
    plan.duration = dice.of(&[30.0, 0.0, -1.0, f64::NAN, 1e300]).unwrap_or(30.0);
    if let Some(agent) = plan.agents.first_mut() {
        let keep = dice.below(14);
        agent.path.truncate(keep);
        if dice.one_in(4)
            && let Some(part) = agent.path.first_mut().and_then(|point| point.first_mut())
        {
            *part = f64::NAN;
        }
        if dice.one_in(4) {
            agent.jam = Some(vec![f64::INFINITY; 3]);
        }
    }
    let number = dice.below(4) as u64;
    let result = if dice.one_in(8) { Err("no plan".to_owned()) } else { Ok((plan, !dice.one_in(8))) };
    Answer { number, result }
}

fn input(dice: &mut Dice<'_>) -> Option<Input> {
    Some(match dice.below(12) {
        0 => Input::Tick,
        1 => Input::LinkUp,
        2 => Input::LinkDown("gone".into()),
        3 => Input::Planned(answer(dice)),
        4 => {
            let east = dice.number(-5.0, 25.0);
            let id = if dice.one_in(3) { "s1".to_owned() } else { format!("s{}", dice.byte()) };
            let line = format!("{{\"id\": \"{id}\", \"position\": [{east}, 3.0]}}");
            Input::Observed(Observation::parse(&line).ok()?)
        }
        5 if dice.one_in(8) => Input::Stop("enough".into()),
        _ => Input::Frame(Box::new(frame(dice)?)),
    })
}

fn flight(dice: &mut Dice<'_>) {
    let settings = settings(dice);
    let is_armed = settings.jammer_armed;
    let mut flight = Flight::new(&WORLD, &plan(), settings).expect("a flight");
    let mut now = Time::ZERO;
    let mut has_ended = false;
    let mut step = |flight: &mut Flight, now: Time, input: Input| {
        let outputs = flight.step(now, input);
        assert!(outputs.len() <= OUTPUTS_MAX, "{} outputs at once", outputs.len());
        assert!(!has_ended || outputs.is_empty(), "a flight that has ended says {outputs:?}");
        has_ended |= outputs.iter().any(|output| matches!(output, Output::End(_)));
        for output in &outputs {
            assert!(!written(output).is_empty());
            let Output::Send(message) = output else { continue };
            assert!(!radiates(message) || is_armed, "jams, and nobody armed it");
            assert!(
                !radiates(message)
                    || flight.phase() == "fly" && flight.vehicle().is_some_and(|vehicle| vehicle.armed),
                "jams while it does not fly the plan"
            );
            if let MavMessage::SET_POSITION_TARGET_GLOBAL_INT(data) = &**message {
                let numbers = [data.alt, data.vx, data.vy, data.vz, data.afx, data.afy, data.afz];
                assert!(numbers.iter().all(|number| number.is_finite()), "steers to {data:?}");
            }
        }
        has_ended
    };
    while !dice.is_empty() {
        now = later(now, dice);
        let Some(input) = input(dice) else { continue };
        step(&mut flight, now, input);
    }
    // Nothing is heard any more: nothing is emitted any more.
    for _ in 0..40 {
        now = Time::from_micros(now.micros() + 100_000);
        step(&mut flight, now, Input::Tick);
    }
    assert!(flight.emission().is_none(), "emits to a vehicle that is not heard");
    step(&mut flight, now, Input::Stop("the end".into()));
    for _ in 0..100 {
        now = Time::from_micros(now.micros() + 100_000);
        if step(&mut flight, now, Input::Tick) {
            return;
        }
    }
    panic!("was told to stop, and did not");
}

/// Whether a message tells a payload to jam.
fn radiates(message: &MavMessage) -> bool {
    matches!(message, MavMessage::COMMAND_LONG(data) if data.command == MavCmd::MAV_CMD_USER_2 && data.param2 != 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[should_panic(expected = "goes on after 600 s of silence")]
    fn a_machine_without_end_is_seen() {
        until_silence(&mut Dice::new(&[1, 2, 3], Mood::Sane), |_, _, _| false);
    }

    #[test]
    #[should_panic(expected = "65 messages at once")]
    fn a_machine_that_says_too_much_is_seen() {
        let message = quietpath_bridge::link::codec::companion_heartbeat();
        until_silence(&mut Dice::new(&[1, 2, 3], Mood::Sane), |_, _, out| {
            out.resize(OUTPUTS_MAX + 1, message.clone());
            true
        });
    }
}
