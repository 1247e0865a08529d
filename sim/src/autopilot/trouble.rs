//! What goes wrong on purpose, at times that are known beforehand.
//!
//! Faults of the wire (loss, delay, jitter, duplicates, reordering, corruption) are those of
//! [`quietpath_bridge::link::memory`]; they are put between the machine and its link by who joins the two.

use std::time::Duration;

use quietpath_bridge::clock::Time;
use quietpath_bridge::link::dialect::*;
use quietpath_bridge::link::{Frame, Identity};
use quietpath_bridge::mission::item::wire_degrees;
use quietpath_bridge::mission::{Item, List, Pace, Talk, Upload};

use super::{Home, Machine, Sent};

/// How long a restart takes: the vehicle glides on, armed, as after a watchdog's reset.
pub const RESTART: Duration = Duration::from_millis(1500);
/// The other ground station.
pub const STATION: Identity = Identity { system: 255, component: 190 };

/// A trouble. Times count from the clock's zero.
#[derive(Clone, Debug, PartialEq)]
pub enum Trouble {
    /// The autopilot's process begins anew. It forgets transfers, intervals and setpoints; lists, parameters, mode and arming
    /// stay, as watchdogs keep them.
    Restart {
        /// When.
        at: Time,
    },
    /// Nothing comes in or goes out for a while; the vehicle flies on.
    Silence {
        /// When it begins.
        from: Time,
        /// When it ends.
        until: Time,
    },
    /// Another ground station uploads a mission of its own.
    Station {
        /// When.
        at: Time,
        /// Its mission.
        items: Vec<Item>,
    },
}

/// A ground station that uploads something.
pub(super) struct Station(Upload);

impl Machine {
    /// Whether nothing comes in or goes out.
    pub(super) fn is_deaf(&self) -> bool {
        let is_silent = |trouble: &Trouble| match trouble {
            Trouble::Silence { from, until } => (*from..*until).contains(&self.now),
            Trouble::Restart { .. } | Trouble::Station { .. } => false,
        };
        self.down.is_some() || self.killed.is_some() || self.settings.troubles.iter().any(is_silent)
    }

    /// Begins and ends what is due.
    pub(super) fn suffer(&mut self) {
        let now = self.now;
        if self.down.is_some_and(|until| now >= until) {
            self.down = None;
            self.boot = now;
            (self.heartbeat, self.heartbeats) = (None, 0);
            self.run.resume(self.body.position);
            self.guided.wait(now);
            self.hold = self.body.position;
        }
        let is_due = |trouble: &Trouble| match trouble {
            Trouble::Restart { at } | Trouble::Station { at, .. } => *at <= now,
            Trouble::Silence { until, .. } => *until <= now,
        };
        let troubles = std::mem::take(&mut self.settings.troubles);
        let (due, later) = troubles.into_iter().partition::<Vec<_>, _>(is_due);
        self.settings.troubles = later;
        for trouble in due {
            match trouble {
                Trouble::Restart { .. } => self.restart(),
                Trouble::Silence { .. } => {}
                Trouble::Station { items, .. } => {
                    let talk = Talk { us: STATION, vehicle: self.us, list: List::Mission };
                    self.stations.push(Station(Upload::new(talk, items, Pace::default())));
                }
            }
        }
    }

    /// Begins the autopilot's process anew: see [`Trouble::Restart`].
    pub fn restart(&mut self) {
        self.down = Some(self.now + RESTART);
        self.streams.clear();
        self.guided.forget();
        self.storage.restart();
        self.stations.clear();
        self.out.clear();
    }

    /// Stations hear what the autopilot says, and speak to it.
    pub(super) fn talk_to_stations(&mut self) {
        let mut stations = std::mem::take(&mut self.stations);
        let mut heard = 0;
        for _ in 0..64 {
            let said: Vec<Sent> = self.out.iter().skip(heard).cloned().collect();
            heard = self.out.len();
            let mut out = Vec::new();
            for Station(upload) in &mut stations {
                for Sent { from, message } in &said {
                    upload.handle(self.now, &frame(*from, message.clone()), &mut out);
                }
                upload.poll(self.now, &mut out);
            }
            if out.is_empty() {
                break;
            }
            out.into_iter().for_each(|message| self.hear(&frame(STATION, message)));
        }
        stations.retain(|Station(upload)| upload.result().is_none());
        self.stations = stations;
    }
}

/// An item of another station's mission: over home, at a height above it, m.
#[must_use]
pub fn stay(home: &Home, height: f64) -> Item {
    Item {
        command: MavCmd::MAV_CMD_NAV_WAYPOINT,
        frame: MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT,
        params: [0.0; 4],
        x: wire_degrees(home.latitude_deg),
        y: wire_degrees(home.longitude_deg),
        z: height as f32,
        autocontinue: true,
    }
}

const fn frame(from: Identity, message: MavMessage) -> Frame {
    Frame { from, sequence: 0, message, bytes: Vec::new() }
}
