//! The figures of the page, in the units that are printed on it.
//!
//! | part | what |
//! |---|---|
//! | `map` | unit and extent of the area; sensors with their tracks, regions, landscapes |
//! | `paths` | what is planned, as it was planned at each step, and what was flown |
//! | `panels` | every figure along the flight |
//! | `figures`, `margins`, `wire`, `provenance` | tables |
//!
//! Positions are in the map's unit, times in seconds; metrics in metres.

use quietpath_bridge::file::scenario::{MotionEntry, RegionEntry, SensorEntry};
use quietpath_bridge::file::{FileError, PlanFile, ScenarioFile};
use quietpath_bridge::planning::Assessment;
use quietpath_core::Metric;
use quietpath_core::constraints::TOLERANCE;
use quietpath_core::scenario::Side;
use serde::Serialize;
use sha2::{Digest as _, Sha256};

use super::field::{self, Fields};
use crate::illustrate::{self, Flown, map_unit};
use crate::margins::{self, Margin, Sense};
use crate::picture::colour;
use crate::picture::scale::{Kind, Spacing, trimmed};
use crate::picture::series::{Panel, time_unit, value_scale};
use crate::report;
use crate::units;

/// Corners that a circle is drawn with.
const CORNERS: u32 = 90;
/// Colours of a landscape.
const COLOURS: u32 = 256;

/// A plan and all that is known of how it came about and was flown.
#[derive(Clone, Debug)]
pub struct Story<'a> {
    /// The plan; what was flown of each step, where it was made in steps; or the way that a vehicle took.
    pub plan: &'a PlanFile,
    /// Which of these.
    pub way: Way,
    /// Its figures.
    pub assessment: &'a Assessment,
    /// The plan of each step, in order; none where it was made in one piece.
    pub steps: &'a [PlanFile],
    /// What went over the wire; none where nothing did.
    pub wire: &'a [Message],
    /// The landscape that shows first.
    pub background: Metric,
    /// How it was made: names and values.
    pub settings: &'a [(String, String)],
}

/// Whether a way is on paper, or a vehicle took it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// Planned.
    Planned,
    /// Flown.
    Flown,
}

/// Something that went over the wire.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Message {
    /// When, s of the scenario.
    pub time: f64,
    /// From whom to whom.
    pub way: String,
    /// Its name.
    pub name: String,
    /// What it says.
    pub content: String,
}

/// Everything on the page.
#[derive(Debug, Serialize)]
pub struct Data {
    title: String,
    subtitle: String,
    /// Whether the heading is a warning.
    alarming: bool,
    /// The landscape that shows first.
    background: &'static str,
    /// First and last instant, s.
    time: [f64; 2],
    /// Unit of time on axes, and its seconds.
    clock: (&'static str, f64),
    map: Map,
    fields: Fields,
    agents: Vec<Agent>,
    paths: Vec<Path>,
    panels: Vec<Diagram>,
    figures: Vec<Row>,
    margins: Vec<Room>,
    violations: Vec<Row>,
    wire: Vec<Message>,
    provenance: Vec<Row>,
    scenario: String,
}

/// A name and its value.
type Row = (String, String);

#[derive(Debug, Serialize)]
struct Map {
    unit: &'static str,
    x: [f64; 2],
    y: [f64; 2],
    sensors: Vec<Sensor>,
    regions: Vec<Region>,
    colours: Vec<String>,
}

#[derive(Debug, Serialize)]
struct Sensor {
    name: String,
    detects: bool,
    ranges: bool,
    times: Vec<f64>,
    x: Vec<f64>,
    y: Vec<f64>,
}

#[derive(Debug, Serialize)]
struct Region {
    name: String,
    inside: bool,
    ring: Vec<[f64; 2]>,
    from: Option<f64>,
    until: Option<f64>,
}

#[derive(Debug, Serialize)]
struct Agent {
    name: String,
    colour: &'static str,
}

/// A way on the map.
#[derive(Debug, Serialize)]
struct Path {
    /// `plan`, `step` or `flown`.
    kind: &'static str,
    agent: usize,
    times: Vec<f64>,
    x: Vec<f64>,
    y: Vec<f64>,
    jam: Vec<f64>,
    dropout: Vec<f64>,
}

/// A diagram over time.
#[derive(Debug, Serialize)]
struct Diagram {
    title: String,
    unit: String,
    log: bool,
    low: f64,
    high: f64,
    /// Whether values are percentages of certainty.
    probability: bool,
    lines: Vec<Line>,
    bounds: Vec<(f64, String)>,
}

#[derive(Debug, Serialize)]
struct Line {
    agent: usize,
    times: Vec<f64>,
    values: Vec<Option<f64>>,
}

/// A constraint and its margin, ready to be printed.
#[derive(Debug, Serialize)]
struct Room {
    constraint: &'static str,
    about: String,
    found: String,
    bound: String,
    room: String,
    kept: bool,
}

/// Gathers what the page shows.
///
/// # Errors
/// As [`quietpath_bridge::planning::landscapes`].
pub fn gather(scenario: &ScenarioFile, story: &Story<'_>) -> Result<Data, Box<FileError>> {
    let plan = story.plan;
    let times = plan.node_times();
    let first = times.first().copied().unwrap_or(scenario.start_time);
    let time = [first, times.last().copied().unwrap_or(first + 1.0)];
    let scale = map_unit(scenario).1;
    let flown = Flown { plan, assessment: story.assessment, steps: &[] };
    let panels = illustrate::panels(scenario, flown, 1.0);
    let agents = scenario.agents.iter().enumerate();
    let found = margins::margins(scenario, plan, story.assessment);
    Ok(Data {
        title: scenario.name.clone(),
        subtitle: illustrate::flight_words(scenario, plan),
        alarming: story.way == Way::Planned && !story.assessment.feasible,
        background: story.background.name(),
        time,
        clock: time_unit(time[1] - time[0]),
        map: map(scenario),
        fields: field::fields(scenario, time)?,
        agents: agents
            .map(|(index, agent)| Agent { name: agent.name.clone(), colour: colour::agent(index) })
            .collect(),
        paths: paths(story, scale),
        panels: panels.iter().map(diagram).collect(),
        figures: figures(scenario, story),
        margins: found.iter().map(|margin| room(margin, story.assessment)).collect(),
        violations: violations(story.assessment),
        wire: story.wire.to_vec(),
        provenance: provenance(scenario, story),
        scenario: scenario.text().to_owned(),
    })
}

fn map(scenario: &ScenarioFile) -> Map {
    let (unit, scale) = map_unit(scenario);
    let side = |axis: usize| {
        let edge = |bounds: &[f64]| bounds.get(axis).copied().unwrap_or_default() * scale;
        [edge(&scenario.domain.min), edge(&scenario.domain.max)]
    };
    let share = |index| f64::from(index) / f64::from(COLOURS - 1);
    Map {
        unit,
        x: side(0),
        y: side(1),
        sensors: scenario.sensors.iter().map(|entry| sensor(entry, scale)).collect(),
        regions: scenario.regions.iter().map(|entry| region(entry, scale)).collect(),
        colours: (0..COLOURS).map(|index| colour::css(share(index))).collect(),
    }
}

fn sensor(entry: &SensorEntry, scale: f64) -> Sensor {
    let (times, places): (Vec<f64>, Vec<&[f64]>) = match &entry.motion {
        MotionEntry::Fixed(position) => (vec![0.0], vec![position]),
        MotionEntry::Track(knots) => knots.iter().map(|knot| (knot.time, knot.position.as_slice())).unzip(),
    };
    let (x, y) = (along(&places, 0, scale), along(&places, 1, scale));
    let (detects, ranges) = (entry.detection.is_some(), entry.ranging.is_some());
    Sensor { name: entry.name.clone(), detects, ranges, times, x, y }
}

/// One coordinate of every place.
fn along(places: &[&[f64]], axis: usize, scale: f64) -> Vec<f64> {
    places.iter().map(|place| place.get(axis).copied().unwrap_or_default() * scale).collect()
}

fn region(entry: &RegionEntry, scale: f64) -> Region {
    let finite = |time: f64| time.is_finite().then_some(time);
    Region {
        name: entry.name.clone(),
        inside: entry.side == Side::Inside,
        ring: entry.outline.ring(CORNERS).iter().map(|corner| corner.map(|part| part * scale)).collect(),
        from: finite(entry.window.from),
        until: finite(entry.window.until),
    }
}

fn paths(story: &Story<'_>, scale: f64) -> Vec<Path> {
    let of_plan = |kind: &'static str, plan: &PlanFile| -> Vec<Path> {
        let times = plan.node_times();
        let way = |(index, agent): (usize, &quietpath_bridge::file::plan::AgentPlan)| {
            let places: Vec<&[f64]> = agent.path.iter().map(Vec::as_slice).collect();
            let (x, y) = (along(&places, 0, scale), along(&places, 1, scale));
            let (jam, dropout) = (agent.jam.clone().unwrap_or_default(), agent.dropout.clone().unwrap_or_default());
            Path { kind, agent: index, times: times.clone(), x, y, jam, dropout }
        };
        plan.agents.iter().enumerate().map(way).collect()
    };
    let mut paths: Vec<Path> = story.steps.iter().flat_map(|plan| of_plan("step", plan)).collect();
    let kind = match story.way {
        Way::Planned => "plan",
        Way::Flown => "flown",
    };
    paths.extend(of_plan(kind, story.plan));
    paths
}

fn diagram(panel: &Panel) -> Diagram {
    let scale = value_scale(panel);
    let line = |line: &crate::picture::series::Line| Line {
        agent: line.agent,
        times: line.points.iter().map(|point| point[0]).collect(),
        values: line.points.iter().map(|point| point[1].is_finite().then_some(point[1])).collect(),
    };
    Diagram {
        title: panel.title.clone(),
        unit: panel.unit.clone(),
        log: scale.spacing == Spacing::Log,
        low: scale.min,
        high: scale.max,
        probability: panel.kind == Kind::Probability,
        lines: panel.lines.iter().map(line).collect(),
        bounds: panel.bounds.iter().map(|bound| (bound.value, bound.words.clone())).collect(),
    }
}

fn figures(scenario: &ScenarioFile, story: &Story<'_>) -> Vec<Row> {
    let assessment = story.assessment;
    let row = |name: &str, value: String| (name.to_owned(), value);
    let status = story.plan.status.as_deref().unwrap_or("unknown").replace('_', " ");
    let verdict = if assessment.feasible { "feasible" } else { "not feasible" };
    let verdict = match story.way {
        Way::Planned => format!("{verdict} ({status})"),
        Way::Flown => report::kept(assessment),
    };
    let mut rows = vec![
        row("verdict", verdict),
        row("objective", report::trimmed_to(assessment.objective, 9)),
        row("flight time", units::duration(story.plan.duration)),
    ];
    if let Some(timing) = story.plan.timing {
        rows.push(row("planning time", report::span(timing.plan_seconds)));
    }
    for agent in &assessment.agents {
        let name = |label: &str| {
            if assessment.agents.len() > 1 { format!("{}: {label}", agent.name) } else { label.to_owned() }
        };
        rows.extend(
            report::agent_rows(scenario, assessment, agent).into_iter().map(|(label, value)| (name(label), value)),
        );
    }
    rows
}

/// A margin as text. The core decides what is kept: rounding may leave a figure a hair beyond its bound.
fn room(margin: &Margin, assessment: &Assessment) -> Room {
    let with_unit = |value: f64| format!("{} {}", trimmed(value), margin.unit).trim_end().to_owned();
    let word = match margin.sense {
        Sense::AtMost => "at most",
        Sense::AtLeast => "at least",
    };
    let violation = assessment.violations.iter().find(|(name, _)| *name == margin.constraint);
    let broken = margin.room() < 0.0 && violation.is_some_and(|(_, size)| *size > TOLERANCE);
    // What the core lets pass is shown as nothing left, not as a debt of 1e-15.
    let left = if broken { margin.room() } else { margin.room().max(0.0) };
    Room {
        constraint: margin.constraint,
        about: margin.about.clone(),
        found: with_unit(margin.found),
        bound: format!("{word} {}", with_unit(margin.bound)),
        room: with_unit(left),
        kept: !broken,
    }
}

/// The core's own verdict on every constraint, relative to its scale.
fn violations(assessment: &Assessment) -> Vec<Row> {
    let shown = |size: f64| if size == 0.0 { "0".to_owned() } else { format!("{size:.1e}") };
    assessment.violations.iter().map(|(name, size)| ((*name).to_owned(), shown(*size))).collect()
}

fn provenance(scenario: &ScenarioFile, story: &Story<'_>) -> Vec<Row> {
    let row = |name: &str, value: String| (name.to_owned(), value);
    let hash: String = Sha256::digest(scenario.text()).iter().map(|byte| format!("{byte:02x}")).collect();
    let mut rows = vec![
        row("program", format!("quietpath {}", env!("CARGO_PKG_VERSION"))),
        row("scenario file", scenario.file_name().to_owned()),
        row("scenario SHA-256", hash),
        row("intervals", story.plan.nodes().saturating_sub(1).to_string()),
    ];
    rows.extend(story.settings.iter().cloned());
    rows
}
