//! What a link received, lost and refused.
//!
//! Losses are gaps in the sequence numbers of each sender. A frame that comes late is counted as received and its
//! loss taken back; a duplicate is neither.

use std::collections::BTreeMap;
use std::time::Duration;

use super::codec::Identity;

/// Counters of one end of a link, since it was made.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Statistics {
    /// Bytes received.
    pub bytes_in: u64,
    /// Bytes of intact frames.
    pub bytes_framed: u64,
    /// Frames accepted.
    pub frames_in: u64,
    /// Frames sent.
    pub frames_out: u64,
    /// Intact frames that could not be decoded: unknown messages or values.
    pub unreadable: u64,
    /// Frames refused for having no signature, or a wrong one.
    pub unsigned: u64,
    /// Frames refused because their signature's timestamp is not new.
    pub replayed: u64,
    /// Frames from others than the peer.
    pub stray: u64,
    /// Frames that did not fit in the queue to the device, and chunks that did not fit in the queue from it.
    pub overrun: u64,
    /// Times that the device was opened.
    pub opened: u64,
    /// Round trip by `TIMESYNC`, smoothed; `None` before the first answer.
    pub round_trip: Option<Duration>,
    senders: BTreeMap<Identity, Sender>,
}

/// One sender's sequence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Sender {
    expected: u8,
    received: u64,
    lost: u64,
    /// Which of the 64 numbers before the expected one have come: bit 0 is the one just before.
    seen: u64,
}

impl Statistics {
    /// Frames that never came, over all senders.
    #[must_use]
    pub fn lost(&self) -> u64 {
        self.senders.values().map(|sender| sender.lost).sum()
    }

    /// Bytes that belonged to no intact frame, those of a frame that is not complete yet among them.
    #[must_use]
    pub const fn junk(&self) -> u64 {
        self.bytes_in.saturating_sub(self.bytes_framed)
    }

    /// Share of the frames that never came, 0 to 1.
    #[must_use]
    pub fn loss(&self) -> f64 {
        let received: u64 = self.senders.values().map(|sender| sender.received).sum();
        let sent = received + self.lost();
        if sent == 0 { 0.0 } else { self.lost() as f64 / sent as f64 }
    }

    /// Takes note of a frame's sequence number.
    pub(super) fn count(&mut self, from: Identity, sequence: u8) {
        let fresh = Sender { expected: sequence, received: 0, lost: 0, seen: u64::MAX };
        self.senders.entry(from).or_insert(fresh).count(sequence);
    }

    /// Takes note of a round trip.
    pub(crate) fn round_trip(&mut self, measured: Duration) {
        let smoothed = self.round_trip.map_or(measured, |before| (before * 7 + measured) / 8);
        self.round_trip = Some(smoothed);
    }
}

impl Sender {
    fn count(&mut self, sequence: u8) {
        /// Numbers that far ahead are ahead; further away they are late.
        const AHEAD: u8 = 128;
        let gap = sequence.wrapping_sub(self.expected);
        if gap < AHEAD {
            self.lost += u64::from(gap);
            self.received += 1;
            self.seen = self.seen.checked_shl(u32::from(gap) + 1).unwrap_or(0) | 1;
            self.expected = sequence.wrapping_add(1);
            return;
        }
        let behind = u32::from(self.expected.wrapping_sub(sequence)) - 1;
        let bit = 1_u64.checked_shl(behind).unwrap_or(0);
        if bit != 0 && self.seen & bit == 0 {
            self.seen |= bit;
            self.received += 1;
            self.lost = self.lost.saturating_sub(1);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(sequence: impl IntoIterator<Item = u8>) -> (u64, f64) {
        let mut statistics = Statistics::default();
        for number in sequence {
            statistics.count(Identity::COMPANION, number);
        }
        (statistics.lost(), statistics.loss())
    }

    #[test]
    fn gaps_are_losses_and_latecomers_are_not() {
        assert_eq!(after([250, 251, 252, 253, 254, 255, 0, 1]), (0, 0.0));
        assert_eq!(after([254, 1]), (2, 0.5));
        assert_eq!(after([5, 6, 8, 7, 9]), (0, 0.0), "reordered");
        assert_eq!(after([5, 6, 6, 6, 5, 7]), (0, 0.0), "duplicates");
        assert_eq!(after([5, 8, 6, 6, 9]), (1, 0.2), "one of two came late, twice");
    }
}
