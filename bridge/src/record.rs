//! The record of a flight: every input with its time, every output, and the frames as a `.tlog`.
//!
//! A record is a file of JSON lines. The first holds everything that the flight began with; each further line is an
//! input or what came out of it:
//!
//! ```json
//! {"quietpath_record": 1, "settings": {..}, "scenario_name": "..", "scenario": "..", "plan": {..}}
//! {"t": 1520034, "in": {"frame": "fd09.."}}
//! {"t": 1520034, "out": ["send fd1f..", "say info .."]}
//! ```
//!
//! `t` is in microseconds. [`replay`] feeds the inputs to a new flight and compares what comes out, text by text: frames
//! are written unsigned and with sequence number 0, so that every bit of a message counts and the link does not.
//!
//! Every line is handed to the operating system as it is written, so a bridge that is killed loses nothing of it; a computer
//! that loses power may lose what was not on the disk yet. Wherever a record ends, in the middle of a line too, it is
//! replayed as far as it goes. A record is never written over: where the file is there already, the new one is
//! `NAME-2`, `NAME-3` and so on. Keys are in neither file, and frames are recorded unsigned or with the signature they came
//! with, which does not tell the key.
//!
//! A `.tlog` holds the frames of both directions, each behind its time in microseconds of Unix time, big-endian; ground
//! stations read it.

use std::fs::File;
use std::io::{self, BufRead, BufReader, BufWriter, Read, Write};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use serde::{Deserialize, Serialize};

use crate::clock::Time;
use crate::file::{FileError, PlanFile, ScenarioFile};
use crate::flight::{Flight, Input, Journal, Output, Settings};
use crate::link::codec::{Frame, Identity, plain_bytes};
use crate::replan::{Answer, Observation};

/// Version of the format.
const VERSION: u32 = 1;
/// Longest line, bytes: the first holds the scenario and the plan.
const LINE_MAX: usize = 64 << 20;
/// Names that are tried for a record whose own is taken.
const NAMES_MAX: u32 = 10_000;

/// The first line.
#[derive(Serialize, Deserialize)]
struct Header {
    quietpath_record: u32,
    settings: Settings,
    scenario_name: String,
    scenario: String,
    plan: PlanFile,
    /// Where the flight was picked up, if it was.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    journal: Option<Journal>,
}

/// An input as it is written.
#[derive(Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Written {
    Tick,
    Frame(String),
    LinkUp,
    LinkDown(String),
    Observed(Observation),
    Planned(Answer),
    Stop(String),
}

/// Any further line.
#[derive(Serialize, Deserialize)]
struct Line {
    t: Time,
    #[serde(rename = "in", default, skip_serializing_if = "Option::is_none")]
    input: Option<Written>,
    #[serde(rename = "out", default, skip_serializing_if = "Option::is_none")]
    output: Option<Vec<String>>,
}

impl Written {
    fn of(input: &Input) -> Self {
        match input {
            Input::Tick => Self::Tick,
            Input::Frame(frame) => Self::Frame(hexadecimal(&frame.bytes)),
            Input::LinkUp => Self::LinkUp,
            Input::LinkDown(why) => Self::LinkDown(why.clone()),
            Input::Observed(observation) => Self::Observed(observation.clone()),
            Input::Planned(answer) => Self::Planned(answer.clone()),
            Input::Stop(why) => Self::Stop(why.clone()),
        }
    }

    fn into_input(self) -> Option<Input> {
        Some(match self {
            Self::Tick => Input::Tick,
            Self::Frame(digits) => Input::Frame(Box::new(Frame::parse(&bytes(&digits)?)?)),
            Self::LinkUp => Input::LinkUp,
            Self::LinkDown(why) => Input::LinkDown(why),
            Self::Observed(observation) => Input::Observed(observation),
            Self::Planned(answer) => Input::Planned(answer),
            Self::Stop(why) => Input::Stop(why),
        })
    }
}

fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn bytes(digits: &str) -> Option<Vec<u8>> {
    let pair = |at| u8::from_str_radix(digits.get(at..at + 2)?, 16).ok();
    (0..digits.len()).step_by(2).map(pair).collect()
}

/// What a flight wants done, as text that is equal where it is equal bit for bit.
#[must_use]
pub fn written(output: &Output) -> String {
    match output {
        Output::Send(message) => format!("send {}", hexadecimal(&plain_bytes(Identity::COMPANION, message))),
        Output::Board(system) => format!("board {system}"),
        Output::RoundTrip(span) => format!("round trip {} us", span.as_micros()),
        // Debug prints as many digits as it takes to tell numbers apart.
        Output::Plan(job) => {
            format!("plan {} from {:?}: {} {:?}", job.number, job.seam, job.tail.to_json(), job.scenario.sensors)
        }
        Output::Keep(None) => "keep nothing".to_owned(),
        Output::Keep(Some(journal)) => {
            format!("keep {}", serde_json::to_string(journal).unwrap_or_else(|error| error.to_string()))
        }
        Output::Say(level, text) => format!("say {level:?} {text}"),
        Output::End(end) => format!("end {end:?}"),
    }
}

/// Writes a record and its `.tlog`.
pub struct Recorder {
    path: PathBuf,
    files: Files<File>,
}

/// Where a record is written to.
struct Files<W: Write> {
    lines: BufWriter<W>,
    tlog: BufWriter<W>,
    /// Unix time at the clock's zero, microseconds.
    epoch: u64,
    has_failed: bool,
}

/// What a flight began with, and where it was picked up.
#[derive(Clone, Copy, Debug)]
pub struct Beginning<'a> {
    /// The scenario.
    pub scenario: &'a ScenarioFile,
    /// The plan.
    pub plan: &'a PlanFile,
    /// How to fly.
    pub settings: &'a Settings,
    /// Where it was picked up, if it was.
    pub journal: Option<&'a Journal>,
}

impl Recorder {
    /// Begins a record at `path`, and `path` with the extension `tlog`; where either is there already, beside it:
    /// [`Recorder::path`] says where. `now` is the clock's time.
    ///
    /// # Errors
    /// The files cannot be written.
    pub fn create(path: &Path, beginning: &Beginning<'_>, now: Time) -> io::Result<Self> {
        let (path, lines, tlog) = unused(path)?;
        let (mut lines, tlog) = (BufWriter::new(lines), BufWriter::new(tlog));
        let header = Header {
            quietpath_record: VERSION,
            settings: beginning.settings.clone(),
            scenario_name: beginning.scenario.file_name().to_owned(),
            scenario: beginning.scenario.text().to_owned(),
            plan: beginning.plan.clone(),
            journal: beginning.journal.cloned(),
        };
        serde_json::to_writer(&mut lines, &header)?;
        writeln!(lines)?;
        lines.flush()?;
        let unix = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
        let epoch = u64::try_from(unix.as_micros()).unwrap_or(u64::MAX).saturating_sub(now.micros());
        Ok(Self { path, files: Files { lines, tlog, epoch, has_failed: false } })
    }

    /// Where the record is.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes an input and what came out of it.
    pub fn write(&mut self, now: Time, input: &Input, outputs: &[Output]) {
        self.files.write(now, input, outputs);
    }

    /// Writes a frame, of either direction, to the `.tlog`.
    pub fn frame(&mut self, now: Time, bytes: &[u8]) {
        self.files.frame(now, bytes);
    }
}

impl<W: Write> Files<W> {
    fn write(&mut self, now: Time, input: &Input, outputs: &[Output]) {
        if self.has_failed {
            return;
        }
        let output = (!outputs.is_empty()).then(|| outputs.iter().map(written).collect());
        let result = self.try_write(&Line { t: now, input: Some(Written::of(input)), output });
        if let Input::Frame(frame) = input {
            self.frame(now, &frame.bytes);
        }
        self.note(result);
        // A bridge that is killed has told the operating system everything.
        let result = self.lines.flush().and_then(|()| self.tlog.flush());
        self.note(result);
    }

    fn try_write(&mut self, line: &Line) -> io::Result<()> {
        serde_json::to_writer(&mut self.lines, line)?;
        writeln!(self.lines)
    }

    fn frame(&mut self, now: Time, bytes: &[u8]) {
        if self.has_failed {
            return;
        }
        let time = self.epoch.saturating_add(now.micros()).to_be_bytes();
        let result = self.tlog.write_all(&time).and_then(|()| self.tlog.write_all(bytes));
        self.note(result);
    }

    /// A full disk ends the record, and not the flight. Nothing follows a line that was not written.
    fn note(&mut self, result: io::Result<()>) {
        if let Err(error) = result
            && !self.has_failed
        {
            self.has_failed = true;
            tracing::error!(%error, "the record is not complete");
        }
    }
}

/// New files for a record: at `path`, or beside it where that is taken.
fn unused(path: &Path) -> io::Result<(PathBuf, File, File)> {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    for number in 1..=NAMES_MAX {
        let mut beside = path.to_owned();
        if number > 1 {
            let extension = path.extension().map(|extension| format!(".{}", extension.to_string_lossy()));
            beside.set_file_name(format!("{stem}-{number}{}", extension.unwrap_or_default()));
        }
        let create = |path: &Path| File::options().write(true).create_new(true).open(path);
        let is_taken = |error: &io::Error| error.kind() == io::ErrorKind::AlreadyExists;
        // Both or none: a .tlog alone would be taken for the frames of another record.
        if beside.with_extension("tlog").exists() {
            continue;
        }
        match create(&beside) {
            Ok(lines) => {
                let tlog = create(&beside.with_extension("tlog"))?;
                return Ok((beside, lines, tlog));
            }
            Err(error) if is_taken(&error) => {}
            Err(error) => return Err(error),
        }
    }
    Err(io::Error::new(io::ErrorKind::AlreadyExists, format!("{NAMES_MAX} records of that name are there")))
}

/// Where a record ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// With a whole line.
    Whole,
    /// In the middle of this line, counted from 1: the program was killed or the power was lost.
    Cut {
        /// The line.
        line: usize,
    },
}

/// What a replay found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Replayed {
    /// Inputs fed.
    pub inputs: usize,
    /// Outputs that were the same, bit for bit.
    pub outputs: usize,
    /// Time of the last input.
    pub last: Time,
    /// Where the record ends.
    pub ending: Ending,
}

/// Reads a record, line by line as it is written, and feeds it to a flight.
pub struct Reader {
    name: String,
    lines: BufReader<File>,
    /// The line that is being read: a record that grows may end in the middle of one.
    line: Vec<u8>,
    number: usize,
    scenario: ScenarioFile,
    flight: Flight,
}

/// A line of a record, fed to the flight.
#[derive(Clone, Debug)]
pub struct Fed {
    /// Time of the input.
    pub time: Time,
    /// The input.
    pub input: Input,
    /// What came out of it now.
    pub outputs: Vec<Output>,
    /// What came out of it then, as text.
    recorded: Vec<String>,
}

const RECORD: &str = "give the file that `quietpath-bridge run --record` wrote";

/// Reads on in a line; true where it is whole.
fn read_line(file: &mut impl BufRead, line: &mut Vec<u8>) -> io::Result<bool> {
    let left = LINE_MAX.saturating_sub(line.len());
    let count = file.by_ref().take(left as u64).read_until(b'\n', line)?;
    let is_whole = line.last() == Some(&b'\n');
    if count >= left && !is_whole {
        return Err(io::Error::new(io::ErrorKind::InvalidData, format!("it has more than {LINE_MAX} bytes")));
    }
    Ok(is_whole)
}

impl Reader {
    /// Opens a record, and makes the flight that it is of.
    ///
    /// # Errors
    /// A file that is no record.
    pub fn open(path: &Path) -> Result<Self, Box<FileError>> {
        let name = path.display().to_string();
        let fail = |message: String, help: &str| Box::new(FileError::whole(&format!("{name}:1"), message, help));
        let unreadable = |error: io::Error| fail(format!("cannot be read: {error}"), RECORD);
        let mut lines = BufReader::new(File::open(path).map_err(unreadable)?);
        let mut first = Vec::new();
        let is_whole = read_line(&mut lines, &mut first).map_err(unreadable)?;
        let header: Header = serde_json::from_slice(&first).map_err(|error| match error.is_eof() && !is_whole {
            true => fail("ends before the flight begins".into(), "the program was killed at once: nothing is lost"),
            false => fail(format!("is no record: {error}"), RECORD),
        })?;
        if header.quietpath_record != VERSION {
            let version = header.quietpath_record;
            let message = format!("is a record of version {version}, and this program reads {VERSION}");
            return Err(fail(message, "replay it with the program that wrote it"));
        }
        let scenario = ScenarioFile::parse(&header.scenario_name, &header.scenario)?.scenario;
        let mut flight = Flight::new(&scenario, &header.plan, header.settings)?;
        if let Some(journal) = header.journal {
            let misfit = |why| fail(format!("holds a journal that does not fit: {why}"), RECORD);
            flight = flight.resuming(journal).map_err(misfit)?;
        }
        Ok(Self { name, lines, line: Vec::new(), number: 1, scenario, flight })
    }

    /// The scenario that the flight began with.
    #[must_use]
    pub const fn scenario(&self) -> &ScenarioFile {
        &self.scenario
    }

    /// The flight, as it is after the lines that have been read.
    #[must_use]
    pub const fn flight(&self) -> &Flight {
        &self.flight
    }

    /// Where the record ends, as far as it was read.
    #[must_use]
    pub const fn ending(&self) -> Ending {
        if self.line.is_empty() { Ending::Whole } else { Ending::Cut { line: self.number + 1 } }
    }

    /// Feeds the next line; `None` where there is none yet, or the last one is not complete.
    ///
    /// # Errors
    /// A line that cannot be read.
    pub fn feed(&mut self) -> Result<Option<Fed>, Box<FileError>> {
        let number = self.number + 1;
        let name = &self.name;
        let fail = |message: String| Box::new(FileError::whole(&format!("{name}:{number}"), message, RECORD));
        let is_whole = read_line(&mut self.lines, &mut self.line);
        if !is_whole.map_err(|error| fail(format!("cannot be read: {error}")))? {
            return Ok(None);
        }
        let parsed: Line = serde_json::from_slice(&self.line).map_err(|error| fail(format!("is broken: {error}")))?;
        let input = parsed.input.and_then(Written::into_input).ok_or_else(|| fail("holds no input".into()))?;
        self.line.clear();
        self.number = number;
        let outputs = self.flight.step(parsed.t, input.clone());
        Ok(Some(Fed { time: parsed.t, input, outputs, recorded: parsed.output.unwrap_or_default() }))
    }
}

/// Feeds a record to a new flight; `each` gets every input's time and outputs. A record that was cut off is replayed as
/// far as it goes.
///
/// # Errors
/// A file that is no record; the first line whose outputs differ, with both.
pub fn replay(path: &Path, mut each: impl FnMut(Time, &[String])) -> Result<Replayed, Box<FileError>> {
    let mut reader = Reader::open(path)?;
    let mut replayed = Replayed { inputs: 0, outputs: 0, last: Time::ZERO, ending: Ending::Whole };
    while let Some(Fed { time, outputs, recorded, .. }) = reader.feed()? {
        let outputs: Vec<String> = outputs.iter().map(written).collect();
        if outputs != recorded {
            let message = format!("came out differently\n  then {recorded:?}\n  now  {outputs:?}");
            let (place, help) =
                (format!("{}:{}", reader.name, reader.number), "the program is another one than the one that flew");
            return Err(Box::new(FileError::whole(&place, message, help)));
        }
        replayed.inputs += 1;
        replayed.outputs += outputs.len();
        replayed.last = time;
        each(time, &outputs);
    }
    replayed.ending = reader.ending();
    Ok(replayed)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::{Cell, RefCell};
    use std::rc::Rc;

    /// A file on a disk that has room for some bytes, shared with who looks at it.
    #[derive(Clone, Default)]
    struct Disk {
        bytes: Rc<RefCell<Vec<u8>>>,
        room: Rc<Cell<usize>>,
    }

    impl Write for Disk {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            let count = bytes.len().min(self.room.get());
            if count == 0 && !bytes.is_empty() {
                return Err(io::ErrorKind::StorageFull.into());
            }
            self.room.set(self.room.get() - count);
            self.bytes.borrow_mut().extend_from_slice(&bytes[..count]);
            Ok(count)
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    /// What is on the disks, lines and frames, of a record whose disks are full after some bytes, and again have room later.
    fn written_with(room: [usize; 2]) -> [Vec<u8>; 2] {
        let disks = room.map(|room| Disk { room: Rc::new(Cell::new(room)), ..Disk::default() });
        let [lines, tlog] = disks.clone().map(BufWriter::new);
        let mut files = Files { lines, tlog, epoch: 0, has_failed: false };
        for number in 0..40 {
            if number == 30 {
                disks.iter().for_each(|disk| disk.room.set(usize::MAX));
            }
            // Longer than what is held back until the disk has room.
            let text = format!("{number} ").repeat(300);
            files.write(Time::from_millis(number), &Input::LinkDown(text.clone()), &[]);
            files.frame(Time::from_millis(number), text.as_bytes());
        }
        drop(files);
        disks.map(|disk| disk.bytes.take())
    }

    #[test]
    fn a_disk_that_is_full_for_a_while_leaves_a_record_that_ends_there() {
        let whole = written_with([usize::MAX; 2]);
        assert_eq!(whole[0].iter().filter(|byte| **byte == b'\n').count(), 40);
        for room in (0..9000).step_by(97) {
            for rooms in [[room, usize::MAX], [usize::MAX, room], [room, room]] {
                let found = written_with(rooms);
                for (found, whole) in found.iter().zip(&whole) {
                    assert!(whole.starts_with(found), "{rooms:?}: what comes after a failure is glued to it");
                    assert!(found.len() < whole.len(), "{rooms:?}: the record has ended");
                }
            }
        }
    }
}
