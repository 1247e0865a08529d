//! The developer loop: `cargo xtask check`, `test`, `target`, `ci`, `pictures`, `gallery`, `bench`, `live`, `count`.
//!
//! Every command is a list of steps. A step is a program run from the top of the repository with its output passed
//! through; the first that fails ends the run, and a summary says what ran, how long it took, and what did not run.

mod count;
mod step;

use std::path::Path;
use std::process::ExitCode;

use anyhow::Context;
use clap::{Parser, Subcommand};

use step::Step;

/// What the planning core is compiled for: Cortex-M4F and Cortex-M7F without an operating system.
const TARGET: &str = "thumbv7em-none-eabihf";

/// Scenarios whose landscape, with the path through it, is shown on the pages.
const PICTURES: [&str; 2] = ["square8-detection", "square8-aee"];

#[derive(Parser)]
#[command(name = "xtask", bin_name = "cargo xtask", about = "The developer loop of quietpath")]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Formatting, lints and documentation, with warnings as errors
    Check,
    /// All tests, those with programs from PyPI too, and the core for the microcontroller; installs the target if it is missing
    Test,
    /// The core alone for the microcontroller, in f32 and f64
    Target,
    /// What continuous integration runs: check, then test
    Ci,
    /// The pictures of the README, drawn anew by the program
    Pictures,
    /// The page of all figures of the paper, planned and drawn anew
    Gallery,
    /// Measures plans and writes docs/benchmarks.md; `cargo xtask bench --help` lists its choices
    #[command(disable_help_flag = true)]
    Bench {
        /// Passed on
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        arguments: Vec<String>,
    },
    /// Flies the bridge against the simulated autopilot, and writes docs/live.md: latency, load, endurance; takes six minutes
    Live,
    /// The instructions of one plan, counted by valgrind, in all and by function
    Count {
        /// A published scenario
        #[arg(default_value = "square8-detection")]
        scenario: String,
    },
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    match run(&arguments.command) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("xtask: {error:#}");
            ExitCode::FAILURE
        }
    }
}

/// Runs a command's steps; false where one failed.
fn run(command: &Command) -> anyhow::Result<bool> {
    let top = Path::new(env!("CARGO_MANIFEST_DIR")).parent().context("xtask lies in a folder of the repository")?;
    let steps = match command {
        Command::Bench { arguments } => vec![bench(arguments)],
        Command::Live => vec![
            // As the measurement itself builds the programs that it starts.
            Step::cargo("the programs", "build --workspace --bins --release"),
            Step::new("the bridge in flight", "target/release/live", "page"),
        ],
        Command::Count { scenario } => return count::count(scenario, top),
        Command::Check => check(),
        Command::Test => test(),
        Command::Target => target(),
        Command::Ci => check().into_iter().chain(test()).collect(),
        Command::Pictures => pictures(),
        Command::Gallery => vec![Step::cargo("gallery", "run --package quietpath-sim --example gallery")],
    };
    let good = step::run_all(&steps, top)?;
    if good && matches!(command, Command::Pictures) {
        hang(top)?;
    }
    Ok(good)
}

fn check() -> Vec<Step> {
    vec![
        Step::cargo("formatting", "fmt --all --check"),
        Step::cargo("formatting, embedded", "fmt --manifest-path tests/embedded/Cargo.toml --check"),
        Step::cargo("lints", "clippy --workspace --all-targets -- -D warnings"),
        Step::cargo(
            "lints of the core with defmt",
            "clippy --package quietpath-core --features defmt -- -D warnings",
        ),
        Step::cargo("documentation", "doc --workspace --no-deps --document-private-items")
            .with_env("RUSTDOCFLAGS", "-D warnings"),
    ]
}

fn test() -> Vec<Step> {
    // With the whole workspace, or its crates are built again with other features.
    let interoperate = "test --workspace --test interoperate -- --ignored";
    let mut steps =
        vec![Step::cargo("tests", "test --workspace"), Step::cargo("other people's MAVLink", interoperate)];
    steps.extend(target());
    steps
}

fn target() -> Vec<Step> {
    // One folder of artifacts for both: the embedded consumer is a workspace of its own.
    let embedded = format!("build --manifest-path tests/embedded/Cargo.toml --target-dir target --target {TARGET}");
    vec![
        Step::new("target installed", "rustup", &format!("target add {TARGET}")),
        Step::cargo("core alone", &format!("build --package quietpath-core --target {TARGET}")),
        Step::cargo("core instantiated in f32 and f64", &format!("{embedded} --release")),
    ]
}

fn bench(arguments: &[String]) -> Step {
    let program = "run --release --package quietpath-tests --bin bench --";
    Step::cargo("measurements", [&[program.to_owned()], arguments].concat().join(" ").trim_end())
}

fn pictures() -> Vec<Step> {
    let plan = |name| {
        let arguments = format!("run --release -- plan sim/scenarios/{name}.toml --out target/pictures/{name}");
        Step::cargo(name, &arguments)
    };
    PICTURES.into_iter().map(plan).collect()
}

/// Copies the pictures to where the pages look for them.
fn hang(top: &Path) -> anyhow::Result<()> {
    let wall = top.join("docs/pictures");
    std::fs::create_dir_all(&wall).with_context(|| format!("cannot make {}", wall.display()))?;
    for name in PICTURES {
        let picture = top.join("target/pictures").join(name).join("landscape.png");
        let place = wall.join(name).with_extension("png");
        std::fs::copy(&picture, &place).with_context(|| format!("cannot copy {}", picture.display()))?;
        println!("{}", place.display());
    }
    Ok(())
}
