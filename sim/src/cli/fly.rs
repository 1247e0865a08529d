//! Arguments of the commands that fly and look on.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use quietpath_bridge::link::Address;

use super::{LikeArg, MetricArg};

/// Arguments of `quietpath fly`.
#[derive(Debug, Args)]
pub struct FlyArgs {
    /// Scenario file; `-` reads it from standard input
    pub scenario: String,
    /// Who steers
    #[arg(long, value_enum, default_value_t = FlyModeArg::Guided)]
    pub mode: FlyModeArg,
    /// Which autopilot is simulated, or expected
    #[arg(long, value_enum, default_value_t = LikeArg::Px4)]
    pub like: LikeArg,
    /// Faults: share of the frames that are lost, in each direction
    #[arg(long, value_name = "SHARE", default_value_t = 0.0)]
    pub loss: f64,
    /// Seed of the faults
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// How many times faster than time to fly [default: as fast as it goes; 1 with --connect]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub speedup: Option<f64>,
    /// Link to an autopilot elsewhere, instead of the simulated one: udpin:HOST:PORT, tcpout:HOST:PORT, serial:DEVICE, ..
    #[arg(long, value_name = "URL", value_parser = address, conflicts_with_all = ["loss", "seed"])]
    pub connect: Option<Address>,
    /// Metric that the report shows first [default: that of the first objective term]
    #[arg(long, value_name = "NAME", value_enum)]
    pub metric: Option<MetricArg>,
    /// Show the flight as it goes on to browsers on this machine, on a port; without one, on a free one
    #[arg(long, value_name = "PORT", num_args = 0..=1, default_missing_value = "0")]
    pub view: Option<u16>,
    /// Folder for the report, plans, pictures and mission files; made where it is missing
    #[arg(long, value_name = "DIR", default_value = "out")]
    pub out: PathBuf,
}

/// Who steers, as the command line names it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum FlyModeArg {
    /// The bridge, by setpoints
    Guided,
    /// The autopilot, along an uploaded mission
    Mission,
}

/// Arguments of `quietpath view`.
#[derive(Debug, Args)]
pub struct ViewArgs {
    /// Record of a flight, as `quietpath-bridge run --record` writes it
    pub record: PathBuf,
    /// Port on 127.0.0.1 [default: a free one]
    #[arg(long, value_name = "PORT", default_value_t = 0, hide_default_value = true)]
    pub port: u16,
    /// Metric that the map shows first [default: that of the first objective term]
    #[arg(long, value_name = "NAME", value_enum)]
    pub metric: Option<MetricArg>,
}

fn address(text: &str) -> Result<Address, String> {
    text.parse().map_err(|error| format!("{error}"))
}
