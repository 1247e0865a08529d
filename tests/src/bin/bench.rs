//! `cargo xtask bench`: measures, and writes `docs/benchmarks.md`.

use std::process::ExitCode;

use clap::Parser;
use quietpath_tests::bench::{published, random, scaling};

/// Measures plans and writes docs/benchmarks.md. Without a choice: the published scenarios against the peers
#[derive(Parser)]
#[command(bin_name = "cargo xtask bench")]
struct Arguments {
    /// Turns of each solver on a published scenario
    #[arg(long, default_value_t = 5)]
    turns: usize,
    /// Only published scenarios whose names contain this; the page is left alone
    #[arg(long, default_value = "")]
    only: String,
    /// This many made-up scenarios against a multi-start, instead
    #[arg(long, value_name = "N")]
    random: Option<u64>,
    /// Seed of the made-up scenarios
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Random starts of each made-up scenario
    #[arg(long, default_value_t = 40)]
    starts: usize,
    /// Time against nodes, sensors and agents, and landscapes, instead
    #[arg(long)]
    scaling: bool,
    /// Fewer sizes in --scaling, and the page is left alone
    #[arg(long, requires = "scaling")]
    short: bool,
    /// Everything: published scenarios, 300 made-up ones, scaling
    #[arg(long, conflicts_with_all = ["random", "scaling", "only"])]
    all: bool,
}

/// Made-up scenarios of `--all`.
const RANDOM_OF_ALL: u64 = 300;

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("bench: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &Arguments) -> std::io::Result<()> {
    let wanted = arguments.random.or(arguments.all.then_some(RANDOM_OF_ALL));
    if arguments.all || !(arguments.scaling || wanted.is_some()) {
        published::run(&published::Request { turns: arguments.turns, only: arguments.only.clone() })?;
    }
    if arguments.all || arguments.scaling {
        let extent = if arguments.short { scaling::Extent::Short } else { scaling::Extent::Full };
        scaling::run(extent)?;
    }
    if let Some(count) = wanted {
        random::run(&random::Request { count, seed: arguments.seed, starts: arguments.starts })?;
    }
    Ok(())
}
