//! The command line: what can be asked, and how each command is explained.

mod fly;

use std::path::PathBuf;
use std::time::Duration;

use clap::builder::styling::{AnsiColor, Styles};
use clap::{Args, Parser, Subcommand, ValueEnum};

use crate::autopilot::Home;
use crate::trade::{Amount, Over};

pub use fly::{FlyArgs, FlyModeArg, ViewArgs};

const STYLES: Styles = Styles::styled()
    .header(AnsiColor::Green.on_default().bold())
    .usage(AnsiColor::Green.on_default().bold())
    .literal(AnsiColor::Cyan.on_default().bold())
    .placeholder(AnsiColor::Cyan.on_default());

const AFTER: &str = "\
Without a command, the built-in scenario `wight-jam` is planned and flown in simulation, over MAVLink, into the folder
`out`.

Exit status: 0 done, 1 the plan is not feasible or the flight did not arrive, 2 bad input or usage.

Example:
  quietpath new scenario.toml && quietpath plan scenario.toml --out out";

/// Plans how UAVs fly between known radio sensors so that they are detected least, or located worst.
#[derive(Debug, Parser)]
#[command(name = "quietpath", version, styles = STYLES, after_help = AFTER)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Option<Command>,
}

/// What can be asked.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Plan a flight; print a summary, write the plan, a report, pictures and mission files
    #[command(after_help = "\
A scenario with `[rolling]` is planned in steps, each of which knows the world as it is by then; what is written, and
weighed, is the path that was flown, and `steps/` in the folder holds the plan of each step.

Exit status: 0 planned, 1 no feasible plan found, 2 bad input.

Example:
  quietpath plan scenario.toml --out out")]
    Plan(PlanArgs),
    /// Plan a scenario and fly it over MAVLink, in simulation or with an autopilot elsewhere
    #[command(after_help = "\
The bridge knows where sensors are, hears where they move, and plans anew in flight; frames pass two UDP sockets on
127.0.0.1. The same seed flies the same flight. With --connect, the vehicle is one that somebody else has started and
takes off; sensors are the scenario's, nothing is jammed, and quietpath autopilot is such a vehicle. Ctrl-C ends the
flight, and what was flown is written all the same.

Exit status: 0 at the goal, 1 ended before it, 2 bad input or no feasible plan to begin with.

Example:
  quietpath fly scenario.toml --like ardupilot --mode mission --loss 0.1 --out out")]
    Fly(FlyArgs),
    /// Show a flight of `quietpath-bridge` to browsers on this machine while it goes on
    #[command(after_help = "\
The page follows the record of the flight as it is written; it cannot change anything. `quietpath fly --view` shows a
simulated flight. Ctrl-C ends it.

Exit status: 0 ended, 2 bad input.

Example:
  quietpath view flight.jsonl")]
    View(ViewArgs),
    /// Plan over a range of deadlines or budgets, and draw what each buys
    #[command(after_help = "\
Values have units: 105% of the shortest flight time (deadline) or of the flight's time (budgets), 18.7s; plain numbers
are multiples of the shortest flight time for a deadline, and seconds for budgets. Without values, a deadline goes from
100% to 130%, and a budget from 0 to the scenario's own. More never gives a worse plan: every plan is also tried as a
start for its neighbours. Scenarios with `[rolling]` are planned in one piece.

Exit status: 0 planned, 1 a plan is not feasible, 2 bad input.

Example:
  quietpath trade scenario.toml --over deadline --values 100%,105%,110%,115% --out trade")]
    Trade(TradeArgs),
    /// Draw a metric over the area
    #[command(after_help = "\
Pictures are in metres; the outermost percent of values at either end share a colour.
A CSV has the columns x, y (z, where a flight has three dimensions) and the metric,
at the centres of the cells and in the scenario's units.

Example:
  quietpath landscape scenario.toml --metric log_aee --out landscape.png --out landscape.csv")]
    Landscape(LandscapeArgs),
    /// Look a scenario over and give advice, or recompute the objective and the violations of a plan
    #[command(after_help = "\
Without a plan: margins, goals that cannot be reached, sensors that do nothing.

Exit status: 0 feasible, 1 not feasible or out of reach, 2 bad input.

Example:
  quietpath check scenario.toml out/plan.json")]
    Check(CheckArgs),
    /// Put a plan on a page: map, diagrams, constraints, provenance, in one HTML file
    #[command(after_help = "\
The page needs no network and no program but a browser. `quietpath plan --out` writes it too.

Exit status: 0 written, 1 written and the plan is not feasible, 2 bad input.

Example:
  quietpath report scenario.toml out/plan.json --out report.html")]
    Report(ReportArgs),
    /// Fly a plan many times through a world that is not quite the scenario's, and say how that went
    #[command(after_help = "\
What varies stands in the scenario's [study]: sensor positions, path loss, wind. Runs are written as they are done;
started again with the same arguments, the study goes on where it was ended.

Exit status: 0 flown, 2 bad input.

Example:
  quietpath study scenario.toml --runs 1000 --out study")]
    Study(StudyArgs),
    /// Put the shards of a study together
    #[command(after_help = "\
Example:
  quietpath merge --out study shards/runs-1-of-2.jsonl shards/runs-2-of-2.jsonl")]
    Merge(MergeArgs),
    /// Make a scenario from QGroundControl plans, GeoJSON, KML or tables of sensors
    #[command(after_help = "\
From .plan: home, first and last waypoint, cruise speed, fences. From .geojson and .kml: points as sensors, polygons
as regions to keep out of. From .csv: sensors, by name and latitude, longitude or east_m, north_m.
What stands in no file is taken from the starter scenario and marked `assumed`.

Example:
  quietpath import mission.plan sensors.csv --out scenario.toml")]
    Import(ImportArgs),
    /// Print the JSON Schema of scenario files, for editors
    #[command(after_help = "\
An editor with support for TOML takes it from a first line `#:schema scenario.schema.json`.

Example:
  quietpath schema > scenario.schema.json")]
    Schema,
    /// Write a commented scenario to start from
    #[command(after_help = "\
Example:
  quietpath new scenario.toml")]
    New(NewArgs),
    /// Be a simulated autopilot on a MAVLink link, for `quietpath-bridge` and ground stations to fly
    #[command(after_help = "\
Links: udpin:HOST:PORT and tcpin:HOST:PORT wait, udpout: and tcpout: call, pty:PATH makes a serial line, serial:DEVICE
uses one. Times are seconds of the flight; with --speedup 10 one of them takes a tenth of a second, and whoever is at the
other end must have the same speed. The same seed has the same faults.

Exit status: 0 its time is over, 2 bad input.

Example:
  quietpath autopilot --connect udpout:127.0.0.1:14540 --like px4 --scenario scenario.toml")]
    Autopilot(Box<AutopilotArgs>),
    /// Print the completions of a shell
    #[command(after_help = "\
Example:
  quietpath completions bash > quietpath.bash")]
    Completions(CompletionsArgs),
}

/// Arguments of `quietpath plan`.
#[derive(Debug, Args)]
pub struct PlanArgs {
    /// Scenario file; `-` reads it from standard input
    pub scenario: String,
    /// Folder for plan.json, report.html, pictures and mission files; made where it is missing
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// File for the plan alone; `-` writes it to standard output and the summary to standard error
    #[arg(long, value_name = "FILE")]
    pub plan: Option<PathBuf>,
    /// Numbers that the planner computes with
    #[arg(long, value_enum, default_value_t = PrecisionArg::F64)]
    pub precision: PrecisionArg,
    /// Metric behind the flight in the landscape [default: that of the first objective term]
    #[arg(long, value_name = "NAME", value_enum)]
    pub metric: Option<MetricArg>,
    /// Plan a scenario with `[rolling]` in one piece, every track known
    #[arg(long)]
    pub once: bool,
}

/// Arguments of `quietpath trade`.
#[derive(Debug, Args)]
pub struct TradeArgs {
    /// Scenario file; `-` reads it from standard input
    pub scenario: String,
    /// What to sweep
    #[arg(long, value_enum)]
    pub over: Over,
    /// First value
    #[arg(long, value_name = "VALUE")]
    pub from: Option<Amount>,
    /// Last value
    #[arg(long, value_name = "VALUE")]
    pub to: Option<Amount>,
    /// Number of values from first to last [default: 6]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(2..=64))]
    pub points: Option<u8>,
    /// The values one by one, separated by commas
    #[arg(long, value_name = "VALUES", value_delimiter = ',', conflicts_with_all = ["from", "to", "points"])]
    pub values: Vec<Amount>,
    /// Metric of the landscape and of the first curves [default: that of the first objective term]
    #[arg(long, value_name = "NAME", value_enum)]
    pub metric: Option<MetricArg>,
    /// Folder for pictures, figures and plans; made where it is missing
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

/// Arguments of `quietpath landscape`.
#[derive(Debug, Args)]
pub struct LandscapeArgs {
    /// Scenario file; `-` reads it from standard input
    pub scenario: String,
    /// Metric to draw
    #[arg(long, value_name = "NAME", value_enum)]
    pub metric: MetricArg,
    /// Instant of the picture, in seconds, where sensors move [default: the start time]
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    pub time: Option<f64>,
    /// Height of the picture in a flight in three dimensions, in length units [default: that of the first start]
    #[arg(long, value_name = "Z", allow_negative_numbers = true)]
    pub height: Option<f64>,
    /// Cells along the longer side
    #[arg(long, value_name = "N", default_value_t = 240, value_parser = clap::value_parser!(u16).range(2..=2000))]
    pub resolution: u16,
    /// File to write: .png, .svg or .csv, or `-` for CSV on standard output; may be repeated
    #[arg(long, value_name = "FILE", default_value = "landscape.png")]
    pub out: Vec<PathBuf>,
}

/// Arguments of `quietpath check`.
#[derive(Debug, Args)]
pub struct CheckArgs {
    /// Scenario file; `-` reads it from standard input
    pub scenario: String,
    /// Plan file; `-` reads it from standard input
    pub plan: Option<String>,
}

/// Arguments of `quietpath report`.
#[derive(Debug, Args)]
pub struct ReportArgs {
    /// Scenario file; `-` reads it from standard input
    pub scenario: String,
    /// Plan file; `-` reads it from standard input
    pub plan: String,
    /// Metric that the map shows first [default: that of the first objective term]
    #[arg(long, value_name = "NAME", value_enum)]
    pub metric: Option<MetricArg>,
    /// File to write
    #[arg(long, value_name = "FILE", default_value = "report.html")]
    pub out: PathBuf,
}

/// Arguments of `quietpath study`.
#[derive(Debug, Args)]
pub struct StudyArgs {
    /// Scenario file with `[study]`; `-` reads it from standard input
    pub scenario: String,
    /// Number of runs
    #[arg(long, value_name = "N", default_value_t = 1000, value_parser = clap::value_parser!(u64).range(1..=100_000_000))]
    pub runs: u64,
    /// Plan file to fly [default: the scenario is planned]
    #[arg(long, value_name = "FILE")]
    pub plan: Option<String>,
    /// Plan a scenario with `[rolling]` in one piece, every track known
    #[arg(long)]
    pub once: bool,
    /// Fly the I-th part of N alone, such as 1/4
    #[arg(long, value_name = "I/N")]
    pub shard: Option<Shard>,
    /// Folder for runs, summary and pictures; made where it is missing
    #[arg(long, value_name = "DIR", default_value = "study")]
    pub out: PathBuf,
}

/// A part of a study.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// Which part, from 1.
    pub index: u32,
    /// How many parts there are.
    pub count: u32,
}

impl std::str::FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts = text.split_once('/').and_then(|(index, count)| Some((index.parse().ok()?, count.parse().ok()?)));
        match parts {
            Some((index, count)) if (1..=count).contains(&index) => Ok(Self { index, count }),
            _ => Err("write I/N with I from 1 to N, such as 1/4".into()),
        }
    }
}

/// Arguments of `quietpath merge`.
#[derive(Debug, Args)]
pub struct MergeArgs {
    /// Files of runs
    #[arg(required = true)]
    pub files: Vec<PathBuf>,
    /// Folder for runs, summary and pictures; made where it is missing
    #[arg(long, value_name = "DIR", default_value = "study")]
    pub out: PathBuf,
}

/// Arguments of `quietpath import`.
#[derive(Debug, Args)]
pub struct ImportArgs {
    /// Files: .plan, .geojson, .kml, .csv
    #[arg(required = true)]
    pub files: Vec<PathBuf>,
    /// Scenario file to write; `-` for standard output
    #[arg(long, value_name = "FILE", default_value = "scenario.toml")]
    pub out: PathBuf,
    /// Overwrite a file that exists
    #[arg(long)]
    pub force: bool,
}

/// Arguments of `quietpath new`.
#[derive(Debug, Args)]
pub struct NewArgs {
    /// File to write; `-` for standard output
    #[arg(default_value = "scenario.toml")]
    pub file: PathBuf,
    /// Overwrite a file that exists
    #[arg(long)]
    pub force: bool,
}

/// Arguments of `quietpath autopilot`.
#[derive(Debug, Args)]
pub struct AutopilotArgs {
    /// The link that it speaks on
    #[arg(long, value_name = "URL")]
    pub connect: String,
    /// Which autopilot it is like
    #[arg(long, value_enum)]
    pub like: LikeArg,
    /// Scenario whose agent it is: it stands below the agent's start, as fast as the agent
    #[arg(long, value_name = "FILE")]
    pub scenario: Option<String>,
    /// The agent [default: the first]
    #[arg(long, value_name = "NAME", requires = "scenario")]
    pub agent: Option<String>,
    /// Where it stands: degrees and metres above the sea
    #[arg(long, value_name = "LAT,LON,ALT", value_parser = home, allow_hyphen_values = true)]
    pub at: Option<Home>,
    /// What the person with the remote control does
    #[arg(long, value_enum, default_value_t = PilotArg::None)]
    pub pilot: PilotArg,
    /// How many times faster than time it flies
    #[arg(long, value_name = "N", default_value_t = 1.0)]
    pub speedup: f64,
    /// System id
    #[arg(long, value_name = "ID", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=250))]
    pub system: u8,
    /// Key file: sign what is sent, refuse what is not signed
    #[arg(long, value_name = "FILE")]
    pub signing_key: Option<PathBuf>,
    /// A jammer on board at this component id; may be repeated
    #[arg(long, value_name = "ID")]
    pub jammer: Vec<u8>,
    /// A transmitter on board at this component id; may be repeated
    #[arg(long, value_name = "ID")]
    pub transmitter: Vec<u8>,
    /// End after this time
    #[arg(long = "for", value_name = "SECONDS", value_parser = seconds)]
    pub seconds: Option<Duration>,
    /// Write the track that is flown as CSV
    #[arg(long, value_name = "FILE")]
    pub track: Option<PathBuf>,
    /// Faults: share of frames that are lost, in each direction
    #[arg(long, value_name = "SHARE", default_value_t = 0.0)]
    pub loss: f64,
    /// Faults: share of frames that come twice
    #[arg(long, value_name = "SHARE", default_value_t = 0.0)]
    pub duplicate: f64,
    /// Faults: share of frames with a flipped bit
    #[arg(long, value_name = "SHARE", default_value_t = 0.0)]
    pub corrupt: f64,
    /// Faults: least delay
    #[arg(long, value_name = "MS", default_value_t = 0)]
    pub delay: u64,
    /// Faults: largest delay on top of it, which reorders frames
    #[arg(long, value_name = "MS", default_value_t = 0)]
    pub jitter: u64,
    /// Faults: seed of their chance
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
    /// Faults: the autopilot restarts at this time; may be repeated
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub restart_at: Vec<Duration>,
    /// Faults: nothing comes in or goes out for a while; may be repeated
    #[arg(long, value_name = "FROM-UNTIL", value_parser = window)]
    pub silent: Vec<Window>,
    /// Faults: another ground station replaces the mission at this time; may be repeated
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub station_at: Vec<Duration>,
}

/// From when, until when.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Window(pub Duration, pub Duration);

/// A kind of autopilot, as the command line names it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum LikeArg {
    /// PX4
    Px4,
    /// ArduPilot: ArduCopter
    Ardupilot,
}

/// What the person with the remote control does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum PilotArg {
    /// Nothing: the vehicle stands
    None,
    /// Arms, takes off, and leaves the vehicle in the air
    Takeoff,
    /// Waits for a mission, arms and starts it
    Mission,
}

fn seconds(text: &str) -> Result<Duration, String> {
    let number = text.parse().map_err(|_| "not a number of seconds".to_owned())?;
    Duration::try_from_secs_f64(number).map_err(|_| "not a time in seconds".to_owned())
}

fn window(text: &str) -> Result<Window, String> {
    let (from, until) = text.split_once('-').ok_or("write it as 30-34.5")?;
    let window = Window(seconds(from)?, seconds(until)?);
    if window.0 < window.1 { Ok(window) } else { Err("it ends before it begins".to_owned()) }
}

fn home(text: &str) -> Result<Home, String> {
    let numbers: Vec<f64> = text.split(',').filter_map(|part| part.trim().parse().ok()).collect();
    match numbers.as_slice() {
        [latitude_deg, longitude_deg, altitude_m]
            if latitude_deg.abs() <= 90.0 && longitude_deg.abs() <= 180.0 && altitude_m.is_finite() =>
        {
            Ok(Home { latitude_deg: *latitude_deg, longitude_deg: *longitude_deg, altitude_m: *altitude_m })
        }
        _ => Err("write latitude and longitude in degrees and the altitude in metres, as 47.4,8.5,488".to_owned()),
    }
}

/// Arguments of `quietpath completions`.
#[derive(Debug, Args)]
pub struct CompletionsArgs {
    /// Shell to complete for
    #[arg(value_enum)]
    pub shell: clap_complete::Shell,
}

/// Floating-point format, as the command line names it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum PrecisionArg {
    /// 32 bits, as small microcontrollers compute
    F32,
    /// 64 bits
    F64,
}

/// Metric, by the names of scenario files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MetricArg(pub quietpath_core::scenario::Metric);

impl ValueEnum for MetricArg {
    fn value_variants<'a>() -> &'a [Self] {
        const ALL: [MetricArg; 10] = {
            let mut all = [MetricArg(quietpath_core::scenario::Metric::Detection); 10];
            let mut index = 0;
            while index < all.len() {
                all[index] = MetricArg(quietpath_core::scenario::Metric::ALL[index]);
                index += 1;
            }
            all
        };
        &ALL
    }

    fn to_possible_value(&self) -> Option<clap::builder::PossibleValue> {
        Some(clap::builder::PossibleValue::new(self.0.name()))
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory as _;

    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn the_help_of_every_command_ends_with_an_example() {
        let command = Cli::command();
        for command in command.get_subcommands().chain([&command]) {
            let help = command.clone().render_long_help().to_string();
            let last = help.trim_end().lines().rev().take(2).collect::<Vec<_>>();
            assert_eq!(last[1], "Example:", "{help}");
            assert!(last[0].starts_with("  quietpath "), "{help}");
        }
    }
}
