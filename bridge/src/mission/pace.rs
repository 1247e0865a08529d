//! How long to wait for an answer.
//!
//! The protocol's own limits, 1500 ms for an answer and 250 ms for an item, are lower bounds: on a slow link they are
//! shorter than the way there and back, and every answer would be asked for again. So they grow with the round trip,
//! which transfers measure themselves on answers that were asked for once.

use std::time::Duration;

/// Shortest wait for an answer that starts a transfer.
const ANSWER_MIN: Duration = Duration::from_millis(1500);
/// Shortest wait for an item.
const ITEM_MIN: Duration = Duration::from_millis(250);
/// What an autopilot takes to answer, on top of twice the round trip.
const SLACK: Duration = Duration::from_millis(100);

/// How fast the other end answers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pace {
    round_trip: Option<Duration>,
}

impl Pace {
    /// A pace by a measured round trip.
    #[must_use]
    pub const fn new(round_trip: Option<Duration>) -> Self {
        Self { round_trip }
    }

    /// Takes note of a round trip.
    pub(crate) fn measured(&mut self, span: Duration) {
        // Slow answers count at once, fast ones slowly: asking twice costs more than waiting a little.
        let smoothed = self.round_trip.map_or(span, |before| span.max((before * 7 + span) / 8));
        self.round_trip = Some(smoothed);
    }

    /// How long to wait for an answer that starts a transfer.
    #[must_use]
    pub fn answer(&self) -> Duration {
        self.round_trip.map_or(ANSWER_MIN, |round_trip| ANSWER_MIN.max(round_trip * 2 + SLACK))
    }

    /// How long to wait for an item.
    #[must_use]
    pub fn item(&self) -> Duration {
        self.round_trip.map_or(ANSWER_MIN, |round_trip| ITEM_MIN.max(round_trip * 2 + SLACK))
    }
}
