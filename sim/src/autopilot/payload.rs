//! Payloads: components of the vehicle that take transmit power or jamming by two commands.
//!
//! | command | parameter 1 | 2 | 3 | 4 | 5 |
//! |---|---|---|---|---|---|
//! | `MAV_CMD_USER_1`, transmit power | instance | fraction, 0 to 1 | time to live, s | | |
//! | `MAV_CMD_USER_2`, jamming | instance | level, 0 to 1 | azimuth, degrees from north | elevation, degrees | time to live, s |
//!
//! A payload that hears nothing for its time to live falls silent, or goes back to full power, by itself. It refuses numbers
//! outside of their range, other instances and the other command.

use std::time::Duration;

use quietpath_bridge::clock::Time;
use quietpath_bridge::link::Identity;
use quietpath_bridge::link::dialect::*;
pub use quietpath_bridge::payload::Kind;

/// Time to live of a command that names none, s.
const TIME_TO_LIVE: f32 = 1.0;
/// Time between heartbeats.
const HEARTBEAT: Duration = Duration::from_secs(1);

/// What a payload is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Spec {
    /// What it does.
    pub kind: Kind,
    /// Its component id.
    pub component: u8,
    /// Its number there.
    pub instance: u8,
}

/// A payload. See the [module](self).
#[derive(Clone, Debug)]
pub struct Payload {
    spec: Spec,
    /// Jamming level, or fraction of the transmit power, and direction.
    level: f32,
    azimuth_deg: f32,
    elevation_deg: f32,
    until: Option<Time>,
    heartbeat: Option<Time>,
    commands: u64,
    expiries: u64,
}

impl Payload {
    /// A payload that has heard nothing yet.
    #[must_use]
    pub const fn new(spec: Spec) -> Self {
        let level = rest(spec.kind);
        let (azimuth_deg, elevation_deg) = (0.0, 0.0);
        let (commands, expiries) = (0, 0);
        Self { spec, level, azimuth_deg, elevation_deg, until: None, heartbeat: None, commands, expiries }
    }

    /// What it is.
    #[must_use]
    pub const fn spec(&self) -> Spec {
        self.spec
    }

    /// Jamming level of a jammer, fraction of full power of a transmitter, 0 to 1.
    #[must_use]
    pub const fn level(&self) -> f32 {
        self.level
    }

    /// Direction of a jammer: degrees clockwise from north, and above the horizon.
    #[must_use]
    pub const fn direction_deg(&self) -> [f32; 2] {
        [self.azimuth_deg, self.elevation_deg]
    }

    /// Commands that it took.
    #[must_use]
    pub const fn commands(&self) -> u64 {
        self.commands
    }

    /// How often it fell silent, or went back to full power, because it heard nothing.
    #[must_use]
    pub const fn expiries(&self) -> u64 {
        self.expiries
    }

    /// Takes a command; its answer.
    pub(super) fn command(&mut self, now: Time, data: &COMMAND_LONG_DATA) -> MavResult {
        let is_jammer = match (self.spec.kind, data.command) {
            (Kind::Transmitter, MavCmd::MAV_CMD_USER_1) => false,
            (Kind::Jammer, MavCmd::MAV_CMD_USER_2) => true,
            _ => return MavResult::MAV_RESULT_UNSUPPORTED,
        };
        let life = if is_jammer { data.param5 } else { data.param3 };
        let numbers = [data.param1, data.param2, data.param3, data.param4, data.param5];
        let is_good = numbers.iter().all(|number| number.is_finite())
            && data.param1 == f32::from(self.spec.instance)
            && (0.0..=1.0).contains(&data.param2)
            && (0.0..=60.0).contains(&life);
        if !is_good {
            return MavResult::MAV_RESULT_DENIED;
        }
        self.level = data.param2;
        if is_jammer {
            (self.azimuth_deg, self.elevation_deg) = (data.param3, data.param4);
        }
        let life = if life > 0.0 { life } else { TIME_TO_LIVE };
        self.until = Some(now + Duration::from_secs_f32(life));
        self.commands += 1;
        MavResult::MAV_RESULT_ACCEPTED
    }

    /// Falls silent where it heard nothing for its time to live.
    pub(super) fn expire(&mut self, now: Time) {
        if self.until.is_some_and(|until| now > until) {
            self.until = None;
            self.expiries += u64::from(self.level != rest(self.spec.kind));
            self.level = rest(self.spec.kind);
        }
    }

    /// Falls silent, and says what is due.
    pub(super) fn poll(&mut self, now: Time, boot_ms: u32, out: &mut Vec<MavMessage>) {
        self.expire(now);
        if self.heartbeat.is_none_or(|sent| now.since(sent) >= HEARTBEAT) {
            self.heartbeat = Some(now);
            out.push(MavMessage::HEARTBEAT(HEARTBEAT_DATA {
                custom_mode: 0,
                mavtype: MavType::MAV_TYPE_GENERIC,
                autopilot: MavAutopilot::MAV_AUTOPILOT_INVALID,
                base_mode: MavModeFlag::empty(),
                system_status: MavState::MAV_STATE_ACTIVE,
                mavlink_version: 3,
            }));
            let name = match self.spec.kind {
                Kind::Transmitter => "power",
                Kind::Jammer => "jam",
            };
            let data = NAMED_VALUE_FLOAT_DATA { time_boot_ms: boot_ms, value: self.level, name: name.into() };
            out.push(MavMessage::NAMED_VALUE_FLOAT(data));
        }
    }

    /// Who it is on a vehicle.
    pub(super) const fn identity(&self, system: u8) -> Identity {
        Identity { system, component: self.spec.component }
    }
}

/// What a payload does when it is told nothing.
const fn rest(kind: Kind) -> f32 {
    match kind {
        Kind::Transmitter => 1.0,
        Kind::Jammer => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn jam(level: f32, instance: f32, life: f32) -> COMMAND_LONG_DATA {
        let command = MavCmd::MAV_CMD_USER_2;
        COMMAND_LONG_DATA {
            param1: instance,
            param2: level,
            param3: 90.0,
            param5: life,
            command,
            ..Default::default()
        }
    }

    #[test]
    fn a_jammer_that_hears_nothing_falls_silent() {
        let mut jammer = Payload::new(Spec { kind: Kind::Jammer, component: 26, instance: 2 });
        let at = Time::from_millis;
        assert_eq!(jammer.command(at(0), &jam(0.5, 2.0, 1.0)), MavResult::MAV_RESULT_ACCEPTED);
        let mut out = Vec::new();
        jammer.poll(at(1000), 0, &mut out);
        assert_eq!((jammer.level(), jammer.direction_deg()), (0.5, [90.0, 0.0]));
        jammer.poll(at(1001), 0, &mut out);
        assert_eq!((jammer.level(), jammer.expiries()), (0.0, 1));
        for (wrong, result) in [
            (jam(1.5, 2.0, 1.0), MavResult::MAV_RESULT_DENIED),
            (jam(f32::NAN, 2.0, 1.0), MavResult::MAV_RESULT_DENIED),
            (jam(0.5, 0.0, 1.0), MavResult::MAV_RESULT_DENIED),
            (jam(0.5, 2.0, 3600.0), MavResult::MAV_RESULT_DENIED),
            (
                COMMAND_LONG_DATA { command: MavCmd::MAV_CMD_USER_1, ..jam(0.5, 2.0, 1.0) },
                MavResult::MAV_RESULT_UNSUPPORTED,
            ),
        ] {
            assert_eq!((jammer.command(at(2000), &wrong), jammer.level()), (result, 0.0), "{wrong:?}");
        }
    }
}
