//! Flights in steps, as a person meets them: what is said, which files there are, and that they belong together.

use std::fs;
use std::process::{Command, Output};

use tempfile::TempDir;

/// Two that fly east past a patrol that comes towards them.
const SCENARIO: &str = r#"softening = 0.05
frame = { unit_m = 100.0, latitude_deg = 50.0, longitude_deg = 8.0, altitude_m = 30.0 }
grid = { intervals = 16 }
time = { max = 250.0, target = 90.0, penalty = 1.0 }
domain = { min = [0.0, 0.0], max = [10.0, 10.0] }
[[agent]]
name = "kite"
start = [1.0, 5.0]
goal = [8.0, 5.0]
speed_max = 0.1
accel_max = 0.02
jammer = { budget = 5.0 }
[[agent]]
name = "lark"
start = [1.0, 7.0]
goal = [8.0, 6.5]
speed_max = 0.1
accel_max = 0.02
[[sensor]]
name = "patrol"
track = [{ t = 0.0, position = [5.0, 0.0] }, { t = 60.0, position = [6.0, 5.5] }]
detection = { model = "proxy", scale = 0.3, epsilon = 0.3, path_loss = 2.0 }
[[objective.term]]
metric = "detection"
[rolling]
steps = 3
"#;

fn run(room: &TempDir, args: &[&str]) -> Output {
    let mut program = Command::new(env!("CARGO_BIN_EXE_quietpath"));
    program.current_dir(room.path()).args(args).output().expect("the program runs")
}

/// Runs and expects an exit status; what is said on standard output.
fn expect(room: &TempDir, status: i32, args: &[&str]) -> String {
    let output = run(room, args);
    let text = |stream: &[u8]| String::from_utf8_lossy(stream).into_owned();
    assert_eq!(output.status.code(), Some(status), "{}\n{}", text(&output.stdout), text(&output.stderr));
    text(&output.stdout)
}

fn room(scenario: &str) -> TempDir {
    let room = TempDir::new().expect("a folder");
    fs::write(room.path().join("s.toml"), scenario).expect("the scenario");
    room
}

fn read(room: &TempDir, name: &str) -> String {
    fs::read_to_string(room.path().join(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

fn json(room: &TempDir, name: &str) -> serde_json::Value {
    serde_json::from_str(&read(room, name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

#[test]
fn a_flight_in_steps_is_told_step_by_step_and_checks() {
    let room = room(SCENARIO);
    let said = expect(&room, 0, &["plan", "s.toml", "--out", "out"]);
    assert!(said.contains("status                  flown"), "{said}");
    let rows: Vec<&str> = said.lines().skip_while(|line| !line.starts_with("step ")).skip(1).take(3).collect();
    for (number, row) in ["1", "2", "3"].iter().zip(&rows) {
        let words: Vec<&str> = row.split_whitespace().collect();
        assert_eq!((words.first(), words.get(2)), (Some(number), Some(&"s")), "{said}");
        assert!(words.contains(&"new") && words.contains(&"yes"), "{said}");
    }
    let flown = json(&room, "out/plan.json");
    let times = flown["times"].as_array().expect("times");
    assert_eq!((times.len(), flown["status"].as_str()), (17, Some("flown")));
    let csv = read(&room, "out/steps/steps.csv");
    let begins: Vec<f64> =
        csv.lines().skip(1).map(|line| line.split(',').nth(1).expect("a time").parse().expect("a number")).collect();
    assert_eq!(begins.len(), 3);
    for (index, (node, begin)) in [0, 5, 10].into_iter().zip(begins).enumerate() {
        assert_eq!(times[node].as_f64(), Some(begin));
        let step = json(&room, &format!("out/steps/step-{:02}.json", index + 1));
        assert_eq!(step["start_time"].as_f64(), Some(begin));
        for agent in 0..2 {
            assert_eq!(step["agents"][agent]["path"][0], flown["agents"][agent]["path"][node]);
        }
        let picture = fs::read(room.path().join(format!("out/steps/step-{:02}.png", index + 1))).expect("a picture");
        assert!(png::Decoder::new(std::io::Cursor::new(picture)).read_info().is_ok());
    }
    assert!(room.path().join("out/steps.png").exists() && !room.path().join("out/steps/step-04.json").exists());
    roxmltree::Document::parse(&read(&room, "out/steps.svg")).expect("an SVG");
    assert!(read(&room, "out/series.svg").contains("a step begins"));
    let missions = fs::read_dir(room.path().join("out")).expect("the folder").flatten();
    assert_eq!(missions.filter(|file| file.path().extension().is_some_and(|it| it == "waypoints")).count(), 2);
    let check = expect(&room, 0, &["check", "s.toml", "out/plan.json"]);
    assert!(check.contains("(as the plan claims)") && check.contains("\nfeasible"), "{check}");
}

#[test]
fn single_precision_and_the_plan_alone_work_in_steps_too() {
    let room = room(SCENARIO);
    let output = run(&room, &["plan", "s.toml", "--precision", "f32", "--plan", "-"]);
    assert_eq!(output.status.code(), Some(0));
    fs::write(room.path().join("plan.json"), &output.stdout).expect("the plan");
    assert!(String::from_utf8_lossy(&output.stderr).contains("\nstep "));
    expect(&room, 0, &["check", "s.toml", "plan.json"]);
}

#[test]
fn once_is_one_piece() {
    let room = room(SCENARIO);
    let said = expect(&room, 0, &["plan", "s.toml", "--once", "--out", "out"]);
    assert!(!said.contains("\nstep "), "{said}");
    assert!(json(&room, "out/plan.json")["times"].is_null() && !room.path().join("out/steps").exists());
}

#[test]
fn a_flight_that_cannot_be_says_what_stopped_its_steps() {
    let wall = "[[region]]\nname = \"wall\"\npolygon = [[4, 0], [5, 0], [5, 10], [4, 10]]\n";
    let room = room(&format!("{SCENARIO}{wall}"));
    let said = expect(&room, 1, &["plan", "s.toml", "--out", "out"]);
    assert!(said.contains("status                  infeasible"), "{said}");
    assert!(said.contains("no feasible plan: region[0] (wall) closes every way"), "{said}");
    assert!(
        said.contains("no mission files: the plan is not feasible") && room.path().join("out/steps.png").exists()
    );
}

/// The steps take the patrol to stay where it is; it flies into the way instead.
#[test]
fn a_limit_that_the_world_breaks_is_named_with_its_place() {
    let limit = "[[limit]]\nmetric = \"detection\"\nmax = 0.03\n";
    let room = room(&format!("{SCENARIO}{limit}").replace("steps = 3", "steps = 1"));
    let said = expect(&room, 1, &["plan", "s.toml", "--out", "out"]);
    let row = said.lines().skip_while(|line| !line.starts_with("step ")).nth(1).expect("a step");
    assert!(row.contains("yes") && said.contains("worst violation         limit: "), "{said}");
    let check = expect(&room, 1, &["check", "s.toml", "out/plan.json"]);
    assert!(check.contains("not feasible: limit[0] (detection) is broken by"), "{check}");
}
