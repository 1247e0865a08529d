//! Round trips by TIMESYNC: a question once a second, and answers to the questions of others.

use std::time::Duration;

use crate::clock::Time;
use crate::link::Identity;
use crate::link::dialect::{MavMessage, TIMESYNC_DATA};

/// How often to ask.
const INTERVAL: Duration = Duration::from_secs(1);
/// Longest round trip that an answer is believed to have.
const ROUND_TRIP_MAX: Duration = Duration::from_secs(10);

/// Asks for the time, and tells it.
#[derive(Clone, Copy, Debug, Default)]
pub struct Timesync {
    asked: Option<Time>,
}

impl Timesync {
    /// Takes a message; a round trip where it answers us.
    pub fn handle(&mut self, now: Time, data: &TIMESYNC_DATA, out: &mut Vec<MavMessage>) -> Option<Duration> {
        if data.tc1 == 0 {
            out.push(MavMessage::TIMESYNC(TIMESYNC_DATA { tc1: nanos(now), ts1: data.ts1, ..Default::default() }));
            return None;
        }
        // Only the answer to the last question: others may ask over the same link, and their answers pass by.
        let asked = self.asked.filter(|asked| nanos(*asked) == data.ts1)?;
        Some(now.since(asked)).filter(|span| *span <= ROUND_TRIP_MAX)
    }

    /// Asks, when it is time.
    pub fn poll(&mut self, now: Time, vehicle: Identity, out: &mut Vec<MavMessage>) {
        if self.asked.is_some_and(|asked| now.since(asked) < INTERVAL) {
            return;
        }
        self.asked = Some(now);
        let (target_system, target_component) = (vehicle.system, vehicle.component);
        out.push(MavMessage::TIMESYNC(TIMESYNC_DATA { tc1: 0, ts1: nanos(now), target_system, target_component }));
    }
}

fn nanos(time: Time) -> i64 {
    // Zero would be no answer, and the clock may read zero.
    i64::try_from(time.micros().saturating_mul(1000)).unwrap_or(i64::MAX).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_question_is_timed_and_others_are_answered() {
        let vehicle = Identity { system: 1, component: 1 };
        let (mut ours, mut theirs) = (Timesync::default(), Timesync::default());
        let at = Time::from_millis;
        let mut out = Vec::new();
        ours.poll(at(0), vehicle, &mut out);
        ours.poll(at(999), vehicle, &mut out);
        let [MavMessage::TIMESYNC(question)] = out.as_slice() else { panic!("{out:?}") };
        let mut answers = Vec::new();
        assert_eq!(theirs.handle(at(50_000), question, &mut answers), None);
        let [MavMessage::TIMESYNC(answer)] = answers.as_slice() else { panic!("{answers:?}") };
        assert_eq!(ours.handle(at(70), answer, &mut Vec::new()), Some(Duration::from_millis(70)));
        let stale = TIMESYNC_DATA { ts1: answer.ts1 + 1, ..*answer };
        assert_eq!(ours.handle(at(70), &stale, &mut Vec::new()), None);
    }
}
