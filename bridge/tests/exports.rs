//! Mission files and maps, read back from the text that is written.

use quietpath_bridge::file::plan::AgentPlan;
use quietpath_bridge::file::scenario::Outline;
use quietpath_bridge::file::{PlanFile, ScenarioFile, geojson, mission};
use quietpath_core::scenario::Side;
use serde_json::Value;

fn scenario(name: &str) -> ScenarioFile {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../sim/scenarios");
    ScenarioFile::read(&format!("{folder}/{name}.toml")).expect("scenario").scenario
}

/// Straight lines, slower in the second half by a third.
fn plan(scenario: &ScenarioFile) -> PlanFile {
    let nodes = 13;
    let share = |node: usize| (node as f64 / 12.0).min(1.0);
    let line = |start: &[f64], goal: &[f64], s: f64| start.iter().zip(goal).map(|(a, b)| a + (b - a) * s).collect();
    let agents = (scenario.agents.iter())
        .map(|agent| AgentPlan {
            name: agent.name.clone(),
            path: (0..nodes).map(|node| line(&agent.start, &agent.goal, share(node))).collect(),
            ..AgentPlan::default()
        })
        .collect();
    let mut times = vec![0.0];
    for node in 1..nodes {
        times.push(times[node - 1] + if node <= 6 { 10.0 } else { 15.0 });
    }
    PlanFile { duration: times[nodes - 1], times: Some(times), agents, ..PlanFile::default() }
}

fn written(name: &str, text: &str) -> String {
    let path = format!("{}/{name}", env!("CARGO_TARGET_TMPDIR"));
    std::fs::write(&path, text).expect("write");
    std::fs::read_to_string(&path).expect("read")
}

#[test]
fn waypoints_have_twelve_columns_home_first_and_no_nan() {
    let scenario = scenario("square8-detection");
    let missions = mission::missions(&scenario, &plan(&scenario)).expect("missions");
    let text = written("square8.waypoints", &missions[0].to_waypoints());
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some("QGC WPL 110"));
    let rows: Vec<Vec<f64>> =
        lines.map(|line| line.split('\t').map(|word| word.parse().expect("a number")).collect()).collect();
    for (index, row) in rows.iter().enumerate() {
        assert_eq!(row.len(), 12, "{row:?}");
        assert_eq!(row[0], index as f64);
        assert!(row.iter().all(|number| number.is_finite()));
    }
    let commands: Vec<f64> = rows.iter().map(|row| row[3]).collect();
    let mut expected = vec![16.0, 22.0, 16.0, 178.0];
    expected.extend([16.0; 6]);
    expected.push(178.0);
    expected.extend([16.0; 6]);
    assert_eq!(commands, expected);
    // Home is the origin; the start lies 80 m east and 100 m north of it, 30 m above home.
    assert_eq!(rows[0][8..11], [-35.363262, 149.165237, 0.0]);
    assert_eq!((rows[0][2], rows[1][2], rows[2][2]), (0.0, 3.0, 3.0));
    let (north, east) = ((rows[2][8] + 35.363262) * 110_948.0, (rows[2][9] - 149.165237) * 90_908.0);
    assert!((north - 100.0).abs() < 0.1 && (east - 80.0).abs() < 0.1, "{north} {east}");
    assert_eq!(rows[2][10], 30.0);
    // 958.02 m in 12 legs: 7.983 m/s in legs of 10 s, 5.322 m/s in legs of 15 s.
    assert_eq!(rows[3][4..8], [1.0, 7.983, -1.0, 0.0]);
    assert_eq!(rows[10][5], 5.322);
}

#[test]
fn a_ground_station_finds_all_it_needs() {
    let scenario = scenario("wight");
    let missions = mission::missions(&scenario, &plan(&scenario)).expect("missions");
    let json: Value = serde_json::from_str(&written("wight.plan", &missions[0].to_qgc_plan())).expect("JSON");
    assert_eq!((&json["fileType"], &json["version"]), (&Value::from("Plan"), &Value::from(1)));
    let mission = &json["mission"];
    assert_eq!(mission["globalPlanAltitudeMode"], 1);
    assert_eq!(mission["plannedHomePosition"], serde_json::json!([50.62, -1.38, 0.0]));
    let items = mission["items"].as_array().expect("items");
    for (index, item) in items.iter().enumerate() {
        assert_eq!(item["doJumpId"], index + 1);
        assert_eq!(item["params"].as_array().map(Vec::len), Some(7));
        let null = item["command"] != 178;
        assert_eq!(item["params"][3].is_null(), null, "{item}");
    }
    assert_eq!(items[0]["command"], 22);
    assert_eq!(items[1]["Altitude"], 60.0);
    let fence = &json["geoFence"];
    let circles = fence["circles"].as_array().expect("circles");
    assert_eq!(circles.len(), 2);
    assert_eq!((&circles[0]["inclusion"], &circles[0]["circle"]["radius"]), (&Value::from(false), &2600.0.into()));
    // A region forbidden for a while only is no fence.
    let mut timed = scenario.clone();
    timed.regions[0].window.until = 5000.0;
    let missions = mission::missions(&timed, &plan(&scenario)).expect("missions");
    assert_eq!(missions[0].fences.len(), 1);
}

#[test]
fn polygons_and_regions_to_stay_in_are_fences() {
    let mut scenario = scenario("wight");
    let corners = vec![[1.0, 1.0], [1.0, 3.0], [2.0, 1.0]];
    scenario.regions[0].outline = Outline::Polygon(corners);
    scenario.regions[1].side = Side::Inside;
    let plan = plan(&scenario);
    let missions = mission::missions(&scenario, &plan).expect("missions");
    let json: Value = serde_json::from_str(&missions[0].to_qgc_plan()).expect("JSON");
    let fence = &json["geoFence"];
    assert_eq!((&fence["version"], fence["circles"].as_array().map(Vec::len)), (&Value::from(2), Some(1)));
    assert_eq!(fence["circles"][0]["inclusion"], true);
    let polygon = &fence["polygons"][0];
    assert_eq!((&polygon["inclusion"], &polygon["version"]), (&Value::from(false), &Value::from(1)));
    let corners: Vec<[f64; 2]> =
        serde_json::from_value(polygon["polygon"].clone()).expect("latitudes and longitudes");
    // The clockwise corners turned round: (2, 1), (1, 3), (1, 1); the origin lies at 50.62, -1.38, the unit is 1 km.
    assert_eq!(corners.len(), 3);
    assert!((corners[1][0] - 50.62 - 3.0 / 111.24).abs() < 1e-4, "{corners:?}");
    assert!((corners[0][1] - corners[1][1] - 1.0 / 70.8).abs() < 1e-4, "{corners:?}");
    let map: Value = serde_json::from_str(&geojson::to_geojson(&scenario, &plan).expect("map")).expect("JSON");
    let features = map["features"].as_array().expect("features");
    let regions: Vec<&Value> = features.iter().filter(|one| one["properties"]["kind"] == "region").collect();
    assert_eq!(
        (&regions[0]["properties"]["side"], &regions[1]["properties"]["side"]),
        (&"outside".into(), &"inside".into())
    );
    let ring: Vec<[f64; 2]> = serde_json::from_value(regions[0]["geometry"]["coordinates"][0].clone()).expect("ring");
    assert_eq!((ring.len(), ring.first()), (4, ring.last()));
    let doubled_area: f64 = ring.windows(2).map(|pair| pair[0][0] * pair[1][1] - pair[1][0] * pair[0][1]).sum();
    assert!(doubled_area > 0.0 && regions[0]["properties"]["radius_m"].is_null());
}

#[test]
fn three_dimensions_fly_above_the_sea() {
    let scenario = scenario("volume8-detection");
    let missions = mission::missions(&scenario, &plan(&scenario)).expect("missions");
    let waypoint = &missions[0].items[1];
    assert_eq!((waypoint.frame, waypoint.altitude_m), (0, 60.0));
    let json: Value = serde_json::from_str(&missions[0].to_qgc_plan()).expect("JSON");
    assert_eq!(json["mission"]["globalPlanAltitudeMode"], 2);
    assert_eq!(json["mission"]["items"][1]["AltitudeMode"], 2);
    assert!(
        missions[0].to_waypoints().contains("\n0\t1\t0\t16\t0\t0\t0\t0\t-35.36326200\t149.16523700\t30.000\t1\n")
    );
}

#[test]
fn each_agent_has_a_file_of_its_own() {
    let scenario = scenario("square8-team");
    let missions = mission::missions(&scenario, &plan(&scenario)).expect("missions");
    let names: Vec<String> = missions.iter().map(|one| mission::file_name(&one.agent, 2, "plan")).collect();
    assert_eq!(names, ["mission-uav1.plan", "mission-uav2.plan"]);
    assert_eq!(mission::file_name("uav1", 1, "waypoints"), "mission.waypoints");
    assert_eq!(mission::file_name("../a b", 2, "plan"), "mission-.._a_b.plan");
}

#[test]
fn a_map_has_longitude_first_and_closed_rings() {
    let scenario = scenario("wight");
    let text = geojson::to_geojson(&scenario, &plan(&scenario)).expect("map");
    let json: Value = serde_json::from_str(&written("wight.geojson", &text)).expect("JSON");
    let features = json["features"].as_array().expect("features");
    let count = |kind: &str| features.iter().filter(|feature| feature["properties"]["kind"] == kind).count();
    let counts = ["path", "start", "goal", "sensor", "sensor_track", "region"].map(count);
    assert_eq!(counts, [1, 1, 1, 9, 1, 2]);
    let path = &features[0]["geometry"]["coordinates"];
    assert_eq!(path.as_array().map(Vec::len), Some(13));
    let (longitude, latitude) = (path[0][0].as_f64().expect("number"), path[0][1].as_f64().expect("number"));
    assert!((-1.38..-1.2).contains(&longitude) && (50.6..50.8).contains(&latitude));
    let ring = features.iter().find(|feature| feature["properties"]["kind"] == "region").expect("region");
    let ring: Vec<[f64; 2]> = serde_json::from_value(ring["geometry"]["coordinates"][0].clone()).expect("ring");
    assert_eq!((ring.len(), ring.first()), (geojson::CORNERS as usize + 1, ring.last()));
    let doubled_area: f64 = ring.windows(2).map(|pair| pair[0][0] * pair[1][1] - pair[1][0] * pair[0][1]).sum();
    assert!(doubled_area > 0.0, "RFC 7946 wants outer rings counter-clockwise");
}

#[test]
fn a_scenario_without_a_place_on_earth_makes_no_mission() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../sim/scenarios");
    let text = std::fs::read_to_string(format!("{folder}/square8-cep.toml")).expect("scenario");
    let placeless: Vec<&str> = text.lines().filter(|line| !line.contains("_deg")).collect();
    let scenario = ScenarioFile::parse("here.toml", &placeless.join("\n")).expect("can be planned").scenario;
    let error = mission::missions(&scenario, &plan(&scenario)).expect_err("no place").to_string();
    assert!(error.starts_with("here.toml: does not say where on the Earth"), "{error}");
    geojson::to_geojson(&scenario, &plan(&scenario)).expect_err("no place");
}
