//! `quietpath new`: a commented scenario to start from.

use std::fs::File;
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
    let mut file = create(&args.file, args.force)?;
    file.write_all(STARTER.as_bytes()).map_err(|cause| Failure::write(&args.file, &cause))?;
    say(Stream::Out, &format!("wrote {shown}\nnext: quietpath plan {shown} --out out\n"))?;
    Ok(Verdict::Done)
}

/// Makes a file that is not there yet, or with `force` anew.
pub(super) fn create(path: &Path, force: bool) -> Result<File, Failure> {
    let mut options = std::fs::OpenOptions::new();
    let options = if force { options.create(true).truncate(true) } else { options.create_new(true) };
    options.write(true).open(path).map_err(|cause| match cause.kind() {
        std::io::ErrorKind::AlreadyExists => {
            let shown = path.display();
            Failure::Input(format!("{shown} exists already\n  help: give another name, or --force to overwrite it"))
        }
        _ => Failure::write(path, &cause),
    })
}
