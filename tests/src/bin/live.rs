//! Prints what the bridge takes and how long it takes while it flies: see `quietpath_tests::live`.

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use quietpath_tests::bench::machine;
use quietpath_tests::{live, repository};

#[derive(Parser)]
#[command(about = "The bridge as a program, measured while it flies the simulated autopilot")]
struct Arguments {
    #[command(subcommand)]
    figure: Option<Figure>,
}

#[derive(Subcommand)]
enum Figure {
    /// All of them, into docs/live.md; this is what happens without a word
    Page,
    /// From an observation to the first setpoint of the plan that it asked for
    Latency {
        /// Observations
        #[arg(default_value_t = LATENCY_COUNT)]
        count: usize,
    },
    /// Share of one core while steering
    Load {
        /// Time to look at, s
        #[arg(default_value_t = LOAD_TIME)]
        seconds: f64,
    },
    /// Memory, threads and heartbeats of a long flight under faults
    Endurance {
        /// Time to fly, s of the flight
        #[arg(default_value_t = ENDURANCE_TIME)]
        seconds: f64,
        /// How many times faster than time
        #[arg(long, default_value_t = ENDURANCE_SPEEDUP)]
        speedup: f64,
    },
}

const LATENCY_COUNT: usize = 200;
const LOAD_TIME: f64 = 30.0;
const ENDURANCE_TIME: f64 = 3600.0;
const ENDURANCE_SPEEDUP: f64 = 20.0;

fn latency(count: usize) -> String {
    eprintln!("latency: {count} observations");
    live::latencies(count).to_string()
}

fn load(seconds: f64) -> String {
    eprintln!("load: {seconds} s");
    format!("{:.2} % of one core over {seconds} s\n", 100.0 * live::load(seconds))
}

fn endurance(seconds: f64, speedup: f64) -> String {
    eprintln!("endurance: {:.0} s", seconds / speedup);
    live::endure(seconds, speedup).to_string()
}

fn main() -> ExitCode {
    match Arguments::parse().figure.unwrap_or(Figure::Page) {
        Figure::Latency { count } => print!("{}", latency(count)),
        Figure::Load { seconds } => print!("{}", load(seconds)),
        Figure::Endurance { seconds, speedup } => print!("{}", endurance(seconds, speedup)),
        Figure::Page => {
            let page = live::page(
                &machine::described(),
                &latency(LATENCY_COUNT),
                &load(LOAD_TIME),
                &endurance(ENDURANCE_TIME, ENDURANCE_SPEEDUP),
                ENDURANCE_SPEEDUP,
            );
            let path = repository().join("docs/live.md");
            if let Err(error) = std::fs::write(&path, page) {
                eprintln!("{}: {error}", path.display());
                return ExitCode::FAILURE;
            }
            println!("wrote {}", path.display());
        }
    }
    ExitCode::SUCCESS
}
