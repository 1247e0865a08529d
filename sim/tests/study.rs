//! Studies as a person or a cluster meets them: killed, resumed, sharded, merged.

#![expect(clippy::unwrap_used, reason = "the helpers of a test may fail as a test does")]

use std::collections::BTreeSet;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

use tempfile::TempDir;

const SCENARIO: &str = include_str!("../scenarios/square8-detection.toml");

fn command(room: &TempDir, args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_quietpath"));
    command.current_dir(room).args(args).stdin(Stdio::null());
    command
}

fn run(room: &TempDir, args: &[&str]) -> Output {
    command(room, args).output().unwrap()
}

fn good(room: &TempDir, args: &[&str]) -> String {
    let output = run(room, args);
    assert!(output.status.success(), "{args:?}\n{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

fn room() -> TempDir {
    let room = TempDir::new().unwrap();
    std::fs::write(room.path().join("s.toml"), SCENARIO).unwrap();
    good(&room, &["plan", "s.toml", "--plan", "plan.json"]);
    room
}

fn lines(path: &Path) -> Vec<String> {
    let text = std::fs::read_to_string(path).unwrap_or_default();
    text.split_inclusive('\n').filter(|line| line.ends_with('\n')).map(str::to_owned).collect()
}

/// Heading and runs, in whatever order they are.
fn content(path: &Path) -> BTreeSet<String> {
    lines(path).into_iter().collect()
}

/// Kills a study once it has written some runs; returns how many.
fn killed(mut child: Child, file: &Path) -> usize {
    for _ in 0..1000 {
        std::thread::sleep(Duration::from_millis(5));
        if lines(file).len() > 40 {
            break;
        }
    }
    child.kill().unwrap();
    child.wait().unwrap();
    lines(file).len() - 1
}

#[test]
fn a_study_that_is_killed_goes_on_and_ends_as_if_it_had_not_been() {
    let room = room();
    let args = ["study", "s.toml", "--plan", "plan.json", "--runs", "600", "--out"];
    let whole = good(&room, &[&args[..], &["whole"]].concat());
    let file = room.path().join("cut/runs.jsonl");
    let child =
        command(&room, &[&args[..], &["cut"]].concat()).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let before = killed(child, &file);
    assert!((1..600).contains(&before), "{before} runs before the end: nothing is tested");
    let kept = content(&file);
    let output = run(&room, &[&args[..], &["cut"]].concat());
    let words = String::from_utf8(output.stderr).unwrap();
    assert!(words.contains(&format!("{before} runs are there, {} are to be flown", 600 - before)), "{words}");
    assert!(kept.is_subset(&content(&file)), "what was there stays");
    assert_eq!(content(&file), content(&room.path().join("whole/runs.jsonl")));
    assert_eq!(String::from_utf8(output.stdout).unwrap().replace("cut/", "whole/"), whole);
    let summary = |folder: &str| std::fs::read(room.path().join(folder).join("summary.json")).unwrap();
    assert_eq!(summary("cut"), summary("whole"));
}

#[test]
fn shards_put_together_are_the_study() {
    let room = room();
    let args = ["study", "s.toml", "--plan", "plan.json", "--runs", "41", "--out"];
    good(&room, &[&args[..], &["whole"]].concat());
    for shard in ["1/3", "2/3", "3/3"] {
        good(&room, &[&args[..], &["parts", "--shard", shard]].concat());
    }
    let parts = ["parts/runs-1-of-3.jsonl", "parts/runs-2-of-3.jsonl", "parts/runs-3-of-3.jsonl"];
    let counts: Vec<usize> = parts.iter().map(|part| lines(&room.path().join(part)).len() - 1).collect();
    assert_eq!(counts, [14, 14, 13]);
    good(&room, &[&["merge", "--out", "merged"][..], &parts].concat());
    let summary = |folder: &str| std::fs::read(room.path().join(folder).join("summary.json")).unwrap();
    assert_eq!(summary("merged"), summary("whole"));
    assert_eq!(content(&room.path().join("merged/runs.jsonl")), content(&room.path().join("whole/runs.jsonl")));
    let lacking = run(&room, &["merge", "--out", "half", parts[0]]);
    assert!(String::from_utf8(lacking.stderr).unwrap().contains("26 of the runs below 40 are in none"));
}

#[test]
fn what_is_wrong_is_said() {
    let room = room();
    std::fs::write(room.path().join("bare.toml"), SCENARIO.split("[study]").next().unwrap()).unwrap();
    let says = |args: &[&str], words: &str| {
        let output = run(&room, args);
        let text = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{text}");
        assert!(text.contains(words), "{text}");
    };
    says(&["study", "bare.toml"], "bare.toml has no [study]: nothing says what varies");
    says(&["study", "s.toml", "--shard", "4/3"], "write I/N with I from 1 to N");
    says(&["merge", "s.toml"], "s.toml:1: is no line of a study");
    good(&room, &["study", "s.toml", "--plan", "plan.json", "--runs", "3", "--out", "a"]);
    std::fs::write(room.path().join("s.toml"), SCENARIO.replace("path_loss = 0.05", "path_loss = 0.06")).unwrap();
    says(
        &["study", "s.toml", "--plan", "plan.json", "--runs", "3", "--out", "a"],
        "holds runs of another scenario file",
    );
    let negative = SCENARIO.replace("sensor_position = 0.2", "sensor_position = -0.2");
    std::fs::write(room.path().join("s.toml"), negative).unwrap();
    says(&["study", "s.toml"], "study.sensor_position must not be negative, but is -0.2");
}
