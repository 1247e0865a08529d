//! The formats: from text to what is in it. Errors are sentences without the name of the file.

use geojson::{GeoJson, GeometryValue};
use kml::types::Geometry;
use kml::{Kml, KmlReader};
use serde_json::Value;

use super::{Area, Found, Shape, Spot};

/// MAVLink commands that have a place to fly to: waypoint, loiter (three kinds), return aside; land, take-off.
const PLACES: [u64; 6] = [16, 17, 18, 19, 21, 22];

/// `QGroundControl`'s plan: home, waypoints, speed, fences.
pub fn qgc_plan(text: &str, found: &mut Found) -> Result<(), String> {
    let plan: Value = serde_json::from_str(text).map_err(|cause| format!("is not valid JSON: {cause}"))?;
    if plan.get("fileType").and_then(Value::as_str) != Some("Plan") {
        return Err("is no plan of QGroundControl: `fileType` is not \"Plan\"".into());
    }
    let mission = &plan["mission"];
    if let Some([latitude, longitude]) = pair(&mission["plannedHomePosition"]) {
        found.home = Some([latitude, longitude]);
    }
    found.speed_m_s = mission["cruiseSpeed"].as_f64().filter(|speed| *speed > 0.0).or(found.speed_m_s);
    for item in mission["items"].as_array().into_iter().flatten() {
        let flown = item["command"].as_u64().is_some_and(|command| PLACES.contains(&command));
        let place =
            item["params"].as_array().and_then(|params| Some([params.get(4)?.as_f64()?, params.get(5)?.as_f64()?]));
        if let Some(place) = place.filter(|[latitude, longitude]| flown && (*latitude != 0.0 || *longitude != 0.0)) {
            found.height_m = found.height_m.or_else(|| item["params"][6].as_f64().filter(|height| *height > 0.0));
            found.waypoints.push(Spot::Earth(place));
        }
    }
    let fence = &plan["geoFence"];
    for (index, polygon) in fence["polygons"].as_array().into_iter().flatten().enumerate() {
        let corners: Option<Vec<Spot>> =
            polygon["polygon"].as_array().map(|all| all.iter().filter_map(pair).map(Spot::Earth).collect());
        let outline = Shape::Polygon(corners.unwrap_or_default());
        found.areas.push(Area { name: format!("fence{}", index + 1), inside: polygon["inclusion"] == true, outline });
    }
    for (index, circle) in fence["circles"].as_array().into_iter().flatten().enumerate() {
        let (center, radius) = (pair(&circle["circle"]["center"]), circle["circle"]["radius"].as_f64());
        let (Some(center), Some(radius)) = (center, radius) else {
            return Err(format!("geoFence.circles[{index}] has no centre and radius"));
        };
        let outline = Shape::Circle(Spot::Earth(center), radius);
        found.areas.push(Area { name: format!("circle{}", index + 1), inside: circle["inclusion"] == true, outline });
    }
    Ok(())
}

/// The first two numbers of a list.
fn pair(value: &Value) -> Option<[f64; 2]> {
    Some([value.get(0)?.as_f64()?, value.get(1)?.as_f64()?])
}

/// GeoJSON: points are sensors, polygons regions.
pub fn geojson(text: &str, found: &mut Found) -> Result<(), String> {
    let parsed: GeoJson = text.parse().map_err(|cause| format!("is not valid GeoJSON: {cause}"))?;
    match parsed {
        GeoJson::Geometry(geometry) => shape(&geometry.value, "", false, found),
        GeoJson::Feature(feature) => feature_of(&feature, found),
        GeoJson::FeatureCollection(all) => all.features.iter().for_each(|feature| feature_of(feature, found)),
    }
    Ok(())
}

fn feature_of(feature: &geojson::Feature, found: &mut Found) {
    let text = |key: &str| feature.property(key).and_then(|value| value.as_str()).unwrap_or_default();
    // What `quietpath plan` itself writes: a flight's ends are no sensors.
    if let (kind @ ("start" | "goal"), Some(geometry)) = (text("kind"), &feature.geometry) {
        if let GeometryValue::Point { coordinates } = &geometry.value {
            let at = if kind == "start" { 0 } else { found.waypoints.len() };
            if let Some(spot) = earth(coordinates.as_slice()) {
                found.waypoints.insert(at, spot);
            }
        }
        return;
    }
    if let Some(geometry) = &feature.geometry {
        shape(&geometry.value, text("name"), text("side") == "inside", found);
    }
}

/// GeoJSON and KML have longitude first.
fn earth(position: &[f64]) -> Option<Spot> {
    Some(Spot::Earth([*position.get(1)?, *position.first()?]))
}

fn shape(value: &GeometryValue, name: &str, inside: bool, found: &mut Found) {
    let mut polygon = |rings: &[Vec<geojson::Position>]| {
        let corners = rings.first().into_iter().flatten().filter_map(|corner| earth(corner.as_slice())).collect();
        area(found, name, inside, corners);
    };
    match value {
        GeometryValue::Polygon { coordinates } => polygon(coordinates),
        GeometryValue::MultiPolygon { coordinates } => coordinates.iter().for_each(|rings| polygon(rings)),
        GeometryValue::Point { coordinates } => {
            sensor(found, name, earth(coordinates.as_slice()));
        }
        GeometryValue::MultiPoint { coordinates } => {
            coordinates.iter().for_each(|point| sensor(found, name, earth(point.as_slice())));
        }
        GeometryValue::GeometryCollection { geometries } => {
            geometries.iter().for_each(|part| shape(&part.value, name, inside, found));
        }
        GeometryValue::LineString { .. } | GeometryValue::MultiLineString { .. } => {
            found
                .notes
                .push(format!("a line{} was left out: only points and polygons mean something here", named(name)));
        }
    }
}

fn named(name: &str) -> String {
    if name.is_empty() { String::new() } else { format!(" ({name})") }
}

fn sensor(found: &mut Found, name: &str, spot: Option<Spot>) {
    let number = found.sensors.len() + 1;
    let name = if name.is_empty() { format!("s{number}") } else { name.to_owned() };
    found.sensors.extend(spot.map(|spot| (name, spot)));
}

/// Adds a polygon; the corner that closes a ring is the first once more.
fn area(found: &mut Found, name: &str, inside: bool, mut corners: Vec<Spot>) {
    if corners.len() > 1 && corners.first() == corners.last() {
        corners.pop();
    }
    let number = found.areas.len() + 1;
    let name = if name.is_empty() { format!("region{number}") } else { name.to_owned() };
    found.areas.push(Area { name, inside, outline: Shape::Polygon(corners) });
}

/// KML: placemarks that are points are sensors, polygons regions.
pub fn kml(text: &str, found: &mut Found) -> Result<(), String> {
    let parsed: Kml = KmlReader::from_string(text).read().map_err(|cause| format!("is not valid KML: {cause}"))?;
    element(&parsed, found);
    Ok(())
}

fn element(kml: &Kml, found: &mut Found) {
    match kml {
        Kml::KmlDocument(document) => document.elements.iter().for_each(|part| element(part, found)),
        Kml::Document { elements, .. } => elements.iter().for_each(|part| element(part, found)),
        Kml::Folder(folder) => folder.elements.iter().for_each(|part| element(part, found)),
        Kml::Placemark(placemark) => {
            let name = placemark.name.as_deref().unwrap_or_default();
            if let Some(geometry) = &placemark.geometry {
                placed(geometry, name, found);
            }
        }
        _ => {}
    }
}

fn placed(geometry: &Geometry, name: &str, found: &mut Found) {
    match geometry {
        Geometry::Point(point) => sensor(found, name, Some(Spot::Earth([point.coord.y, point.coord.x]))),
        Geometry::Polygon(polygon) => {
            let corners = polygon.outer.coords.iter().map(|corner| Spot::Earth([corner.y, corner.x])).collect();
            area(found, name, false, corners);
        }
        Geometry::MultiGeometry(all) => all.geometries.iter().for_each(|part| placed(part, name, found)),
        _ => found
            .notes
            .push(format!("a line{} was left out: only points and polygons mean something here", named(name))),
    }
}

/// CSV of sensors, with a line of headings.
pub fn csv(text: &str, found: &mut Found) -> Result<(), String> {
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(text.as_bytes());
    let headings = reader.headers().map_err(|cause| format!("is not valid CSV: {cause}"))?.clone();
    let column =
        |names: &[&str]| headings.iter().position(|heading| names.contains(&heading.to_lowercase().as_str()));
    let earth =
        column(&["latitude", "lat", "latitude_deg"]).zip(column(&["longitude", "lon", "lng", "longitude_deg"]));
    let plane = column(&["east_m", "east", "x"]).zip(column(&["north_m", "north", "y"]));
    let (columns, is_earth) = match (earth, plane) {
        (Some(columns), _) => (columns, true),
        (None, Some(columns)) => (columns, false),
        _ => {
            let have: Vec<&str> = headings.iter().collect();
            return Err(format!(
                "has the columns {}, and no place among them\n  help: name two columns latitude and longitude (degrees), or \
                 east_m and north_m",
                have.join(", ")
            ));
        }
    };
    let name = column(&["name", "id", "sensor"]);
    for (index, record) in reader.records().enumerate() {
        let line = index + 2;
        let record = record.map_err(|cause| format!("line {line} is not valid: {cause}"))?;
        let number = |column: usize| -> Result<f64, String> {
            let text = record.get(column).unwrap_or_default();
            let heading = headings.get(column).unwrap_or_default();
            let number = text.parse().ok().filter(|number: &f64| number.is_finite());
            number.ok_or_else(|| format!("line {line}: {heading} is `{text}`, and must be a number"))
        };
        let place = [number(columns.0)?, number(columns.1)?];
        let spot = if is_earth { Spot::Earth(place) } else { Spot::Plane(place) };
        sensor(found, name.and_then(|name| record.get(name)).unwrap_or_default(), Some(spot));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(reader: fn(&str, &mut Found) -> Result<(), String>, text: &str) -> Found {
        let mut found = Found::default();
        reader(text, &mut found).unwrap();
        found
    }

    #[test]
    fn kml_has_longitude_first_and_nests() {
        let text = r#"<?xml version="1.0"?><kml xmlns="http://www.opengis.net/kml/2.2"><Document><Folder>
            <Placemark><name>mast</name><Point><coordinates>8.5,47.4,400</coordinates></Point></Placemark>
            <Placemark><name>zone</name><Polygon><outerBoundaryIs><LinearRing><coordinates>
              8.50,47.40 8.51,47.40 8.51,47.41 8.50,47.40</coordinates></LinearRing></outerBoundaryIs></Polygon></Placemark>
            </Folder></Document></kml>"#;
        let found = read(kml, text);
        assert_eq!(found.sensors, [("mast".to_owned(), Spot::Earth([47.4, 8.5]))]);
        let Shape::Polygon(corners) = &found.areas[0].outline else { panic!("{:?}", found.areas) };
        assert_eq!((corners.len(), corners[1]), (3, Spot::Earth([47.4, 8.51])));
    }

    #[test]
    fn geojson_tells_sides_and_leaves_lines_out() {
        let text = r#"{"type": "FeatureCollection", "features": [
            {"type": "Feature", "properties": {"name": "a"}, "geometry": {"type": "Point", "coordinates": [8.5, 47.4]}},
            {"type": "Feature", "properties": {"side": "inside"}, "geometry": {"type": "Polygon",
              "coordinates": [[[8.5, 47.4], [8.6, 47.4], [8.6, 47.5], [8.5, 47.4]]]}},
            {"type": "Feature", "properties": null, "geometry": {"type": "LineString", "coordinates": [[1, 2], [3, 4]]}}]}"#;
        let found = read(geojson, text);
        assert_eq!((found.sensors.len(), found.areas.len(), found.notes.len()), (1, 1, 1));
        assert!(found.areas[0].inside);
    }

    #[test]
    fn a_table_without_places_or_numbers_says_so() {
        let mut found = Found::default();
        let error = csv("name,height\na,3\n", &mut found).unwrap_err();
        assert!(error.contains("has the columns name, height"), "{error}");
        let error = csv("name,lat,lon\na,1,2\nb,x,3\n", &mut found).unwrap_err();
        assert_eq!(error, "line 3: lat is `x`, and must be a number");
        let found = read(csv, "Name, East_m, North_m\nmast, 10, -20.5\n");
        assert_eq!(found.sensors, [("mast".to_owned(), Spot::Plane([10.0, -20.5]))]);
    }

    #[test]
    fn a_plan_without_its_mark_is_refused() {
        let error = qgc_plan("{\"mission\": {}}", &mut Found::default()).unwrap_err();
        assert!(error.contains("fileType"), "{error}");
    }
}
