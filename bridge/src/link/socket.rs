//! Sockets and serial ports: the one file that opens them.
//!
//! Every device is a half that receives, which waits at most [`WAIT`], and a half that transmits, which another
//! thread may use at the same time. Whatever a device does, neither waits for ever.

use std::collections::BTreeMap;
use std::io::{self, ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream, ToSocketAddrs, UdpSocket};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use serialport::SerialPort;

use super::address::Address;

/// Longest that receiving waits, and so the longest that closing a link takes.
const WAIT: Duration = Duration::from_millis(50);
/// Longest that transmitting waits for a device that takes nothing.
const WRITE_TIMEOUT: Duration = Duration::from_secs(1);
/// Longest that connecting waits.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(2);
/// How often the connections of a listener are looked at.
const POLL: Duration = Duration::from_millis(2);
/// Connections that a listener keeps.
const CONNECTIONS_MAX: usize = 8;

/// Who sent some bytes, as far as the device can tell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Source {
    /// Whoever is at the other end of the line.
    Line,
    /// An address on the network.
    Peer(SocketAddr),
}

/// The half of a device that receives.
pub(super) trait Receive: Send {
    /// Bytes and where they came from; `None` where none came for [`WAIT`]. An error means that the device is gone.
    fn receive(&mut self, buffer: &mut [u8]) -> io::Result<Option<(usize, Source)>>;
}

/// The half of a device that transmits.
pub(super) trait Transmit: Send + Sync {
    /// Sends one frame.
    fn transmit(&self, bytes: &[u8], to: Source) -> io::Result<()>;
}

/// Both halves of a device.
pub(super) type Halves = (Box<dyn Receive>, Arc<dyn Transmit>);

/// Opens a device.
pub(super) fn open(address: &Address) -> io::Result<Halves> {
    match address {
        Address::Serial { device, baud } => serial(device, *baud),
        Address::UdpIn(at) => udp_in(at),
        Address::UdpOut(to) => udp_out(to),
        Address::TcpIn(at) => tcp_in(at),
        Address::TcpOut(to) => tcp_out(to),
        Address::Pty(path) => pseudo_terminal(path),
    }
}

/// A socket that listens for datagrams and never waits: for those who observe.
///
/// # Errors
/// The address is taken, or is none of this machine.
pub fn listen(at: &str) -> io::Result<UdpSocket> {
    let socket = UdpSocket::bind(resolve(at)?)?;
    socket.set_nonblocking(true)?;
    Ok(socket)
}

fn resolve(address: &str) -> io::Result<SocketAddr> {
    let missing = || io::Error::new(ErrorKind::NotFound, format!("{address} has no address"));
    address.to_socket_addrs()?.next().ok_or_else(missing)
}

/// Whether a read or write only ran out of time.
fn is_late(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted)
}

/// The device has come to its end: unplugged, or closed from the other side.
fn gone() -> io::Error {
    io::Error::new(ErrorKind::BrokenPipe, "the other side is gone")
}

/// A poisoned lock guards a device, whose state a panic elsewhere does not spoil.
fn lock<V>(mutex: &Mutex<V>) -> MutexGuard<'_, V> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

// Serial lines.

struct SerialReceiver(Box<dyn SerialPort>);
struct SerialTransmitter(Mutex<Box<dyn SerialPort>>);

fn serial(device: &str, baud: u32) -> io::Result<Halves> {
    let port = serialport::new(device, baud).timeout(WAIT).open()?;
    let mut writer = port.try_clone()?;
    writer.set_timeout(WRITE_TIMEOUT)?;
    Ok((Box::new(SerialReceiver(port)), Arc::new(SerialTransmitter(Mutex::new(writer)))))
}

impl Receive for SerialReceiver {
    fn receive(&mut self, buffer: &mut [u8]) -> io::Result<Option<(usize, Source)>> {
        match self.0.read(buffer) {
            Ok(0) => Err(gone()),
            Ok(count) => Ok(Some((count, Source::Line))),
            Err(error) if is_late(&error) => Ok(None),
            Err(error) => Err(error),
        }
    }
}

impl Transmit for SerialTransmitter {
    fn transmit(&self, bytes: &[u8], _: Source) -> io::Result<()> {
        lock(&self.0).write_all(bytes)
    }
}

/// The near end of a pseudo-terminal. The far end stays open here too: without a user it is a line without a listener, not
/// a line that is gone.
#[cfg(unix)]
struct PseudoTerminal {
    near: SerialReceiver,
    _far: serialport::TTYPort,
    path: std::path::PathBuf,
}

#[cfg(unix)]
fn pseudo_terminal(path: &str) -> io::Result<Halves> {
    let (mut near, far) = serialport::TTYPort::pair()?;
    near.set_timeout(WAIT)?;
    let mut writer = near.try_clone()?;
    writer.set_timeout(WRITE_TIMEOUT)?;
    let name = far.name().ok_or_else(|| io::Error::new(ErrorKind::NotFound, "the pseudo-terminal has no name"))?;
    // One that a process left behind leads nowhere.
    let is_left = std::fs::symlink_metadata(path).is_ok_and(|found| found.is_symlink());
    if is_left && !std::path::Path::new(path).exists() {
        std::fs::remove_file(path)?;
    }
    std::os::unix::fs::symlink(name, path)?;
    let near = SerialReceiver(Box::new(near));
    let receiver = PseudoTerminal { near, _far: far, path: path.into() };
    Ok((Box::new(receiver), Arc::new(SerialTransmitter(Mutex::new(writer)))))
}

#[cfg(not(unix))]
fn pseudo_terminal(_: &str) -> io::Result<Halves> {
    Err(io::Error::new(ErrorKind::Unsupported, "this system has no pseudo-terminals"))
}

#[cfg(unix)]
impl Receive for PseudoTerminal {
    fn receive(&mut self, buffer: &mut [u8]) -> io::Result<Option<(usize, Source)>> {
        self.near.receive(buffer)
    }
}

#[cfg(unix)]
impl Drop for PseudoTerminal {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.path);
    }
}

// Datagrams.

struct Datagrams {
    socket: UdpSocket,
    /// The only source that counts; `None` where everybody may send.
    remote: Option<SocketAddr>,
}

fn udp_in(at: &str) -> io::Result<Halves> {
    datagrams(UdpSocket::bind(resolve(at)?)?, None)
}

fn udp_out(to: &str) -> io::Result<Halves> {
    let remote = resolve(to)?;
    let any: SocketAddr = if remote.is_ipv4() { ([0; 4], 0).into() } else { ([0_u16; 8], 0).into() };
    let socket = UdpSocket::bind(any)?;
    socket.connect(remote)?;
    datagrams(socket, Some(remote))
}

fn datagrams(socket: UdpSocket, remote: Option<SocketAddr>) -> io::Result<Halves> {
    socket.set_read_timeout(Some(WAIT))?;
    socket.set_write_timeout(Some(WRITE_TIMEOUT))?;
    let writer = socket.try_clone()?;
    let halves = |socket| Datagrams { socket, remote };
    Ok((Box::new(halves(socket)), Arc::new(halves(writer))))
}

/// A socket hears that nobody listens at the other end; that may change at any time.
fn is_unanswered(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::ConnectionRefused | ErrorKind::ConnectionReset) || is_late(error)
}

impl Receive for Datagrams {
    fn receive(&mut self, buffer: &mut [u8]) -> io::Result<Option<(usize, Source)>> {
        match self.socket.recv_from(buffer) {
            Ok((count, _)) if self.remote.is_some() => Ok(Some((count, Source::Line))),
            Ok((count, from)) => Ok(Some((count, Source::Peer(from)))),
            Err(error) if is_unanswered(&error) => Ok(None),
            Err(error) => Err(error),
        }
    }
}

impl Transmit for Datagrams {
    fn transmit(&self, bytes: &[u8], to: Source) -> io::Result<()> {
        let sent = match (self.remote, to) {
            (Some(_), _) => self.socket.send(bytes),
            (None, Source::Peer(to)) => self.socket.send_to(bytes, to),
            (None, Source::Line) => return Ok(()),
        };
        match sent {
            Err(error) if !is_unanswered(&error) => Err(error),
            _ => Ok(()),
        }
    }
}

// Streams.

struct Stream(TcpStream);

fn tcp_out(to: &str) -> io::Result<Halves> {
    let stream = TcpStream::connect_timeout(&resolve(to)?, CONNECT_TIMEOUT)?;
    stream.set_nodelay(true)?;
    stream.set_read_timeout(Some(WAIT))?;
    stream.set_write_timeout(Some(WRITE_TIMEOUT))?;
    let writer = stream.try_clone()?;
    Ok((Box::new(Stream(stream)), Arc::new(Stream(writer))))
}

impl Receive for Stream {
    fn receive(&mut self, buffer: &mut [u8]) -> io::Result<Option<(usize, Source)>> {
        match self.0.read(buffer) {
            Ok(0) => Err(gone()),
            Ok(count) => Ok(Some((count, Source::Line))),
            Err(error) if is_late(&error) => Ok(None),
            Err(error) => Err(error),
        }
    }
}

impl Transmit for Stream {
    fn transmit(&self, bytes: &[u8], _: Source) -> io::Result<()> {
        // A frame of which only the head fitted must not be followed by another: the connection is given up.
        (&self.0).write_all(bytes).inspect_err(|_| {
            let _ = self.0.shutdown(std::net::Shutdown::Both);
        })
    }
}

/// Connections to a listener: anyone may connect, the endpoint says whom to answer.
struct Listener {
    listener: TcpListener,
    connections: Arc<Mutex<BTreeMap<SocketAddr, TcpStream>>>,
}

struct Connections(Arc<Mutex<BTreeMap<SocketAddr, TcpStream>>>);

fn tcp_in(at: &str) -> io::Result<Halves> {
    let listener = TcpListener::bind(resolve(at)?)?;
    listener.set_nonblocking(true)?;
    let connections = Arc::new(Mutex::new(BTreeMap::new()));
    let transmitter = Connections(Arc::clone(&connections));
    Ok((Box::new(Listener { listener, connections }), Arc::new(transmitter)))
}

impl Listener {
    fn accept(&self) -> io::Result<()> {
        while let Some((stream, from)) = match self.listener.accept() {
            Ok(accepted) => Some(accepted),
            Err(error) if is_late(&error) => None,
            // A client that gave up while it waited.
            Err(error) if matches!(error.kind(), ErrorKind::ConnectionAborted | ErrorKind::ConnectionReset) => None,
            Err(error) => return Err(error),
        } {
            stream.set_nonblocking(true)?;
            stream.set_nodelay(true)?;
            let mut connections = lock(&self.connections);
            if connections.len() < CONNECTIONS_MAX {
                connections.insert(from, stream);
            }
        }
        Ok(())
    }

    fn read(&self, buffer: &mut [u8]) -> Option<(usize, Source)> {
        let mut connections = lock(&self.connections);
        let mut closed = Vec::new();
        let mut read = None;
        for (from, stream) in connections.iter_mut() {
            match stream.read(buffer) {
                Ok(count) if count > 0 => {
                    read = Some((count, Source::Peer(*from)));
                    break;
                }
                Err(error) if is_late(&error) => {}
                _ => closed.push(*from),
            }
        }
        for from in closed {
            connections.remove(&from);
        }
        read
    }
}

impl Receive for Listener {
    fn receive(&mut self, buffer: &mut [u8]) -> io::Result<Option<(usize, Source)>> {
        let rounds = WAIT.as_millis() / POLL.as_millis();
        for _ in 0..rounds {
            self.accept()?;
            if let Some(read) = self.read(buffer) {
                return Ok(Some(read));
            }
            std::thread::sleep(POLL);
        }
        Ok(None)
    }
}

impl Transmit for Connections {
    fn transmit(&self, bytes: &[u8], to: Source) -> io::Result<()> {
        let Source::Peer(to) = to else { return Ok(()) };
        let mut connections = lock(&self.0);
        let Some(stream) = connections.get_mut(&to) else { return Ok(()) };
        // Not blocking: a client that does not read is cut off instead of holding up the others.
        if stream.write_all(bytes).is_err() {
            connections.remove(&to);
        }
        Ok(())
    }
}
