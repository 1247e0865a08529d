//! What the autopilot says by itself, and how often: nothing but heartbeats until SET_MESSAGE_INTERVAL asks for more.

use std::collections::BTreeMap;
use std::time::Duration;

use quietpath_bridge::clock::Time;

/// Messages that can be asked for: SYS_STATUS, GPS_RAW_INT, ATTITUDE, LOCAL_POSITION_NED, GLOBAL_POSITION_INT,
/// MISSION_CURRENT, HOME_POSITION, EXTENDED_SYS_STATE.
pub(super) const STREAMS: [u32; 8] = [1, 24, 30, 32, 33, 42, 242, 245];
/// The shortest interval that an autopilot grants.
const SHORTEST: Duration = Duration::from_millis(20);

/// Intervals, by message.
#[derive(Clone, Debug, Default)]
pub(super) struct Streams {
    each: BTreeMap<u32, (Duration, Option<Time>)>,
}

impl Streams {
    /// Sets an interval: microseconds, 0 for the default, -1 for never. False for a message that is not known.
    pub(super) fn set(&mut self, message: u32, micros: f32) -> bool {
        if !STREAMS.contains(&message) {
            return false;
        }
        if micros > 0.0 {
            let interval = Duration::from_micros(micros as u64).max(SHORTEST);
            let last = self.each.get(&message).and_then(|(_, last)| *last);
            self.each.insert(message, (interval, last));
        } else {
            self.each.remove(&message);
        }
        true
    }

    /// The messages that are due.
    pub(super) fn due(&mut self, now: Time) -> Vec<u32> {
        let due = |(message, (interval, last)): (&u32, &mut (Duration, Option<Time>))| {
            if last.is_some_and(|last| now.since(last) < *interval) {
                return None;
            }
            // In step with the interval, so that ticks that do not divide it do not slow it down.
            let next = last.map_or(now, |last| last + *interval);
            *last = Some(if now.since(next) > *interval { now } else { next });
            Some(*message)
        };
        self.each.iter_mut().filter_map(due).collect()
    }

    /// Nothing is asked for any more.
    pub(super) fn clear(&mut self) {
        self.each.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_come_as_often_as_they_were_asked_for() {
        let mut streams = Streams::default();
        assert!(streams.set(33, 100_000.0) && streams.set(42, 500_000.0) && !streams.set(4711, 1e6));
        let mut counts = BTreeMap::new();
        for tick in 0..100 {
            for message in streams.due(Time::from_millis(tick * 30)) {
                *counts.entry(message).or_insert(0) += 1;
            }
        }
        // 2.97 s: at 0 and every interval after.
        assert_eq!(counts, BTreeMap::from([(33, 30), (42, 6)]));
        streams.set(33, -1.0);
        streams.clear();
        assert!(streams.due(Time::from_millis(99_000)).is_empty());
    }
}
