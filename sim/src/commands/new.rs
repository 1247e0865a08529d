//! `quietpath new`: a commented scenario to start from.

use std::io::Write as _;
use std::path::Path;

use crate::cli::NewArgs;
use crate::outcome::{Failure, Stream, Verdict, say};

/// The scenario that `quietpath new` writes.
pub const STARTER: &str = include_str!("../../scenarios/starter.toml");

/// Writes the starter scenario.
///
/// # Errors
/// Where the file exists and is not to be overwritten, or cannot be written.
pub fn run(args: &NewArgs) -> Result<Verdict, Failure> {
    if args.file == Path::new("-") {
        say(Stream::Out, STARTER)?;
        return Ok(Verdict::Done);
    }
    let shown = args.file.display();
    let mut options = std::fs::OpenOptions::new();
    let options = if args.force { options.create(true).truncate(true) } else { options.create_new(true) };
    let mut file = options.write(true).open(&args.file).map_err(|cause| match cause.kind() {
        std::io::ErrorKind::AlreadyExists => {
            Failure::Input(format!("{shown} exists already\n  help: give another name, or --force to overwrite it"))
        }
        _ => Failure::write(&args.file, &cause),
    })?;
    file.write_all(STARTER.as_bytes()).map_err(|cause| Failure::write(&args.file, &cause))?;
    say(Stream::Out, &format!("wrote {shown}\nnext: quietpath plan {shown} --out out\n"))?;
    Ok(Verdict::Done)
}
