//! What goes wrong with the programs: `quietpath-bridge` flies `quietpath autopilot` over loopback UDP, faster than time.
//!
//! The flight is that of [`crate::programs`]: 80 m along the south in 20 s, jamming all the way. What the vehicle did is
//! read from its track; every record is replayed, bit for bit, as far as it goes.

use std::fs::File;
use std::net::UdpSocket;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use fastrand::Rng;
use quietpath_bridge::flight::FlyMode;

use super::Outcome::{self, Arrives, Holds, LetsGo, Refuses};
use super::{Fault, Flown, Fly};
use crate::programs::{Folder, built, end, ended, free_port};

/// How many times faster than time: a machine that is busy with other things must keep up.
const SPEEDUP: f64 = 4.0;
/// Longest that a flight may take.
const PATIENCE: Duration = Duration::from_secs(90);
/// How long the vehicle is watched after the bridge has ended, s of the flight.
const WATCHED: f64 = 8.0;
/// How long a payload may go on without the bridge, s of the flight: its time to live, the time between two lines of a track,
/// and what a busy machine adds.
const ECHO: f64 = 2.5;
/// Speed of a vehicle that stands, m/s.
const STANDS: f64 = 0.5;
/// The goal: metres north and east of the scenario's origin, and how near it is reached.
const GOAL: [f64; 2] = [10.0, 90.0];
/// How near the goal is reached, m: missions end within their acceptance.
const NEAR: f64 = 7.0;
/// Metres of a degree of latitude and of longitude there.
const METERS: [f64; 2] = [111_170.0, 75_500.0];
/// A file size limit that the first line of a record fits into, and the flight does not: blocks of 512 bytes.
const BLOCKS: &str = "64";

/// What goes wrong with the programs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trial {
    /// The bridge is killed and begun anew. Steered, on ArduPilot alone: PX4 has its own answer.
    Killed,
    /// The same, steered, on PX4, which holds when setpoints end.
    KilledOnPx4,
    /// The bridge is killed, and nobody begins it anew.
    Gone,
    /// The computer sleeps: the bridge's process is stopped, and goes on later.
    Suspended,
    /// SIGTERM.
    Terminated,
    /// The disk is full from some moment of the flight on.
    DiskFull,
    /// The disk is full before the flight.
    NoRecord,
    /// The log cannot be written.
    NoLog,
    /// 10 000 datagrams a second at the port for observations.
    Flood,
    /// The autopilot's computer is switched off and on.
    Rebooted,
    /// Another bridge is begun at the same port.
    Second,
}

fn fault(name: &'static str, says: &'static str, [steered, mission]: [Option<Outcome>; 2], trial: Trial) -> Fault {
    Fault { name, says, steered, mission, fly: Fly::Programs(trial) }
}

/// All of them.
#[must_use]
pub fn faults() -> Vec<Fault> {
    let both = |outcome| [Some(outcome), Some(outcome)];
    let killed = "the bridge is killed (SIGKILL) in flight and begun anew; it does not jam any more";
    let on_px4 = "the same on PX4, which holds by itself meanwhile: the bridge does not take the vehicle back";
    let gone = "the bridge is killed (SIGKILL) in flight, and stays away: the autopilot is on its own, and silent";
    vec![
        fault("killed", killed, both(Arrives), Trial::Killed),
        fault("killed-on-px4", on_px4, [Some(LetsGo), None], Trial::KilledOnPx4),
        fault("gone", gone, [Some(Holds), Some(Arrives)], Trial::Gone),
        fault("suspended", "the bridge's computer sleeps for 12 s", [Some(Holds), Some(Arrives)], Trial::Suspended),
        fault("terminated", "the bridge is ended (SIGTERM) in flight", [Some(Holds), None], Trial::Terminated),
        fault("disk-full", "the disk is full while the flight is recorded", both(Arrives), Trial::DiskFull),
        fault(
            "no-record",
            "the disk is full before the flight, which is to be recorded",
            both(Refuses),
            Trial::NoRecord,
        ),
        fault("no-log", "the disk that the log is written to is full", both(Arrives), Trial::NoLog),
        fault("datagrams", "10 000 datagrams a second at the port for observations", both(Arrives), Trial::Flood),
        fault(
            "rebooted",
            "the autopilot is switched off in flight, and on again",
            [Some(Holds), Some(LetsGo)],
            Trial::Rebooted,
        ),
        fault("port-taken", "a second bridge is begun at the same port", both(Arrives), Trial::Second),
    ]
}

/// A line of the track.
#[derive(Clone, Copy, Debug)]
struct Moment {
    time: f64,
    /// Metres north and east of the origin.
    place: [f64; 2],
    speed: f64,
    level: f64,
}

/// A flight of the programs.
struct Programs {
    folder: Folder,
    mode: FlyMode,
    port: u16,
    tracker: u16,
    vehicles: usize,
    children: Vec<Child>,
}

impl Drop for Programs {
    fn drop(&mut self) {
        for child in &mut self.children {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

impl Programs {
    fn vehicle(&mut self, like: &str) -> Child {
        self.vehicles += 1;
        let pilot = if self.mode == FlyMode::Guided { "takeoff" } else { "mission" };
        let (scenario, track) = (self.folder.path("scenario.toml"), self.track_name(self.vehicles));
        let mut command = Command::new(built("quietpath"));
        command.args(["autopilot", "--scenario", &scenario, "--like", like, "--pilot", pilot, "--jammer", "26"]);
        command.args(["--speedup", &SPEEDUP.to_string(), "--track", &track]);
        command.args(["--connect", &format!("udpout:127.0.0.1:{}", self.port)]);
        command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("the program runs")
    }

    fn track_name(&self, number: usize) -> String {
        self.folder.path(&format!("track-{number}.csv"))
    }

    /// The bridge behind some words of a shell, which end in `exec "$@"`.
    fn bridge(&self, shell: &str, log: &str) -> Child {
        let mode = if self.mode == FlyMode::Guided { "guided" } else { "mission" };
        let path = |name| self.folder.path(name);
        let mut command = Command::new("sh");
        command.args(["-c", shell, "sh"]).arg(built("quietpath-bridge")).args([
            "run",
            "--arm-jammer",
            "--mode",
            mode,
        ]);
        command.args(["--scenario", &path("scenario.toml"), "--plan", &path("plan.json")]);
        command.args(["--config", &path("bridge.toml"), "--state", &path("flight.state")]);
        command.args(["--record", &path("flight.jsonl"), "--speedup", &SPEEDUP.to_string()]);
        command.args(["--observations", &format!("udp:127.0.0.1:{}", self.tracker)]);
        command.args(["--link", &format!("udpin:127.0.0.1:{}", self.port)]);
        let log = File::options().create(true).append(true).open(log).expect("a log");
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(log).spawn().expect("the program runs")
    }

    fn track(&self, number: usize) -> Vec<Moment> {
        let text = std::fs::read_to_string(self.track_name(number)).unwrap_or_default();
        // The last line may not be whole yet.
        let whole = text.rsplit_once('\n').map_or("", |(whole, _)| whole);
        whole.lines().skip(1).filter_map(moment).collect()
    }

    /// Waits until the plan is flown; false where it never is.
    fn wait_for_flight(&self, bridge: &mut Child) -> bool {
        let begin = Instant::now();
        while begin.elapsed() < PATIENCE && bridge.try_wait().expect("a child").is_none() {
            if self.track(self.vehicles).iter().any(|moment| moment.level > 0.0) {
                return true;
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        false
    }
}

fn moment(line: &str) -> Option<Moment> {
    let numbers: Vec<f64> = line.split(',').filter_map(|part| part.parse().ok()).collect();
    let &[time, latitude, longitude, _, east, north, _, level] = numbers.as_slice() else { return None };
    let place = [(latitude - 47.4) * METERS[0], (longitude - 8.5) * METERS[1]];
    Some(Moment { time, place, speed: east.hypot(north), level })
}

fn signal(child: &Child, name: &str) {
    let done = Command::new("kill").args([name, &child.id().to_string()]).status();
    assert!(done.is_ok_and(|status| status.success()), "kill {name}");
}

/// Lets time of the flight pass, s.
fn pass(seconds: f64) {
    std::thread::sleep(Duration::from_secs_f64(seconds / SPEEDUP));
}

/// Flies a trial once.
///
/// # Panics
/// The programs cannot be started.
#[must_use]
pub fn fly(trial: Trial, mode: FlyMode, seed: u64) -> Flown {
    let mut random = Rng::with_seed(seed ^ 0x009a_97a3);
    let like = match (trial, mode) {
        (Trial::Killed, FlyMode::Guided) => "ardupilot",
        (Trial::KilledOnPx4, _) => "px4",
        _ if seed.is_multiple_of(2) => "px4",
        _ => "ardupilot",
    };
    let (port, tracker) = (free_port(), free_port());
    let mut programs = Programs { folder: Folder::new(), mode, port, tracker, vehicles: 0, children: Vec::new() };
    let vehicle = programs.vehicle(like);
    programs.children.push(vehicle);
    let log = programs.folder.path("bridge.log");
    let shell = match trial {
        Trial::DiskFull => format!("ulimit -f {BLOCKS}; exec \"$@\""),
        Trial::NoRecord => "ulimit -f 1; exec \"$@\"".to_owned(),
        _ => "exec \"$@\"".to_owned(),
    };
    let mut bridge = programs.bridge(&shell, if trial == Trial::NoLog { "/dev/full" } else { &log });
    let begins = programs.wait_for_flight(&mut bridge);
    let struck = begins.then(|| strike(trial, &mut programs, &mut bridge, like, 1.0 + 9.0 * random.f64()));
    let output = match (trial, begins) {
        (Trial::Gone, true) => None,
        _ => Some(ended(bridge, PATIENCE)),
    };
    if trial == Trial::Gone {
        pass(25.0);
    }
    pass(WATCHED);
    let said = std::fs::read_to_string(&log).unwrap_or_default();
    let mut flown = judge(trial, &programs, begins, struck.flatten(), output);
    flown.broken.extend(replays(&programs));
    if said.contains("panicked") {
        flown.broken.push("panics".into());
    }
    flown.said = said.lines().map(str::to_owned).collect();
    flown
}

/// Does it, after a time of the flight; when the vehicle must be silent from then on, its track's time at that moment.
fn strike(trial: Trial, programs: &mut Programs, bridge: &mut Child, like: &str, after: f64) -> Option<f64> {
    pass(after);
    let now = |programs: &Programs| programs.track(1).last().map(|moment| moment.time);
    match trial {
        Trial::Killed | Trial::KilledOnPx4 | Trial::Gone => {
            let _ = bridge.kill();
            let _ = bridge.wait();
            let struck = now(programs);
            if trial != Trial::Gone {
                pass(2.0);
                *bridge = programs.bridge("exec \"$@\"", &programs.folder.path("bridge.log"));
            }
            struck
        }
        Trial::Suspended => {
            signal(bridge, "-STOP");
            pass(12.0);
            signal(bridge, "-CONT");
            None
        }
        Trial::Terminated => {
            signal(bridge, "-TERM");
            now(programs)
        }
        Trial::Flood => {
            flood(programs.tracker);
            None
        }
        Trial::Rebooted => {
            for vehicle in programs.children.drain(..) {
                end(vehicle);
            }
            let vehicle = programs.vehicle(like);
            programs.children.push(vehicle);
            None
        }
        Trial::Second => {
            let second = programs.bridge("exec \"$@\"", &programs.folder.path("second.log"));
            programs.children.push(second);
            None
        }
        Trial::DiskFull | Trial::NoRecord | Trial::NoLog => None,
    }
}

/// 10 000 datagrams a second for a second and a half: nonsense, and sensors that nobody knows.
fn flood(port: u16) {
    let socket = UdpSocket::bind("127.0.0.1:0").expect("a socket");
    let begin = Instant::now();
    for burst in 0_u32..150 {
        for number in 0..100 {
            let line = match number % 3 {
                0 => format!("{{\"id\": \"ghost-{number}\", \"position\": [4.0, 18.0]}}"),
                1 => "{\"id\": \"s1\", \"position\": [1e999, 2.0]}".to_owned(),
                _ => "\u{0}nonsense".to_owned(),
            };
            let _ = socket.send_to(line.as_bytes(), ("127.0.0.1", port));
        }
        let due = Duration::from_millis(10) * (burst + 1);
        std::thread::sleep(due.saturating_sub(begin.elapsed()));
    }
}

fn judge(
    trial: Trial,
    programs: &Programs,
    begins: bool,
    struck: Option<f64>,
    output: Option<Result<Output, Box<Output>>>,
) -> Flown {
    let track = programs.track(programs.vehicles);
    let last = track.last().copied();
    let status = match output {
        Some(Ok(output)) => Some(output.status.code().unwrap_or(-1)),
        _ => None,
    };
    let stands = last.is_some_and(|last| last.speed < STANDS);
    let off = last.map_or(f64::INFINITY, |last| (last.place[0] - GOAL[0]).hypot(last.place[1] - GOAL[1]));
    let outcome = match status {
        Some(0) => Some(Arrives),
        Some(1 | 2) if !begins => Some(Refuses),
        Some(1 | 4) => Some(Holds),
        Some(3) => Some(LetsGo),
        None if trial == Trial::Gone && off < NEAR => Some(Arrives),
        None if trial == Trial::Gone && stands => Some(Holds),
        _ => None,
    };
    let mut broken = Vec::new();
    if outcome == Some(Arrives) && off > NEAR {
        broken.push(format!("is not where it says: {off:.1} m from the goal"));
    }
    if matches!(outcome, Some(Arrives | Holds)) && !stands {
        broken.push(format!("does not stand: {last:?}"));
    }
    let jams_until = track.iter().filter(|moment| moment.level > 0.0).map(|moment| moment.time).fold(0.0, f64::max);
    if struck.is_some_and(|struck| jams_until > struck + ECHO) {
        broken.push(format!("jams after the fault: at {jams_until:.1} s, {struck:?}"));
    }
    if last.is_some_and(|last| last.level > 0.0) {
        broken.push("jams at the end".into());
    }
    if outcome.is_none() {
        broken.push(format!("ends with status {status:?}"));
    }
    Flown { outcome, broken, said: Vec::new() }
}

/// Every record that is there is replayed; what was wrong with one.
fn replays(programs: &Programs) -> Option<String> {
    let names = ["flight.jsonl", "flight-2.jsonl"].map(|name| programs.folder.path(name));
    names.iter().filter(|name| std::fs::metadata(name).is_ok_and(|file| file.len() > 0)).find_map(|name| {
        let replay = Command::new(built("quietpath-bridge")).args(["replay", "--quiet", name]).output();
        let replay = replay.expect("the program runs");
        // A disk that was full before the first line left no flight to replay.
        let said = String::from_utf8_lossy(&replay.stderr).into_owned();
        let is_good = replay.status.success() || said.contains("ends before the flight begins");
        (!is_good).then(|| format!("a record does not replay: {said}"))
    })
}
