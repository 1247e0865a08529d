//! What the program is made of, as a library for the whole-system tests.
//!
//! | module | what |
//! |---|---|
//! | [`advice`] | what is odd about a scenario, before it is planned |
//! | [`autopilot`] | a simulated autopilot |
//! | [`cli`] | the command line: arguments and their explanations |
//! | [`commands`] | what each command does |
//! | [`outcome`] | exit statuses, error messages, standard streams, progress |
//! | [`rehearsal`] | a whole flight in one process: bridge, autopilot, wires, one clock |
//! | [`report`] | the summaries and tables that commands print |
//! | [`fly`] | a scenario, planned and flown over MAVLink |
//! | [`import`](mod@import) | scenarios from the files of others |
//! | [`margins`] | how much room a plan leaves to every constraint |
//! | [`page`] | the report as a page that moves |
//! | [`illustrate`] | from plans to pictures |
//! | [`picture`] | drawing: landscapes and series as SVG and PNG |
//! | [`study`] | one plan, flown many times |
//! | [`trade`] | plans over a range of deadlines or budgets |
//! | [`view`] | the page while a flight goes on |
//! | [`wiretap`] | what went over the wire, for people to read |
//! | [`units`] | from the scenario's units to the ones that people read |

pub mod advice;
pub mod autopilot;
pub mod cli;
pub mod commands;
pub mod fly;
pub mod illustrate;
pub mod import;
pub mod margins;
pub mod outcome;
pub mod page;
pub mod picture;
pub mod rehearsal;
pub mod report;
pub mod study;
pub mod trade;
pub mod units;
pub mod view;
pub mod wiretap;

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
