//! What payloads emit.

use crate::clock::Time;
use crate::payload::Emission;
use crate::replan::job::step_value;
use crate::telemetry::Flying as InAir;

use super::settings::FlyMode;
use super::{Flight, Phase};
use crate::telemetry::Mode;

/// How much longer than its deadline planning may take before the planner counts as stalled, s.
const STALL_GRACE: f64 = 1.0;

/// Share of the jamming budget that is sent at most: switching takes its time, and plans end on theirs.
const BUDGET_SHARE_MAX: f64 = 1.05;

/// What was jammed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spending {
    /// The budget, s at full power; `None` without a jammer.
    budget: Option<f64>,
    /// What was sent of it, s.
    sent: f64,
    /// The level that is being sent, and since when.
    now: Option<(Time, f64)>,
}

impl Spending {
    /// Nothing was sent yet.
    pub(super) const fn new(budget: Option<f64>) -> Self {
        Self { budget, sent: 0.0, now: None }
    }
}

impl Flight {
    /// What payloads are to emit now; `None`, which means level 0 and full power, unless *all* of this holds: the plan is
    /// being flown, the vehicle is heard, armed, in the air and in the mode of the plan, the planner is not stalled, and
    /// the plan has time left to live.
    #[must_use]
    pub fn emission(&self) -> Option<Emission> {
        let vehicle = self.telemetry.vehicle()?;
        let is_flying = matches!(self.phase, Phase::Fly)
            && !self.telemetry.is_lost(self.now)
            && vehicle.armed
            && !matches!(vehicle.flying, InAir::Ground | InAir::Landing)
            && vehicle.mode == self.own_mode();
        if !is_flying || self.is_stalled() || self.is_expired() {
            return None;
        }
        let time = self.scenario_time();
        let plan = self.flying.plan.agents.iter().find(|agent| agent.name == self.agent)?;
        let times = self.flying.plan.node_times();
        if time > self.flying.curve.end() {
            return None;
        }
        let control = |values: &Option<Vec<f64>>| {
            values
                .as_deref()
                .filter(|values| !values.is_empty())
                .map_or(0.0, |values| step_value(&times, values, time))
        };
        // A bridge that died does not jam again: see `resume`.
        let level = if self.is_resumed || self.is_spent() { 0.0 } else { control(&plan.jam) };
        Some(Emission { level, azimuth: control(&plan.azimuth), dropout: control(&plan.dropout) })
    }

    /// Whether all of the jamming budget has been sent. Plans keep their budgets by their own time: a vehicle that takes
    /// longer to its next waypoint, or never gets there, jams on meanwhile.
    fn is_spent(&self) -> bool {
        self.spending.budget.is_some_and(|budget| self.spending.sent > BUDGET_SHARE_MAX * budget)
    }

    /// Counts what is sent from now on: so much, up to the next time.
    pub(super) fn count_emission(&mut self, emission: Option<Emission>) {
        let level = emission.map_or(0.0, |emission| emission.level);
        if let Some((since, before)) = self.spending.now.replace((self.now, level)) {
            self.spending.sent += before * self.now.since(since).as_secs_f64();
        }
    }

    /// The mode in which the vehicle flies the plan.
    pub(super) const fn own_mode(&self) -> Mode {
        match self.settings.mode {
            FlyMode::Mission => Mode::Mission,
            FlyMode::Guided => Mode::Guided,
        }
    }

    /// Whether the planner takes longer than it may.
    pub(super) fn is_stalled(&self) -> bool {
        let (Some(replan), Some((_, asked))) = (self.settings.replan, &self.job) else { return false };
        self.now.since(*asked).as_secs_f64() > replan.deadline_s + STALL_GRACE
    }

    /// Whether the plan has been flown for longer than it may. A flight that is not planned anew has one plan for all of
    /// its time.
    pub(super) fn is_expired(&self) -> bool {
        self.settings.replan.is_some_and(|replan| self.scenario_time() - self.flying.made > replan.time_to_live_s)
    }
}
