//! Observations from other hosts: datagrams with a message authentication code.
//!
//! ```text
//! HMAC-SHA256 of the rest, 64 hexadecimal digits   NAME TIME
//! {"id": "s3", "position": [3.2, 4.1]}
//! ..
//! ```
//!
//! `NAME` is the sender's, one word; `TIME` is the sender's, microseconds of Unix time, and increases from datagram to
//! datagram. The code covers everything behind the first blank.
//!
//! | rule | |
//! |---|---|
//! | known sender | time greater than its last |
//! | new sender | time at most [`BEHIND_MAX`] behind ours |
//! | after a right code only | the sender's last time is taken note of |
//!
//! Limits: the content is not secret. Within a minute of a restart of the bridge, what was sent in that minute can be sent
//! again by somebody else; on a computer whose clock is behind, for as long as it is behind.

use std::collections::BTreeMap;

use hmac::{Hmac, KeyInit, Mac};
use sha2::Sha256;

use crate::link::signing::Key;

/// How far a new sender's time may lie behind ours, microseconds: one minute.
pub const BEHIND_MAX: u64 = 60_000_000;
/// Longest name of a sender, bytes.
const NAME_MAX: usize = 64;
/// Senders that are told apart.
const SENDERS_MAX: usize = 256;

fn code(key: &Key, rest: &[u8]) -> Option<Hmac<Sha256>> {
    let mut code = Hmac::<Sha256>::new_from_slice(key.bytes()).ok()?;
    code.update(rest);
    Some(code)
}

/// Some lines as a sealed datagram. `time` is Unix time, microseconds, greater than that of the datagram before.
#[must_use]
pub fn seal(key: &Key, name: &str, time: u64, lines: &str) -> Vec<u8> {
    let rest = format!("{name} {time}\n{lines}");
    let digits: String = code(key, rest.as_bytes())
        .map(|code| code.finalize().into_bytes().iter().map(|byte| format!("{byte:02x}")).collect())
        .unwrap_or_default();
    format!("{digits} {rest}").into_bytes()
}

/// Opens sealed datagrams.
#[derive(Clone, Debug)]
pub struct Opener {
    key: Key,
    senders: BTreeMap<String, u64>,
}

impl Opener {
    /// Opens what was sealed with this key.
    #[must_use]
    pub const fn new(key: Key) -> Self {
        Self { key, senders: BTreeMap::new() }
    }

    /// The lines of a datagram; `now` is Unix time, microseconds.
    ///
    /// # Errors
    /// Why it is refused.
    pub fn open<'a>(&mut self, now: u64, datagram: &'a [u8]) -> Result<&'a [u8], &'static str> {
        const UNSEALED: &str = "is not sealed: send it with `quietpath-bridge observe --key FILE`";
        let (digits, rest) = datagram.split_at_checked(64).ok_or(UNSEALED)?;
        let rest = rest.strip_prefix(b" ").ok_or(UNSEALED)?;
        let mut given = [0; 32];
        for (byte, pair) in given.iter_mut().zip(digits.chunks(2)) {
            let pair = std::str::from_utf8(pair).map_err(|_| UNSEALED)?;
            *byte = u8::from_str_radix(pair, 16).map_err(|_| UNSEALED)?;
        }
        // Compares in a time that does not tell how much was right.
        let code = code(&self.key, rest).ok_or(UNSEALED)?;
        code.verify_slice(&given).map_err(|_| "is sealed with another key, or was changed")?;
        let end = rest.iter().position(|byte| *byte == b'\n').unwrap_or(rest.len());
        let (head, lines) = rest.split_at_checked(end).ok_or(UNSEALED)?;
        let head = std::str::from_utf8(head).map_err(|_| UNSEALED)?;
        let (name, time) = head.split_once(' ').filter(|(name, _)| name.len() <= NAME_MAX).ok_or(UNSEALED)?;
        let time: u64 = time.parse().map_err(|_| UNSEALED)?;
        let is_new = match self.senders.get(name) {
            Some(last) => time > *last,
            None => time.saturating_add(BEHIND_MAX) >= now,
        };
        if !is_new {
            return Err("is old: it was sent before, or its sender's clock is behind by more than a minute");
        }
        if self.senders.len() >= SENDERS_MAX && !self.senders.contains_key(name) {
            return Err("is one sender too many");
        }
        self.senders.insert(name.to_owned(), time);
        Ok(lines)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOW: u64 = 1_800_000_000_000_000;
    const LINES: &str = "{\"id\": \"s1\"}\n";

    fn key(byte: u8) -> Key {
        Key::new([byte; 32])
    }

    #[test]
    fn a_datagram_opens_once_with_the_key_and_no_other() {
        let mut opener = Opener::new(key(1));
        let sealed = seal(&key(1), "radar", NOW, LINES);
        assert_eq!(opener.open(NOW, &sealed), Ok(&b"\n{\"id\": \"s1\"}\n"[..]));
        assert!(opener.open(NOW, &sealed).is_err_and(|why| why.starts_with("is old")), "replayed");
        let earlier = seal(&key(1), "radar", NOW - 1, LINES);
        assert!(opener.open(NOW, &earlier).is_err_and(|why| why.starts_with("is old")), "out of order");
        assert!(opener.open(NOW, &seal(&key(1), "camera", NOW - 1, LINES)).is_ok(), "another sender");
        let foreign = seal(&key(2), "radar", NOW + 1, LINES);
        assert_eq!(opener.open(NOW, &foreign), Err("is sealed with another key, or was changed"));
        assert!(opener.open(NOW, LINES.as_bytes()).is_err_and(|why| why.starts_with("is not sealed")));
        assert!(opener.open(NOW, b"").is_err_and(|why| why.starts_with("is not sealed")));
    }

    #[test]
    fn every_changed_bit_is_refused_and_moves_nothing() {
        let mut opener = Opener::new(key(1));
        let sealed = seal(&key(1), "radar", NOW, LINES);
        for bit in 0..sealed.len() * 8 {
            let mut changed = sealed.clone();
            changed[bit / 8] ^= 1 << (bit % 8);
            // Hexadecimal digits may be capitals: that is the same code.
            let is_case = bit < 64 * 8 && changed.eq_ignore_ascii_case(&sealed);
            assert!(is_case || opener.clone().open(NOW, &changed).is_err(), "bit {bit}");
        }
        assert!(opener.open(NOW, &sealed).is_ok());
    }

    #[test]
    fn a_new_sender_may_be_a_minute_behind_and_no_more() {
        let sealed = |behind| seal(&key(1), "radar", NOW - behind, LINES);
        assert!(Opener::new(key(1)).open(NOW, &sealed(BEHIND_MAX)).is_ok());
        assert!(Opener::new(key(1)).open(NOW, &sealed(BEHIND_MAX + 1)).is_err());
    }

    /// RFC 4231, test case 2, for the code itself.
    #[test]
    fn the_code_is_hmac_sha256() {
        let mut code = Hmac::<Sha256>::new_from_slice(b"Jefe").expect("any key");
        code.update(b"what do ya want for nothing?");
        let digits: String = code.finalize().into_bytes().iter().map(|byte| format!("{byte:02x}")).collect();
        assert_eq!(digits, "5bdcc146bf60754e6a042426089575c75a003f089d2739839dec58b964ec3843");
    }
}
