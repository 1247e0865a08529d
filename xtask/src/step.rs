//! A step of the loop: a program with arguments, run and timed.

use std::ffi::OsString;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use anyhow::Context;

/// A program to run, and the name by which the summary lists it.
pub struct Step {
    name: &'static str,
    program: OsString,
    arguments: Vec<String>,
    environment: Option<(&'static str, &'static str)>,
}

impl Step {
    /// A step that runs `program` with `arguments`, which are separated by single spaces.
    pub fn new(name: &'static str, program: impl Into<OsString>, arguments: &str) -> Self {
        let arguments = arguments.split(' ').map(String::from).collect();
        Self { name, program: program.into(), arguments, environment: None }
    }

    /// A step that runs the cargo that started this program.
    pub fn cargo(name: &'static str, arguments: &str) -> Self {
        Self::new(name, std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()), arguments)
    }

    /// The same step with a variable of its environment set.
    pub fn with_env(mut self, key: &'static str, value: &'static str) -> Self {
        self.environment = Some((key, value));
        self
    }

    /// The command as a person would type it.
    fn shown(&self) -> String {
        let program = Path::new(&self.program).file_stem().unwrap_or(&self.program).to_string_lossy();
        let environment = self.environment.map(|(key, value)| format!("{key}='{value}' ")).unwrap_or_default();
        format!("{environment}{program} {}", self.arguments.join(" "))
    }

    fn run(&self, top: &Path) -> anyhow::Result<bool> {
        let mut command = Command::new(&self.program);
        command.args(&self.arguments).current_dir(top).envs(self.environment);
        let status = command.status().with_context(|| format!("cannot start {}", self.shown()))?;
        Ok(status.success())
    }
}

/// How a step ended.
enum Outcome {
    Passed(Duration),
    Failed(Duration),
    NotRun,
}

/// Runs steps in turn up to the first that fails, and prints a summary; false where one failed.
///
/// # Errors
/// A program that cannot be started.
pub fn run_all(steps: &[Step], top: &Path) -> anyhow::Result<bool> {
    let mut outcomes = Vec::with_capacity(steps.len());
    let mut good = true;
    for (index, step) in steps.iter().enumerate() {
        if !good {
            outcomes.push(Outcome::NotRun);
            continue;
        }
        println!("\n[{}/{}] {}: {}", index + 1, steps.len(), step.name, step.shown());
        let start = Instant::now();
        good = step.run(top)?;
        let time = start.elapsed();
        outcomes.push(if good { Outcome::Passed(time) } else { Outcome::Failed(time) });
    }
    println!("\nSummary");
    for (step, outcome) in steps.iter().zip(&outcomes) {
        match outcome {
            Outcome::Passed(time) => println!("  passed   {:>7.1} s  {}", time.as_secs_f64(), step.name),
            Outcome::Failed(time) => {
                println!("  FAILED   {:>7.1} s  {}: {}", time.as_secs_f64(), step.name, step.shown())
            }
            Outcome::NotRun => println!("  not run            {}", step.name),
        }
    }
    Ok(good)
}
