//! The tour of the README, walked: every command of it runs, and leaves what it says.

#![cfg(unix)]
#![expect(clippy::unwrap_used, reason = "the helpers of a test may fail as a test does")]

use std::path::Path;
use std::process::{Command, Stdio};

use tempfile::TempDir;

const README: &str = include_str!("../../README.md");
const SECTION: &str = "## Five minutes";

/// The commands of a section: lines of its `sh` blocks.
fn commands(section: &str) -> Vec<String> {
    let (_, rest) = README.split_once(section).expect("the section");
    let text = rest.split("\n## ").next().unwrap();
    let blocks = text.split("```sh").skip(1).map(|block| block.split("```").next().unwrap());
    blocks.flat_map(str::lines).map(str::trim).filter(|line| !line.is_empty()).map(str::to_owned).collect()
}

#[test]
fn every_command_of_the_tour_runs() {
    let room = TempDir::new().unwrap();
    let top = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    // The tour starts at the top of the repository; what it writes belongs elsewhere.
    std::fs::create_dir(room.path().join("sim")).unwrap();
    std::os::unix::fs::symlink(top.join("sim/scenarios"), room.path().join("sim/scenarios")).unwrap();
    let mut walked = 0;
    for command in commands(SECTION) {
        let words: Vec<&str> = command.split_whitespace().collect();
        let [program, arguments @ ..] = words.as_slice() else { panic!("{command}") };
        if *program == "cargo" {
            assert_eq!(
                arguments,
                ["install", "--path", "sim"],
                "what cannot be walked here must be known: {command}"
            );
            continue;
        }
        assert_eq!(*program, "quietpath", "{command}");
        let mut child = Command::new(env!("CARGO_BIN_EXE_quietpath"));
        let output = child.current_dir(&room).args(arguments).stdin(Stdio::null()).output().unwrap();
        assert!(output.status.success(), "{command}\n{}", String::from_utf8_lossy(&output.stderr));
        walked += 1;
    }
    assert!(walked >= 6, "{walked} commands");
    // The table of files is about the first plan.
    let (_, table) = README.split_once("| file | what it is |").unwrap();
    for row in table.lines().skip(2).take_while(|line| line.trim_start().starts_with('|')) {
        for file in row.split('|').nth(1).unwrap().split('`').skip(1).step_by(2) {
            assert!(room.path().join("out/hide").join(file).is_file(), "{file}");
        }
    }
}
