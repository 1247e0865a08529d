//! Commands: sent until they are answered.
//!
//! An ACK names its command and nothing else, so at most one command of a kind is under way to a component; others
//! of that kind wait. A resend raises `confirmation`; IN_PROGRESS buys time; an autopilot that takes a command in the
//! other of the two messages only (COMMAND_LONG, COMMAND_INT) gets it there.

use std::collections::VecDeque;
use std::time::Duration;

use crate::clock::Time;
use crate::link::dialect::{
    COMMAND_ACK_DATA, COMMAND_INT_DATA, COMMAND_LONG_DATA, MavCmd, MavFrame, MavMessage, MavResult,
};
use crate::link::{Frame, Identity};
use crate::mission::item::wire_degrees;

/// Shortest wait for an answer.
const WAIT_MIN: Duration = Duration::from_millis(500);
/// How much longer a command may take that is in progress.
const PROGRESS: Duration = Duration::from_secs(10);
/// How often a command is sent.
const SENDS_MAX: u32 = 4;
/// Longest that a command may be in progress.
const LIFE_MAX: Duration = Duration::from_secs(120);

/// A command without its address.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Command {
    /// What to do.
    pub command: MavCmd,
    /// Parameters 1 to 7.
    pub params: [f32; 7],
}

impl Command {
    /// A command by its parameters.
    #[must_use]
    pub const fn new(command: MavCmd, params: [f32; 7]) -> Self {
        Self { command, params }
    }

    /// Asks for a message, `hertz` times a second.
    #[must_use]
    pub fn interval(message: u32, hertz: f32) -> Self {
        let micros = 1e6 / hertz;
        Self::new(MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL, [message as f32, micros, 0.0, 0.0, 0.0, 0.0, 0.0])
    }

    /// Goes on with the mission at an item.
    #[must_use]
    pub fn set_current(item: u16) -> Self {
        let params = [f32::from(item), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        Self::new(MavCmd::MAV_CMD_DO_SET_MISSION_CURRENT, params)
    }

    /// As COMMAND_LONG.
    #[must_use]
    pub const fn long(&self, to: Identity, confirmation: u8) -> MavMessage {
        let [param1, param2, param3, param4, param5, param6, param7] = self.params;
        MavMessage::COMMAND_LONG(COMMAND_LONG_DATA {
            param1,
            param2,
            param3,
            param4,
            param5,
            param6,
            param7,
            command: self.command,
            target_system: to.system,
            target_component: to.component,
            confirmation,
        })
    }

    /// As COMMAND_INT; parameters 5 and 6 are taken for degrees.
    #[must_use]
    pub fn int(&self, to: Identity) -> MavMessage {
        let [param1, param2, param3, param4, x, y, z] = self.params;
        MavMessage::COMMAND_INT(COMMAND_INT_DATA {
            param1,
            param2,
            param3,
            param4,
            x: wire_degrees(f64::from(x)),
            y: wire_degrees(f64::from(y)),
            z,
            command: self.command,
            target_system: to.system,
            target_component: to.component,
            frame: MavFrame::MAV_FRAME_GLOBAL,
            current: 0,
            autocontinue: 0,
        })
    }
}

/// How a command ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome {
    /// It was answered.
    Answered(MavResult),
    /// It was not.
    Silent,
}

impl Outcome {
    /// Whether it was done.
    #[must_use]
    pub fn is_done(self) -> bool {
        self == Self::Answered(MavResult::MAV_RESULT_ACCEPTED)
    }
}

/// A command that ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ended {
    /// What [`Commands::submit`] returned for it.
    pub ticket: u64,
    /// The command.
    pub command: Command,
    /// How it ended.
    pub outcome: Outcome,
}

#[derive(Clone, Copy, Debug)]
struct Pending {
    ticket: u64,
    to: Identity,
    command: Command,
    is_int: bool,
    swapped: bool,
    sends: u32,
    begun: Time,
    due: Option<Time>,
}

/// Commands under way. See the [module](self).
#[derive(Clone, Debug, Default)]
pub struct Commands {
    pending: VecDeque<Pending>,
    tickets: u64,
}

impl Commands {
    /// Takes a command; [`Commands::poll`] sends it. The number names it when it ends.
    pub fn submit(&mut self, now: Time, to: Identity, command: Command) -> u64 {
        self.tickets += 1;
        let ticket = self.tickets;
        let (is_int, swapped, sends, due) = (false, false, 0, None);
        self.pending.push_back(Pending { ticket, to, command, is_int, swapped, sends, begun: now, due });
        ticket
    }

    /// The same for a command that says where to be, such as a mode: what was asked of that kind before is no longer meant,
    /// and is not sent again. An answer to it that is still on its way counts for this one.
    pub fn supersede(&mut self, now: Time, to: Identity, command: Command) -> u64 {
        self.pending.retain(|pending| pending.to != to || pending.command.command != command.command);
        self.submit(now, to, command)
    }

    /// Number of commands that have not ended.
    #[must_use]
    pub fn under_way(&self) -> usize {
        self.pending.len()
    }

    /// Takes a message of the link; the command that it ends.
    pub fn handle(&mut self, now: Time, us: Identity, frame: &Frame) -> Option<Ended> {
        let MavMessage::COMMAND_ACK(ack) = &frame.message else { return None };
        if !is_for(us, ack) {
            return None;
        }
        let answers = |pending: &Pending| {
            pending.due.is_some() && pending.to == frame.from && pending.command.command == ack.command
        };
        let index = self.pending.iter().position(answers)?;
        let pending = self.pending.get_mut(index)?;
        match ack.result {
            MavResult::MAV_RESULT_IN_PROGRESS if now.since(pending.begun) < LIFE_MAX => {
                pending.due = Some(now + PROGRESS);
                None
            }
            MavResult::MAV_RESULT_COMMAND_INT_ONLY | MavResult::MAV_RESULT_COMMAND_LONG_ONLY if !pending.swapped => {
                pending.is_int = ack.result == MavResult::MAV_RESULT_COMMAND_INT_ONLY;
                (pending.swapped, pending.sends, pending.due) = (true, 0, None);
                None
            }
            result => {
                let Pending { ticket, command, .. } = *pending;
                self.pending.remove(index);
                Some(Ended { ticket, command, outcome: Outcome::Answered(result) })
            }
        }
    }

    /// Sends what is due; commands that nobody answered.
    pub fn poll(&mut self, now: Time, round_trip: Option<Duration>, out: &mut Vec<MavMessage>) -> Vec<Ended> {
        let wait = round_trip.map_or(WAIT_MIN, |round_trip| WAIT_MIN.max(round_trip * 2));
        let mut busy: Vec<(Identity, MavCmd)> = Vec::new();
        let mut ended = Vec::new();
        self.pending.retain_mut(|pending| {
            let kind = (pending.to, pending.command.command);
            if busy.contains(&kind) {
                return true;
            }
            busy.push(kind);
            if pending.due.is_some_and(|due| now < due) {
                return true;
            }
            if pending.sends >= SENDS_MAX {
                let Pending { ticket, command, .. } = *pending;
                ended.push(Ended { ticket, command, outcome: Outcome::Silent });
                return false;
            }
            let confirmation = u8::try_from(pending.sends).unwrap_or(u8::MAX);
            out.push(if pending.is_int {
                pending.command.int(pending.to)
            } else {
                pending.command.long(pending.to, confirmation)
            });
            (pending.sends, pending.due) = (pending.sends + 1, Some(now + wait));
            true
        });
        ended
    }
}

/// Older autopilots leave the address of an ACK empty.
const fn is_for(us: Identity, ack: &COMMAND_ACK_DATA) -> bool {
    (ack.target_system == 0 || ack.target_system == us.system)
        && (ack.target_component == 0 || ack.target_component == us.component)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mode_that_is_asked_for_no_longer_is_not_sent_again() {
        let vehicle = Identity { system: 1, component: 1 };
        let mode = |mode| Command::new(MavCmd::MAV_CMD_DO_SET_MODE, [mode; 7]);
        let mut commands = Commands::default();
        for second in 0..20 {
            commands.supersede(Time::from_millis(second * 1000), vehicle, mode(1.0));
            commands.poll(Time::from_millis(second * 1000), None, &mut Vec::new());
        }
        assert_eq!(commands.under_way(), 1, "nobody answers, and they pile up");
        commands.supersede(Time::from_millis(20_000), vehicle, mode(2.0));
        let mut out = Vec::new();
        commands.poll(Time::from_millis(20_000), None, &mut out);
        assert!(matches!(out.as_slice(), [MavMessage::COMMAND_LONG(data)] if data.param1 == 2.0), "{out:?}");
    }

    const VEHICLE: Identity = Identity { system: 1, component: 1 };
    const US: Identity = Identity::COMPANION;

    fn at(millis: u64) -> Time {
        Time::from_millis(millis)
    }

    fn ack(command: MavCmd, result: MavResult, component: u8) -> Frame {
        let data =
            COMMAND_ACK_DATA { command, result, target_system: 1, target_component: component, ..Default::default() };
        Frame { from: VEHICLE, sequence: 0, message: MavMessage::COMMAND_ACK(data), bytes: Vec::new() }
    }

    fn confirmations(out: &[MavMessage]) -> Vec<u8> {
        let confirmation = |message: &MavMessage| match message {
            MavMessage::COMMAND_LONG(data) => data.confirmation,
            _ => 255,
        };
        out.iter().map(confirmation).collect()
    }

    #[test]
    fn a_command_is_sent_again_and_then_given_up() {
        let mut commands = Commands::default();
        let ticket = commands.submit(at(0), VEHICLE, Command::set_current(3));
        let mut out = Vec::new();
        let mut ended = Vec::new();
        for tick in 0..50 {
            ended.extend(commands.poll(at(tick * 100), None, &mut out));
        }
        assert_eq!(confirmations(&out), [0, 1, 2, 3]);
        let [end] = ended.as_slice() else { panic!("{ended:?}") };
        assert_eq!((end.ticket, end.outcome), (ticket, Outcome::Silent));
        assert_eq!(commands.under_way(), 0);
    }

    #[test]
    fn progress_buys_time_and_other_stations_acks_are_not_ours() {
        let mut commands = Commands::default();
        commands.submit(at(0), VEHICLE, Command::set_current(3));
        let command = MavCmd::MAV_CMD_DO_SET_MISSION_CURRENT;
        let mut out = Vec::new();
        commands.poll(at(0), None, &mut out);
        assert_eq!(commands.handle(at(1), US, &ack(command, MavResult::MAV_RESULT_ACCEPTED, 190)), None);
        assert_eq!(commands.handle(at(1), US, &ack(command, MavResult::MAV_RESULT_IN_PROGRESS, 191)), None);
        assert!(commands.poll(at(9_000), None, &mut out).is_empty());
        assert_eq!(out.len(), 1);
        let ended = commands.handle(at(9_500), US, &ack(command, MavResult::MAV_RESULT_DENIED, 191)).expect("ended");
        assert_eq!(ended.outcome, Outcome::Answered(MavResult::MAV_RESULT_DENIED));
    }

    #[test]
    fn one_of_a_kind_is_under_way_and_int_only_is_sent_as_int() {
        let mut commands = Commands::default();
        let first = commands.submit(at(0), VEHICLE, Command::interval(33, 10.0));
        let second = commands.submit(at(0), VEHICLE, Command::interval(42, 2.0));
        let command = MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL;
        let mut out = Vec::new();
        commands.poll(at(0), None, &mut out);
        assert_eq!(out.len(), 1, "an ACK would not say which");
        let int_only = ack(command, MavResult::MAV_RESULT_COMMAND_INT_ONLY, 191);
        assert_eq!(commands.handle(at(1), US, &int_only), None);
        commands.poll(at(2), None, &mut out);
        assert!(matches!(out.last(), Some(MavMessage::COMMAND_INT(data)) if data.param1 == 33.0), "{out:?}");
        let accepted = ack(command, MavResult::MAV_RESULT_ACCEPTED, 191);
        assert_eq!(commands.handle(at(3), US, &accepted).expect("ended").ticket, first);
        assert_eq!(commands.handle(at(3), US, &accepted), None, "a duplicate answers nothing that was not sent");
        commands.poll(at(4), None, &mut out);
        assert_eq!(commands.handle(at(5), US, &accepted).expect("ended").ticket, second);
    }
}
