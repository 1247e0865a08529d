//! What goes wrong on purpose, at times that are known beforehand.
//!
//! Faults of the wire (loss, delay, jitter, duplicates, reordering, corruption) are those of
//! [`quietpath_bridge::link::memory`]; they are put between the machine and its link by who joins the two.

use std::time::Duration;

use quietpath_bridge::clock::Time;
use quietpath_bridge::flight::{End, Flight, Input, Output};
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
    /// It says that it is elsewhere, as after a jump of its satellite navigation, and flies on as before.
    Leap {
        /// When it begins.
        from: Time,
        /// When it ends.
        until: Time,
        /// How far to the east and to the north, m.
        by: [f64; 2],
    },
    /// What it says about where it is are no numbers, or no places.
    Nonsense {
        /// When it begins.
        from: Time,
        /// When it ends.
        until: Time,
    },
    /// Every other system id speaks on the same link: autopilots, ground stations, companions.
    Crowd {
        /// When they begin.
        from: Time,
    },
}

impl Trouble {
    /// Whether it goes on at a time.
    fn is_on(&self, now: Time) -> bool {
        match self {
            Self::Silence { from, until } | Self::Leap { from, until, .. } | Self::Nonsense { from, until } => {
                (*from..*until).contains(&now)
            }
            Self::Crowd { from } => *from <= now,
            Self::Restart { .. } | Self::Station { .. } => false,
        }
    }

    /// Whether it has come, and need not be remembered.
    fn is_past(&self, now: Time) -> bool {
        match self {
            Self::Restart { at } | Self::Station { at, .. } => *at <= now,
            Self::Silence { until, .. } | Self::Leap { until, .. } | Self::Nonsense { until, .. } => *until <= now,
            Self::Crowd { .. } => false,
        }
    }
}

/// A ground station that uploads something.
pub(super) struct Station(Upload);

impl Machine {
    /// Whether nothing comes in or goes out.
    pub(super) fn is_deaf(&self) -> bool {
        let is_silent = |trouble: &Trouble| matches!(trouble, Trouble::Silence { .. }) && trouble.is_on(self.now);
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
        let troubles = std::mem::take(&mut self.settings.troubles);
        let (due, later) = troubles.into_iter().partition::<Vec<_>, _>(|trouble| trouble.is_past(now));
        self.settings.troubles = later;
        for trouble in due {
            match trouble {
                Trouble::Restart { .. } => self.restart(),
                Trouble::Silence { .. } | Trouble::Leap { .. } | Trouble::Nonsense { .. } | Trouble::Crowd { .. } => {
                }
                Trouble::Station { items, .. } => {
                    let talk = Talk { us: STATION, vehicle: self.us, list: List::Mission };
                    self.stations.push(Station(Upload::new(talk, items, Pace::default())));
                }
            }
        }
    }

    /// Brings trouble to a vehicle that flies.
    pub fn befall(&mut self, trouble: Trouble) {
        self.settings.troubles.push(trouble);
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

/// A second bridge on the same vehicle, which the autopilot hears on another port. Heartbeats are for everybody: autopilots
/// pass them on.
pub(super) struct Rival {
    flight: Flight,
    end: Option<End>,
}

impl Machine {
    /// A second bridge begins a flight on this vehicle.
    pub fn join(&mut self, flight: Flight) {
        self.rivals.push(Rival { flight, end: None });
    }

    /// How the flights of other bridges stand: the phase, and how they ended.
    pub fn rivals(&self) -> impl Iterator<Item = (&'static str, Option<&End>)> {
        self.rivals.iter().map(|rival| (rival.flight.phase(), rival.end.as_ref()))
    }

    /// Other bridges hear what the autopilot says, and speak to it.
    pub(super) fn talk_to_rivals(&mut self) {
        let mut rivals = std::mem::take(&mut self.rivals);
        for Rival { flight, end } in &mut rivals {
            let mut inputs: Vec<Input> = self.out.iter().map(|sent| overheard(sent.from, &sent.message)).collect();
            inputs.extend(self.passed_on.drain(..).map(|(from, message)| overheard(from, &message)));
            inputs.push(Input::Tick);
            let outputs: Vec<Output> = inputs.into_iter().flat_map(|input| flight.step(self.now, input)).collect();
            for output in outputs {
                match output {
                    Output::Send(message) => {
                        let from = Identity { system: self.us.system, ..Identity::COMPANION };
                        if matches!(*message, MavMessage::HEARTBEAT(_)) {
                            self.out.push(Sent { from, message: (*message).clone() });
                        }
                        self.hear(&frame(from, *message));
                    }
                    Output::End(ended) => *end = Some(ended),
                    _ => {}
                }
            }
        }
        self.rivals = rivals;
    }

    /// What is wrong with what is said.
    pub(super) fn distort(&mut self, sent: &mut Vec<Sent>) {
        let now = self.now;
        for trouble in self.settings.troubles.iter().filter(|trouble| trouble.is_on(now)) {
            match trouble {
                Trouble::Leap { by, .. } => sent.iter_mut().for_each(|sent| leap(&mut sent.message, *by)),
                Trouble::Nonsense { .. } => sent.iter_mut().for_each(|sent| garble(&mut sent.message)),
                Trouble::Crowd { .. } if self.heartbeat == Some(now) => sent.extend(crowd(self.us.system)),
                _ => {}
            }
        }
    }
}

fn overheard(from: Identity, message: &MavMessage) -> Input {
    Input::Frame(Box::new(frame(from, message.clone())))
}

/// Metres of a ten-millionth of a degree of latitude.
const METERS_PER_UNIT: f64 = 0.011_132;

fn leap(message: &mut MavMessage, [east, north]: [f64; 2]) {
    let MavMessage::GLOBAL_POSITION_INT(data) = message else { return };
    let latitude = (f64::from(data.lat) * 1e-7).to_radians();
    data.lat += (north / METERS_PER_UNIT) as i32;
    data.lon += (east / (METERS_PER_UNIT * latitude.cos())) as i32;
}

fn garble(message: &mut MavMessage) {
    match message {
        MavMessage::GLOBAL_POSITION_INT(data) => {
            let (lat, lon) = [(i32::MAX, i32::MIN), (0, 0)][data.time_boot_ms as usize / 100 % 2];
            (data.lat, data.lon, data.alt, data.relative_alt) = (lat, lon, i32::MIN, i32::MAX);
            (data.vx, data.vy, data.vz) = (i16::MIN, i16::MAX, i16::MIN);
        }
        MavMessage::LOCAL_POSITION_NED(data) => (data.x, data.y, data.z) = (f32::NAN, f32::INFINITY, f32::NAN),
        MavMessage::ATTITUDE(data) => (data.roll, data.pitch, data.yaw) = (f32::NAN, f32::NAN, f32::NEG_INFINITY),
        // A sensor that is followed, seen nowhere.
        MavMessage::EXTENDED_SYS_STATE(_) => {
            let (vel, position_cov) = ([f32::NAN; 3], [f32::NAN; 3]);
            *message = MavMessage::FOLLOW_TARGET(FOLLOW_TARGET_DATA {
                lat: i32::MAX,
                lon: i32::MIN,
                alt: f32::NAN,
                vel,
                position_cov,
                est_capabilities: u8::MAX,
                ..Default::default()
            });
        }
        _ => {}
    }
}

/// What all others say in a second: where one is the others are not.
fn crowd(ours: u8) -> impl Iterator<Item = Sent> {
    let systems = (1..=u8::MAX).filter(move |system| *system != ours);
    systems.flat_map(|system| {
        let (mavtype, autopilot, component) = match system % 3 {
            0 => (MavType::MAV_TYPE_QUADROTOR, MavAutopilot::MAV_AUTOPILOT_PX4, 1),
            1 => (MavType::MAV_TYPE_QUADROTOR, MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA, 1),
            _ => (MavType::MAV_TYPE_GCS, MavAutopilot::MAV_AUTOPILOT_INVALID, 190),
        };
        let from = Identity { system, component };
        let heartbeat = HEARTBEAT_DATA { mavtype, autopilot, mavlink_version: 3, ..Default::default() };
        let lat = i32::from(system) * 1_000_000;
        let position = GLOBAL_POSITION_INT_DATA { lat, lon: -lat, ..Default::default() };
        [MavMessage::HEARTBEAT(heartbeat), MavMessage::GLOBAL_POSITION_INT(position)]
            .map(|message| Sent { from, message })
    })
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
