//! What the program is made of, as a library for the whole-system tests.
//!
//! | module | what |
//! |---|---|
//! | [`autopilot`] | a simulated autopilot |
//! | [`cli`] | the command line: arguments and their explanations |
//! | [`commands`] | what each command does |
//! | [`outcome`] | exit statuses, error messages, standard streams, progress |
//! | [`rehearsal`] | a whole flight in one process: bridge, autopilot, wires, one clock |
//! | [`report`] | the summaries and tables that commands print |
//! | [`illustrate`] | from plans to pictures |
//! | [`picture`] | drawing: landscapes and series as SVG and PNG |
//! | [`trade`] | plans over a range of deadlines or budgets |
//! | [`units`] | from the scenario's units to the ones that people read |

pub mod autopilot;
pub mod cli;
pub mod commands;
pub mod illustrate;
pub mod outcome;
pub mod picture;
pub mod rehearsal;
pub mod report;
pub mod trade;
pub mod units;

/// Carries out a command line; returns the exit status.
#[must_use]
pub fn run(cli: cli::Cli) -> u8 {
    match commands::run(cli) {
        Ok(verdict) => verdict.status(),
        Err(failure) => {
            outcome::report(&failure);
            failure.status()
        }
    }
}
