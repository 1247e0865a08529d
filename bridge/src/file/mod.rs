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

use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

/// Largest file that is read, bytes: far more than the largest scenario or plan that fits this build.
pub const FILE_MAX: u64 = 32 << 20;

/// Reads a whole file, up to [`FILE_MAX`].
///
/// # Errors
/// The file cannot be read, or is larger.
pub fn read_limited(path: &Path) -> io::Result<Vec<u8>> {
    limited(File::open(path)?)
}

/// Puts `bytes` in the place of what a file holds. A crash, or a loss of power, leaves the old content or the new one; once
/// this has returned, the new one.
///
/// # Errors
/// The file, or `PATH.new` beside it, cannot be written.
pub fn replace(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut beside = path.as_os_str().to_owned();
    beside.push(".new");
    let beside = PathBuf::from(beside);
    let mut file = File::create(&beside)?;
    file.write_all(bytes)?;
    file.sync_all()?;
    fs::rename(&beside, path)?;
    // A name is on the disk once its folder is. Not every file system can be asked for that, and none loses more than this.
    if let Some(folder) = path.parent() {
        let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
        let _ = File::open(folder).and_then(|folder| folder.sync_all());
    }
    Ok(())
}

fn limited(source: impl Read) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    source.take(FILE_MAX + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > FILE_MAX {
        return Err(io::Error::new(io::ErrorKind::FileTooLarge, format!("it has more than {FILE_MAX} bytes")));
    }
    Ok(bytes)
}

/// Reads a text file, or standard input where `path` is `-`: what errors call it, and its text.
fn read_text(path: &str, help: &str) -> Result<(String, String), Box<FileError>> {
    let name = if path == "-" { "<stdin>" } else { path };
    let read = match path {
        "-" => limited(io::stdin().lock()),
        _ => read_limited(Path::new(path)),
    };
    let failed = |message: String| Box::new(FileError::whole(name, message, help));
    let bytes = read.map_err(|error| failed(format!("cannot be read: {error}")))?;
    let text = String::from_utf8(bytes).map_err(|_| failed("is not text in UTF-8".to_owned()))?;
    Ok((name.to_owned(), text))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_without_end_is_refused() {
        let error = limited(io::repeat(b' ')).expect_err("it has no end");
        assert_eq!(error.to_string(), "it has more than 33554432 bytes");
        let error = ScenarioFile::read("/dev/zero").expect_err("it has no end").to_string();
        assert!(error.contains("/dev/zero") && error.contains("more than 33554432 bytes"), "{error}");
        assert_eq!(limited(&b"abc"[..]).expect("short"), b"abc");
    }

    #[test]
    fn what_cannot_be_replaced_stays() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("state");
        replace(&path, b"old").expect("written");
        // Something is in the way of the file beside it.
        let beside = folder.path().join("state.new");
        fs::create_dir(&beside).expect("a folder");
        assert!(replace(&path, b"new").is_err());
        assert_eq!(fs::read(&path).expect("there"), b"old");
        fs::remove_dir(&beside).expect("removed");
        // What a crash left there does not matter.
        fs::write(&beside, b"a part of something longer").expect("written");
        replace(&path, b"new").expect("written");
        assert_eq!(fs::read(&path).expect("there"), b"new");
        assert!(!beside.exists());
    }
}
