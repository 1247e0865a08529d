//! What went over the wire, for people to read: what matters one by one, what streams as a count.
//!
//! A stream is a message that says where something is, or that somebody is there, many times a second. Commands to payloads
//! are repeated too: those that say something new have a line of their own, the rest is counted.
//!
//! Limits: `LINES_MAX` lines; what comes later is counted.

use std::collections::BTreeMap;

use quietpath_bridge::clock::Time;
use quietpath_bridge::link::codec;
use quietpath_bridge::link::dialect::{COMMAND_LONG_DATA, MavCmd, MavMessage};

use crate::page::Message;

/// Lines that are kept one by one.
const LINES_MAX: usize = 600;
/// Longest content of a line, characters.
const CONTENT_MAX: usize = 240;

/// Messages that stream: telemetry, heartbeats, setpoints.
const STREAMS: [&str; 15] = [
    "HEARTBEAT",
    "ATTITUDE",
    "GLOBAL_POSITION_INT",
    "LOCAL_POSITION_NED",
    "GPS_RAW_INT",
    "SYS_STATUS",
    "EXTENDED_SYS_STATE",
    "HOME_POSITION",
    "MISSION_CURRENT",
    "NAMED_VALUE_FLOAT",
    "VFR_HUD",
    "TIMESYNC",
    "SYSTEM_TIME",
    "SET_POSITION_TARGET_GLOBAL_INT",
    "SET_POSITION_TARGET_LOCAL_NED",
];

/// Commands that payloads hear over and over: transmit power, jamming.
const PAYLOAD: [MavCmd; 2] = [MavCmd::MAV_CMD_USER_1, MavCmd::MAV_CMD_USER_2];

/// Name of the message, and what kind of it.
type Stream = (&'static str, &'static str);

/// From whom to whom.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Direction {
    /// From the bridge to the vehicle.
    Up,
    /// From the vehicle to the bridge.
    Down,
}

impl Direction {
    const fn words(self) -> &'static str {
        match self {
            Self::Up => "bridge \u{2192} vehicle",
            Self::Down => "vehicle \u{2192} bridge",
        }
    }
}

/// Equal messages in a row, or all of a stream.
#[derive(Clone, Debug)]
struct Line {
    first: Time,
    last: Time,
    direction: Direction,
    name: &'static str,
    count: u64,
    content: String,
}

/// Notes what goes over the wire.
#[derive(Clone, Debug, Default)]
pub struct Wiretap {
    lines: Vec<Line>,
    streams: BTreeMap<(Direction, Stream), Line>,
    /// What each payload was told last: by component and command.
    told: Vec<(u8, MavCmd, [f32; 3])>,
    beyond: u64,
}

impl Wiretap {
    /// Notes a message.
    pub fn hear(&mut self, time: Time, direction: Direction, message: &MavMessage) {
        let name = codec::name(message);
        if let Some(stream) = self.stream(message) {
            let fresh = || Line { first: time, last: time, direction, name, count: 0, content: stream.1.to_owned() };
            let line = self.streams.entry((direction, stream)).or_insert_with(fresh);
            line.last = time;
            line.count += 1;
            return;
        }
        // Requests and items alternate: both of the last two lines go on.
        let is_same = |line: &&mut Line| line.name == name && line.direction == direction && name != "COMMAND_LONG";
        if let Some(line) = self.lines.iter_mut().rev().take(2).find(is_same) {
            line.last = time;
            line.count += 1;
            return;
        }
        if self.lines.len() >= LINES_MAX {
            self.beyond += 1;
            return;
        }
        let content = content(message);
        self.lines.push(Line { first: time, last: time, direction, name, count: 1, content });
    }

    /// The stream that a message belongs to; none where it is worth a line.
    fn stream(&mut self, message: &MavMessage) -> Option<Stream> {
        match message {
            MavMessage::COMMAND_LONG(data) if PAYLOAD.contains(&data.command) => {
                (!self.is_news(data)).then_some((codec::name(message), "the same said again to a payload"))
            }
            MavMessage::COMMAND_ACK(data) if PAYLOAD.contains(&data.command) => {
                Some((codec::name(message), "answers of payloads"))
            }
            _ => STREAMS.iter().find(|name| **name == codec::name(message)).map(|name| (*name, "")),
        }
    }

    /// Whether a payload is told something else than before. The time to live, said each time, is no news.
    fn is_news(&mut self, data: &COMMAND_LONG_DATA) -> bool {
        let says = [data.param2, data.param3, data.param4];
        let known =
            self.told.iter_mut().find(|(to, command, _)| (*to, *command) == (data.target_component, data.command));
        match known {
            Some((_, _, before)) => std::mem::replace(before, says) != says,
            None => {
                self.told.push((data.target_component, data.command, says));
                true
            }
        }
    }

    /// What was heard: streams first, then the rest in order; `zero` is what to add to the clock for the scenario's time, s.
    #[must_use]
    pub fn messages(&self, zero: f64) -> Vec<Message> {
        let message = |line: &Line, content: String| Message {
            time: line.first.seconds() + zero,
            way: line.direction.words().to_owned(),
            name: line.name.to_owned(),
            content,
        };
        let until = |line: &Line| format!("until {:.1} s", line.last.seconds() + zero);
        let mut all: Vec<Message> = Vec::new();
        for line in self.streams.values() {
            let what = if line.content.is_empty() { String::new() } else { format!(", {}", line.content) };
            all.push(message(line, format!("{} in all{what}, {}", line.count, until(line))));
        }
        for line in &self.lines {
            let more = if line.count > 1 { format!("{} in a row, the first: ", line.count) } else { String::new() };
            all.push(message(line, format!("{more}{}", line.content)));
        }
        if self.beyond > 0 {
            let content = format!("{} further messages are in no line", self.beyond);
            let time = self.lines.last().map_or(zero, |line| line.last.seconds() + zero);
            all.push(Message { time, way: String::new(), name: "..".into(), content });
        }
        all
    }
}

/// The fields of a message, as its type prints them.
fn content(message: &MavMessage) -> String {
    let text = format!("{message:?}");
    let inner = text.split_once("_DATA {").map_or(text.as_str(), |(_, rest)| rest.trim_end_matches([')', '}', ' ']));
    let inner = inner.trim();
    if inner.chars().count() <= CONTENT_MAX {
        return inner.to_owned();
    }
    inner.chars().take(CONTENT_MAX).chain("..".chars()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use quietpath_bridge::link::codec::companion_heartbeat;
    use quietpath_bridge::link::dialect::MISSION_COUNT_DATA;

    #[test]
    fn a_payload_that_is_told_the_same_again_has_no_line_more() {
        let mut tap = Wiretap::default();
        for (millis, level) in [0.0, 0.0, 0.5, 0.5, 0.5, 0.0].into_iter().enumerate() {
            let data = COMMAND_LONG_DATA { command: MavCmd::MAV_CMD_USER_2, param2: level, ..Default::default() };
            tap.hear(Time::from_millis(millis as u64), Direction::Up, &MavMessage::COMMAND_LONG(data));
        }
        let messages = tap.messages(0.0);
        let contents: Vec<&str> = messages.iter().map(|message| message.content.as_str()).collect();
        assert_eq!(messages.len(), 4, "{contents:#?}");
        assert!(contents[0].starts_with("3 in all, the same said again"), "{contents:#?}");
        assert!(contents[2].contains("param2: 0.5"), "{contents:#?}");
    }

    #[test]
    fn streams_are_counted_and_the_rest_is_told() {
        let mut tap = Wiretap::default();
        let count = MavMessage::MISSION_COUNT(MISSION_COUNT_DATA { count: 7, ..Default::default() });
        for second in 0..3 {
            tap.hear(Time::from_millis(1000 * second), Direction::Up, &companion_heartbeat());
            tap.hear(Time::from_millis(1000 * second + 500), Direction::Up, &count);
        }
        let messages = tap.messages(100.0);
        assert_eq!(messages.len(), 2, "{messages:?}");
        assert_eq!((messages[0].name.as_str(), messages[0].time), ("HEARTBEAT", 100.0));
        assert_eq!(messages[0].content, "3 in all, until 102.0 s");
        assert!(
            messages[1].content.starts_with("3 in a row, the first: ") && messages[1].content.contains("count: 7")
        );
    }
}
