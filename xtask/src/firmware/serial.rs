//! The image `mavlink` flies a vehicle that is simulated here, through QEMU's serial line.
//!
//! The vehicle is a point that follows setpoints within its bounds on speed and acceleration. Both sides go in lockstep: a
//! position, a setpoint, a step, so that the flight is the same on any machine.

use std::io::{BufReader, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::time::Duration;

use anyhow::{Context, bail};
use mavlink::dialects::ardupilotmega::{HEARTBEAT_DATA, LOCAL_POSITION_NED_DATA, MavMessage};
use mavlink::{MAVLinkV2MessageRaw, MavHeader, MavlinkReader, MavlinkVersion};

use super::image;
use super::parts::Part;

/// Time between two positions, and between two heartbeats, ms.
const STEP_MS: u32 = 500;
const HEARTBEAT_MS: u32 = 1000;
/// A flight that takes longer does not arrive, ms.
const FLIGHT_MAX_MS: u32 = 200_000;
/// A setpoint that takes longer does not come.
const PATIENCE: Duration = Duration::from_secs(120);
/// Start and goal of the built-in flight, east and north, m.
const START_M: [f32; 2] = [80.0, 100.0];
const GOAL_M: [f32; 2] = [850.0, 670.0];
/// A little more than the planner reckons with, m/s and m/s^2.
const SPEED_MAX: f32 = 11.0;
const ACCEL_MAX: f32 = 3.0;
/// Largest speed that is planned, m/s.
const SPEED_PLANNED: f32 = 10.0;
/// How near the vehicle has to stay to its setpoints, m: the plan begins at speed and the vehicle at rest, which gathers it
/// meanwhile, and is a step late.
const OFF_MAX: f32 = SPEED_PLANNED * SPEED_PLANNED / (2.0 * ACCEL_MAX) + SPEED_PLANNED * 1e-3 * STEP_MS as f32;
/// How near it has to come to the goal, m.
const THERE: f32 = 1.0;

/// A vehicle: east and north.
struct Vehicle {
    position: [f32; 2],
    velocity: [f32; 2],
}

/// Flies the image on a part; false where the vehicle does not arrive.
///
/// # Errors
/// The image does not start, or falls silent.
pub fn fly(part: &Part, top: &Path) -> anyhow::Result<bool> {
    let listener = TcpListener::bind("127.0.0.1:0").context("cannot listen on the loopback interface")?;
    let line = format!("tcp:127.0.0.1:{}", listener.local_addr()?.port());
    let mut child = image::emulate(part, &image::path(part, "mavlink", top), &["-serial", &line])?;
    let flown = listener.accept().context("QEMU does not connect").and_then(|(stream, _)| converse(stream));
    let ended = if flown.is_ok() {
        image::wait(&mut child)
    } else {
        child.kill()?;
        child.wait()?;
        Ok(false)
    };
    let (seconds, setpoints, off) = flown?;
    let good = ended? && off <= OFF_MAX;
    println!(
        "  over MAVLink: {} after {seconds:.1} s and {setpoints} setpoints, at most {off:.1} m off",
        if good { "at the goal" } else { "NOT WELL" }
    );
    Ok(good)
}

/// The flight: seconds, setpoints, and the largest distance from a setpoint, m.
fn converse(stream: TcpStream) -> anyhow::Result<(f32, u32, f32)> {
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.set_nodelay(true)?;
    let mut writer = stream.try_clone()?;
    let mut reader = MavlinkReader::new(BufReader::new(stream));
    let mut header = MavHeader { system_id: 1, component_id: 1, ..MavHeader::default() };
    let mut vehicle = Vehicle { position: START_M, velocity: [0.0; 2] };
    let (mut setpoints, mut off) = (0, 0.0_f32);
    for time_ms in (0..FLIGHT_MAX_MS).step_by(STEP_MS as usize) {
        if time_ms % HEARTBEAT_MS == 0 {
            send(&mut writer, &mut header, &MavMessage::HEARTBEAT(HEARTBEAT_DATA::default()))?;
        }
        let [y, x] = vehicle.position;
        let [vy, vx] = vehicle.velocity;
        let found = LOCAL_POSITION_NED_DATA { time_boot_ms: time_ms, x, y, z: 0.0, vx, vy, vz: 0.0 };
        send(&mut writer, &mut header, &MavMessage::LOCAL_POSITION_NED(found))?;
        let answer = reader.read_message::<MavMessage>(MavlinkVersion::V2);
        let (_, answer) = answer.with_context(|| format!("no setpoint at {time_ms} ms"))?;
        let MavMessage::SET_POSITION_TARGET_LOCAL_NED(wanted) = answer else { bail!("not a setpoint: {answer:?}") };
        if wanted.time_boot_ms != time_ms || u32::from(wanted.target_system) != header.system_id {
            bail!("a setpoint for another time or vehicle: {wanted:?}");
        }
        setpoints += 1;
        let target = [wanted.y, wanted.x];
        off = off.max(distance(vehicle.position, target));
        // The plan has ended where its setpoint rests.
        let is_over = [wanted.vx, wanted.vy] == [0.0; 2] && distance(target, GOAL_M) < THERE;
        if is_over && distance(vehicle.position, target) < THERE {
            return Ok((time_ms as f32 * 1e-3, setpoints, off));
        }
        vehicle.step(target, [wanted.vy, wanted.vx], STEP_MS as f32 * 1e-3);
    }
    bail!("the vehicle is at {:?} m after {} s, the goal is at {GOAL_M:?}", vehicle.position, FLIGHT_MAX_MS / 1000)
}

impl Vehicle {
    /// Follows a setpoint for `time` seconds.
    fn step(&mut self, target: [f32; 2], velocity: [f32; 2], time: f32) {
        let wanted = [0, 1].map(|axis| velocity[axis] + 0.5 * (target[axis] - self.position[axis]));
        let wanted = limited(wanted, SPEED_MAX);
        let change = limited([0, 1].map(|axis| wanted[axis] - self.velocity[axis]), ACCEL_MAX * time);
        for axis in [0, 1] {
            self.velocity[axis] += change[axis];
            self.position[axis] += self.velocity[axis] * time;
        }
    }
}

fn limited(vector: [f32; 2], most: f32) -> [f32; 2] {
    let length = distance(vector, [0.0; 2]);
    if length > most { vector.map(|part| part * most / length) } else { vector }
}

fn distance(a: [f32; 2], b: [f32; 2]) -> f32 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

fn send(line: &mut TcpStream, header: &mut MavHeader, message: &MavMessage) -> anyhow::Result<()> {
    let mut frame = MAVLinkV2MessageRaw::new();
    frame.serialize_message(*header, message);
    header.sequence = header.sequence.wrapping_add(1);
    line.write_all(frame.raw_bytes()).context("the serial line is closed")
}
