//! How to fly: what the configuration file and the command line decide.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::payload::{Kind, Payload, Radiation};
use crate::telemetry::{Autopilot, Choice};

/// Who steers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum FlyMode {
    /// The autopilot, along an uploaded mission.
    #[default]
    Mission,
    /// The bridge, by setpoints.
    Guided,
}

/// Which autopilot is expected.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum AutopilotChoice {
    /// Whichever answers.
    #[default]
    Auto,
    /// PX4.
    Px4,
    /// ArduPilot.
    Ardupilot,
}

impl AutopilotChoice {
    /// As the telemetry takes it.
    #[must_use]
    pub const fn choice(self) -> Choice {
        match self {
            Self::Auto => Choice::Auto,
            Self::Px4 => Choice::Only(Autopilot::Px4),
            Self::Ardupilot => Choice::Only(Autopilot::ArduPilot),
        }
    }
}

/// What to do when there is no plan to fly any more.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum OnFailure {
    /// Stay in place.
    #[default]
    Hold,
    /// Fly home.
    Return,
    /// Leave the autopilot its mission; a vehicle that is steered holds.
    Continue,
}

/// How to plan anew in flight.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Replanning {
    /// Time between two plans, s.
    pub interval_s: f64,
    /// How far ahead a plan takes over, s: longer than planning takes.
    pub lead_s: f64,
    /// How far ahead a plan takes over that an observation asks for at once, s: longer than planning takes. Observations
    /// wait for the next interval where not given, and always in mission mode.
    pub prompt_lead_s: Option<f64>,
    /// How long planning may take, s.
    pub deadline_s: f64,
    /// How long a plan is flown at most, s, counted from when it was made.
    pub time_to_live_s: f64,
    /// Standard deviation above which an observation is not used, length units.
    pub sigma_max: f64,
}

impl Default for Replanning {
    fn default() -> Self {
        Self {
            interval_s: 10.0,
            lead_s: 3.0,
            prompt_lead_s: None,
            deadline_s: 2.0,
            time_to_live_s: 30.0,
            sigma_max: f64::MAX,
        }
    }
}

/// An output of the autopilot that a payload hangs on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MissionOutput {
    /// Number of the servo (ArduPilot) or actuator (PX4, 1 to 4).
    pub output: u8,
    /// Value at level 0: microseconds (ArduPilot), -1 to 1 (PX4).
    pub off: f64,
    /// Value at level 1.
    pub full: f64,
}

/// A payload, as the configuration names it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PayloadEntry {
    /// `transmitter` or `jammer`.
    pub kind: PayloadKind,
    /// Component id on the vehicle.
    pub component: u8,
    /// Number on that component.
    #[serde(default)]
    pub instance: u8,
    /// Switch this output by items of the mission too: see `docs/bridge.md` for what that cannot do.
    #[serde(default)]
    pub mission_output: Option<MissionOutput>,
}

/// What a payload does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum PayloadKind {
    /// A transmitter whose power can be turned down.
    Transmitter,
    /// A jammer.
    Jammer,
}

/// How to fly.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// Who steers.
    pub mode: FlyMode,
    /// Which autopilot is expected.
    pub autopilot: AutopilotChoice,
    /// System id of the vehicle; any where not given.
    pub system: Option<u8>,
    /// The agent of the scenario that this vehicle is; the first where not given.
    pub agent: Option<String>,
    /// What to do when there is no plan to fly any more.
    pub on_failure: OnFailure,
    /// Planning anew in flight; off where not given.
    pub replan: Option<Replanning>,
    /// Whether the regions of the scenario become the autopilot's fence.
    pub fence: bool,
    /// Whether the start becomes a rally point.
    pub rally: bool,
    /// Setpoints a second.
    pub setpoint_hz: f64,
    /// How near the start and the goal are reached, m.
    pub arrival_m: f64,
    /// Payloads.
    pub payload: Vec<PayloadEntry>,
    /// Whether jamming was armed on the command line. Not a key of the configuration file.
    pub jammer_armed: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            mode: FlyMode::default(),
            autopilot: AutopilotChoice::default(),
            system: None,
            agent: None,
            on_failure: OnFailure::default(),
            replan: None,
            fence: true,
            rally: false,
            setpoint_hz: 20.0,
            arrival_m: 3.0,
            payload: Vec::new(),
            jammer_armed: false,
        }
    }
}

impl Settings {
    /// Time between two setpoints.
    #[must_use]
    pub fn setpoint_interval(&self) -> Duration {
        Duration::from_secs_f64(1.0 / self.setpoint_hz.clamp(2.0, 50.0))
    }

    /// The payloads.
    #[must_use]
    pub fn payloads(&self) -> Vec<Payload> {
        let payload = |entry: &PayloadEntry| {
            let kind = match entry.kind {
                PayloadKind::Transmitter => Kind::Transmitter,
                PayloadKind::Jammer => Kind::Jammer,
            };
            Payload { kind, component: entry.component, instance: entry.instance }
        };
        self.payload.iter().map(payload).collect()
    }

    /// Whether anything may be jammed: the command line and the scenario must both say so.
    #[must_use]
    pub const fn radiation(&self, scenario_says_so: bool) -> Radiation {
        if self.jammer_armed && scenario_says_so { Radiation::Armed } else { Radiation::Off }
    }
}
