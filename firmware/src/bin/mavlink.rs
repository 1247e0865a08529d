//! The built-in flight flown over MAVLink on a serial line: heartbeats and local positions in, setpoints out.
//!
//! The first position after a heartbeat starts the flight. Every position is answered by one setpoint, where the plan in
//! force has the vehicle at that time; between two plans the sensor moves on. The image ends when the vehicle is at the
//! goal and the flight is over.
//!
//! Units: the scenario's length unit is [`UNIT_M`] metres; its axes are east and north of MAVLink's local frame.
#![no_std]
#![no_main]

use cortex_m as _;
use cortex_m_rt::entry;
use defmt_semihosting as _;
use mavlink::dialects::common::{MavFrame, MavMessage, PositionTargetTypemask, SET_POSITION_TARGET_LOCAL_NED_DATA};
use mavlink::{MAVLinkV2MessageRaw, MavHeader, MavlinkReader, MavlinkVersion};
use quietpath_firmware::finish;
use quietpath_firmware::uart::Uart;
use quietpath_flight::{Error, Flight, Memory, Setpoint, begin, fly, is_over, replan, setpoint};
use static_cell::ConstStaticCell;

static MEMORY: ConstStaticCell<Memory> = ConstStaticCell::new(Memory::new());

/// Length unit of the scenario, m.
const UNIT_M: f32 = 100.0;
/// How near the goal counts as there, m.
const THERE_M: f32 = 1.0;
/// We: a companion computer of the vehicle's system.
const COMPONENT: u8 = 191;

#[entry]
fn main() -> ! {
    match run(MEMORY.take()) {
        Ok(plans) => {
            defmt::println!("arrived after {=u32} plans", plans);
            finish(true)
        }
        Err(error) => {
            defmt::println!("error {}", error);
            finish(false)
        }
    }
}

/// Flies; the number of plans that it took.
fn run(memory: &mut Memory) -> Result<u32, Error> {
    let mut flight = begin()?;
    let mut plans = 0;
    let mut reader = MavlinkReader::new(Uart::start());
    let mut line = Uart::start();
    let mut header = MavHeader { component_id: COMPONENT, ..MavHeader::default() };
    let mut vehicle = None;
    let mut start_ms = None;
    loop {
        let Ok((from, message)) = reader.read_message::<MavMessage>(MavlinkVersion::V2) else { continue };
        match message {
            MavMessage::HEARTBEAT(_) => {
                vehicle = u8::try_from(from.system_id).ok().map(|system| (system, from.component_id));
            }
            MavMessage::LOCAL_POSITION_NED(found) => {
                let Some((system, component)) = vehicle else { continue };
                let start_ms = *start_ms.get_or_insert(found.time_boot_ms);
                let time = (found.time_boot_ms - start_ms) as f32 * 1e-3;
                // What was passed is flown before the next plan; the first plan is there before the first setpoint.
                while plans == 0 || is_over(&flight, time) && fly(&mut flight) {
                    replan(&mut flight, memory)?;
                    plans += 1;
                }
                let wanted = setpoint(&flight, time);
                header.system_id = system.into();
                send(&mut line, &mut header, &target(&wanted, (system, component), found.time_boot_ms));
                if has_arrived(&flight, &wanted, [found.y, found.x]) {
                    return Ok(plans);
                }
            }
            _ => {}
        }
    }
}

/// A setpoint on the wire: position and velocity, at constant height.
fn target(wanted: &Setpoint, (system, component): (u8, u8), time_boot_ms: u32) -> MavMessage {
    let [[east, north], [to_east, to_north]] =
        [wanted.position, wanted.velocity].map(|pair| pair.map(|part| part * UNIT_M));
    let ignored = PositionTargetTypemask::POSITION_TARGET_TYPEMASK_AX_IGNORE
        | PositionTargetTypemask::POSITION_TARGET_TYPEMASK_AY_IGNORE
        | PositionTargetTypemask::POSITION_TARGET_TYPEMASK_AZ_IGNORE
        | PositionTargetTypemask::POSITION_TARGET_TYPEMASK_YAW_IGNORE
        | PositionTargetTypemask::POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE;
    MavMessage::SET_POSITION_TARGET_LOCAL_NED(SET_POSITION_TARGET_LOCAL_NED_DATA {
        time_boot_ms,
        x: north,
        y: east,
        z: 0.0,
        vx: to_north,
        vy: to_east,
        vz: 0.0,
        afx: 0.0,
        afy: 0.0,
        afz: 0.0,
        yaw: 0.0,
        yaw_rate: 0.0,
        type_mask: ignored,
        target_system: system,
        target_component: component,
        coordinate_frame: MavFrame::MAV_FRAME_LOCAL_NED,
    })
}

fn send(line: &mut Uart, header: &mut MavHeader, message: &MavMessage) {
    let mut frame = MAVLinkV2MessageRaw::new();
    frame.serialize_message(*header, message);
    header.sequence = header.sequence.wrapping_add(1);
    // It waits for room and cannot fail.
    let _ = embedded_io::Write::write_all(line, frame.raw_bytes());
}

/// Whether the plan has ended, and the vehicle is where it ends.
fn has_arrived(flight: &Flight, wanted: &Setpoint, [east, north]: [f32; 2]) -> bool {
    let [goal_east, goal_north] = wanted.position.map(|part| part * UNIT_M);
    let off = (east - goal_east) * (east - goal_east) + (north - goal_north) * (north - goal_north);
    flight.has_arrived() && off < THERE_M * THERE_M
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    finish(false)
}
