//! `quietpath fly`: a scenario, planned and flown over MAVLink in simulation.
//!
//! | file in `--out` | what |
//! |---|---|
//! | `report.html` | the flight as one page that moves |
//! | `plan.json` | the plan that it began with |
//! | `steps/plan-01.json`, .. | the plans that took over in flight |
//! | `flown.json` | the way that was flown, as a plan file |
//! | `landscape.svg`, `.png`, `series.svg`, `.png` | pictures of what was flown |
//! | `mission.plan`, `mission.waypoints`, `path.geojson` | the first plan, for ground stations and maps |
//! | `flight.log` | what the bridge said |

use std::fmt::Write as _;
use std::time::Instant;

use quietpath_bridge::file::mission::{file_name, missions};
use quietpath_bridge::file::{PlanFile, ScenarioFile, geojson};
use quietpath_bridge::flight::{End, FlyMode, Level};
use quietpath_bridge::planning;
use quietpath_bridge::telemetry::Autopilot;
use quietpath_core::scenario::Metric;

use super::{landscape, load, plan::background};
use crate::cli::{FlyArgs, FlyModeArg, LikeArg};
use crate::fly::{self, Flown, Look, Manner, Progress, ended};
use crate::illustrate;
use crate::outcome::{Failure, Stream, Verdict, flight_bar, say, with_progress, write_file};
use crate::page::{self, Story, Way};
use crate::report;
use crate::units;
use crate::view::{self, Server, shown};

/// The scenario that is flown when nothing is asked.
pub const BUILT_IN: &str = include_str!("../../scenarios/wight-jam.toml");
/// Where its files go.
const BUILT_IN_OUT: &str = "out";
/// Parts of the bar that shows how much is flown.
const PARTS: u64 = 1000;
/// Cells along the longer side of the landscape behind a flight.
const CELLS: usize = 240;

/// Flies a scenario file.
///
/// # Errors
/// Bad input, a scenario that cannot be planned or flown, files that cannot be written.
pub fn run(args: &FlyArgs) -> Result<Verdict, Failure> {
    carry_out(&load(&args.scenario)?, args)
}

/// Flies the built-in scenario into the folder `out`.
///
/// # Errors
/// Files that cannot be written.
pub fn built_in() -> Result<Verdict, Failure> {
    let scenario = ScenarioFile::parse("built-in scenario", BUILT_IN)?.scenario;
    let args = FlyArgs {
        scenario: String::new(),
        mode: FlyModeArg::Guided,
        like: LikeArg::Px4,
        loss: 0.0,
        seed: 1,
        speedup: None,
        connect: None,
        metric: None,
        view: None,
        out: BUILT_IN_OUT.into(),
    };
    let words = "Flying the built-in scenario in simulation; `quietpath --help` tells what else there is.\n\n";
    say(Stream::Out, words)?;
    carry_out(&scenario, &args)
}

fn carry_out(scenario: &ScenarioFile, args: &FlyArgs) -> Result<Verdict, Failure> {
    if !(0.0..1.0).contains(&args.loss) {
        return Err(Failure::Input(format!("--loss {} is no share: give a number from 0 to below 1", args.loss)));
    }
    if args.speedup.is_some_and(|speedup| !(speedup.is_finite() && speedup > 0.0)) {
        return Err(Failure::input("--speedup is how many times faster than time it flies: a number above 0"));
    }
    let steps = args.out.join("steps");
    std::fs::create_dir_all(&steps)
        .map_err(|cause| Failure::Input(format!("cannot make the folder {}: {cause}", steps.display())))?;
    let metric = background(scenario, args.metric)?;
    let manner = Manner {
        like: match args.like {
            LikeArg::Px4 => Autopilot::Px4,
            LikeArg::Ardupilot => Autopilot::ArduPilot,
        },
        mode: match args.mode {
            FlyModeArg::Guided => FlyMode::Guided,
            FlyModeArg::Mission => FlyMode::Mission,
        },
        loss: args.loss,
        seed: args.seed,
        speedup: args.speedup,
        connect: args.connect.clone(),
    };
    let bar = flight_bar("planning", PARTS);
    let unit_m = scenario.frame.unit_m;
    let server = args.view.map(Server::start).transpose()?;
    if let Some(server) = &server {
        say(Stream::Err, &format!("the flight as it goes on: http://{}/\n", server.address()))?;
    }
    let mut pace = view::Pace::default();
    let flown = fly::fly(scenario, &manner, |look| {
        bar.set_message(words(look.progress, unit_m));
        bar.set_position(parts(&look));
        let is_due = pace.is_due() || look.end.is_some();
        let begun = Instant::now();
        if let Some(server) = server.as_ref().filter(|_| is_due)
            && let Some(page) = shown(look, metric)?
        {
            pace.shown(begun);
            server.show(page);
        }
        Ok(())
    })?;
    bar.finish_and_clear();
    if flown.track.nodes() < 2 {
        return Err(Failure::Input(format!("nothing was flown: {}", ended(&flown.end))));
    }
    let files = with_progress("drawing", || write(scenario, &flown, metric, args))?;
    say(Stream::Out, &summary(scenario, &flown, &files, args)?)?;
    Ok(Verdict::on(flown.end == End::Done))
}

/// Progress in a few words: step, time, position, detection, link.
fn words(progress: &Progress, unit_m: f64) -> String {
    let who = progress.agent.as_ref().map(|name| format!("{name}, ")).unwrap_or_default();
    let time = progress.time.map_or_else(|| progress.phase.to_owned(), |time| format!("{time:.0} s"));
    let place: Vec<String> = progress.position.iter().take(2).map(|part| units::length(part * unit_m)).collect();
    format!(
        "{who}plan {}, {time}, {} north, detection {:.3}, peak {:.3}, {:.1} % lost",
        progress.replans + 1,
        place.join(" east "),
        progress.detection,
        progress.peak,
        100.0 * progress.loss,
    )
}

/// Parts of the plan's time that are flown, of [`PARTS`].
fn parts(look: &Look<'_>) -> u64 {
    let (Some(time), Some(plan)) = (look.progress.time, look.steps.last()) else { return 0 };
    let begin = look.steps.first().map_or(plan.start_time, |first| first.start_time);
    let whole = plan.start_time + plan.duration - begin;
    ((time - begin) / whole.max(f64::MIN_POSITIVE) * PARTS as f64).clamp(0.0, PARTS as f64) as u64
}

/// Writes everything; the names of the files.
fn write(scenario: &ScenarioFile, flown: &Flown, metric: Metric, args: &FlyArgs) -> Result<Vec<String>, Failure> {
    let mut files = Vec::new();
    let mut put = |name: String, bytes: &[u8]| -> Result<(), Failure> {
        write_file(&args.out.join(&name), bytes)?;
        files.push(name);
        Ok(())
    };
    let assessment = planning::assess(scenario, &flown.track, "the flight")?;
    let settings = settings(args, flown);
    let story = Story {
        plan: &flown.track,
        way: Way::Flown,
        assessment: &assessment,
        steps: &flown.steps,
        wire: &flown.wire,
        background: metric,
        settings: &settings,
    };
    put("report.html".into(), page::html(scenario, &story)?.as_bytes())?;
    put("flown.json".into(), flown.track.to_json().as_bytes())?;
    for (index, step) in flown.steps.iter().enumerate() {
        let name = if index == 0 { "plan.json".into() } else { format!("steps/plan-{index:02}.json") };
        put(name, step.to_json().as_bytes())?;
    }
    let grid = planning::landscape(scenario, &landscape::view(scenario, metric, CELLS))?;
    let drawn = illustrate::Flown { plan: &flown.track, assessment: &assessment, steps: &[] };
    let pictures = [
        ("landscape", illustrate::landscape(scenario, &grid, Some(&flown.track)).map_err(Failure::input)?),
        ("series", illustrate::series(scenario, drawn)),
    ];
    for (name, picture) in &pictures {
        put(format!("{name}.png"), &picture.png().map_err(Failure::input)?)?;
        put(format!("{name}.svg"), picture.svg().as_bytes())?;
    }
    if let Some(first) = flown.steps.first() {
        put("path.geojson".into(), geojson::to_geojson(scenario, first)?.as_bytes())?;
        missions_of(scenario, first, &mut put)?;
    }
    put("flight.log".into(), log(flown).as_bytes())?;
    Ok(files)
}

fn missions_of(
    scenario: &ScenarioFile,
    plan: &PlanFile,
    put: &mut impl FnMut(String, &[u8]) -> Result<(), Failure>,
) -> Result<(), Failure> {
    let missions = missions(scenario, plan)?;
    for mission in &missions {
        let name = |extension| file_name(&mission.agent, missions.len(), extension);
        put(name("plan"), mission.to_qgc_plan().as_bytes())?;
        put(name("waypoints"), mission.to_waypoints().as_bytes())?;
    }
    Ok(())
}

fn settings(args: &FlyArgs, flown: &Flown) -> Vec<(String, String)> {
    let row = |name: &str, value: String| (name.to_owned(), value);
    let like = match args.like {
        LikeArg::Px4 => "PX4",
        LikeArg::Ardupilot => "ArduPilot",
    };
    let mode = match args.mode {
        FlyModeArg::Guided => "by setpoints of the bridge",
        FlyModeArg::Mission => "along an uploaded mission",
    };
    vec![
        row("autopilot", format!("simulated, like {like}")),
        row("steered", mode.into()),
        row("frames lost on purpose", format!("{} %", 100.0 * args.loss)),
        row("seed", args.seed.to_string()),
        row("plans", format!("{}, {} of them in flight", flown.steps.len(), flown.steps.len() - 1)),
        row("ended", ended(&flown.end)),
    ]
}

fn log(flown: &Flown) -> String {
    let mut text = String::new();
    for (time, level, words) in &flown.log {
        let mark = if *level == Level::Warn { " warning:" } else { "" };
        let _ = writeln!(text, "{time:10.2} s{mark} {words}");
    }
    text
}

fn summary(scenario: &ScenarioFile, flown: &Flown, files: &[String], args: &FlyArgs) -> Result<String, Failure> {
    let assessment = planning::assess(scenario, &flown.track, "the flight")?;
    let last = &flown.last;
    let mut text = String::new();
    let mut row = |label: &str, value: String| {
        let _ = writeln!(text, "{label:<26}{value}");
    };
    row("scenario", scenario.name.clone());
    row("ended", ended(&flown.end));
    row("constraints", report::kept(&assessment));
    row("flight time", units::duration(flown.track.duration));
    for agent in &assessment.agents {
        for (label, value) in report::agent_rows(scenario, &assessment, agent) {
            row(label, value);
        }
    }
    row("plans in flight", last.replans.to_string());
    let [out, back] = last.frames;
    row("frames", format!("{out} out, {back} in, {:.1} % lost", 100.0 * last.loss));
    row("took", format!("{:.1} s", flown.seconds));
    text.push_str("\nfiles\n");
    for name in files.iter().filter(|name| !name.starts_with("steps/")) {
        let _ = writeln!(text, "  {}", args.out.join(name).display());
    }
    let steps = files.iter().filter(|name| name.starts_with("steps/")).count();
    if steps > 0 {
        let _ = writeln!(text, "  {} ({steps} plans)", args.out.join("steps").display());
    }
    Ok(text)
}
