//! Notes of a flight: where the vehicle was, which plans it flew, what was said.

use quietpath_bridge::capacity::NODES;
use quietpath_bridge::clock::Time;
use quietpath_bridge::file::plan::AgentPlan;
use quietpath_bridge::file::scenario::AgentEntry;
use quietpath_bridge::file::{PlanFile, ScenarioFile};
use quietpath_bridge::flight::Level;
use quietpath_bridge::frame::{LocalFrame, Place};
use quietpath_bridge::payload::Emission;
use quietpath_bridge::planning;

use super::craft::{Craft, SILENT};
use super::{Look, Progress};
use crate::outcome::Failure;

/// Places of the track that a plan's interval is divided into.
const PLACES_PER_INTERVAL: usize = 4;
/// Room for a flight that takes longer than the scenario allows.
const LATE: f64 = 1.1;
/// Times that are closer are the same, s.
const SAME: f64 = 1e-6;

/// Takes notes of a flight.
pub(super) struct Watch<'a> {
    truth: &'a ScenarioFile,
    frame: LocalFrame,
    /// Which agent flies.
    agent: usize,
    /// The plans, each with all agents.
    pub(super) steps: Vec<PlanFile>,
    pub(super) log: Vec<(f64, Level, String)>,
    times: Vec<f64>,
    path: Vec<Vec<f64>>,
    emissions: Vec<Emission>,
    /// Time between two places of the track, s.
    every: f64,
    /// Integrals since the last place, s, until when, and what was emitted then.
    sums: [f64; 2],
    summed: f64,
    emitted: Emission,
    pub(super) last: Progress,
}

impl<'a> Watch<'a> {
    /// Notes of one agent's flight.
    ///
    /// # Errors
    /// A scenario that lies nowhere on the Earth.
    pub(super) fn new(truth: &'a ScenarioFile, plan: &PlanFile, agent: usize) -> Result<Self, Failure> {
        let frame = LocalFrame::of(truth).ok_or_else(|| Failure::input("the scenario lies nowhere on the Earth"))?;
        let longest = truth.time.max - truth.start_time;
        let fine = plan.duration / (PLACES_PER_INTERVAL * plan.nodes().max(2)) as f64;
        Ok(Self {
            truth,
            frame,
            agent,
            steps: vec![plan.clone()],
            log: Vec::new(),
            times: Vec::new(),
            path: Vec::new(),
            emissions: Vec::new(),
            every: fine.max(LATE * longest / NODES as f64),
            sums: [0.0; 2],
            summed: truth.start_time,
            emitted: SILENT,
            last: Progress::default(),
        })
    }

    /// After every step: what was said, and where the vehicle is.
    pub(super) fn note(&mut self, craft: &dyn Craft, said: Vec<(Level, String)>) {
        let now = craft.now().seconds();
        self.log.extend(said.into_iter().map(|(level, text)| (now, level, text)));
        let flies = craft.flight().plan();
        if self.steps.last().is_some_and(|last| flies.start_time > last.start_time) {
            self.steps.push(flies.clone());
        }
        let Some(time) = self.scenario_time(craft) else { return };
        let emission = craft.emission();
        for (sum, level) in self.sums.iter_mut().zip([emission.level, emission.dropout]) {
            *sum += level * (time - self.summed);
        }
        self.summed = time;
        let is_due = self.times.last().is_none_or(|last| time >= last + self.every);
        if is_due && craft.flight().phase() == "fly" && self.path.len() + 1 < NODES {
            self.mark(craft, time);
        }
        self.emitted = emission;
    }

    /// The end of the way, between two places of the track.
    pub(super) fn finish(&mut self, craft: &dyn Craft) {
        let Some(time) = self.scenario_time(craft) else { return };
        // A last interval much shorter than the others would make much of the vehicle's last metre.
        if self.times.last().is_some_and(|last| time > last + 0.5 * self.every) && self.path.len() < NODES {
            self.mark(craft, time);
        }
    }

    fn mark(&mut self, craft: &dyn Craft, time: f64) {
        let Some(position) = self.position(craft.place()) else { return };
        let [level, dropout] = self.times.last().map_or([0.0; 2], |last| self.sums.map(|sum| sum / (time - last)));
        self.sums = [0.0; 2];
        self.times.push(time);
        self.path.push(position);
        self.emissions.push(Emission { level, dropout, azimuth: self.emitted.azimuth });
    }

    pub(super) fn scenario_time(&self, craft: &dyn Craft) -> Option<f64> {
        craft.began().map(|began| self.truth.start_time + craft.now().since(began).as_secs_f64())
    }

    fn position(&self, place: Option<Place>) -> Option<Vec<f64>> {
        self.frame.position(&place?)
    }

    /// Tells who looks on; `before` are the tracks of agents that flew before this one.
    pub(super) fn look_on(
        &mut self,
        craft: &dyn Craft,
        before: &[PlanFile],
        tell: &mut impl FnMut(Look<'_>) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        self.progress(craft)?;
        let (progress, steps, world, end) = (&self.last, &self.steps, craft.flight().world(), craft.end());
        let zero = self.truth.start_time - craft.began().map_or(0.0, Time::seconds);
        tell(Look { progress, track: &self.track(before), steps, world, wire: &craft.wire().messages(zero), end })
    }

    fn progress(&mut self, craft: &dyn Craft) -> Result<(), Failure> {
        let position = self.position(craft.place());
        let time = self.scenario_time(craft);
        let at = time.unwrap_or(self.truth.start_time);
        let place = position.as_deref();
        let detection = place.map(|place| planning::detection_at(self.truth, at, place)).transpose()?.unwrap_or(0.0);
        let statistics = craft.statistics();
        let phase = craft.flight().phase();
        self.last = Progress {
            agent: self.entry().map(|entry| entry.name.clone()).filter(|_| self.truth.agents.len() > 1),
            phase,
            time,
            position: position.unwrap_or_default(),
            detection,
            peak: if phase == "fly" { self.last.peak.max(detection) } else { self.last.peak },
            replans: self.steps.len() - 1,
            frames: [statistics.frames_out, statistics.frames_in],
            loss: statistics.loss(),
        };
        Ok(())
    }

    fn entry(&self) -> Option<&AgentEntry> {
        self.truth.agents.get(self.agent)
    }

    /// What was flown, as a plan. Levels are means over the interval before a place. Agents that flew before are where they
    /// were at these times, those that are to fly where they will be.
    pub(super) fn track(&self, before: &[PlanFile]) -> PlanFile {
        let start_time = self.times.first().copied().unwrap_or_default();
        let duration = self.times.last().copied().unwrap_or_default() - start_time;
        let names = self.truth.agents.iter().map(|entry| entry.name.as_str()).enumerate();
        let agents = names.filter_map(|(index, name)| {
            let source = before.get(index).or(self.steps.first())?;
            if index == self.agent { Some(self.own()) } else { sampled(source, name, &self.times) }
        });
        PlanFile {
            scenario: self.truth.name.clone(),
            start_time,
            duration,
            status: Some("flown".into()),
            agents: agents.collect(),
            times: Some(self.times.clone()),
            ..PlanFile::default()
        }
    }

    fn own(&self) -> AgentPlan {
        let entry = self.entry();
        let along = |value: fn(&Emission) -> f64| self.emissions.iter().map(value).collect();
        let jammer = entry.and_then(|agent| agent.jammer);
        AgentPlan {
            name: entry.map(|agent| agent.name.clone()).unwrap_or_default(),
            path: self.path.clone(),
            jam: jammer.map(|_| along(|emission| emission.level)),
            azimuth: jammer.map(|_| along(|emission| emission.azimuth)),
            dropout: entry.and_then(|agent| agent.dropout).map(|_| along(|emission| emission.dropout)),
        }
    }
}

/// One agent of a plan at other times: positions between its nodes, levels of the intervals.
pub(super) fn sampled(plan: &PlanFile, name: &str, times: &[f64]) -> Option<AgentPlan> {
    let agent = plan.agents.iter().find(|agent| agent.name == name)?;
    let nodes = plan.node_times();
    let last = nodes.len().checked_sub(1)?;
    // The node at which the interval that holds a time ends.
    let end = |time: f64| nodes.partition_point(|node| *node < time - SAME).min(last);
    let place = |time: &f64| {
        let to = end(*time);
        let (b, a) = (agent.path.get(to)?, agent.path.get(to.saturating_sub(1))?);
        let (from, until) = (nodes.get(to.saturating_sub(1))?, nodes.get(to)?);
        let share = if until > from { ((time - from) / (until - from)).clamp(0.0, 1.0) } else { 1.0 };
        Some(a.iter().zip(b).map(|(a, b)| a + share * (b - a)).collect())
    };
    let levels = |values: &Option<Vec<f64>>| {
        let values = values.as_ref()?;
        Some(times.iter().map(|time| values.get(end(*time)).copied().unwrap_or_default()).collect())
    };
    Some(AgentPlan {
        name: name.to_owned(),
        path: times.iter().map(place).collect::<Option<_>>()?,
        jam: levels(&agent.jam),
        azimuth: levels(&agent.azimuth),
        dropout: levels(&agent.dropout),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plan_is_sampled_between_its_nodes() {
        let path = vec![vec![0.0, 0.0], vec![2.0, 0.0], vec![2.0, 4.0]];
        let agent = AgentPlan { name: "a".into(), path, jam: Some(vec![0.0, 0.5, 1.0]), ..AgentPlan::default() };
        let plan = PlanFile { start_time: 10.0, duration: 4.0, agents: vec![agent], ..PlanFile::default() };
        let found = sampled(&plan, "a", &[10.0, 11.0, 12.0, 12.5, 14.0, 99.0]).expect("the agent is there");
        let path = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 1.0], [2.0, 4.0], [2.0, 4.0]];
        assert_eq!(found.path, path);
        assert_eq!(found.jam, Some(vec![0.0, 0.5, 0.5, 1.0, 1.0, 1.0]));
        assert_eq!((found.dropout, sampled(&plan, "b", &[10.0])), (None, None));
    }
}
