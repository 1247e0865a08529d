//! Instructions of one plan, by valgrind's callgrind: a figure that does not depend on what else the machine does.
//!
//! It counts the whole program: reading the scenario is part of it, and hardly shows. A function's share includes what
//! it calls, as long as the compiler left it a function.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

use anyhow::{Context, bail};
use clap::ValueEnum;

/// Functions that are listed.
const LISTED: usize = 25;
/// Part of a name that a listed function has.
const OURS: &str = "quietpath_core::";

/// How the program that is counted is compiled.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Profile {
    /// As it is used.
    Release,
    /// As it is tested: its figures are higher, and change with the same changes.
    Dev,
}

impl Profile {
    /// What builds it.
    const fn arguments(self) -> &'static [&'static str] {
        match self {
            Self::Release => &["build", "--release", "--quiet", "--package", "quietpath-tests", "--bin", "one_plan"],
            // Tests of a package are built with its programs, and all of the workspace with the same features.
            Self::Dev => &["test", "--no-run", "--quiet", "--workspace", "--test", "interoperate"],
        }
    }

    /// Where it lies.
    const fn program(self) -> &'static str {
        match self {
            Self::Release => "target/release/one_plan",
            Self::Dev => "target/debug/one_plan",
        }
    }
}

/// Counts, and prints; false where a program failed.
///
/// # Errors
/// A program that cannot be started: cargo, valgrind.
pub fn count(scenario: &str, profile: Profile, top: &Path) -> anyhow::Result<bool> {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    if !Command::new(cargo)
        .args(profile.arguments())
        .current_dir(top)
        .status()
        .context("cannot start cargo")?
        .success()
    {
        bail!("the program to count does not build");
    }
    let found = top.join("target/callgrind.out");
    let run = Command::new("valgrind")
        .args(["--tool=callgrind", &format!("--callgrind-out-file={}", found.display()), "--main-stacksize=67108864"])
        .arg(top.join(profile.program()))
        .arg(scenario)
        .current_dir(top)
        .output()
        .context("cannot start valgrind: install it, `apt-get install valgrind` or the like")?;
    let said = String::from_utf8_lossy(&run.stderr);
    if !run.status.success() {
        bail!("valgrind failed:\n{said}");
    }
    print!("{}", String::from_utf8_lossy(&run.stdout));
    let total = said.lines().find_map(|line| line.split_once("Collected : ")).context("valgrind counted nothing")?.1;
    println!("instructions: {total}");
    by_function(&found, top)
}

/// Prints the functions of the core with what they call.
fn by_function(found: &Path, top: &Path) -> anyhow::Result<bool> {
    let listing = Command::new("callgrind_annotate")
        .args(["--inclusive=yes", "--threshold=100", "--auto=no"])
        .arg(found)
        .current_dir(top)
        .output()
        .context("cannot start callgrind_annotate, which comes with valgrind")?;
    println!("by function, with what it calls:");
    // A function comes once for each place that it is inlined into and once for itself: the largest stands first.
    let mut seen = BTreeSet::new();
    let listed = String::from_utf8_lossy(&listing.stdout);
    let lines = listed.lines().filter(|line| line.contains(OURS)).map(shortened);
    let names = lines.filter(|line| seen.insert(line.rsplit(' ').next().unwrap_or_default().to_owned()));
    for line in names.take(LISTED) {
        println!("{line}");
    }
    Ok(listing.status.success())
}

/// A line of the listing without file, object and generic arguments.
fn shortened(line: &str) -> String {
    let (figures, name) = line.split_once(OURS).unwrap_or((line, ""));
    let numbers = figures.rsplit_once(' ').map_or(figures, |(numbers, _)| numbers);
    let name = name.split(" [").next().unwrap_or_default();
    let (mut depth, mut short) = (0_usize, String::new());
    for letter in name.chars() {
        match letter {
            '<' => depth += 1,
            '>' => depth = depth.saturating_sub(1),
            _ if depth == 0 => short.push(letter),
            _ => {}
        }
    }
    format!("{} {short}", numbers.trim_end())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_keeps_its_figures_and_its_name() {
        let line = "12,345 (12.30%)  core/src/objective.rs:quietpath_core::objective::gradient<f64, 2> [target/one]";
        assert_eq!(shortened(line), "12,345 (12.30%) objective::gradient");
    }
}
