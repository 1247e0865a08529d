//! Pictures of a flight that was planned in steps: each step's plan, and all of them with what was flown.

use quietpath_bridge::file::ScenarioFile;
use quietpath_bridge::file::plan::AgentPlan;
use quietpath_bridge::planning::{self, Step};

use super::{Flown, flight, overlay};
use crate::picture::landscape::{Ends, Flight, LINE};
use crate::picture::scale::trimmed;
use crate::picture::{DrawError, Picture, colour};
use crate::units::{self, Presentation};

/// Dash pattern of what is planned and not flown yet.
const PLANNED: &str = "8 5";
/// Width of the lines of many plans.
const THIN: f64 = 2.0;
/// Colour of what was flown, among the colours of steps.
const FLOWN: &str = "#111111";
/// Steps that the legend names.
const NAMED: usize = 6;

/// Draws a step: what was flown before it, solid, and its plan, dashed. `field` is of the time of the step.
///
/// # Errors
/// Where the picture cannot be encoded, and where there is no such step.
pub fn step(
    scenario: &ScenarioFile,
    field: &planning::Grid,
    flown: Flown<'_>,
    index: usize,
) -> Result<Picture, DrawError> {
    let step = flown.steps.get(index).ok_or_else(DrawError::nothing)?;
    let several = flown.plan.agents.len() > 1;
    let mut flights = Vec::new();
    for (agent, (whole, rest)) in flown.plan.agents.iter().zip(&step.plan.agents).enumerate() {
        let name = |what: &str| if several { format!("{}, {what}", whole.name) } else { what.to_owned() };
        if step.node > 0 {
            let before = flight(scenario, &first(whole, step.node + 1), &name("flown"), colour::agent(agent));
            flights.push(Flight { ends: Ends::Start, ..before });
        }
        let planned = flight(scenario, rest, &name("planned"), colour::agent(agent));
        let ends = if step.node > 0 { Ends::Goal } else { Ends::Both };
        flights.push(Flight { ends, dash: PLANNED, ..planned });
    }
    let presentation = Presentation::of(field.metric, scenario.dimension, scenario.frame.unit_m);
    let title = format!("{}: step {} of {}, {}", scenario.name, index + 1, flown.steps.len(), presentation.name);
    let objective = step.plan.objective.map(trimmed).unwrap_or_default();
    let subtitle = format!(
        "at {} s, with {} to fly, objective of the rest {objective} ({})",
        trimmed((10.0 * step.time()).round() / 10.0),
        units::duration(step.plan.duration),
        words(step),
    );
    overlay(scenario, field, [title, subtitle], flights)
}

/// Draws the plans of all steps, each from where it begins, and what was flown.
///
/// # Errors
/// Where the picture cannot be encoded.
pub fn all(scenario: &ScenarioFile, field: &planning::Grid, flown: Flown<'_>) -> Result<Picture, DrawError> {
    let steps = flown.steps;
    let last = steps.len().saturating_sub(1).max(1);
    let every = steps.len().div_ceil(NAMED).max(1);
    let mut flights = Vec::new();
    for (index, step) in steps.iter().enumerate() {
        let ink = colour::swept(index as f64 / last as f64);
        for (agent, rest) in step.plan.agents.iter().enumerate() {
            let is_named = agent == 0 && index % every == 0;
            let name = if is_named { format!("step {}, {:.0} s", index + 1, step.time()) } else { String::new() };
            let planned = flight(scenario, rest, &name, &ink);
            flights.push(Flight {
                ends: Ends::Neither,
                width: THIN,
                jam: Vec::new(),
                azimuth: Vec::new(),
                ..planned
            });
        }
    }
    for (agent, whole) in flown.plan.agents.iter().enumerate() {
        let name = if agent == 0 { "flown" } else { "" };
        flights.push(Flight { width: LINE, ..flight(scenario, whole, name, FLOWN) });
    }
    let presentation = Presentation::of(field.metric, scenario.dimension, scenario.frame.unit_m);
    let title = format!("{}: plans of {} steps, and what was flown", scenario.name, steps.len());
    let subtitle = format!("over the {} at {} s", presentation.name, trimmed(field.time));
    overlay(scenario, field, [title, subtitle], flights)
}

/// The first nodes of an agent's plan.
fn first(agent: &AgentPlan, nodes: usize) -> AgentPlan {
    let cut = |values: &Option<Vec<f64>>| values.as_ref().map(|all| all.iter().take(nodes).copied().collect());
    AgentPlan {
        name: agent.name.clone(),
        path: agent.path.iter().take(nodes).cloned().collect(),
        jam: cut(&agent.jam),
        azimuth: cut(&agent.azimuth),
        dropout: cut(&agent.dropout),
    }
}

/// What became of a step.
fn words(step: &Step) -> String {
    match step.choice {
        planning::Choice::New => step.status.name().replace('_', " "),
        planning::Choice::Tail => "the plan before it stays".to_owned(),
    }
}
