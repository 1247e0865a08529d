//! Every fuzz target in turn, and a page of what came of it.
//!
//! New inputs go to `target/fuzz/TARGET`, so that the seeds in `fuzz/corpus` stay what somebody chose. An input that breaks
//! a promise is left in `fuzz/artifacts/TARGET`: make it small with `cargo +nightly fuzz tmin TARGET FILE`, and keep it
//! in `fuzz/corpus/TARGET` under a name that says what it is.

use std::fmt::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Instant;

use anyhow::{Context, bail};

/// Longest that one input may take, s: with sanitizers, on a busy machine.
const INPUT_SECONDS: u64 = 10;
/// The same where it is planned, several times.
const PLAN_SECONDS: u64 = 120;
/// Longest input, bytes.
const INPUT_BYTES: u64 = 8192;
/// Memory that a target may use, MB: the planning threads of the bridge alone reserve 256.
const MEMORY_MB: u64 = 4096;

/// What came of one target.
struct Run {
    target: String,
    inputs: u64,
    seconds: u64,
    seeds: usize,
    /// Edges of the program that were reached by the inputs that were there already, and in the end.
    edges: [u64; 2],
    good: bool,
}

/// Fuzzes every target for some seconds and writes `docs/hardening/fuzz.md`; false where a promise was broken.
///
/// # Errors
/// A program that cannot be started, or a target that does not build.
pub fn fuzz(seconds: u64, only: Option<&str>, top: &Path) -> anyhow::Result<bool> {
    let mut targets: Vec<String> = std::fs::read_dir(top.join("fuzz/fuzz_targets"))?
        .filter_map(|entry| Some(entry.ok()?.path().file_stem()?.to_string_lossy().into_owned()))
        .filter(|name| only.is_none_or(|only| only == name))
        .collect();
    targets.sort();
    if targets.is_empty() {
        bail!("there is no such target: see fuzz/fuzz_targets");
    }
    let mut runs = Vec::new();
    for (index, target) in targets.iter().enumerate() {
        println!("[{}/{}] {target}, {seconds} s", index + 1, targets.len());
        runs.push(run(target, seconds, top)?);
    }
    let page = page(&runs, seconds, &crate::watch::made(top)?);
    print!("{page}");
    if only.is_none() {
        let place = top.join("docs/hardening/fuzz.md");
        std::fs::create_dir_all(top.join("docs/hardening"))?;
        std::fs::write(&place, page).with_context(|| format!("cannot write {}", place.display()))?;
        println!("written to {}", place.display());
    }
    Ok(runs.iter().all(|run| run.good))
}

fn run(target: &str, seconds: u64, top: &Path) -> anyhow::Result<Run> {
    let found = top.join("target/fuzz").join(target);
    std::fs::create_dir_all(&found)?;
    let seeds = top.join("fuzz/corpus").join(target);
    let mut arguments: Vec<String> = ["run", "nightly", "cargo", "fuzz", "run", target].map(String::from).into();
    arguments.extend([found.display().to_string(), seeds.display().to_string()]);
    if target == "scenario" {
        arguments.push(top.join("sim/scenarios").display().to_string());
    }
    let timeout = if target == "problem" { PLAN_SECONDS } else { INPUT_SECONDS };
    let limits = [("max_total_time", seconds), ("timeout", timeout), ("max_len", INPUT_BYTES)];
    arguments.push("--".to_owned());
    arguments.extend(limits.map(|(name, value)| format!("-{name}={value}")));
    arguments.extend([format!("-rss_limit_mb={MEMORY_MB}"), "-print_final_stats=1".to_owned()]);
    let missing = "cannot start cargo-fuzz: rustup toolchain install nightly; cargo install cargo-fuzz";
    let begin = Instant::now();
    let output = Command::new("rustup").args(&arguments).current_dir(top).stdout(Stdio::inherit()).output();
    let output = output.context(missing)?;
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    let figure =
        |name: &str| -> Option<u64> { said.lines().find_map(|line| line.strip_prefix(name)?.trim().parse().ok()) };
    let Some(inputs) = figure("stat::number_of_executed_units:") else {
        bail!("{target} did not run; {missing}\n{said}");
    };
    let good = output.status.success();
    if !good {
        eprintln!("{said}");
    }
    let seeds = std::fs::read_dir(seeds)?.count();
    let seconds = begin.elapsed().as_secs();
    Ok(Run { target: target.to_owned(), inputs, seconds, seeds, edges: edges(&said), good })
}

/// Edges that libFuzzer says it has reached: once it had read what was there, and in the end.
fn edges(said: &str) -> [u64; 2] {
    let of = |line: &str| line.split_once("cov: ")?.1.split(' ').next()?.parse::<u64>().ok();
    let begun = said.lines().find(|line| line.contains("INITED")).and_then(of);
    let ended = said.lines().rev().find_map(of);
    [begun, ended].map(Option::unwrap_or_default)
}

fn page(runs: &[Run], seconds: u64, made: &str) -> String {
    let inputs: u64 = runs.iter().map(|run| run.inputs).sum();
    let hours = runs.iter().map(|run| run.seconds).sum::<u64>() as f64 / 3600.0;
    let mut out = format!(
        "# Fuzzing\n\nWritten by `cargo xtask fuzz {seconds}` {made}: {inputs} inputs in {hours:.2} hours. What the targets \
         promise stands in `tests/abuse/src/lib.rs`; *edges* are places of the program that were reached, by what was there \
         already and in the end.\n\n\
         | target | seeds | inputs | seconds | edges before | edges after | result |\n|---|---|---|---|---|---|---|\n",
    );
    for Run { target, inputs, seconds, seeds, edges: [before, after], good } in runs {
        let result = if *good { "nothing broken" } else { "BROKEN" };
        let _ = writeln!(out, "| {target} | {seeds} | {inputs} | {seconds} | {before} | {after} | {result} |");
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_broken_promise_stands_out() {
        let run = |good| Run { target: "wire".into(), inputs: 7, seconds: 1800, seeds: 2, edges: [3, 4], good };
        let page = page(&[run(true), run(false)], 1800, "today");
        assert!(page.contains("today: 14 inputs in 1.00 hours"), "{page}");
        assert!(
            page.contains("| wire | 2 | 7 | 1800 | 3 | 4 | nothing broken |") && page.contains("BROKEN"),
            "{page}"
        );
    }

    #[test]
    fn edges_are_read() {
        let said = "#1\tINITED cov: 120 ft: 300 corp: 5/1b exec/s: 0\n#9\tNEW    cov: 130 ft: 301\n#20\tDONE   cov: 131 ft: 302";
        assert_eq!(edges(said), [120, 131]);
    }
}
