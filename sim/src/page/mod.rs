//! `report.html`: a plan, or a flight, as one page that moves.
//!
//! The page is a single file: its figures as JSON, the charting library, the program that draws, and the style, put together
//! here. It asks the network for nothing, and a policy in its head forbids it to.
//!
//! | file | what |
//! |---|---|
//! | [`data`] | the figures, in the units that are printed |
//! | [`field`] | landscapes, packed |
//! | `page.html`, `page.css` | structure and style |
//! | `map.js`, `charts.js`, `tables.js`, `app.js` | the map, diagrams over time, tables, and the time that links them |
//! | `sim/vendor/uplot` | uPlot, as its authors publish it |
//!
//! Limits: landscapes are for one agent without controls, as pictures are; the nearest of at most
//! [`field::FRAMES`] instants is shown where sensors move.

pub mod data;
pub mod field;

use quietpath_bridge::file::{FileError, ScenarioFile};

pub use data::{Message, Story, Way};

const HTML: &str = include_str!("page.html");
const STYLE: [&str; 2] = [include_str!("../../vendor/uplot/uPlot.min.css"), include_str!("page.css")];
const LIBRARY: &str = include_str!("../../vendor/uplot/uPlot.iife.min.js");
const PROGRAM: [&str; 4] =
    [include_str!("map.js"), include_str!("charts.js"), include_str!("tables.js"), include_str!("app.js")];

/// The page of a story.
///
/// # Errors
/// As [`quietpath_bridge::planning::landscapes`].
pub fn html(scenario: &ScenarioFile, story: &Story<'_>) -> Result<String, Box<FileError>> {
    Ok(assembled(&scenario.name, &json(scenario, story)?, ""))
}

/// The data of a story, as JSON.
///
/// # Errors
/// As [`html`].
pub fn json(scenario: &ScenarioFile, story: &Story<'_>) -> Result<String, Box<FileError>> {
    let data = data::gather(scenario, story)?;
    Ok(serde_json::to_string(&data).unwrap_or_else(|_| "null".into()))
}

/// The page for a server that has `/events`: it may connect to where it comes from, and nowhere else.
#[must_use]
pub fn live(title: &str, json: &str) -> String {
    assembled(title, json, "connect-src 'self'; ")
}

fn assembled(title: &str, json: &str, policy: &str) -> String {
    fill(&[
        ("title", &escaped(title)),
        ("policy", policy),
        ("live", if policy.is_empty() { "" } else { " data-live=\"/events\"" }),
        ("style", &STYLE.concat()),
        // A script element ends at the first `</script`, whatever stands around it.
        ("data", &json.replace('<', "\\u003c")),
        ("library", LIBRARY),
        ("program", &PROGRAM.concat()),
    ])
}

/// The structure with its `{{name}}` places filled, each once.
fn fill(parts: &[(&str, &str)]) -> String {
    let mut page = String::new();
    let mut rest = HTML;
    while let Some((before, (name, after))) =
        rest.split_once("{{").and_then(|(before, tail)| Some((before, tail.split_once("}}")?)))
    {
        page.push_str(before);
        page.push_str(parts.iter().find(|(known, _)| *known == name).map_or("", |(_, text)| text));
        rest = after;
    }
    page.push_str(rest);
    page
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
