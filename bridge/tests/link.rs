//! Links on real sockets and a pseudo-terminal: threads, reconnection, junk, capture, closing.

use std::io::Write;
use std::net::{TcpListener, UdpSocket};
use std::time::{Duration, Instant};

use quietpath_bridge::clock::SystemClock;
use quietpath_bridge::link::codec::companion_heartbeat;
use quietpath_bridge::link::dialect::{HEARTBEAT_DATA, MavAutopilot, MavMessage, MavType};
use quietpath_bridge::link::{Accept, Address, Endpoint, Event, Identity, Link};

const VEHICLE: Identity = Identity { system: 7, component: 1 };
/// Longest that anything here may take.
const PATIENCE: Duration = Duration::from_secs(10);

fn autopilot_heartbeat() -> MavMessage {
    let MavMessage::HEARTBEAT(data) = companion_heartbeat() else { panic!("a heartbeat") };
    let (mavtype, autopilot) = (MavType::MAV_TYPE_QUADROTOR, MavAutopilot::MAV_AUTOPILOT_PX4);
    MavMessage::HEARTBEAT(HEARTBEAT_DATA { mavtype, autopilot, ..data })
}

fn open(address: &str, endpoint: Endpoint) -> Link {
    let address: Address = address.parse().expect("an address");
    Link::open(address, endpoint, SystemClock::start()).expect("threads")
}

fn bridge(address: &str) -> Link {
    open(address, Endpoint::new(Identity::COMPANION, Accept::Autopilot(None)))
}

fn vehicle(address: &str) -> Link {
    open(address, Endpoint::new(VEHICLE, Accept::Anyone))
}

/// Waits for an event; both ends send heartbeats meanwhile.
fn until(mut ends: [(&mut Link, MavMessage); 2], mut done: impl FnMut(usize, &Event) -> bool) {
    let begin = Instant::now();
    while begin.elapsed() < PATIENCE {
        for (index, (link, heartbeat)) in ends.iter_mut().enumerate() {
            link.send(heartbeat);
            while let Some((_, event)) = link.receive(Duration::from_millis(5)) {
                if done(index, &event) {
                    return;
                }
            }
        }
    }
    panic!("nothing came of it in {PATIENCE:?}");
}

/// Waits until both ends have heard each other.
fn meet(bridge: &mut Link, vehicle: &mut Link) {
    let mut heard = [false; 2];
    until([(bridge, companion_heartbeat()), (vehicle, autopilot_heartbeat())], |end, event| {
        heard[end] |= matches!(event, Event::Frame(_));
        heard == [true; 2]
    });
}

/// A port that nobody uses just now.
fn free_port() -> u16 {
    let socket = UdpSocket::bind("127.0.0.1:0").expect("a socket");
    socket.local_addr().expect("bound").port()
}

#[test]
fn datagrams_and_streams_meet_whichever_end_waits() {
    for (waits, calls) in [("udpin", "udpout"), ("tcpin", "tcpout")] {
        let port = free_port();
        let (waits, calls) = (format!("{waits}:127.0.0.1:{port}"), format!("{calls}:127.0.0.1:{port}"));
        // The caller is there first: nobody answers yet.
        let mut bridge_calls = bridge(&calls);
        assert_eq!(bridge_calls.endpoint().identity(), Identity::COMPANION);
        meet(&mut bridge_calls, &mut vehicle(&waits));
        drop(bridge_calls);
        let port = free_port();
        let scheme = |address: &str| format!("{}:127.0.0.1:{port}", address.split(':').next().expect("a scheme"));
        meet(&mut bridge(&scheme(&waits)), &mut vehicle(&scheme(&calls)));
    }
}

#[test]
fn a_stray_datagram_captures_nothing_and_junk_blocks_nothing() {
    let port = free_port();
    let mut ours = bridge(&format!("udpin:127.0.0.1:{port}"));
    let mut theirs = vehicle(&format!("udpout:127.0.0.1:{port}"));
    meet(&mut ours, &mut theirs);
    let peer = ours.endpoint().peer();
    let stranger = UdpSocket::bind("127.0.0.1:0").expect("a socket");
    stranger.connect(("127.0.0.1", port)).expect("loopback");
    let mut rival = Endpoint::new(Identity { system: 99, component: 1 }, Accept::Anyone);
    for round in 0..200_u8 {
        stranger.send(&[round; 1400]).expect("sent");
        stranger.send(&rival.encode(quietpath_bridge::clock::Time::ZERO, &autopilot_heartbeat())).expect("sent");
    }
    let mut later = 0;
    until([(&mut ours, companion_heartbeat()), (&mut theirs, autopilot_heartbeat())], |end, event| {
        if let (0, Event::Frame(frame)) = (end, event) {
            assert_eq!(frame.from, VEHICLE);
            later += 1;
        }
        later > 20
    });
    assert_eq!(ours.endpoint().peer(), peer);
    let statistics = ours.statistics();
    assert!(statistics.stray > 0 && statistics.junk() >= 1400, "{statistics:?}");
}

#[test]
fn a_stream_is_connected_again_after_it_broke() {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a listener");
    let port = listener.local_addr().expect("bound").port();
    let mut link = bridge(&format!("tcpout:127.0.0.1:{port}"));
    let mut vehicle = Endpoint::new(VEHICLE, Accept::Anyone);
    for round in 1..=3 {
        let (mut stream, _) = listener.accept().expect("a connection");
        // Half a frame before the connection breaks must not spoil the first frame after it.
        let bytes = vehicle.encode(quietpath_bridge::clock::Time::ZERO, &autopilot_heartbeat());
        stream.write_all(&bytes).expect("written");
        stream.write_all(&bytes[..9]).expect("written");
        let begin = Instant::now();
        let mut events = Vec::new();
        while !events.iter().any(|event| matches!(event, Event::Frame(_))) {
            assert!(begin.elapsed() < PATIENCE, "{events:?}");
            events.extend(link.receive(Duration::from_millis(100)).map(|(_, event)| event));
        }
        assert!(events.contains(&Event::Up), "{events:?}");
        assert_eq!(link.statistics().opened, round);
        drop(stream);
        let down = std::iter::repeat_with(|| link.receive(PATIENCE)).flatten().next().expect("an event").1;
        assert!(matches!(&down, Event::Down(why) if why.starts_with("tcpout:127.0.0.1:")), "{down:?}");
    }
}

#[test]
fn closing_takes_no_longer_than_a_stuck_device() {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a listener");
    let port = listener.local_addr().expect("bound").port();
    let mut link = vehicle(&format!("tcpout:127.0.0.1:{port}"));
    // Connected, and never read from.
    let (_stream, _) = listener.accept().expect("a connection");
    for _ in 0..200_000 {
        link.send(&companion_heartbeat());
    }
    assert!(link.statistics().overrun > 0, "the queue has an end");
    let begin = Instant::now();
    drop(link);
    assert!(begin.elapsed() < Duration::from_secs(4), "{:?}", begin.elapsed());
}

#[test]
fn what_was_sent_last_goes_out_before_the_link_closes() {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a listener");
    let port = listener.local_addr().expect("bound").port();
    let mut link = vehicle(&format!("tcpout:127.0.0.1:{port}"));
    let (mut stream, _) = listener.accept().expect("a connection");
    assert_eq!(link.receive(PATIENCE).map(|(_, event)| event), Some(Event::Up));
    let mut expected = Endpoint::new(VEHICLE, Accept::Anyone);
    let mut bytes = Vec::new();
    for _ in 0..50 {
        link.send(&companion_heartbeat());
        bytes.extend(expected.encode(quietpath_bridge::clock::Time::ZERO, &companion_heartbeat()));
    }
    drop(link);
    let mut received = Vec::new();
    std::io::Read::read_to_end(&mut stream, &mut received).expect("read to the end");
    assert_eq!(received, bytes);
}

#[test]
fn a_device_that_is_not_there_is_named_with_its_reason() {
    let mut link = bridge("serial:/dev/quietpath-no-such-device:57600");
    let (_, event) = link.receive(PATIENCE).expect("an event");
    let Event::Down(why) = event else { panic!("{event:?}") };
    assert!(why.starts_with("serial:/dev/quietpath-no-such-device:57600: "), "{why}");
    // Somebody else has the port.
    let taken = UdpSocket::bind("127.0.0.1:0").expect("a socket");
    let port = taken.local_addr().expect("bound").port();
    let (_, event) = bridge(&format!("udpin:127.0.0.1:{port}")).receive(PATIENCE).expect("an event");
    assert!(matches!(&event, Event::Down(why) if why.contains("in use")), "{event:?}");
}

#[cfg(unix)]
#[test]
fn a_serial_line_carries_frames_and_is_opened_again_after_it_vanished() {
    use serialport::{SerialPort, TTYPort};
    use std::io::Read;
    use std::os::unix::fs::symlink;

    let folder = tempfile::tempdir().expect("a folder");
    let device = folder.path().join("ttyACM0");
    let mut link = bridge(&format!("serial:{}:921600", device.display()));
    let mut vehicle = Endpoint::new(VEHICLE, Accept::Anyone);
    for round in 1..=2 {
        let (mut master, slave) = TTYPort::pair().expect("a pseudo-terminal");
        symlink(slave.name().expect("a name"), &device).expect("a link to the device");
        drop(slave);
        master.set_timeout(Duration::from_millis(20)).expect("set");
        let begin = Instant::now();
        let mut heard = Vec::new();
        let (mut up, mut framed) = (false, false);
        let mut buffer = [0; 512];
        while !(up && framed && heard.len() > 20) {
            assert!(begin.elapsed() < PATIENCE, "round {round}: up {up}, framed {framed}, heard {}", heard.len());
            let now = quietpath_bridge::clock::Time::ZERO;
            let _ = master.write_all(&vehicle.encode(now, &autopilot_heartbeat()));
            while let Some((_, event)) = link.receive(Duration::from_millis(20)) {
                up |= event == Event::Up;
                framed |= matches!(event, Event::Frame(_));
            }
            link.send(&companion_heartbeat());
            let count = master.read(&mut buffer).unwrap_or(0);
            heard.extend_from_slice(&buffer[..count]);
        }
        assert_eq!(vehicle_hears(&heard), Some(Identity::COMPANION));
        std::fs::remove_file(&device).expect("unplugged");
        drop(master);
        let gone = |link: &mut Link| {
            let events = std::iter::repeat_with(|| link.receive(PATIENCE)).map_while(|event| event);
            events.map(|(_, event)| event).any(|event| matches!(event, Event::Down(_)))
        };
        assert!(gone(&mut link), "round {round}: nobody noticed");
    }
}

#[cfg(unix)]
fn vehicle_hears(bytes: &[u8]) -> Option<Identity> {
    let mut vehicle = Endpoint::new(VEHICLE, Accept::Anyone);
    let frames = vehicle.decode(quietpath_bridge::clock::Time::ZERO, quietpath_bridge::link::Source::Line, bytes);
    frames.first().map(|frame| frame.from)
}
