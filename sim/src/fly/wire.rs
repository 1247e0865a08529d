//! What went over the wire, for people to read: what matters one by one, what streams as a count.

use std::collections::BTreeMap;

use quietpath_bridge::clock::Time;
use quietpath_bridge::link::dialect::MavMessage;
use quietpath_bridge::link::dialect::Message as _;

use crate::page::Message;

/// Lines that are kept one by one.
const LINES_MAX: usize = 600;
/// Longest content of a line, characters.
const CONTENT_MAX: usize = 240;

/// Messages that stream: telemetry, heartbeats, setpoints.
const STREAMS: [&str; 14] = [
    "HEARTBEAT",
    "ATTITUDE",
    "GLOBAL_POSITION_INT",
    "LOCAL_POSITION_NED",
    "GPS_RAW_INT",
    "SYS_STATUS",
    "EXTENDED_SYS_STATE",
    "HOME_POSITION",
    "MISSION_CURRENT",
    "VFR_HUD",
    "TIMESYNC",
    "SYSTEM_TIME",
    "SET_POSITION_TARGET_GLOBAL_INT",
    "SET_POSITION_TARGET_LOCAL_NED",
];

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
    streams: BTreeMap<(Direction, &'static str), Line>,
    beyond: u64,
}

impl Wiretap {
    /// Notes a message.
    pub fn hear(&mut self, time: Time, direction: Direction, message: &MavMessage) {
        let name = message.message_name();
        if STREAMS.contains(&name) {
            let fresh = || Line { first: time, last: time, direction, name, count: 0, content: String::new() };
            let line = self.streams.entry((direction, name)).or_insert_with(fresh);
            line.last = time;
            line.count += 1;
            return;
        }
        if let Some(line) = self.lines.last_mut().filter(|line| line.name == name && line.direction == direction) {
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
            all.push(message(line, format!("{} in all, {}", line.count, until(line))));
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
        assert!(messages[1].content.starts_with("3 in a row, the first: ") && messages[1].content.contains("count: 7"));
    }
}
