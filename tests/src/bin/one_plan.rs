//! Plans one published scenario with default settings, once: what `cargo xtask count` counts the instructions of.

use std::process::ExitCode;

use quietpath_bridge::planning::{Options, Rollout, plan};

/// The scenario where none is named: one agent, eight sensors, sixty intervals.
const USUAL: &str = "square8-detection";

fn main() -> ExitCode {
    let name = std::env::args().nth(1).unwrap_or_else(|| USUAL.into());
    let options = Options { rollout: Rollout::Once, ..Options::default() };
    match plan(&quietpath_tests::scenario(&name), &options) {
        Ok(planned) => {
            let status = planned.status.name();
            println!("{name}: {:.9} {status}, {} iterations", planned.assessment.objective, planned.iterations);
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}
