//! Sweeps as pictures: the trade-off curves, all paths over the landscape, and the metrics along all paths.

use quietpath_bridge::file::plan::AgentPlan;
use quietpath_bridge::planning;
use quietpath_core::scenario::Metric;

use super::Over;
use super::sweep::{Point, Swept};
use crate::illustrate::{self, capitalised};
use crate::picture::curves::{self, Curve, Diagram, Dots, Key, Sheet};
use crate::picture::scale::Kind;
use crate::picture::series::time_unit;
use crate::picture::{DrawError, Picture, colour};
use crate::units::Presentation;

/// Dash pattern of every agent but the first.
const OTHER_AGENTS: &str = "9 5";
/// Dash pattern of jamming levels.
const JAMMING: &str = "5 4";
/// How much wider than usual the first of many lines may be.
const WIDENING_MAX: f64 = 12.0;
/// Jamming below this level is not drawn.
const FAINTEST: f64 = 1e-3;

/// The pictures of a sweep.
#[derive(Clone, Debug)]
pub struct Drawn {
    /// What was swept against what it buys.
    pub trade: Picture,
    /// All paths over the landscape.
    pub paths: Picture,
    /// Metrics along all paths over time.
    pub along: Picture,
}

/// Draws the pictures; `metrics` in the order of the diagrams, `field` behind the paths.
///
/// # Errors
/// Where a picture cannot be encoded.
pub fn draw(swept: &Swept, metrics: &[Metric], field: &planning::Grid) -> Result<Drawn, DrawError> {
    Ok(Drawn { trade: trade(swept, metrics), paths: paths(swept, field)?, along: along(swept, metrics) })
}

/// The colour of each point, by its value.
fn inks(swept: &Swept) -> Vec<String> {
    let values = swept.points.iter().map(|point| point.case.seconds);
    let (low, high) = values.clone().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), it| (a.min(it), b.max(it)));
    values.map(|value| colour::swept(if high > low { (value - low) / (high - low) } else { 1.0 })).collect()
}

fn headings(swept: &Swept, what: &str) -> [String; 2] {
    let name = swept.points.first().map_or("", |point| point.case.scenario.name.as_str());
    let title = format!("{name}: {what} by {}", swept.over.words());
    let bad = swept.points.iter().filter(|point| !point.planned.assessment.feasible).count();
    let missing = if bad > 0 { format!(", {bad} of them without a feasible plan") } else { String::new() };
    (title, format!("{} plans{missing}; percentages are of {}", swept.points.len(), swept.over.whole())).into()
}

fn agents(swept: &Swept) -> Vec<&str> {
    let first = swept.points.first();
    first.map(|point| point.planned.plan.agents.iter().map(|agent| agent.name.as_str()).collect()).unwrap_or_default()
}

fn presentation(swept: &Swept, metric: Metric) -> Presentation {
    let (dimension, unit_m) = swept
        .points
        .first()
        .map_or((2, 1.0), |point| (point.case.scenario.dimension, point.case.scenario.frame.unit_m));
    Presentation::of(metric, dimension, unit_m)
}

/// Name and unit of a metric over its diagram.
fn heading(presentation: &Presentation) -> String {
    let label = presentation.label();
    if label.starts_with("ln ") { label } else { capitalised(&label) }
}

fn trade(swept: &Swept, metrics: &[Metric]) -> Picture {
    let scale = if swept.over == Over::Deadline { 100.0 } else { 1.0 };
    let at = |point: &Point| match swept.over {
        Over::Deadline => scale * point.case.share,
        Over::JamBudget | Over::DropoutBudget => point.case.seconds,
    };
    let curve = |colour: &str, figure: &dyn Fn(&Point) -> f64| {
        let value = |point: &Point| if point.planned.assessment.feasible { figure(point) } else { f64::NAN };
        let points = swept.points.iter().map(|point| [at(point), value(point)]).collect();
        Curve { colour: colour.to_owned(), dash: "", dots: Dots::Shown, points, silence: Vec::new() }
    };
    let diagram = |title: String, kind, curves| Diagram { title, kind, curves };
    let ink = "#333333";
    let mut diagrams = vec![
        diagram("Objective".into(), Kind::Signed, vec![curve(ink, &|point| point.planned.assessment.objective)]),
        diagram("Flight time (s)".into(), Kind::Signed, vec![curve(ink, &|point| point.planned.plan.duration)]),
    ];
    let agents = agents(swept);
    for metric in metrics {
        let presentation = presentation(swept, *metric);
        let worst = if *metric == Metric::Detection { "Peak" } else { "Smallest" };
        for (word, which) in [("Mean", 0), (worst, 1)] {
            let figure = |agent: usize, point: &Point| {
                let all = point.figures(&[*metric]);
                let found = all.get(agent).and_then(|agent| agent.metrics.first());
                found
                    .map_or(f64::NAN, |found| presentation.convert(if which == 0 { found.mean } else { found.worst }))
            };
            let curves =
                (0..agents.len()).map(|agent| curve(colour::agent(agent), &|point| figure(agent, point))).collect();
            diagrams.push(diagram(format!("{word} {}", presentation.label()), Kind::Signed, curves));
        }
    }
    let label = match swept.over {
        Over::Deadline => "deadline (% of the shortest flight time)".to_owned(),
        over => format!("{} (s)", over.words()),
    };
    let keys = agents.iter().enumerate().map(|(index, name)| Key {
        colour: colour::agent(index).to_owned(),
        dash: "",
        words: (*name).to_owned(),
    });
    let ends = [swept.points.first(), swept.points.last()].map(|point| point.map_or(0.0, at));
    let room = 0.03 * (ends[1] - ends[0]).max(1e-9);
    let [title, subtitle] = headings(swept, "trade-off");
    let sheet = Sheet {
        title,
        subtitle,
        label,
        x: [ends[0] - room, ends[1] + room],
        keys: if agents.len() > 1 { keys.collect() } else { Vec::new() },
        diagrams,
        columns: 2,
        height: 170.0,
    };
    curves::draw(&sheet)
}

fn paths(swept: &Swept, field: &planning::Grid) -> Result<Picture, DrawError> {
    let Some(scenario) = swept.points.first().map(|point| &point.case.scenario) else {
        return Err(DrawError::nothing());
    };
    let mut flights = Vec::new();
    let count = swept.points.len();
    for (number, (point, ink)) in swept.points.iter().zip(inks(swept)).enumerate() {
        for (index, agent) in point.planned.plan.agents.iter().enumerate() {
            let name = if index == 0 { point.case.label(swept.over) } else { String::new() };
            let mut flight = illustrate::flight(scenario, agent, &name, &ink);
            // Earlier lines are wider, so that they show below later ones on the same way.
            flight.width += (WIDENING_MAX / count as f64).min(3.0) * (count - 1 - number) as f64;
            if index > 0 {
                flight.dash = OTHER_AGENTS;
            }
            flights.push(flight);
        }
    }
    let [title, subtitle] = headings(swept, "paths");
    let behind = presentation(swept, field.metric).name;
    let dashed = if agents(swept).len() > 1 { ", all agents but the first dashed" } else { "" };
    illustrate::overlay(scenario, field, [title, format!("over the {behind}; {subtitle}{dashed}")], flights)
}

fn along(swept: &Swept, metrics: &[Metric]) -> Picture {
    let latest = swept.points.iter().map(|point| point.planned.plan.duration).fold(0.0, f64::max);
    let begin = swept.points.first().map_or(0.0, |point| point.case.scenario.start_time);
    let (unit, second) = time_unit(latest);
    let inks = inks(swept);
    let names = agents(swept);
    let each = || {
        swept.points.iter().zip(&inks).flat_map(|(point, ink)| {
            point.planned.plan.agents.iter().enumerate().map(move |(index, agent)| (point, ink, index, agent))
        })
    };
    let times = |point: &Point| point.planned.assessment.times.iter().map(|time| time / second).collect::<Vec<_>>();
    let mut diagrams = Vec::new();
    for metric in metrics {
        let presentation = presentation(swept, *metric);
        let curves = each().filter_map(|(point, ink, index, agent)| {
            let values = point.planned.assessment.agents.get(index)?.metric(*metric)?;
            let points = times(point).into_iter().zip(values).map(|(time, it)| [time, presentation.convert(*it)]);
            let dash = if index > 0 { OTHER_AGENTS } else { "" };
            let silence = agent.dropout.clone().unwrap_or_default();
            Some(Curve { colour: ink.clone(), dash, dots: Dots::Hidden, points: points.collect(), silence })
        });
        let curves: Vec<Curve> = curves.collect();
        diagrams.push(Diagram { title: heading(&presentation), kind: presentation.kind, curves });
    }
    let jams = |agent: &AgentPlan| agent.jam.iter().flatten().skip(1).any(|level| *level > FAINTEST);
    let jamming: Vec<Curve> = each()
        .filter(|(_, _, _, agent)| jams(agent))
        .map(|(point, ink, _, agent)| {
            let levels = agent.jam.iter().flatten();
            let points = times(point).into_iter().zip(levels).skip(1).map(|(time, level)| [time, *level]).collect();
            Curve { colour: ink.clone(), dash: JAMMING, dots: Dots::Hidden, points, silence: Vec::new() }
        })
        .collect();
    if !jamming.is_empty() {
        diagrams.push(Diagram { title: "Jamming level".into(), kind: Kind::Magnitude, curves: jamming });
    }
    let key =
        |(point, ink): (&Point, &String)| Key { colour: ink.clone(), dash: "", words: point.case.label(swept.over) };
    let mut keys: Vec<Key> = swept.points.iter().zip(&inks).map(key).collect();
    for (index, name) in names.iter().enumerate().filter(|_| names.len() > 1) {
        let dash = if index > 0 { OTHER_AGENTS } else { "" };
        keys.push(Key { colour: "#555555".into(), dash, words: (*name).to_owned() });
    }
    let [title, subtitle] = headings(swept, "along the flight");
    curves::draw(&Sheet {
        title,
        subtitle,
        label: format!("time ({unit})"),
        x: [begin / second, (begin + latest) / second],
        keys,
        diagrams,
        columns: 1,
        height: 240.0,
    })
}
