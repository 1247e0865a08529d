//! Tests of the nightly toolchain's watchers, and the pages of what came of them.
//!
//! A watcher is anything that sees more than whether a test passes: an interpreter, or instrumented code.

use std::fmt::Write as _;
use std::io::{BufRead as _, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Instant;

use anyhow::Context as _;

/// What the pages' commands need.
const MISSING: &str = "cannot start: rustup toolchain install nightly --component miri,rust-src";

/// Tests that run under a watch.
pub struct Watch {
    pub what: &'static str,
    /// Of cargo.
    pub arguments: String,
    pub environment: Vec<(&'static str, String)>,
}

/// A page of what came of tests under a watch.
pub struct Page {
    /// Its heading.
    pub title: &'static str,
    /// The command that writes it.
    pub command: &'static str,
    /// Where it lies.
    pub place: &'static str,
}

/// What came of them.
struct Watched {
    what: &'static str,
    shown: String,
    counts: Counts,
    seconds: u64,
    good: bool,
}

/// Tests that passed, failed, and were left out because they are ignored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Counts {
    passed: u64,
    failed: u64,
    ignored: u64,
}

/// Runs all watches and writes the page; whether nothing was found.
///
/// # Errors
/// A program that cannot be started, or a page that cannot be written.
pub fn all(watches: &[Watch], page: &Page, top: &Path) -> anyhow::Result<bool> {
    let mut found = Vec::new();
    for (index, watch) in watches.iter().enumerate() {
        println!("[{}/{}] {}", index + 1, watches.len(), watch.what);
        found.push(run(watch, top)?);
    }
    let text = page.text(&made(top)?, &found);
    print!("{text}");
    let place = top.join(page.place);
    std::fs::write(&place, text).with_context(|| format!("cannot write {}", place.display()))?;
    println!("written to {}", place.display());
    Ok(found.iter().all(|watched| watched.good))
}

fn run(watch: &Watch, top: &Path) -> anyhow::Result<Watched> {
    let begin = Instant::now();
    let mut command = Command::new("rustup");
    command.args(["run", "nightly", "cargo"]).args(watch.arguments.split_whitespace());
    command.envs(watch.environment.iter().map(|(name, value)| (name, value)));
    let mut child = command.current_dir(top).stdout(Stdio::piped()).spawn().context(MISSING)?;
    let mut counts = Counts::default();
    for line in child.stdout.take().into_iter().flat_map(|out| BufReader::new(out).lines()) {
        let line = line?;
        println!("{line}");
        counts.add(&line);
    }
    let good = child.wait()?.success() && counts.passed > 0 && counts.failed == 0;
    let environment: String = watch.environment.iter().map(|(name, value)| format!("{name}={value} ")).collect();
    let shown = format!("{environment}cargo +nightly {}", watch.arguments);
    Ok(Watched { what: watch.what, shown, counts, seconds: begin.elapsed().as_secs(), good })
}

impl Counts {
    /// Adds what a line of the test harness says, if it says how many there were.
    fn add(&mut self, line: &str) {
        let Some(said) = line.strip_prefix("test result: ") else { return };
        let words: Vec<&str> = said.split_whitespace().collect();
        for pair in words.windows(2) {
            let [number, what] = *pair else { continue };
            let Ok(number) = number.parse::<u64>() else { continue };
            match what {
                "passed;" => self.passed += number,
                "failed;" => self.failed += number,
                "ignored;" => self.ignored += number,
                _ => {}
            }
        }
    }
}

/// When, of what and by which compiler a page is made.
///
/// # Errors
/// A program that cannot be started.
pub fn made(top: &Path) -> anyhow::Result<String> {
    let said = |program: &str, arguments: &[&str]| -> anyhow::Result<String> {
        let output = Command::new(program).args(arguments).current_dir(top).output();
        let output = output.with_context(|| format!("cannot start {program}"))?;
        Ok(String::from_utf8_lossy(&output.stdout).trim().to_owned())
    };
    let date = said("date", &["-u", "+%Y-%m-%d"])?;
    let commit = said("git", &["describe", "--always", "--dirty"])?;
    let compiler = said("rustup", &["run", "nightly", "rustc", "--version"])?;
    Ok(format!("on {date}, of {commit}, by {compiler}"))
}

impl Page {
    fn text(&self, made: &str, found: &[Watched]) -> String {
        let Self { title, command, .. } = self;
        let mut out = format!(
            "# {title}\n\nWritten by `{command}` {made}.\n\n\
         | tests | passed | failed | ignored | seconds, built too | result |\n|---|---|---|---|---|---|\n"
        );
        for Watched { what, counts: Counts { passed, failed, ignored }, seconds, good, .. } in found {
            let result = if *good { "nothing found" } else { "FOUND SOMETHING" };
            let _ = writeln!(out, "| {what} | {passed} | {failed} | {ignored} | {seconds} | {result} |");
        }
        out.push_str("\nThe commands:\n\n```sh\n");
        for watched in found {
            let _ = writeln!(out, "{}", watched.shown);
        }
        out.push_str("```\n");
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tests_are_counted_and_what_is_found_stands_out() {
        let mut counts = Counts::default();
        for line in [
            "running 3 tests",
            "test result: ok. 12 passed; 0 failed; 3 ignored; 0 measured; 40 filtered out; finished in 0.60s",
            "test result: FAILED. 1 passed; 2 failed; 0 ignored; 0 measured; 0 filtered out; finished in 1.00s",
        ] {
            counts.add(line);
        }
        assert_eq!(counts, Counts { passed: 13, failed: 2, ignored: 3 });
        let watched = |good| Watched { what: "the core", shown: "cargo".into(), counts, seconds: 5, good };
        let page = Page { title: "Watched", command: "cargo xtask watch", place: "" };
        let page = page.text("today", &[watched(true), watched(false)]);
        assert!(page.contains("| the core | 13 | 2 | 3 | 5 | nothing found |"), "{page}");
        assert!(page.contains("| 5 | FOUND SOMETHING |"), "{page}");
    }
}
