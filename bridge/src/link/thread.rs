//! The end of a link on a real device, with its threads.
//!
//! One thread opens the device, receives, and opens it anew when it is gone; another transmits. Both reach the owner of
//! the [`Link`] through queues of bounded length, so that a device that is stuck or floods cannot block whoever flies:
//! what does not fit is dropped and counted. Everything that decides happens in the owner's thread, in [`Endpoint`].
//!
//! Dropping a [`Link`] transmits what is waiting, up to the first failure, stops both threads and waits for them: a
//! tenth of a second, or a second where a device takes no bytes.

use std::collections::VecDeque;
use std::io;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, SyncSender, TrySendError};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use super::address::Address;
use super::codec::Frame;
use super::dialect::MavMessage;
use super::endpoint::Endpoint;
use super::socket::{self, Source, Transmit};
use super::statistics::Statistics;
use crate::clock::{SystemClock, Time};

/// Chunks that wait to be decoded.
const INCOMING_MAX: usize = 4096;
/// Frames that wait to be transmitted: about a second of a full serial line.
const OUTGOING_MAX: usize = 256;
/// Pause before a device is opened anew, at first; it doubles up to [`REOPEN_MAX`].
const REOPEN_MIN: Duration = Duration::from_millis(100);
/// Longest pause before a device is opened anew.
const REOPEN_MAX: Duration = Duration::from_secs(2);
/// How often a pause looks whether the link is being closed.
const NAP: Duration = Duration::from_millis(20);

/// What a link has to say.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// The device is open.
    Up,
    /// The device is gone or cannot be opened, and why. It is tried again.
    Down(String),
    /// A frame of the peer.
    Frame(Box<Frame>),
}

/// What the receiving thread sends.
enum Incoming {
    Up,
    Down(String),
    Bytes(Time, Source, Vec<u8>),
}

/// One end of a link on a real device. See the [module](self).
pub struct Link {
    endpoint: Endpoint,
    clock: SystemClock,
    outgoing: Option<SyncSender<(Source, Vec<u8>)>>,
    incoming: Receiver<Incoming>,
    decoded: VecDeque<(Time, Event)>,
    shared: Arc<Shared>,
    threads: Vec<JoinHandle<()>>,
}

/// What the threads share.
#[derive(Default)]
struct Shared {
    /// The owner is leaving: what waits is transmitted unless that fails.
    closing: AtomicBool,
    /// Both threads end.
    stop: AtomicBool,
    overrun: AtomicU64,
    transmitter: Mutex<Option<Arc<dyn Transmit>>>,
}

impl Shared {
    fn stops(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    fn transmitter(&self) -> Option<Arc<dyn Transmit>> {
        self.transmitter.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn attach(&self, transmitter: Option<Arc<dyn Transmit>>) {
        *self.transmitter.lock().unwrap_or_else(PoisonError::into_inner) = transmitter;
    }

    fn count_overrun(&self) {
        self.overrun.fetch_add(1, Ordering::Relaxed);
    }
}

impl Link {
    /// Starts a link. A device that is not there yet is waited for: the reason comes as [`Event::Down`].
    ///
    /// # Errors
    /// The operating system gives no thread.
    pub fn open(address: Address, endpoint: Endpoint, clock: SystemClock) -> io::Result<Self> {
        let (to_owner, incoming) = mpsc::sync_channel(INCOMING_MAX);
        let (outgoing, to_device) = mpsc::sync_channel(OUTGOING_MAX);
        let shared = Arc::new(Shared::default());
        let thread = |name: &str| std::thread::Builder::new().name(name.to_owned());
        let mut link = Self {
            endpoint,
            clock,
            outgoing: Some(outgoing),
            incoming,
            decoded: VecDeque::new(),
            shared: Arc::clone(&shared),
            threads: Vec::new(),
        };
        let receiver = Receiving { address, clock, shared: Arc::clone(&shared), to_owner };
        link.threads.push(thread("link-receive").spawn(move || receiver.run())?);
        link.threads.push(thread("link-transmit").spawn(move || transmit(&to_device, &shared))?);
        Ok(link)
    }

    /// What decides about frames here.
    #[must_use]
    pub const fn endpoint(&self) -> &Endpoint {
        &self.endpoint
    }

    /// Becomes part of a vehicle: see [`Endpoint::board`].
    pub const fn board(&mut self, system: u8) {
        self.endpoint.board(system);
    }

    /// Counters.
    #[must_use]
    pub fn statistics(&self) -> Statistics {
        let mut statistics = self.endpoint.statistics().clone();
        statistics.overrun += self.shared.overrun.load(Ordering::Relaxed);
        statistics
    }

    /// Takes note of a round trip that the owner measured.
    pub fn round_trip(&mut self, measured: Duration) {
        self.endpoint.statistics_mut().round_trip(measured);
    }

    /// Hands a message to the device and returns at once. What nobody can hear yet is dropped.
    pub fn send(&mut self, message: &MavMessage) {
        let bytes = self.encode_as(self.endpoint.identity().component, message);
        self.forward(bytes);
    }

    /// The frame of a message that another component of this system sends: see [`Endpoint::encode_as`].
    pub fn encode_as(&mut self, component: u8, message: &MavMessage) -> Vec<u8> {
        self.endpoint.encode_as(self.clock.now(), component, message)
    }

    /// Hands bytes that are framed already to the device and returns at once.
    pub fn forward(&mut self, bytes: Vec<u8>) {
        let to = self.endpoint.peer().unwrap_or(Source::Line);
        if let Some(outgoing) = &self.outgoing
            && let Err(TrySendError::Full(_)) = outgoing.try_send((to, bytes))
        {
            self.shared.count_overrun();
        }
    }

    /// The next event and when it came, waiting for it at most `wait`.
    pub fn receive(&mut self, wait: Duration) -> Option<(Time, Event)> {
        let until = self.clock.now() + wait;
        loop {
            if let Some(event) = self.decoded.pop_front() {
                return Some(event);
            }
            let incoming = match self.incoming.recv_timeout(self.clock.real(until.since(self.clock.now()))) {
                Ok(incoming) => incoming,
                Err(RecvTimeoutError::Timeout) => return None,
                Err(RecvTimeoutError::Disconnected) => {
                    // The receiving thread never ends by itself; should it, its owner must not spin.
                    std::thread::sleep(self.clock.real(until.since(self.clock.now())));
                    return None;
                }
            };
            let now = self.clock.now();
            match incoming {
                Incoming::Up => {
                    self.endpoint.restart();
                    self.decoded.push_back((now, Event::Up));
                }
                Incoming::Down(why) => self.decoded.push_back((now, Event::Down(why))),
                Incoming::Bytes(came, source, bytes) => {
                    let frames = self.endpoint.decode(came, source, &bytes);
                    self.decoded.extend(frames.into_iter().map(|frame| (came, Event::Frame(Box::new(frame)))));
                }
            }
        }
    }
}

impl Drop for Link {
    fn drop(&mut self) {
        self.shared.closing.store(true, Ordering::Relaxed);
        // The transmitting thread ends with its queue, and uses the device up to then.
        self.outgoing = None;
        for thread in self.threads.drain(..).rev() {
            let _ = thread.join();
            self.shared.stop.store(true, Ordering::Relaxed);
        }
    }
}

fn transmit(to_device: &Receiver<(Source, Vec<u8>)>, shared: &Shared) {
    let mut is_failing = false;
    while let Ok((to, bytes)) = to_device.recv() {
        let Some(transmitter) = shared.transmitter() else { continue };
        match transmitter.transmit(&bytes, to) {
            Ok(()) => is_failing = false,
            Err(error) => {
                if !is_failing {
                    tracing::warn!(%error, "cannot transmit");
                }
                is_failing = true;
                shared.count_overrun();
                if shared.closing.load(Ordering::Relaxed) {
                    return;
                }
            }
        }
    }
}

/// The receiving thread.
struct Receiving {
    address: Address,
    clock: SystemClock,
    shared: Arc<Shared>,
    to_owner: SyncSender<Incoming>,
}

impl Receiving {
    fn run(self) {
        let mut pause = REOPEN_MIN;
        let mut last = String::new();
        while !self.shared.stops() {
            let why = match socket::open(&self.address) {
                Ok((mut receiver, transmitter)) => {
                    self.shared.attach(Some(transmitter));
                    self.tell(Incoming::Up);
                    (pause, last) = (REOPEN_MIN, String::new());
                    let error = self.receive(receiver.as_mut());
                    self.shared.attach(None);
                    error
                }
                Err(error) => Some(error),
            };
            let Some(why) = why else { return };
            let why = format!("{}: {why}", self.address);
            if why != last {
                tracing::warn!(%why, "the link is down");
                self.tell(Incoming::Down(why.clone()));
                last = why;
            }
            self.rest(pause);
            pause = (pause * 2).min(REOPEN_MAX);
        }
    }

    /// Receives until the device is gone, or, without an error, until the link is closed.
    fn receive(&self, receiver: &mut dyn socket::Receive) -> Option<io::Error> {
        let mut buffer = vec![0; 64 * 1024];
        while !self.shared.stops() {
            match receiver.receive(&mut buffer) {
                Ok(None) => {}
                Ok(Some((count, source))) => {
                    let bytes = buffer.get(..count).unwrap_or_default().to_vec();
                    self.tell(Incoming::Bytes(self.clock.now(), source, bytes));
                }
                Err(error) => return Some(error),
            }
        }
        None
    }

    fn tell(&self, incoming: Incoming) {
        if let Err(TrySendError::Full(_)) = self.to_owner.try_send(incoming) {
            self.shared.count_overrun();
        }
    }

    fn rest(&self, pause: Duration) {
        let until = self.clock.now() + pause;
        while !self.shared.stops() && self.clock.now() < until {
            std::thread::sleep(NAP);
        }
    }
}
