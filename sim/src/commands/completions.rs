//! `quietpath completions`: what a shell needs to complete our command line.

use clap::CommandFactory as _;

use crate::cli::{Cli, CompletionsArgs};
use crate::outcome::{Failure, Stream, Verdict, say};

/// Prints the completions of a shell.
///
/// # Errors
/// Where standard output cannot be written.
pub fn run(args: &CompletionsArgs) -> Result<Verdict, Failure> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "quietpath", &mut script);
    say(Stream::Out, &String::from_utf8_lossy(&script))?;
    Ok(Verdict::Done)
}
