//! The program with other people's MAVLink: pymavlink and MAVSDK play the vehicle, and pymavlink reads our files;
//! and our JSON Schema with somebody else's validator.
//!
//! These tests make a Python environment under `target/` and fill it from PyPI, so they run where they are asked for:
//! `cargo xtask test`, or `cargo test -p quietpath-bridge --test interoperate -- --ignored`.

#![cfg(unix)]

mod shared;

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::OnceLock;
use std::time::Duration;

use serde_json::Value;
use shared::{Folder, free_port, program, run, terminate};

const PACKAGES: [&str; 3] = ["pymavlink==2.4.50", "mavsdk==4.1.0", "jsonschema==4.26.0"];
const KEY: &str = "00112233445566778899aabbccddeeff00112233445566778899aabbccddeeff";

/// The Python of an environment that has both.
fn python() -> &'static Path {
    static PYTHON: OnceLock<PathBuf> = OnceLock::new();
    PYTHON.get_or_init(|| {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("mavlink");
        let python = folder.join("bin/python");
        let has = |python: &Path| {
            let probe = Command::new(python)
                .args(["-c", "import pymavlink, mavsdk, jsonschema"])
                .stderr(Stdio::null())
                .status();
            probe.is_ok_and(|status| status.success())
        };
        if !has(&python) {
            succeed(Command::new("python3").args(["-m", "venv", "--clear"]).arg(&folder));
            succeed(Command::new(folder.join("bin/pip")).args(["install", "--quiet"]).args(PACKAGES));
        }
        assert!(has(&python), "{} lacks pymavlink, mavsdk or jsonschema", python.display());
        python
    })
}

fn succeed(command: &mut Command) {
    let status = command.status();
    assert!(status.as_ref().is_ok_and(|status| status.success()), "{command:?}: {status:?}");
}

fn script(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/interoperate").join(name)
}

/// A vehicle by one of the scripts; ended where it is dropped.
struct Vehicle(Option<Child>);

impl Vehicle {
    fn start(program: &str, port: u16, key: Option<&str>) -> Self {
        let mut command = Command::new(python());
        command.arg(script(program)).arg(port.to_string()).args(key);
        Self(Some(command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().expect("Python runs")))
    }

    /// What it got.
    fn end(mut self) -> Value {
        let mut child = self.0.take().expect("it runs");
        let mut input = child.stdin.take().expect("a pipe");
        input.write_all(b"\n").expect("it reads");
        drop(input);
        let output = child.wait_with_output().expect("it ends");
        // Libraries chat on standard output too: the line of JSON is the last.
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        serde_json::from_str(text.lines().last().unwrap_or_default()).expect("a line of JSON")
    }
}

impl Drop for Vehicle {
    fn drop(&mut self) {
        if let Some(mut child) = self.0.take() {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

#[test]
#[ignore = "makes a Python environment"]
fn pymavlink_receives_missions_and_fences_and_gives_them_back() {
    for key in [None, Some(KEY)] {
        let folder = Folder::new();
        folder.write("key", KEY);
        let key_file = folder.path("key");
        std::fs::set_permissions(&key_file, std::os::unix::fs::PermissionsExt::from_mode(0o600))
            .expect("permissions");
        let port = free_port();
        let vehicle = Vehicle::start("vehicle.py", port, key);
        let link = format!("udpin:127.0.0.1:{port}");
        let (scenario, plan) = (folder.path("scenario.toml"), folder.path("plan.json"));
        let signing = ["--signing-key", key_file.as_str()];
        let signing: &[&str] = if key.is_some() { &signing } else { &[] };
        let upload = ["upload", "--link", &link, "--scenario", &scenario, "--plan", &plan];
        let (status, out, err) = run(&[&upload, signing].concat());
        assert_eq!(status, 0, "{out}{err}");
        let (status, out, err) = run(&[&["download", "--link", &link][..], signing].concat());
        assert_eq!((status, out.lines().count()), (0, 8), "{out}{err}");
        let got = vehicle.end();
        let lists = &got["lists"];
        let commands: Vec<u64> =
            lists["0"].as_array().expect("a list").iter().filter_map(|item| item[0].as_u64()).collect();
        assert_eq!(commands, [22, 16, 178, 16, 16, 16, 16], "take-off, start, speed, nodes");
        assert_eq!(lists["0"][2][6], 4.0, "10 m a length unit, 2 of them in 5 s");
        assert_eq!(lists["1"].as_array().map(Vec::len), Some(1));
        assert_eq!(
            (lists["1"][0][0].as_u64(), lists["1"][0][5].as_f64()),
            (Some(5004), Some(20.0)),
            "an exclusion circle"
        );
        let (signed, unsigned) =
            (got["signed"].as_u64().expect("a count"), got["unsigned"].as_u64().expect("a count"));
        assert!(if key.is_some() { signed > 10 && unsigned == 0 } else { unsigned > 10 && signed == 0 }, "{got}");
    }
}

#[test]
#[ignore = "makes a Python environment"]
fn pymavlink_reads_our_waypoints_and_logs() {
    let folder = Folder::new();
    let port = free_port();
    let _vehicle = Vehicle::start("vehicle.py", port, None);
    let link = format!("udpin:127.0.0.1:{port}");
    let (scenario, plan, record) =
        (folder.path("scenario.toml"), folder.path("plan.json"), folder.path("flight.jsonl"));
    let arguments = ["run", "--link", &link, "--scenario", &scenario, "--plan", &plan, "--record", &record];
    let child = program(&arguments).spawn().expect("the program runs");
    std::thread::sleep(Duration::from_secs(3));
    let (status, _, err) = terminate(child);
    assert_eq!(status, 4, "{err}");
    let waypoints = folder.path("kept.waypoints");
    let (status, _, err) = run(&["download", "--link", &link, "--out", &waypoints]);
    assert_eq!(status, 0, "{err}");
    let read = Command::new(python()).arg(script("read.py")).args([waypoints, folder.path("flight.tlog")]).output();
    let read: Value = serde_json::from_slice(&read.expect("Python runs").stdout).expect("a line of JSON");
    assert_eq!(
        (read["count"].as_u64(), read["command"].as_u64(), read["bad"].as_u64()),
        (Some(7), Some(16), Some(0))
    );
    assert!((read["x"].as_f64().expect("a latitude") - 47.4).abs() < 0.01, "{read}");
    let heartbeats = read["kinds"]["HEARTBEAT"].as_u64().expect("heartbeats");
    assert!(heartbeats > 10 && read["kinds"]["MISSION_ITEM_INT"].as_u64() > Some(10), "{read}");
}

#[test]
#[ignore = "makes a Python environment"]
fn mavsdk_receives_a_mission_and_gives_it_back() {
    let folder = Folder::new();
    let port = free_port();
    let vehicle = Vehicle::start("mavsdk_vehicle.py", port, None);
    let link = format!("udpin:127.0.0.1:{port}");
    let (scenario, plan) = (folder.path("scenario.toml"), folder.path("plan.json"));
    // MAVSDK does not say which autopilot it is.
    let arguments = ["upload", "--link", &link, "--scenario", &scenario, "--plan", &plan, "--autopilot", "px4"];
    let (status, out, err) = run(&arguments);
    assert_eq!(status, 0, "{out}{err}");
    assert!(out.contains("the mission: 7 items, read back"), "{out}");
    let got = vehicle.end();
    let mission = got["got"].as_array().and_then(|missions| missions.first()).expect("a mission");
    let commands: Vec<u64> = mission.as_array().expect("a list").iter().filter_map(|item| item[0].as_u64()).collect();
    assert_eq!(commands, [22, 16, 178, 16, 16, 16, 16], "{got}");
}

#[test]
#[ignore = "makes a Python environment"]
fn jsonschema_finds_our_scenarios_valid_and_spoilt_ones_not() {
    let folder = Folder::new();
    let scenarios = Path::new(env!("CARGO_MANIFEST_DIR")).join("../sim/scenarios");
    let mut paths: Vec<String> = std::fs::read_dir(&scenarios)
        .expect("scenarios")
        .map(|entry| entry.expect("an entry").path().to_str().expect("text").to_owned())
        .collect();
    let good = std::fs::read_to_string(scenarios.join("square8-detection.toml")).expect("a scenario");
    let spoilt = [("speed_max", "speed_most"), ("\"proxy\"", "\"proxies\""), ("intervals = 60", "intervals = 0")];
    for (index, (from, to)) in spoilt.iter().enumerate() {
        let name = format!("spoilt{index}.toml");
        folder.write(&name, &good.replacen(from, to, 1));
        paths.push(folder.path(&name));
    }
    let mut command = Command::new(python());
    let mut child =
        command.arg(script("validate.py")).args(&paths).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn();
    let child = child.as_mut().expect("Python runs");
    let schema = quietpath_bridge::file::schema::scenario_schema();
    child.stdin.take().expect("a pipe").write_all(schema.as_bytes()).expect("it reads");
    let mut text = String::new();
    std::io::Read::read_to_string(&mut child.stdout.take().expect("a pipe"), &mut text).expect("it writes");
    assert!(child.wait().expect("it ends").success());
    let errors: Value = serde_json::from_str(&text).expect("a line of JSON");
    for path in &paths {
        let found = errors[path].as_array().expect("a list");
        assert_eq!(found.is_empty(), !path.contains("spoilt"), "{path}: {found:?}");
    }
}
