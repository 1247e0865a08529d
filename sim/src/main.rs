//! The quietpath program.

use std::process::ExitCode;

use clap::Parser as _;

fn main() -> ExitCode {
    ExitCode::from(quietpath_sim::run(quietpath_sim::cli::Cli::parse()))
}
