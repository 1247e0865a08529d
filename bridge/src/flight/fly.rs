//! The flight itself: along the plan, to the next plan, and out of it.

use crate::clock::Time;
use crate::command::Command;
use crate::file::{PlanFile, ScenarioFile};
use crate::mission::{Delivery, List, Watch};
use crate::replan::Answer;
use crate::replan::job::{Rejected, budgets_at, joined, judge, rest, rest_at};
use crate::setpoint::Curve;
use crate::setpoint::Steering;
use crate::telemetry::{Autopilot, Flying as InAir, Mode, Vehicle};

use super::settings::{FlyMode, OnFailure};
use super::{End, Flight, Flying, Level, Output, Phase};

/// Time after the last node in which a steered vehicle settles, s.
const SETTLE: f64 = 2.0;
/// Times that are closer are the same, s.
const NODE_TOLERANCE: f64 = 1e-6;
/// How long a steered vehicle may take to the goal after its time, s.
const ARRIVE_MAX: f64 = 30.0;

impl Flight {
    /// The plan that flies, or is about to.
    #[must_use]
    pub const fn plan(&self) -> &PlanFile {
        &self.flying.plan
    }

    /// The name of the agent that this vehicle is.
    #[must_use]
    pub fn agent(&self) -> &str {
        &self.agent
    }

    /// The scenario as the bridge knows it now.
    #[must_use]
    pub const fn world(&self) -> &ScenarioFile {
        &self.world
    }

    pub(super) fn fly(&mut self, vehicle: &Vehicle) {
        if self.telemetry.is_lost(self.now) {
            // Nothing is steered blindly. The autopilot has its own answer to a bridge that it does not hear.
            return;
        }
        if !vehicle.armed {
            return self.end(End::Released("the vehicle was disarmed".into()));
        }
        if matches!(vehicle.flying, InAir::Ground | InAir::Landing) {
            return self.end(End::Released("the vehicle lands".into()));
        }
        if vehicle.mode != self.own_mode() {
            return self.end(End::Released(format!("the mode is {:?} now, and not by the bridge", vehicle.mode)));
        }
        if self.is_expired() {
            return self.give_up("the plan is older than its time to live".into());
        }
        let time = self.scenario_time();
        let is_steered = self.settings.mode == FlyMode::Guided;
        if let Some(next) = self.next.take_if(|next| is_steered && next.curve.begin() <= time) {
            self.say(Level::Info, format!("the plan of {:.1} s flies", next.curve.begin()));
            // Its first setpoint does not wait for its turn.
            self.setpoint = None;
            self.take_over(next);
        }
        match self.settings.mode {
            FlyMode::Guided => {
                let sample = self.flying.curve.sample(time);
                self.steer(vehicle, &sample, Steering::Along);
                let late = time - self.flying.curve.end();
                let is_there = self.distance_m(vehicle, &sample.position) < self.settings.arrival_m;
                if late > SETTLE && is_there {
                    return self.leave(Mode::Hold, End::Done);
                }
                if late > ARRIVE_MAX {
                    return self.give_up("the vehicle did not come to the goal".into());
                }
            }
            FlyMode::Mission => {
                self.advance_update(vehicle);
                let goal = self.flying.curve.sample(self.flying.curve.end());
                let is_last = self.item.is_some_and(|(item, _)| usize::from(item) + 1 >= self.flying.nodes.len());
                if is_last && self.distance_m(vehicle, &goal.position) < self.settings.arrival_m {
                    return self.end(End::Done);
                }
            }
        }
        self.plan_anew(time);
    }

    /// Time of the scenario by the item that the mission flies to, s: the clock runs between two nodes, and waits at the
    /// second for the vehicle.
    pub(super) fn mission_time(&self) -> f64 {
        let times = self.flying.plan.node_times();
        let begin = self.flying.curve.begin();
        let Some((item, since)) = self.item else { return begin };
        let node = self.flying.nodes.get(usize::from(item)).copied().unwrap_or_default();
        let to = times.get(node).copied().unwrap_or(self.flying.curve.end());
        let from = node.checked_sub(1).and_then(|node| times.get(node).copied()).unwrap_or(begin);
        (from + self.now.since(since).as_secs_f64()).min(to)
    }

    fn plan_anew(&mut self, time: f64) {
        let Some(replan) = self.settings.replan else { return };
        if self.job.is_some() || self.next.is_some() || self.update.is_some() {
            return;
        }
        let (world, plan) = (&self.world, &self.flying.plan);
        let prompt = replan.prompt_lead_s.filter(|_| self.is_news && self.settings.mode == FlyMode::Guided);
        let is_due = time - self.flying.made >= replan.interval_s;
        let job = match prompt {
            Some(lead) => rest_at(self.jobs + 1, world, plan, time + lead),
            // A mission takes over when it has been delivered.
            None if is_due => rest(self.jobs + 1, world, plan, time + replan.lead_s + self.delivery_s),
            None => return,
        };
        self.is_news = false;
        let Some(job) = job else {
            // Too little is left: the plan is good to its end.
            self.flying.made = time;
            self.keep();
            return;
        };
        self.jobs += 1;
        self.job = Some((Box::new(job.clone()), self.now));
        self.out.push(Output::Plan(Box::new(job)));
    }

    pub(super) fn planned(&mut self, answer: &Answer) {
        let Some((job, asked)) = self.job.take() else { return };
        let time = self.scenario_time();
        match judge(&job, answer, time, &self.flying.curve) {
            Err(Rejected::Stale) => self.job = Some((job, asked)),
            Err(why) => self.say(Level::Warn, format!("the plan for {:.1} s does not fly: {why}", job.seam)),
            Ok((plan, curve)) if matches!(self.phase, Phase::Fly) => {
                let budgets = job.scenario.agents.first().map(|agent| (agent.jammer, agent.dropout));
                let is_rest = self.settings.mode == FlyMode::Mission;
                let next = Flying { plan, curve, made: time, nodes: Vec::new(), budgets, is_rest };
                match self.settings.mode {
                    FlyMode::Guided => self.next = Some(next),
                    FlyMode::Mission => self.begin_update(next),
                }
            }
            Ok(_) => {}
        }
    }

    /// Sends the rest of the mission: what the plan that flies still does up to the seam, then the new plan.
    fn begin_update(&mut self, mut next: Flying) {
        let Some(vehicle) = self.telemetry.vehicle().copied() else { return };
        let now = self.mission_time();
        let plan = joined(&self.flying.plan, &next.plan, now);
        let Some(curve) = plan.as_ref().and_then(|plan| Curve::of(plan, &self.agent)) else {
            return self.say(Level::Warn, "a plan does not continue the one that flies");
        };
        next.budgets = plan.as_ref().and_then(|plan| budgets_at(&self.world, &self.flying.plan, plan.start_time));
        (next.plan, next.curve) = (plan.unwrap_or_default(), curve);
        let (items, nodes) = match self.items_of(&vehicle, &next.plan, next.is_rest) {
            Ok(both) => both,
            Err(why) => return self.say(Level::Warn, format!("a plan makes no mission: {why}")),
        };
        next.nodes = nodes;
        let talk = self.talk(vehicle.identity, List::Mission);
        self.update = Some(Box::new(Delivery::new(talk, vehicle.autopilot, items, self.pace())));
        (self.next, self.update_begun) = (Some(next), self.now);
    }

    /// The item of a new mission that flies to the node that the vehicle is flying to, and since when.
    fn item_to_go_on_at(&self, vehicle: &Vehicle, next: &Flying) -> (u16, Time) {
        let (now, times) = (self.mission_time(), next.plan.node_times());
        let node = times.iter().position(|time| *time >= now - NODE_TOLERANCE).unwrap_or(times.len()).max(1);
        // Item 0 of ArduPilot is home.
        let first = usize::from(vehicle.autopilot == Autopilot::ArduPilot);
        let item = next.nodes.iter().skip(first).position(|of| *of >= node).unwrap_or_default() + first;
        let since = self.item.map_or(self.now, |(_, since)| since);
        (u16::try_from(item).unwrap_or(u16::MAX), since)
    }

    fn advance_update(&mut self, vehicle: &Vehicle) {
        let Some(mut update) = self.update.take() else { return };
        let mut out = Vec::new();
        update.poll(self.now, &mut out);
        let result = update.result();
        self.send(out);
        // Not only when it is proved: an autopilot that was given a new list may begin it anew.
        if update.is_accepted() || matches!(result, Some(Ok(_))) {
            self.go_on_by_new_mission(vehicle);
        }
        match result {
            None => self.update = Some(update),
            Some(Ok(delivered)) => {
                let kept = update.items().to_vec();
                self.watch_over(Watch::new(self.talk(vehicle.identity, List::Mission), delivered), kept);
                self.delivery_s = self.now.since(self.update_begun).as_secs_f64();
                self.say(Level::Info, format!("the rest of the mission was replaced: {} items", delivered.count));
            }
            Some(Err(failure)) => {
                self.next = None;
                self.give_up(format!("the rest of the mission was not delivered: {failure}"));
            }
        }
    }

    /// The autopilot has the new mission: it is told where to go on.
    fn go_on_by_new_mission(&mut self, vehicle: &Vehicle) {
        let Some(next) = self.next.take() else { return };
        // Autopilots disagree on what they keep: the item is always said.
        let (item, since) = self.item_to_go_on_at(vehicle, &next);
        let command = Command::set_current(item);
        self.commands.submit(self.now, vehicle.identity, command);
        // Twice, for half a second in the wrong direction is what a lost one costs.
        self.send(vec![command.long(vehicle.identity, 0)]);
        self.take_over(next);
        (self.item, self.expected) = (Some((item, since)), Some((item, self.now)));
    }

    /// There is no plan to fly any more.
    pub(super) fn give_up(&mut self, why: String) {
        let is_steered = self.settings.mode == FlyMode::Guided;
        match self.settings.on_failure {
            OnFailure::Return => self.leave(Mode::Return, End::Failed(why)),
            OnFailure::Continue if !is_steered => self.end(End::Failed(why)),
            OnFailure::Hold | OnFailure::Continue => self.leave(Mode::Hold, End::Failed(why)),
        }
    }
}
