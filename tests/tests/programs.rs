//! The two programs as people start them: `quietpath-bridge` flies `quietpath autopilot`, over a serial line and over UDP,
//! faster than time.

#![cfg(unix)]

use std::io::{BufRead as _, BufReader, Write as _};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use quietpath_tests::programs::{Folder, built, ended, free_port};

/// Longest that anything may take.
const PATIENCE: Duration = Duration::from_secs(120);
/// How many times faster than time: a machine that is busy with other things must keep up.
const SPEEDUP: &str = "4";

/// The last line of a track as numbers: latitude and longitude.
fn last_place(track: &Path) -> [f64; 2] {
    let text = std::fs::read_to_string(track).expect("a track");
    let line = text.lines().last().expect("a line");
    let numbers: Vec<f64> = line.split(',').skip(1).take(2).filter_map(|part| part.parse().ok()).collect();
    numbers.try_into().expect("a place")
}

fn autopilot(folder: &Folder, arguments: &[&str]) -> Child {
    let mut command = Command::new(built("quietpath"));
    let scenario = folder.path("scenario.toml");
    command.args(["autopilot", "--scenario", &scenario, "--speedup", SPEEDUP, "--jammer", "26", "--track"]);
    command.arg(folder.path("track.csv")).args(arguments).stdout(Stdio::piped()).stderr(Stdio::piped());
    command.spawn().expect("the program runs")
}

fn bridge(folder: &Folder, arguments: &[&str]) -> Child {
    let mut command = Command::new(built("quietpath-bridge"));
    let (scenario, plan) = (folder.path("scenario.toml"), folder.path("plan.json"));
    command.args(["run", "--scenario", &scenario, "--plan", &plan, "--speedup", SPEEDUP, "--arm-jammer", "--config"]);
    command.arg(folder.path("bridge.toml")).args(arguments).stdout(Stdio::piped()).stderr(Stdio::piped());
    command.spawn().expect("the program runs")
}

fn finish(what: &str, child: Child) -> Output {
    ended(child, PATIENCE).unwrap_or_else(|output| panic!("{what} does not end: {output:?}"))
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// A browser's view of a record that is about to be written, and its address.
fn view(record: &str) -> (Child, String) {
    let mut command = Command::new(built("quietpath"));
    command.args(["view", record]).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().expect("the program runs");
    let mut line = String::new();
    let said = child.stderr.as_mut().expect("it speaks");
    BufReader::new(said).read_line(&mut line).expect("it says where");
    let address = line.split("http://").nth(1).and_then(|rest| rest.split('/').next()).expect("an address");
    (child, address.to_owned())
}

/// The last instants of so many events of a page, s of the scenario.
fn instants(page: &str, count: usize) -> Vec<f64> {
    let mut stream = TcpStream::connect(page).expect("it listens");
    stream.set_read_timeout(Some(PATIENCE)).expect("a time limit");
    write!(stream, "GET /events HTTP/1.1\r\nHost: {page}\r\n\r\n").expect("it is asked");
    let lines = BufReader::new(stream).lines().map_while(Result::ok);
    let events = lines.filter_map(|line| line.strip_prefix("data:").map(str::to_owned)).take(count);
    let last = |event: String| {
        let data: serde_json::Value = serde_json::from_str(event.trim()).expect("JSON");
        data["time"][1].as_f64().expect("an instant")
    };
    events.map(last).collect()
}

#[test]
fn a_flight_over_udp_is_steered_recorded_and_replayed() {
    let folder = Folder::new();
    let port = free_port();
    let vehicle = autopilot(
        &folder,
        &["--connect", &format!("udpout:127.0.0.1:{port}"), "--like", "ardupilot", "--pilot", "takeoff"],
    );
    let record = folder.path("flight.jsonl");
    let link = format!("udpin:127.0.0.1:{port}");
    let (looker, page) = view(&record);
    let flight = bridge(&folder, &["--link", &link, "--mode", "guided", "--record", &record]);
    let seen = instants(&page, 2);
    assert!(seen.len() == 2 && seen.windows(2).all(|pair| pair[0] < pair[1]), "{seen:?}");
    let output = finish("the bridge", flight);
    quietpath_tests::programs::end(looker);
    quietpath_tests::programs::end(vehicle);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let track = PathBuf::from(folder.path("track.csv"));
    let [latitude, longitude] = last_place(&track);
    let [north, east] = [(latitude - 47.4) * 111_170.0, (longitude - 8.5) * 75_500.0];
    assert!((north - 10.0).abs() < 5.0 && (east - 90.0).abs() < 5.0, "{north} {east}");
    assert!(std::fs::read_to_string(&track).expect("a track").contains(",Guided,1\n"), "it jams on the way");
    let replay =
        Command::new(built("quietpath-bridge")).args(["replay", "--quiet", &record]).output().expect("it runs");
    assert!(replay.status.success(), "{}", text(&replay.stderr));
}

#[test]
fn a_mission_over_a_serial_line_is_delivered_and_flown() {
    let folder = Folder::new();
    let device = folder.path("ttyACM0");
    let vehicle = autopilot(&folder, &["--connect", &format!("pty:{device}"), "--like", "px4", "--pilot", "mission"]);
    let begin = Instant::now();
    while !Path::new(&device).exists() {
        assert!(begin.elapsed() < PATIENCE, "no device");
        std::thread::sleep(Duration::from_millis(10));
    }
    let flight = bridge(&folder, &["--link", &format!("serial:{device}:921600"), "--mode", "mission"]);
    let output = finish("the bridge", flight);
    let said = quietpath_tests::programs::end(vehicle);
    assert_eq!(output.status.code(), Some(0), "{}\n{said}", text(&output.stderr));
    assert!(said.contains("mode Mission, item 6"), "{said}");
    let [_, longitude] = last_place(Path::new(&folder.path("track.csv")));
    assert!(((longitude - 8.5) * 75_500.0 - 90.0).abs() < 6.0, "{longitude}");
}

#[test]
fn bad_input_of_the_autopilot_is_answered_with_what_would_be_right() {
    let cases: [(&[&str], &str); 5] = [
        (&["--connect", "udp:1", "--like", "px4"], "--connect: `udp` is no kind of link; write serial:"),
        (&["--connect", "udpin:h:1", "--like", "px4", "--loss", "1.5"], "--loss 1.5 is no share"),
        (&["--connect", "udpin:h:1", "--like", "px4", "--speedup", "0"], "a number above 0"),
        (&["--connect", "udpin:h:1", "--like", "px4", "--at", "47.4"], "write latitude and longitude in degrees"),
        (&["--connect", "udpin:h:1", "--like", "px4", "--silent", "9-3"], "it ends before it begins"),
    ];
    for (arguments, says) in cases {
        let output = Command::new(built("quietpath")).arg("autopilot").args(arguments).output().expect("it runs");
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(text(&output.stderr).contains(says), "{arguments:?}: {}", text(&output.stderr));
    }
}
