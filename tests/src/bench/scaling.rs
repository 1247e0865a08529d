//! Time against nodes, sensors and agents, and how many points of a landscape a second.
//!
//! | symbol | name | unit | shape |
//! |---|---|---|---|
//! | p | exponent of time = c size^p | | |
//!
//! The scenarios are drawn like [`crate::instances`], but plain: detection and AEE, fixed TOA sensors, one size at a
//! time changed. A size's time is the median over `DRAWS` of them, of the whole plan and of one evaluation of the
//! objective: the number of evaluations depends on the problem, the cost of each on its size.

use std::fmt::Write as _;

use fastrand::Rng;
use quietpath_bridge::file::ScenarioFile;
use quietpath_bridge::planning::{View, landscape};
use quietpath_core::Metric;
use quietpath_sim::picture::chart::{Chart, Curve, draw};
use serde_json::json;

use super::figure::{median, power_law};
use super::peer::Peer;
use super::published::ours;
use super::{machine, page};
use crate::{repository, scenario, scenario_path};

/// Scenarios of each size.
const DRAWS: u64 = 5;
/// The sizes that stay while one changes.
const USUAL: Size = Size { nodes: 100, sensors: 8, agents: 1 };
/// Cells of the landscape along a side.
const CELLS: usize = 200;
/// Turns of each side in the comparison of landscapes.
const TURNS: usize = 5;

/// How large a scenario is.
#[derive(Clone, Copy)]
struct Size {
    nodes: usize,
    sensors: usize,
    agents: usize,
}

/// What changes, and through which sizes.
struct Sweep {
    name: &'static str,
    sizes: Vec<(f64, Size)>,
}

fn sweeps(is_short: bool) -> Vec<Sweep> {
    let every = if is_short { 2 } else { 1 };
    let sweep = |name, list: &[usize], size: fn(usize) -> Size| {
        let sizes = list.iter().step_by(every).map(|&count| (count as f64, size(count))).collect();
        Sweep { name, sizes }
    };
    vec![
        sweep("nodes", &[25, 50, 100, 200, 400], |nodes| Size { nodes, ..USUAL }),
        sweep("sensors", &[4, 8, 16, 32, 64, 128], |sensors| Size { sensors, ..USUAL }),
        sweep("agents", &[1, 2, 4, 8], |agents| Size { agents, ..USUAL }),
    ]
}

/// How much to measure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extent {
    /// Everything.
    Full,
    /// Every other size, one draw each, and the page is left alone: to see that it works.
    Short,
}

/// Measures, prints, draws the figures, and writes the sections.
///
/// # Errors
/// The page or a figure cannot be written.
pub fn run(extent: Extent) -> std::io::Result<()> {
    let opening = machine::described();
    let mut text = format!(
        "{opening} Median of {DRAWS} scenarios a size; the others are {} nodes, {} sensors, {} agent.\n\n\
         | against | exponent of a plan | exponent of an evaluation | sizes: ms a plan |\n|---|---:|---:|---|\n",
        USUAL.nodes, USUAL.sensors, USUAL.agents
    );
    let mut figures = String::new();
    for sweep in sweeps(extent == Extent::Short) {
        let (plans, evaluations) = measure(&sweep, if extent == Extent::Short { 1 } else { DRAWS });
        let (plan_law, evaluation_law) = (power_law(&plans), power_law(&evaluations));
        let sizes: Vec<String> = plans.iter().map(|[size, ms]| format!("{size}: {ms:.1}")).collect();
        let row = format!("| {} | {:.2} | {:.2} | {} |", sweep.name, plan_law.0, evaluation_law.0, sizes.join(", "));
        println!("{row}");
        let _ = writeln!(text, "{row}");
        let chart = Chart {
            title: format!("Planning time against {}", sweep.name),
            subtitle: "dashed: fitted power laws".into(),
            x: sweep.name.into(),
            y: "time (ms)".into(),
            curves: vec![
                Curve { words: "whole plan".into(), points: plans, law: Some(plan_law) },
                Curve { words: "one evaluation".into(), points: evaluations, law: Some(evaluation_law) },
            ],
        };
        let file = hang(&format!("scaling-{}", sweep.name), &chart, extent)?;
        let _ = write!(figures, "\n![Planning time against {}]({file})\n", sweep.name);
    }
    println!("\n{text}");
    let landscapes = landscapes(&opening);
    println!("{landscapes}");
    if extent == Extent::Full {
        page::write("Scaling", &format!("{text}{figures}"))?;
        page::write("Landscapes", &landscapes)?;
    }
    Ok(())
}

/// Writes a figure; returns its place as the page names it.
fn hang(name: &str, chart: &Chart, extent: Extent) -> std::io::Result<String> {
    let folder = if extent == Extent::Full { "docs/pictures" } else { "target/pictures" };
    let file = repository().join(folder).join(name).with_extension("svg");
    std::fs::create_dir_all(repository().join(folder))?;
    std::fs::write(&file, draw(chart).svg())?;
    println!("{}", file.display());
    Ok(format!("pictures/{name}.svg"))
}

/// Milliseconds of a plan and of an evaluation, by size.
fn measure(sweep: &Sweep, draws: u64) -> (Vec<[f64; 2]>, Vec<[f64; 2]>) {
    let (mut plans, mut evaluations) = (Vec::new(), Vec::new());
    for (count, size) in &sweep.sizes {
        let (mut whole, mut each) = (Vec::new(), Vec::new());
        for draw in 0..draws {
            match ours(&plain(*size, draw)) {
                Ok((planned, seconds)) => {
                    whole.push(1e3 * seconds);
                    each.push(1e3 * seconds / planned.evaluations.max(1) as f64);
                }
                Err(error) => println!("{} {count}: {}", sweep.name, error.lines().next().unwrap_or_default()),
            }
        }
        plans.push([*count, median(&whole)]);
        evaluations.push([*count, median(&each)]);
    }
    (plans, evaluations)
}

/// A plain scenario of a size: the first sensors and agents are the same in every size.
fn plain(size: Size, draw: u64) -> ScenarioFile {
    let mut text = format!(
        "name = \"plain\"\nsoftening = 0.05\n[frame]\nunit_m = 100.0\n[grid]\nintervals = {}\n[time]\nmax = 300.0\n\
         target = 115.0\npenalty = 1.0\n[domain]\nmin = [0.0, 0.0]\nmax = [10.0, 10.0]\n[[objective.term]]\n\
         metric = \"detection\"\n[[objective.term]]\nmetric = \"log_aee\"\nsense = \"max\"\nweight = 0.2\n",
        size.nodes - 1
    );
    for agent in 0..size.agents {
        let north = 0.5 + 9.0 * ((agent as f64 * 0.618).fract());
        let _ = writeln!(
            text,
            "[[agent]]\nstart = [0.5, {north:.3}]\ngoal = [9.5, {:.3}]\nspeed_max = 0.1\naccel_max = 0.02",
            10.0 - north
        );
    }
    let mut random = Rng::with_seed(draw);
    for _ in 0..size.sensors {
        let (east, north) = (10.0 * random.f64(), 10.0 * random.f64());
        let _ = writeln!(
            text,
            "[[sensor]]\nposition = [{east:.3}, {north:.3}]\n\
             ranging = {{ model = \"toa\", c1 = 0.01, c2 = 0.1, path_loss = 2.0 }}\n\
             detection = {{ model = \"proxy\", scale = 0.3, epsilon = 0.3, path_loss = 2.0 }}"
        );
    }
    let loaded = ScenarioFile::parse("plain", &text);
    loaded.unwrap_or_else(|error| panic!("{error}")).scenario
}

/// Points of a landscape a second, every metric at each, by ours and by NumPy.
fn landscapes(opening: &str) -> String {
    let mut text = format!(
        "{opening} Every metric at {CELLS} x {CELLS} points, one thread, median of {TURNS} interleaved turns.\n"
    );
    let mut numpy = match Peer::numpy() {
        Ok(peer) => {
            let _ = writeln!(text, "{}.", peer.versions);
            Some(peer)
        }
        Err(error) => {
            let _ = writeln!(text, "NumPy could not be had: {error}.");
            None
        }
    };
    text.push_str(
        "\n| scenario | sensors | points/s | NumPy, points/s | ratio | largest difference |\n|---|---:|---:|---:|---:|---:|\n",
    );
    for name in ["square8-detection", "square8-energy", "swarm4", "volume8-detection"] {
        let _ = writeln!(text, "{}", landscape_row(name, numpy.as_mut()));
    }
    text
}

fn landscape_row(name: &str, mut numpy: Option<&mut Peer>) -> String {
    let scenario = scenario(name);
    let view = View { metric: Metric::LogAee, time: 0.0, columns: CELLS, rows: CELLS, height: None };
    let request = json!({ "scenario": scenario_path(name), "columns": CELLS, "rows": CELLS, "metric": "log_aee" });
    let (mut own, mut other, mut difference) = (Vec::new(), Vec::new(), f64::NAN);
    for _ in 0..TURNS {
        let begin = std::time::Instant::now();
        let Ok(grid) = landscape(&scenario, &view) else { return format!("| {name} | has no AEE | | | | |") };
        own.push((CELLS * CELLS) as f64 / begin.elapsed().as_secs_f64());
        let Some(peer) = numpy.as_deref_mut() else { continue };
        if let Ok(answer) = peer.ask(&request) {
            other.push((CELLS * CELLS) as f64 / answer["seconds"].as_f64().unwrap_or(f64::NAN));
            let values = answer["values"].as_array().into_iter().flatten().filter_map(serde_json::Value::as_f64);
            difference = values.zip(&grid.values).map(|(a, b)| (a - b).abs() / b.abs().max(1.0)).fold(0.0, f64::max);
        }
    }
    let (own, other) = (median(&own), median(&other));
    format!(
        "| {name} | {} | {own:.3e} | {other:.3e} | {:.1} | {difference:.0e} |",
        scenario.sensors.len(),
        own / other
    )
}
