//! Flights that cannot be: the program says what stands in the way, where, and what may help, and ends with status 1.

use std::fmt::Write as _;
use std::fs;
use std::process::{Command, Output};

use tempfile::TempDir;

/// A flight east at 10 m/s through a box of a kilometre, and what makes it a problem.
fn east_with(constraints: &str) -> String {
    format!(
        r#"softening = 0.05
frame = {{ unit_m = 100.0, latitude_deg = 50.0, longitude_deg = 8.0, altitude_m = 30.0 }}
grid = {{ intervals = 30 }}
time = {{ max = 250.0 }}
domain = {{ min = [0.0, 0.0], max = [10.0, 10.0] }}
[[agent]]
name = "kite"
start = [1.0, 5.0]
goal = [8.0, 5.0]
speed_max = 0.1
accel_max = 0.02
[[sensor]]
position = [5.0, 0.0]
detection = {{ model = "proxy", scale = 0.3, epsilon = 0.3, path_loss = 2.0 }}
[[objective.term]]
metric = "detection"
{constraints}"#
    )
}

/// Writes the scenario into a folder and plans it there.
fn planned(room: &TempDir, text: &str) -> Output {
    fs::write(room.path().join("flight.toml"), text).expect("the scenario");
    run(room, &["plan", "flight.toml", "--out", "out"])
}

fn run(room: &TempDir, args: &[&str]) -> Output {
    let mut program = Command::new(env!("CARGO_BIN_EXE_quietpath"));
    program.current_dir(room.path()).args(args).output().expect("the program runs")
}

/// Both streams.
fn said(output: &Output) -> String {
    [&output.stdout, &output.stderr].map(|stream| String::from_utf8_lossy(stream).into_owned()).concat()
}

/// Plans a flight that cannot be, and expects these words.
fn stopped(constraints: &str, says: &[&str]) {
    let room = TempDir::new().expect("a folder");
    let output = planned(&room, &east_with(constraints));
    let text = said(&output);
    assert_eq!(output.status.code(), Some(1), "{text}");
    for part in says {
        assert!(text.contains(part), "no `{part}` in\n{text}");
    }
    // It can be looked at and checked, but not flown.
    assert!(text.contains("no mission files: the plan is not feasible"), "{text}");
    let exists = |name: &str| room.path().join("out").join(name).exists();
    assert!(exists("landscape.png") && exists("plan.json") && !exists("mission.plan") && !exists("path.geojson"));
    let checked = run(&room, &["check", "flight.toml", "out/plan.json"]);
    assert_eq!(checked.status.code(), Some(1));
    assert!(said(&checked).contains("not feasible: "), "{}", said(&checked));
}

#[test]
fn a_ring_of_regions_around_the_goal() {
    let mut ring = String::new();
    for index in 0..8 {
        let (sin, cos) = (f64::from(index) * std::f64::consts::FRAC_PI_4).sin_cos();
        let (east, north) = (8.0 + 1.2 * cos, 5.0 + 1.2 * sin);
        let _ = writeln!(ring, "[[region]]\nname = \"ring{index}\"\ncenter = [{east}, {north}]\nradius = 0.6");
    }
    stopped(&ring, &["no feasible plan: region[", "] (ring", ") closes every way of kite", "entered near ["]);
}

#[test]
fn a_wall_across_the_domain() {
    let wall = "[[region]]\nname = \"keep-out\"\npolygon = [[4.0, -1.0], [4.05, -1.0], [4.05, 11.0], [4.0, 11.0]]\n";
    let says = ["region[0] (keep-out) closes every way of kite", "entered near [", " s\n  help: a smaller region"];
    stopped(wall, &says);
}

#[test]
fn a_limit_that_cannot_be_met() {
    let limit = "[[limit]]\nmetric = \"detection\"\nmax = 0.002\n";
    let says = ["limit[0] (detection <= 0.002) closes every way of kite", "broken near [", "help: a looser limit"];
    stopped(limit, &says);
}

#[test]
fn agents_that_cannot_pass_each_other() {
    let other =
        "[[agent]]\nname = \"crow\"\nstart = [8.0, 5.0]\ngoal = [1.0, 5.0]\nspeed_max = 0.1\naccel_max = 0.02\n";
    // A corridor that is narrower than the distance.
    let text = east_with(other).replace("[0.0, 0.0], max = [10.0, 10.0]", "[0.0, 4.8], max = [10.0, 5.2]");
    let room = TempDir::new().expect("a folder");
    let output = planned(&room, &format!("separation = 0.6\n{text}"));
    assert_eq!(output.status.code(), Some(1), "{}", said(&output));
    let says = "kite and crow come closer than `separation` on the best path that was found";
    assert!(said(&output).contains(says), "{}", said(&output));
}

/// No plan can keep this, so it is an error of the scenario, at its line.
#[test]
fn a_region_to_stay_in_that_does_not_hold_the_goal() {
    let room = TempDir::new().expect("a folder");
    let corridor = "[[region]]\nname = \"corridor\"\ninside = true\ncenter = [2.0, 5.0]\nradius = 3.0\n";
    let output = planned(&room, &east_with(corridor));
    assert_eq!(output.status.code(), Some(2));
    let says = "flight.toml:9: agent[0].goal lies outside region[0] (corridor), which is to be stayed in";
    assert!(said(&output).contains(says), "{}", said(&output));
}

#[test]
fn a_flight_that_can_be_says_nothing_of_this() {
    let room = TempDir::new().expect("a folder");
    let output = planned(&room, &east_with(""));
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    assert!(!said(&output).contains("no feasible plan"), "{}", said(&output));
    assert!(room.path().join("out/mission.plan").exists());
}

#[test]
fn a_sweep_says_what_stands_in_the_way_of_its_plans() {
    let room = TempDir::new().expect("a folder");
    let wall = "[[region]]\nname = \"keep-out\"\npolygon = [[4.0, -1.0], [4.05, -1.0], [4.05, 11.0], [4.0, 11.0]]\n";
    let text = east_with(wall).replace("max = 250.0", "max = 250.0, target = 80.0, penalty = 1.0");
    fs::write(room.path().join("flight.toml"), text).expect("the scenario");
    let output = run(&room, &["trade", "flight.toml", "--over", "deadline", "--points", "2"]);
    assert_eq!(output.status.code(), Some(1), "{}", said(&output));
    let says = ["no feasible plan at 100 %", "region[0] (keep-out)", "help: a smaller region"];
    for part in says {
        assert!(said(&output).contains(part), "no `{part}` in\n{}", said(&output));
    }
}
