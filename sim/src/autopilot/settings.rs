//! What to simulate: which autopilot, where it stands, what it is capable of, and who flies it.
//!
//! Limits: one vehicle stands for one agent; a vehicle for an agent needs a scenario that lies on the Earth.

use quietpath_bridge::file::ScenarioFile;
use quietpath_bridge::file::scenario::AgentEntry;
use quietpath_bridge::frame::{Altitude, LocalFrame, Place};
use quietpath_bridge::link::dialect::MavCmd;
use quietpath_bridge::telemetry::Autopilot;

use super::body::Limits;
use super::payload::Spec;
use super::trouble::Trouble;

/// Speed of a vehicle over that of its plans.
const SPEED_RESERVE: f64 = 1.05;
/// Acceleration of a vehicle over that of its plans.
const ACCEL_RESERVE: f64 = 2.0;
/// Least acceleration of a vehicle, m/s^2.
const ACCEL_MIN: f64 = 1.0;

/// Where the vehicle stands when it is switched on, and what it counts altitudes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Home {
    /// Latitude, WGS-84 degrees.
    pub latitude_deg: f64,
    /// Longitude, WGS-84 degrees.
    pub longitude_deg: f64,
    /// Altitude above mean sea level, m.
    pub altitude_m: f64,
}

/// The person with the remote control.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Pilot {
    /// Nobody: the vehicle stands on the ground until MAVLink, or a caller, moves it.
    #[default]
    Nobody,
    /// Arms, takes off to a height above home, m, and leaves the vehicle there.
    TakesOff(f64),
    /// Waits for a mission, arms and starts it.
    StartsMission,
}

/// What to simulate.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Which autopilot it is like.
    pub like: Autopilot,
    /// Its system id.
    pub system: u8,
    /// Where it stands.
    pub home: Home,
    /// What it is capable of.
    pub limits: Limits,
    /// What is on board.
    pub payloads: Vec<Spec>,
    /// Who flies it.
    pub pilot: Pilot,
    /// What goes wrong.
    pub troubles: Vec<Trouble>,
    /// Commands that it takes in COMMAND_INT only, on top of its kind's.
    pub int_only: Vec<MavCmd>,
    /// Commands that it takes in COMMAND_LONG only, on top of its kind's.
    pub long_only: Vec<MavCmd>,
}

impl Settings {
    /// A vehicle for an agent of a scenario: it stands on the ground below the agent's start, and its speed and acceleration
    /// leave a little for catching up. `None` where the scenario says neither where it lies nor of such an agent.
    #[must_use]
    pub fn for_agent(like: Autopilot, scenario: &ScenarioFile, agent: Option<&str>) -> Option<Self> {
        let is_it = |entry: &&AgentEntry| agent.is_none_or(|name| entry.name == name);
        let entry = scenario.agents.iter().find(is_it)?;
        let start = LocalFrame::of(scenario)?.place(&entry.start);
        let altitude_m = if scenario.dimension == 3 { scenario.frame.origin?.altitude_m } else { 0.0 };
        let Place { latitude_deg, longitude_deg, .. } = start;
        let unit = scenario.frame.unit_m;
        let limits = Limits {
            speed_max: SPEED_RESERVE * entry.speed_max * unit,
            accel_max: (ACCEL_RESERVE * entry.accel_max * unit).max(ACCEL_MIN),
            ..Limits::default()
        };
        Some(Self { limits, ..Self::new(like, Home { latitude_deg, longitude_deg, altitude_m }) })
    }

    /// The height above home of an agent's start, m: where a pilot takes off to.
    #[must_use]
    pub fn start_height(&self, scenario: &ScenarioFile, agent: Option<&str>) -> Option<f64> {
        let entry = scenario.agents.iter().find(|entry| agent.is_none_or(|name| entry.name == name))?;
        Some(match LocalFrame::of(scenario)?.place(&entry.start).altitude {
            Altitude::AboveHome(meters) => meters,
            Altitude::AboveSeaLevel(meters) => meters - self.home.altitude_m,
        })
    }

    /// A vehicle like one of a kind, at home, without payloads, pilot or trouble.
    #[must_use]
    pub fn new(like: Autopilot, home: Home) -> Self {
        let (payloads, troubles, int_only, long_only) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let (limits, pilot) = (Limits::default(), Pilot::Nobody);
        Self { like, system: 1, home, limits, payloads, pilot, troubles, int_only, long_only }
    }
}
