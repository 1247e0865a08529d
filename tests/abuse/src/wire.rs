//! What a link hears.
//!
//! Bytes of a fuzzer are hardly ever frames, because of their checksums. So the bytes here are a list of pieces: some go
//! in as they are, some as the payload of a message that is framed rightly, signed or not, and some frames are spoilt
//! afterwards or come twice.

use quietpath_bridge::clock::Time;
use quietpath_bridge::link::codec::companion_heartbeat;
use quietpath_bridge::link::dialect::{HEARTBEAT_DATA, MavAutopilot, MavMessage, MavType};
use quietpath_bridge::link::signing::Key;
use quietpath_bridge::link::{Accept, Endpoint, Frame, Identity, Signing, Source};

use crate::dice::{Dice, Mood};
use crate::machines::message;

const VEHICLE: Identity = Identity { system: 1, component: 1 };
/// Frames that a chunk may hold at most: the shortest has 12 bytes.
const FRAME_MIN: usize = 8;

fn port(number: u16) -> Source {
    Source::Peer(([127, 0, 0, 1], number).into())
}

/// The heartbeat of a multicopter on PX4.
fn heartbeat() -> MavMessage {
    let MavMessage::HEARTBEAT(data) = companion_heartbeat() else { return companion_heartbeat() };
    let (mavtype, autopilot) = (MavType::MAV_TYPE_QUADROTOR, MavAutopilot::MAV_AUTOPILOT_PX4);
    MavMessage::HEARTBEAT(HEARTBEAT_DATA { mavtype, autopilot, ..data })
}

/// Feeds an endpoint with pieces from its peer and from strangers.
///
/// # Panics
/// A promise is broken.
pub fn bytes(bytes: &[u8]) {
    let mut dice = Dice::new(bytes, Mood::Sane);
    let is_signed = dice.one_in(2);
    let key = |byte| Signing::new(Key::new([byte; 32]), 0, 1_000_000_000);
    let signed = |endpoint: Endpoint, byte| if is_signed { endpoint.with_signing(key(byte)) } else { endpoint };
    let mut bridge = signed(Endpoint::new(Identity::COMPANION, Accept::Autopilot(None)), 1);
    let mut vehicle = signed(Endpoint::new(VEHICLE, Accept::Anyone), 1);
    // Has no key, or a wrong one.
    let mut stranger = signed(Endpoint::new(Identity { system: 9, component: 1 }, Accept::Anyone), 2);
    let peer = port(1);
    let mut now = Time::ZERO;
    let first = vehicle.encode(now, &heartbeat());
    assert_eq!(bridge.decode(now, peer, &first).len(), 1, "the vehicle is heard");
    let mut last = Vec::new();
    let mut heard = now;
    while !dice.is_empty() {
        now = Time::from_micros(now.micros() + 1000 * dice.below(1200) as u64);
        let is_peer = !dice.one_in(3);
        let source = if is_peer { peer } else { port(2 + u16::from(dice.byte() % 64)) };
        let mut is_repeated = false;
        let piece = match dice.below(5) {
            0 => {
                let count = dice.below(300);
                dice.some(count).to_vec()
            }
            1 => {
                is_repeated = true;
                last.clone()
            }
            kind => {
                let Some(message) = message(&mut dice) else { continue };
                let mut frame = if is_peer { vehicle.encode(now, &message) } else { stranger.encode(now, &message) };
                if kind == 2 {
                    let place = dice.below(frame.len());
                    frame[place] ^= 1 << dice.below(8);
                }
                frame
            }
        };
        let frames = bridge.decode(now, source, &piece);
        assert!(frames.len() <= piece.len() / FRAME_MIN + 300, "{} frames of {} bytes", frames.len(), piece.len());
        frames.iter().for_each(round_trip);
        if !frames.is_empty() && source == peer {
            heard = now;
        }
        let is_stranger = source != peer && !frames.is_empty();
        // A signature says who made a frame, not where it comes from: what the vehicle said and the bridge has not heard, for
        // something was in the way, anybody may say once.
        assert!(!is_stranger || !is_signed || is_repeated, "a stranger without the key was heard");
        assert!(
            !is_stranger || now.since(heard) >= quietpath_bridge::link::endpoint::SILENCE,
            "a stranger took the link from a vehicle that speaks"
        );
        if is_stranger {
            // Nobody had to be listened to any more: the link is the stranger's, and there is no more to say.
            return;
        }
        last = piece;
    }
}

/// What was decoded encodes to what decodes to the same.
fn round_trip(frame: &Frame) {
    let again = Frame::parse(&frame.bytes).expect("the bytes of a frame are a frame");
    // Messages hold numbers that are not equal to themselves.
    assert_eq!(format!("{:?}", again.message), format!("{:?}", frame.message), "the same bytes, another message");
    assert_eq!((again.from, again.sequence), (frame.from, frame.sequence));
}
