//! One end of a link, without input or output: bytes in, frames out, and the other way round.
//!
//! A device may carry more than one voice: a socket hears everybody who sends to it. Only one of them is the peer that
//! is answered and listened to. A source becomes the peer by an intact heartbeat of the right kind ([`Accept`]), with a
//! right signature where there is a key; it stays the peer until it has been silent for [`SILENCE`]. Everything from
//! other sources is counted and dropped, so a stray datagram, a second ground station or noise captures nothing.

use std::collections::BTreeMap;
use std::time::Duration;

use super::codec::{self, Decoder, Frame, Identity, RawFrame};
use super::dialect::{MavAutopilot, MavMessage, MavType};
use super::signing::{Refused, Signing};
use super::socket::Source;
use super::statistics::Statistics;
use crate::clock::Time;

/// Silence after which another source may become the peer.
pub const SILENCE: Duration = Duration::from_secs(3);

/// Sources that may have an unfinished frame at the same time.
const DECODERS_MAX: usize = 16;

/// Whose heartbeat makes its source the peer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Accept {
    /// That of an autopilot, of the given system or of any.
    Autopilot(Option<u8>),
    /// Everybody's: for a vehicle that waits for its ground station.
    Anyone,
}

impl Accept {
    fn takes(self, frame: &Frame) -> bool {
        let MavMessage::HEARTBEAT(data) = &frame.message else { return false };
        match self {
            Self::Anyone => true,
            Self::Autopilot(system) => {
                data.autopilot != MavAutopilot::MAV_AUTOPILOT_INVALID
                    && data.mavtype != MavType::MAV_TYPE_GCS
                    && system.is_none_or(|system| system == frame.from.system)
            }
        }
    }
}

/// One end of a link. See the [module](self).
pub struct Endpoint {
    identity: Identity,
    accept: Accept,
    signing: Option<Signing>,
    /// The next sequence number of each component that speaks here.
    sequences: BTreeMap<u8, u8>,
    decoders: BTreeMap<Source, Decoder>,
    peer: Option<(Source, Time)>,
    statistics: Statistics,
}

impl Endpoint {
    /// An end that speaks as `identity`, unsigned.
    #[must_use]
    pub fn new(identity: Identity, accept: Accept) -> Self {
        let (decoders, statistics) = (BTreeMap::new(), Statistics::default());
        Self { identity, accept, signing: None, sequences: BTreeMap::new(), decoders, peer: None, statistics }
    }

    /// The same end, signing what it sends and refusing what is not signed.
    #[must_use]
    pub fn with_signing(self, signing: Signing) -> Self {
        Self { signing: Some(signing), ..self }
    }

    /// Who speaks here.
    #[must_use]
    pub const fn identity(&self) -> Identity {
        self.identity
    }

    /// Becomes part of a vehicle: from now on speaks with its system id.
    pub const fn board(&mut self, system: u8) {
        self.identity.system = system;
    }

    /// Whom to answer; `None` while nobody is known.
    #[must_use]
    pub fn peer(&self) -> Option<Source> {
        self.peer.map(|(source, _)| source)
    }

    /// Counters.
    #[must_use]
    pub const fn statistics(&self) -> &Statistics {
        &self.statistics
    }

    /// Counters, for those who count on behalf of this end.
    pub(crate) const fn statistics_mut(&mut self) -> &mut Statistics {
        &mut self.statistics
    }

    /// A message as a frame.
    pub fn encode(&mut self, now: Time, message: &MavMessage) -> Vec<u8> {
        self.encode_as(now, self.identity.component, message)
    }

    /// A message of another component of the same system as a frame: for a vehicle whose payloads speak over one link.
    pub fn encode_as(&mut self, now: Time, component: u8, message: &MavMessage) -> Vec<u8> {
        let identity = Identity { component, ..self.identity };
        let next = self.sequences.entry(component).or_insert(0);
        let sequence = std::mem::replace(next, next.wrapping_add(1));
        self.statistics.frames_out += 1;
        let raw = match &mut self.signing {
            None => codec::plain(identity, sequence, message),
            Some(signing) => {
                let mut raw = codec::signable(identity, sequence, message);
                signing.sign(now, &mut raw);
                raw
            }
        };
        raw.raw_bytes().to_vec()
    }

    /// The frames of the peer that end in some bytes from a source.
    pub fn decode(&mut self, now: Time, source: Source, bytes: &[u8]) -> Vec<Frame> {
        self.statistics.bytes_in += bytes.len() as u64;
        if self.decoders.len() >= DECODERS_MAX && !self.decoders.contains_key(&source) {
            // Strangers cannot fill the memory; the peer's unfinished frame is kept.
            let peer = self.peer();
            self.decoders.retain(|known, _| Some(*known) == peer);
        }
        let raw = self.decoders.entry(source).or_default().feed(bytes);
        raw.iter().filter_map(|raw| self.admit(now, source, raw)).collect()
    }

    /// The frame, where it may come in.
    fn admit(&mut self, now: Time, source: Source, raw: &RawFrame) -> Option<Frame> {
        self.statistics.bytes_framed += raw.len() as u64;
        if let Some(signing) = &mut self.signing {
            let checked = raw.version2().map_or(Err(Refused::Unsigned), |raw| signing.verify(now, raw));
            match checked {
                Ok(()) => {}
                Err(Refused::Unsigned) => {
                    self.statistics.unsigned += 1;
                    return None;
                }
                Err(Refused::Replayed) => {
                    self.statistics.replayed += 1;
                    return None;
                }
            }
        }
        let decoded = raw.decode();
        let takes = decoded.as_ref().is_ok_and(|frame| self.accept.takes(frame));
        match self.peer {
            Some((peer, _)) if peer == source => self.peer = Some((source, now)),
            Some((_, heard)) if now.since(heard) < SILENCE => {
                self.statistics.stray += 1;
                return None;
            }
            _ if takes => {
                tracing::info!(?source, "answering this source from now on");
                self.peer = Some((source, now));
            }
            _ => {
                self.statistics.stray += 1;
                return None;
            }
        }
        if let Some(from) = raw.from() {
            self.statistics.count(from, raw.sequence());
        }
        match decoded {
            Ok(frame) => {
                self.statistics.frames_in += 1;
                Some(frame)
            }
            Err(codec::Unreadable) => {
                self.statistics.unreadable += 1;
                None
            }
        }
    }

    /// Forgets half-received frames, after a device was opened anew.
    pub(crate) fn restart(&mut self) {
        self.decoders.clear();
        self.statistics.opened += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::link::codec::companion_heartbeat;
    use crate::link::dialect::HEARTBEAT_DATA;
    use crate::link::signing::Key;

    fn autopilot_heartbeat() -> MavMessage {
        let MavMessage::HEARTBEAT(data) = companion_heartbeat() else { panic!("a heartbeat") };
        let (mavtype, autopilot) = (MavType::MAV_TYPE_QUADROTOR, MavAutopilot::MAV_AUTOPILOT_PX4);
        MavMessage::HEARTBEAT(HEARTBEAT_DATA { mavtype, autopilot, ..data })
    }

    fn port(port: u16) -> Source {
        Source::Peer(([127, 0, 0, 1], port).into())
    }

    fn second(second: u64) -> Time {
        Time::from_millis(second * 1000)
    }

    #[test]
    fn only_an_autopilot_becomes_the_peer_and_nobody_takes_its_place_while_it_speaks() {
        let mut vehicle = Endpoint::new(Identity { system: 7, component: 1 }, Accept::Anyone);
        let mut other = Endpoint::new(Identity { system: 9, component: 1 }, Accept::Anyone);
        let mut bridge = Endpoint::new(Identity::COMPANION, Accept::Autopilot(None));
        let station = other.encode(Time::ZERO, &companion_heartbeat());
        assert!(bridge.decode(second(0), port(1), &station).is_empty());
        assert!(bridge.decode(second(0), port(1), b"junk").is_empty());
        assert_eq!(bridge.peer(), None);
        assert_eq!(bridge.decode(second(1), port(2), &vehicle.encode(second(1), &autopilot_heartbeat())).len(), 1);
        assert_eq!(bridge.peer(), Some(port(2)));
        let rival = other.encode(second(2), &autopilot_heartbeat());
        assert!(bridge.decode(second(2), port(1), &rival).is_empty());
        assert_eq!((bridge.peer(), bridge.statistics().stray), (Some(port(2)), 2));
        // A restarted autopilot speaks from another port.
        let again = vehicle.encode(second(4), &autopilot_heartbeat());
        assert_eq!(bridge.decode(second(4), port(3), &again).len(), 1);
        assert_eq!(bridge.peer(), Some(port(3)));
        let mut chosen = Endpoint::new(Identity::COMPANION, Accept::Autopilot(Some(9)));
        assert!(chosen.decode(second(4), port(3), &again).is_empty());
    }

    #[test]
    fn strangers_cannot_fill_the_memory_nor_break_the_peers_frames() {
        let mut vehicle = Endpoint::new(Identity { system: 7, component: 1 }, Accept::Anyone);
        let mut bridge = Endpoint::new(Identity::COMPANION, Accept::Autopilot(None));
        bridge.decode(second(0), port(1), &vehicle.encode(second(0), &autopilot_heartbeat()));
        let bytes = vehicle.encode(second(1), &autopilot_heartbeat());
        let (head, tail) = bytes.split_at(7);
        assert!(bridge.decode(second(1), port(1), head).is_empty());
        for number in 100..400 {
            bridge.decode(second(1), port(number), &[0xFD, 200, 0]);
            assert!(bridge.decoders.len() <= DECODERS_MAX);
        }
        assert_eq!(bridge.decode(second(1), port(1), tail).len(), 1);
    }

    #[test]
    fn with_a_key_unsigned_frames_make_no_peer_and_replays_are_counted() {
        let signing = || Signing::new(Key::new([1; 32]), 0, 1000);
        let mut plain = Endpoint::new(Identity { system: 7, component: 1 }, Accept::Anyone);
        let mut vehicle = Endpoint::new(Identity { system: 7, component: 1 }, Accept::Anyone).with_signing(signing());
        let mut bridge = Endpoint::new(Identity::COMPANION, Accept::Autopilot(None)).with_signing(signing());
        assert!(bridge.decode(second(0), port(1), &plain.encode(second(0), &autopilot_heartbeat())).is_empty());
        assert_eq!((bridge.peer(), bridge.statistics().unsigned), (None, 1));
        let frame = vehicle.encode(second(0), &autopilot_heartbeat());
        assert_eq!(bridge.decode(second(0), port(2), &frame).len(), 1);
        assert!(bridge.decode(second(1), port(2), &frame).is_empty());
        assert_eq!((bridge.peer(), bridge.statistics().replayed), (Some(port(2)), 1));
    }
}
