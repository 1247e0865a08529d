//! How it flies: the body in steps, what steers it in each mode, and who changes modes, arms and takes off.
//!
//! Limits: time is stepped by [`STEP`]; of more than [`CATCH_UP_MAX`] at once the beginning is left out.

use std::time::Duration;

use quietpath_bridge::clock::Time;
use quietpath_bridge::link::dialect::*;
use quietpath_bridge::mission::List;
use quietpath_bridge::telemetry::{Autopilot, Mode};

use super::body::Aim;
use super::mission::{Event, Surroundings};
use super::{Landed, Machine, Pilot};

/// Step of the body.
pub const STEP: Duration = Duration::from_millis(20);
/// Longest time that is made up for in one go.
const CATCH_UP_MAX: Duration = Duration::from_secs(10);
/// How fast it descends to land, m/s.
const DESCENT: f64 = 1.0;
/// How near a height, or home, is reached, m.
const NEAR: f64 = 0.5;
/// How long a pilot waits before doing something.
const PATIENCE: Duration = Duration::from_secs(3);

impl Machine {
    /// Moves the body up to now.
    pub(super) fn move_on(&mut self) {
        let mut at = self.stepped.unwrap_or(self.now);
        if self.now.since(at) > CATCH_UP_MAX {
            at = Time::from_micros(self.now.micros().saturating_sub(CATCH_UP_MAX.as_micros() as u64));
        }
        while self.now.since(at) >= STEP {
            at = at + STEP;
            self.step(at);
        }
        self.stepped = Some(at);
    }

    fn step(&mut self, at: Time) {
        let aim = self.aim(at);
        // On the ground nothing moves that does not take off.
        if self.landed == Landed::Ground {
            (self.body.velocity, self.hold) = ([0.0; 3], self.body.position);
            return;
        }
        let mut limits = self.settings.limits;
        if let Some(speed) = self.speed_max() {
            limits.speed_max = limits.speed_max.min(speed);
        }
        self.body.step(STEP.as_secs_f64(), &aim, &limits);
        let height = self.body.position[2];
        match self.landed {
            Landed::Rising if self.lifting.is_none() && height > NEAR => self.landed = Landed::Air,
            Landed::Landing if height <= 0.0 => {
                self.landed = Landed::Ground;
                self.disarm();
            }
            _ => {}
        }
        if let Some((target, after)) = self.lifting
            && height > target - NEAR
        {
            self.lifting = None;
            self.landed = Landed::Air;
            self.hold = [self.hold[0], self.hold[1], target];
            self.mode = after;
        }
    }

    /// The largest speed that the parameters allow, m/s.
    fn speed_max(&self) -> Option<f64> {
        match self.settings.like {
            Autopilot::Px4 => self.params.number("MPC_XY_VEL_MAX"),
            Autopilot::ArduPilot => self.params.number("WPNAV_SPEED").map(|speed| speed / 100.0),
        }
    }

    fn seconds(&self, name: &str) -> Duration {
        Duration::try_from_secs_f64(self.params.number(name).unwrap_or(1.0)).unwrap_or_default()
    }

    /// What the body is steered by at a time.
    fn aim(&mut self, at: Time) -> Aim {
        if self.down.is_some() || self.killed.is_some() {
            return Aim::Nothing;
        }
        if let Some((height, _)) = self.lifting {
            return Aim::Rest([self.hold[0], self.hold[1], height]);
        }
        match self.mode {
            Mode::Guided => self.aim_guided(at),
            Mode::Mission => self.aim_mission(at),
            Mode::Return => {
                let [east, north, height] = self.body.position;
                if east.hypot(north) < NEAR {
                    self.change_mode(Mode::Land);
                }
                Aim::Rest([0.0, 0.0, height.max(self.hold[2])])
            }
            Mode::Land => {
                if self.landed == Landed::Air || self.landed == Landed::Rising {
                    self.landed = Landed::Landing;
                }
                Aim::Velocity([0.0, 0.0, -DESCENT])
            }
            Mode::Hold | Mode::Other => Aim::Rest(self.hold),
        }
    }

    fn aim_guided(&mut self, at: Time) -> Aim {
        let kind = self.settings.like;
        if kind == Autopilot::Px4 && self.guided.has_ended(at, self.seconds("COM_OF_LOSS_T")) {
            self.change_mode(Mode::Hold);
            return Aim::Rest(self.hold);
        }
        if kind == Autopilot::Px4 && self.armed && self.landed == Landed::Ground {
            self.landed = Landed::Rising;
        }
        let timeout = if kind == Autopilot::ArduPilot { self.seconds("GUID_TIMEOUT") } else { Duration::MAX };
        self.guided.aim(at, kind, timeout).unwrap_or(Aim::Rest(self.hold))
    }

    fn aim_mission(&mut self, at: Time) -> Aim {
        let acceptance = match self.settings.like {
            Autopilot::Px4 => self.params.number("NAV_ACC_RAD"),
            Autopilot::ArduPilot => self.params.number("WPNAV_RADIUS").map(|radius| radius / 100.0),
        };
        let around = Surroundings {
            kind: self.settings.like,
            items: &self.storage.lists[0],
            frame: &self.frame,
            home_altitude: self.settings.home.altitude_m,
            acceptance: acceptance.unwrap_or(2.0),
        };
        let mut events = Vec::new();
        let aim = self.run.fly(at, &self.body, &around, &mut events);
        if self.armed && self.landed == Landed::Ground && matches!(aim, Aim::Leg { .. }) {
            self.landed = Landed::Rising;
        }
        let is_news = !events.is_empty();
        for event in events {
            match event {
                Event::Reached(seq) => {
                    self.say(MavMessage::MISSION_ITEM_REACHED(MISSION_ITEM_REACHED_DATA { seq }));
                }
                Event::Output(output, value) => {
                    self.outputs.insert(output, value);
                }
                Event::Wants(mode) => {
                    self.change_mode(mode);
                }
            }
        }
        if is_news {
            self.say(MavMessage::MISSION_CURRENT(self.mission_current()));
        }
        aim
    }

    /// What a pilot does.
    pub(super) fn fly_by_hand(&mut self) {
        let is_time = match self.settings.pilot {
            Pilot::Nobody => false,
            Pilot::TakesOff(_) => true,
            // Not in the middle of a transfer, nor right behind it: companions read back.
            Pilot::StartsMission => {
                !self.list(List::Mission).is_empty()
                    && !self.storage.is_receiving()
                    && self.now.since(self.storage.heard()) > PATIENCE
            }
        };
        if !is_time || self.landed != Landed::Ground {
            return;
        }
        let since = *self.pilot_since.get_or_insert(self.now);
        if self.now.since(since) < PATIENCE {
            return;
        }
        match self.settings.pilot {
            Pilot::Nobody => {}
            Pilot::TakesOff(height) => {
                self.take_off(height);
            }
            Pilot::StartsMission => {
                self.arm();
                self.change_mode(Mode::Mission);
            }
        }
        // Once: a vehicle that has landed stays on the ground.
        self.settings.pilot = Pilot::Nobody;
    }

    /// Arms.
    pub const fn arm(&mut self) {
        self.armed = true;
    }

    /// Disarms; in the air the motors stop, and it stands on the ground.
    pub fn disarm(&mut self) {
        (self.armed, self.landed, self.lifting) = (false, Landed::Ground, None);
        self.body.position[2] = 0.0;
        self.run.go_on_at(0, self.body.position);
    }

    /// A person arms and takes off by hand, to a height above home, m, and leaves it there.
    pub fn take_off(&mut self, height: f64) {
        self.arm();
        self.lift(height, Mode::Hold);
    }

    pub(super) fn lift(&mut self, height: f64, after: Mode) {
        if self.landed != Landed::Ground {
            return;
        }
        self.landed = Landed::Rising;
        self.hold = self.body.position;
        self.mode = if after == Mode::Guided { after } else { Mode::Hold };
        self.lifting = Some((height, after));
    }

    /// Changes the mode, as a person or a companion may; false where it is not granted.
    pub fn change_mode(&mut self, mode: Mode) -> bool {
        let is_granted = match mode {
            Mode::Guided => self.guided.is_granted(self.now, self.settings.like),
            Mode::Mission => !self.list(List::Mission).is_empty(),
            Mode::Return | Mode::Land | Mode::Hold | Mode::Other => true,
        };
        if !is_granted || mode == self.mode {
            return is_granted;
        }
        if self.settings.like == Autopilot::ArduPilot {
            self.guided.forget();
        }
        if mode == Mode::Mission {
            self.run.resume(self.body.position);
        }
        self.lifting = None;
        (self.mode, self.hold) = (mode, self.body.position);
        true
    }

    /// Goes on with the mission at an item; false where there is none.
    pub fn set_current(&mut self, item: u16) -> bool {
        let is_there = usize::from(item) < self.list(List::Mission).len();
        if is_there {
            self.run.go_on_at(item, self.body.position);
        }
        is_there
    }
}
