//! `quietpath import`: a scenario from the files of others.
//!
//! | file | what is taken |
//! |---|---|
//! | `.plan` of QGroundControl | home as the origin, first and last waypoint as start and goal, cruise speed, fences as regions |
//! | `.geojson`, `.json` | points as sensors, polygons as regions |
//! | `.kml` | placemarks: points as sensors, polygons as regions |
//! | `.csv` | sensors: `name`, and `latitude`, `longitude` or `east_m`, `north_m` |
//!
//! A polygon is kept out of, unless its property or column `side` says `inside`. Regions must be convex here and have
//! few corners: one to keep out of is replaced by its convex hull or the circle around it, which is larger and so safe,
//! and one to stay in is left out; both are told.
//!
//! What files do not say (how well sensors measure, how fast the vehicle is) is taken from the starter scenario and
//! marked in the text.
//!
//! Limits: two dimensions; heights are ignored.

mod shape;
mod source;
mod write;

use std::path::Path;

use quietpath_bridge::frame::{LocalFrame, Place};

use crate::outcome::Failure;
pub use write::scenario;

/// A place as a file has it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Spot {
    /// Latitude and longitude, degrees.
    Earth([f64; 2]),
    /// East and north of the origin, m.
    Plane([f64; 2]),
}

/// A region as a file has it.
#[derive(Clone, Debug, PartialEq)]
pub struct Area {
    /// Name.
    pub name: String,
    /// Whether to stay in.
    pub inside: bool,
    /// Outline.
    pub outline: Shape,
}

/// The outline of an area.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// Centre, and radius in m.
    Circle(Spot, f64),
    /// Corners.
    Polygon(Vec<Spot>),
}

/// What was found in files.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Found {
    /// Latitude and longitude of home, degrees.
    pub home: Option<[f64; 2]>,
    /// Waypoints, in order.
    pub waypoints: Vec<Spot>,
    /// Height of the first waypoint above home, m.
    pub height_m: Option<f64>,
    /// Cruise speed, m/s.
    pub speed_m_s: Option<f64>,
    /// Sensors: names and places.
    pub sensors: Vec<(String, Spot)>,
    /// Regions.
    pub areas: Vec<Area>,
    /// What was left out or changed.
    pub notes: Vec<String>,
}

/// Reads files, each by the end of its name.
///
/// # Errors
/// A file that cannot be read or is not what its name says; nothing found at all.
pub fn read(files: &[std::path::PathBuf]) -> Result<Found, Failure> {
    let mut found = Found::default();
    for file in files {
        let text = std::fs::read_to_string(file)
            .map_err(|cause| Failure::Input(format!("cannot read {}: {cause}", file.display())))?;
        read_one(file, &text, &mut found)?;
    }
    if found.sensors.is_empty() && found.areas.is_empty() && found.waypoints.is_empty() && found.home.is_none() {
        let names: Vec<String> = files.iter().map(|file| file.display().to_string()).collect();
        return Err(Failure::Input(format!(
            "{}: nothing to import: no points, polygons, fences or waypoints",
            names.join(", ")
        )));
    }
    Ok(found)
}

fn read_one(file: &Path, text: &str, found: &mut Found) -> Result<(), Failure> {
    let extension = file.extension().map(|extension| extension.to_ascii_lowercase());
    let done = match extension.as_ref().and_then(|extension| extension.to_str()) {
        Some("plan") => source::qgc_plan(text, found),
        Some("geojson" | "json") => source::geojson(text, found),
        Some("kml") => source::kml(text, found),
        Some("csv") => source::csv(text, found),
        _ => Err("the name says no format\n  help: end it in .plan, .geojson, .kml or .csv".to_owned()),
    };
    done.map_err(|cause| Failure::Input(format!("{}: {cause}", file.display())))
}

/// East and north of the origin, m.
fn flat(frame: Option<&LocalFrame>, spot: Spot) -> Option<[f64; 2]> {
    match spot {
        Spot::Plane(place) => Some(place),
        Spot::Earth([latitude_deg, longitude_deg]) => {
            let altitude = quietpath_bridge::frame::Altitude::AboveHome(0.0);
            let position = frame?.position(&Place { latitude_deg, longitude_deg, altitude })?;
            Some([position.first().copied()?, position.get(1).copied()?])
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_without_a_format_are_refused() {
        let Err(Failure::Input(text)) = read_one(Path::new("a.txt"), "", &mut Found::default()) else { panic!() };
        assert!(text.starts_with("a.txt: the name says no format"), "{text}");
    }
}
