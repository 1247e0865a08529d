//! `quietpath study`: one plan, flown many times through a world that is not quite the scenario's; and `quietpath merge`.
//!
//! | file in `--out` | what |
//! |---|---|
//! | `plan.json` | the plan that is flown |
//! | `runs.jsonl`, with `--shard` `runs-i-of-n.jsonl` | a heading, then a line a run, as they are done |
//! | `summary.json` | quantiles and failures |
//! | `study.svg`, `.png` | distributions |
//!
//! Started again with the same arguments it goes on where it was ended. A shard writes its runs alone; `quietpath merge` puts
//! shards together.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc;

use quietpath_bridge::file::{FileError, PlanFile, ScenarioFile};
use quietpath_bridge::planning::{self, Options, Rollout};

use super::load;
use crate::cli::{MergeArgs, Shard, StudyArgs};
use crate::outcome::{Failure, Stream, Verdict, counting_bar, say, with_progress, write_file, write_whole};
use crate::study::record::{self, Heading, Record};
use crate::study::{Run, Stage, figures, summary};

/// Flies a study.
///
/// # Errors
/// Bad input, a scenario without `[study]`, a plan that is not feasible, files that cannot be written or belong to another
/// study.
pub fn run(args: &StudyArgs) -> Result<Verdict, Failure> {
    let scenario = load(&args.scenario)?;
    let Some(study) = &scenario.study else {
        return Err(Failure::Input(format!(
            "{} has no [study]: nothing says what varies\n  help: add [study] with sensor_position = 0.1, path_loss = \
             0.05 or wind = {{ deviation = 0.01 }}, in the scenario's units",
            scenario.file_name()
        )));
    };
    make(&args.out)?;
    let plan = plan(&scenario, args)?;
    let paper = planning::assess(&scenario, &plan, "the plan")?;
    if !paper.feasible {
        return Err(Failure::input("the plan is not feasible; `quietpath plan` tells what stands in the way"));
    }
    let mut planned = figures(&scenario, &paper);
    planned.flight_time = Some(plan.duration);
    let heading = Heading::of(&scenario, &plan, planned);
    let file = args
        .shard
        .map_or_else(|| "runs.jsonl".to_owned(), |Shard { index, count }| format!("runs-{index}-of-{count}.jsonl"));
    let (mut record, mut runs) = Record::open(&args.out.join(&file), &heading)?;
    write_whole(&args.out.join("plan.json"), plan.to_json().as_bytes())?;
    let mine =
        |run: &u64| args.shard.is_none_or(|Shard { index, count }| run % u64::from(count) == u64::from(index) - 1);
    runs.retain(|run, _| *run < args.runs && mine(run));
    let missing: Vec<u64> = (0..args.runs).filter(mine).filter(|run| !runs.contains_key(run)).collect();
    if !runs.is_empty() {
        say(Stream::Err, &format!("going on: {} runs are there, {} are to be flown\n", runs.len(), missing.len()))?;
    }
    let stage = Stage::new(&scenario, study, &plan).ok_or_else(|| Failure::input("the plan is no curve in time"))?;
    fly(&stage, &missing, &mut record, &mut runs)?;
    if args.shard.is_some() {
        let help = "quietpath merge --out MERGED DIR/runs-*.jsonl";
        say(
            Stream::Out,
            &format!("{} runs in {}\nwhen all shards are there: {help}\n", runs.len(), args.out.join(file).display()),
        )?;
        return Ok(Verdict::Done);
    }
    finish(&heading, &runs, &args.out)
}

/// Puts the runs of shards together.
///
/// # Errors
/// Files that cannot be read, or belong to different studies.
pub fn merge(args: &MergeArgs) -> Result<Verdict, Failure> {
    let mut all: Option<Heading> = None;
    let mut runs = BTreeMap::new();
    for file in &args.files {
        let (heading, found) = record::read(file)?;
        if let Some(first) = all.as_ref().filter(|first| **first != heading) {
            return Err(record::differs(file, &heading, first));
        }
        all = Some(heading);
        runs.extend(found);
    }
    let heading = all.ok_or_else(|| Failure::input("give at least one file"))?;
    make(&args.out)?;
    let mut lines = vec![serde_json::to_string(&heading).map_err(Failure::input)?];
    for run in runs.values() {
        lines.push(serde_json::to_string(run).map_err(Failure::input)?);
    }
    write_whole(&args.out.join("runs.jsonl"), (lines.join("\n") + "\n").as_bytes())?;
    let last = runs.keys().next_back().map_or(0, |last| last + 1);
    let lacking = last - runs.len() as u64;
    if lacking > 0 {
        say(Stream::Err, &format!("note: {lacking} of the runs below {last} are in none of the files\n"))?;
    }
    finish(&heading, &runs, &args.out)
}

fn make(folder: &Path) -> Result<(), Failure> {
    std::fs::create_dir_all(folder)
        .map_err(|cause| Failure::Input(format!("cannot make the folder {}: {cause}", folder.display())))
}

/// The plan that is flown: given, or made.
fn plan(scenario: &ScenarioFile, args: &StudyArgs) -> Result<PlanFile, Failure> {
    if let Some(path) = &args.plan {
        let plan = PlanFile::read(path)?;
        plan.fits(path, scenario)?;
        return Ok(plan);
    }
    let rollout = if args.once { Rollout::Once } else { Rollout::AsWritten };
    let options = Options { rollout, ..Options::default() };
    Ok(with_progress("planning", || planning::plan(scenario, &options))?.plan)
}

/// Flies runs on every core; each is on disk before the next figure of progress.
fn fly(
    stage: &Stage<'_>,
    missing: &[u64],
    record: &mut Record,
    runs: &mut BTreeMap<u64, Run>,
) -> Result<(), Failure> {
    let bar = counting_bar("flying", missing.len() as u64);
    let next = AtomicUsize::new(0);
    let cores = std::thread::available_parallelism().map_or(1, usize::from).min(missing.len().max(1));
    let (done, results) = mpsc::channel::<Result<Run, Box<FileError>>>();
    let outcome = std::thread::scope(|scope| {
        for _ in 0..cores {
            let (done, next) = (done.clone(), &next);
            scope.spawn(move || {
                while let Some(run) = missing.get(next.fetch_add(1, Ordering::Relaxed)) {
                    if done.send(stage.run(*run)).is_err() {
                        return;
                    }
                }
            });
        }
        drop(done);
        // Dropping the receiver on an error ends the workers.
        for result in results {
            let run = result?;
            record.put(&run)?;
            runs.insert(run.run, run);
            bar.inc(1);
        }
        Ok(())
    });
    bar.finish_and_clear();
    outcome
}

/// Writes and prints what the runs amount to.
fn finish(heading: &Heading, runs: &BTreeMap<u64, Run>, out: &Path) -> Result<Verdict, Failure> {
    let summary = summary::summarise(heading, runs);
    let picture = summary.picture();
    let json = serde_json::to_string_pretty(&summary).map_err(Failure::input)?;
    let files: [(&str, Vec<u8>); 3] = [
        ("summary.json", (json + "\n").into_bytes()),
        ("study.svg", picture.svg().as_bytes().to_vec()),
        ("study.png", picture.png().map_err(Failure::input)?),
    ];
    let mut text = summary.table();
    text.push_str("\nfiles\n");
    for (name, bytes) in files {
        let path: PathBuf = out.join(name);
        write_file(&path, &bytes)?;
        text.push_str(&format!("  {}\n", path.display()));
    }
    text.push_str(&format!("  {}\n", out.join("runs.jsonl").display()));
    say(Stream::Out, &text)?;
    Ok(Verdict::Done)
}
