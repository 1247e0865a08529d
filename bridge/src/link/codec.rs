//! Bytes to frames and back.
//!
//! The `mavlink` crate frames, checks and decodes. What this module adds is the handling of bytes without a device
//! (`Decoder::feed`), and two mercies: frames of messages that cannot be decoded are counted and not merely lost,
//! and a heartbeat that names a vehicle newer than the dialect is still a heartbeat.
//!
//! MAVLink 1 is read, because autopilots speak it on some ports until they hear MAVLink 2, and never written. System
//! ids above 255 are refused.

use std::collections::VecDeque;
use std::io::Read;

use mavlink::error::ParserError;
use mavlink::{
    MAVLinkMessageRaw, MAVLinkV2MessageRaw, MavHeader, MavlinkReader, MavlinkVersion, Message, MessageData,
};

use super::dialect::{HEARTBEAT_DATA, MavAutopilot, MavMessage, MavModeFlag, MavState, MavType};

/// Who speaks: system and component id.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Identity {
    /// System id, 1 to 255; one for a vehicle and everything on board.
    pub system: u8,
    /// Component id.
    pub component: u8,
}

impl Identity {
    /// A companion computer that does not know yet on which vehicle it is: component `MAV_COMP_ID_ONBOARD_COMPUTER`.
    pub const COMPANION: Self = Self { system: 1, component: 191 };
}

/// A received message.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Who sent it.
    pub from: Identity,
    /// Sequence number of the sender's frames.
    pub sequence: u8,
    /// The message.
    pub message: MavMessage,
    /// The frame as it came, from its start byte.
    pub bytes: Vec<u8>,
}

impl Frame {
    /// The first whole frame in some bytes, such as those of a record; signatures are not checked.
    #[must_use]
    pub fn parse(bytes: &[u8]) -> Option<Self> {
        let raw = Decoder::default().feed(bytes).into_iter().next()?;
        raw.decode().ok()
    }
}

/// A frame whose checksum is right, not decoded yet.
pub(super) struct RawFrame(MAVLinkMessageRaw);

/// A frame that is intact and yet cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Unreadable;

impl RawFrame {
    /// The frame of MAVLink 2, which alone can be signed.
    pub(super) const fn version2(&self) -> Option<&MAVLinkV2MessageRaw> {
        match &self.0 {
            MAVLinkMessageRaw::V2(raw) => Some(raw),
            MAVLinkMessageRaw::V1(_) => None,
        }
    }

    fn bytes(&self) -> &[u8] {
        match &self.0 {
            MAVLinkMessageRaw::V1(raw) => raw.raw_bytes(),
            MAVLinkMessageRaw::V2(raw) => raw.raw_bytes(),
        }
    }

    /// Who sent it; `None` for system ids that this version does not speak to.
    pub(super) fn from(&self) -> Option<Identity> {
        let system = u8::try_from(self.0.system_id()).ok()?;
        Some(Identity { system, component: self.0.component_id() })
    }

    pub(super) fn sequence(&self) -> u8 {
        self.0.sequence()
    }

    pub(super) fn len(&self) -> usize {
        self.bytes().len()
    }

    pub(super) fn decode(&self) -> Result<Frame, Unreadable> {
        let from = self.from().ok_or(Unreadable)?;
        let message = message(self.0.version(), self.0.message_id(), self.0.payload()).map_err(|_| Unreadable)?;
        Ok(Frame { from, sequence: self.sequence(), message, bytes: self.bytes().to_vec() })
    }
}

/// The message of a payload. Values of a heartbeat that the dialect does not know become the general ones.
fn message(version: MavlinkVersion, id: u32, payload: &[u8]) -> Result<MavMessage, ParserError> {
    let first = MavMessage::parse(version, id, payload);
    if id != HEARTBEAT_DATA::ID || !matches!(first, Err(ParserError::InvalidEnum { .. })) {
        return first;
    }
    /// Where the kind of vehicle, the kind of autopilot and the state stand in a heartbeat's payload.
    const ENUMS: [usize; 3] = [4, 5, 7];
    let mut general = payload.to_vec();
    for place in ENUMS {
        // Zero is the general kind of each, so one that is known to fail is replaced, and the others are kept.
        let mut probe = [0_u8; HEARTBEAT_DATA::ENCODED_LEN];
        if let (Some(probe), Some(byte)) = (probe.get_mut(place), general.get_mut(place)) {
            *probe = *byte;
        }
        if MavMessage::parse(version, id, &probe).is_err()
            && let Some(byte) = general.get_mut(place)
        {
            *byte = 0;
        }
    }
    MavMessage::parse(version, id, &general)
}

/// Bytes that wait to be read.
#[derive(Default)]
struct Queue(VecDeque<u8>);

impl Read for Queue {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        self.0.read(buffer)
    }
}

/// Finds frames in a stream of bytes.
pub(super) struct Decoder(MavlinkReader<Queue>);

impl Default for Decoder {
    fn default() -> Self {
        Self(MavlinkReader::new(Queue::default()))
    }
}

impl Decoder {
    /// The frames that end in these bytes. Whatever is not part of a frame with the right checksum is skipped.
    pub(super) fn feed(&mut self, bytes: &[u8]) -> Vec<RawFrame> {
        self.0.get_mut().0.extend(bytes);
        // The reader reports the end of the queue as the end of its file, keeps what it has, and goes on next time.
        std::iter::from_fn(|| self.0.read_any_raw_message::<MavMessage>().ok()).map(RawFrame).collect()
    }
}

/// A message as an unsigned MAVLink 2 frame.
pub(super) fn plain(from: Identity, sequence: u8, message: &MavMessage) -> MAVLinkV2MessageRaw {
    let mut raw = MAVLinkV2MessageRaw::new();
    raw.serialize_message(header(from, sequence), message);
    raw
}

/// The name of a message, as the protocol writes it.
#[must_use]
pub fn name(message: &MavMessage) -> &'static str {
    message.message_name()
}

/// The bytes of a message as an unsigned frame with sequence number 0.
#[must_use]
pub fn plain_bytes(from: Identity, message: &MavMessage) -> Vec<u8> {
    plain(from, 0, message).raw_bytes().to_vec()
}

/// A message as a MAVLink 2 frame whose signature is yet to be filled in.
pub(super) fn signable(from: Identity, sequence: u8, message: &MavMessage) -> MAVLinkV2MessageRaw {
    let mut raw = MAVLinkV2MessageRaw::new();
    raw.serialize_message_for_signing(header(from, sequence), message);
    raw
}

fn header(from: Identity, sequence: u8) -> MavHeader {
    MavHeader { system_id: u32::from(from.system), component_id: from.component, sequence }
}

/// The heartbeat of a companion computer: type 18, no autopilot, active.
///
/// Written out in full: the dialect's own default says that the vehicle is armed.
#[must_use]
pub fn companion_heartbeat() -> MavMessage {
    MavMessage::HEARTBEAT(HEARTBEAT_DATA {
        custom_mode: 0,
        mavtype: MavType::MAV_TYPE_ONBOARD_CONTROLLER,
        autopilot: MavAutopilot::MAV_AUTOPILOT_INVALID,
        base_mode: MavModeFlag::empty(),
        system_status: MavState::MAV_STATE_ACTIVE,
        mavlink_version: 3,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn heartbeat() -> Vec<u8> {
        plain(Identity::COMPANION, 9, &companion_heartbeat()).raw_bytes().to_vec()
    }

    #[test]
    fn frames_are_found_in_pieces_and_behind_junk() {
        let mut decoder = Decoder::default();
        let stream: Vec<u8> = [&[0x00, 0xFD, 0x01][..], &heartbeat(), b"junk", &heartbeat()].concat();
        let mut found = Vec::new();
        for piece in stream.chunks(5).chain([&[0_u8; 300][..]]) {
            found.extend(decoder.feed(piece).iter().filter_map(|raw| raw.decode().ok()));
        }
        assert_eq!(found.len(), 2);
        for frame in &found {
            assert_eq!((frame.from, frame.sequence), (Identity::COMPANION, 9));
            assert_eq!(frame.message, companion_heartbeat());
            assert_eq!(frame.bytes, heartbeat());
        }
    }

    #[test]
    fn a_flipped_bit_is_no_frame() {
        for bit in 0..heartbeat().len() * 8 {
            let mut bytes = heartbeat();
            bytes[bit / 8] ^= 1 << (bit % 8);
            assert_eq!(Frame::parse(&bytes), None, "bit {bit}");
        }
    }

    #[test]
    fn a_heartbeat_of_an_unknown_vehicle_is_a_heartbeat() {
        let payload = [1, 2, 3, 4, 250, 12, 0x81, 4, 3];
        let Ok(MavMessage::HEARTBEAT(data)) = message(MavlinkVersion::V2, 0, &payload) else {
            panic!("no heartbeat")
        };
        assert_eq!((data.mavtype, data.autopilot), (MavType::MAV_TYPE_GENERIC, MavAutopilot::MAV_AUTOPILOT_PX4));
        assert_eq!((data.system_status, data.custom_mode), (MavState::MAV_STATE_ACTIVE, 0x0403_0201));
    }

    #[test]
    fn version_1_is_read() {
        let mut raw = mavlink::MAVLinkV1MessageRaw::new();
        raw.serialize_message(header(Identity { system: 7, component: 1 }, 3), &companion_heartbeat());
        let frame = Frame::parse(raw.raw_bytes()).expect("a frame");
        assert_eq!((frame.from.system, frame.message), (7, companion_heartbeat()));
    }
}
