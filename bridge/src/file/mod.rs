//! The files that people and programs exchange: scenarios in, plans and missions out.
//!
//! Every error is a [`FileError`]: file, line, field, what is wrong, and what would be right.

mod error;
pub mod geojson;
pub mod mission;
pub mod plan;
mod reader;
pub mod scenario;
pub mod schema;

pub use error::{FileError, Place, Warning};
pub use plan::PlanFile;
pub use scenario::ScenarioFile;

use std::io::Read;

/// Reads a text file, or standard input where `path` is `-`: what errors call it, and its text.
fn read_text(path: &str, help: &str) -> Result<(String, String), Box<FileError>> {
    let name = if path == "-" { "<stdin>" } else { path };
    let mut bytes = Vec::new();
    let read = match path {
        "-" => std::io::stdin().read_to_end(&mut bytes).map(|_| ()),
        _ => std::fs::read(path).map(|content| bytes = content),
    };
    let failed = |message: String| Box::new(FileError::whole(name, message, help));
    read.map_err(|error| failed(format!("cannot be read: {error}")))?;
    let text = String::from_utf8(bytes).map_err(|_| failed("is not text in UTF-8".to_owned()))?;
    Ok((name.to_owned(), text))
}
