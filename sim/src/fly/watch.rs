//! Notes of a flight: where the vehicle was, which plans it flew, what was said.

use quietpath_bridge::capacity::NODES;
use quietpath_bridge::clock::Time;
use quietpath_bridge::file::plan::AgentPlan;
use quietpath_bridge::file::{PlanFile, ScenarioFile};
use quietpath_bridge::flight::Level;
use quietpath_bridge::frame::{LocalFrame, Place};
use quietpath_bridge::planning;

use super::craft::Craft;
use super::{Look, Progress};
use crate::outcome::Failure;

/// Places of the track that a plan's interval is divided into.
const PLACES_PER_INTERVAL: usize = 4;
/// Room for a flight that takes longer than the scenario allows.
const LATE: f64 = 1.1;

/// Takes notes of a flight.
pub(super) struct Watch<'a> {
    truth: &'a ScenarioFile,
    frame: LocalFrame,
    pub(super) steps: Vec<PlanFile>,
    pub(super) log: Vec<(f64, Level, String)>,
    times: Vec<f64>,
    path: Vec<Vec<f64>>,
    jam: Vec<f64>,
    dropout: Vec<f64>,
    /// Time between two places of the track, s.
    every: f64,
    /// Integrals of the levels since the last place, s, and until when.
    sums: [f64; 2],
    summed: f64,
    pub(super) last: Progress,
}

impl<'a> Watch<'a> {
    pub(super) fn new(truth: &'a ScenarioFile, plan: &PlanFile) -> Result<Self, Failure> {
        let frame = LocalFrame::of(truth).ok_or_else(|| Failure::input("the scenario lies nowhere on the Earth"))?;
        let longest = truth.time.max - truth.start_time;
        let fine = plan.duration / (PLACES_PER_INTERVAL * plan.nodes().max(2)) as f64;
        Ok(Self {
            truth,
            frame,
            steps: vec![plan.clone()],
            log: Vec::new(),
            times: Vec::new(),
            path: Vec::new(),
            jam: Vec::new(),
            dropout: Vec::new(),
            every: fine.max(LATE * longest / NODES as f64),
            sums: [0.0; 2],
            summed: truth.start_time,
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
        for (sum, level) in self.sums.iter_mut().zip(craft.levels()) {
            *sum += level * (time - self.summed);
        }
        self.summed = time;
        let is_due = self.times.last().is_none_or(|last| time >= last + self.every);
        if is_due && craft.flight().phase() == "fly" && self.path.len() + 1 < NODES {
            self.mark(craft, time);
        }
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
        let [jam, dropout] = self.times.last().map_or([0.0; 2], |last| self.sums.map(|sum| sum / (time - last)));
        self.sums = [0.0; 2];
        self.times.push(time);
        self.path.push(position);
        self.jam.push(jam);
        self.dropout.push(dropout);
    }

    pub(super) fn scenario_time(&self, craft: &dyn Craft) -> Option<f64> {
        craft.began().map(|began| self.truth.start_time + craft.now().since(began).as_secs_f64())
    }

    fn position(&self, place: Option<Place>) -> Option<Vec<f64>> {
        self.frame.position(&place?)
    }

    /// Tells who looks on.
    pub(super) fn look_on(
        &mut self,
        craft: &dyn Craft,
        tell: &mut impl FnMut(Look<'_>) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        self.progress(craft)?;
        let (progress, steps, world, end) = (&self.last, &self.steps, craft.flight().world(), craft.end());
        let zero = self.truth.start_time - craft.began().map_or(0.0, Time::seconds);
        tell(Look { progress, track: &self.track(), steps, world, wire: &craft.wire().messages(zero), end })
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

    /// What was flown, as a plan. Levels are means over the interval before a place.
    pub(super) fn track(&self) -> PlanFile {
        let start_time = self.times.first().copied().unwrap_or_default();
        let duration = self.times.last().copied().unwrap_or_default() - start_time;
        let entry = self.truth.agents.first();
        let agent = AgentPlan {
            name: entry.map(|agent| agent.name.clone()).unwrap_or_default(),
            path: self.path.clone(),
            jam: entry.and_then(|agent| agent.jammer).map(|_| self.jam.clone()),
            azimuth: None,
            dropout: entry.and_then(|agent| agent.dropout).map(|_| self.dropout.clone()),
        };
        PlanFile {
            scenario: self.truth.name.clone(),
            start_time,
            duration,
            status: Some("flown".into()),
            times: Some(self.times.clone()),
            agents: vec![agent],
            ..PlanFile::default()
        }
    }
}
