//! The flight itself: along the plan, to the next plan, and out of it.

use crate::command::Command;
use crate::file::PlanFile;
use crate::file::plan::AgentPlan;
use crate::mission::{Delivery, List, Watch};
use crate::replan::Answer;
use crate::replan::job::{Rejected, judge, rest, rest_at, step_value};
use crate::setpoint::Steering;
use crate::telemetry::{Autopilot, Flying as InAir, Mode, Vehicle};

use super::settings::{FlyMode, OnFailure};
use super::{End, Flight, Flying, Level, Output, Phase};

/// Time after the last node in which a steered vehicle settles, s.
const SETTLE: f64 = 2.0;
/// How long a steered vehicle may take to the goal after its time, s.
const ARRIVE_MAX: f64 = 30.0;
/// Items at the beginning of a mission that a vehicle in the air has behind it: take-off.
const BEHIND: usize = 1;

impl Flight {
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
        if let Some(next) = self.next.take_if(|next| next.curve.begin() <= time) {
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
            None if is_due => rest(self.jobs + 1, world, plan, time + replan.lead_s),
            None => return,
        };
        self.is_news = false;
        let Some(job) = job else {
            // Too little is left: the plan is good to its end.
            self.flying.made = time;
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
                let next = Flying { plan, curve, made: time, nodes: Vec::new(), budgets };
                match self.settings.mode {
                    FlyMode::Guided => self.next = Some(next),
                    FlyMode::Mission => self.begin_update(next),
                }
            }
            Ok(_) => {}
        }
    }

    /// A new plan flies. What is spent before it is spent: its budgets are those of the rest.
    fn take_over(&mut self, next: Flying) {
        if let (Some((jammer, dropout)), Some(agent)) = (next.budgets, self.world.agents.first_mut()) {
            (agent.jammer, agent.dropout) = (jammer, dropout);
        }
        self.flying = next;
    }

    /// Sends the rest of the mission by a new plan.
    fn begin_update(&mut self, mut next: Flying) {
        let Some(vehicle) = self.telemetry.vehicle().copied() else { return };
        let mut mission = match self.mission_of(&next.plan) {
            Ok(mission) => mission,
            Err(why) => return self.say(Level::Warn, format!("a plan makes no mission: {why}")),
        };
        mission.items.drain(..BEHIND.min(mission.items.len()));
        self.carry_over(&mut next.plan);
        let (items, nodes) = self.wire_mission(&vehicle, &mission, &next.plan, 0);
        next.nodes = nodes;
        let talk = self.talk(vehicle.identity, List::Mission);
        self.update = Some(Box::new(Delivery::new(talk, vehicle.autopilot, items, self.pace())));
        self.next = Some(next);
    }

    /// Until the first node of a new plan the old one goes on: its controls there are those of the new plan's node 0,
    /// which no integral counts.
    fn carry_over(&self, plan: &mut PlanFile) {
        let time = plan.start_time;
        let times = self.flying.plan.node_times();
        let same = |agent: &&AgentPlan| agent.name == self.agent;
        let Some(old) = self.flying.plan.agents.iter().find(same) else { return };
        let Some(new) = plan.agents.iter_mut().find(|agent| agent.name == self.agent) else { return };
        for (new, old) in
            [(&mut new.jam, &old.jam), (&mut new.dropout, &old.dropout), (&mut new.azimuth, &old.azimuth)]
        {
            if let (Some(first), Some(old)) = (new.as_mut().and_then(|new| new.first_mut()), old) {
                *first = step_value(&times, old, time);
            }
        }
    }

    /// The item of a new mission to go on at: its first, or the one behind it where that node was passed in the meantime.
    fn first_item(&self, vehicle: &Vehicle, next: &Flying) -> u16 {
        // Item 0 of ArduPilot is home.
        let first = u16::from(vehicle.autopilot == Autopilot::ArduPilot);
        if self.mission_time() <= next.curve.begin() {
            return first;
        }
        let item = next.nodes.iter().position(|node| *node > 0).unwrap_or_default();
        u16::try_from(item).unwrap_or(first)
    }

    fn advance_update(&mut self, vehicle: &Vehicle) {
        let Some(mut update) = self.update.take() else { return };
        let mut out = Vec::new();
        update.poll(self.now, &mut out);
        let result = update.result();
        self.send(out);
        match result {
            None => self.update = Some(update),
            Some(Ok(delivered)) => {
                let kept = update.items().to_vec();
                self.watch_over(Watch::new(self.talk(vehicle.identity, List::Mission), delivered), kept);
                if let Some(next) = self.next.take() {
                    // Autopilots disagree on what they keep: the item is always said.
                    let first = self.first_item(vehicle, &next);
                    self.commands.submit(self.now, vehicle.identity, Command::set_current(first));
                    self.take_over(next);
                    (self.item, self.expected) = (Some((first, self.now)), Some((first, self.now)));
                }
                self.say(Level::Info, format!("the rest of the mission was replaced: {} items", delivered.count));
            }
            Some(Err(failure)) => {
                self.next = None;
                self.give_up(format!("the rest of the mission was not delivered: {failure}"));
            }
        }
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
