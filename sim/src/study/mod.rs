//! Many flights of one plan through a world that is not quite the scenario's.
//!
//! The plan is made for the scenario as it is written. A run draws a world ([`Study`]: where sensors really are, how
//! signals really fade, what the air does), flies the plan in it ([`follow`](mod@follow)), and computes along the way that was flown
//! what the sensors of that world see. Jamming and silence follow the plan's clock.
//!
//! A run depends on its number and the seed alone: not on the cores, the order, the shard, or whether it was
//! interrupted.
//!
//! | module | what |
//! |---|---|
//! | [`follow`](mod@follow) | the vehicle and the air |
//! | [`record`] | a line a run, resuming, merging |
//! | [`summary`] | distributions, as a table and as pictures |
//!
//! Limits: the plan is not made anew in flight; every sensor and every exponent errs on its own.

pub mod follow;
pub mod record;
pub mod summary;

use quietpath_bridge::capacity::NODES;
use quietpath_bridge::file::plan::AgentPlan;
use quietpath_bridge::file::scenario::{MotionEntry, SensorEntry, Study};
use quietpath_bridge::file::{FileError, PlanFile, ScenarioFile};
use quietpath_bridge::planning::{self, Assessment};
use quietpath_bridge::setpoint::Curve;
use quietpath_core::Metric;
use quietpath_core::constraints::TOLERANCE;
use quietpath_core::scenario::{Detection, Ranging};
use serde::{Deserialize, Serialize};

use crate::report::{extreme, mean};
use crate::units::Presentation;
use follow::{Air, Limits, follow, normal};

/// Deviations beyond which a draw is drawn anew.
const TAIL: f64 = 4.0;
/// The smallest path-loss exponent that is drawn.
const PATH_LOSS_MIN: f64 = 0.1;

/// What a flight was worth. Metres and seconds.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Figures {
    /// When the last vehicle arrived, s after the start; `None` where one did not arrive by `time.max`.
    pub flight_time: Option<f64>,
    /// Largest probability of detection of any vehicle.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub peak_detection: Option<f64>,
    /// Probability of detection, mean over time and vehicles.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mean_detection: Option<f64>,
    /// Smallest location error (CEP) of any vehicle, m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub least_cep_m: Option<f64>,
    /// Location error (CEP), mean over time and vehicles, m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mean_cep_m: Option<f64>,
}

/// One run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// Its number, from 0.
    pub run: u64,
    /// What the flight was worth.
    #[serde(flatten)]
    pub figures: Figures,
    /// Largest distance from the plan, m.
    pub off_plan_m: f64,
    /// Mean wind, m/s: east, north.
    pub wind_m_s: [f64; 2],
    /// What went wrong: `late`, `domain`, `region`, `separation`, `limit`.
    pub failures: Vec<String>,
}

/// What all runs share.
#[derive(Debug)]
pub struct Stage<'a> {
    scenario: &'a ScenarioFile,
    study: &'a Study,
    plan: &'a PlanFile,
    curves: Vec<Curve>,
    instants: Vec<f64>,
}

impl<'a> Stage<'a> {
    /// Prepares the runs of a plan; `None` where an agent's path is no curve in time.
    #[must_use]
    pub fn new(scenario: &'a ScenarioFile, study: &'a Study, plan: &'a PlanFile) -> Option<Self> {
        let curves = scenario.agents.iter().map(|agent| Curve::of(plan, &agent.name)).collect::<Option<_>>()?;
        let (begin, end) = (plan.start_time, scenario.time.max.max(plan.start_time + plan.duration));
        // As fine as the plan, as far as the room for nodes goes.
        let intervals = ((end - begin) / plan.duration * plan.nodes().saturating_sub(1) as f64).ceil();
        let intervals = (intervals as usize).clamp(1, NODES - 1);
        let instant = |node: usize| begin + (end - begin) * node as f64 / intervals as f64;
        Some(Self { scenario, study, plan, curves, instants: (0..=intervals).map(instant).collect() })
    }

    /// Draws a world and flies the plan in it.
    ///
    /// # Errors
    /// As [`planning::assess`]; a plan that fits the scenario has none.
    pub fn run(&self, run: u64) -> Result<Run, Box<FileError>> {
        let mut random = fastrand::Rng::with_seed(mixed(self.study.seed, run));
        let world = self.world(&mut random);
        let mut air = Air::draw(&self.study.wind, &mut random);
        let wind = air.mean();
        let mut ways = Vec::with_capacity(self.curves.len());
        for (curve, agent) in self.curves.iter().zip(&self.scenario.agents) {
            let airspeed = self.study.airspeed * agent.speed_max;
            let limits = Limits { speed: agent.speed_max, airspeed, accel: agent.accel_max };
            ways.push(follow(curve, limits, &mut air, &self.instants));
        }
        let arrivals: Option<Vec<f64>> = ways.iter().map(|way| way.arrival).collect();
        let arrival = arrivals.map(|all| all.into_iter().fold(f64::NEG_INFINITY, f64::max));
        let flown = self.flown(&ways, arrival);
        let assessment = planning::assess(&world, &flown, "the flight")?;
        let unit_m = self.scenario.frame.unit_m;
        let flight_time = arrival.map(|arrival| arrival - self.plan.start_time);
        let mut failures: Vec<String> = Vec::new();
        if arrival.is_none() {
            failures.push("late".into());
        }
        for (name, size) in &assessment.violations {
            if ["domain", "region", "separation", "limit"].contains(name) && *size > TOLERANCE {
                failures.push((*name).to_owned());
            }
        }
        Ok(Run {
            run,
            figures: Figures { flight_time, ..figures(self.scenario, &assessment) },
            off_plan_m: ways.iter().map(|way| way.off).fold(0.0, f64::max) * unit_m,
            wind_m_s: wind.map(|part| part * unit_m),
            failures,
        })
    }

    /// The scenario as it may really be.
    fn world(&self, random: &mut fastrand::Rng) -> ScenarioFile {
        let mut world = self.scenario.clone();
        for sensor in &mut world.sensors {
            let shift: Vec<f64> =
                (0..world.dimension).map(|_| self.study.sensor_position * bounded(random)).collect();
            displace(sensor, &shift);
            let by = self.study.path_loss * bounded(random);
            weaken(sensor, by);
        }
        world
    }

    /// What was flown, as a plan: until the last vehicle arrived, or time was up.
    fn flown(&self, ways: &[follow::Way], arrival: Option<f64>) -> PlanFile {
        let end = arrival.unwrap_or(f64::INFINITY);
        let last = self.instants.iter().position(|instant| *instant >= end).unwrap_or(self.instants.len() - 1).max(1);
        let mut times: Vec<f64> = self.instants.iter().take(last + 1).copied().collect();
        // The flight ends when the last vehicle is there, not at the instant after.
        if let (Some(end), Some(time)) = (arrival, times.last_mut()) {
            *time = end;
        }
        let plan_times = self.plan.node_times();
        let controls = |levels: &Option<Vec<f64>>| {
            let levels = levels.as_ref()?;
            Some(times.iter().map(|time| level(&plan_times, levels, *time)).collect())
        };
        let agents = self.plan.agents.iter().zip(ways).map(|(agent, way)| AgentPlan {
            name: agent.name.clone(),
            path: way.positions.iter().take(last + 1).cloned().collect(),
            jam: controls(&agent.jam),
            azimuth: controls(&agent.azimuth),
            dropout: controls(&agent.dropout),
        });
        let agents = agents.collect();
        let start_time = self.plan.start_time;
        let duration = times.last().copied().unwrap_or(start_time) - start_time;
        PlanFile { start_time, duration, agents, times: Some(times), ..PlanFile::default() }
    }
}

/// A control at a time: it holds over the interval that ends at its node, and is 0 after the plan.
fn level(times: &[f64], levels: &[f64], time: f64) -> f64 {
    times.iter().position(|node| *node >= time).and_then(|node| levels.get(node)).copied().unwrap_or(0.0)
}

/// The figures of a plan or a flight; its flight time is left out.
#[must_use]
pub fn figures(scenario: &ScenarioFile, assessment: &Assessment) -> Figures {
    let series = |metric| assessment.agents.iter().filter_map(move |agent| agent.metric(metric));
    let means = |metric| {
        let all: Vec<f64> = series(metric).map(|values| mean(values, &assessment.times)).collect();
        (!all.is_empty()).then(|| all.iter().sum::<f64>() / all.len() as f64).filter(|mean| mean.is_finite())
    };
    let metres = |value: f64| Presentation::of(Metric::Cep, scenario.dimension, scenario.frame.unit_m).convert(value);
    let detects = scenario.sensors.iter().any(|sensor| sensor.detection.is_some());
    let peak = series(Metric::Detection).map(|values| extreme(values, f64::max).0).reduce(f64::max);
    Figures {
        flight_time: None,
        peak_detection: peak.filter(|_| detects),
        mean_detection: means(Metric::Detection).filter(|_| detects),
        least_cep_m: series(Metric::Cep).map(|values| metres(extreme(values, f64::min).0)).reduce(f64::min),
        mean_cep_m: means(Metric::Cep).map(metres),
    }
}

fn displace(sensor: &mut SensorEntry, shift: &[f64]) {
    let places: Vec<&mut Vec<f64>> = match &mut sensor.motion {
        MotionEntry::Fixed(position) => vec![position],
        MotionEntry::Track(knots) => knots.iter_mut().map(|knot| &mut knot.position).collect(),
    };
    for place in places {
        for (part, by) in place.iter_mut().zip(shift) {
            *part += by;
        }
    }
}

fn weaken(sensor: &mut SensorEntry, by: f64) {
    if let Some(Ranging::Rss { path_loss, .. } | Ranging::Toa { path_loss, .. }) = &mut sensor.ranging {
        *path_loss = (*path_loss + by).max(PATH_LOSS_MIN);
    }
    if let Some(Detection::Proxy { path_loss, .. } | Detection::Energy { path_loss, .. }) = &mut sensor.detection {
        *path_loss = (*path_loss + by).max(PATH_LOSS_MIN);
    }
}

/// A normal number within [`TAIL`] deviations.
fn bounded(random: &mut fastrand::Rng) -> f64 {
    for _ in 0..16 {
        let value = normal(random);
        if value.abs() <= TAIL {
            return value;
        }
    }
    0.0
}

/// A seed of a run's own: neighbouring numbers must not give related sequences (the finaliser of SplitMix64).
fn mixed(seed: u64, run: u64) -> u64 {
    let mut bits = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15).wrapping_add(run.wrapping_mul(0xD1B5_4A32_D192_ED03));
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    bits ^ (bits >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCENARIO: &str = include_str!("../../scenarios/square8-detection.toml");

    fn scenario(study: &str) -> ScenarioFile {
        let bare = SCENARIO.split("[study]").next().unwrap();
        ScenarioFile::parse("s.toml", &format!("{bare}\n{study}")).unwrap().scenario
    }

    fn straight(scenario: &ScenarioFile) -> PlanFile {
        let (start, goal) = (&scenario.agents[0].start, &scenario.agents[0].goal);
        let node = |node: u32| start.iter().zip(goal).map(|(a, b)| a + (b - a) * f64::from(node) / 60.0).collect();
        let agents =
            vec![AgentPlan { name: "uav1".into(), path: (0..=60).map(node).collect(), ..AgentPlan::default() }];
        PlanFile { duration: 120.0, agents, ..PlanFile::default() }
    }

    #[test]
    fn a_world_without_doubt_is_the_plan() {
        let scenario = scenario("[study]\n");
        let study = scenario.study.clone().unwrap();
        let plan = straight(&scenario);
        let run = Stage::new(&scenario, &study, &plan).unwrap().run(0).unwrap();
        let paper = figures(&scenario, &planning::assess(&scenario, &plan, "p").unwrap());
        assert!((run.figures.flight_time.unwrap() - 120.0).abs() < 2.0, "{run:?}");
        let (flown, planned) = (run.figures.mean_detection.unwrap(), paper.mean_detection.unwrap());
        assert!((flown / planned - 1.0).abs() < 0.02, "{flown} {planned}");
        assert!(run.failures.is_empty() && run.off_plan_m < 15.0, "{run:?}");
    }

    #[test]
    fn a_run_depends_on_its_number_and_the_seed_alone() {
        let text = "[study]\nsensor_position = 0.3\npath_loss = 0.1\nwind = { deviation = 0.02, gust = 0.02 }\n";
        let scenario = scenario(text);
        let study = scenario.study.clone().unwrap();
        let plan = straight(&scenario);
        let stage = Stage::new(&scenario, &study, &plan).unwrap();
        let first = stage.run(7).unwrap();
        stage.run(3).unwrap();
        assert_eq!(stage.run(7).unwrap(), first);
        assert_ne!(stage.run(8).unwrap().figures, first.figures);
        let other = Study { seed: 2, ..study.clone() };
        assert_ne!(Stage::new(&scenario, &other, &plan).unwrap().run(7).unwrap().figures, first.figures);
    }

    #[test]
    fn what_is_drawn_has_the_spread_that_was_asked_for() {
        let scenario = scenario("[study]\nsensor_position = 0.3\npath_loss = 0.1\n");
        let study = scenario.study.clone().unwrap();
        let plan = straight(&scenario);
        let stage = Stage::new(&scenario, &study, &plan).unwrap();
        let (mut shifts, mut exponents) = (Vec::new(), Vec::new());
        for run in 0..500 {
            let world = stage.world(&mut fastrand::Rng::with_seed(mixed(1, run)));
            for (true_one, sensor) in world.sensors.iter().zip(&scenario.sensors) {
                if let (MotionEntry::Fixed(is), MotionEntry::Fixed(was)) = (&true_one.motion, &sensor.motion) {
                    shifts.extend(is.iter().zip(was).map(|(is, was)| is - was));
                }
                if let (Some(Ranging::Toa { path_loss: is, .. }), Some(Ranging::Toa { path_loss: was, .. })) =
                    (true_one.ranging, sensor.ranging)
                {
                    exponents.push(is - was);
                }
            }
        }
        let deviation = |all: &[f64]| (all.iter().map(|part| part * part).sum::<f64>() / all.len() as f64).sqrt();
        assert!((deviation(&shifts) / 0.3 - 1.0).abs() < 0.03, "{}", deviation(&shifts));
        assert!((deviation(&exponents) / 0.1 - 1.0).abs() < 0.04, "{}", deviation(&exponents));
    }

    #[test]
    fn wind_beyond_airspeed_makes_it_late() {
        let scenario = scenario("[study]\nwind = { mean = [-0.2, 0.0] }\n");
        let study = scenario.study.clone().unwrap();
        let run = Stage::new(&scenario, &study, &straight(&scenario)).unwrap().run(0).unwrap();
        assert_eq!(run.figures.flight_time, None);
        assert!(run.failures.contains(&"late".to_owned()), "{run:?}");
    }
}
