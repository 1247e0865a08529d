//! Bad input through the real program: it says what is wrong, where, and what would be right, and ends with status 2.

use std::path::Path;
use std::process::{Command, Output};

/// A good scenario with one thing wrong.
struct Case {
    /// What is wrong, for the test's own messages.
    name: &'static str,
    /// The scenario's text.
    text: String,
    /// Text of the line that the error must point at; its first occurrence counts.
    line: &'static str,
    /// The field that the error must name.
    field: &'static str,
    /// What else it must say: what is wrong, and what would be right.
    says: &'static [&'static str],
}

/// The program, as a user starts it; a backtrace in the environment must not reach the user's eyes.
fn program() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_quietpath"));
    command.env("RUST_BACKTRACE", "1");
    command
}

/// The scenario that the cases spoil.
fn good_scenario() -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios/square8-detection.toml");
    std::fs::read_to_string(path).expect("the scenario")
}

/// `text` with the first `old` replaced, which must be there.
fn with(text: &str, old: &str, new: &str) -> String {
    assert!(text.contains(old), "the scenario has no `{old}`");
    text.replacen(old, new, 1)
}

/// Everything from the first `marker` on cut off.
fn until(text: &str, marker: &str) -> String {
    text.split(marker).next().unwrap_or_default().to_owned()
}

const SENSOR: &str = "\n[[sensor]]\nposition = [1.0, 1.0]\n";
const AGENT: &str = "\n[[agent]]\nstart = [1.0, 1.0]\ngoal = [2.0, 1.0]\nspeed_max = 0.1\naccel_max = 0.02\n";

fn wrong_numbers(good: &str) -> Vec<Case> {
    let speed = |name, value: &str, line, says| {
        let text = with(good, "speed_max = 0.1", &format!("speed_max = {value}"));
        Case { name, text, line, field: "agent[0].speed_max", says }
    };
    vec![
        speed("a number that is NaN", "nan", "speed_max = nan", &["not a finite number"]),
        speed("an infinite number", "inf", "speed_max = inf", &["not a finite number"]),
        speed("a negative speed", "-0.1", "speed_max = -0.1", &["-0.1", "greater than 0"]),
        Case {
            name: "NaN within a position",
            text: with(good, "position = [5.0, 1.5]", "position = [5.0, nan]"),
            line: "position = [5.0, nan]",
            field: "sensor[1].position",
            says: &["not a finite number"],
        },
        Case {
            name: "a start outside the domain",
            text: with(good, "start = [0.8, 1.0]", "start = [0.8, -1.0]"),
            line: "start = [0.8, -1.0]",
            field: "agent[0].start",
            says: &["outside the domain", "between 0 and 10"],
        },
        Case {
            name: "a goal too far for the time there is",
            text: with(good, "\nmax = 300.0", "\nmax = 90.0"),
            line: "goal = [8.5, 6.7]",
            field: "agent[0].goal",
            says: &["cannot be reached", "95.80", "90"],
        },
    ]
}

fn wrong_structure(good: &str) -> Vec<Case> {
    vec![
        Case { name: "broken TOML", text: with(good, "[grid]", "[grid"), line: "[grid", field: "", says: &["]"] },
        Case {
            name: "an unknown key",
            text: with(good, "speed_max = 0.1", "speed_mx = 0.1"),
            line: "speed_mx = 0.1",
            field: "agent[0].speed_mx",
            says: &["`speed_max`"],
        },
        Case {
            name: "an empty objective",
            text: until(good, "[[objective.term]]"),
            line: "",
            field: "objective.term",
            says: &["metric"],
        },
        Case {
            name: "a track whose times do not increase",
            text: with(
                good,
                "position = [2.0, 2.0]",
                "track = [{ t = 0.0, position = [2.0, 2.0] }, { t = 9.0, position = [3.0, 2.0] }, { t = 9.0, position = [4.0, 2.0] }]",
            ),
            line: "track = [",
            field: "sensor[0].track",
            says: &["later than", "9 s follows 9 s"],
        },
        Case {
            name: "too few ranging sensors for the metric",
            text: format!(
                "{}\n[[objective.term]]\nmetric = \"log_cep\"\n",
                good.replace("\nranging = ", "\n# ranging = ")
            ),
            line: "metric = \"log_cep\"",
            field: "objective.term[1].metric",
            says: &["3 sensors", "`ranging`", "there are 0"],
        },
    ]
}

fn too_large(good: &str) -> Vec<Case> {
    vec![
        Case {
            name: "more intervals than fit",
            text: with(good, "intervals = 60", "intervals = 600"),
            line: "intervals = 600",
            field: "grid.intervals",
            says: &["600", "512"],
        },
        Case {
            name: "more sensors than fit",
            text: format!("{good}{}", SENSOR.repeat(121)),
            line: "",
            field: "sensor",
            says: &["129", "128"],
        },
        Case {
            name: "more agents than fit",
            text: format!("{good}{}", AGENT.repeat(8)),
            line: "",
            field: "agent",
            says: &["9", "8"],
        },
    ]
}

/// Runs `quietpath plan` on a file with the given text.
fn plan(text: &str) -> Output {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("bad.toml"), text).expect("a file");
    let output = program().args(["plan", "bad.toml"]).current_dir(folder.path()).output();
    output.expect("the program starts")
}

/// Panics unless the program ended as it must on bad input; returns what it said.
fn refusal(name: &str, output: &Output) -> String {
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{name}: status, with\n{said}");
    assert!(output.stdout.is_empty(), "{name}: bad input prints nothing on standard output");
    for word in ["panicked", "backtrace", "RUST_BACKTRACE", ".rs:"] {
        assert!(!said.contains(word), "{name}: a user should not see `{word}` in\n{said}");
    }
    said
}

#[test]
fn bad_scenarios_are_refused_with_line_field_and_remedy() {
    let good = good_scenario();
    for case in wrong_numbers(&good).iter().chain(&wrong_structure(&good)).chain(&too_large(&good)) {
        let said = refusal(case.name, &plan(&case.text));
        let line = case.text.lines().position(|line| line.contains(case.line)).map(|index| index + 1);
        let place = match (case.line, line) {
            ("", _) => String::from("bad.toml:"),
            (_, Some(line)) => format!("bad.toml:{line}: "),
            (_, None) => panic!("{}: the test itself has no line `{}`", case.name, case.line),
        };
        for expected in [place.as_str(), case.field].iter().chain(case.says) {
            assert!(said.contains(expected), "{}: `{expected}` is missing from\n{said}", case.name);
        }
        assert!(said.contains("help: "), "{}: nothing says what would be right in\n{said}", case.name);
    }
}

#[test]
fn missing_file_is_refused_by_name() {
    let output = program().args(["plan", "no-such-file.toml"]).output().expect("the program starts");
    let said = refusal("a missing file", &output);
    assert!(said.contains("no-such-file.toml"), "{said}");
    assert!(said.contains("help: "), "{said}");
}
