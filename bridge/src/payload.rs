//! Transmit power and jamming, relayed to payloads.
//!
//! Payloads are components of the vehicle with two commands of their own:
//!
//! | command | parameter 1 | 2 | 3 | 4 | 5 |
//! |---|---|---|---|---|---|
//! | `MAV_CMD_USER_1`, transmit power | instance | fraction of full power, 0 to 1 | time to live, s | | |
//! | `MAV_CMD_USER_2`, jamming | instance | level, 0 to 1 | azimuth, degrees clockwise from north | elevation, degrees | time to live, s |
//!
//! Each is repeated every [`REFRESH`] with a time to live: a payload that hears nothing for that long falls silent, or
//! goes back to full power, by itself. Nobody waits for the answer: the next repetition is the resend.
//!
//! **Radiating.** No jamming command leaves the bridge unless [`Radiation::Armed`], which needs both the switch on the
//! command line and the word of the scenario. And then: whoever calls [`Relay::poll`] without an emission gets level 0
//! sent. There is no state in which an old level is repeated.

use std::time::Duration;

use crate::clock::Time;
use crate::command::Command;
use crate::link::dialect::{MavCmd, MavMessage, MavResult};
use crate::link::{Frame, Identity};

/// How often payloads hear from the bridge.
pub const REFRESH: Duration = Duration::from_millis(250);
/// How soon a change is said again, as the first time may be lost.
const AGAIN: Duration = Duration::from_millis(30);
/// How often a change is said again that soon.
const AGAIN_TIMES: u8 = 2;
/// How long a payload goes on without hearing from the bridge, s.
pub const TIME_TO_LIVE_S: f32 = 1.0;

/// What a payload does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A transmitter whose power can be turned down.
    Transmitter,
    /// A jammer.
    Jammer,
}

/// A payload.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Payload {
    /// What it does.
    pub kind: Kind,
    /// Its component id on the vehicle.
    pub component: u8,
    /// Its number on that component.
    pub instance: u8,
}

/// Whether anything may be jammed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Radiation {
    /// No jamming command is ever sent.
    #[default]
    Off,
    /// The switch and the scenario both allow it.
    Armed,
}

/// What to emit now.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Emission {
    /// Jamming level, 0 to 1.
    pub level: f64,
    /// Jamming direction, rad, counter-clockwise from east.
    pub azimuth: f64,
    /// Reduction of the transmit power, 0 to 1.
    pub dropout: f64,
}

/// Tells payloads what to do. See the [module](self).
#[derive(Clone, Debug)]
pub struct Relay {
    payloads: Vec<Payload>,
    radiation: Radiation,
    sent: Option<Time>,
    last: Option<Emission>,
    /// How often the last change is still to be said soon.
    again: u8,
    /// What each payload answered last.
    answers: Vec<Option<MavResult>>,
}

impl Relay {
    /// A relay to some payloads.
    #[must_use]
    pub fn new(payloads: Vec<Payload>, radiation: Radiation) -> Self {
        let answers = vec![None; payloads.len()];
        Self { payloads, radiation, sent: None, last: None, again: 0, answers }
    }

    /// What is being emitted; `None` for nothing.
    #[must_use]
    pub const fn emission(&self) -> Option<Emission> {
        self.last
    }

    /// Takes a message of the link; what to tell people where a payload answers otherwise than before.
    pub fn handle(&mut self, frame: &Frame) -> Option<String> {
        let MavMessage::COMMAND_ACK(ack) = &frame.message else { return None };
        let answers = |payload: &Payload| {
            let command = match payload.kind {
                Kind::Transmitter => MavCmd::MAV_CMD_USER_1,
                Kind::Jammer => MavCmd::MAV_CMD_USER_2,
            };
            frame.from.component == payload.component && ack.command == command
        };
        let (payload, last) = self.payloads.iter().zip(&mut self.answers).find(|(payload, _)| answers(payload))?;
        let is_news = last.replace(ack.result) != Some(ack.result);
        is_news.then(|| format!("the payload at component {} answers {:?}", payload.component, ack.result))
    }

    /// Sends what is due. Without an emission, or with one that is not finite: level 0 and full power.
    ///
    /// A change does not wait for the next repetition, and is said thrice in a row.
    pub fn poll(&mut self, now: Time, vehicle: Identity, emission: Option<Emission>, out: &mut Vec<MavMessage>) {
        let is_finite = |emission: &Emission| {
            [emission.level, emission.azimuth, emission.dropout].iter().all(|number| number.is_finite())
        };
        let emission = emission.filter(is_finite);
        let is_change = emission != self.last;
        let wait = if self.again > 0 { AGAIN } else { REFRESH };
        if !is_change && self.sent.is_some_and(|sent| now.since(sent) < wait) {
            return;
        }
        self.again = if is_change { AGAIN_TIMES } else { self.again.saturating_sub(1) };
        (self.sent, self.last) = (Some(now), emission);
        self.speak(vehicle, emission, out);
    }

    /// Level 0 and full power, at once: for the moment before everything ends.
    pub fn silence(&mut self, vehicle: Identity, out: &mut Vec<MavMessage>) {
        self.last = None;
        self.speak(vehicle, None, out);
    }

    fn speak(&self, vehicle: Identity, emission: Option<Emission>, out: &mut Vec<MavMessage>) {
        for payload in &self.payloads {
            let to = Identity { system: vehicle.system, component: payload.component };
            let instance = f32::from(payload.instance);
            let command = match payload.kind {
                Kind::Transmitter => {
                    let power = 1.0 - emission.map_or(0.0, |emission| emission.dropout.clamp(0.0, 1.0));
                    let params = [instance, power as f32, TIME_TO_LIVE_S, 0.0, 0.0, 0.0, 0.0];
                    Command::new(MavCmd::MAV_CMD_USER_1, params)
                }
                Kind::Jammer if self.radiation == Radiation::Off => continue,
                Kind::Jammer => {
                    let (level, azimuth) =
                        emission.map_or((0.0, 0.0), |emission| (emission.level.clamp(0.0, 1.0), emission.azimuth));
                    let compass = (90.0 - azimuth.to_degrees()).rem_euclid(360.0);
                    let params = [instance, level as f32, compass as f32, 0.0, TIME_TO_LIVE_S, 0.0, 0.0];
                    Command::new(MavCmd::MAV_CMD_USER_2, params)
                }
            };
            out.push(command.long(to, 0));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const VEHICLE: Identity = Identity { system: 1, component: 1 };
    const JAM: Emission = Emission { level: 0.5, azimuth: 0.0, dropout: 0.25 };

    fn relay(radiation: Radiation) -> Relay {
        let transmitter = Payload { kind: Kind::Transmitter, component: 25, instance: 1 };
        Relay::new(vec![transmitter, Payload { kind: Kind::Jammer, component: 26, instance: 2 }], radiation)
    }

    fn levels(out: &[MavMessage]) -> Vec<(u32, [f32; 5])> {
        let level = |message: &MavMessage| match message {
            MavMessage::COMMAND_LONG(data) => {
                (data.command as u32, [data.param1, data.param2, data.param3, data.param4, data.param5])
            }
            other => panic!("{other:?}"),
        };
        out.iter().map(level).collect()
    }

    #[test]
    fn emissions_are_repeated_and_nothing_means_level_0_at_once() {
        let mut relay = relay(Radiation::Armed);
        let mut out = Vec::new();
        for tick in 0..10 {
            relay.poll(Time::from_millis(tick * 100), VEHICLE, Some(JAM), &mut out);
        }
        let (power, jam) = ((31010, [1.0, 0.75, 1.0, 0.0, 0.0]), (31011, [2.0, 0.5, 90.0, 0.0, 1.0]));
        // At 0, 100 and 200 ms, and then every 250 ms, as far as it is asked.
        assert_eq!(levels(&out), [power, jam].repeat(5));
        out.clear();
        relay.poll(Time::from_millis(901), VEHICLE, None, &mut out);
        let off = [(31010, [1.0, 1.0, 1.0, 0.0, 0.0]), (31011, [2.0, 0.0, 90.0, 0.0, 1.0])];
        assert_eq!(levels(&out), off);
        out.clear();
        relay.poll(Time::from_millis(902), VEHICLE, Some(Emission { level: f64::NAN, ..JAM }), &mut out);
        assert_eq!(out, [], "not a number is nothing, and nothing has been said");
        relay.poll(Time::from_millis(1200), VEHICLE, Some(Emission { level: f64::NAN, ..JAM }), &mut out);
        assert_eq!(levels(&out), off);
    }

    #[test]
    fn an_answer_is_news_once() {
        use crate::link::dialect::COMMAND_ACK_DATA;
        let mut relay = relay(Radiation::Armed);
        let mut answer = |component, command, result| {
            let ack = COMMAND_ACK_DATA { command, result, ..Default::default() };
            let from = Identity { system: 1, component };
            relay.handle(&Frame { from, sequence: 0, message: MavMessage::COMMAND_ACK(ack), bytes: Vec::new() })
        };
        let (power, accepted) = (MavCmd::MAV_CMD_USER_1, MavResult::MAV_RESULT_ACCEPTED);
        assert_eq!(answer(26, power, accepted), None, "that component is the jammer");
        let news = "the payload at component 25 answers MAV_RESULT_ACCEPTED";
        assert_eq!(answer(25, power, accepted).as_deref(), Some(news));
        assert_eq!(answer(25, power, accepted), None);
        assert!(answer(25, power, MavResult::MAV_RESULT_DENIED).is_some());
    }

    #[test]
    fn unarmed_no_jamming_command_leaves_at_all() {
        let mut relay = relay(Radiation::Off);
        let mut out = Vec::new();
        relay.poll(Time::ZERO, VEHICLE, Some(JAM), &mut out);
        relay.poll(Time::from_millis(1), VEHICLE, None, &mut out);
        relay.silence(VEHICLE, &mut out);
        assert!(levels(&out).iter().all(|(command, _)| *command == 31010), "{out:?}");
        assert_eq!(out.len(), 3);
    }

    #[test]
    fn levels_stay_between_0_and_1_and_azimuths_on_the_compass() {
        let mut relay = relay(Radiation::Armed);
        let mut out = Vec::new();
        let azimuth = std::f64::consts::PI;
        relay.poll(Time::ZERO, VEHICLE, Some(Emission { level: 7.0, azimuth, dropout: -1.0 }), &mut out);
        assert_eq!(levels(&out)[0].1[1], 1.0);
        assert_eq!(levels(&out)[1].1[1..3], [1.0, 270.0]);
    }
}
