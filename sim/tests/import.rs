//! Scenarios from the files of others, and advice on them.

#![expect(clippy::unwrap_used, reason = "the helpers of a test may fail as a test does")]

use std::path::Path;
use std::process::{Command, Output, Stdio};

use tempfile::TempDir;

fn run(room: &TempDir, args: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_quietpath"));
    command.current_dir(room).args(args).stdin(Stdio::null()).output().unwrap()
}

fn good(room: &TempDir, args: &[&str]) -> String {
    let output = run(room, args);
    assert!(output.status.success(), "{args:?}\n{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr)
}

fn scenario(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios").join(name);
    path.to_str().unwrap().to_owned()
}

/// A number of a scenario file that stands behind a key.
fn list(text: &str, key: &str) -> Vec<f64> {
    let line = text.lines().find(|line| line.starts_with(key)).unwrap();
    let numbers = line.split(['[', ']']).nth(1).unwrap();
    numbers.split(',').map(|number| number.trim().parse().unwrap()).collect()
}

#[test]
fn what_the_program_writes_comes_back_where_it_was() {
    let room = TempDir::new().unwrap();
    good(&room, &["plan", &scenario("wight.toml"), "--once", "--out", "wight"]);
    let words = good(&room, &["import", "wight/mission.plan", "wight/path.geojson", "--out", "back.toml"]);
    assert!(words.contains("wrote back.toml"), "{words}");
    let [was, is] = [scenario("wight.toml"), room.path().join("back.toml").to_str().unwrap().to_owned()]
        .map(|path| std::fs::read_to_string(path).unwrap());
    for key in ["start = ", "goal = "] {
        let metres = |text: &str| {
            let unit_m: f64 =
                text.lines().find_map(|line| line.strip_prefix("unit_m = ")).unwrap().trim().parse().unwrap();
            list(text, key).iter().map(|part| part * unit_m).collect::<Vec<_>>()
        };
        for (a, b) in metres(&was).iter().zip(metres(&is)) {
            assert!((a - b).abs() < 1.0, "{key}{a} {b}");
        }
    }
    good(&room, &["plan", "back.toml", "--plan", "plan.json"]);
}

#[test]
fn tables_and_maps_become_a_scenario_that_can_be_planned() {
    let room = TempDir::new().unwrap();
    let put = |name: &str, text: &str| std::fs::write(room.path().join(name), text).unwrap();
    put("sensors.csv", "name,lat,lon\nmast \"A\",47.400,8.500\nhut,47.405,8.507\ntower,47.395,8.510\n");
    put(
        "zones.kml",
        "<kml xmlns=\"http://www.opengis.net/kml/2.2\"><Document><Placemark><name>dented</name><Polygon><outerBoundaryIs>\
         <LinearRing><coordinates>8.502,47.400 8.504,47.400 8.503,47.401 8.504,47.402 8.502,47.402 8.502,47.400</coordinates>\
         </LinearRing></outerBoundaryIs></Polygon></Placemark></Document></kml>",
    );
    let words = good(&room, &["import", "sensors.csv", "zones.kml", "--out", "s.toml"]);
    assert!(words.contains("3 sensors, 1 regions") && words.contains("dented is not convex"), "{words}");
    let text = std::fs::read_to_string(room.path().join("s.toml")).unwrap();
    assert!(text.contains("name = \"mast \\\"A\\\"\"") && text.contains("# assumed"), "{text}");
    good(&room, &["plan", "s.toml", "--out", "out"]);
    let again = run(&room, &["import", "sensors.csv", "--out", "s.toml"]);
    assert_eq!(again.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&again.stderr).contains("s.toml exists already"));
    put("plane.csv", "name,east_m,north_m\na,10,20\n");
    let mixed = run(&room, &["import", "sensors.csv", "plane.csv", "--out", "m.toml"]);
    // The places on the Earth give an origin, from which metres are counted.
    assert!(mixed.status.success());
    put("empty.kml", "<kml xmlns=\"http://www.opengis.net/kml/2.2\"><Document></Document></kml>");
    let nothing = run(&room, &["import", "empty.kml"]);
    assert!(String::from_utf8_lossy(&nothing.stderr).contains("nothing to import"));
}

#[test]
fn advice_ends_with_what_it_found() {
    let room = TempDir::new().unwrap();
    let calm = good(&room, &["check", &scenario("square8-detection.toml")]);
    assert!(calm.contains("nothing to advise") && calm.contains("slack until time.max"), "{calm}");
    let text = std::fs::read_to_string(scenario("square8-detection.toml")).unwrap();
    let wall = "\n[[region]]\npolygon = [[4.9, -1.0], [5.1, -1.0], [5.1, 11.0], [4.9, 11.0]]\n";
    std::fs::write(room.path().join("walled.toml"), text + wall).unwrap();
    let output = run(&room, &["check", "walled.toml"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stdout).contains("uav1 cannot reach its goal"));
}
