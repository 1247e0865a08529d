//! The file from which an interrupted flight is picked up.
//!
//! It is written beside and renamed: a crash leaves the old one or the new one. While no plan is flown there is none.

use std::fs;
use std::io::ErrorKind;
use std::path::PathBuf;

use quietpath_bridge::file::{read_limited, replace};
use quietpath_bridge::flight::Journal;

/// Where the journal of a flight is kept.
pub struct State(Option<PathBuf>);

impl State {
    /// Nowhere, or in this file.
    pub const fn new(path: Option<PathBuf>) -> Self {
        Self(path)
    }

    /// The journal of a flight that was interrupted, if there is one.
    pub fn read(&self) -> Option<Journal> {
        let path = self.0.as_ref()?;
        let bytes = match read_limited(path) {
            Ok(bytes) => bytes,
            Err(error) if error.kind() == ErrorKind::NotFound => return None,
            Err(error) => {
                tracing::warn!("{}: cannot be read: {error}; the flight begins anew", path.display());
                return None;
            }
        };
        let journal = serde_json::from_slice(&bytes);
        journal.map_err(|error| tracing::warn!("{}: is no journal: {error}", path.display())).ok()
    }

    /// Writes the journal, or removes it. A full disk does not end a flight.
    pub fn keep(&self, journal: Option<&Journal>) {
        let Some(path) = &self.0 else { return };
        let done = match journal {
            None => match fs::remove_file(path) {
                Err(error) if error.kind() != ErrorKind::NotFound => Err(error),
                _ => Ok(()),
            },
            Some(journal) => serde_json::to_vec(journal).map_err(Into::into).and_then(|bytes| replace(path, &bytes)),
        };
        if let Err(error) = done {
            tracing::error!(%error, "{}: cannot be written; the flight cannot be picked up", path.display());
        }
    }
}
