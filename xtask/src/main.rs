//! The developer loop: `cargo xtask check`, `test`, `target`, `header`, `instructions`, `sizes`, `ci`, `pictures`,
//! `gallery`, `bench`, `live`, `count`, `fuzz`, `faults`, `numbers`, `miri`, `sanitize`, `deny`.
//!
//! Every command is a list of steps. A step is a program run from the top of the repository with its output passed
//! through; the first that fails ends the run, and a summary says what ran, how long it took, and what did not run.

mod count;
mod firmware;
mod fuzz;
mod miri;
mod sanitize;
mod step;
mod watch;

use std::path::Path;
use std::process::ExitCode;

use anyhow::Context;
use clap::{Parser, Subcommand};

use count::Profile;
use firmware::Table;
use step::Step;

/// The scenario whose report is shown on the pages.
const REPORT: &str = "wight-jam";
/// Pictures of the report: name, width and height, instant in seconds, and whether in the dark.
const SCREENS: [(&str, &str, &str, bool); 2] =
    [("report-1280", "1280,1500", "5400", false), ("report-390-dark", "390,1500", "5400", true)];

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
    /// The pictures of the pages, drawn anew by the program; those of the report need chromium
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
    /// Every fuzz target in turn; writes docs/hardening/fuzz.md. Needs a nightly toolchain and cargo-fuzz
    Fuzz {
        /// How long each target is fuzzed
        seconds: u64,
        /// This target alone; writes no page
        #[arg(long)]
        only: Option<String>,
    },
    /// Flights on which something goes wrong, over many seeds; writes docs/hardening/faults.md
    Faults {
        /// Seeds of each fault that one process is enough for
        #[arg(default_value_t = 1000)]
        seeds: u64,
        /// Seeds of each fault of the programs; each takes some ten seconds
        #[arg(long, default_value_t = 20)]
        programs: u64,
    },
    /// Plans random problems in f32 and f64 and judges the plans; writes docs/hardening/numbers.md
    Numbers {
        /// Problems
        #[arg(default_value_t = 10_000)]
        count: u64,
        /// How many of them are planned with assertions and overflow checks too
        #[arg(long, default_value_t = 2000)]
        checked: u64,
        /// Problems at a time
        #[arg(long, default_value_t = 2)]
        threads: u64,
    },
    /// The core's tests under Miri, a selection; writes docs/hardening/miri.md. Needs a nightly toolchain with Miri
    Miri,
    /// The bridge's tests under sanitizers of addresses and threads; writes docs/hardening/sanitizers.md. Needs a nightly
    /// toolchain with rust-src
    Sanitize,
    /// Licences, sources and duplicates of all dependencies, and withdrawn versions. Needs cargo-deny and cargo-audit
    Deny,
    /// Flies the bridge against the simulated autopilot, and writes docs/live.md: latency, load, endurance; takes six minutes
    Live,
    /// The instructions of one plan, counted by valgrind, in all and by function
    Count {
        /// A published scenario
        #[arg(default_value = "square8-detection")]
        scenario: String,
        /// Whether the program is compiled to be used, or as it is for tests, where it is there already
        #[arg(long, value_enum, default_value_t = Profile::Release)]
        profile: Profile,
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
        Command::Count { scenario, profile } => return count::count(scenario, *profile, top),
        Command::Fuzz { seconds, only } => return fuzz::fuzz(*seconds, only.as_deref(), top),
        Command::Numbers { count, checked, threads } => numbers(*count, *checked, *threads),
        Command::Miri => return miri::miri(top),
        Command::Sanitize => return sanitize::sanitize(top),
        Command::Faults { seeds, programs } => faults(*seeds, *programs),
        Command::Deny => deny(top)?,
        Command::Check => check(),
        Command::Test => test()?,
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
        Command::Ci => check().into_iter().chain(test()?).collect(),
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
        "clippy --manifest-path firmware/Cargo.toml --target-dir target/firmware --workspace --exclude quietpath-decode --release --target {} -- -D warnings",
        firmware::TARGET
    );
    vec![
        Step::cargo("formatting", "fmt --all --check"),
        Step::cargo("formatting of the firmware", "fmt --manifest-path firmware/Cargo.toml --all --check"),
        Step::cargo("lints", "clippy --workspace --all-targets -- -D warnings"),
        // As others get it: the workspace asks for more memory, and its size is held where memory is shared.
        Step::cargo("lints of the core alone", "clippy --package quietpath-core -- -D warnings"),
        Step::new("target installed", "rustup", &format!("target add {}", firmware::TARGET)),
        Step::cargo("lints of the firmware", &lints_of_firmware),
        Step::cargo("documentation", "doc --workspace --no-deps --document-private-items")
            .with_env("RUSTDOCFLAGS", "-D warnings"),
    ]
}

fn test() -> anyhow::Result<Vec<Step>> {
    // This very program: cargo would build it again, for itself alone.
    let xtask = std::env::current_exe().context("a program knows where it is")?;
    // With the whole workspace, or its crates are built again with other features.
    let others = "test --workspace --test interoperate --test page -- --ignored";
    let mut steps = vec![Step::cargo("tests", "test --workspace")];
    steps.extend(chromium());
    steps.push(Step::cargo("other people's MAVLink, and the report in a browser", others));
    steps.push(Step::new("the firmware under QEMU", &xtask, "target"));
    steps.push(Step::new("sizes of the firmware", &xtask, "sizes --compare"));
    Ok(steps)
}

/// Chromium, from the system's packages where it is missing; elsewhere the tests say what they need.
fn chromium() -> Vec<Step> {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let has = |program: &str| std::env::split_paths(&path).any(|folder| folder.join(program).is_file());
    if has("chromium") || !has("apt-get") {
        return Vec::new();
    }
    let install = "install -qq -y --no-install-recommends chromium";
    vec![Step::new("packages listed", "apt-get", "update -qq"), Step::new("chromium installed", "apt-get", install)]
}

fn bench(arguments: &[String]) -> Step {
    let program = "run --release --package quietpath-tests --bin bench --";
    Step::cargo("measurements", [&[program.to_owned()], arguments].concat().join(" ").trim_end())
}

fn faults(seeds: u64, programs: u64) -> Vec<Step> {
    let choices = format!("{seeds} --programs {programs} --threads 4 --out docs/hardening/faults.md");
    vec![
        // As tests build them, with all checks on, and as the campaign itself does for the programs that it starts.
        Step::cargo("the programs", "test --no-run --quiet --workspace --test interoperate --test cli"),
        Step::new("faults", "target/debug/faults", &choices),
    ]
}

fn numbers(count: u64, checked: u64, threads: u64) -> Vec<Step> {
    let program = "--package quietpath-abuse --bin numbers --";
    let page = "docs/hardening/numbers.md";
    let released = format!("run --release {program} {count} --threads {threads} --out {page}");
    let checked = format!("run {program} {checked} --threads {threads} --append {page}");
    vec![Step::cargo("random problems", &released), Step::cargo("the same, with all checks on", &checked)]
}

/// Folders of workspaces: each has its own list of dependencies.
const WORKSPACES: [&str; 3] = [".", "firmware", "fuzz"];

fn deny(top: &Path) -> anyhow::Result<Vec<Step>> {
    // The database of advisories is a repository that is not reached from everywhere. What the registry says of each
    // version is here already, and all that is asked of cargo-audit: so it gets a database without advisories.
    let empty = top.join("target/no-advisories");
    std::fs::create_dir_all(empty.join("crates"))?;
    let empty = empty.display();
    let ours = "-c user.name=xtask -c user.email=xtask@localhost";
    let mut steps = vec![
        Step::cargo("dependencies", "deny check licenses bans sources"),
        Step::new("no advisories", "git", &format!("-C {empty} init --quiet")),
        Step::new("no advisories", "git", &format!("-C {empty} {ours} commit --quiet --allow-empty --message none")),
    ];
    for folder in WORKSPACES {
        // What the registry says of a version comes with it.
        steps.push(Step::cargo(
            "what is there",
            &format!("fetch --quiet --locked --manifest-path {folder}/Cargo.toml"),
        ));
        let audit = format!("audit --db {empty} --no-fetch --deny yanked --file {folder}/Cargo.lock");
        steps.push(Step::cargo("withdrawn versions", &audit));
    }
    Ok(steps)
}

fn pictures() -> Vec<Step> {
    let plan = |name| {
        let arguments = format!("run --release -- plan sim/scenarios/{name}.toml --out target/pictures/{name}");
        Step::cargo(name, &arguments)
    };
    let study = "run --release -- study sim/scenarios/square8-detection.toml --out target/pictures/study";
    let report = format!("run --release -- fly sim/scenarios/{REPORT}.toml --out target/pictures/{REPORT}");
    let mut steps: Vec<Step> = PICTURES.into_iter().map(plan).collect();
    steps.push(Step::cargo("study", study));
    steps.push(Step::cargo("report", &report));
    steps.extend(SCREENS.map(|(name, size, instant, dark)| screen(name, size, instant, dark)));
    steps
}

/// The report in headless Chromium, into a picture.
fn screen(name: &'static str, size: &str, instant: &str, dark: bool) -> Step {
    let top = concat!(env!("CARGO_MANIFEST_DIR"), "/../target/pictures");
    let scheme =
        if dark { "--blink-settings=preferredColorScheme=0" } else { "--blink-settings=preferredColorScheme=1" };
    let options = "--headless --no-sandbox --disable-gpu --no-first-run --hide-scrollbars --virtual-time-budget=8000";
    let quiet = "--disable-quic --disable-background-networking --disable-component-update --disable-sync";
    let files = format!("--user-data-dir={top}/browser --screenshot={top}/{name}.png --window-size={size}");
    let page = format!("file://{top}/{REPORT}/report.html#t={instant}");
    Step::new(name, "chromium", &format!("{options} {quiet} {scheme} {files} {page}"))
}

/// Copies the pictures to where the pages look for them.
fn hang(top: &Path) -> anyhow::Result<()> {
    let wall = top.join("docs/pictures");
    std::fs::create_dir_all(&wall).with_context(|| format!("cannot make {}", wall.display()))?;
    let landscapes = PICTURES.map(|name| (format!("{name}/landscape.png"), name));
    let screens = SCREENS.map(|(name, ..)| (format!("{name}.png"), name));
    for (picture, name) in landscapes.into_iter().chain(screens).chain([("study/study.png".to_owned(), "study")]) {
        let picture = top.join("target/pictures").join(picture);
        let place = wall.join(name).with_extension("png");
        std::fs::copy(&picture, &place).with_context(|| format!("cannot copy {}", picture.display()))?;
        println!("{}", place.display());
    }
    Ok(())
}
