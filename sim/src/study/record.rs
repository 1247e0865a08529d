//! Runs on disk: a heading and then a line a run, as JSON, so that nothing is lost whatever ends the program.
//!
//! Each line is written by one call as soon as its run is done. A study that was ended is resumed by reading the file again: the
//! runs that are there are not flown anew, and half a line at the end, which a loss of power may leave, is cut off.
//! Files whose headings differ belong to different studies and are refused.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::{Read as _, Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};

use quietpath_bridge::file::{PlanFile, ScenarioFile};
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

use super::{Figures, Run};
use crate::outcome::Failure;

/// What makes runs comparable: scenario, plan and seed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Heading {
    /// Name of the scenario.
    pub study: String,
    /// Of the scenario file's text.
    pub scenario_sha256: String,
    /// Of the plan's times and paths.
    pub plan_sha256: String,
    /// Version of the program: another one may compute other figures.
    pub version: String,
    /// What the plan is worth on paper.
    pub planned: Figures,
}

impl Heading {
    /// The heading of a study.
    #[must_use]
    pub fn of(scenario: &ScenarioFile, plan: &PlanFile, planned: Figures) -> Self {
        // How long planning took is no part of what is flown.
        let flown = PlanFile { timing: None, ..plan.clone() };
        Self {
            study: scenario.name.clone(),
            scenario_sha256: hash(scenario.text()),
            plan_sha256: hash(&flown.to_json()),
            version: env!("CARGO_PKG_VERSION").into(),
            planned,
        }
    }
}

fn hash(text: &str) -> String {
    Sha256::digest(text).iter().map(|byte| format!("{byte:02x}")).collect()
}

/// A file of runs, open for more.
#[derive(Debug)]
pub struct Record {
    path: PathBuf,
    file: File,
}

impl Record {
    /// Opens a file of runs, or begins one; returns the runs that are in it.
    ///
    /// # Errors
    /// A file of another study, one that cannot be read or written, a line that is no run.
    pub fn open(path: &Path, heading: &Heading) -> Result<(Self, BTreeMap<u64, Run>), Failure> {
        let failed = |cause: std::io::Error| Failure::write(path, &cause);
        let mut file =
            OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path).map_err(failed)?;
        let mut text = String::new();
        file.read_to_string(&mut text).map_err(failed)?;
        let whole = text.rfind('\n').map_or(0, |end| end + 1);
        file.set_len(whole as u64).map_err(failed)?;
        file.seek(SeekFrom::End(0)).map_err(failed)?;
        let mut record = Self { path: path.to_owned(), file };
        let complete = text.get(..whole).unwrap_or_default();
        if complete.is_empty() {
            record.put(heading)?;
            return Ok((record, BTreeMap::new()));
        }
        let (found, runs) = parse(path, complete)?;
        if found != *heading {
            return Err(differs(path, &found, heading));
        }
        Ok((record, runs))
    }

    /// Adds a line.
    ///
    /// # Errors
    /// Where it cannot be written.
    pub fn put(&mut self, line: &impl Serialize) -> Result<(), Failure> {
        let mut text = serde_json::to_string(line).map_err(Failure::input)?;
        text.push('\n');
        self.file.write_all(text.as_bytes()).map_err(|cause| Failure::write(&self.path, &cause))
    }
}

/// Reads a file of runs.
///
/// # Errors
/// A file that cannot be read, has no heading, or has a line that is no run.
pub fn read(path: &Path) -> Result<(Heading, BTreeMap<u64, Run>), Failure> {
    let text = std::fs::read_to_string(path)
        .map_err(|cause| Failure::Input(format!("cannot read {}: {cause}", path.display())))?;
    let whole = text.rfind('\n').map_or(0, |end| end + 1);
    parse(path, text.get(..whole).unwrap_or_default())
}

fn parse(path: &Path, text: &str) -> Result<(Heading, BTreeMap<u64, Run>), Failure> {
    let wrong = |line: usize, cause: serde_json::Error| {
        let help = "give a file that `quietpath study` wrote";
        Failure::Input(format!("{}:{line}: is no line of a study: {cause}\n  help: {help}", path.display()))
    };
    let mut lines = text.lines().enumerate();
    let first = lines.next().map_or("", |(_, line)| line);
    let heading: Heading = serde_json::from_str(first).map_err(|cause| wrong(1, cause))?;
    let mut runs = BTreeMap::new();
    for (index, line) in lines {
        let run: Run = serde_json::from_str(line).map_err(|cause| wrong(index + 1, cause))?;
        runs.insert(run.run, run);
    }
    Ok((heading, runs))
}

/// Says in which way two headings differ.
#[must_use]
pub fn differs(path: &Path, found: &Heading, expected: &Heading) -> Failure {
    let what = if found.scenario_sha256 != expected.scenario_sha256 {
        "another scenario file"
    } else if found.plan_sha256 != expected.plan_sha256 {
        "another plan"
    } else {
        "another version of the program"
    };
    Failure::Input(format!(
        "{} holds runs of {what}\n  help: give another --out, or remove that file",
        path.display()
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn heading() -> Heading {
        Heading {
            study: "s".into(),
            scenario_sha256: "a".into(),
            plan_sha256: "b".into(),
            version: "1".into(),
            planned: Figures::default(),
        }
    }

    fn run(number: u64) -> Run {
        let figures = Figures { peak_detection: Some(0.1 + number as f64), ..Figures::default() };
        Run { run: number, figures, off_plan_m: 1.5, wind_m_s: [0.5, -0.25], failures: vec!["late".into()] }
    }

    #[test]
    fn half_a_line_is_cut_off_and_the_rest_comes_back() {
        let room = tempfile::TempDir::new().unwrap();
        let path = room.path().join("runs.jsonl");
        let (mut record, runs) = Record::open(&path, &heading()).unwrap();
        assert!(runs.is_empty());
        record.put(&run(4)).unwrap();
        record.file.write_all(b"{\"run\":5,\"flight_").unwrap();
        drop(record);
        let (mut record, runs) = Record::open(&path, &heading()).unwrap();
        assert_eq!(runs.into_values().collect::<Vec<_>>(), [run(4)]);
        record.put(&run(6)).unwrap();
        drop(record);
        let (found, runs) = read(&path).unwrap();
        assert_eq!((found, runs.into_keys().collect::<Vec<_>>()), (heading(), vec![4, 6]));
    }

    #[test]
    fn runs_of_another_study_are_refused() {
        let room = tempfile::TempDir::new().unwrap();
        let path = room.path().join("runs.jsonl");
        Record::open(&path, &heading()).unwrap();
        let other = Heading { plan_sha256: "c".into(), ..heading() };
        let Err(Failure::Input(text)) = Record::open(&path, &other) else { panic!("refused") };
        assert!(text.contains("runs of another plan") && text.contains("help:"), "{text}");
        std::fs::write(&path, format!("{}\nnonsense\n", serde_json::to_string(&heading()).unwrap())).unwrap();
        let Err(Failure::Input(text)) = read(&path) else { panic!("refused") };
        assert!(text.contains("runs.jsonl:2: is no line of a study"), "{text}");
    }
}
