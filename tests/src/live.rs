//! The bridge as a program, measured while it flies the simulated autopilot over UDP.
//!
//! | figure | how |
//! |---|---|
//! | latency | from an observation that is sent to the bridge's socket to the first setpoint of the plan that it asked for, as it arrives at the vehicle's socket |
//! | load | processor time of the bridge's process over a while of steered flight without planning anew |
//! | endurance | memory and threads of both processes, and the bridge's heartbeats, over a long flight under faults |
//!
//! `cargo xtask live` writes them to `docs/live.md`. Nothing here is a test of time: other work on the machine
//! shows in all of it.

use std::collections::BTreeMap;
use std::fmt;
use std::io::{self, BufRead as _, BufReader};
use std::net::UdpSocket;
use std::path::Path;
use std::process::Child;
use std::time::{Duration, Instant};

use quietpath_bridge::clock::SystemClock;
use quietpath_bridge::link::codec::Frame;
use quietpath_bridge::link::dialect::{MavMessage, MavType};
use quietpath_bridge::link::memory::Faults;
use quietpath_bridge::link::{Link, Statistics};
use quietpath_bridge::planning::{Options, Rollout, plan};
use quietpath_bridge::telemetry::Autopilot;
use quietpath_sim::autopilot::serve::{Go, endpoint, serve};
use quietpath_sim::autopilot::{Machine, Pilot, Settings};
use serde_json::Value;

use crate::programs::{Folder, built, free_port, start};
use crate::scenario_path;

/// Clock ticks of the kernel in a second.
const TICKS: f64 = 100.0;

/// A value of `/proc/PID/status`, kB or a count.
fn status(child: &Child, name: &str) -> u64 {
    let text = std::fs::read_to_string(format!("/proc/{}/status", child.id())).unwrap_or_default();
    let line = text.lines().find_map(|line| line.strip_prefix(name)).unwrap_or_default();
    line.split_whitespace().find_map(|word| word.parse().ok()).unwrap_or_default()
}

/// Processor time of a process so far, s.
fn processor(child: &Child) -> f64 {
    let text = std::fs::read_to_string(format!("/proc/{}/stat", child.id())).unwrap_or_default();
    let after = text.rsplit(')').next().unwrap_or_default();
    let fields: Vec<f64> = after.split_whitespace().filter_map(|field| field.parse().ok()).collect();
    // Without the state, which is no number: user and system time are the 11th and 12th.
    (fields.get(10).copied().unwrap_or_default() + fields.get(11).copied().unwrap_or_default()) / TICKS
}

/// Writes the files of a flight of a published scenario.
fn prepare(folder: &Folder, name: &str, config: &str) {
    let path = scenario_path(name);
    let loaded = quietpath_bridge::file::ScenarioFile::read(&path.to_string_lossy());
    let scenario = loaded.unwrap_or_else(|error| panic!("{error}")).scenario;
    let options = Options { rollout: Rollout::Once, ..Options::default() };
    let planned = plan(&scenario, &options).unwrap_or_else(|error| panic!("{error}"));
    folder.write("plan.json", &planned.plan.to_json());
    folder.write("scenario.toml", &std::fs::read_to_string(path).expect("a scenario"));
    folder.write("bridge.toml", config);
}

/// The vehicle of a scenario in the folder, on a thread of its own until told to stop.
fn vehicle(folder: &Folder, port: u16, seconds: f64) -> std::thread::JoinHandle<(Vec<(u32, Instant)>, Statistics)> {
    let loaded = quietpath_bridge::file::ScenarioFile::read(&folder.path("scenario.toml"));
    let scenario = loaded.unwrap_or_else(|error| panic!("{error}")).scenario;
    let mut settings = Settings::for_agent(Autopilot::ArduPilot, &scenario, None).expect("it lies on the Earth");
    settings.pilot = Pilot::TakesOff(settings.start_height(&scenario, None).expect("a start"));
    std::thread::spawn(move || {
        let clock = SystemClock::start();
        let mut machine = Machine::new(settings);
        let address = format!("udpout:127.0.0.1:{port}").parse().expect("an address");
        let mut link = Link::open(address, endpoint(&machine), clock).expect("threads");
        let mut came = Vec::new();
        let hear = |frame: &Frame| {
            if let MavMessage::SET_POSITION_TARGET_GLOBAL_INT(data) = &frame.message {
                came.push((data.time_boot_ms, Instant::now()));
            }
        };
        let until = quietpath_bridge::clock::Time::ZERO + Duration::from_secs_f64(seconds);
        let each = |moment: quietpath_sim::autopilot::serve::Moment<'_>| {
            if moment.now < until { Go::On } else { Go::Stop }
        };
        let statistics = serve(&mut machine, &mut link, clock, (Faults::NONE, 0), hear, each);
        (came, statistics)
    })
}

/// What became of observations.
#[derive(Clone, Debug, Default)]
pub struct Latencies {
    /// From being sent to the first setpoint of the plan that they asked for, s, in order of size.
    pub seconds: Vec<f64>,
    /// Observations that were sent.
    pub count: usize,
    /// Plans that did not fly: why, and how many.
    pub refused: BTreeMap<String, usize>,
}

impl Latencies {
    /// A quantile, ms.
    fn at(&self, share: f64) -> f64 {
        let place = (share * self.seconds.len().saturating_sub(1) as f64).round() as usize;
        self.seconds.get(place).copied().unwrap_or(f64::NAN) * 1e3
    }
}

impl fmt::Display for Latencies {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [median, ninety, most, all] = [0.5, 0.9, 0.99, 1.0].map(|share| self.at(share));
        writeln!(f, "median {median:.1} ms, 90 % {ninety:.1} ms, 99 % {most:.1} ms, largest {all:.1} ms")?;
        writeln!(f, "{} of {} observations came to fly", self.seconds.len(), self.count)?;
        self.refused.iter().try_for_each(|(why, count)| writeln!(f, "{count} plans did not fly: {why}"))
    }
}

/// Latencies of `count` observations of square8-detection (60 intervals, 8 sensors), s, in order of size.
///
/// # Panics
/// The programs do not start, or the flight does not come about.
#[must_use]
pub fn latencies(count: usize) -> Latencies {
    let folder = Folder::new();
    let config = "[flight]\nmode = \"guided\"\nsetpoint_hz = 20.0\n[flight.replan]\ninterval_s = 1000.0\n\
                  time_to_live_s = 1000.0\nprompt_lead_s = 0.03\ndeadline_s = 1.0\n";
    prepare(&folder, "square8-detection", config);
    let (port, tracker) = (free_port(), free_port());
    let (record, link) = (folder.path("flight.jsonl"), format!("udpin:127.0.0.1:{port}"));
    let (observations, config) = (format!("udp:127.0.0.1:{tracker}"), folder.path("bridge.toml"));
    let (scenario, plan) = (folder.path("scenario.toml"), folder.path("plan.json"));
    let seconds = 25.0 + 0.25 * count as f64;
    let flying = vehicle(&folder, port, seconds);
    let arguments = ["run", "--config", &config, "--link", &link, "--scenario", &scenario, "--plan", &plan];
    let more = ["--observations", &observations, "--record", &record];
    let mut bridge = start(&built("quietpath-bridge"), &[&arguments[..], &more].concat());
    // Take-off and the way to the start.
    std::thread::sleep(Duration::from_secs(20));
    let socket = UdpSocket::bind("127.0.0.1:0").expect("a socket");
    let mut sent = Vec::new();
    for number in 0..count {
        // The first sensor wanders in a small circle; its second coordinate tells one observation from the other.
        let north = 2.0 + 1e-3 * number as f64;
        let line = format!("{{\"id\": \"s1\", \"position\": [2.0, {north}]}}");
        sent.push((format!("[2.0,{north:?}]"), Instant::now()));
        let _ = socket.send_to(line.as_bytes(), ("127.0.0.1", tracker));
        std::thread::sleep(Duration::from_millis(250));
    }
    std::thread::sleep(Duration::from_secs(1));
    let _ = std::process::Command::new("kill").args(["-TERM", &bridge.id().to_string()]).status();
    let _ = bridge.wait();
    let (came, _) = flying.join().expect("the vehicle flew");
    let mut found = first_setpoints(Path::new(&record), &sent, &came).expect("a record");
    found.seconds.sort_by(f64::total_cmp);
    found.count = count;
    found
}

/// For each observation the time from when it was sent to when the first setpoint of its plan came.
fn first_setpoints(record: &Path, sent: &[(String, Instant)], came: &[(u32, Instant)]) -> io::Result<Latencies> {
    let (mut asked, mut is_flying, mut found) = (None, false, Latencies::default());
    for line in BufReader::new(std::fs::File::open(record)?).lines().skip(1) {
        let value: Value = serde_json::from_str(&line?).unwrap_or_default();
        if let Some(observed) = value["in"]["observed"]["position"].as_array() {
            let text =
                format!("[{:?},{:?}]", observed[0].as_f64().unwrap_or(0.0), observed[1].as_f64().unwrap_or(0.0));
            asked = sent.iter().find(|(sent, _)| *sent == text).map(|(_, at)| *at);
            is_flying = false;
        }
        for out in value["out"].as_array().into_iter().flatten().filter_map(Value::as_str) {
            if let Some((_, why)) = out.split_once("does not fly: ") {
                *found.refused.entry(why.to_owned()).or_insert(0) += 1;
            }
            is_flying |= out.starts_with("say Info the plan of") && out.ends_with("flies");
            let bytes = out.strip_prefix("send ").filter(|_| is_flying && asked.is_some());
            let Some(frame) = bytes.and_then(bytes_of).and_then(|bytes| Frame::parse(&bytes)) else { continue };
            let MavMessage::SET_POSITION_TARGET_GLOBAL_INT(data) = frame.message else { continue };
            let arrived = came.iter().find(|(boot, _)| *boot == data.time_boot_ms);
            if let (Some(asked), Some((_, arrived))) = (asked.take(), arrived) {
                found.seconds.push(arrived.duration_since(asked).as_secs_f64());
            }
        }
    }
    Ok(found)
}

fn bytes_of(digits: &str) -> Option<Vec<u8>> {
    (0..digits.len()).step_by(2).map(|at| u8::from_str_radix(digits.get(at..at + 2)?, 16).ok()).collect()
}

/// Share of one core that the bridge takes while it steers for a time, s, without planning anew.
///
/// # Panics
/// The programs do not start.
#[must_use]
pub fn load(seconds: f64) -> f64 {
    let folder = Folder::new();
    prepare(&folder, "square8-detection", "[flight]\nmode = \"guided\"\n");
    let port = free_port();
    let flying = vehicle(&folder, port, 22.0 + seconds);
    let (link, config) = (format!("udpin:127.0.0.1:{port}"), folder.path("bridge.toml"));
    let (scenario, plan) = (folder.path("scenario.toml"), folder.path("plan.json"));
    let arguments = ["run", "--config", &config, "--link", &link, "--scenario", &scenario, "--plan", &plan];
    let mut bridge = start(&built("quietpath-bridge"), &arguments);
    std::thread::sleep(Duration::from_secs(20));
    let (before, begin) = (processor(&bridge), Instant::now());
    std::thread::sleep(Duration::from_secs_f64(seconds));
    let share = (processor(&bridge) - before) / begin.elapsed().as_secs_f64();
    let _ = bridge.kill();
    let _ = bridge.wait();
    let _ = flying.join();
    share
}

/// What a long flight showed.
#[derive(Clone, Debug, Default)]
pub struct Endured {
    /// Time flown, s of the flight.
    pub seconds: f64,
    /// Resident memory of the bridge, kB: at a quarter of the time, and at the end.
    pub memory: [u64; 2],
    /// Fewest and most threads of the bridge from a quarter of the time on.
    pub threads: [u64; 2],
    /// Longest time between two heartbeats of the bridge, s of the flight.
    pub heartbeat_max: f64,
    /// Heartbeats that it sent.
    pub heartbeats: usize,
    /// Plans that flew.
    pub plans: usize,
    /// How the bridge ended; `None` where it flew on to the end.
    pub ended: Option<i32>,
}

impl fmt::Display for Endured {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { seconds, memory, threads, heartbeat_max, heartbeats, plans, ended } = self;
        writeln!(f, "{seconds:.0} s of flight, {plans} plans flown")?;
        writeln!(f, "memory {} kB after a quarter, {} kB at the end", memory[0], memory[1])?;
        writeln!(f, "threads {} to {}", threads[0], threads[1])?;
        writeln!(f, "{heartbeats} heartbeats, the longest gap {heartbeat_max:.2} s of the flight")?;
        match ended {
            None => writeln!(f, "flown to the end"),
            Some(status) => writeln!(f, "ENDED BEFORE with exit status {status}"),
        }
    }
}

/// Flies wight-jam in the time of its own for `seconds` of the flight, `speedup` times faster than time, with a tenth of
/// the frames lost, duplicates, corruption, delay and reordering.
///
/// # Panics
/// The programs do not start.
#[must_use]
pub fn endure(seconds: f64, speedup: f64) -> Endured {
    let folder = Folder::new();
    let config = "[flight]\nmode = \"guided\"\n[flight.replan]\ninterval_s = 30.0\nlead_s = 20.0\ndeadline_s = 15.0\n\
                  time_to_live_s = 600.0\n";
    prepare(&folder, "wight-jam", config);
    let port = free_port();
    let (link, speed) = (format!("udpin:127.0.0.1:{port}"), speedup.to_string());
    let (scenario, plan) = (folder.path("scenario.toml"), folder.path("plan.json"));
    let connect = format!("udpout:127.0.0.1:{port}");
    let vehicle =
        ["autopilot", "--connect", &connect, "--like", "ardupilot", "--scenario", &scenario, "--pilot", "takeoff"];
    let faults = ["--loss", "0.1", "--duplicate", "0.05", "--corrupt", "0.01", "--delay", "40", "--jitter", "80"];
    let mut vehicle = start(&built("quietpath"), &[&vehicle[..], &faults, &["--speedup", &speed]].concat());
    let (config, record) = (folder.path("bridge.toml"), folder.path("flight.jsonl"));
    let arguments = ["run", "--config", &config, "--link", &link, "--scenario", &scenario, "--plan", &plan];
    let more = ["--speedup", &speed, "--record", &record];
    let mut bridge = start(&built("quietpath-bridge"), &[&arguments[..], &more].concat());
    let mut endured = Endured::default();
    let whole = Duration::from_secs_f64(seconds / speedup);
    let begin = Instant::now();
    while begin.elapsed() < whole && endured.ended.is_none() {
        std::thread::sleep(whole / 200);
        endured.ended = bridge.try_wait().ok().flatten().map(|status| status.code().unwrap_or(-1));
        if begin.elapsed() < whole / 4 {
            continue;
        }
        let (memory, threads) = (status(&bridge, "VmRSS:"), status(&bridge, "Threads:"));
        if endured.memory[0] == 0 {
            (endured.memory[0], endured.threads) = (memory, [threads; 2]);
        }
        endured.memory[1] = memory;
        endured.threads = [endured.threads[0].min(threads), endured.threads[1].max(threads)];
    }
    for child in [&mut bridge, &mut vehicle] {
        let _ = child.kill();
        let _ = child.wait();
    }
    heartbeats(Path::new(&record), &mut endured).expect("a record");
    endured
}

/// What the record says about heartbeats and plans.
fn heartbeats(record: &Path, endured: &mut Endured) -> io::Result<()> {
    let mut last = None;
    for line in BufReader::new(std::fs::File::open(record)?).lines().skip(1) {
        // The last line may be cut off.
        let Ok(value) = serde_json::from_str::<Value>(&line?) else { break };
        let time = value["t"].as_f64().unwrap_or_default() * 1e-6;
        endured.seconds = time;
        for out in value["out"].as_array().into_iter().flatten().filter_map(Value::as_str) {
            endured.plans += usize::from(out.starts_with("say Info the plan of") && out.ends_with("flies"));
            let frame = out.strip_prefix("send ").and_then(bytes_of).and_then(|bytes| Frame::parse(&bytes));
            let is_ours = frame.is_some_and(|frame| {
                matches!(frame.message, MavMessage::HEARTBEAT(data) if data.mavtype == MavType::MAV_TYPE_ONBOARD_CONTROLLER)
            });
            if is_ours {
                endured.heartbeats += 1;
                endured.heartbeat_max = endured.heartbeat_max.max(last.map_or(0.0, |last| time - last));
                last = Some(time);
            }
        }
    }
    Ok(())
}

/// The page of the figures.
#[must_use]
pub fn page(machine: &str, latency: &str, load: &str, endurance: &str, speedup: f64) -> String {
    let block = |text: &str| format!("```text\n{}\n```", text.trim_end());
    [
        "# The bridge, measured while it flies",
        "Written by `cargo xtask live`: the program `quietpath-bridge` flies the simulated autopilot over loopback UDP.",
        machine,
        "## From an observation to the first setpoint of the new plan",
        "square8-detection, 60 intervals, 8 sensors; a tracker reports a sensor four times a second to the UDP port, each \
         report asks for a plan, and the plan's first setpoint is timed where it arrives at the vehicle's socket. Setpoints \
         go out 20 times a second, so waiting for the next one takes up to 50 ms by itself where a plan does not hurry it.",
        &block(latency),
        "## Processor",
        "The share of one core that the bridge takes while it steers, without planning anew.",
        &block(load),
        "## Endurance",
        &format!(
            "wight-jam for an hour at {speedup:.0} times its speed, a plan every 30 s, with 10 % of the frames lost in each \
             direction, 5 % coming twice, 1 % with a flipped bit, 40 to 120 ms late and out of order."
        ),
        &block(endurance),
    ]
    .join("\n\n")
        + "\n"
}
