//! Prints what the bridge takes and how long it takes while it flies: see `quietpath_tests::live`.

use clap::{Parser, Subcommand};
use quietpath_tests::live;

#[derive(Parser)]
#[command(about = "The bridge as a program, measured while it flies the simulated autopilot")]
struct Arguments {
    #[command(subcommand)]
    figure: Figure,
}

#[derive(Subcommand)]
enum Figure {
    /// From an observation to the first setpoint of the plan that it asked for
    Latency {
        /// Observations
        #[arg(default_value_t = 200)]
        count: usize,
    },
    /// Share of one core while steering
    Load {
        /// Time to look at, s
        #[arg(default_value_t = 30.0)]
        seconds: f64,
    },
    /// Memory, threads and heartbeats of a long flight under faults
    Endurance {
        /// Time to fly, s of the flight
        #[arg(default_value_t = 3600.0)]
        seconds: f64,
        /// How many times faster than time
        #[arg(long, default_value_t = 20.0)]
        speedup: f64,
    },
}

fn main() {
    match Arguments::parse().figure {
        Figure::Latency { count } => {
            let live::Latencies { seconds: sorted, refused } = live::latencies(count);
            let at = |share: f64| {
                let place = (share * sorted.len().saturating_sub(1) as f64).round() as usize;
                sorted.get(place).copied().unwrap_or(f64::NAN) * 1e3
            };
            println!("{} of {count} observations came to fly", sorted.len());
            for (why, count) in refused {
                println!("{count} plans did not fly: {why}");
            }
            println!(
                "median {:.1} ms, 90 % {:.1} ms, 99 % {:.1} ms, largest {:.1} ms",
                at(0.5),
                at(0.9),
                at(0.99),
                at(1.0)
            );
        }
        Figure::Load { seconds } => println!("{:.2} % of one core", 100.0 * live::load(seconds)),
        Figure::Endurance { seconds, speedup } => println!("{:#?}", live::endure(seconds, speedup)),
    }
}
