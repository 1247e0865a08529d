//! Where sensors were seen, as any tracker can write it: one JSON object a line, in a file that grows or in datagrams.
//!
//! ```json
//! {"id": "s3", "time": 41.5, "position": [3.2, 4.1], "covariance": [[0.01, 0.0], [0.0, 0.01]]}
//! {"id": "s9", "latitude_deg": 47.41, "longitude_deg": 8.55, "detection": {"model": "proxy", "scale": 1.0, "epsilon": 0.1, "path_loss": 2.0}}
//! ```
//!
//! | key | unit | when left out |
//! |---|---|---|
//! | `id` | | must be given: the sensor's name in the scenario, or a new one |
//! | `position` | length units of the scenario | or |
//! | `latitude_deg`, `longitude_deg`, `altitude_m` | degrees, m above sea level | one of the two must be given |
//! | `velocity` | length units / s | the sensor stays |
//! | `covariance` | length units^2 | exact |
//! | `time` | s of the scenario | when it arrives |
//! | `ranging`, `detection` | the tables of a scenario's sensor | as before |
//!
//! A new sensor needs `ranging` or `detection`. An observation whose standard deviation along its worst axis is larger
//! than the configured `sigma_max` is not used: the model knows sensors at places, not clouds. Unknown keys are refused.
//!
//! In MAVLink the same is FOLLOW_TARGET (144) from any component of the vehicle: `custom_state` is the sensor's number in
//! the scenario, counted from 1, `lat`, `lon`, `alt`, `vel` and `position_cov` (diagonal, m^2) as the message defines them.

use quietpath_core::scenario::{Detection, Pooling, Ranging, Susceptibility};
use serde::{Deserialize, Serialize};

use crate::capacity::SENSORS;
use crate::file::ScenarioFile;
use crate::file::scenario::{KnotEntry, MotionEntry, SensorEntry};
use crate::frame::{Altitude, LocalFrame, Place};
use crate::link::dialect::FOLLOW_TARGET_DATA;

/// How long a sensor that was seen moving is taken to go on, s.
const AHEAD: f64 = 3600.0;

/// How well a sensor measures distances, as in a scenario.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "model", rename_all = "lowercase", deny_unknown_fields)]
pub enum RangingSeen {
    /// By signal strength.
    Rss {
        /// Scale of the variance.
        scale: f64,
        /// Path-loss exponent.
        path_loss: f64,
    },
    /// By time of arrival.
    Toa {
        /// First constant.
        c1: f64,
        /// Second constant.
        c2: f64,
        /// Path-loss exponent.
        path_loss: f64,
    },
}

/// How well a sensor detects, as in a scenario.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "model", rename_all = "lowercase", deny_unknown_fields)]
pub enum DetectionSeen {
    /// The proxy.
    Proxy {
        /// Scale.
        scale: f64,
        /// Offset.
        epsilon: f64,
        /// Path-loss exponent.
        path_loss: f64,
    },
    /// The energy detector.
    Energy {
        /// Number of samples.
        samples: u32,
        /// Signal variance at distance 1.
        signal: f64,
        /// Noise variance.
        noise: f64,
        /// Logarithm of the threshold.
        log_threshold: f64,
        /// Path-loss exponent.
        path_loss: f64,
    },
}

/// One observation. See the [module](self).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Observation {
    /// The sensor's name.
    pub id: String,
    /// Time, s of the scenario.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time: Option<f64>,
    /// Position, length units.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub position: Option<Vec<f64>>,
    /// Latitude, degrees.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub latitude_deg: Option<f64>,
    /// Longitude, degrees.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub longitude_deg: Option<f64>,
    /// Altitude above sea level, m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub altitude_m: Option<f64>,
    /// Velocity, length units / s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub velocity: Option<Vec<f64>>,
    /// Covariance of the position, length units^2.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub covariance: Option<Vec<Vec<f64>>>,
    /// How well it measures distances.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ranging: Option<RangingSeen>,
    /// How well it detects.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub detection: Option<DetectionSeen>,
}

impl Observation {
    /// Reads a line.
    ///
    /// # Errors
    /// What is wrong with it, and what would be right.
    pub fn parse(line: &str) -> Result<Self, String> {
        let help = "write {\"id\": \"s1\", \"position\": [3.2, 4.1]}, or latitude_deg and longitude_deg";
        serde_json::from_str(line).map_err(|error| format!("is no observation: {error}; {help}"))
    }

    /// What FOLLOW_TARGET says; `None` where it names no sensor of the scenario.
    #[must_use]
    pub fn from_mavlink(data: &FOLLOW_TARGET_DATA, scenario: &ScenarioFile) -> Option<Self> {
        let number = usize::try_from(data.custom_state).ok()?.checked_sub(1)?;
        let sensor = scenario.sensors.get(number)?;
        let unit = scenario.frame.unit_m;
        let [north, east, down] = data.vel.map(|part| f64::from(part) / unit);
        let variance = |part: f32| f64::from(part) / (unit * unit);
        let [a, b, c] = data.position_cov.map(variance);
        let covariance = vec![vec![a, 0.0, 0.0], vec![0.0, b, 0.0], vec![0.0, 0.0, c]];
        Some(Self {
            id: sensor.name.clone(),
            time: None,
            position: None,
            latitude_deg: Some(f64::from(data.lat) * 1e-7),
            longitude_deg: Some(f64::from(data.lon) * 1e-7),
            altitude_m: Some(f64::from(data.alt)),
            velocity: Some(vec![east, north, -down]),
            covariance: Some(covariance),
            ranging: None,
            detection: None,
        })
    }

    /// Puts what was seen at scenario time `now`, s, into a scenario.
    ///
    /// # Errors
    /// What is wrong with the observation; the scenario is as before.
    pub fn apply(&self, scenario: &mut ScenarioFile, now: f64, sigma_max: f64) -> Result<(), String> {
        let dimension = scenario.dimension;
        let position = self.place_in(scenario)?;
        if let Some(sigma) = self.sigma()?.filter(|sigma| *sigma > sigma_max) {
            return Err(format!("`{}` is uncertain by {sigma:.3}, more than {sigma_max}: not used", self.id));
        }
        let time = self.time.unwrap_or(now);
        let velocity: Vec<f64> =
            self.velocity.iter().flatten().copied().chain(std::iter::repeat(0.0)).take(dimension).collect();
        if !velocity.iter().chain([&time]).all(|number| number.is_finite()) {
            return Err(format!("`{}` has a time or velocity that is not finite", self.id));
        }
        let motion = if velocity.iter().all(|part| *part == 0.0) {
            MotionEntry::Fixed(position)
        } else {
            let later = position.iter().zip(&velocity).map(|(at, speed)| at + speed * AHEAD).collect();
            let knot = |time, position| KnotEntry { time, position };
            MotionEntry::Track(vec![knot(time, position), knot(time + AHEAD, later)])
        };
        let (ranging, detection) = (self.ranging.map(Ranging::from), self.detection.map(Detection::from));
        let known = scenario.sensors.iter().position(|sensor| sensor.name == self.id);
        let seen = match known.and_then(|index| scenario.sensors.get(index)) {
            Some(sensor) => SensorEntry {
                motion,
                ranging: ranging.or(sensor.ranging),
                detection: detection.or(sensor.detection),
                ..sensor.clone()
            },
            None => self.new_sensor(scenario, motion, ranging, detection)?,
        };
        // What the core would refuse would make every later plan fail, and not this observation alone.
        seen.check(dimension).map_err(|why| format!("`{}` makes no sensor: {why}", self.id))?;
        pools(scenario, &seen).map_err(|why| format!("`{}` makes no sensor: {why}", self.id))?;
        match known.and_then(|index| scenario.sensors.get_mut(index)) {
            Some(sensor) => *sensor = seen,
            None => scenario.sensors.push(seen),
        }
        Ok(())
    }

    /// A sensor that the scenario does not have.
    fn new_sensor(
        &self,
        scenario: &ScenarioFile,
        motion: MotionEntry,
        ranging: Option<Ranging<f64>>,
        detection: Option<Detection<f64>>,
    ) -> Result<SensorEntry, String> {
        if ranging.is_none() && detection.is_none() {
            return Err(format!(
                "`{}` is no sensor of the scenario, and says nothing of `ranging` or `detection`",
                self.id
            ));
        }
        if scenario.sensors.len() >= SENSORS {
            return Err(format!("`{}` is one sensor too many: this build holds {SENSORS}", self.id));
        }
        let (error_gain, detect_gain, error_exponent, detect_exponent) = (0.0, 0.0, 2.0, 2.0);
        let jam = Susceptibility { error_gain, error_exponent, detect_gain, detect_exponent };
        Ok(SensorEntry { name: self.id.clone(), motion, ranging, detection, jam })
    }

    fn place_in(&self, scenario: &ScenarioFile) -> Result<Vec<f64>, String> {
        let dimension = scenario.dimension;
        let wrong = |what: &str| format!("`{}` {what}", self.id);
        let position = match (&self.position, self.latitude_deg, self.longitude_deg) {
            (Some(position), None, None) => position.clone(),
            (None, Some(latitude_deg), Some(longitude_deg)) => {
                let frame = LocalFrame::of(scenario)
                    .ok_or_else(|| wrong("has a latitude, and the scenario does not say where it lies"))?;
                let altitude = Altitude::AboveSeaLevel(self.altitude_m.unwrap_or_default());
                let place = Place { latitude_deg, longitude_deg, altitude };
                frame.position(&place).ok_or_else(|| wrong("has no place in the scenario"))?
            }
            _ => return Err(wrong("needs either `position` or `latitude_deg` and `longitude_deg`")),
        };
        if position.len() != dimension || !position.iter().all(|part| part.is_finite()) {
            return Err(wrong(&format!("needs a position of {dimension} finite numbers")));
        }
        Ok(position)
    }

    /// Standard deviation along the worst axis, bounded from above by the trace, length units.
    fn sigma(&self) -> Result<Option<f64>, String> {
        let Some(covariance) = &self.covariance else { return Ok(None) };
        let trace: Option<f64> = covariance.iter().enumerate().map(|(axis, row)| row.get(axis).copied()).sum();
        match trace {
            Some(trace) if trace.is_finite() && trace >= 0.0 => Ok(Some(trace.sqrt())),
            _ => Err(format!("`{}` has a covariance that is none", self.id)),
        }
    }
}

/// Refuses an energy detector that cannot be pooled with those that the scenario has.
fn pools(scenario: &ScenarioFile, seen: &SensorEntry) -> Result<(), String> {
    let samples = |sensor: &SensorEntry| match sensor.detection {
        Some(Detection::Energy { samples, .. }) => Some(samples),
        _ => None,
    };
    let others = scenario.sensors.iter().filter(|sensor| sensor.name != seen.name).find_map(samples);
    match (samples(seen), others) {
        (Some(samples), Some(others)) if samples != others && scenario.pooling != Pooling::None => {
            Err(format!("it takes {samples} samples, and those that it is pooled with {others}"))
        }
        _ => Ok(()),
    }
}

impl From<RangingSeen> for Ranging<f64> {
    fn from(seen: RangingSeen) -> Self {
        match seen {
            RangingSeen::Rss { scale, path_loss } => Self::Rss { scale, path_loss },
            RangingSeen::Toa { c1, c2, path_loss } => Self::Toa { c1, c2, path_loss },
        }
    }
}

impl From<DetectionSeen> for Detection<f64> {
    fn from(seen: DetectionSeen) -> Self {
        match seen {
            DetectionSeen::Proxy { scale, epsilon, path_loss } => Self::Proxy { scale, epsilon, path_loss },
            DetectionSeen::Energy { samples, signal, noise, log_threshold, path_loss } => {
                Self::Energy { samples, signal, noise, log_threshold, path_loss }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scenario() -> ScenarioFile {
        let text = include_str!("../../../sim/scenarios/square8-detection.toml");
        ScenarioFile::parse("s.toml", text).expect("scenario").scenario
    }

    fn apply(line: &str) -> Result<ScenarioFile, String> {
        let mut scenario = scenario();
        Observation::parse(line)?.apply(&mut scenario, 5.0, 0.5)?;
        Ok(scenario)
    }

    #[test]
    fn a_known_sensor_moves_and_a_new_one_needs_a_model() {
        let name = scenario().sensors[2].name.clone();
        let seen = apply(&format!("{{\"id\": \"{name}\", \"position\": [1.5, 2.5]}}")).expect("applied");
        assert_eq!(seen.sensors[2].motion, MotionEntry::Fixed(vec![1.5, 2.5]));
        assert_eq!(seen.sensors[2].detection, scenario().sensors[2].detection);
        let moving = apply(&format!("{{\"id\": \"{name}\", \"position\": [1.0, 2.0], \"velocity\": [0.01, 0]}}"));
        let MotionEntry::Track(track) = &moving.expect("applied").sensors[2].motion else { panic!("a track") };
        assert_eq!((track[0].time, track[1].position.clone()), (5.0, vec![37.0, 2.0]));
        let model = "\"detection\": {\"model\": \"proxy\", \"scale\": 1, \"epsilon\": 0.1, \"path_loss\": 2}";
        let new = apply(&format!("{{\"id\": \"late\", \"position\": [1, 2], {model}}}")).expect("applied");
        assert_eq!(new.sensors.len(), scenario().sensors.len() + 1);
    }

    #[test]
    fn a_flood_of_new_sensors_ends_at_the_capacity() {
        let mut world = scenario();
        let model = "\"detection\": {\"model\": \"proxy\", \"scale\": 1, \"epsilon\": 0.1, \"path_loss\": 2}";
        let mut refused = 0;
        for number in 0..2 * SENSORS {
            let line = format!("{{\"id\": \"f{number}\", \"position\": [1, 2], {model}}}");
            let seen = Observation::parse(&line).expect("an observation");
            if let Err(why) = seen.apply(&mut world, 0.0, 0.5) {
                assert!(why.contains("one sensor too many: this build holds 128"), "{why}");
                refused += 1;
            }
        }
        assert_eq!((world.sensors.len(), refused), (SENSORS, SENSORS + scenario().sensors.len()));
        assert!(world.to_core::<f64, 2>().is_ok(), "it is planned with all the same");
    }

    #[test]
    fn what_is_wrong_with_an_observation_is_said() {
        let name = scenario().sensors[0].name.clone();
        let cases = [
            ("{".to_owned(), "is no observation: EOF"),
            ("{\"id\": \"x\", \"positon\": [1, 2]}".to_owned(), "is no observation: unknown field `positon`"),
            ("{\"id\": \"x\", \"position\": [1, 2]}".to_owned(), "`x` is no sensor of the scenario"),
            (format!("{{\"id\": \"{name}\"}}"), "needs either `position` or"),
            (format!("{{\"id\": \"{name}\", \"position\": [1]}}"), "needs a position of 2 finite numbers"),
            (
                format!("{{\"id\": \"{name}\", \"position\": [1, 2], \"covariance\": [[0.3, 0], [0, 0.3]]}}"),
                "is uncertain by 0.775, more than 0.5",
            ),
            (
                format!(
                    "{{\"id\": \"{name}\", \"position\": [1, 2], \"detection\": {{\"model\": \"proxy\", \"scale\": -1, \"epsilon\": 1, \"path_loss\": 2}}}}"
                ),
                "makes no sensor: detection.scale",
            ),
            (
                format!("{{\"id\": \"{name}\", \"time\": 1e300, \"position\": [1, 2], \"velocity\": [1, 0]}}"),
                "makes no sensor: track",
            ),
            (
                format!("{{\"id\": \"{name}\", \"position\": [1e308, 2], \"velocity\": [1e308, 0]}}"),
                "makes no sensor: track",
            ),
            (
                format!("{{\"id\": \"{name}\", \"position\": [1, 2], \"covariance\": [[1], []]}}"),
                "covariance that is none",
            ),
        ];
        for (line, says) in cases {
            let error = apply(&line).expect_err(says);
            assert!(error.contains(says), "{error}");
        }
    }
}
