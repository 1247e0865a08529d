//! What each command does.

pub mod autopilot;
pub mod check;
pub mod completions;
pub mod fly;
pub mod import;
pub mod landscape;
pub mod new;
pub mod plan;
pub mod report;
pub mod schema;
pub mod steps;
pub mod study;
pub mod trade;
pub mod view;

use quietpath_bridge::file::ScenarioFile;

use crate::cli::{Cli, Command};
use crate::outcome::{Failure, Stream, Verdict, say};

/// Carries out a command.
///
/// # Errors
/// Bad input, or output that cannot be written.
pub fn run(cli: Cli) -> Result<Verdict, Failure> {
    match cli.command {
        None => fly::built_in(),
        Some(Command::Plan(args)) => plan::run(&args),
        Some(Command::Fly(args)) => fly::run(&args),
        Some(Command::View(args)) => view::run(&args),
        Some(Command::Trade(args)) => trade::run(&args),
        Some(Command::Landscape(args)) => landscape::run(&args),
        Some(Command::Check(args)) => check::run(&args),
        Some(Command::Report(args)) => report::run(&args),
        Some(Command::Study(args)) => study::run(&args),
        Some(Command::Merge(args)) => study::merge(&args),
        Some(Command::Import(args)) => import::run(&args),
        Some(Command::Schema) => schema::run(),
        Some(Command::New(args)) => new::run(&args),
        Some(Command::Autopilot(args)) => autopilot::run(&args),
        Some(Command::Completions(args)) => completions::run(&args),
    }
}

/// Reads a scenario (`-` is standard input); what is odd about it goes to standard error.
fn load(path: &str) -> Result<ScenarioFile, Failure> {
    let loaded = ScenarioFile::read(path)?;
    for warning in &loaded.warnings {
        say(Stream::Err, &format!("{warning}\n"))?;
    }
    Ok(loaded.scenario)
}
