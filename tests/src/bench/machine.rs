//! Where and when: the processor, the load, the versions.

use std::path::Path;
use std::process::Command;

use crate::repository;

/// One paragraph that says on what the figures were measured.
#[must_use]
pub fn described() -> String {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let date = spoken("date", &["-u", "+%Y-%m-%d %H:%M UTC"]).unwrap_or_else(|| "an unknown date".into());
    let compiler = spoken("rustc", &["--version"]).unwrap_or_else(|| "an unknown compiler".into());
    let mut text = format!(
        "Measured on {date}, {}, {cores} cores ({}), {compiler}, commit {}.",
        processor(),
        std::env::consts::OS,
        commit()
    );
    if let Some(load) = load().filter(|load| *load > 1.0) {
        text.push_str(&format!(" **The machine was busy** (load {load:.1}): times are too long, ratios less so."));
    }
    text
}

fn processor() -> String {
    let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = info.lines().find_map(|line| line.strip_prefix("model name")?.split_once(": "));
    model.map_or_else(|| std::env::consts::ARCH.to_owned(), |(_, name)| name.to_owned())
}

fn commit() -> String {
    let hash = spoken("git", &["rev-parse", "--short", "HEAD"]).unwrap_or_else(|| "unknown".into());
    let changed = spoken("git", &["status", "--porcelain", "--", "core", "bridge", "sim", "tests"]);
    if changed.is_some_and(|list| !list.is_empty()) { format!("{hash} with changes") } else { hash }
}

/// Mean number of runnable processes of the last minute.
fn load() -> Option<f64> {
    std::fs::read_to_string("/proc/loadavg").ok()?.split(' ').next()?.parse().ok()
}

fn spoken(program: &str, arguments: &[&str]) -> Option<String> {
    let output = Command::new(program).args(arguments).current_dir(repository()).output().ok()?;
    output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

/// The Python of the peers' own environment; made, with its packages, where it is missing.
///
/// # Errors
/// What Python or its package installer say.
pub fn python() -> Result<std::path::PathBuf, String> {
    let folder = repository().join("target/peer/venv");
    let python = folder.join("bin/python");
    if is_ready(&python) {
        return Ok(python);
    }
    println!("making {} with casadi, numpy and scipy", folder.display());
    run(Command::new("python3").args(["-m", "venv"]).arg(&folder))?;
    run(Command::new(&python).args(["-m", "pip", "install", "--quiet", "casadi", "numpy", "scipy"]))?;
    Ok(python)
}

fn is_ready(python: &Path) -> bool {
    let asked = Command::new(python).args(["-c", "import casadi, numpy, scipy"]).output();
    asked.is_ok_and(|output| output.status.success())
}

fn run(command: &mut Command) -> Result<(), String> {
    let output = command.output().map_err(|error| format!("{command:?}: {error}"))?;
    if output.status.success() {
        return Ok(());
    }
    let said = String::from_utf8_lossy(&output.stderr);
    Err(format!("{command:?}: {}", said.lines().last().unwrap_or("failed without a word")))
}
