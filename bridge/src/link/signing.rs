//! MAVLink 2 signatures.
//!
//! With a key, every frame that goes out is signed, and every frame that comes in is refused unless its signature is
//! right and its timestamp new. Timestamps count 10 microseconds from the beginning of 2015 and increase strictly,
//! over restarts too: a file beside the key holds a timestamp that no frame has reached yet. It is moved ahead by
//! [`RESERVE`] before the frames get there, so a crash costs some timestamps, and never uses one twice. A computer
//! without a clock of its own may come up in the past: it goes on from the file, and follows what its peer says.
//!
//! | rule | |
//! |---|---|
//! | known stream (system, component, link id) | timestamp greater than its last |
//! | new stream | timestamp at most [`BEHIND_MAX`] behind ours |
//! | after a right signature only | the stream's last timestamp is taken note of, and ours follows it |
//!
//! A key file holds 64 hexadecimal digits, or 32 bytes as they are, and must be readable by its owner alone.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use mavlink::MAVLinkV2MessageRaw;
use mavlink::consts::v2::{IFLAG_SIGNED, SIGNATURE_VALUE_SIZE};

use super::codec::Identity;
use crate::clock::Time;
use crate::file::{FileError, read_limited, replace};

/// Timestamps reserved at a time, in 10 microseconds: 10 seconds.
pub const RESERVE: u64 = 1_000_000;
/// How far a new stream's timestamp may lie behind ours, in 10 microseconds: one minute.
pub const BEHIND_MAX: u64 = 6_000_000;
/// Largest number that a timestamp file may hold: frames have room for 48 bits, and a year must be left.
const TIMESTAMP_MAX: u64 = (1 << 48) - 365 * 86_400 * 100_000;
/// The beginning of 2015, seconds of Unix time.
const EPOCH_2015: Duration = Duration::from_secs(1_420_070_400);

/// A signing key.
#[derive(Clone, PartialEq, Eq)]
pub struct Key([u8; 32]);

// A key is not for logs.
impl std::fmt::Debug for Key {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Key(..)")
    }
}

impl Key {
    /// A key by its bytes.
    #[must_use]
    pub const fn new(bytes: [u8; 32]) -> Self {
        Self(bytes)
    }

    pub(crate) const fn bytes(&self) -> &[u8; 32] {
        &self.0
    }

    /// Reads a key file.
    ///
    /// # Errors
    /// The file cannot be read, is open to others than its owner, or holds no key.
    pub fn read(path: &Path) -> Result<Self, Box<FileError>> {
        let name = path.display().to_string();
        let fail = |message: String, help: &str| Box::new(FileError::whole(&name, message, help));
        let make = "make one with `openssl rand -hex 32 > FILE; chmod 600 FILE`";
        let unreadable = |error: std::io::Error| fail(format!("cannot be read: {error}"), make);
        let metadata = fs::metadata(path).map_err(unreadable)?;
        if let Some(mode) = open_to_others(&metadata) {
            let message = format!("is a key, and its permissions {mode:03o} let others than its owner in");
            return Err(fail(message, &format!("chmod 600 {name}")));
        }
        let bytes = read_limited(path).map_err(unreadable)?;
        if let Ok(key) = <[u8; 32]>::try_from(bytes.as_slice()) {
            return Ok(Self(key));
        }
        let text = String::from_utf8_lossy(&bytes);
        let key = hexadecimal(text.trim());
        key.map(Self).ok_or_else(|| fail("is neither 64 hexadecimal digits nor 32 bytes".into(), make))
    }
}

/// The permissions of a file that others than its owner can use; `None` where they cannot.
#[cfg(unix)]
fn open_to_others(metadata: &fs::Metadata) -> Option<u32> {
    use std::os::unix::fs::PermissionsExt;
    let mode = metadata.permissions().mode() & 0o777;
    (mode & 0o077 != 0).then_some(mode)
}

/// Elsewhere permissions have no such numbers.
#[cfg(not(unix))]
fn open_to_others(_: &fs::Metadata) -> Option<u32> {
    None
}

fn hexadecimal(digits: &str) -> Option<[u8; 32]> {
    let mut key = [0; 32];
    if digits.len() != 64 || !digits.is_ascii() {
        return None;
    }
    for (index, byte) in key.iter_mut().enumerate() {
        *byte = u8::from_str_radix(digits.get(2 * index..2 * index + 2)?, 16).ok()?;
    }
    Some(key)
}

/// Where timestamps survive a restart.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Store {
    /// Nowhere: for tests.
    None,
    /// A file with a timestamp that has not been used.
    File(PathBuf),
}

/// Why a frame is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Refused {
    /// No signature, or a wrong one.
    Unsigned,
    /// Right, but not new.
    Replayed,
}

/// Signs and verifies for one end of a link.
#[derive(Clone, Debug)]
pub struct Signing {
    key: Key,
    link: u8,
    /// Timestamp at the clock's zero.
    epoch: u64,
    /// Smallest timestamp that has not been used or seen.
    next: u64,
    /// Timestamps below this one may be used without writing the file.
    reserved: u64,
    store: Store,
    streams: BTreeMap<(Identity, u8), u64>,
}

impl Signing {
    /// Signing without memory, for tests: `epoch` is the timestamp at the clock's zero.
    #[must_use]
    pub const fn new(key: Key, link: u8, epoch: u64) -> Self {
        let streams = BTreeMap::new();
        Self { key, link, epoch, next: 0, reserved: u64::MAX, store: Store::None, streams }
    }

    /// Signing with a key file; timestamps go on in a file beside it, `KEY.timestamp`. `now` is the clock's time.
    ///
    /// # Errors
    /// As [`Key::read`]; a timestamp file that cannot be read or written.
    pub fn from_key_file(path: &Path, link: u8, now: Time) -> Result<Self, Box<FileError>> {
        let key = Key::read(path)?;
        let mut store = path.as_os_str().to_owned();
        store.push(".timestamp");
        let store = PathBuf::from(store);
        let fail =
            |message: String, help: &str| Box::new(FileError::whole(&store.display().to_string(), message, help));
        let next = match read_limited(&store) {
            Ok(text) => {
                let number: Option<u64> = String::from_utf8_lossy(&text).trim().parse().ok();
                number.filter(|number| *number <= TIMESTAMP_MAX).ok_or_else(|| {
                    fail("is not a timestamp".into(), "write a number greater than any used, in 10 us since 2015")
                })?
            }
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => 0,
            Err(error) => return Err(fail(format!("cannot be read: {error}"), "let its owner read it")),
        };
        let wall = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH + EPOCH_2015).unwrap_or_default();
        let wall = u64::try_from(wall.as_micros() / 10).unwrap_or(u64::MAX);
        let epoch = wall.saturating_sub(now.micros() / 10);
        let mut signing =
            Self { store: Store::File(store.clone()), epoch, next, reserved: 0, ..Self::new(key, link, 0) };
        let first = signing.timestamp(now);
        signing.reserve(first).map_err(|error| {
            fail(format!("cannot be written: {error}"), "timestamps must survive a restart: make its folder writable")
        })?;
        Ok(signing)
    }

    fn timestamp(&self, now: Time) -> u64 {
        self.next.max(self.epoch.saturating_add(now.micros() / 10))
    }

    /// Sees to it that `timestamp` lies below what the file holds.
    fn reserve(&mut self, timestamp: u64) -> std::io::Result<()> {
        if timestamp < self.reserved {
            return Ok(());
        }
        let reserved = timestamp.saturating_add(RESERVE);
        if let Store::File(path) = &self.store {
            replace(path, format!("{reserved}\n").as_bytes())?;
        }
        self.reserved = reserved;
        Ok(())
    }

    /// Fills in the signature of a frame.
    pub(super) fn sign(&mut self, now: Time, raw: &mut MAVLinkV2MessageRaw) {
        let timestamp = self.timestamp(now);
        if let Err(error) = self.reserve(timestamp) {
            // A full disk must not silence a vehicle in flight. At worst a peer takes frames after a restart for old.
            tracing::error!(%error, "the signing timestamp cannot be written down");
            self.reserved = timestamp.saturating_add(RESERVE);
        }
        self.next = timestamp.saturating_add(1);
        let [bytes @ .., _, _] = timestamp.to_le_bytes();
        raw.signature_timestamp_bytes_mut().copy_from_slice(&bytes);
        *raw.signature_link_id_mut() = self.link;
        let mut value = [0; SIGNATURE_VALUE_SIZE];
        raw.calculate_signature(&self.key.0, &mut value);
        raw.signature_value_mut().copy_from_slice(&value);
    }

    /// Checks a frame's signature and timestamp.
    pub(super) fn verify(&mut self, now: Time, raw: &MAVLinkV2MessageRaw) -> Result<(), Refused> {
        if raw.incompatibility_flags() & IFLAG_SIGNED == 0 {
            return Err(Refused::Unsigned);
        }
        let mut value = [0; SIGNATURE_VALUE_SIZE];
        raw.calculate_signature(&self.key.0, &mut value);
        // Every byte is looked at, so that the time taken does not tell how many were right.
        let difference = value.iter().zip(raw.signature_value()).fold(0, |sum, (a, b)| sum | (a ^ b));
        let system = u8::try_from(raw.system_id()).map_err(|_| Refused::Unsigned)?;
        if difference != 0 {
            return Err(Refused::Unsigned);
        }
        let stream = (Identity { system, component: raw.component_id() }, raw.signature_link_id());
        let timestamp = raw.signature_timestamp();
        let is_new = match self.streams.get(&stream) {
            Some(last) => timestamp > *last,
            None => timestamp.saturating_add(BEHIND_MAX) >= self.timestamp(now),
        };
        if !is_new {
            return Err(Refused::Replayed);
        }
        self.streams.insert(stream, timestamp);
        self.next = self.next.max(timestamp.saturating_add(1));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::link::codec::{companion_heartbeat, signable};

    const ZERO: Time = Time::ZERO;

    fn signing(epoch: u64) -> Signing {
        Signing::new(Key::new([7; 32]), 3, epoch)
    }

    fn signed(by: &mut Signing, now: Time) -> MAVLinkV2MessageRaw {
        let mut raw = signable(Identity::COMPANION, 0, &companion_heartbeat());
        by.sign(now, &mut raw);
        raw
    }

    #[test]
    fn a_frame_is_accepted_once_and_only_with_the_key() {
        let (mut ours, mut theirs) = (signing(1000), signing(1000));
        let frame = signed(&mut ours, ZERO);
        assert_eq!(theirs.verify(ZERO, &frame), Ok(()));
        assert_eq!(theirs.verify(ZERO, &frame), Err(Refused::Replayed));
        assert_eq!(
            theirs.verify(ZERO, &signed(&mut ours, ZERO)),
            Ok(()),
            "the clock stands still, the timestamp not"
        );
        let mut stranger = Signing::new(Key::new([8; 32]), 3, 1000);
        assert_eq!(stranger.verify(ZERO, &frame), Err(Refused::Unsigned));
        let plain = crate::link::codec::plain(Identity::COMPANION, 0, &companion_heartbeat());
        assert_eq!(theirs.verify(ZERO, &plain), Err(Refused::Unsigned));
    }

    #[test]
    fn a_forged_timestamp_does_not_move_the_stream() {
        let (mut ours, mut theirs) = (signing(1000), signing(1000));
        let mut forged = signed(&mut ours, ZERO);
        forged.signature_timestamp_bytes_mut().fill(0xFF);
        assert_eq!(theirs.verify(ZERO, &forged), Err(Refused::Unsigned));
        assert_eq!(theirs.verify(ZERO, &signed(&mut ours, ZERO)), Ok(()));
    }

    #[test]
    fn a_new_stream_may_be_a_minute_behind_and_no_more() {
        let mut theirs = signing(10 * BEHIND_MAX);
        let just = signed(&mut signing(9 * BEHIND_MAX), ZERO);
        let old = signed(&mut signing(9 * BEHIND_MAX - 1), ZERO);
        assert_eq!(theirs.clone().verify(ZERO, &just), Ok(()));
        assert_eq!(theirs.verify(ZERO, &old), Err(Refused::Replayed));
    }

    #[test]
    fn timestamps_go_on_after_a_restart_and_follow_the_peer() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("key");
        fs::write(&path, "ab".repeat(32)).expect("written");
        let problem = Signing::from_key_file(&path, 0, ZERO);
        if cfg!(unix) {
            let error = problem.expect_err("open to others").to_string();
            assert!(error.contains("is a key, and its permissions 6"), "{error}");
            assert!(error.contains("help: chmod 600"), "{error}");
        }
        close(&path);
        let mut before = Signing::from_key_file(&path, 0, ZERO).expect("a key");
        let wall = before.timestamp(ZERO);
        assert!(wall > 36_000_000_000_000, "{wall}: this is later than 2026");
        let mut peer = Signing::new(Key::new([0xAB; 32]), 0, wall + 5_000_000);
        let ahead = signed(&mut peer, ZERO);
        before.verify(ZERO, &ahead).expect("signed with the same key");
        let last = signed(&mut before, ZERO).signature_timestamp();
        assert_eq!(last, ahead.signature_timestamp() + 1);
        // As after a crash: nothing was said at the end, and the clock has gone back by all of its time.
        let mut after = Signing::from_key_file(&path, 0, ZERO).expect("a key");
        after.epoch = 0;
        let next = signed(&mut after, ZERO).signature_timestamp();
        assert!(next > last && next <= last + 2 * RESERVE, "{last} {next}");
        let text = fs::read_to_string(path.with_extension("timestamp")).expect("a file beside the key");
        assert!(text.trim().parse::<u64>().expect("a number") > next);
    }

    #[test]
    fn a_disk_that_is_full_silences_nobody() {
        let nowhere = Store::File("/nowhere/at/all/key.timestamp".into());
        let mut ours = Signing { store: nowhere, reserved: 0, ..signing(1000) };
        let mut theirs = signing(1000);
        for number in 0..3 {
            let frame = signed(&mut ours, Time::from_millis(6000 * number));
            assert_eq!(theirs.verify(ZERO, &frame), Ok(()));
        }
    }

    #[test]
    fn a_timestamp_file_is_checked() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("key");
        fs::write(&path, "ab".repeat(32)).expect("written");
        close(&path);
        let store = folder.path().join("key.timestamp");
        // The last would begin anew from 0 in frames, which hold 48 bits.
        for wrong in ["", "soon", "-5", &u64::MAX.to_string(), &(1_u64 << 48).to_string()] {
            fs::write(&store, wrong).expect("written");
            let error = Signing::from_key_file(&path, 0, ZERO).expect_err("no timestamp").to_string();
            assert!(error.contains("key.timestamp: is not a timestamp"), "{error}");
        }
        fs::write(&store, format!("{TIMESTAMP_MAX}\n")).expect("written");
        let mut last = Signing::from_key_file(&path, 0, ZERO).expect("a timestamp");
        assert_eq!(signed(&mut last, ZERO).signature_timestamp(), TIMESTAMP_MAX);
    }

    #[test]
    fn a_key_file_is_checked() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("key");
        let error = Key::read(&path).expect_err("no file").to_string();
        assert!(error.contains("cannot be read") && error.contains("openssl rand -hex 32"), "{error}");
        for (content, is_key) in [(vec![1; 32], true), (b"0g".repeat(32), false), (vec![1; 31], false)] {
            fs::write(&path, &content).expect("written");
            close(&path);
            assert_eq!(Key::read(&path).is_ok(), is_key, "{content:?}");
        }
    }

    fn close(path: &Path) {
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            fs::set_permissions(path, fs::Permissions::from_mode(0o600)).expect("permissions");
        }
    }
}
