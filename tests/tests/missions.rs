//! Missions to a strict stand-in for an autopilot, over a wire with faults, under a clock of the test's own.

use std::time::Duration;

use quietpath_bridge::clock::Time;
use quietpath_bridge::link::codec::companion_heartbeat;
use quietpath_bridge::link::dialect::{MavCmd, MavFrame, MavMessage, MavMissionResult};
use quietpath_bridge::link::memory::{Faults, Wire};
use quietpath_bridge::link::{Accept, Endpoint, Frame, Identity, Source};
use quietpath_bridge::mission::item::first_difference;
use quietpath_bridge::mission::{Delivered, Delivery, Download, Failure, Item, List, Pace, Talk, Upload, Watch};
use quietpath_bridge::telemetry::Autopilot;
use quietpath_sim::autopilot::storage::{Storage, ack};

const VEHICLE: Identity = Identity { system: 1, component: 1 };
const US: Identity = Identity::COMPANION;
const TICK: Duration = Duration::from_millis(20);
/// Longest that a delivery may take.
const LIMIT: Time = Time::from_millis(2 * 60 * 60 * 1000);

fn talk(list: List) -> Talk {
    Talk { us: US, vehicle: VEHICLE, list }
}

fn items(count: usize) -> Vec<Item> {
    let item = |index: usize| Item {
        command: MavCmd::MAV_CMD_NAV_WAYPOINT,
        frame: MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT,
        params: [0.0; 4],
        x: 473_977_420 + 137 * index as i32,
        y: 85_455_940 - 71 * index as i32,
        z: 40.0 + 0.013 * index as f32,
        autocontinue: true,
    };
    (0..count).map(item).collect()
}

/// Items as they stand in a list.
fn items_of(list: List, count: usize) -> Vec<Item> {
    let command = match list {
        List::Mission => MavCmd::MAV_CMD_NAV_WAYPOINT,
        List::Fence => MavCmd::MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION,
        List::Rally => MavCmd::MAV_CMD_NAV_RALLY_POINT,
    };
    items(count).into_iter().map(|item| Item { command, ..item }).collect()
}

/// Both ends of a link, and the wires between them.
struct Air {
    now: Time,
    ours: Endpoint,
    theirs: Endpoint,
    up: Wire,
    down: Wire,
    vehicle: Storage,
}

impl Air {
    fn new(kind: Autopilot, faults: Faults, seed: u64) -> Self {
        let mut theirs = Endpoint::new(VEHICLE, Accept::Anyone);
        let mut ours = Endpoint::new(US, Accept::Anyone);
        let now = Time::ZERO;
        // Both know each other already.
        theirs.decode(now, Source::Line, &ours.encode(now, &companion_heartbeat()));
        ours.decode(now, Source::Line, &theirs.encode(now, &companion_heartbeat()));
        let (up, down) = (Wire::new(faults, seed), Wire::new(faults, seed + 1));
        Self { now, ours, theirs, up, down, vehicle: Storage::new(kind, VEHICLE) }
    }

    /// Lets time pass until `machine`, given a message or nothing, says that it is done.
    fn run(&mut self, mut machine: impl FnMut(Time, Option<&Frame>, &mut Vec<MavMessage>) -> bool) {
        while self.now < LIMIT {
            let now = self.now;
            let mut out = Vec::new();
            let mut done = machine(now, None, &mut out);
            while let Some(bytes) = self.down.receive(now) {
                for frame in self.ours.decode(now, Source::Line, &bytes) {
                    done |= machine(now, Some(&frame), &mut out);
                }
            }
            for message in out.drain(..) {
                let bytes = self.ours.encode(now, &message);
                self.up.send(now, &bytes);
            }
            while let Some(bytes) = self.up.receive(now) {
                for frame in self.theirs.decode(now, Source::Line, &bytes) {
                    self.vehicle.handle(now, &frame, &mut out);
                }
            }
            self.vehicle.poll(now, &mut out);
            for message in out {
                let bytes = self.theirs.encode(now, &message);
                self.down.send(now, &bytes);
            }
            if done {
                return;
            }
            self.now = now + TICK;
        }
        panic!("not done after {} s", LIMIT.seconds());
    }

    fn deliver(&mut self, list: List, items: Vec<Item>) -> (Result<Delivered, Failure>, u32) {
        let mut delivery = Delivery::new(talk(list), self.vehicle.kind(), items, Pace::default());
        self.run(|now, frame, out| {
            match frame {
                Some(frame) => delivery.handle(now, frame, out),
                None => delivery.poll(now, out),
            }
            delivery.result().is_some()
        });
        (delivery.result().expect("done"), delivery.tries())
    }
}

const KINDS: [Autopilot; 2] = [Autopilot::Px4, Autopilot::ArduPilot];

#[test]
fn missions_arrive_whatever_the_wire_does() {
    println!("items loss  kind       result  tries  frames up, down  seconds");
    for kind in KINDS {
        for count in [1, 100, 650] {
            for loss in [0.0, 0.05, 0.1, 0.2, 0.3] {
                let (delay, jitter) = (Duration::from_millis(400), Duration::from_millis(200));
                let faults = Faults { loss, duplication: 0.1, corruption: 0.01, delay, jitter };
                let mut air = Air::new(kind, faults, 1000 + count as u64);
                let sent = items(count);
                let (result, tries) = air.deliver(List::Mission, sent.clone());
                let difference = first_difference(kind, true, &sent, &air.vehicle.lists[0]);
                println!(
                    "{count:>5} {loss:>4}  {kind:<9?}  {:<6}  {tries:>5}  {:>6} {:>8}  {:>7.1}",
                    result.is_ok(),
                    air.ours.statistics().frames_out,
                    air.theirs.statistics().frames_out,
                    air.now.seconds()
                );
                // Nothing wrong is ever accepted as right; up to a fifth lost, everything arrives.
                assert!(result.is_err() || difference.is_none(), "{kind:?} {count} {loss}: {difference:?}");
                assert!(result.is_ok() || loss > 0.2, "{kind:?} {count} {loss}: {result:?}");
            }
        }
    }
}

#[test]
fn fence_rally_and_mission_do_not_mix_and_empty_lists_clear() {
    for kind in KINDS {
        let mut air = Air::new(kind, Faults::NONE, 1);
        for (list, count) in [(List::Mission, 7), (List::Fence, 5), (List::Rally, 2)] {
            assert!(air.deliver(list, items_of(list, count)).0.is_ok(), "{list}");
        }
        assert_eq!(air.vehicle.lists.each_ref().map(Vec::len), [7, 5, 2]);
        assert_eq!(air.deliver(List::Fence, Vec::new()).0.map(|delivered| delivered.count), Ok(0));
        assert_eq!(air.vehicle.lists.each_ref().map(Vec::len), [7, 0, 2]);
    }
}

#[test]
fn a_refusal_is_final_and_names_the_item() {
    let mut air = Air::new(Autopilot::ArduPilot, Faults::NONE, 1);
    let mut sent = items(9);
    sent[4].params[3] = f32::NAN;
    let (result, tries) = air.deliver(List::Mission, sent);
    let expected = Failure::Rejected { result: MavMissionResult::MAV_MISSION_INVALID_PARAM4, item: Some(4) };
    assert_eq!((result, tries), (Err(expected), 1));
    assert!(expected.to_string().ends_with("MAV_MISSION_INVALID_PARAM4 at item 4"), "{expected}");
    let (result, _) = Air::new(Autopilot::ArduPilot, Faults::NONE, 1).deliver(List::Mission, items(651));
    let full = MavMissionResult::MAV_MISSION_NO_SPACE;
    assert_eq!(result, Err(Failure::Rejected { result: full, item: None }));
}

#[test]
fn what_was_stored_wrong_is_found_and_sent_again() {
    let mut air = Air::new(Autopilot::Px4, Faults::NONE, 1);
    air.vehicle.spoils = Some(3);
    let (result, tries) = air.deliver(List::Mission, items(6));
    assert_eq!((result.map(|delivered| delivered.count), tries), (Ok(6), 2));
    assert_eq!(first_difference(Autopilot::Px4, true, &items(6), &air.vehicle.lists[0]), None);
}

#[test]
fn a_dead_wire_ends_in_silence() {
    let faults = Faults { loss: 1.0, ..Faults::NONE };
    let (result, tries) = Air::new(Autopilot::Px4, faults, 1).deliver(List::Mission, items(3));
    assert_eq!((result, tries), (Err(Failure::Silent), 5));
}

#[test]
fn downloads_bring_what_is_there() {
    let faults = Faults { loss: 0.1, delay: Duration::from_millis(50), ..Faults::NONE };
    let mut air = Air::new(Autopilot::Px4, faults, 5);
    air.vehicle.lists[1] = items(12);
    let mut download = Download::new(talk(List::Fence), Pace::default());
    air.run(|now, frame, out| {
        match frame {
            Some(frame) => download.handle(now, frame, out),
            None => download.poll(now, out),
        }
        download.result().is_some()
    });
    assert_eq!(download.result(), Some(Ok(items(12).as_slice())));
}

/// MISSION_ACK for a list by its place in [`List::ALL`].
fn acked(to: Identity, list: usize, result: MavMissionResult, id: u32) -> MavMessage {
    ack(to, List::ALL[list].mission_type(), result, id)
}

fn frame(from: Identity, message: MavMessage) -> Frame {
    Frame { from, sequence: 0, message, bytes: Vec::new() }
}

#[test]
fn acks_of_other_stations_lists_and_times_are_not_ours() {
    let mut upload = Upload::new(talk(List::Mission), items(2), Pace::default());
    let mut out = Vec::new();
    upload.poll(Time::ZERO, &mut out);
    let accepted = MavMissionResult::MAV_MISSION_ACCEPTED;
    let station = Identity { system: 255, component: 190 };
    let stray = [
        frame(VEHICLE, acked(station, 0, MavMissionResult::MAV_MISSION_DENIED, 0)),
        frame(VEHICLE, acked(US, 1, MavMissionResult::MAV_MISSION_DENIED, 0)),
        frame(station, acked(US, 0, MavMissionResult::MAV_MISSION_DENIED, 0)),
        frame(VEHICLE, acked(US, 0, MavMissionResult::MAV_MISSION_INVALID_SEQUENCE, 0)),
        // Accepted before anything was asked for: this is the answer to an upload before.
        frame(VEHICLE, acked(US, 0, accepted, 0)),
    ];
    for stray in &stray {
        upload.handle(Time::ZERO, stray, &mut out);
        assert_eq!(upload.result(), None, "{stray:?}");
    }
    upload.handle(Time::ZERO, &frame(VEHICLE, acked(US, 0, MavMissionResult::MAV_MISSION_DENIED, 0)), &mut out);
    assert!(matches!(upload.result(), Some(Err(Failure::Rejected { .. }))));
}

/// An autopilot says so for an item of a transfer before this one that came twice or late.
#[test]
fn errors_about_another_transfer_end_nothing_and_one_that_is_meant_does() {
    let error = frame(VEHICLE, acked(US, 0, MavMissionResult::MAV_MISSION_ERROR, 0));
    let mut upload = Upload::new(talk(List::Mission), items(3), Pace::default());
    upload.poll(Time::ZERO, &mut Vec::new());
    for _ in 0..4 {
        upload.handle(Time::ZERO, &error, &mut Vec::new());
        assert_eq!(upload.result(), None);
    }
    upload.handle(Time::ZERO, &error, &mut Vec::new());
    assert!(matches!(upload.result(), Some(Err(Failure::Rejected { .. }))), "{:?}", upload.result());
    let mut download = Download::new(talk(List::Mission), Pace::default());
    download.poll(Time::ZERO, &mut Vec::new());
    download.handle(Time::ZERO, &error, &mut Vec::new());
    assert!(download.result().is_none());
}

#[test]
fn a_replaced_mission_is_noticed() {
    use quietpath_bridge::link::dialect::MISSION_CURRENT_DATA;
    let current = |mission_id, total| {
        let data = MISSION_CURRENT_DATA { mission_id, total, ..Default::default() };
        frame(VEHICLE, MavMessage::MISSION_CURRENT(data))
    };
    let mut watch = Watch::new(talk(List::Mission), Delivered { count: 10, opaque_id: 77 });
    assert!(!watch.handle(&current(77, 10)));
    assert!(watch.handle(&current(78, 10)));
    watch.confirm();
    assert!(
        !watch.handle(&current(78, 10)) && watch.handle(&current(77, 10)),
        "read back, it was ours by another id"
    );
    let mut without_id = Watch::new(talk(List::Mission), Delivered { count: 10, opaque_id: 0 });
    for (total, sign) in [(10, false), (9, false), (0, false), (u16::MAX, false), (7, true)] {
        assert_eq!(without_id.handle(&current(0, total)), sign, "{total}");
    }
    assert!(!without_id.handle(&current(5, 10)) && without_id.handle(&current(6, 10)), "the first id is ours");
    let accepted = MavMissionResult::MAV_MISSION_ACCEPTED;
    let station = Identity { system: 255, component: 190 };
    let overheard = frame(VEHICLE, acked(station, 0, accepted, 0));
    assert!(without_id.handle(&overheard));
    assert!(!without_id.handle(&frame(VEHICLE, acked(station, 1, accepted, 0))), "a fence");
    assert!(!without_id.handle(&frame(VEHICLE, acked(US, 0, accepted, 0))), "ours");
    assert!(!without_id.handle(&frame(station, acked(station, 0, accepted, 0))), "not the vehicle");
}
