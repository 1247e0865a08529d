//! Power and jamming as items of the mission, for payloads that hang on an output of the autopilot.
//!
//! Off unless a payload names its output. The autopilot then switches it at the node where the plan does, between the
//! waypoint that it leaves and the one that it flies to, and switches it off after the last.
//!
//! | | ArduPilot | PX4 |
//! |---|---|---|
//! | item | DO_SET_SERVO (183): output, microseconds | DO_SET_ACTUATOR (187): values from -1 to 1 |
//! | outputs | all | 1 to 4: in an item, 5 and 6 are whole numbers |
//!
//! **What this cannot do.** An autopilot goes on with its mission when the bridge falls silent: the next item switches the
//! output on again. Where that must not be, do not use it; the payloads of [`crate::payload`] fall silent by themselves.

use crate::command::Command;
use crate::file::plan::AgentPlan;
use crate::link::dialect::{MavCmd, MavFrame};
use crate::mission::Item;
use crate::payload::Radiation;
use crate::telemetry::Autopilot;

use super::settings::{MissionOutput, PayloadEntry, PayloadKind};

/// Outputs that an item can set on PX4.
const PX4_OUTPUTS: u8 = 4;
/// Change of a level that is worth an item.
const LEVEL_STEP: f64 = 1e-3;

/// The value of an output at a level.
fn value(output: &MissionOutput, level: f64) -> f32 {
    (output.off + (output.full - output.off) * level.clamp(0.0, 1.0)) as f32
}

/// The command that sets an output; `None` where the autopilot has no such output.
#[must_use]
pub fn set(autopilot: Autopilot, output: &MissionOutput, level: f64) -> Option<Command> {
    let value = value(output, level);
    match autopilot {
        Autopilot::ArduPilot => {
            let params = [f32::from(output.output), value, 0.0, 0.0, 0.0, 0.0, 0.0];
            Some(Command::new(MavCmd::MAV_CMD_DO_SET_SERVO, params))
        }
        Autopilot::Px4 => {
            let mut params = [f32::NAN, f32::NAN, f32::NAN, f32::NAN, f32::NAN, f32::NAN, 0.0];
            let index = usize::from(output.output).checked_sub(1).filter(|_| output.output <= PX4_OUTPUTS)?;
            *params.get_mut(index)? = value;
            Some(Command::new(MavCmd::MAV_CMD_DO_SET_ACTUATOR, params))
        }
    }
}

fn item(autopilot: Autopilot, output: &MissionOutput, level: f64) -> Option<Item> {
    let Command { command, params: [p1, p2, p3, p4, ..] } = set(autopilot, output, level)?;
    // The largest whole number stands for "not given", as NaN does.
    let unused = if autopilot == Autopilot::Px4 { i32::MAX } else { 0 };
    let frame = MavFrame::MAV_FRAME_GLOBAL;
    Some(Item { command, frame, params: [p1, p2, p3, p4], x: unused, y: unused, z: 0.0, autocontinue: true })
}

/// The level of a payload on the way to a node; `None` for a payload that must not be switched.
fn level(entry: &PayloadEntry, radiation: Radiation, plan: &AgentPlan, node: usize) -> Option<f64> {
    let control = |values: &Option<Vec<f64>>| values.as_ref().and_then(|values| values.get(node).copied());
    match (entry.kind, radiation) {
        (PayloadKind::Transmitter, _) => Some(1.0 - control(&plan.dropout).unwrap_or(0.0)),
        (PayloadKind::Jammer, Radiation::Armed) => Some(control(&plan.jam).unwrap_or(0.0)),
        (PayloadKind::Jammer, Radiation::Off) => None,
    }
}

/// The level of a payload when nothing is flown.
const fn rest(kind: PayloadKind) -> f64 {
    match kind {
        PayloadKind::Transmitter => 1.0,
        PayloadKind::Jammer => 0.0,
    }
}

/// A mission with the items that switch its payloads. `nodes` holds for each item the node that it flies to.
#[must_use]
pub fn insert(
    autopilot: Autopilot,
    items: Vec<Item>,
    nodes: &[usize],
    payloads: &[PayloadEntry],
    radiation: Radiation,
    plan: &AgentPlan,
) -> Vec<Item> {
    let outputs: Vec<(&PayloadEntry, MissionOutput)> =
        payloads.iter().filter_map(|entry| Some((entry, entry.mission_output?))).collect();
    // The rest of a mission begins with whatever the mission before it left on.
    let is_whole = items.iter().any(|item| item.command == MavCmd::MAV_CMD_NAV_TAKEOFF);
    let mut now: Vec<Option<f64>> = outputs.iter().map(|(entry, _)| is_whole.then(|| rest(entry.kind))).collect();
    let differs = |now: Option<f64>, wanted: f64| now.is_none_or(|now| (wanted - now).abs() > LEVEL_STEP);
    let mut out = Vec::with_capacity(items.len());
    for (wire, node) in items.into_iter().zip(nodes) {
        // Before the first node nothing is emitted, and home is no place that is flown to.
        if wire.command == MavCmd::MAV_CMD_NAV_WAYPOINT && *node > 0 {
            for ((entry, output), now) in outputs.iter().zip(&mut now) {
                let wanted = level(entry, radiation, plan, *node).filter(|wanted| differs(*now, *wanted));
                if let Some(wanted) = wanted {
                    out.extend(item(autopilot, output, wanted));
                    *now = Some(wanted);
                }
            }
        }
        out.push(wire);
    }
    for ((entry, output), now) in outputs.iter().zip(now) {
        let may = entry.kind == PayloadKind::Transmitter || radiation == Radiation::Armed;
        if may && differs(now, rest(entry.kind)) {
            out.extend(item(autopilot, output, rest(entry.kind)));
        }
    }
    out
}

/// The commands that bring all outputs to rest.
#[must_use]
pub fn quiet(autopilot: Autopilot, payloads: &[PayloadEntry], radiation: Radiation) -> Vec<Command> {
    let is_ours = |entry: &&PayloadEntry| entry.kind == PayloadKind::Transmitter || radiation == Radiation::Armed;
    let command = |entry: &PayloadEntry| set(autopilot, &entry.mission_output?, rest(entry.kind));
    payloads.iter().filter(is_ours).filter_map(command).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn waypoint() -> Item {
        let frame = MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT;
        let command = MavCmd::MAV_CMD_NAV_WAYPOINT;
        Item { command, frame, params: [0.0; 4], x: 1, y: 1, z: 1.0, autocontinue: true }
    }

    fn entry(kind: PayloadKind, output: u8) -> PayloadEntry {
        let mission_output = Some(MissionOutput { output, off: 1000.0, full: 2000.0 });
        PayloadEntry { kind, component: 25, instance: 0, mission_output }
    }

    fn commands(items: &[Item]) -> Vec<(u32, f32, f32)> {
        items.iter().map(|item| (item.command as u32, item.params[0], item.params[1])).collect()
    }

    #[test]
    fn outputs_change_before_the_node_that_they_are_for_and_rest_at_the_end() {
        let plan = AgentPlan { jam: Some(vec![1.0, 0.0, 0.5, 0.5]), ..AgentPlan::default() };
        let mut items = vec![waypoint(); 5];
        // ArduPilot: home, then nodes 0 to 3.
        let nodes = [0, 0, 1, 2, 3];
        let jammer = [entry(PayloadKind::Jammer, 9)];
        let rest = insert(Autopilot::ArduPilot, items.clone(), &nodes, &jammer, Radiation::Armed, &plan);
        items[1].command = MavCmd::MAV_CMD_NAV_TAKEOFF;
        let with = |radiation| insert(Autopilot::ArduPilot, items.clone(), &nodes, &jammer, radiation, &plan);
        let (way, half, off) = ((16, 0.0, 0.0), (183, 9.0, 1500.0), (183, 9.0, 1000.0));
        let up = (22, 0.0, 0.0);
        assert_eq!(commands(&with(Radiation::Armed)), [way, up, way, half, way, way, off]);
        assert_eq!(commands(&rest), [way, way, off, way, half, way, way, off], "what was on may be on still");
        assert_eq!(with(Radiation::Off), items, "unarmed");
        assert_eq!(quiet(Autopilot::ArduPilot, &jammer, Radiation::Off), []);
        let quiet = quiet(Autopilot::ArduPilot, &jammer, Radiation::Armed);
        assert_eq!(quiet.iter().map(|command| command.params[1]).collect::<Vec<_>>(), [1000.0]);
    }

    #[test]
    fn px4_sets_one_actuator_and_leaves_the_others() {
        let output = MissionOutput { output: 2, off: -1.0, full: 1.0 };
        let item = item(Autopilot::Px4, &output, 1.0).expect("an item");
        assert_eq!((item.command as u32, item.params[1], item.x, item.z), (187, 1.0, i32::MAX, 0.0));
        assert!([0, 2, 3].iter().all(|other| item.params[*other].is_nan()));
        for output in [0, 5] {
            assert_eq!(set(Autopilot::Px4, &MissionOutput { output, off: 0.0, full: 1.0 }, 1.0), None);
        }
    }
}
