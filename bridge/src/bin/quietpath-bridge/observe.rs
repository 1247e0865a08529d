//! Where observations come from: a file that grows, or datagrams.

use std::fs::File;
use std::io::{ErrorKind, Read};
use std::net::UdpSocket;
use std::path::PathBuf;

use quietpath_bridge::link::listen;
use quietpath_bridge::replan::Observation;

/// Longest line, bytes.
const LINE_MAX: usize = 64 * 1024;
/// Lines taken at a time, so that a flood does not hold up the flight.
const LINES_MAX: usize = 64;

/// A source of observations. Reading never waits.
pub enum Observations {
    /// None.
    None,
    /// A file, from its beginning, and what is added to it.
    Grows { path: PathBuf, file: Option<File>, rest: Vec<u8> },
    /// Datagrams of one or more lines.
    Datagrams(UdpSocket),
}

impl Observations {
    /// Opens `udp:HOST:PORT` or a file, which need not be there yet.
    pub fn open(source: Option<&str>) -> Result<Self, String> {
        match source {
            None => Ok(Self::None),
            Some(source) => match source.strip_prefix("udp:") {
                Some(at) => {
                    listen(at).map(Self::Datagrams).map_err(|error| format!("--observations {source}: {error}"))
                }
                None => Ok(Self::Grows { path: source.into(), file: None, rest: Vec::new() }),
            },
        }
    }

    /// What has come since the last time.
    pub fn poll(&mut self) -> Vec<Result<Observation, String>> {
        let text = match self {
            Self::None => return Vec::new(),
            Self::Grows { path, file, rest } => {
                if file.is_none() {
                    *file = File::open(path).ok();
                }
                let Some(file) = file else { return Vec::new() };
                grown(file, rest)
            }
            Self::Datagrams(socket) => datagrams(socket),
        };
        let lines = text.lines().filter(|line| !line.trim().is_empty());
        lines.take(LINES_MAX).map(Observation::parse).collect()
    }
}

/// The whole lines that a file has grown by; `rest` keeps the one that is not whole yet.
fn grown(file: &mut File, rest: &mut Vec<u8>) -> String {
    let mut more = vec![0; LINE_MAX];
    let count = file.read(&mut more).unwrap_or(0);
    rest.extend(more.iter().take(count));
    let Some(end) = rest.iter().rposition(|byte| *byte == b'\n') else {
        if rest.len() > LINE_MAX {
            rest.clear();
        }
        return String::new();
    };
    let whole: Vec<u8> = rest.drain(..=end).collect();
    String::from_utf8_lossy(&whole).into_owned()
}

fn datagrams(socket: &UdpSocket) -> String {
    let mut text = String::new();
    let mut buffer = vec![0; LINE_MAX];
    for _ in 0..LINES_MAX {
        match socket.recv(&mut buffer) {
            Ok(count) => {
                text.push_str(&String::from_utf8_lossy(buffer.get(..count).unwrap_or_default()));
                text.push('\n');
            }
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(_) => break,
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    #[test]
    fn a_file_is_read_as_it_grows_line_by_line() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("seen.jsonl");
        let mut source = Observations::open(path.to_str()).expect("a source");
        assert!(source.poll().is_empty(), "not there yet");
        let mut file = File::create(&path).expect("created");
        write!(file, "{{\"id\": \"a\", \"position\": [1, 2]}}\n{{\"id\": \"b\"").expect("written");
        let names = |source: &mut Observations| -> Vec<String> {
            source.poll().into_iter().map(|seen| seen.map_or_else(|why| why, |seen| seen.id)).collect()
        };
        assert_eq!(names(&mut source), ["a"]);
        assert!(source.poll().is_empty());
        writeln!(file, ", \"position\": [1, 2]}}\nnonsense").expect("written");
        let seen = names(&mut source);
        assert_eq!(seen[0], "b");
        assert!(seen[1].starts_with("is no observation"), "{seen:?}");
    }

    #[test]
    fn datagrams_hold_one_or_more_lines() {
        let port = UdpSocket::bind("127.0.0.1:0").expect("a socket").local_addr().expect("bound").port();
        let mut source = Observations::open(Some(&format!("udp:127.0.0.1:{port}"))).expect("a source");
        assert!(source.poll().is_empty());
        let sender = UdpSocket::bind("127.0.0.1:0").expect("a socket");
        sender.send_to(b"{\"id\": \"a\"}\n{\"id\": \"b\"}", ("127.0.0.1", port)).expect("sent");
        let begin = std::time::Instant::now();
        let mut seen = Vec::new();
        while seen.len() < 2 && begin.elapsed().as_secs() < 5 {
            seen.extend(source.poll());
        }
        assert_eq!(seen.len(), 2);
        assert!(Observations::open(Some("udp:nowhere")).is_err());
    }
}
