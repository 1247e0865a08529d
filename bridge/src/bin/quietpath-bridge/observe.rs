//! Where observations come from: a file that grows, or datagrams; and the command that sends such datagrams.
//!
//! Datagrams of other hosts are taken with a key only: see `quietpath_bridge::replan::seal`. Whatever a source does, a
//! poll takes [`LINES_MAX`] lines and [`BYTES_MAX`] bytes, and [`WAITING_MAX`] lines wait at most.

use std::collections::VecDeque;
use std::fs::File;
use std::io::{BufRead, ErrorKind, Read};
use std::net::{SocketAddr, UdpSocket};
use std::path::PathBuf;
use std::time::SystemTime;

use quietpath_bridge::link::listen;
use quietpath_bridge::link::signing::Key;
use quietpath_bridge::replan::Observation;
use quietpath_bridge::replan::seal::{Opener, seal};

use crate::Outcome;
use crate::cli::ObserveArgs;

/// Longest line, bytes; also what a datagram can hold.
const LINE_MAX: usize = 64 * 1024;
/// Lines taken at a time, so that a flood does not hold up the flight.
const LINES_MAX: usize = 64;
/// Bytes read at a time.
const BYTES_MAX: usize = 4 * LINE_MAX;
/// Lines that wait to be taken. A file waits with them; of datagrams, those that are too many are dropped.
const WAITING_MAX: usize = 1024;

/// A source of observations. Reading never waits.
pub struct Observations {
    source: Source,
    waiting: VecDeque<Result<String, String>>,
    dropped: u64,
}

enum Source {
    /// None.
    None,
    /// A file, from its beginning, and what is added to it.
    Grows { path: PathBuf, file: Option<File>, rest: Vec<u8>, is_skipping: bool },
    /// Datagrams of one or more lines, sealed where there is a key.
    Datagrams { socket: UdpSocket, opener: Option<Box<Opener>> },
}

impl Observations {
    /// Opens `udp:HOST:PORT` or a file, which need not be there yet.
    pub fn open(source: Option<&str>, key: Option<Key>) -> Result<Self, String> {
        let source = match source {
            None => Source::None,
            Some(source) => match source.strip_prefix("udp:") {
                Some(at) => datagram_socket(source, at, key)?,
                None if key.is_some() => {
                    let help = "a file is protected by its permissions: leave the key out";
                    return Err(format!("--observations-key: {source} is no udp:HOST:PORT\n  help: {help}"));
                }
                None => Source::Grows { path: source.into(), file: None, rest: Vec::new(), is_skipping: false },
            },
        };
        Ok(Self { source, waiting: VecDeque::new(), dropped: 0 })
    }

    /// What has come since the last time.
    pub fn poll(&mut self) -> Vec<Result<Observation, String>> {
        match &mut self.source {
            Source::None => return Vec::new(),
            Source::Grows { path, file, rest, is_skipping } => {
                if file.is_none() {
                    *file = File::open(path).ok();
                }
                if let (Some(file), true) = (file, self.waiting.is_empty()) {
                    grown(file, rest, is_skipping, &mut self.waiting);
                }
            }
            Source::Datagrams { socket, opener } => {
                datagrams(socket, opener.as_deref_mut(), &mut self.waiting);
                let excess = self.waiting.len().saturating_sub(WAITING_MAX);
                if excess > 0 {
                    // What came first is the oldest, and newer ones say more.
                    self.waiting.drain(..excess);
                    self.dropped += excess as u64;
                    tracing::warn!("observations come faster than they can be used: {} dropped so far", self.dropped);
                }
            }
        }
        let count = self.waiting.len().min(LINES_MAX);
        let parse = |line: Result<String, String>| line.and_then(|line| Observation::parse(&line));
        self.waiting.drain(..count).map(parse).collect()
    }
}

fn datagram_socket(source: &str, at: &str, key: Option<Key>) -> Result<Source, String> {
    let socket = listen(at).map_err(|error| format!("--observations {source}: {error}"))?;
    let is_local = socket.local_addr().is_ok_and(|address: SocketAddr| address.ip().is_loopback());
    if !is_local && key.is_none() {
        let message = "listens to other hosts, and anybody on the network could say where sensors are";
        let help = "listen at 127.0.0.1, or give --observations-key FILE and send with `quietpath-bridge observe`";
        return Err(format!("--observations {source} {message}\n  help: {help}"));
    }
    Ok(Source::Datagrams { socket, opener: key.map(|key| Box::new(Opener::new(key))) })
}

fn take(text: &[u8], waiting: &mut VecDeque<Result<String, String>>) {
    let text = String::from_utf8_lossy(text);
    waiting.extend(text.lines().filter(|line| !line.trim().is_empty()).map(|line| Ok(line.to_owned())));
}

/// The whole lines that a file has grown by; `rest` keeps the one that is not whole yet. A line that is too long is
/// skipped to its end.
fn grown(
    file: &mut File,
    rest: &mut Vec<u8>,
    is_skipping: &mut bool,
    waiting: &mut VecDeque<Result<String, String>>,
) {
    let mut more = vec![0; LINE_MAX];
    let count = file.read(&mut more).unwrap_or(0);
    rest.extend(more.iter().take(count));
    if *is_skipping {
        let Some(end) = rest.iter().position(|byte| *byte == b'\n') else { return rest.clear() };
        rest.drain(..=end);
        *is_skipping = false;
    }
    if let Some(end) = rest.iter().rposition(|byte| *byte == b'\n') {
        let whole: Vec<u8> = rest.drain(..=end).collect();
        take(&whole, waiting);
    }
    if rest.len() > LINE_MAX {
        rest.clear();
        *is_skipping = true;
        waiting.push_back(Err(format!("is longer than {LINE_MAX} bytes: skipped to its end")));
    }
}

fn datagrams(socket: &UdpSocket, mut opener: Option<&mut Opener>, waiting: &mut VecDeque<Result<String, String>>) {
    let (mut buffer, mut bytes) = (vec![0; LINE_MAX], 0);
    for _ in 0..LINES_MAX {
        match socket.recv(&mut buffer) {
            Ok(count) => {
                let datagram = buffer.get(..count).unwrap_or_default();
                bytes += count;
                match &mut opener {
                    None => take(datagram, waiting),
                    Some(opener) => match opener.open(unix_micros(), datagram) {
                        Ok(lines) => take(lines, waiting),
                        Err(why) => waiting.push_back(Err(why.to_owned())),
                    },
                }
                if bytes >= BYTES_MAX {
                    break;
                }
            }
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(_) => break,
        }
    }
}

fn unix_micros() -> u64 {
    let unix = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    u64::try_from(unix.as_micros()).unwrap_or(u64::MAX)
}

/// Sends lines of standard input to a bridge, one datagram each, sealed.
pub fn observe(args: &ObserveArgs) -> Outcome {
    try_observe(args).map_or_else(Outcome::Input, |()| Outcome::Done)
}

fn try_observe(args: &ObserveArgs) -> Result<(), String> {
    let key = Key::read(&args.key).map_err(|error| error.to_string())?;
    let no_way = |error: std::io::Error| format!("--to {}: {error}\n  help: give HOST:PORT", args.to);
    let to: Vec<SocketAddr> = std::net::ToSocketAddrs::to_socket_addrs(&args.to).map_err(no_way)?.collect();
    let any: SocketAddr =
        if to.first().is_some_and(SocketAddr::is_ipv6) { ([0_u16; 8], 0).into() } else { ([0; 4], 0).into() };
    let socket = UdpSocket::bind(any).and_then(|socket| socket.connect(to.as_slice()).map(|()| socket));
    let socket = socket.map_err(no_way)?;
    // Several of these may send to one bridge.
    let name = format!("observe-{}", std::process::id());
    let mut last = 0;
    for line in std::io::stdin().lock().lines() {
        let line = line.map_err(|error| format!("standard input: {error}"))?;
        if let Err(why) = Observation::parse(&line) {
            tracing::warn!("not sent, because it {why}");
            continue;
        }
        last = unix_micros().max(last + 1);
        let sealed = seal(&key, &name, last, &line);
        if let Err(error) = socket.send(&sealed) {
            tracing::warn!("not sent: {error}");
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    fn names(source: &mut Observations) -> Vec<String> {
        source.poll().into_iter().map(|seen| seen.map_or_else(|why| why, |seen| seen.id)).collect()
    }

    #[test]
    fn a_file_is_read_as_it_grows_line_by_line() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("seen.jsonl");
        let mut source = Observations::open(path.to_str(), None).expect("a source");
        assert!(source.poll().is_empty(), "not there yet");
        let mut file = File::create(&path).expect("created");
        write!(file, "{{\"id\": \"a\", \"position\": [1, 2]}}\n{{\"id\": \"b\"").expect("written");
        assert_eq!(names(&mut source), ["a"]);
        assert!(source.poll().is_empty());
        writeln!(file, ", \"position\": [1, 2]}}\nnonsense").expect("written");
        let seen = names(&mut source);
        assert_eq!(seen[0], "b");
        assert!(seen[1].starts_with("is no observation"), "{seen:?}");
    }

    #[test]
    fn nothing_of_a_file_is_lost_however_fast_it_grows_and_lines_without_end_are_skipped() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("seen.jsonl");
        let mut text: String = (0..500).map(|number| format!("{{\"id\": \"s{number}\"}}\n")).collect();
        text += &"x".repeat(5 * LINE_MAX);
        text += "\n{\"id\": \"last\"}\n";
        std::fs::write(&path, text).expect("written");
        let mut source = Observations::open(path.to_str(), None).expect("a source");
        let mut seen = Vec::new();
        for _ in 0..40 {
            let more = names(&mut source);
            assert!(more.len() <= LINES_MAX);
            seen.extend(more);
        }
        assert_eq!(seen.len(), 502, "{seen:?}");
        assert!(seen[499] == "s499" && seen[500].starts_with("is longer than 65536") && seen[501] == "last");
    }

    fn pair(key: Option<Key>) -> (Observations, UdpSocket, u16) {
        let port = UdpSocket::bind("127.0.0.1:0").expect("a socket").local_addr().expect("bound").port();
        let source = Observations::open(Some(&format!("udp:127.0.0.1:{port}")), key).expect("a source");
        (source, UdpSocket::bind("127.0.0.1:0").expect("a socket"), port)
    }

    /// Everything that has come; the kernel hands a loopback datagram over before the sender goes on.
    fn all(source: &mut Observations) -> Vec<String> {
        let begin = std::time::Instant::now();
        let mut seen = Vec::new();
        while seen.is_empty() && begin.elapsed().as_secs() < 5 {
            seen.extend(names(source));
        }
        for _ in 0..100 {
            seen.extend(names(source));
        }
        seen
    }

    #[test]
    fn datagrams_hold_one_or_more_lines() {
        let (mut source, sender, port) = pair(None);
        assert!(source.poll().is_empty());
        sender.send_to(b"{\"id\": \"a\"}\n{\"id\": \"b\"}", ("127.0.0.1", port)).expect("sent");
        assert_eq!(all(&mut source), ["a", "b"]);
        assert!(Observations::open(Some("udp:nowhere"), None).is_err());
    }

    #[test]
    fn other_hosts_need_a_key_and_with_one_nothing_unsealed_is_taken() {
        let error = Observations::open(Some("udp:0.0.0.0:0"), None).err().expect("anybody could send");
        assert!(error.contains("listens to other hosts") && error.contains("--observations-key"), "{error}");
        assert!(Observations::open(Some("udp:0.0.0.0:0"), Some(Key::new([3; 32]))).is_ok());
        assert!(Observations::open(Some("seen.jsonl"), Some(Key::new([3; 32]))).is_err());
        let (mut source, sender, port) = pair(Some(Key::new([3; 32])));
        sender.send_to(b"{\"id\": \"a\"}", ("127.0.0.1", port)).expect("sent");
        let line = "{\"id\": \"b\"}";
        let sealed = seal(&Key::new([3; 32]), "radar", unix_micros(), line);
        for datagram in [&sealed, &sealed, &seal(&Key::new([4; 32]), "radar", unix_micros() + 9, line)] {
            sender.send_to(datagram, ("127.0.0.1", port)).expect("sent");
        }
        let seen = all(&mut source);
        assert!(seen[0].starts_with("is not sealed") && seen[1] == "b", "{seen:?}");
        assert!(seen[2].starts_with("is old") && seen[3].starts_with("is sealed with another key"), "{seen:?}");
    }

    #[test]
    fn a_flood_is_dropped_from_its_oldest_end_and_holds_nobody_up() {
        let (mut source, sender, port) = pair(None);
        let lines: String = (0..3000).map(|number| format!("{{\"id\": \"s{number}\"}}\n")).collect();
        sender.send_to(lines.as_bytes(), ("127.0.0.1", port)).expect("sent");
        let seen = all(&mut source);
        assert_eq!(seen.len(), WAITING_MAX);
        assert!(seen[0] == "s1976" && seen.last().is_some_and(|last| last == "s2999"), "{seen:?}");
    }
}
