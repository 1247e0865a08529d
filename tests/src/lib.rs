//! What the whole-system tests share: where things are, and the recorded figures.

pub mod bench;
pub mod faults;
pub mod figures;
pub mod instances;
pub mod live;
pub mod programs;
pub mod starts;

use std::path::{Path, PathBuf};

use quietpath_bridge::file::ScenarioFile;

/// The top of the repository.
#[must_use]
pub fn repository() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap_or(Path::new("."))
}

/// The file of a scenario that comes with the program.
#[must_use]
pub fn scenario_path(name: &str) -> PathBuf {
    repository().join("sim/scenarios").join(name).with_extension("toml")
}

/// A scenario that comes with the program.
///
/// # Panics
/// There is no such scenario, or it is not valid.
#[must_use]
pub fn scenario(name: &str) -> ScenarioFile {
    let path = scenario_path(name);
    let loaded = ScenarioFile::read(&path.to_string_lossy());
    loaded.unwrap_or_else(|error| panic!("{error}")).scenario
}
