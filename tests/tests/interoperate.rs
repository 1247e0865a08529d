//! MAVSDK as a ground station: what it downloads from the simulated autopilot, and what its importers make of our files.
//!
//! It needs a Python environment under `target/` with packages from PyPI, so it runs where it is asked for:
//! `cargo xtask test`, or `cargo test --workspace --test interoperate -- --ignored`.

#![cfg(unix)]

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use quietpath_bridge::clock::{SystemClock, Time};
use quietpath_bridge::file::mission::missions;
use quietpath_bridge::file::{PlanFile, ScenarioFile};
use quietpath_bridge::link::Link;
use quietpath_bridge::link::memory::Faults;
use quietpath_bridge::mission::item::{fence_items, mission_items};
use quietpath_bridge::telemetry::Autopilot;
use quietpath_sim::autopilot::serve::{Go, endpoint, serve};
use quietpath_sim::autopilot::{Machine, Settings};
use quietpath_tests::programs::{Folder, PLAN, SCENARIO, free_port};
use serde_json::Value;

/// The Python of an environment that has MAVSDK.
fn python() -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("mavlink");
    let python = folder.join("bin/python");
    let has = || {
        let probe = Command::new(&python).args(["-c", "import mavsdk"]).stderr(Stdio::null()).status();
        probe.is_ok_and(|status| status.success())
    };
    let done = |command: &mut Command| assert!(command.status().is_ok_and(|status| status.success()), "{command:?}");
    if !has() {
        done(Command::new("python3").args(["-m", "venv", "--clear"]).arg(&folder));
        done(Command::new(folder.join("bin/pip")).args(["install", "--quiet", "pymavlink==2.4.50", "mavsdk==4.1.0"]));
    }
    assert!(has(), "{} lacks MAVSDK", python.display());
    python
}

fn commands(list: &Value) -> Vec<u64> {
    list.as_array().expect("a list").iter().filter_map(|item| item[0].as_u64()).collect()
}

#[test]
#[ignore = "makes a Python environment"]
fn mavsdk_downloads_from_the_simulated_autopilot_and_imports_our_files() {
    let python = python();
    let scenario = ScenarioFile::parse("line.toml", SCENARIO).expect("a scenario").scenario;
    let plan = PlanFile::parse("plan.json", PLAN).expect("a plan");
    let mission = missions(&scenario, &plan).expect("missions").remove(0);
    let folder = Folder::new();
    folder.write("mission.plan", &mission.to_qgc_plan());
    folder.write("mission.waypoints", &mission.to_waypoints());
    let mut machine = Machine::new(Settings::for_agent(Autopilot::Px4, &scenario, None).expect("a vehicle"));
    machine.storage_mut().lists[0] = mission_items(Autopilot::Px4, &mission);
    machine.storage_mut().lists[1] = fence_items(&mission.fences);
    let (clock, port) = (SystemClock::start(), free_port());
    let address = format!("udpout:127.0.0.1:{port}").parse().expect("an address");
    let mut link = Link::open(address, endpoint(&machine), clock).expect("threads");
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/interoperate/station.py");
    let mut command = Command::new(python);
    command.arg(script).arg(port.to_string()).args([folder.path("mission.plan"), folder.path("mission.waypoints")]);
    let mut station = command.stdout(Stdio::piped()).spawn().expect("Python runs");
    let mut is_over = false;
    serve(
        &mut machine,
        &mut link,
        clock,
        (Faults::NONE, 0),
        |_| {},
        |moment| {
            is_over = !matches!(station.try_wait(), Ok(None));
            if is_over || moment.now > Time::from_millis(60_000) { Go::Stop } else { Go::On }
        },
    );
    if !is_over {
        let _ = station.kill();
    }
    let output = station.wait_with_output().expect("it ends");
    // Libraries chat on standard output too: the line of JSON is the last.
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let got: Value = serde_json::from_str(text.lines().last().unwrap_or_default()).expect(&text);
    let expected = [22, 16, 178, 16, 16, 16, 16];
    assert_eq!(commands(&got["mission"]), expected, "take-off, start, speed, nodes: {got}");
    let items = &machine.storage_mut().lists[0];
    assert_eq!(got["mission"][6][1].as_i64(), Some(i64::from(items[6].x)), "{got}");
    assert_eq!(commands(&got["fence"]), [5004], "an exclusion circle: {got}");
    assert_eq!(commands(&got["plan"]), expected, "{got}");
    assert_eq!(commands(&got["plan_fence"]), [5004], "{got}");
    // Its importer takes home, item 0 of the file, for a waypoint.
    assert_eq!(commands(&got["waypoints"])[1..], expected, "{got}");
}
