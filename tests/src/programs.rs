//! Starting the programs: where they are, what they read, and how they end.

use std::io::Read as _;
use std::net::UdpSocket;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

/// A flight of 80 m along the south that jams all the way.
pub const SCENARIO: &str = r#"
frame = { unit_m = 10.0, latitude_deg = 47.4, longitude_deg = 8.5, altitude_m = 40.0 }
grid = { intervals = 4 }
time = { max = 60.0 }
domain = { min = [0.0, 0.0], max = [20.0, 20.0] }
[[agent]]
start = [1.0, 1.0]
goal = [9.0, 1.0]
speed_max = 1.0
accel_max = 1.0
jammer = { budget = 20.0, live = true }
[[sensor]]
position = [10.0, 5.0]
detection = { model = "proxy", scale = 1.0, epsilon = 0.5, path_loss = 2.0 }
[[region]]
center = [10.0, 8.0]
radius = 2.0
[[objective.term]]
metric = "detection"
"#;
/// Its plan.
pub const PLAN: &str = r#"{"duration": 20.0, "agents": [{"name": "uav1",
 "path": [[1, 1], [3, 1], [5, 1], [7, 1], [9, 1]], "jam": [1, 1, 1, 1, 1]}]}"#;
/// A jammer on board.
pub const CONFIG: &str = "[[flight.payload]]\nkind = \"jammer\"\ncomponent = 26\n";

/// A program of this workspace, built as tests build it: they are there already where all tests run.
///
/// # Panics
/// It cannot be built.
#[must_use]
pub fn built(name: &str) -> PathBuf {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    let folder = FOLDER.get_or_init(|| {
        let here = std::env::current_exe().expect("a program knows where it is");
        let folder = here.ancestors().find(|folder| folder.join("deps").is_dir()).expect("a target folder");
        let mut build = Command::new(env!("CARGO"));
        if folder.ends_with("release") {
            build.args(["build", "--quiet", "--workspace", "--bins", "--release"]);
        } else {
            // Tests that start a program are built with it. Other commands would build all crates with other features.
            build.args(["test", "--no-run", "--quiet", "--workspace", "--test", "interoperate", "--test", "cli"]);
        }
        build.current_dir(crate::repository()).env("CARGO_TARGET_DIR", folder.parent().expect("a target folder"));
        assert!(build.status().is_ok_and(|status| status.success()), "the programs can be built");
        folder.to_owned()
    });
    folder.join(name)
}

/// A port that nobody uses.
///
/// # Panics
/// There is none.
#[must_use]
pub fn free_port() -> u16 {
    let socket = UdpSocket::bind("127.0.0.1:0").expect("a socket");
    socket.local_addr().expect("bound").port()
}

/// A folder of its own with a scenario, a plan and a configuration.
#[derive(Debug)]
pub struct Folder(tempfile::TempDir);

impl Default for Folder {
    fn default() -> Self {
        Self::new()
    }
}

impl Folder {
    /// Makes it.
    ///
    /// # Panics
    /// It cannot be written.
    #[must_use]
    pub fn new() -> Self {
        let folder = Self(tempfile::tempdir().expect("a folder"));
        for (name, text) in [("scenario.toml", SCENARIO), ("plan.json", PLAN), ("bridge.toml", CONFIG)] {
            folder.write(name, text);
        }
        folder
    }

    /// The path of a file.
    #[must_use]
    pub fn path(&self, name: &str) -> String {
        self.0.path().join(name).display().to_string()
    }

    /// Writes a file.
    ///
    /// # Panics
    /// It cannot be written.
    pub fn write(&self, name: &str, text: &str) {
        std::fs::write(self.0.path().join(name), text).expect("written");
    }
}

/// Waits for the end of a program; one that does not end is ended, and what it said is the error.
///
/// # Errors
/// It took longer than `patience`.
///
/// # Panics
/// The operating system does not answer.
pub fn ended(mut child: Child, patience: Duration) -> Result<Output, Box<Output>> {
    let begin = Instant::now();
    while child.try_wait().expect("a child").is_none() {
        if begin.elapsed() > patience {
            let _ = child.kill();
            return Err(Box::new(child.wait_with_output().expect("it ended")));
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    Ok(child.wait_with_output().expect("it ended"))
}

/// Ends a program; what it wrote to its standard output.
pub fn end(mut child: Child) -> String {
    let _ = child.kill();
    let _ = child.wait();
    let mut said = String::new();
    if let Some(mut out) = child.stdout.take() {
        let _ = out.read_to_string(&mut said);
    }
    said
}

/// Starts a program whose output nobody reads.
///
/// # Panics
/// It cannot be started.
#[must_use]
pub fn start(program: &Path, arguments: &[&str]) -> Child {
    let mut command = Command::new(program);
    command.args(arguments).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    command.spawn().expect("the program runs")
}

/// `quietpath-bridge` with some arguments.
#[must_use]
pub fn bridge(arguments: &[&str]) -> Command {
    let mut command = Command::new(built("quietpath-bridge"));
    command.args(arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).stdin(Stdio::null());
    command
}

/// Runs `quietpath-bridge` to its end: status, standard output, standard error.
///
/// # Panics
/// It cannot be started.
#[must_use]
pub fn run(arguments: &[&str]) -> (i32, String, String) {
    text(&bridge(arguments).output().expect("the program runs"))
}

/// Asks a program to end, and waits: status, standard output, standard error.
///
/// # Panics
/// It cannot be asked.
#[must_use]
pub fn terminate(child: Child) -> (i32, String, String) {
    let asked = Command::new("kill").args(["-TERM", &child.id().to_string()]).status();
    assert!(asked.is_ok_and(|status| status.success()), "kill");
    text(&child.wait_with_output().expect("it ends"))
}

fn text(output: &Output) -> (i32, String, String) {
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code().unwrap_or(-1), text(&output.stdout), text(&output.stderr))
}
