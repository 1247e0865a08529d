//! A machine on a real link, in time with a clock.

use std::time::Duration;

use quietpath_bridge::clock::{SystemClock, Time};
use quietpath_bridge::link::memory::{Faults, Wire};
use quietpath_bridge::link::{Accept, Endpoint, Event, Frame, Link, Statistics};

use super::{Machine, STEP};

/// Frames that are taken in one go.
const FRAMES_MAX: usize = 256;

/// Whether to go on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Go {
    /// Go on.
    On,
    /// Stop.
    Stop,
}

/// A moment of a server, for who looks on.
#[derive(Clone, Copy)]
pub struct Moment<'a> {
    /// The time.
    pub now: Time,
    /// The vehicle.
    pub machine: &'a Machine,
    /// Why the device is not there; `None` while it is.
    pub down: Option<&'a str>,
}

/// The end of a link that a vehicle speaks at: it answers whoever speaks to it first.
#[must_use]
pub fn endpoint(machine: &Machine) -> Endpoint {
    Endpoint::new(machine.identity(), Accept::Anyone)
}

/// Lets a machine fly on a link until `each` says stop. Faults, by a seed, stand between the machine and the link, in both
/// directions. `hear` gets every frame as it comes, before faults; `each` is asked at least at every [`STEP`] of the clock.
pub fn serve(
    machine: &mut Machine,
    link: &mut Link,
    clock: SystemClock,
    (faults, seed): (Faults, u64),
    mut hear: impl FnMut(&Frame),
    mut each: impl FnMut(Moment<'_>) -> Go,
) -> Statistics {
    let (mut up, mut down) = (Wire::new(faults, seed), Wire::new(faults, seed.wrapping_add(1)));
    let mut trouble: Option<String> = None;
    loop {
        let mut wait = STEP;
        for _ in 0..FRAMES_MAX {
            match link.receive(wait) {
                None => break,
                Some((_, Event::Up)) => trouble = None,
                Some((_, Event::Down(why))) => trouble = Some(why),
                Some((time, Event::Frame(frame))) => {
                    hear(&frame);
                    up.send(time, &frame.bytes);
                }
            }
            // What comes later is heard in the next round.
            wait = Duration::ZERO;
        }
        let now = clock.now();
        while let Some(bytes) = up.receive(now) {
            if let Some(frame) = Frame::parse(&bytes) {
                machine.receive(now, &frame);
            }
        }
        for sent in machine.tick(now) {
            let bytes = sent.bytes(machine.identity(), |component, message| link.encode_as(component, message));
            down.send(now, &bytes);
        }
        while let Some(bytes) = down.receive(now) {
            link.forward(bytes);
        }
        if each(Moment { now, machine, down: trouble.as_deref() }) == Go::Stop {
            return link.statistics();
        }
    }
}
