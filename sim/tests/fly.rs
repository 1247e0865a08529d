//! Flights as a person meets them: the main job, faults, missions, a signal, an autopilot elsewhere, a browser that looks on.

#![cfg(unix)]
#![expect(clippy::unwrap_used, reason = "the helpers of a test may fail as a test does")]

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, ChildStderr, Command, Output, Stdio};
use std::time::Duration;

use tempfile::TempDir;

fn scenario(name: &str) -> String {
    format!("{}/scenarios/{name}.toml", env!("CARGO_MANIFEST_DIR"))
}

fn command(room: &TempDir, args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_quietpath"));
    command.current_dir(room).args(args).stdin(Stdio::null());
    command
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Runs to the end, at the goal; what it said.
fn flown(room: &TempDir, args: &[&str]) -> String {
    let output = command(room, args).output().unwrap();
    assert!(output.status.success(), "{}{}", text(&output.stdout), text(&output.stderr));
    let words = text(&output.stdout);
    assert!(words.contains("at the goal"), "{words}");
    words
}

/// Number behind a label of the summary.
fn figure(words: &str, label: &str) -> f64 {
    let line = words.lines().find(|line| line.starts_with(label)).unwrap_or_else(|| panic!("{label} in {words}"));
    line[label.len()..].split_whitespace().next().unwrap().parse().unwrap()
}

fn has(room: &TempDir, names: &[&str]) {
    for name in names {
        let size = std::fs::metadata(room.path().join(name)).map(|file| file.len()).unwrap_or_default();
        assert!(size > 100, "{name}: {size} bytes");
    }
}

#[test]
fn without_a_word_the_main_job_is_flown() {
    let room = TempDir::new().unwrap();
    let words = flown(&room, &[]);
    assert!(figure(&words, "plans in flight") >= 15.0, "{words}");
    assert!(figure(&words, "frames") > 1e5, "{words}");
    has(&room, &["out/report.html", "out/plan.json", "out/flown.json", "out/steps/plan-15.json", "out/mission.plan"]);
    has(
        &room,
        &["out/mission.waypoints", "out/path.geojson", "out/landscape.png", "out/series.svg", "out/flight.log"],
    );
    // The vehicle jams as it was planned: the budget is used, and kept.
    let page = std::fs::read_to_string(room.path().join("out/report.html")).unwrap();
    assert!(page.contains("\"jam_budget\"") && page.contains("SET_POSITION_TARGET_GLOBAL_INT"));
}

#[test]
fn a_mission_arrives_over_a_bad_link() {
    let room = TempDir::new().unwrap();
    let file = scenario("square8-detection");
    let args = ["fly", &file, "--like", "ardupilot", "--mode", "mission", "--loss", "0.1", "--out", "."];
    let words = flown(&room, &args);
    let line = words.lines().find(|line| line.starts_with("frames")).unwrap().to_owned();
    let lost: f64 = line.rsplit(", ").next().unwrap().split(' ').next().unwrap().parse().unwrap();
    assert!((5.0..15.0).contains(&lost), "{line}");
    assert_eq!(words.replace(took(&words), ""), {
        let again = flown(&room, &args);
        again.replace(took(&again), "")
    });
}

/// The line that differs from flight to flight.
fn took(words: &str) -> &str {
    words.lines().find(|line| line.starts_with("took")).unwrap()
}

#[test]
fn a_team_flies_one_after_the_other_and_is_shown_together() {
    let room = TempDir::new().unwrap();
    flown(&room, &["fly", &scenario("square8-team"), "--out", "."]);
    let track = std::fs::read_to_string(room.path().join("flown.json")).unwrap();
    let track: serde_json::Value = serde_json::from_str(&track).unwrap();
    let agents = track["agents"].as_array().unwrap();
    assert_eq!(agents.len(), 2);
    let plan = std::fs::read_to_string(room.path().join("plan.json")).unwrap();
    let plan: serde_json::Value = serde_json::from_str(&plan).unwrap();
    for (flown, planned) in agents.iter().zip(plan["agents"].as_array().unwrap()) {
        let last = |agent: &serde_json::Value| agent["path"].as_array().unwrap().last().unwrap().clone();
        let (flown, planned) = (last(flown), last(planned));
        let off = |axis: usize| flown[axis].as_f64().unwrap() - planned[axis].as_f64().unwrap();
        // A length unit is 100 m: both are at their goals, and neither is where it was only planned to be.
        assert!((1e-9..0.05).contains(&off(0).hypot(off(1))), "{flown} {planned}");
    }
    let log = std::fs::read_to_string(room.path().join("flight.log")).unwrap();
    assert!(log.contains("uav1: flying the plan") && log.contains("uav2: flying the plan"), "{log}");
}

fn signal(child: &Child, name: &str) {
    assert!(Command::new("kill").args([format!("-{name}"), child.id().to_string()]).status().unwrap().success());
}

#[test]
fn a_signal_ends_the_flight_and_what_was_flown_is_there() {
    let room = TempDir::new().unwrap();
    let file = scenario("square8-detection");
    let args = ["fly", &file, "--speedup", "5", "--out", ".", "--view"];
    let mut child = command(&room, &args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut page = Page::of(&mut child);
    page.events(1);
    signal(&child, "INT");
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{}", text(&output.stderr));
    let words = text(&output.stdout);
    assert!(words.contains("stopped: ended by a signal"), "{words}");
    has(&room, &["report.html", "flown.json", "flight.log"]);
}

#[test]
fn an_autopilot_elsewhere_takes_the_place_of_the_simulated_one() {
    let room = TempDir::new().unwrap();
    let file = scenario("square8-detection");
    let port = std::net::UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port().to_string();
    let (here, there) = (format!("udpin:127.0.0.1:{port}"), format!("udpout:127.0.0.1:{port}"));
    let vehicle = ["autopilot", "--connect", &there, "--like", "ardupilot", "--scenario", &file];
    let pilot = ["--pilot", "takeoff", "--speedup", "20"];
    let mut elsewhere = command(&room, &[&vehicle[..], &pilot].concat());
    let mut elsewhere = elsewhere.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let args = ["fly", &file, "--connect", &here, "--like", "ardupilot", "--speedup", "20", "--out", "."];
    let output: Output = command(&room, &args).output().unwrap();
    elsewhere.kill().unwrap();
    elsewhere.wait().unwrap();
    let words = text(&output.stdout);
    assert!(output.status.success() && words.contains("at the goal"), "{words}{}", text(&output.stderr));
    has(&room, &["report.html", "flown.json"]);
}

#[test]
fn what_cannot_be_flown_is_said() {
    let room = TempDir::new().unwrap();
    let says = |args: &[&str], words: &str| {
        let output = command(&room, args).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{}", text(&output.stdout));
        assert!(text(&output.stderr).contains(words), "{}", text(&output.stderr));
    };
    let file = scenario("square8-detection");
    let source = std::fs::read_to_string(&file).unwrap();
    let nowhere: Vec<&str> = source.lines().filter(|line| !line.starts_with("latitude_deg")).collect();
    let nowhere: Vec<&str> = nowhere.into_iter().filter(|line| !line.starts_with("longitude_deg")).collect();
    std::fs::write(room.path().join("nowhere.toml"), nowhere.join("\n")).unwrap();
    says(&["fly", "nowhere.toml"], "add latitude_deg, longitude_deg and altitude_m to [frame]");
    says(&["fly", &file, "--loss", "1.5"], "--loss 1.5 is no share");
    says(&["fly", &file, "--speedup", "-3"], "--speedup is how many times faster than time it flies");
    says(&["fly", &file, "--connect", "carrier pigeon"], "carrier pigeon");
    says(&["view", "nowhere.toml"], "is no record");
}

/// A page that a program shows, and how it is asked for.
struct Page {
    address: String,
    _rest: BufReader<ChildStderr>,
}

impl Page {
    /// Reads the address from what a program says.
    fn of(child: &mut Child) -> Self {
        let mut rest = BufReader::new(child.stderr.take().unwrap());
        let mut line = String::new();
        while !line.contains("http://") {
            line.clear();
            assert!(rest.read_line(&mut line).unwrap() > 0, "no address");
        }
        let address = line.split("http://").nth(1).unwrap().split('/').next().unwrap().to_owned();
        assert!(address.starts_with("127.0.0.1:"), "{address}");
        Self { address, _rest: rest }
    }

    fn open(&self, request: &str) -> TcpStream {
        let mut stream = TcpStream::connect(&self.address).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
        stream.write_all(request.as_bytes()).unwrap();
        stream
    }

    /// The answer to a request.
    fn ask(&self, first: &str, headers: &str) -> String {
        let mut answer = Vec::new();
        self.open(&format!("{first} HTTP/1.1\r\n{headers}Connection: close\r\n\r\n"))
            .read_to_end(&mut answer)
            .unwrap();
        text(&answer)
    }

    /// The last instants of so many events, s of the scenario.
    fn events(&mut self, count: usize) -> Vec<f64> {
        let stream = self.open(&format!("GET /events HTTP/1.1\r\nHost: {}\r\n\r\n", self.address));
        let lines = BufReader::new(stream).lines().map_while(Result::ok);
        let events = lines.filter_map(|line| line.strip_prefix("data:").map(str::to_owned)).take(count);
        let last = |event: String| {
            let data: serde_json::Value = serde_json::from_str(event.trim()).unwrap();
            data["time"][1].as_f64().unwrap()
        };
        events.map(last).collect()
    }
}

#[test]
fn a_page_shows_the_flight_to_this_machine_alone() {
    let room = TempDir::new().unwrap();
    let file = scenario("square8-detection");
    let args = ["fly", &file, "--speedup", "5", "--out", ".", "--view"];
    let mut child = command(&room, &args).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let mut page = Page::of(&mut child);
    let times = page.events(2);
    assert!(times.len() == 2 && times.windows(2).all(|pair| pair[0] < pair[1]), "{times:?}");
    let host = format!("Host: {}\r\n", page.address);
    let good = page.ask("GET /", &host);
    assert!(good.starts_with("HTTP/1.1 200") && good.contains("data-live=\"/events\""), "{:.300}", good);
    assert!(good.contains("connect-src 'self'") && good.contains("square8-detection"));
    let refused = |first: &str, headers: &str, status: &str| {
        let answer = page.ask(first, headers);
        assert!(answer.starts_with(&format!("HTTP/1.1 {status}")), "{first} {headers}: {answer:.200}");
        assert!(!answer.contains("Access-Control-Allow-Origin"));
    };
    refused("GET /", "Host: quietpath.example\r\n", "403");
    refused("GET /events", &format!("{host}Origin: http://quietpath.example\r\n"), "403");
    refused("GET /events", &format!("{host}Origin: null\r\n"), "403");
    refused("POST /", &format!("{host}Content-Length: 0\r\n"), "405");
    refused("PUT /events", &format!("{host}Content-Length: 0\r\n"), "405");
    refused("GET /../Cargo.toml", &host, "404");
    refused("GET /%2e%2e/Cargo.toml", &host, "404");
    refused("GET /report.html", &host, "404");
    let other = format!("http://{}/", page.address);
    assert!(other.starts_with("http://127.0.0.1:"));
    signal(&child, "TERM");
    assert_eq!(child.wait().unwrap().code(), Some(1));
    assert!(Path::new(&room.path().join("report.html")).is_file());
}
