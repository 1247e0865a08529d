//! The program as a person or a script meets it: arguments, streams, files, exit statuses.

#![expect(clippy::unwrap_used, reason = "the helpers of a test may fail as a test does")]

use std::fs;
use std::io::Write as _;
use std::path::Path;
use std::process::{Command, Output, Stdio};

use tempfile::TempDir;

const COMMANDS: [&str; 11] =
    ["plan", "trade", "landscape", "check", "report", "study", "merge", "import", "schema", "new", "completions"];
const METRICS: [&str; 10] =
    ["detection", "false_alarm", "cep2", "cep", "aee", "gdop", "log_cep2", "log_cep", "log_aee", "log_gdop"];

/// A folder of its own, and the program run in it.
struct Room(TempDir);

impl Room {
    fn new() -> Self {
        Self(TempDir::new().unwrap())
    }

    fn path(&self, name: &str) -> std::path::PathBuf {
        self.0.path().join(name)
    }

    fn command(&self, args: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_quietpath"));
        command.current_dir(self.0.path()).args(args).stdin(Stdio::null());
        command
    }

    fn run(&self, args: &[&str]) -> Output {
        self.command(args).output().unwrap()
    }

    /// Runs and expects an exit status; returns standard output.
    fn expect(&self, status: i32, args: &[&str]) -> String {
        let output = self.run(args);
        assert_eq!(output.status.code(), Some(status), "{args:?}\n{}\n{}", stdout(&output), stderr(&output));
        stdout(&output)
    }

    fn fed(&self, input: &[u8], args: &[&str]) -> Output {
        let mut command = self.command(args);
        let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        child.stdin.take().unwrap().write_all(input).unwrap();
        child.wait_with_output().unwrap()
    }
}

fn stdout(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).unwrap()
}

fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

/// The text of a scenario that comes with the program.
fn scenario(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("scenarios/{name}.toml"));
    fs::read_to_string(path).unwrap()
}

/// Width and height of a PNG that decodes to its end.
fn png_size(path: &Path) -> (u32, u32) {
    let decoder = png::Decoder::new(std::io::BufReader::new(fs::File::open(path).unwrap()));
    let mut reader = decoder.read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let frame = reader.next_frame(&mut pixels).unwrap();
    assert!(pixels.iter().any(|byte| *byte != pixels[0]), "{} is blank", path.display());
    (frame.width, frame.height)
}

/// Width and height of an SVG that parses.
fn svg_size(path: &Path) -> (f64, f64) {
    let text = fs::read_to_string(path).unwrap();
    assert!(text.len() < 500_000, "{} has {} bytes", path.display(), text.len());
    let document = roxmltree::Document::parse(&text).unwrap();
    let size = |name| document.root_element().attribute(name).unwrap().parse().unwrap();
    (size("width"), size("height"))
}

#[test]
fn help_of_every_command_ends_with_an_example_that_parses() {
    let room = Room::new();
    for command in COMMANDS {
        let help = room.expect(0, &[command, "--help"]);
        let last = help.trim_end().lines().last().unwrap();
        assert!(last.starts_with(&format!("  quietpath {command}")), "{help}");
        assert!(!help.contains('\u{1b}'), "no colour in a pipe");
    }
}

#[test]
fn the_examples_of_the_help_run_in_order() {
    let room = Room::new();
    for command in ["new", "plan", "trade", "landscape", "check", "completions"] {
        let help = room.expect(0, &[command, "--help"]);
        let example = help.trim_end().lines().last().unwrap().trim().split(" > ").next().unwrap().to_owned();
        let args: Vec<&str> = example.split_whitespace().skip(1).collect();
        room.expect(0, &args);
    }
    assert!(room.path("out/plan.json").exists() && room.path("landscape.csv").exists());
}

#[test]
fn a_plan_leaves_its_files_and_a_summary() {
    let room = Room::new();
    fs::write(room.path("scenario.toml"), scenario("square8-detection")).unwrap();
    let said = room.expect(0, &["plan", "scenario.toml", "--out", "out"]);
    for name in [
        "landscape.png",
        "landscape.svg",
        "series.png",
        "series.svg",
        "plan.json",
        "report.html",
        "path.geojson",
        "mission.plan",
        "mission.waypoints",
    ] {
        assert!(said.contains(&format!("  out/{name}\n")), "{name} is not named in\n{said}");
        assert!(fs::metadata(room.path(&format!("out/{name}"))).unwrap().len() > 100, "{name}");
    }
    for name in ["landscape", "series"] {
        let (width, height) = svg_size(&room.path(&format!("out/{name}.svg")));
        let pixels = png_size(&room.path(&format!("out/{name}.png")));
        let scaled = |length: f64| (length * 1.25).round() as u32;
        assert_eq!(pixels, (scaled(width), scaled(height)), "{name}");
    }
    for label in ["status", "objective", "flight time", "path length", "peak detection", "mean detection"] {
        assert!(said.lines().any(|line| line.starts_with(label)), "{label} is missing in\n{said}");
    }
    for label in ["smallest location error", "worst violation", "planning time"] {
        assert!(said.lines().any(|line| line.starts_with(label)), "{label} is missing in\n{said}");
    }
    let checked = room.expect(0, &["check", "scenario.toml", "out/plan.json"]);
    assert!(checked.contains("(as the plan claims)") && checked.trim_end().ends_with("feasible"), "{checked}");
}

#[test]
fn the_starter_plans_and_checks_feasible() {
    let room = Room::new();
    room.expect(0, &["new", "mine.toml"]);
    room.expect(0, &["plan", "mine.toml", "--plan", "plan.json"]);
    let checked = room.expect(0, &["check", "mine.toml", "plan.json"]);
    assert!(checked.trim_end().ends_with("\nfeasible"), "{checked}");
}

#[test]
fn new_overwrites_only_when_told_to() {
    let room = Room::new();
    fs::write(room.path("mine.toml"), "precious").unwrap();
    let refused = room.run(&["new", "mine.toml"]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(stderr(&refused).starts_with("error: mine.toml exists already"), "{}", stderr(&refused));
    assert_eq!(fs::read_to_string(room.path("mine.toml")).unwrap(), "precious");
    room.expect(0, &["new", "mine.toml", "--force"]);
    let printed = room.expect(0, &["new", "-"]);
    assert_eq!(fs::read_to_string(room.path("mine.toml")).unwrap(), printed);
}

#[test]
fn a_scenario_comes_from_standard_input_and_a_plan_goes_to_standard_output() {
    let room = Room::new();
    let text = scenario("square8-detection");
    let output = room.fed(text.as_bytes(), &["plan", "-", "--plan", "-"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let plan: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(plan["scenario"], "square8-detection");
    assert!(plan["timing"]["plan_seconds"].as_f64().unwrap() > 0.0);
    assert!(plan["status"].is_string());
    assert!(stderr(&output).contains("flight time"), "the summary is on standard error");
    assert!(!stderr(&output).contains('\u{1b}'), "no colour and no progress in a pipe");
    fs::write(room.path("s.toml"), &text).unwrap();
    let checked = room.fed(&output.stdout, &["check", "s.toml", "-"]);
    assert_eq!(checked.status.code(), Some(0), "{}", stdout(&checked));
}

#[test]
fn both_precisions_plan() {
    let room = Room::new();
    fs::write(room.path("s.toml"), scenario("square8-detection")).unwrap();
    let objective = |precision: &str| {
        let said = room.expect(0, &["plan", "s.toml", "--precision", precision, "--plan", "-"]);
        let plan: serde_json::Value = serde_json::from_str(&said).unwrap();
        plan["objective"].as_f64().unwrap()
    };
    let (single, double) = (objective("f32"), objective("f64"));
    assert!((single - double).abs() < 0.01 * double.abs(), "{single} {double}");
    assert!((single - double).abs() > 0.0, "f32 is not f64");
}

#[test]
fn a_plan_that_breaks_a_bound_is_not_feasible() {
    let room = Room::new();
    room.expect(0, &["new", "s.toml"]);
    let said = room.expect(0, &["plan", "s.toml", "--plan", "-"]);
    let mut plan: serde_json::Value = serde_json::from_str(&said).unwrap();
    plan["duration"] = (plan["duration"].as_f64().unwrap() * 0.5).into();
    fs::write(room.path("fast.json"), plan.to_string()).unwrap();
    let checked = room.expect(1, &["check", "s.toml", "fast.json"]);
    let speed = checked.lines().find(|line| line.starts_with("speed ")).unwrap();
    assert!(speed.ends_with("violated"), "{checked}");
    assert!(checked.contains("not feasible"), "{checked}");
    assert!(checked.contains("but the plan claims"), "{checked}");
}

#[test]
fn an_objective_that_is_not_the_plans_is_told() {
    let room = Room::new();
    room.expect(0, &["new", "s.toml"]);
    let said = room.expect(0, &["plan", "s.toml", "--plan", "-"]);
    let mut plan: serde_json::Value = serde_json::from_str(&said).unwrap();
    plan["objective"] = (plan["objective"].as_f64().unwrap() + 0.5).into();
    fs::write(room.path("p.json"), plan.to_string()).unwrap();
    let checked = room.expect(0, &["check", "s.toml", "p.json"]);
    assert!(checked.contains("but the plan claims"), "{checked}");
}

#[test]
fn bad_input_is_status_2_and_one_message() {
    let room = Room::new();
    fs::write(room.path("s.toml"), scenario("square8-detection")).unwrap();
    fs::write(room.path("broken.toml"), "name = \n").unwrap();
    fs::write(room.path("file"), "").unwrap();
    let cases: [(&[&str], &str); 8] = [
        (&["plan", "missing.toml"], "missing.toml"),
        (&["plan", "broken.toml"], "broken.toml:1"),
        (&["check", "s.toml", "missing.json"], "missing.json"),
        (&["check", "-", "-"], "standard input"),
        (&["plan", "s.toml", "--out", "file"], "cannot make the folder file"),
        (&["plan", "s.toml", "--plan", "no/such/plan.json"], "cannot write no/such/plan.json"),
        (&["landscape", "s.toml", "--metric", "cep", "--out", "picture.bmp"], "picture.bmp"),
        (&["landscape", "s.toml", "--metric", "cep", "--out", "no/such.png"], "cannot write no/such.png"),
    ];
    for (args, words) in cases {
        let output = room.run(args);
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{args:?}: {said}");
        assert!(said.starts_with("error: ") && said.contains(words), "{args:?}: {said}");
        assert!(!said.contains("panicked") && !said.contains("backtrace"), "{args:?}: {said}");
    }
    for args in [&["fly-me"][..], &["plan"], &["plan", "s.toml", "--precision", "f16"], &["landscape", "s.toml"]] {
        let output = room.run(args);
        assert_eq!(output.status.code(), Some(2), "{args:?}");
        assert!(stderr(&output).starts_with("error: "), "{args:?}");
    }
}

#[test]
fn a_reader_that_leaves_early_is_no_error() {
    let room = Room::new();
    fs::write(room.path("s.toml"), scenario("square8-detection")).unwrap();
    let cases: [&[&str]; 4] = [
        &["landscape", "s.toml", "--metric", "detection", "--out", "-"],
        &["plan", "s.toml", "--plan", "-"],
        &["completions", "bash"],
        &["new", "-"],
    ];
    for args in cases {
        let mut command = room.command(args);
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        // Nobody reads: the other end is closed before the program has written anything.
        drop(child.stdout.take());
        let output = child.wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{args:?}: {}", stderr(&output));
        assert!(!stderr(&output).contains("panicked"), "{args:?}: {}", stderr(&output));
    }
}

#[test]
fn every_metric_has_a_landscape_in_every_format() {
    let room = Room::new();
    fs::write(room.path("s.toml"), scenario("square8-energy")).unwrap();
    for metric in METRICS {
        let args = ["landscape", "s.toml", "--metric", metric, "--resolution", "30"];
        room.expect(0, &[&args[..], &["--out", "l.png", "--out", "l.svg", "--out", "l.csv"]].concat());
        let (width, height) = svg_size(&room.path("l.svg"));
        assert!(width > 600.0 && height > 600.0, "{metric}: {width} x {height}");
        png_size(&room.path("l.png"));
        let csv = fs::read_to_string(room.path("l.csv")).unwrap();
        let mut lines = csv.lines();
        assert_eq!(lines.next(), Some(format!("x,y,{metric}").as_str()));
        let values: Vec<f64> = lines.map(|line| line.rsplit(',').next().unwrap().parse().unwrap()).collect();
        assert_eq!(values.len(), 900, "{metric}");
        assert!(values.iter().all(|value| value.is_finite()), "{metric}");
    }
}

#[test]
fn the_csv_of_a_landscape_is_the_model() {
    let room = Room::new();
    fs::write(room.path("s.toml"), scenario("square8-detection")).unwrap();
    let csv = room.expect(0, &["landscape", "s.toml", "--metric", "detection", "--resolution", "2", "--out", "-"]);
    // Two cells a side of ten units: centres at 2.5 and 7.5. By hand, (19) and (26) over the eight sensors.
    let sensors =
        [(2.0, 2.0), (5.0, 1.5), (8.0, 2.5), (1.5, 5.5), (4.8, 5.0), (8.2, 5.2), (3.0, 8.3), (7.0, 8.4_f64)];
    for line in csv.lines().skip(1) {
        let row: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
        let missed = |(x, y): &(f64, f64)| {
            let square = (row[0] - x).powi(2) + (row[1] - y).powi(2) + 0.05 * 0.05;
            1.0 - (0.3 / (0.3 + square)).min(1.0)
        };
        let expected = 1.0 - sensors.iter().map(missed).product::<f64>();
        assert!((row[2] - expected).abs() < 1e-12, "{line} {expected}");
    }
    assert_eq!(csv.lines().count(), 5);
}

#[test]
fn moving_sensors_move_with_the_time_asked_for() {
    let room = Room::new();
    room.expect(0, &["new", "s.toml"]);
    let at = |time: &str| {
        let args =
            ["landscape", "s.toml", "--metric", "detection", "--resolution", "20", "--out", "-", "--time", time];
        room.expect(0, &args)
    };
    assert_eq!(at("-5"), at("0"), "the patrol rests before its first entry");
    assert_ne!(at("0"), at("60"));
}

#[test]
fn without_a_place_on_the_earth_there_are_no_mission_files() {
    let room = Room::new();
    let text: String = scenario("square8-detection")
        .lines()
        .filter(|line| !line.contains("_deg") && !line.starts_with("altitude_m"))
        .map(|line| format!("{line}\n"))
        .collect();
    fs::write(room.path("s.toml"), text).unwrap();
    let said = room.expect(0, &["plan", "s.toml", "--out", "deep/er"]);
    assert!(said.contains("note: no mission files") && said.contains("latitude"), "{said}");
    assert!(room.path("deep/er/series.png").exists() && !room.path("deep/er/mission.plan").exists());
}

#[test]
fn names_with_markup_do_not_break_pictures() {
    let room = Room::new();
    let text =
        scenario("square8-detection").replace("\"uav1\"", r#""<a&b>\"\u0001""#).replace("\"s1\"", "\"</text>\"");
    fs::write(room.path("s.toml"), text).unwrap();
    room.expect(0, &["plan", "s.toml", "--out", "out"]);
    svg_size(&room.path("out/landscape.svg"));
    svg_size(&room.path("out/series.svg"));
    png_size(&room.path("out/landscape.png"));
}

#[test]
fn completions_know_the_commands() {
    let room = Room::new();
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = room.expect(0, &["completions", shell]);
        assert!(script.contains("landscape") && script.contains("quietpath"), "{shell}");
    }
}

/// A scenario that comes with the program, with fewer intervals so that a sweep takes no time.
fn coarse(name: &str) -> String {
    let text = scenario(name);
    assert!(text.contains("intervals = 60"));
    text.replace("intervals = 60", "intervals = 16")
}

/// The column of a CSV by its name.
fn column(csv: &str, name: &str) -> Vec<f64> {
    let mut lines = csv.lines();
    let place = lines.next().unwrap().split(',').position(|column| column == name).unwrap();
    lines.map(|line| line.split(',').nth(place).unwrap().parse().unwrap()).collect()
}

#[test]
fn more_time_and_larger_budgets_never_give_worse_plans() {
    let room = Room::new();
    for (name, over, values) in [
        ("square8-deadline-105", "deadline", "100%,102%,104%,108%,112%,120%,130%"),
        ("square8-jam", "jam-budget", "0,5,15,30,60"),
        ("square8-team", "jam-budget", "12,16,20,30"),
        ("dropout4-35", "dropout-budget", "0%,10%,17%,25%,35%"),
    ] {
        fs::write(room.path("s.toml"), coarse(name)).unwrap();
        room.expect(0, &["trade", "s.toml", "--over", over, "--values", values, "--out", "t"]);
        let csv = fs::read_to_string(room.path("t/trade.csv")).unwrap();
        let (objectives, seconds) = (column(&csv, "objective"), column(&csv, "seconds"));
        assert_eq!(objectives.len(), values.split(',').count());
        assert!(seconds.is_sorted(), "{seconds:?}");
        for pair in objectives.windows(2) {
            assert!(pair[1] <= pair[0], "{name} over {over}: {objectives:?}");
        }
        for picture in ["trade", "paths", "along"] {
            png_size(&room.path(&format!("t/{picture}.png")));
            svg_size(&room.path(&format!("t/{picture}.svg")));
        }
        let json: serde_json::Value = serde_json::from_slice(&fs::read(room.path("t/trade.json")).unwrap()).unwrap();
        let points = json["points"].as_array().unwrap();
        for (point, budget) in points.iter().zip(&seconds) {
            assert_eq!(point["feasible"], true, "{name}");
            assert_eq!(point["plan"]["objective"], point["objective"], "{name}");
            for spent in ["jam_spent", "dropout_spent"].map(|key| &point["figures"][0][key]) {
                assert!(spent.as_f64().is_none_or(|spent| spent <= budget + 1e-9), "{name}: {spent} of {budget}");
            }
        }
    }
}

#[test]
fn a_sweep_is_the_same_each_time_and_silent_in_a_pipe() {
    let room = Room::new();
    fs::write(room.path("s.toml"), coarse("square8-jam")).unwrap();
    let args = ["trade", "s.toml", "--over", "jam-budget", "--points", "4"];
    let (one, two) = (room.run(&args), room.run(&args));
    assert_eq!(stdout(&one), stdout(&two));
    assert!(one.stderr.is_empty(), "{}", stderr(&one));
    assert_eq!(stdout(&one).lines().count(), 5, "{}", stdout(&one));
}

#[test]
fn what_cannot_be_swept_is_refused_by_field() {
    let room = Room::new();
    fs::write(room.path("s.toml"), scenario("square8-deadline-105")).unwrap();
    for (args, says) in [
        (&["--over", "jam-budget"][..], "agent[0].jammer is missing"),
        (&["--over", "dropout-budget"], "agent[0].dropout is missing"),
        (&["--over", "deadline", "--values", "90%"], "cannot have a deadline"),
        (&["--over", "deadline", "--from", "1.2", "--to", "1.1"], "--to must be more than --from"),
        (&["--over", "deadline", "--values", "soon"], "give a number"),
        (&["--over", "deadline", "--points", "1"], "--points"),
        (&["--over", "deadline", "--points", "3", "--values", "1"], "cannot be used with"),
        (&["--over", "height"], "deadline"),
    ] {
        let output = room.run(&[&["trade", "s.toml"], args].concat());
        assert_eq!(output.status.code(), Some(2), "{args:?}");
        assert!(stderr(&output).contains(says), "{args:?}: {}", stderr(&output));
        assert!(!stderr(&output).contains("panicked"));
    }
    fs::write(room.path("s.toml"), scenario("square8-deadline-105").replace("penalty = 100.0", "penalty = 0.0"))
        .unwrap();
    let output = room.run(&["trade", "s.toml", "--over", "deadline"]);
    assert!(
        stderr(&output).contains("time.penalty is 0") && stderr(&output).contains("s.toml:"),
        "{}",
        stderr(&output)
    );
}

#[cfg(unix)]
#[test]
fn an_interrupted_sweep_leaves_no_partial_file() {
    let room = Room::new();
    fs::write(room.path("s.toml"), scenario("square8-deadline-105")).unwrap();
    let args = ["trade", "s.toml", "--over", "deadline", "--points", "40", "--out", "t"];
    let mut child = room.command(&args).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    // The folder is made before the first plan.
    while !room.path("t").exists() {
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    // Not INT: a shell that runs the tests in the background has them ignore it, and the program inherits that.
    let sent = Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap();
    assert!(sent.success());
    assert!(!child.wait().unwrap().success());
    assert_eq!(fs::read_dir(room.path("t")).unwrap().count(), 0);
}
