//! The program itself, against a stand-in for a vehicle on a loopback socket.

#![cfg(unix)]

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use quietpath_bridge::clock::SystemClock;
use quietpath_bridge::file::ScenarioFile;
use quietpath_bridge::frame::LocalFrame;
use quietpath_bridge::link::dialect::*;
use quietpath_bridge::link::{Accept, Endpoint, Event, Identity, Link, Signing};
use quietpath_bridge::telemetry::Autopilot;
use quietpath_sim::autopilot::storage::Storage;
use quietpath_tests::programs::{Folder, SCENARIO, bridge, free_port, run, terminate};

const VEHICLE: Identity = Identity { system: 1, component: 1 };
const PATIENCE: Duration = Duration::from_secs(30);

/// What the vehicle saw.
#[derive(Clone, Debug, Default)]
struct Seen {
    setpoints: usize,
    levels: Vec<f32>,
    mission: usize,
    fence: usize,
}

/// A vehicle in the air on a thread of its own, that does what it is told at once.
struct Vehicle {
    stop: Arc<AtomicBool>,
    seen: Arc<Mutex<Seen>>,
    thread: Option<JoinHandle<()>>,
}

impl Vehicle {
    fn start(port: u16, key: Option<&Path>) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let seen = Arc::new(Mutex::new(Seen::default()));
        let clock = SystemClock::start();
        let mut endpoint = Endpoint::new(VEHICLE, Accept::Anyone);
        if let Some(key) = key {
            endpoint = endpoint.with_signing(Signing::from_key_file(key, 1, clock.now()).expect("a key"));
        }
        let address = format!("udpout:127.0.0.1:{port}").parse().expect("an address");
        let link = Link::open(address, endpoint, clock).expect("threads");
        let (flag, shared) = (Arc::clone(&stop), Arc::clone(&seen));
        let thread = std::thread::spawn(move || fly(link, clock, &flag, &shared));
        Self { stop, seen, thread: Some(thread) }
    }

    fn seen(&self) -> Seen {
        self.seen.lock().expect("the vehicle lives").clone()
    }

    fn wait(&self, what: &str, mut until: impl FnMut(&Seen) -> bool) {
        let begin = Instant::now();
        while !until(&self.seen()) {
            assert!(begin.elapsed() < PATIENCE, "{what}: {:?}", self.seen());
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}

impl Drop for Vehicle {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn fly(mut link: Link, clock: SystemClock, stop: &AtomicBool, seen: &Mutex<Seen>) {
    let mut missions = Storage::new(Autopilot::Px4, VEHICLE);
    let (mut custom_mode, mut told) = (3 << 16, None);
    while !stop.load(Ordering::Relaxed) {
        let event = link.receive(Duration::from_millis(5));
        let now = clock.now();
        let mut out = Vec::new();
        if told.is_none_or(|told| now.since(told) > Duration::from_millis(100)) {
            told = Some(now);
            out.extend(telemetry(custom_mode));
        }
        missions.poll(now, &mut out);
        if let Some((_, Event::Frame(frame))) = event {
            missions.handle(now, &frame, &mut out);
            let mut seen = seen.lock().expect("the test lives");
            (seen.mission, seen.fence) = (missions.lists[0].len(), missions.lists[1].len());
            match &frame.message {
                MavMessage::SET_POSITION_TARGET_GLOBAL_INT(_) => seen.setpoints += 1,
                MavMessage::TIMESYNC(data) if data.tc1 == 0 => {
                    out.push(MavMessage::TIMESYNC(TIMESYNC_DATA { tc1: 5, ts1: data.ts1, ..Default::default() }));
                }
                MavMessage::PARAM_REQUEST_READ(data) if data.param_id.to_str() == Ok("SYSID_THISMAV") => {
                    out.push(MavMessage::PARAM_VALUE(PARAM_VALUE_DATA {
                        param_value: 7.0,
                        param_id: data.param_id,
                        param_type: MavParamType::MAV_PARAM_TYPE_REAL32,
                        ..Default::default()
                    }));
                }
                MavMessage::COMMAND_LONG(data) => {
                    match data.command {
                        MavCmd::MAV_CMD_USER_2 => seen.levels.push(data.param2),
                        MavCmd::MAV_CMD_DO_SET_MODE => {
                            custom_mode = (data.param2 as u32) << 16 | (data.param3 as u32) << 24;
                        }
                        _ => {}
                    }
                    let (command, result) = (data.command, MavResult::MAV_RESULT_ACCEPTED);
                    out.push(MavMessage::COMMAND_ACK(COMMAND_ACK_DATA { command, result, ..Default::default() }));
                }
                _ => {}
            }
        }
        for message in &out {
            link.send(message);
        }
    }
}

fn telemetry(custom_mode: u32) -> [MavMessage; 3] {
    let scenario = ScenarioFile::parse("line.toml", SCENARIO).expect("a scenario").scenario;
    let place = LocalFrame::of(&scenario).expect("located").place(&[1.0, 1.0]);
    [
        MavMessage::HEARTBEAT(HEARTBEAT_DATA {
            custom_mode,
            mavtype: MavType::MAV_TYPE_QUADROTOR,
            autopilot: MavAutopilot::MAV_AUTOPILOT_PX4,
            base_mode: MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED,
            system_status: MavState::MAV_STATE_ACTIVE,
            mavlink_version: 3,
        }),
        MavMessage::GLOBAL_POSITION_INT(GLOBAL_POSITION_INT_DATA {
            lat: (place.latitude_deg * 1e7).round() as i32,
            lon: (place.longitude_deg * 1e7).round() as i32,
            alt: 440_000,
            relative_alt: 40_000,
            ..Default::default()
        }),
        MavMessage::EXTENDED_SYS_STATE(EXTENDED_SYS_STATE_DATA {
            landed_state: MavLandedState::MAV_LANDED_STATE_IN_AIR,
            ..Default::default()
        }),
    ]
}

#[test]
fn missions_go_up_and_come_down_and_status_says_who_is_there() {
    let folder = Folder::new();
    let port = free_port();
    let vehicle = Vehicle::start(port, None);
    let link = format!("udpin:127.0.0.1:{port}");
    let (scenario, plan) = (folder.path("scenario.toml"), folder.path("plan.json"));
    let (status, out, err) = run(&["upload", "--link", &link, "--scenario", &scenario, "--plan", &plan]);
    assert_eq!(status, 0, "{out}{err}");
    assert!(out.contains("holds the mission: 7 items, read back") && out.contains("fence: 1 items"), "{out}");
    let seen = vehicle.seen();
    assert_eq!((seen.mission, seen.fence), (7, 1));
    let (status, out, err) = run(&["download", "--link", &link]);
    assert_eq!(status, 0, "{err}");
    let lines: Vec<&str> = out.lines().collect();
    assert_eq!((lines[0], lines.len()), ("QGC WPL 110", 8), "{out}");
    assert!(lines[1].starts_with("0\t1\t3\t22\t0\t0\t0\tNaN\t47.4"), "{out}");
    let params = ["status", "--link", &link, "--seconds", "1.5", "--param", "SYSID_THISMAV"];
    let (status, out, err) = run(&params);
    assert_eq!(status, 0, "{err}");
    for says in ["SYSID_THISMAV = 7\n", "Px4, Copter, system 1\n", "armed true", "40.0 m above home", "loss 0.0 %"] {
        assert!(out.contains(says), "{says}: {out}");
    }
    assert!(out.contains("round trip ") && !out.contains("not answered"), "{out}");
}

#[test]
fn a_signal_holds_the_vehicle_silences_the_jammer_and_leaves_a_record_that_replays() {
    let folder = Folder::new();
    let port = free_port();
    let vehicle = Vehicle::start(port, None);
    let record = folder.path("flight.jsonl");
    folder.write(
        "bridge.toml",
        &format!(
            "link = \"udpin:127.0.0.1:{port}\"\nscenario = \"{}\"\nplan = \"{}\"\nrecord = \"{record}\"\n[flight]\nmode = \
             \"guided\"\n[[flight.payload]]\nkind = \"jammer\"\ncomponent = 26\n",
            folder.path("scenario.toml"),
            folder.path("plan.json"),
        ),
    );
    let config = folder.path("bridge.toml");
    let child = bridge(&["run", "--config", &config, "--arm-jammer"]).spawn().expect("the program runs");
    vehicle.wait("jamming", |seen| seen.levels.last() == Some(&1.0));
    assert!(vehicle.seen().setpoints > 10);
    let (status, _, err) = terminate(child);
    assert_eq!(status, 4, "{err}");
    assert!(err.contains("leaving for Hold") && err.contains("ended by a signal"), "{err}");
    vehicle.wait("silence", |seen| seen.levels.ends_with(&[0.0, 0.0, 0.0]));
    let (status, out, err) = run(&["replay", &record]);
    assert_eq!(status, 0, "{err}");
    assert!(err.contains("outputs, bit for bit") && out.contains("send fd"), "{err}");
    // Without the switch nothing is ever said to the jammer.
    let before = vehicle.seen();
    let child = bridge(&["run", "--config", &config]).spawn().expect("the program runs");
    vehicle.wait("setpoints", |seen| seen.setpoints > before.setpoints + 60);
    let (status, _, err) = terminate(child);
    assert_eq!((status, vehicle.seen().levels.len()), (4, before.levels.len()), "{err}");
}

/// What the program says goes to a terminal that is gone: every write is an error, from the first word on.
#[test]
fn a_flight_goes_on_when_nobody_can_hear_the_program() {
    let folder = Folder::new();
    let port = free_port();
    let vehicle = Vehicle::start(port, None);
    let link = format!("udpin:127.0.0.1:{port}");
    let path = |name: &str| folder.path(name);
    let (scenario, plan, record, config) =
        (path("scenario.toml"), path("plan.json"), path("flight.jsonl"), path("bridge.toml"));
    let arguments = ["run", "--link", &link, "--scenario", &scenario, "--plan", &plan, "--mode", "guided"];
    let mut command = bridge(&[&arguments[..], &["--record", &record, "--config", &config]].concat());
    let gone = || std::io::pipe().expect("a pipe").1;
    let child =
        command.env("QUIETPATH_LOG", "trace").stdout(gone()).stderr(gone()).spawn().expect("the program runs");
    vehicle.wait("the plan is flown", |seen| seen.setpoints > 60);
    assert_eq!(terminate(child).0, 4, "as if it had been heard");
    let (status, _, err) = run(&["replay", &record]);
    assert_eq!(status, 0, "{err}");
}

#[test]
fn a_signed_link_works_and_an_unsigned_one_says_why_not() {
    use std::os::unix::fs::PermissionsExt;
    let folder = Folder::new();
    for name in ["ours.key", "theirs.key"] {
        folder.write(name, &"5a".repeat(32));
        let closed = std::fs::Permissions::from_mode(0o600);
        std::fs::set_permissions(folder.path(name), closed).expect("permissions");
    }
    let port = free_port();
    let link = format!("udpin:127.0.0.1:{port}");
    let (ours, theirs) = (folder.path("ours.key"), folder.path("theirs.key"));
    let signed = ["status", "--link", &link, "--signing-key", &ours, "--seconds", "1"];
    {
        let _vehicle = Vehicle::start(port, Some(Path::new(&theirs)));
        let (status, out, err) = run(&signed);
        assert_eq!(status, 0, "{err}");
        assert!(out.contains("refused 0"), "{out}");
    }
    let _vehicle = Vehicle::start(port, None);
    let (status, _, err) = run(&signed);
    assert_eq!(status, 1);
    assert!(err.contains("frames were refused for their signature: do both ends have the key?"), "{err}");
}

/// A flight on a signed link, with everything written that can be: the key is nowhere but in its file.
#[test]
fn a_key_gets_into_no_log_and_no_record() {
    use std::os::unix::fs::PermissionsExt;
    let folder = Folder::new();
    let digits: String = (0..32).map(|byte| format!("{:02x}", 7 * byte + 3)).collect();
    for name in ["ours.key", "theirs.key"] {
        folder.write(name, &digits);
        std::fs::set_permissions(folder.path(name), std::fs::Permissions::from_mode(0o600)).expect("permissions");
    }
    let port = free_port();
    let vehicle = Vehicle::start(port, Some(Path::new(&folder.path("theirs.key"))));
    let path = |name: &str| folder.path(name);
    let (link, scenario, plan) = (format!("udpin:127.0.0.1:{port}"), path("scenario.toml"), path("plan.json"));
    let (key, record, state, config) =
        (path("ours.key"), path("flight.jsonl"), path("flight.state"), path("bridge.toml"));
    let arguments = ["run", "--link", &link, "--signing-key", &key, "--scenario", &scenario, "--plan", &plan];
    let more = ["--mode", "guided", "--record", &record, "--state", &state, "--config", &config];
    let mut command = bridge(&[&arguments[..], &more].concat());
    let child = command.env("QUIETPATH_LOG", "trace").spawn().expect("the program runs");
    vehicle.wait("the plan is flown", |seen| seen.setpoints > 20 && Path::new(&state).exists());
    let kept = std::fs::read(&state).expect("what the next bridge needs");
    let (_, out, err) = terminate(child);
    let bytes: Vec<u8> = (0..32).map(|byte| 7 * byte + 3).collect();
    let read = |path: String| std::fs::read(path).expect("written");
    let written = [read(record), read(path("flight.tlog")), kept, out.into_bytes(), err.into_bytes()];
    assert!(written[..3].iter().all(|text| text.len() > 100), "all of it is there");
    // Parts of it tell too much already.
    let capitals = digits.to_uppercase();
    let secrets = [&digits.as_bytes()[..16], &capitals.as_bytes()[..16], &bytes[..8]];
    let holds = |text: &[u8], secret: &[u8]| text.windows(secret.len()).any(|part| part == secret);
    for (which, text) in written.iter().enumerate() {
        assert!(!secrets.iter().any(|secret| holds(text, secret)), "output {which} holds the key");
    }
    assert!(holds(&read(key), secrets[0]), "this would find it");
}

#[test]
fn bad_input_is_answered_with_what_would_be_right() {
    let folder = Folder::new();
    folder.write("armed.toml", "[flight]\njammer_armed = true\n");
    folder.write("typo.toml", "[flight]\nmdoe = \"guided\"\n");
    let (scenario, plan) = (folder.path("scenario.toml"), folder.path("plan.json"));
    let (armed, typo) = (folder.path("armed.toml"), folder.path("typo.toml"));
    let cases: [(&[&str], &str); 6] = [
        (&["run"], "no scenario is given\n  help: --scenario FILE"),
        (&["run", "--scenario", &scenario, "--plan", &plan], "no link is given\n  help: --link serial:"),
        (&["run", "--scenario", &scenario, "--plan", &plan, "--link", "udp:1"], "--link: `udp` is no kind of link"),
        (&["status", "--config", &armed], "flight.jammer_armed is no key of the file"),
        (&["status", "--config", &typo], "unknown field `mdoe`"),
        (&["replay", &plan], "is no record"),
    ];
    for (arguments, says) in cases {
        let (status, _, err) = run(arguments);
        assert_eq!(status, 2, "{arguments:?}: {err}");
        assert!(err.contains(says), "{arguments:?}: {err}");
    }
}
