//! Running the program: files, arguments, and what it says.

use std::net::UdpSocket;
use std::process::{Child, Command, Output, Stdio};

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
pub const PLAN: &str = r#"{"duration": 20.0, "agents": [{"name": "uav1",
 "path": [[1, 1], [3, 1], [5, 1], [7, 1], [9, 1]], "jam": [1, 1, 1, 1, 1]}]}"#;

pub fn free_port() -> u16 {
    let socket = UdpSocket::bind("127.0.0.1:0").expect("a socket");
    socket.local_addr().expect("bound").port()
}

/// A folder with a scenario and a plan.
pub struct Folder(tempfile::TempDir);

impl Folder {
    pub fn new() -> Self {
        let folder = Self(tempfile::tempdir().expect("a folder"));
        folder.write("scenario.toml", SCENARIO);
        folder.write("plan.json", PLAN);
        folder
    }

    pub fn path(&self, name: &str) -> String {
        self.0.path().join(name).display().to_string()
    }

    pub fn write(&self, name: &str, text: &str) {
        std::fs::write(self.0.path().join(name), text).expect("written");
    }
}

pub fn program(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_quietpath-bridge"));
    command.args(arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).stdin(Stdio::null());
    command
}

pub fn run(arguments: &[&str]) -> (i32, String, String) {
    text(&program(arguments).output().expect("the program runs"))
}

pub fn text(output: &Output) -> (i32, String, String) {
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code().unwrap_or(-1), text(&output.stdout), text(&output.stderr))
}

pub fn terminate(child: Child) -> (i32, String, String) {
    let killed = Command::new("kill").args(["-TERM", &child.id().to_string()]).status();
    assert!(killed.is_ok_and(|status| status.success()));
    text(&child.wait_with_output().expect("it ends"))
}
