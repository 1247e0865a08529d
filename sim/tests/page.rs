//! The report in a browser: headless Chromium loads it, moves the slider, and tells what it saw.
//!
//! Needs `chromium` on the path (`apt-get install chromium`), so these tests run where they are asked for:
//! `cargo xtask test`, or `cargo test -p quietpath-sim --test page -- --ignored`.

#![expect(clippy::unwrap_used, reason = "the helpers of a test may fail as a test does")]

mod devtools;

use std::io::{BufRead as _, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};

use devtools::Browser;
use serde_json::Value;
use tempfile::TempDir;

/// A browser that talks to nobody.
const QUIET: [&str; 9] = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--hide-scrollbars",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
];

/// Notes whatever goes wrong on the page; stands before all of its scripts.
const WATCH: &str = "<script>
window.problems = [];
addEventListener('error', (event) => problems.push(String(event.message)));
addEventListener('unhandledrejection', (event) => problems.push(String(event.reason)));
addEventListener('securitypolicyviolation', (event) => problems.push('policy: ' + event.blockedURI));
for (const level of ['error', 'warn']) {
  const usual = console[level];
  console[level] = (...words) => { problems.push(words.join(' ')); usual(...words); };
}
</script>";

/// Uses the page as a person would, and leaves what it saw in an attribute; stands behind all of its scripts.
const PROBE: &str = "<script>
const rows = () => Object.fromEntries([...document.querySelectorAll('#positions tbody tr')].map((row) => [row.cells[0].textContent, [row.cells[1].textContent, row.cells[2].textContent]]));
const picture = () => document.querySelector('#map canvas').toDataURL();
const values = () => [...document.querySelectorAll('#charts .u-value')].map((cell) => cell.textContent).join();
const look = () => ({ rows: rows(), picture: picture(), values: values(), now: document.getElementById('now').textContent });
const wait = (ms) => new Promise((done) => setTimeout(done, ms));
(async () => {
  await wait(300);
  const seen = { width: innerWidth, wide: document.documentElement.scrollWidth, dark: matchMedia('(prefers-color-scheme: dark)').matches };
  seen.before = look();
  const slider = document.getElementById('slider');
  slider.value = 600;
  slider.dispatchEvent(new Event('input', { bubbles: true }));
  await wait(200);
  seen.after = look();
  const select = document.getElementById('metric');
  seen.metrics = [...select.options].map((option) => option.text);
  seen.landscapes = [];
  for (const option of select.options) {
    select.value = option.value;
    select.dispatchEvent(new Event('change', { bubbles: true }));
    await wait(60);
    seen.landscapes.push(picture().length > 5000 ? document.getElementById('scale-label').textContent + ':' + document.querySelectorAll('#ticks span').length : 'blank');
  }
  document.getElementById('closer').click();
  await wait(60);
  seen.zoomed = picture() !== seen.after.picture;
  const over = document.querySelector('#charts .u-over');
  const box = over.getBoundingClientRect();
  over.dispatchEvent(new MouseEvent('mousemove', { bubbles: true, clientX: box.left + 0.25 * box.width, clientY: box.top + 10 }));
  await wait(100);
  seen.hovered = look();
  seen.slider = slider.value;
  seen.charts = document.querySelectorAll('#charts canvas').length;
  seen.takeovers = !document.getElementById('takeovers').hidden;
  seen.wire = document.getElementById('wire-section').hidden ? 0 : document.querySelectorAll('#wire tbody tr').length;
  seen.tables = Object.fromEntries(['figures', 'margins', 'violations', 'provenance'].map((id) => [id, document.querySelectorAll('#' + id + ' tr').length]));
  seen.paper = getComputedStyle(document.body).backgroundColor;
  for (const part of [seen.before, seen.after, seen.hovered]) part.picture = [...part.picture].reduce((sum, letter) => (31 * sum + letter.charCodeAt(0)) | 0, 0);
  seen.problems = problems;
  top.document.documentElement.setAttribute('data-seen', encodeURIComponent(JSON.stringify(seen)));
})();
</script>";

/// How the browser is held.
#[derive(Clone, Copy)]
struct Screen {
    /// Width and height of the page. Windows of the browser are no narrower than 500: a phone is a frame in one.
    size: [u32; 2],
    dark: bool,
}

/// Loads a page with the probe in it; what the probe saw, and what the browser complained of.
fn visit(folder: &Path, page: &str, screen: Screen) -> Value {
    let text = std::fs::read_to_string(folder.join(page)).unwrap();
    let text = text.replacen("<head>", &format!("<head>{WATCH}"), 1);
    let end = text.rfind("</body>").unwrap();
    let probed = folder.join("probed.html");
    let text = format!("{}{PROBE}{}", &text[..end], &text[end..]);
    let [width, height] = screen.size;
    let framed = text.replace('&', "&amp;").replace('"', "&quot;");
    let frame = format!(
        "<!doctype html><iframe width={width} height={height} style=\"border:0\" srcdoc=\"{framed}\"></iframe>"
    );
    std::fs::write(&probed, if width < 500 { frame } else { text }).unwrap();
    let mut command = Command::new("chromium");
    command
        .args(QUIET)
        .args(["--enable-logging=stderr", "--virtual-time-budget=20000", "--dump-dom"])
        .arg(format!("--user-data-dir={}", folder.join("browser").display()))
        .arg(format!("--window-size={},{}", width.max(500), height));
    if screen.dark {
        command.arg("--blink-settings=preferredColorScheme=0");
    }
    let output = command.arg(format!("file://{}", probed.display())).stdin(Stdio::null()).output();
    let output = output.expect("chromium runs: apt-get install chromium");
    let (dom, log) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    let complaints: Vec<&str> = log.lines().filter(|line| line.contains(":CONSOLE")).collect();
    assert!(complaints.is_empty(), "{complaints:#?}");
    let seen = dom.split_once("data-seen=\"").expect("the probe came to its end").1.split_once('"').unwrap().0;
    let seen: Value = serde_json::from_slice(&decoded(seen)).unwrap();
    assert_eq!(seen["problems"], serde_json::json!([]));
    seen
}

/// Percent-decoded bytes.
fn decoded(text: &str) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut rest = text.bytes();
    while let Some(byte) = rest.next() {
        if byte == b'%' {
            let digits: String = rest.by_ref().take(2).map(char::from).collect();
            bytes.push(u8::from_str_radix(&digits, 16).unwrap());
        } else {
            bytes.push(byte);
        }
    }
    bytes
}

/// Flies a scenario in a folder of its own.
fn flown(name: &str) -> TempDir {
    let room = TempDir::new().unwrap();
    let scenario = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("scenarios/{name}.toml"));
    let mut command = Command::new(env!("CARGO_BIN_EXE_quietpath"));
    let output = command.current_dir(&room).arg("fly").arg(scenario).args(["--out", "."]).output().unwrap();
    assert!(output.status.success());
    room
}

/// Plans a scenario in a folder of its own.
fn planned(name: &str) -> TempDir {
    let room = TempDir::new().unwrap();
    let scenario = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("scenarios/{name}.toml"));
    let mut command = Command::new(env!("CARGO_BIN_EXE_quietpath"));
    let status =
        command.current_dir(&room).arg("plan").arg(scenario).args(["--once", "--out", "."]).status().unwrap();
    assert!(status.success());
    room
}

#[test]
#[ignore = "needs chromium"]
fn the_slider_moves_sensors_vehicles_and_diagrams() {
    let room = planned("wight-jam");
    let seen = visit(room.path(), "report.html", Screen { size: [1280, 900], dark: false });
    let (before, after) = (&seen["before"], &seen["after"]);
    for who in ["uav1", "s1"] {
        assert!(before["rows"][who].is_array(), "{}", before["rows"]);
    }
    let moved: Vec<&String> = before["rows"]
        .as_object()
        .unwrap()
        .iter()
        .filter(|(who, at)| after["rows"][*who] != **at)
        .map(|(who, _)| who)
        .collect();
    assert!(moved.iter().any(|who| who.starts_with("uav")) && moved.len() > 1, "moved: {moved:?}");
    for what in ["picture", "values", "now"] {
        assert_ne!(before[what], after[what], "{what}");
    }
    assert_eq!(seen["zoomed"], true);
    // A quarter of the way into a diagram is a quarter of the flight, on the slider too.
    let quarter: f64 = seen["slider"].as_str().unwrap().parse().unwrap();
    assert!((quarter - 250.0).abs() < 6.0, "{quarter}");
    assert_ne!(after["values"], seen["hovered"]["values"]);
    assert_ne!(after["rows"]["uav1"], seen["hovered"]["rows"]["uav1"]);
}

#[test]
#[ignore = "needs chromium"]
fn every_metric_has_a_landscape_and_every_table_rows() {
    let room = planned("square8-energy");
    let seen = visit(room.path(), "report.html", Screen { size: [1280, 900], dark: false });
    assert_eq!(seen["metrics"].as_array().unwrap().len(), 10, "{}", seen["metrics"]);
    for landscape in seen["landscapes"].as_array().unwrap() {
        let (label, ticks) = landscape.as_str().unwrap().rsplit_once(':').expect("a landscape");
        assert!(!label.is_empty() && ticks.parse::<u32>().unwrap() >= 2, "{landscape}");
    }
    assert!(seen["charts"].as_u64().unwrap() >= 6, "{}", seen["charts"]);
    for table in ["figures", "margins", "violations", "provenance"] {
        assert!(seen["tables"][table].as_u64().unwrap() > 4, "{table}: {}", seen["tables"]);
    }
}

#[test]
#[ignore = "needs chromium"]
fn a_flight_shows_what_went_over_the_wire_and_when_plans_took_over() {
    let room = flown("square8-detection");
    let seen = visit(room.path(), "report.html", Screen { size: [1280, 900], dark: false });
    assert!(seen["wire"].as_u64().unwrap() > 10, "{}", seen["wire"]);
    assert_eq!(seen["takeovers"], true);
    let (before, after) = (&seen["before"], &seen["after"]);
    assert_ne!(before["picture"], after["picture"], "the track grows with the time");
    let planned = planned("square8-energy");
    let seen = visit(planned.path(), "report.html", Screen { size: [1280, 900], dark: false });
    assert_eq!((&seen["wire"], &seen["takeovers"]), (&0.into(), &false.into()));
}

/// A flight that goes on, until it is dropped.
struct Flight(Child);

impl Drop for Flight {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// The live page: time, table and diagrams go on with the flight, and nothing goes wrong.
#[test]
#[ignore = "needs chromium"]
fn a_flight_that_goes_on_moves_in_the_browser() {
    let room = TempDir::new().unwrap();
    let scenario = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios/square8-detection.toml");
    let mut command = Command::new(env!("CARGO_BIN_EXE_quietpath"));
    command.current_dir(&room).arg("fly").arg(scenario).args(["--speedup", "2", "--view", "--out", "."]);
    let mut flight = Flight(command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap());
    let mut line = String::new();
    BufReader::new(flight.0.stderr.take().unwrap()).read_line(&mut line).unwrap();
    let address = &line[line.find("http://").expect("an address")..];
    // Before the vehicle flies there is a page that waits, and loads itself again.
    let mut browser = Browser::open(&QUIET, room.path(), address.trim());
    let loaded = browser.until("JSON.parse(document.getElementById('data').textContent).time[1]");
    let shown = "parseFloat(document.getElementById('now').textContent)";
    let [place, values] = ["#positions tbody", "#charts"]
        .map(|part| format!("[...document.querySelectorAll('{part} td')].map((cell) => cell.textContent).join()"));
    let before = browser.until(&format!("[{place}, {values}]"));
    browser.until(&format!("{shown} > {loaded} + 5"));
    browser.until(&format!("{place} !== {} && {values} !== {}", before[0], before[1]));
    assert!(browser.problems.is_empty(), "{:#?}", browser.problems);
}

#[test]
#[ignore = "needs chromium"]
fn a_phone_in_the_dark_shows_all_of_it() {
    let room = planned("square8-team");
    let seen = visit(room.path(), "report.html", Screen { size: [390, 844], dark: true });
    assert_eq!((&seen["width"], &seen["wide"]), (&390.into(), &390.into()));
    assert_eq!(seen["dark"], true);
    assert_eq!(seen["paper"], "rgb(20, 23, 26)");
    let light = visit(room.path(), "report.html", Screen { size: [390, 844], dark: false });
    assert_eq!(light["paper"], "rgb(255, 255, 255)");
}
