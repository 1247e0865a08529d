//! From what was found to the text of a scenario.

use std::fmt::Write as _;

use quietpath_bridge::file::scenario::Origin;
use quietpath_bridge::frame::LocalFrame;

use super::shape::{Fit, fitted};
use super::{Found, Shape, Spot, flat};
use crate::outcome::Failure;

/// Metres in a length unit: that of the starter, whose sensors are borrowed.
const UNIT_M: f64 = 100.0;
/// What is assumed where no file says it: speed, m/s; acceleration, m/s^2; height, m.
const SPEED_M_S: f64 = 10.0;
const ACCEL_M_S2: f64 = 2.0;
const HEIGHT_M: f64 = 30.0;
/// Room around everything that was found, as a share of its extent.
const ROOM: f64 = 0.1;
/// Latest arrival, as a multiple of the straight flight.
const PATIENCE: f64 = 2.0;
/// Arrival that costs nothing, as a multiple of the straight flight.
const UNHURRIED: f64 = 1.05;

const SENSOR: &str = "\
ranging = { model = \"toa\", c1 = 0.01, c2 = 0.1, path_loss = 2.0 }                       # assumed
detection = { model = \"proxy\", scale = 0.3, epsilon = 0.3, path_loss = 2.0 }            # assumed
";

/// Writes a scenario; `name` is its name, and `from` the files that it comes from.
///
/// # Errors
/// Places on the Earth and places in metres without a home that connects them; everything in one place.
pub fn scenario(found: &mut Found, name: &str, from: &str) -> Result<String, Failure> {
    let origin = origin(found);
    let frame = origin.map(|origin| LocalFrame::new(origin, 1.0));
    let place = |spot: Spot| {
        let help = "give a .plan as well, whose home is then the origin";
        flat(frame.as_ref(), spot).map(|place| place.map(|part| part / UNIT_M)).ok_or_else(|| {
            Failure::Input(format!("some places are on the Earth and others in metres\n  help: {help}"))
        })
    };
    let mut sensors = Vec::new();
    for (name, spot) in &found.sensors {
        sensors.push((name.clone(), place(*spot)?));
    }
    let mut ways = Vec::new();
    for spot in &found.waypoints {
        ways.push(place(*spot)?);
    }
    let mut regions = Vec::new();
    for area in found.areas.clone() {
        let outline = match &area.outline {
            Shape::Circle(center, radius) => Some(Fit::Circle(place(*center)?, radius / UNIT_M)),
            Shape::Polygon(corners) => {
                let corners = corners.iter().map(|corner| place(*corner)).collect::<Result<Vec<_>, _>>()?;
                let fit = fitted(&corners);
                note(&mut found.notes, &area.name, area.inside, fit.as_ref());
                fit.filter(|fit| !area.inside || matches!(fit, Fit::AsItIs(_)))
            }
        };
        regions.extend(outline.map(|outline| (area.name, area.inside, outline)));
    }
    let all: Vec<[f64; 2]> = sensors
        .iter()
        .map(|(_, at)| *at)
        .chain(ways.iter().copied())
        .chain(regions.iter().flat_map(|(_, _, fit)| extent(fit)))
        .collect();
    let [low, high] =
        domain(&all).ok_or_else(|| Failure::input("everything is in one place: there is no area to plan in"))?;
    let ends = match (ways.first(), ways.last()) {
        (Some(start), Some(goal)) if start != goal => Some([*start, *goal]),
        _ => None,
    };
    let mut text = heading(found, name, from, origin);
    vehicle(&mut text, found, [low, high], ends);
    for (name, at) in &sensors {
        let _ = write!(text, "\n[[sensor]]\nname = {}\nposition = {}\n{SENSOR}", quoted(name), point(*at));
    }
    text.push_str("\n[[objective.term]]\nmetric = \"detection\"\nsense = \"min\"\n");
    for (name, inside, fit) in &regions {
        let _ = writeln!(text, "\n[[region]]\nname = {}", quoted(name));
        match fit {
            Fit::Circle(center, radius) => {
                let _ = writeln!(text, "center = {}\nradius = {}", point(*center), figure(*radius));
            }
            Fit::AsItIs(ring) | Fit::Hull(ring) => {
                let corners: Vec<String> = ring.iter().map(|corner| point(*corner)).collect();
                let _ = writeln!(text, "polygon = [{}]", corners.join(", "));
            }
        }
        if *inside {
            text.push_str("inside = true\n");
        }
    }
    Ok(text)
}

/// Home; or, where there is none, the middle of what has a place on the Earth.
fn origin(found: &Found) -> Option<Origin> {
    let corners = found.areas.iter().flat_map(|area| match &area.outline {
        Shape::Circle(center, _) => vec![*center],
        Shape::Polygon(corners) => corners.clone(),
    });
    let spots = found.sensors.iter().map(|(_, spot)| *spot).chain(found.waypoints.iter().copied()).chain(corners);
    let places: Vec<[f64; 2]> =
        spots.filter_map(|spot| if let Spot::Earth(place) = spot { Some(place) } else { None }).collect();
    let mean = |axis: usize| places.iter().map(|place| place[axis]).sum::<f64>() / places.len() as f64;
    let rounded = |degrees: f64| (degrees * 1e7).round() / 1e7;
    let middle = (!places.is_empty()).then(|| [rounded(mean(0)), rounded(mean(1))]);
    let [latitude_deg, longitude_deg] = found.home.or(middle)?;
    Some(Origin { latitude_deg, longitude_deg, altitude_m: found.height_m.unwrap_or(HEIGHT_M) })
}

fn note(notes: &mut Vec<String>, name: &str, inside: bool, fit: Option<&Fit>) {
    let what = match (fit, inside) {
        (Some(Fit::AsItIs(_)), _) => return,
        (None, _) => "was left out: it has no area",
        (Some(_), true) => "was left out: a region to stay in must be convex, with at most 12 corners",
        (Some(Fit::Hull(_)), false) => "is not convex: its convex hull is kept out of",
        (Some(Fit::Circle(..)), false) => "has too many corners: the circle around it is kept out of",
    };
    notes.push(format!("{name} {what}"));
}

fn extent(fit: &Fit) -> Vec<[f64; 2]> {
    match fit {
        Fit::AsItIs(ring) | Fit::Hull(ring) => ring.clone(),
        Fit::Circle([x, y], radius) => vec![[x - radius, y - radius], [x + radius, y + radius]],
    }
}

/// A box around everything, with room; `None` where that has no area.
fn domain(all: &[[f64; 2]]) -> Option<[[f64; 2]; 2]> {
    let edge = |axis: usize, pick: fn(f64, f64) -> f64| all.iter().map(|place| place[axis]).reduce(pick);
    let (low, high) = ([edge(0, f64::min)?, edge(1, f64::min)?], [edge(0, f64::max)?, edge(1, f64::max)?]);
    let side = (high[0] - low[0]).max(high[1] - low[1]);
    (side > 0.0).then(|| {
        [
            low.map(|at| ((at - ROOM * side) * 100.0).floor() / 100.0),
            high.map(|at| ((at + ROOM * side) * 100.0).ceil() / 100.0),
        ]
    })
}

fn heading(found: &Found, name: &str, from: &str, origin: Option<Origin>) -> String {
    let mut text = format!(
        "# Imported from {from} by quietpath import.\n# Lines marked `assumed` stood in none of these files: put in what is true.\n"
    );
    for note in &found.notes {
        let _ = writeln!(text, "# Note: {note}.");
    }
    let _ =
        writeln!(text, "\nname = {}\ndimension = 2\nsoftening = 0.05\n\n[frame]\nunit_m = {UNIT_M:.1}", quoted(name));
    if let Some(Origin { latitude_deg, longitude_deg, altitude_m }) = origin {
        let assumed = if found.height_m.is_none() { "    # assumed: height of the flight above home" } else { "" };
        let _ = writeln!(
            text,
            "latitude_deg = {latitude_deg:?}\nlongitude_deg = {longitude_deg:?}\naltitude_m = {altitude_m:?}{assumed}"
        );
    }
    text
}

fn vehicle(text: &mut String, found: &Found, [low, high]: [[f64; 2]; 2], ends: Option<[[f64; 2]; 2]>) {
    let corner = |share: f64| [0, 1].map(|axis: usize| low[axis] + share * (high[axis] - low[axis]));
    let [start, goal] = ends.unwrap_or([corner(0.05), corner(0.95)]);
    let speed = found.speed_m_s.unwrap_or(SPEED_M_S) / UNIT_M;
    let straight = (goal[0] - start[0]).hypot(goal[1] - start[1]) / speed;
    let assumed = |known: bool| if known { "" } else { "    # assumed" };
    let ends_known = assumed(ends.is_some());
    let _ = write!(
        text,
        "\n[grid]\nintervals = 60\n\n[time]\nmax = {}    # assumed: {PATIENCE} times the straight flight\n\
         target = {}    # assumed\npenalty = 1.0\n\n[domain]\nmin = {}\nmax = {}\n\n[[agent]]\nname = \"uav1\"\n\
         start = {}{ends_known}\ngoal = {}{ends_known}\nspeed_max = {}{}\naccel_max = {}    # assumed\n",
        figure((PATIENCE * straight).ceil()),
        figure((UNHURRIED * straight).ceil()),
        point(low),
        point(high),
        point(start),
        point(goal),
        figure(speed),
        assumed(found.speed_m_s.is_some()),
        figure(ACCEL_M_S2 / UNIT_M),
    );
}

fn point([x, y]: [f64; 2]) -> String {
    format!("[{}, {}]", figure(x), figure(y))
}

/// A number to the millimetre, as TOML writes floats.
fn figure(value: f64) -> String {
    format!("{:?}", (value * 1e5).round() / 1e5)
}

/// A TOML string: JSON's escapes are a part of TOML's.
fn quoted(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}
