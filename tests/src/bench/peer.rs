//! Other solvers, each a program that answers one request a line: see `tests/peer/`.

use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use quietpath_bridge::file::{PlanFile, ScenarioFile};
use quietpath_bridge::planning::assess;
use serde_json::{Value, json};

use super::machine;
use crate::repository;

/// A solver that waits for requests. Between them it takes no time.
pub struct Peer {
    child: Child,
    requests: ChildStdin,
    answers: BufReader<ChildStdout>,
    /// Ways in which it can be asked to solve.
    pub variants: Vec<String>,
    /// Names and versions.
    pub versions: String,
}

/// What a peer made of a scenario.
#[derive(Clone, Debug)]
pub struct Answer {
    /// Seconds of each solve.
    pub seconds: Vec<f64>,
    /// Seconds to build the problem, not part of the others.
    pub build_seconds: f64,
    /// Iterations.
    pub iterations: u64,
    /// Its own word for how it ended.
    pub status: String,
    /// Objective of its plan, recomputed by ours.
    pub objective: f64,
    /// Whether its plan is feasible, by our measure.
    pub is_feasible: bool,
}

impl Peer {
    /// CasADi with IPOPT.
    ///
    /// # Errors
    /// Where Python or its packages cannot be had.
    pub fn ipopt() -> Result<Self, String> {
        let script = repository().join("tests/peer/ipopt.py");
        Self::begin(Command::new(machine::python()?).arg(script))
    }

    /// The same metrics over a grid in NumPy.
    ///
    /// # Errors
    /// Where Python or its packages cannot be had.
    pub fn numpy() -> Result<Self, String> {
        let script = repository().join("tests/peer/landscape.py");
        Self::begin(Command::new(machine::python()?).arg(script))
    }

    /// OpEn, built first.
    ///
    /// # Errors
    /// Where it does not build.
    pub fn open() -> Result<Self, String> {
        let manifest = repository().join("tests/peer/open/Cargo.toml");
        let target = repository().join("target/peer/open");
        let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
        let mut build = Command::new(cargo);
        build
            .args(["build", "--release", "--quiet", "--manifest-path"])
            .arg(manifest)
            .arg("--target-dir")
            .arg(&target);
        let status = build.status().map_err(|error| format!("{build:?}: {error}"))?;
        if !status.success() {
            return Err("the peer with OpEn does not build".into());
        }
        Self::begin(&mut Command::new(target.join("release/quietpath-peer-open")))
    }

    fn begin(command: &mut Command) -> Result<Self, String> {
        for variable in ["OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"] {
            command.env(variable, "1");
        }
        let spawned = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null()).spawn();
        let mut child = spawned.map_err(|error| format!("{command:?}: {error}"))?;
        let (Some(requests), Some(answers)) = (child.stdin.take(), child.stdout.take()) else {
            return Err(format!("{command:?} has no standard streams"));
        };
        let answers = BufReader::new(answers);
        let mut peer = Self { child, requests, answers, variants: Vec::new(), versions: String::new() };
        let about = peer.ask(&json!({ "versions": true }))?;
        let texts = |value: &Value| value.as_str().map(str::to_owned);
        peer.variants = about["variants"].as_array().into_iter().flatten().filter_map(texts).collect();
        peer.versions = about["versions"].as_str().unwrap_or_default().to_owned();
        Ok(peer)
    }

    /// One request and its answer.
    ///
    /// # Errors
    /// The peer's own error, or that it is gone.
    pub fn ask(&mut self, request: &Value) -> Result<Value, String> {
        let gone = |error: std::io::Error| format!("the peer is gone: {error}");
        writeln!(self.requests, "{request}").and_then(|()| self.requests.flush()).map_err(gone)?;
        let mut line = String::new();
        self.answers.read_line(&mut line).map_err(gone)?;
        let answer: Value = serde_json::from_str(&line).map_err(|_| "the peer ended without an answer".to_owned())?;
        match answer["error"].as_str() {
            Some(error) => Err(error.to_owned()),
            None => Ok(answer),
        }
    }

    /// Solves a scenario in a variant, and weighs what comes back.
    ///
    /// # Errors
    /// What the peer does not model, or that it is gone.
    pub fn solve(&mut self, scenario: &ScenarioFile, path: &Path, variant: &str) -> Result<Answer, String> {
        let answer = self.ask(&json!({ "scenario": path, "variant": variant }))?;
        let plan =
            PlanFile::parse("the peer's plan", &answer["plan"].to_string()).map_err(|error| error.to_string())?;
        let found = assess(scenario, &plan, "the peer's plan").map_err(|error| error.to_string())?;
        let number = |value: &Value| value.as_f64().unwrap_or(f64::NAN);
        Ok(Answer {
            seconds: answer["seconds"].as_array().into_iter().flatten().map(number).collect(),
            build_seconds: number(&answer["build_seconds"]),
            iterations: answer["iterations"].as_u64().unwrap_or_default(),
            status: answer["status"].as_str().unwrap_or_default().to_owned(),
            objective: found.objective,
            is_feasible: found.feasible,
        })
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        // It is ours, and idle: nothing is lost.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
