//! Flying a mission: item after item, along straight legs.
//!
//! The item that is flown lives in memory of its own: a mission that is replaced does not change it, and it is flown to
//! its end. What comes after it is where autopilots disagree: PX4 begins the new list anew, ArduPilot goes on at the number
//! after it. A new current item ends it at once.
//!
//! Limits: no jumps, no conditions, no terrain. A turn is cut by the acceptance radius and what the body's acceleration
//! asks for.

use std::time::Duration;

use quietpath_bridge::clock::Time;
use quietpath_bridge::frame::LocalFrame;
use quietpath_bridge::link::dialect::*;
use quietpath_bridge::mission::Item;
use quietpath_bridge::telemetry::{Autopilot, Mode};

use super::body::{Aim, Body, Stops, Vector, dot, norm, subtract};
use super::guided::local;

/// Items without a place that are carried out between two places.
const AT_ONCE_MAX: usize = 64;
/// Height below which a take-off is done, m.
const HEIGHT_TOLERANCE: f64 = 0.5;

/// What an autopilot knows when it flies a mission.
pub(super) struct Surroundings<'a> {
    pub(super) kind: Autopilot,
    pub(super) items: &'a [Item],
    pub(super) frame: &'a LocalFrame,
    pub(super) home_altitude: f64,
    pub(super) acceptance: f64,
}

/// What happens on the way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Event {
    /// An item was reached.
    Reached(u16),
    /// An output is set.
    Output(u8, f32),
    /// The mission asks for another mode.
    Wants(Mode),
}

#[derive(Clone, Copy, Debug)]
struct Flown {
    seq: u16,
    command: MavCmd,
    to: Vector,
    stops: Stops,
    hold: Duration,
    arrived: Option<Time>,
}

/// A mission as it is flown.
#[derive(Clone, Debug)]
pub(super) struct Run {
    flown: Option<Flown>,
    /// The item to load next.
    next: u16,
    from: Vector,
    /// Speed asked for, m/s; the vehicle's own where nobody asked.
    speed: Option<f64>,
    /// Whether `next` was said by somebody, or is that of a list that was replaced.
    is_next_said: bool,
    done: bool,
}

impl Run {
    pub(super) const fn new() -> Self {
        Self { flown: None, next: 0, from: [0.0; 3], speed: None, is_next_said: false, done: false }
    }

    /// The item that is flown to, or the next one.
    pub(super) fn current(&self) -> u16 {
        match self.flown {
            Some(flown) if !self.is_next_said => flown.seq,
            _ => self.next,
        }
    }

    pub(super) const fn is_done(&self) -> bool {
        self.done
    }

    /// Flies with a speed from now on, m/s, where it is one.
    pub(super) fn ask_speed(&mut self, speed: f64) {
        self.speed = Some(speed).filter(|speed| *speed > 0.0).or(self.speed);
    }

    /// Goes on at an item, at once.
    pub(super) const fn go_on_at(&mut self, seq: u16, from: Vector) {
        (self.flown, self.next, self.from) = (None, seq, from);
        (self.done, self.is_next_said) = (false, false);
    }

    /// The mission was replaced.
    pub(super) fn replaced(&mut self, kind: Autopilot) {
        if kind == Autopilot::Px4 {
            (self.next, self.is_next_said) = (0, true);
        }
        self.done = false;
    }

    /// The leg goes on from where the vehicle is: the mode was another one, or the autopilot began anew.
    pub(super) const fn resume(&mut self, from: Vector) {
        if let Some(flown) = self.flown.take() {
            self.next = flown.seq;
        }
        self.from = from;
    }

    /// Flies on; what to steer by.
    pub(super) fn fly(&mut self, now: Time, body: &Body, around: &Surroundings<'_>, events: &mut Vec<Event>) -> Aim {
        for _ in 0..AT_ONCE_MAX {
            let Some(flown) = self.flown else {
                if !self.load(body, around, events) {
                    return Aim::Rest(self.from);
                }
                continue;
            };
            if !self.is_over(now, body, &flown, around) {
                let (from, to, stops) = (self.from, flown.to, flown.stops);
                if flown.arrived.is_some() {
                    return Aim::Rest(to);
                }
                return Aim::Leg { from, to, speed: self.speed.unwrap_or(f64::MAX), stops };
            }
            events.push(Event::Reached(flown.seq));
            (self.from, self.flown) = (flown.to, None);
            if !std::mem::take(&mut self.is_next_said) {
                self.next = flown.seq.saturating_add(1);
            }
        }
        Aim::Rest(self.from)
    }

    /// Takes up the next item; false where the mission is over, or waits for another mode.
    fn load(&mut self, body: &Body, around: &Surroundings<'_>, events: &mut Vec<Event>) -> bool {
        let seq = usize::from(self.next);
        let Some(item) = around.items.get(seq) else {
            self.done = true;
            return false;
        };
        let is_home = around.kind == Autopilot::ArduPilot && seq == 0;
        let to = match item.command {
            _ if is_home => None,
            MavCmd::MAV_CMD_DO_CHANGE_SPEED => {
                self.ask_speed(f64::from(item.params[1]));
                None
            }
            MavCmd::MAV_CMD_DO_SET_SERVO => {
                events.push(Event::Output(item.params[0] as u8, item.params[1]));
                None
            }
            MavCmd::MAV_CMD_DO_SET_ACTUATOR => {
                let set = (1_u8..).zip(item.params).filter(|(_, value)| value.is_finite());
                events.extend(set.map(|(output, value)| Event::Output(output, value)));
                None
            }
            MavCmd::MAV_CMD_NAV_RETURN_TO_LAUNCH => {
                events.push(Event::Wants(Mode::Return));
                return false;
            }
            MavCmd::MAV_CMD_NAV_LAND => {
                events.push(Event::Wants(Mode::Land));
                return false;
            }
            MavCmd::MAV_CMD_NAV_TAKEOFF => {
                let height = place(item, around).map_or(body.position[2], |place| place[2]);
                Some([body.position[0], body.position[1], height.max(body.position[2])])
            }
            _ => place(item, around),
        };
        if let Some(to) = to {
            let hold = Duration::try_from_secs_f32(item.params[0].max(0.0)).unwrap_or_default();
            let hold = if item.command == MavCmd::MAV_CMD_NAV_TAKEOFF { Duration::ZERO } else { hold };
            let is_last = !around.items.iter().skip(seq + 1).any(|item| (item.command as u32) < 100);
            let stops = if is_last || hold > Duration::ZERO { Stops::Yes } else { Stops::No };
            let command = item.command;
            self.flown = Some(Flown { seq: self.next, command, to, stops, hold, arrived: None });
        } else {
            self.next += 1;
        }
        true
    }

    /// Whether an item is done.
    fn is_over(&mut self, now: Time, body: &Body, flown: &Flown, around: &Surroundings<'_>) -> bool {
        let rest = subtract(flown.to, body.position);
        let line = subtract(flown.to, self.from);
        let is_there = match flown.command {
            MavCmd::MAV_CMD_NAV_TAKEOFF => rest[2] < HEIGHT_TOLERANCE,
            // Flown past it, near enough: it is not flown back to.
            _ => norm(rest) < around.acceptance || (dot(rest, line) < 0.0 && norm(rest) < 3.0 * around.acceptance),
        };
        if !is_there && flown.arrived.is_none() {
            return false;
        }
        let arrived = flown.arrived.unwrap_or(now);
        if let Some(flown) = &mut self.flown {
            flown.arrived = Some(arrived);
        }
        now.since(arrived) >= flown.hold
    }
}

/// The place of an item, m from home.
#[expect(deprecated, reason = "companions still say so")]
fn place(item: &Item, around: &Surroundings<'_>) -> Option<Vector> {
    let above = match item.frame {
        MavFrame::MAV_FRAME_GLOBAL | MavFrame::MAV_FRAME_GLOBAL_INT => 0.0,
        _ => around.home_altitude,
    };
    local(around.frame, item.x, item.y, f64::from(item.z) + above)
}
