//! From scenarios and plans to pictures: what is shown, in which unit, under which title.

pub mod steps;

use quietpath_bridge::file::plan::AgentPlan;
use quietpath_bridge::file::scenario::{MotionEntry, SensorEntry};
use quietpath_bridge::file::{PlanFile, ScenarioFile};
use quietpath_bridge::planning::{self, Assessment, Step};
use quietpath_core::scenario::{BeamPattern, Limit, Metric};

use crate::picture::landscape::{Ends, Flight, Region, Scene, Sensor};
use crate::picture::scale::{Kind, trimmed};
use crate::picture::series::{Bound, Line, Panel, Sheet, time_unit};
use crate::picture::{DrawError, Grid, Picture, colour, landscape, series};
use crate::units::{self, Presentation};

/// Metrics with a diagram of their own; CEP squared and the logarithms are functions of these.
const DIAGRAMS: [Metric; 5] = [Metric::Detection, Metric::FalseAlarm, Metric::Cep, Metric::Aee, Metric::Gdop];

/// Corners that a circle is drawn with: within a tenth of a pixel of it on the largest map.
const CORNERS: u32 = 180;

/// A plan and what it amounts to.
#[derive(Clone, Copy, Debug)]
pub struct Flown<'a> {
    /// The plan.
    pub plan: &'a PlanFile,
    /// Its figures.
    pub assessment: &'a Assessment,
    /// The steps that it was flown in; none where it was planned in one piece.
    pub steps: &'a [Step],
}

/// Draws a metric over the area at an instant, with the flights of a plan where there is one.
///
/// # Errors
/// Where the picture cannot be encoded.
pub fn landscape(
    scenario: &ScenarioFile,
    field: &planning::Grid,
    plan: Option<&PlanFile>,
) -> Result<Picture, DrawError> {
    let presentation = Presentation::of(field.metric, scenario.dimension, scenario.frame.unit_m);
    let title = format!("{}: {}", scenario.name, presentation.name);
    let heading = [title, landscape_subtitle(scenario, field, plan)];
    let agents = plan.iter().flat_map(|plan| &plan.agents).enumerate();
    let flights = agents.map(|(index, agent)| flight(scenario, agent, &agent.name, colour::agent(index))).collect();
    overlay(scenario, field, heading, flights)
}

/// Unit of a map's axes, and how many of it a length unit of the scenario is.
#[must_use]
pub fn map_unit(scenario: &ScenarioFile) -> (&'static str, f64) {
    let side = |axis: usize| {
        let edge = |bounds: &[f64]| bounds.get(axis).copied().unwrap_or_default();
        edge(&scenario.domain.max) - edge(&scenario.domain.min)
    };
    let (unit, size) = units::axis_unit(side(0).max(side(1)) * scenario.frame.unit_m);
    (unit, scenario.frame.unit_m / size)
}

/// Draws flights, in the unit of [`map_unit`], over a metric at an instant.
///
/// # Errors
/// Where the picture cannot be encoded.
pub fn overlay(
    scenario: &ScenarioFile,
    field: &planning::Grid,
    [title, subtitle]: [String; 2],
    flights: Vec<Flight>,
) -> Result<Picture, DrawError> {
    let presentation = Presentation::of(field.metric, scenario.dimension, scenario.frame.unit_m);
    let side = |axis: usize| {
        let edge = |bounds: &[f64]| bounds.get(axis).copied().unwrap_or_default();
        [edge(&scenario.domain.min), edge(&scenario.domain.max)]
    };
    let (x, y) = (side(0), side(1));
    let (unit, scale) = map_unit(scenario);
    let grid = Grid {
        columns: field.east.len(),
        rows: field.north.len(),
        x: x.map(|edge| edge * scale),
        y: y.map(|edge| edge * scale),
        values: field.values.iter().map(|value| presentation.convert(*value)).collect(),
    };
    let regions = scenario.regions.iter().map(|region| Region {
        name: region.name.clone(),
        ring: region.outline.ring(CORNERS).iter().map(|corner| corner.map(|x| x * scale)).collect(),
        side: region.side,
    });
    landscape::draw(&Scene {
        title,
        subtitle,
        unit,
        grid,
        kind: presentation.kind,
        metric: presentation.label(),
        sensors: scenario.sensors.iter().map(|sensor| sensor_mark(sensor, field.time, scale)).collect(),
        regions: regions.collect(),
        flights,
    })
}

fn landscape_subtitle(scenario: &ScenarioFile, field: &planning::Grid, plan: Option<&PlanFile>) -> String {
    let mut parts = Vec::new();
    if let Some(plan) = plan {
        parts.push(flight_words(scenario, plan));
    }
    let moves = |sensor: &SensorEntry| matches!(sensor.motion, MotionEntry::Track(_));
    if scenario.sensors.iter().any(moves) {
        parts.push(format!("moving sensors at {} s", trimmed(field.time)));
    }
    if let Some(height) = field.height {
        parts.push(format!("at height {}", units::length(height * scenario.frame.unit_m)));
    }
    if parts.is_empty() { format!("{} sensors", scenario.sensors.len()) } else { parts.join(", ") }
}

/// Duration, length and objective of a plan in a few words.
#[must_use]
pub fn flight_words(scenario: &ScenarioFile, plan: &PlanFile) -> String {
    let metres: f64 = plan.agents.iter().map(|agent| path_length(&agent.path)).sum::<f64>() * scenario.frame.unit_m;
    let objective = plan.objective.map(|value| format!(", objective {}", trimmed(value))).unwrap_or_default();
    let status = plan.status.as_ref().map(|status| format!(" ({})", status.replace('_', " "))).unwrap_or_default();
    let who = if plan.agents.len() > 1 { format!("{} flights", plan.agents.len()) } else { "flight".into() };
    format!("{who} of {} over {}{objective}{status}", units::duration(plan.duration), units::length(metres))
}

/// Length of a path, in its own units.
#[must_use]
pub fn path_length(path: &[Vec<f64>]) -> f64 {
    let leg = |(a, b): (&Vec<f64>, &Vec<f64>)| {
        a.iter().zip(b).map(|(from, to)| (to - from) * (to - from)).sum::<f64>().sqrt()
    };
    path.iter().zip(path.iter().skip(1)).map(leg).sum()
}

fn flat(position: &[f64], scale: f64) -> [f64; 2] {
    let at = |axis| position.get(axis).copied().unwrap_or(0.0) * scale;
    [at(0), at(1)]
}

fn sensor_mark(sensor: &SensorEntry, time: f64, scale: f64) -> Sensor {
    let name = sensor.name.clone();
    match &sensor.motion {
        MotionEntry::Fixed(position) => Sensor { name, position: flat(position, scale), track: Vec::new() },
        MotionEntry::Track(knots) => {
            let track: Vec<[f64; 2]> = knots.iter().map(|knot| flat(&knot.position, scale)).collect();
            let next = knots.partition_point(|knot| knot.time <= time);
            let before = next.checked_sub(1).and_then(|index| knots.get(index).zip(track.get(index)));
            let position = match (before, knots.get(next).zip(track.get(next))) {
                (Some((a, from)), Some((b, to))) => {
                    let share = (time - a.time) / (b.time - a.time);
                    [from[0] + share * (to[0] - from[0]), from[1] + share * (to[1] - from[1])]
                }
                (Some((_, only)), None) | (None, Some((_, only))) => *only,
                (None, None) => [0.0, 0.0],
            };
            Sensor { name, position, track }
        }
    }
}

/// One agent's part of a plan, in the unit of [`map_unit`].
#[must_use]
pub fn flight(scenario: &ScenarioFile, agent: &AgentPlan, name: &str, colour: &str) -> Flight {
    let scale = map_unit(scenario).1;
    let entry = scenario.agents.iter().find(|entry| entry.name == agent.name);
    let is_directed = entry.and_then(|it| it.jammer).is_some_and(|it| it.pattern != BeamPattern::Isotropic);
    Flight {
        name: name.to_owned(),
        colour: colour.to_owned(),
        dash: "",
        width: landscape::LINE,
        ends: Ends::Both,
        points: agent.path.iter().map(|position| flat(position, scale)).collect(),
        jam: agent.jam.clone().unwrap_or_default(),
        azimuth: agent.azimuth.clone().filter(|_| is_directed).unwrap_or_default(),
        dropout: agent.dropout.clone().unwrap_or_default(),
    }
}

/// Draws every figure along the flight.
#[must_use]
pub fn series(scenario: &ScenarioFile, flown: Flown<'_>) -> Picture {
    let Flown { plan, steps, .. } = flown;
    let (time_unit, second) = time_unit(plan.duration);
    let times = plan.node_times();
    let edge = |time: Option<&f64>| time.map(|time| time / second);
    series::draw(&Sheet {
        title: format!("{}: along the flight", scenario.name),
        subtitle: flight_words(scenario, plan),
        time_unit,
        time: [edge(times.first()).unwrap_or(0.0), edge(times.last()).unwrap_or(1.0)],
        agents: scenario.agents.iter().map(|agent| agent.name.clone()).collect(),
        steps: steps.iter().skip(1).map(|step| step.time() / second).collect(),
        panels: panels(scenario, flown, second),
    })
}

/// The diagrams of every figure along the flight, times in units of `second` seconds.
#[must_use]
pub fn panels(scenario: &ScenarioFile, flown: Flown<'_>, second: f64) -> Vec<Panel> {
    let Flown { plan, assessment, .. } = flown;
    let times: Vec<f64> = plan.node_times().into_iter().map(|time| time / second).collect();
    let mut panels: Vec<Panel> =
        DIAGRAMS.iter().filter_map(|metric| metric_panel(scenario, assessment, &times, *metric)).collect();
    panels.push(kinematic_panel(scenario, assessment, &times, Kinematic::Speed));
    panels.push(kinematic_panel(scenario, assessment, &times, Kinematic::Acceleration));
    let controls = [
        ("Jamming level", plan.agents.iter().map(|agent| agent.jam.as_deref()).collect::<Vec<_>>()),
        ("Dropout (1: silent)", plan.agents.iter().map(|agent| agent.dropout.as_deref()).collect()),
    ];
    panels.extend(controls.into_iter().filter_map(|(title, values)| control_panel(title, &values, &times)));
    panels
}

fn lines<'a>(times: &[f64], values: impl Iterator<Item = &'a [f64]>) -> Vec<Line> {
    let line = |(agent, values): (usize, &[f64])| Line {
        agent,
        points: times.iter().zip(values).map(|(time, value)| [*time, *value]).collect(),
    };
    values.enumerate().map(line).collect()
}

/// The diagram of a metric; none where no sensor measures it.
fn metric_panel(scenario: &ScenarioFile, assessment: &Assessment, times: &[f64], metric: Metric) -> Option<Panel> {
    let presentation = Presentation::of(metric, scenario.dimension, scenario.frame.unit_m);
    let converted: Vec<Vec<f64>> = assessment
        .agents
        .iter()
        .map(|agent| {
            agent.metric(metric).unwrap_or_default().iter().map(|value| presentation.convert(*value)).collect()
        })
        .collect();
    // A metric that no sensor measures is nowhere finite, and false alarms without energy detectors are all zero.
    let interesting = |value: &f64| value.is_finite() && (metric != Metric::FalseAlarm || *value > 0.0);
    let bounds: Vec<Bound> =
        scenario.limits.iter().flat_map(|limit| limit_bounds(limit, metric, &presentation)).collect();
    if bounds.is_empty() && !converted.iter().flatten().any(interesting) {
        return None;
    }
    Some(Panel {
        title: capitalised(presentation.short),
        unit: presentation.unit.into(),
        kind: presentation.kind,
        lines: lines(times, converted.iter().map(Vec::as_slice)),
        bounds,
    })
}

/// A limit's bounds, where it is about a metric or a function of it, in that metric's unit.
fn limit_bounds(limit: &Limit<f64>, metric: Metric, presentation: &Presentation) -> Vec<Bound> {
    let natural = |value: f64| match limit.metric {
        same if same == metric => Some(value),
        Metric::Cep2 if metric == Metric::Cep => Some(value.max(0.0).sqrt()),
        Metric::LogCep2 if metric == Metric::Cep => Some((0.5 * value).exp()),
        log if units::base(log) == metric => Some(value.exp()),
        _ => None,
    };
    let bound = |words: &str, value: Option<f64>| {
        value.and_then(natural).map(|value| Bound { value: presentation.convert(value), words: words.into() })
    };
    [bound("min", limit.min), bound("max", limit.max)].into_iter().flatten().collect()
}

/// Speed or acceleration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kinematic {
    Speed,
    Acceleration,
}

fn kinematic_panel(scenario: &ScenarioFile, assessment: &Assessment, times: &[f64], kinematic: Kinematic) -> Panel {
    let unit_m = scenario.frame.unit_m;
    // A speed belongs to the middle of its interval, an acceleration to the node between two.
    let at: Vec<f64> = match kinematic {
        Kinematic::Speed => times.iter().zip(times.iter().skip(1)).map(|(a, b)| 0.5 * (a + b)).collect(),
        Kinematic::Acceleration => times.iter().skip(1).copied().collect(),
    };
    let values: Vec<Vec<f64>> = assessment
        .agents
        .iter()
        .map(|agent| match kinematic {
            Kinematic::Speed => &agent.speed,
            Kinematic::Acceleration => &agent.accel,
        })
        .map(|values| values.iter().map(|value| value * unit_m).collect())
        .collect();
    let mut bounds: Vec<Bound> = Vec::new();
    for agent in &scenario.agents {
        let most = match kinematic {
            Kinematic::Speed => agent.speed_max,
            Kinematic::Acceleration => agent.accel_max,
        };
        let value = most * unit_m;
        if !bounds.iter().any(|bound| (bound.value - value).abs() <= 1e-12 * value) {
            bounds.push(Bound { value, words: "max".into() });
        }
    }
    let (title, unit) = match kinematic {
        Kinematic::Speed => ("Speed", "m/s"),
        Kinematic::Acceleration => ("Acceleration", "m/s\u{b2}"),
    };
    let lines = lines(&at, values.iter().map(Vec::as_slice));
    Panel { title: title.into(), unit: unit.into(), kind: Kind::Magnitude, lines, bounds }
}

/// The diagram of a control; none where it is nowhere used. Node 0 has no interval, so it is left out.
fn control_panel(title: &str, values: &[Option<&[f64]>], times: &[f64]) -> Option<Panel> {
    let values: Vec<&[f64]> =
        values.iter().map(|values| values.and_then(|all| all.get(1..)).unwrap_or_default()).collect();
    if !values.iter().any(|values| values.iter().any(|value| *value > 0.0)) {
        return None;
    }
    let lines = lines(times.get(1..).unwrap_or_default(), values.into_iter());
    let panel = Panel { title: title.into(), unit: String::new(), kind: Kind::Magnitude, lines, bounds: Vec::new() };
    Some(panel)
}

/// Words that begin with a capital letter.
pub(crate) fn capitalised(words: &str) -> String {
    let mut letters = words.chars();
    letters.next().map(|first| first.to_uppercase().chain(letters).collect()).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_add_up_leg_by_leg() {
        let path = vec![vec![0.0, 0.0], vec![3.0, 4.0], vec![3.0, 5.0]];
        assert!((path_length(&path) - 6.0).abs() < 1e-12);
    }

    #[test]
    fn limits_on_logarithms_are_drawn_where_the_metric_is() {
        let limit = Limit { metric: Metric::LogCep2, min: Some(2.0_f64.ln() * 2.0), max: None };
        let presentation = Presentation::of(Metric::Cep, 2, 100.0);
        let bounds = limit_bounds(&limit, Metric::Cep, &presentation);
        assert_eq!(bounds.len(), 1);
        assert!((bounds[0].value - 200.0).abs() < 1e-9, "{bounds:?}");
        assert!(limit_bounds(&limit, Metric::Aee, &presentation).is_empty());
    }
}
