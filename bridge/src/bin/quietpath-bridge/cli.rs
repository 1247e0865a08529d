//! The command line.

use std::path::PathBuf;

use clap::{ArgAction, Args, Parser, Subcommand, ValueEnum};

#[derive(Parser)]
#[command(name = "quietpath-bridge", version, about = "Flies quietpath plans on an autopilot that speaks MAVLink")]
pub struct Arguments {
    #[command(subcommand)]
    pub command: Command,
}

#[derive(Subcommand)]
pub enum Command {
    /// Fly a plan
    Run(RunArgs),
    /// Upload the mission and the fence of a plan, and read them back
    Upload(UploadArgs),
    /// Write the mission that the autopilot holds, as a QGC WPL 110 file
    Download(DownloadArgs),
    /// Say who is there and how good the link is
    Status(StatusArgs),
    /// Send lines of observations from standard input to a bridge, sealed with a key
    Observe(ObserveArgs),
    /// Feed a record to a new flight and compare what comes out, bit for bit
    Replay {
        /// What `run --record` wrote
        record: PathBuf,
        /// Do not print the outputs
        #[arg(long = "quiet", action = ArgAction::SetTrue, value_parser = Quiet::from_flag())]
        quiet: Quiet,
    },
}

/// Whether to print what comes out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quiet {
    /// Print.
    No,
    /// Do not.
    Yes,
}

impl Quiet {
    fn from_flag() -> impl clap::builder::TypedValueParser<Value = Self> {
        use clap::builder::TypedValueParser as _;
        clap::builder::BoolishValueParser::new().map(|set| if set { Self::Yes } else { Self::No })
    }
}

#[derive(Args)]
pub struct LinkArgs {
    /// serial:DEVICE[:BAUD], udpin:HOST:PORT, udpout:HOST:PORT, tcpin:HOST:PORT or tcpout:HOST:PORT
    #[arg(long, value_name = "URL")]
    pub link: Option<String>,
    /// Key file: sign what is sent, refuse what is not signed
    #[arg(long, value_name = "FILE")]
    pub signing_key: Option<PathBuf>,
    /// System id of the vehicle; the first autopilot heard where not given
    #[arg(long, value_name = "ID")]
    pub system: Option<u8>,
    /// Which autopilot to expect
    #[arg(long, value_enum)]
    pub autopilot: Option<AutopilotArg>,
    /// Configuration file; what is given here as well overrides it
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum AutopilotArg {
    /// Whichever answers
    Auto,
    /// PX4
    Px4,
    /// ArduPilot
    Ardupilot,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ModeArg {
    /// The autopilot flies an uploaded mission
    Mission,
    /// The bridge steers by setpoints
    Guided,
}

#[derive(Args)]
pub struct PlanFiles {
    /// The scenario
    #[arg(long, value_name = "FILE")]
    pub scenario: Option<PathBuf>,
    /// The plan, as `quietpath plan` writes it
    #[arg(long, value_name = "FILE")]
    pub plan: Option<PathBuf>,
    /// The agent that this vehicle is; the first where not given
    #[arg(long, value_name = "NAME")]
    pub agent: Option<String>,
}

#[derive(Args)]
pub struct RunArgs {
    #[command(flatten)]
    pub link: LinkArgs,
    #[command(flatten)]
    pub files: PlanFiles,
    /// Who steers
    #[arg(long, value_enum)]
    pub mode: Option<ModeArg>,
    /// Record everything to this file, and the frames to a .tlog beside it
    #[arg(long, value_name = "FILE")]
    pub record: Option<PathBuf>,
    /// Where to keep what a bridge needs that picks this flight up, if this one dies in it
    #[arg(long, value_name = "FILE")]
    pub state: Option<PathBuf>,
    /// Where observations of sensors come from: a file that grows, or udp:HOST:PORT. Other hosts need --observations-key
    #[arg(long, value_name = "SOURCE")]
    pub observations: Option<String>,
    /// Key file: datagrams of observations that are not sealed with it are refused
    #[arg(long, value_name = "FILE")]
    pub observations_key: Option<PathBuf>,
    /// Allow jamming, where the scenario allows it too. Radiating interference needs lawful authority
    #[arg(long, action = ArgAction::SetTrue)]
    pub arm_jammer: bool,
    /// How many times faster than time to fly, against a simulated autopilot with the same speed
    #[arg(long, value_name = "N", default_value_t = 1.0)]
    pub speedup: f64,
}

#[derive(Args)]
pub struct UploadArgs {
    #[command(flatten)]
    pub link: LinkArgs,
    #[command(flatten)]
    pub files: PlanFiles,
}

#[derive(Args)]
pub struct DownloadArgs {
    #[command(flatten)]
    pub link: LinkArgs,
    /// Which list
    #[arg(long, value_enum, default_value = "mission")]
    pub list: ListArg,
    /// Where to write it; standard output where not given
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ListArg {
    /// The mission
    Mission,
    /// The fence
    Fence,
    /// Rally points
    Rally,
}

#[derive(Args)]
pub struct ObserveArgs {
    /// Where the bridge listens: HOST:PORT
    #[arg(long, value_name = "ADDRESS")]
    pub to: String,
    /// The bridge's --observations-key
    #[arg(long, value_name = "FILE")]
    pub key: PathBuf,
}

#[derive(Args)]
pub struct StatusArgs {
    #[command(flatten)]
    pub link: LinkArgs,
    /// Parameters of the autopilot to read
    #[arg(long = "param", value_name = "NAME")]
    pub params: Vec<String>,
    /// How long to listen, s
    #[arg(long, default_value_t = 5.0, value_name = "SECONDS")]
    pub seconds: f64,
}
