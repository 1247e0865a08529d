//! Every scenario of the program against the best known plan, and against the peers in the same run.
//!
//! A scenario's turns are interleaved: ours, then each peer, then ours again, so that what else the machine does
//! falls on all. Each peer is first tried in every variant it has; the fastest that ends in a feasible plan takes the
//! turns. Times are medians over the turns. The page is written after every scenario.
//!
//! Ours is timed three times a turn: the default plan, which looks everywhere; the peers' own job, one basin from the straight
//! line; and a warm replan, from the plan there is, once a sensor turned out to be elsewhere.

use std::fmt::Write as _;

use quietpath_bridge::file::ScenarioFile;
use quietpath_bridge::file::scenario::MotionEntry;
use quietpath_bridge::planning::{Memory, Options, Planned, Rollout, plan, renew};

use super::figure::{gap, median};
use super::peer::{Answer, Peer};
use super::{machine, page};
use crate::figures::{Reference, references};
use crate::starts;
use crate::{repository, scenario_path};

/// How far a sensor turns out to be from where it was thought, length units.
const ELSEWHERE: f64 = 0.1;
/// Seconds of a solve that is not repeated, nor tried in other variants.
const LONG: f64 = 5.0;

/// How to measure.
#[derive(Clone, Debug)]
pub struct Request {
    /// Turns of each solver.
    pub turns: usize,
    /// Part of the names of the scenarios to take; empty for all.
    pub only: String,
}

/// One solver's row.
struct Row {
    name: String,
    reference: Option<Reference>,
    ours: Result<(Planned, f64), String>,
    /// Seconds from the straight line, and the objective there.
    near: Option<(f64, f64)>,
    /// Seconds of a warm replan.
    warm: Option<f64>,
    /// In the order of the peers.
    peers: Vec<Result<Timed, String>>,
}

/// A peer's answer in its fastest variant.
struct Timed {
    variant: String,
    answer: Answer,
    seconds: f64,
}

/// Measures, prints, and writes the section.
///
/// # Errors
/// The page cannot be written.
pub fn run(request: &Request) -> std::io::Result<()> {
    let mut peers: Vec<(&str, Peer)> = Vec::new();
    let mut missing = Vec::new();
    for (name, peer) in [("IPOPT", Peer::ipopt()), ("OpEn", Peer::open())] {
        match peer {
            Ok(peer) => peers.push((name, peer)),
            Err(error) => {
                println!("without {name}: {error}");
                missing.push(name);
            }
        }
    }
    let opening = machine::described();
    let mut references = references();
    let mut rows = Vec::new();
    let mut names: Vec<String> = names().into_iter().filter(|name| name.contains(&request.only)).collect();
    // The largest last: where a peer takes for ever on it, the page has the rest.
    names.sort_by_key(|name| crate::scenario(name).agents.len());
    for name in names {
        let row = measure(&name, references.remove(&name), &mut peers, request.turns);
        println!("{}", line(&row));
        rows.push(row);
        let labels: Vec<(&str, String)> = peers.iter().map(|(name, peer)| (*name, peer.versions.clone())).collect();
        let body = section(&opening, &rows, &labels, &missing, request.turns);
        if request.only.is_empty() {
            page::write("Published scenarios", &body)?;
        }
    }
    Ok(())
}

/// Names of the scenarios that come with the program.
///
/// # Panics
/// The folder of the scenarios is not there.
#[must_use]
pub fn names() -> Vec<String> {
    let folder = repository().join("sim/scenarios");
    let files = std::fs::read_dir(&folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let stem = |file: std::fs::DirEntry| Some(file.path().file_stem()?.to_string_lossy().into_owned());
    let mut names: Vec<String> = files.flatten().filter_map(stem).collect();
    names.sort();
    names
}

/// The plan of a scenario with default settings, in one piece.
pub(super) fn ours(scenario: &ScenarioFile) -> Result<(Planned, f64), String> {
    let options = Options { rollout: Rollout::Once, ..Options::default() };
    let planned = plan(scenario, &options).map_err(|error| error.to_string())?;
    let seconds = planned.plan.timing.map_or(f64::NAN, |timing| timing.plan_seconds);
    Ok((planned, seconds))
}

/// One basin from the straight line, which is what the peers look for: seconds and objective.
fn near(scenario: &ScenarioFile, memory: &mut Memory) -> Option<(f64, f64)> {
    let planned = renew(scenario, &starts::straight(scenario), &Options::default(), memory).ok()?;
    planned.assessment.feasible.then_some(())?;
    Some((planned.plan.timing?.plan_seconds, planned.assessment.objective))
}

/// The scenario once the first sensor turned out to be a little elsewhere; `None` where there is none.
#[must_use]
pub fn moved(scenario: &ScenarioFile) -> Option<ScenarioFile> {
    let mut moved = scenario.clone();
    match &mut moved.sensors.first_mut()?.motion {
        MotionEntry::Fixed(place) => *place.first_mut()? += ELSEWHERE,
        MotionEntry::Track(knots) => {
            for knot in knots {
                *knot.position.first_mut()? += ELSEWHERE;
            }
        }
    }
    Some(moved)
}

/// Seconds of a replan from `planned` once the first sensor turned out to be elsewhere, a little. Memory is kept from turn to turn,
/// as it is in flight.
fn warm(scenario: &ScenarioFile, planned: &Planned, memory: &mut Memory) -> Option<f64> {
    let moved = moved(scenario)?;
    let again = renew(&moved, &planned.plan, &Options::default(), memory).ok()?;
    again.plan.timing.map(|timing| timing.plan_seconds)
}

fn measure(name: &str, reference: Option<Reference>, peers: &mut [(&str, Peer)], turns: usize) -> Row {
    let path = scenario_path(name);
    let scenario = crate::scenario(name);
    let mut best: Vec<Result<Timed, String>> = Vec::new();
    for (_, peer) in peers.iter_mut() {
        best.push(fastest(peer, &scenario, &path));
    }
    let mut times = vec![Vec::new(); peers.len()];
    let (mut own, mut ours_times) = (ours(&scenario), Vec::new());
    let mut memory = Memory::default();
    let (mut straight, mut near_times, mut warm_times) = (None, Vec::new(), Vec::new());
    for _ in 0..turns {
        own = ours(&scenario);
        straight = near(&scenario, &mut memory);
        near_times.extend(straight.map(|(seconds, _)| seconds));
        warm_times.extend(own.as_ref().ok().and_then(|(planned, _)| warm(&scenario, planned, &mut memory)));
        ours_times.extend(own.as_ref().map(|(_, seconds)| *seconds).ok());
        for (((_, peer), found), times) in peers.iter_mut().zip(&best).zip(&mut times) {
            if let Ok(found) = found
                && found.seconds <= LONG
            {
                let answer = peer.solve(&scenario, &path, &found.variant);
                times.extend(answer.map(|answer| answer.seconds).unwrap_or_default());
            }
        }
    }
    for (found, times) in best.iter_mut().zip(&times) {
        if let Ok(found) = found
            && !times.is_empty()
        {
            found.seconds = median(times);
        }
    }
    if let Ok((_, seconds)) = &mut own {
        *seconds = median(&ours_times);
    }
    let near = straight.map(|(_, objective)| (median(&near_times), objective));
    let warm = (!warm_times.is_empty()).then(|| median(&warm_times));
    Row { name: name.to_owned(), reference, ours: own, near, warm, peers: best }
}

/// The variant that takes least time, of those that end in a feasible plan where there are any. The first solve of a
/// variant warms it up.
fn fastest(peer: &mut Peer, scenario: &ScenarioFile, path: &std::path::Path) -> Result<Timed, String> {
    let mut all = Vec::new();
    for variant in peer.variants.clone() {
        let first = peer.solve(scenario, path, &variant)?;
        let is_long = median(&first.seconds) > LONG;
        let answer = if is_long { first } else { peer.solve(scenario, path, &variant)? };
        let seconds = median(&answer.seconds);
        all.push(Timed { variant, answer, seconds });
        if is_long {
            break;
        }
    }
    all.sort_by(|a, b| {
        (!a.answer.is_feasible, a.seconds)
            .partial_cmp(&(!b.answer.is_feasible, b.seconds))
            .expect("times are numbers")
    });
    all.into_iter().next().ok_or_else(|| "has no variants".into())
}

fn line(row: &Row) -> String {
    match &row.ours {
        Ok((planned, seconds)) => {
            let best = row.reference.as_ref().map_or(f64::NAN, |reference| reference.objective);
            let objective = planned.assessment.objective;
            let mut text = format!(
                "{:24} {objective:13.6} gap {:+9.2e} {:15} {:8.1} ms",
                row.name,
                gap(objective, best),
                planned.status.name(),
                1e3 * seconds
            );
            for timed in row.peers.iter().flatten() {
                let _ = write!(
                    text,
                    "  {} {:8.1} ms ({:.1}x)",
                    timed.variant,
                    1e3 * timed.seconds,
                    timed.seconds / seconds
                );
            }
            text
        }
        Err(error) => format!("{:24} {}", row.name, error.lines().next().unwrap_or_default()),
    }
}

fn section(opening: &str, rows: &[Row], peers: &[(&str, String)], missing: &[&str], turns: usize) -> String {
    let mut text = format!(
        "{opening} Median of {turns} turns, interleaved, one thread each. A peer that takes more than {LONG} s is asked \
         once, in its first variant.\n"
    );
    for (name, versions) in peers {
        let _ = writeln!(text, "{name}: {versions}.");
    }
    for name in missing {
        let _ = writeln!(text, "{name} could not be had, and is left out.");
    }
    text.push_str(
        "\nms: the default plan, which looks everywhere; from the straight line, in one basin; and again from the plan once the first \
         sensor turned out to be 0.1 units elsewhere.\n\n\
         | scenario | objective | best known | gap | status | iterations | feasible | ms | from the line, ms | again, ms |\n\
         |---|---:|---:|---:|---|---:|---|---:|---:|---:|\n",
    );
    for row in rows {
        let _ = writeln!(text, "{}", own_cells(row));
    }
    let gaps: Vec<f64> = rows.iter().filter_map(own_gap).collect();
    let below = gaps.iter().filter(|gap| **gap < 0.0).count();
    let _ = writeln!(
        text,
        "\nGap: median {:+.1e}, worst {:+.1e}; {below} of {} below zero, {} above 1e-3.",
        median(&gaps),
        gaps.iter().copied().fold(f64::NEG_INFINITY, f64::max),
        gaps.len(),
        gaps.iter().filter(|gap| **gap > 1e-3).count()
    );
    for (index, (name, _)) in peers.iter().enumerate() {
        text.push_str(&peer_table(rows, index, name));
    }
    text
}

fn own_gap(row: &Row) -> Option<f64> {
    let objective = row.ours.as_ref().ok()?.0.assessment.objective;
    Some(gap(objective, row.reference.as_ref()?.objective))
}

fn own_cells(row: &Row) -> String {
    let best =
        row.reference.as_ref().map_or_else(|| "none".into(), |reference| format!("{:.6}", reference.objective));
    let (planned, seconds) = match &row.ours {
        Ok(found) => found,
        Err(error) => {
            return format!(
                "| {} | | {best} | | {} | | no | | | |",
                row.name,
                error.lines().next().unwrap_or_default()
            );
        }
    };
    let gap = own_gap(row).map_or_else(String::new, |gap| format!("{gap:+.1e}"));
    let feasible = if planned.assessment.feasible { "yes" } else { "**no**" };
    format!(
        "| {} | {:.6} | {best} | {gap} | {} | {} | {feasible} | {:.1} | {} | {} |",
        row.name,
        planned.assessment.objective,
        planned.status.name(),
        planned.iterations,
        1e3 * seconds,
        row.near.map_or_else(String::new, |(seconds, _)| format!("{:.1}", 1e3 * seconds)),
        row.warm.map_or_else(String::new, |seconds| format!("{:.2}", 1e3 * seconds))
    )
}

fn peer_table(rows: &[Row], index: usize, name: &str) -> String {
    let mut text = format!(
        "\n### {name} from the straight line\nTime ratio: theirs over ours, so that large is good for us. Same job: the same \
         to ours from the straight line; again: the same to our replan. Gap: theirs to ours, so that positive is good for us.\nThe variant is the fastest; building the problem is not part of the time.\n\n\
         | scenario | variant | ms | ratio | same job | again | objective | gap | feasible | iterations | build ms | wins |\n\
         |---|---|---:|---:|---:|---:|---:|---:|---|---:|---:|---|\n"
    );
    let (mut ratios, mut same, mut again, mut wins) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for row in rows {
        let (Ok((planned, seconds)), Some(found)) = (&row.ours, row.peers.get(index)) else { continue };
        let timed = match found {
            Ok(timed) => timed,
            Err(error) => {
                let _ = writeln!(
                    text,
                    "| {} | {} | | | | | | | | | | |",
                    row.name,
                    error.lines().next().unwrap_or_default()
                );
                continue;
            }
        };
        let (ratio, answer) = (timed.seconds / seconds, &timed.answer);
        let behind = gap(answer.objective, planned.assessment.objective);
        let mut won = Vec::new();
        if answer.is_feasible && ratio < 1.0 {
            won.push("time");
        }
        // Less than the planners' own tolerances is no win.
        if answer.is_feasible && behind < -1e-5 {
            won.push("objective");
        }
        let near = row.near.map(|(near, _)| timed.seconds / near);
        let warm = row.warm.map(|warm| timed.seconds / warm);
        if answer.is_feasible {
            ratios.push(ratio);
            same.extend(near);
            again.extend(warm);
        }
        let cell = |ratio: Option<f64>| ratio.map_or_else(String::new, |ratio| format!("{ratio:.1}"));
        let _ = writeln!(
            text,
            "| {} | {} | {:.1} | {ratio:.1} | {} | {} | {:.6} | {behind:+.1e} | {} | {} | {:.0} | {} |",
            row.name,
            timed.variant,
            1e3 * timed.seconds,
            cell(near),
            cell(warm),
            answer.objective,
            if answer.is_feasible { "yes" } else { "no" },
            answer.iterations,
            1e3 * answer.build_seconds,
            won.join(", ")
        );
        if !won.is_empty() {
            wins.push(format!("{} ({})", row.name, won.join(", ")));
        }
    }
    let least = ratios.iter().copied().fold(f64::INFINITY, f64::min);
    let listed = if wins.is_empty() { "nowhere".into() } else { wins.join("; ") };
    let _ = writeln!(
        text,
        "\nRatio where {name}'s plan is feasible: median {:.1}, least {least:.1}; same job: median {:.1}; again: median {:.1}. \
         {name} wins: {listed}.",
        median(&ratios),
        median(&same),
        median(&again)
    );
    text
}
