//! The recorded figures in `tests/data/`, each file with a line of its own that says where it comes from.

use std::collections::BTreeMap;

use serde::Deserialize;
use serde::de::DeserializeOwned;

use crate::repository;

/// What an independent reading of the model says of a plan.
#[derive(Debug, Deserialize)]
pub struct GoldenCase {
    /// Name of the scenario.
    pub scenario: String,
    /// `reference`, `disturbed` or `unequal steps`.
    pub kind: String,
    /// Objective, in the units of the scenario's terms.
    pub objective: f64,
    /// Largest violation of each constraint, relative to its own scale.
    pub violations: BTreeMap<String, f64>,
    /// The plan, as a plan file holds it.
    pub plan: serde_json::Value,
}

/// What CasADi with IPOPT reached on a scenario.
#[derive(Debug, Deserialize)]
pub struct Reference {
    /// Best objective of all starts.
    pub objective: f64,
    /// Objective reached from the straight line at constant speed.
    pub straight_line_start: f64,
    /// Number of starts.
    pub starts: u32,
    /// Starts that ended in a feasible plan.
    pub feasible_starts: u32,
}

#[derive(Deserialize)]
struct GoldenFile {
    cases: Vec<GoldenCase>,
}

#[derive(Deserialize)]
struct ReferenceFile {
    scenarios: BTreeMap<String, Reference>,
}

/// The golden cases, three a scenario.
#[must_use]
pub fn golden() -> Vec<GoldenCase> {
    read::<GoldenFile>("golden.json").cases
}

/// The reference solutions, by scenario.
#[must_use]
pub fn references() -> BTreeMap<String, Reference> {
    read::<ReferenceFile>("reference.json").scenarios
}

fn read<T: DeserializeOwned>(name: &str) -> T {
    let path = repository().join("tests/data").join(name);
    let text = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    serde_json::from_str(&text).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}
