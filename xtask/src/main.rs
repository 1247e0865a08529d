//! The developer loop: `cargo xtask check`, `test`, `target`, `header`, `instructions`,
//! `sizes`, `ci`, `pictures`, `gallery`, `bench`, `count`.
//!
//! Every command is a list of steps. A step is a program run from the top of the repository with its output passed
//! through; the first that fails ends the run, and a summary says what ran, how long it took, and what did not run.

mod count;
mod firmware;
mod step;

use std::path::Path;
use std::process::ExitCode;

use anyhow::Context;
use clap::{Parser, Subcommand};

use firmware::Table;
use step::Step;

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
    /// All tests, those with programs from PyPI too, and the firmware; installs what the firmware needs
    Test,
    /// The firmware: built, run under QEMU, compared with the host bit for bit
    Target,
    /// The header of the C interface, made anew from its source
    Header,
    /// Instructions of pieces of planning on a microcontroller, by size; writes firmware/instructions.md
    Instructions,
    /// What the firmware takes of flash, RAM and stack; fails past the budget
    Sizes {
        /// Print what changed against the committed table
        #[arg(long)]
        compare: bool,
        /// Write the committed table anew
        #[arg(long, conflicts_with = "compare")]
        write: bool,
    },
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
        Command::Count { scenario } => return count::count(scenario, top),
        Command::Check => check(),
        Command::Test => test(),
        Command::Target => return firmware::target(top),
        Command::Header => return firmware::header(top),
        Command::Instructions => return firmware::instructions(top),
        Command::Sizes { compare, write } => {
            let table = match (*compare, *write) {
                (true, _) => Table::Compare,
                (_, true) => Table::Write,
                _ => Table::Ignore,
            };
            return firmware::sizes(table, top);
        }
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
    let lints_of_firmware = format!(
        "clippy --manifest-path firmware/Cargo.toml --target-dir target/firmware --workspace --release --target {} -- -D warnings",
        firmware::TARGET
    );
    vec![
        Step::cargo("formatting", "fmt --all --check"),
        Step::cargo("formatting of the firmware", "fmt --manifest-path firmware/Cargo.toml --all --check"),
        Step::cargo("lints", "clippy --workspace --all-targets -- -D warnings"),
        Step::new("target installed", "rustup", &format!("target add {}", firmware::TARGET)),
        Step::cargo("lints of the firmware", &lints_of_firmware),
        Step::cargo("documentation", "doc --workspace --no-deps --document-private-items")
            .with_env("RUSTDOCFLAGS", "-D warnings"),
    ]
}

fn test() -> Vec<Step> {
    let interoperate = "test --package quietpath-bridge --test interoperate -- --ignored";
    vec![
        Step::cargo("tests", "test --workspace"),
        Step::cargo("other people's MAVLink", interoperate),
        Step::cargo("the firmware under QEMU", "xtask target"),
        Step::cargo("sizes of the firmware", "xtask sizes --compare"),
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
