//! The configuration file, and what the command line overrides.
//!
//! ```toml
//! link = "serial:/dev/ttyACM0:921600"
//! scenario = "/etc/quietpath/scenario.toml"
//! plan = "/etc/quietpath/plan.json"
//! signing_key = "/etc/quietpath/signing.key"
//! record = "/var/lib/quietpath/flight.jsonl"
//! state = "/var/lib/quietpath/flight.state"
//! observations = "udp:127.0.0.1:14600"
//!
//! [flight]
//! mode = "guided"
//! on_failure = "return"
//!
//! [flight.replan]
//! interval_s = 10.0
//!
//! [[flight.payload]]
//! kind = "transmitter"
//! component = 25
//! ```
//!
//! Keys of `[flight]` are the fields of `quietpath_bridge::flight::Settings`.

use std::path::{Path, PathBuf};

use quietpath_bridge::clock::SystemClock;
use quietpath_bridge::file::{PlanFile, ScenarioFile, read_limited};
use quietpath_bridge::flight::settings::AutopilotChoice;
use quietpath_bridge::flight::{FlyMode, Settings};
use quietpath_bridge::link::signing::Key;
use quietpath_bridge::link::{Accept, Address, Endpoint, Identity, Link, Signing};
use serde::Deserialize;

use crate::Outcome;
use crate::cli::{AutopilotArg, LinkArgs, ModeArg, PlanFiles, RunArgs};
use crate::observe::Observations;

/// The number of our stream of signatures.
const SIGNING_LINK: u8 = 0;

/// A configuration.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    pub link: Option<String>,
    pub scenario: Option<PathBuf>,
    pub plan: Option<PathBuf>,
    pub signing_key: Option<PathBuf>,
    pub record: Option<PathBuf>,
    pub state: Option<PathBuf>,
    pub observations: Option<String>,
    pub observations_key: Option<PathBuf>,
    pub flight: Settings,
}

impl Config {
    /// The file, where one is given, with the link's arguments over it.
    pub fn read(args: &LinkArgs) -> Result<Self, Outcome> {
        let mut config = match &args.config {
            None => Self::default(),
            Some(path) => Self::file(path)?,
        };
        config.link = args.link.clone().or(config.link);
        config.signing_key = args.signing_key.clone().or(config.signing_key);
        config.flight.system = args.system.or(config.flight.system);
        if let Some(autopilot) = args.autopilot {
            config.flight.autopilot = match autopilot {
                AutopilotArg::Auto => AutopilotChoice::Auto,
                AutopilotArg::Px4 => AutopilotChoice::Px4,
                AutopilotArg::Ardupilot => AutopilotChoice::Ardupilot,
            };
        }
        Ok(config)
    }

    fn file(path: &Path) -> Result<Self, Outcome> {
        let name = path.display();
        let help = "give the path of a configuration file, or leave --config out";
        let unreadable = |why: String| Outcome::Input(format!("{name}: cannot be read: {why}\n  help: {help}"));
        let bytes = read_limited(path).map_err(|error| unreadable(error.to_string()))?;
        let text = String::from_utf8(bytes).map_err(|_| unreadable("it is not text in UTF-8".into()))?;
        let config: Self = toml::from_str(&text).map_err(|error| Outcome::Input(format!("{name}: {error}")))?;
        if config.flight.jammer_armed {
            let help = "jamming is armed for one flight at a time, by --arm-jammer on the command line";
            return Err(Outcome::Input(format!("{name}: flight.jammer_armed is no key of the file\n  help: {help}")));
        }
        Ok(config)
    }

    /// The arguments of a plan over it.
    pub fn with_files(mut self, files: &PlanFiles) -> Self {
        self.scenario = files.scenario.clone().or(self.scenario);
        self.plan = files.plan.clone().or(self.plan);
        self.flight.agent = files.agent.clone().or(self.flight.agent);
        self
    }

    /// The arguments of a flight over it.
    pub fn with_run(mut self, args: &RunArgs) -> Self {
        self.record = args.record.clone().or(self.record);
        self.state = args.state.clone().or(self.state);
        self.observations = args.observations.clone().or(self.observations);
        self.observations_key = args.observations_key.clone().or(self.observations_key);
        if let Some(mode) = args.mode {
            self.flight.mode = match mode {
                ModeArg::Mission => FlyMode::Mission,
                ModeArg::Guided => FlyMode::Guided,
            };
        }
        self.flight.jammer_armed = args.arm_jammer;
        self
    }

    /// Scenario and plan.
    pub fn load(&self) -> Result<(ScenarioFile, PlanFile), Outcome> {
        let input = |error: Box<quietpath_bridge::file::FileError>| Outcome::Input(error.to_string());
        let missing = |what: &str| {
            Outcome::Input(format!(
                "no {what} is given\n  help: --{what} FILE, or `{what} = \"FILE\"` in the configuration file"
            ))
        };
        let scenario = self.scenario.as_ref().ok_or_else(|| missing("scenario"))?;
        let plan = self.plan.as_ref().ok_or_else(|| missing("plan"))?;
        let loaded = ScenarioFile::read(&scenario.display().to_string()).map_err(input)?;
        for warning in &loaded.warnings {
            tracing::warn!("{warning}");
        }
        let plan = PlanFile::read(&plan.display().to_string()).map_err(input)?;
        Ok((loaded.scenario, plan))
    }

    /// Opens the source of observations.
    pub fn observed(&self) -> Result<Observations, Outcome> {
        let key = self.observations_key.as_ref().map(|path| Key::read(path)).transpose();
        let key = key.map_err(|error| Outcome::Input(error.to_string()))?;
        Observations::open(self.observations.as_deref(), key).map_err(Outcome::Input)
    }

    /// Opens the link.
    pub fn open(&self, clock: SystemClock) -> Result<Link, Outcome> {
        let help = "help: --link serial:/dev/ttyACM0:921600, or `link = \"..\"` in the configuration file";
        let url = self.link.as_ref().ok_or_else(|| Outcome::Input(format!("no link is given\n  {help}")))?;
        let address: Address = url.parse().map_err(|error| Outcome::Input(format!("--link: {error}")))?;
        let mut endpoint = Endpoint::new(Identity::COMPANION, Accept::Autopilot(self.flight.system));
        if let Some(path) = &self.signing_key {
            let signing = Signing::from_key_file(path, SIGNING_LINK, clock.now());
            endpoint = endpoint.with_signing(signing.map_err(|error| Outcome::Input(error.to_string()))?);
        }
        tracing::info!(%address, signed = self.signing_key.is_some(), "opening the link");
        Link::open(address, endpoint, clock)
            .map_err(|error| Outcome::Fault(format!("no thread for the link: {error}")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_example_is_what_happens_without_it_but_for_what_it_turns_on() {
        let example: Config =
            toml::from_str(include_str!("../../../install/bridge.toml")).expect("the example reads");
        let replan = example.flight.replan;
        assert_eq!(replan, Some(quietpath_bridge::flight::settings::Replanning::default()));
        let plain = Settings { replan, payload: example.flight.payload.clone(), ..Settings::default() };
        assert_eq!(example.flight, plain);
        assert_eq!(example.flight.payload.len(), 1);
    }
}
