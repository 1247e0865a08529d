//! `quietpath-bridge`: what an integrator installs next to an autopilot.
//!
//! | command | what |
//! |---|---|
//! | `run` | flies a plan |
//! | `upload` | uploads the mission and the fence of a plan, and reads them back |
//! | `download` | writes what the autopilot holds |
//! | `status` | says who is there, how good the link is, and the value of parameters |
//! | `observe` | sends observations to a bridge, sealed |
//! | `replay` | feeds a record to a new flight and compares |
//!
//! | exit status | meaning |
//! |---|---|
//! | 0 | done |
//! | 1 | it could not be done: refused, lost, no plan left |
//! | 2 | bad input: configuration, files, arguments |
//! | 3 | a person took over |
//! | 4 | ended by a signal |
//! | 70 | a fault of the program; payloads were silenced |

mod cli;
mod config;
mod observe;
mod run;
mod state;
mod station;
mod transfer;

use std::io::{IsTerminal, Write as _};
use std::process::ExitCode;

use clap::Parser;
use quietpath_bridge::record::{self, Ending};
use tracing_subscriber::EnvFilter;

use cli::{Arguments, Command};

/// How a command ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// Done.
    Done,
    /// It could not be done.
    Failed(String),
    /// Bad input.
    Input(String),
    /// A person took over.
    Released(String),
    /// A signal.
    Stopped(String),
    /// A fault of the program.
    Fault(String),
}

impl Outcome {
    fn status(&self) -> u8 {
        match self {
            Self::Done => 0,
            Self::Failed(_) => 1,
            Self::Input(_) => 2,
            Self::Released(_) => 3,
            Self::Stopped(_) => 4,
            Self::Fault(_) => 70,
        }
    }
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let filter = EnvFilter::try_from_env("QUIETPATH_LOG").unwrap_or_else(|_| EnvFilter::new("info"));
    let is_terminal = std::io::stderr().is_terminal();
    // A log that cannot be written must not end a flight, and telling so on standard error would.
    let log = tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr);
    log.log_internal_errors(false).with_ansi(is_terminal).init();
    let outcome = match &arguments.command {
        Command::Run(args) => run::run(args),
        Command::Upload(args) => transfer::upload(args),
        Command::Download(args) => transfer::download(args),
        Command::Status(args) => station::status(args),
        Command::Observe(args) => observe::observe(args),
        Command::Replay { record, quiet } => replay(record, *quiet),
    };
    match &outcome {
        Outcome::Done => {}
        Outcome::Input(why)
        | Outcome::Failed(why)
        | Outcome::Released(why)
        | Outcome::Stopped(why)
        | Outcome::Fault(why) => {
            let _ = writeln!(std::io::stderr(), "quietpath-bridge: {why}");
        }
    }
    ExitCode::from(outcome.status())
}

fn replay(path: &std::path::Path, quiet: cli::Quiet) -> Outcome {
    let each = |time: quietpath_bridge::clock::Time, outputs: &[String]| {
        if quiet == cli::Quiet::No {
            for output in outputs {
                println!("{:12.6} {output}", time.seconds());
            }
        }
    };
    match record::replay(path, each) {
        Ok(replayed) => {
            eprintln!("{} inputs gave the same {} outputs, bit for bit", replayed.inputs, replayed.outputs);
            if let Ending::Cut { line } = replayed.ending {
                let seconds = replayed.last.seconds();
                eprintln!("the record ends in line {line}, after {seconds:.3} s: its program was killed there");
            }
            Outcome::Done
        }
        Err(error) => Outcome::Input(error.to_string()),
    }
}
