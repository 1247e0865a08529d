//! Flies faults over many seeds, and writes what came of them: see `quietpath_tests::faults`.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use quietpath_bridge::flight::FlyMode;
use quietpath_tests::faults::{Fault, Fly, Row, all, page};

#[derive(Parser)]
#[command(about = "Flights on which something goes wrong, each with the outcome that is expected of it")]
struct Arguments {
    /// Seeds of each fault in one process
    #[arg(default_value_t = 200)]
    seeds: u64,
    /// Seeds of each fault of the programs
    #[arg(long, default_value_t = 10)]
    programs: u64,
    /// Flights at a time
    #[arg(long, default_value_t = 2)]
    threads: usize,
    /// This seed alone
    #[arg(long)]
    seed: Option<u64>,
    /// This fault alone
    #[arg(long, value_name = "NAME")]
    only: Option<String>,
    /// Page to write
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

impl Arguments {
    fn seeds(&self, fault: &Fault) -> std::ops::Range<u64> {
        let count = if matches!(fault.fly, Fly::Air(_)) { self.seeds } else { self.programs };
        self.seed.map_or(0..count, |seed| seed..seed + 1)
    }
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let mut rows = Vec::new();
    for fault in all() {
        if arguments.only.as_ref().is_some_and(|only| only != fault.name) {
            continue;
        }
        for mode in [FlyMode::Guided, FlyMode::Mission] {
            if let Some(row) = Row::fly(&fault, mode, arguments.seeds(&fault), arguments.threads) {
                print!("{row}");
                rows.push(row);
            }
        }
    }
    let page = page(&rows, &format!("cargo xtask faults {} --programs {}", arguments.seeds, arguments.programs));
    if let Some(path) = &arguments.out {
        if let Err(error) = std::fs::write(path, page) {
            eprintln!("{}: cannot be written: {error}", path.display());
            return ExitCode::FAILURE;
        }
        println!("written to {}", path.display());
    }
    if !rows.is_empty() && rows.iter().all(Row::is_good) { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
