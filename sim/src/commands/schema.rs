//! `quietpath schema`: what editors need to complete and check scenario files.

use crate::outcome::{Failure, Stream, Verdict, say};

/// Prints the JSON Schema.
///
/// # Errors
/// Where it cannot be written.
pub fn run() -> Result<Verdict, Failure> {
    say(Stream::Out, &quietpath_bridge::file::schema::scenario_schema())?;
    Ok(Verdict::Done)
}
