//! A plan on the map: GeoJSON (RFC 7946), longitude first.
//!
//! One feature for each path (`LineString`), start, goal and sensor (`Point`; the track of a moving one as a
//! `LineString` too), and region (`Polygon`; of [`CORNERS`] corners
//! where it is a circle; its property `side` is `outside` where it is kept out of, `inside` where it is stayed in). `kind` and `name` say which is which.
//! Coordinates are horizontal: the format's altitude counts from the ellipsoid, and ours does not. A path's heights
//! stand in its property `altitude_m`, with `altitude_above` saying from where.

use quietpath_core::scenario::Side;
use serde_json::{Value, json};

use super::mission::located;
use super::plan::AgentPlan;
use super::scenario::{MotionEntry, Outline, RegionEntry, SensorEntry};
use super::{FileError, PlanFile, ScenarioFile};
use crate::frame::{Altitude, LocalFrame};

/// Corners of a circle.
pub const CORNERS: u32 = 72;

/// The plan, the sensors and the regions as GeoJSON.
///
/// # Errors
/// The scenario has no latitude and longitude.
pub fn to_geojson(scenario: &ScenarioFile, plan: &PlanFile) -> Result<String, Box<FileError>> {
    let frame = located(scenario)?;
    let times = plan.node_times();
    let mut features = Vec::new();
    for agent in &plan.agents {
        features.push(path(&frame, agent, &times));
        for (kind, position) in [("start", agent.path.first()), ("goal", agent.path.last())] {
            if let Some(position) = position {
                features.push(feature(kind, &agent.name, "Point", at(&frame, position)));
            }
        }
    }
    for entry in &scenario.sensors {
        sensor(&frame, entry, &mut features);
    }
    features.extend(scenario.regions.iter().map(|entry| region(&frame, entry)));
    let collection = json!({ "type": "FeatureCollection", "features": features });
    Ok(format!("{collection:#}\n"))
}

/// Longitude and latitude of a position.
fn at(frame: &LocalFrame, position: &[f64]) -> Value {
    let place = frame.place(position);
    json!([place.longitude_deg, place.latitude_deg])
}

fn feature(kind: &str, name: &str, geometry: &str, coordinates: Value) -> Value {
    json!({
        "type": "Feature",
        "properties": { "kind": kind, "name": name },
        "geometry": { "type": geometry, "coordinates": coordinates },
    })
}

fn path(frame: &LocalFrame, agent: &AgentPlan, times: &[f64]) -> Value {
    let altitudes: Vec<Altitude> = agent.path.iter().map(|position| frame.place(position).altitude).collect();
    let above = match altitudes.first() {
        Some(Altitude::AboveSeaLevel(_)) => "mean sea level",
        _ => "home",
    };
    let line: Vec<Value> = agent.path.iter().map(|position| at(frame, position)).collect();
    let mut value = feature("path", &agent.name, "LineString", line.into());
    value["properties"]["time_s"] = json!(times);
    value["properties"]["altitude_m"] = altitudes.iter().map(|altitude| altitude.meters()).collect();
    value["properties"]["altitude_above"] = json!(above);
    value
}

fn sensor(frame: &LocalFrame, entry: &SensorEntry, features: &mut Vec<Value>) {
    match &entry.motion {
        MotionEntry::Fixed(position) => {
            features.push(feature("sensor", &entry.name, "Point", at(frame, position)));
        }
        MotionEntry::Track(track) => {
            if let Some(first) = track.first() {
                features.push(feature("sensor", &entry.name, "Point", at(frame, &first.position)));
            }
            // A line needs two positions.
            if track.len() > 1 {
                let line: Vec<Value> = track.iter().map(|knot| at(frame, &knot.position)).collect();
                let mut value = feature("sensor_track", &entry.name, "LineString", line.into());
                value["properties"]["time_s"] = track.iter().map(|knot| knot.time).collect();
                features.push(value);
            }
        }
    }
}

/// A ring counter-clockwise, its last corner its first.
fn region(frame: &LocalFrame, entry: &RegionEntry) -> Value {
    let corners = entry.outline.ring(CORNERS);
    let ring: Vec<Value> = corners.iter().chain(corners.first()).map(|corner| at(frame, corner)).collect();
    let mut value = feature("region", &entry.name, "Polygon", json!([ring]));
    value["properties"]["side"] = json!(match entry.side {
        Side::Outside => "outside",
        Side::Inside => "inside",
    });
    if let Outline::Circle { radius, .. } = entry.outline {
        value["properties"]["radius_m"] = json!(radius * frame.unit_m());
    }
    for (key, bound) in [("from_s", entry.window.from), ("until_s", entry.window.until)] {
        if bound.is_finite() {
            value["properties"][key] = json!(bound);
        }
    }
    value
}
