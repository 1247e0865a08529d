//! A flight that is picked up after the bridge died in it.
//!
//! While a plan is flown, its [`Journal`] says what a new bridge needs to go on with it: [`Output::Keep`] comes when a
//! plan begins to fly, and again, without a journal, when the flight ends. Whoever runs the flight writes it to a file and
//! hands it to the next one ([`Flight::resuming`]).
//!
//! | the vehicle is | what happens |
//! |---|---|
//! | not armed, or on the ground | that flight is over: this one begins from its start |
//! | in the air, in the mode of the plan | the plan goes on: a mission at the item that is flown to, setpoints from the place of the plan that is nearest to the vehicle |
//! | in the air, in another mode | the flight ends: somebody else, or the autopilot's own failsafe, has it |
//!
//! Nothing is started or uploaded, and a mission is read back before anything else is done with it. A picked-up flight does
//! not jam: arming is a person's decision about a program that works, and this one has just died.
//!
//! Limits: setpoints go on where the vehicle is, so that a plan with times of its own is late by as long as the bridge was
//! away; where a path crosses itself at the vehicle, the first of both places counts.

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::clock::Time;
use crate::file::{PlanFile, ScenarioFile};
use crate::mission::{Delivered, Download, List, Watch};
use crate::setpoint::Curve;
use crate::telemetry::Vehicle;

use super::settings::FlyMode;
use super::{End, Flight, Flying, Level, Output, Phase, Settings};

/// Version of the format.
const VERSION: u32 = 1;
/// How long to wait for the vehicle to say where it is, s.
const LOOK: f64 = 5.0;
/// Places of an interval that are looked at for the one nearest to the vehicle.
const PLACES: u32 = 16;
/// How far from the plan it is picked up at most, in distances that count as arrival.
const NEAR: f64 = 10.0;

/// What a new bridge needs to go on with a flight.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Journal {
    quietpath_journal: u32,
    /// The plan id: scenario, plan, agent and mode that the flight began with, digested.
    flight: String,
    /// The plan that flies.
    plan: PlanFile,
    /// When it was made, s of the scenario.
    made: f64,
    /// What is left of the budgets at its beginning, s.
    jam_left: Option<f64>,
    dropout_left: Option<f64>,
    /// Whether it is the rest of a mission that was replaced in flight.
    is_rest: bool,
}

/// A digest of what makes a flight the same flight.
pub(super) fn digest(scenario: &ScenarioFile, plan: &PlanFile, settings: &Settings) -> String {
    let mut hash = Sha256::new();
    let agent = settings.agent.as_deref().unwrap_or_default();
    for part in [scenario.text(), &plan.to_json(), agent, &format!("{:?}", settings.mode)] {
        hash.update((part.len() as u64).to_le_bytes());
        hash.update(part);
    }
    hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

impl Flight {
    /// The same flight, picked up where the journal says. Call it before the first step.
    ///
    /// # Errors
    /// The journal is of another flight, or of another version of the program.
    pub fn resuming(mut self, journal: Journal) -> Result<Self, String> {
        if journal.quietpath_journal != VERSION {
            return Err(format!("it has version {}, and this program reads {VERSION}", journal.quietpath_journal));
        }
        if journal.flight != self.digest {
            return Err("it is of a flight with another scenario, plan, agent or mode".into());
        }
        let curve = Curve::of(&journal.plan, &self.agent).ok_or("its plan has no path that can be flown")?;
        journal.plan.fits("its plan", &self.world).map_err(|error| error.to_string())?;
        self.picked_up = Some(Box::new((journal, curve)));
        Ok(self)
    }

    /// Says what to keep.
    pub(super) fn keep(&mut self) {
        let agent = self.world.agents.iter().find(|agent| agent.name == self.agent);
        let journal = Journal {
            quietpath_journal: VERSION,
            flight: self.digest.clone(),
            plan: self.flying.plan.clone(),
            made: self.flying.made,
            jam_left: agent.and_then(|agent| agent.jammer).map(|jammer| jammer.budget),
            dropout_left: agent.and_then(|agent| agent.dropout).map(|dropout| dropout.budget),
            is_rest: self.flying.is_rest,
        };
        self.out.push(Output::Keep(Some(Box::new(journal))));
    }

    /// A new plan flies. What is spent before it is spent: its budgets are those of the rest.
    pub(super) fn take_over(&mut self, next: Flying) {
        if let (Some((jammer, dropout)), Some(agent)) = (next.budgets, self.world.agents.first_mut()) {
            (agent.jammer, agent.dropout) = (jammer, dropout);
        }
        self.flying = next;
        self.keep();
    }

    fn set_budgets(&mut self, (jam, dropout): (Option<f64>, Option<f64>)) {
        let Some(agent) = self.world.agents.first_mut() else { return };
        if let (Some(jammer), Some(left)) = (&mut agent.jammer, jam) {
            jammer.budget = left;
        }
        if let (Some(dropout), Some(left)) = (&mut agent.dropout, dropout) {
            dropout.budget = left;
        }
    }

    /// Looks at the vehicle, and goes on, begins anew, or lets go.
    pub(super) fn pick_up(&mut self, vehicle: &Vehicle, since: Time) {
        if self.telemetry.is_lost(self.now) {
            return;
        }
        let is_over = self.now.since(since).as_secs_f64() >= LOOK;
        if vehicle.fix.is_none() && !is_over {
            return;
        }
        let Some(picked) = self.picked_up.take() else { return self.begin_delivery(vehicle) };
        let (journal, curve) = *picked;
        if !vehicle.armed || !Self::is_in_the_air(vehicle) {
            self.say(Level::Info, "the flight before this one is over: beginning anew");
            self.out.push(Output::Keep(None));
            return self.begin_delivery(vehicle);
        }
        if vehicle.mode != self.own_mode() {
            let why =
                format!("in flight, and the mode is {:?}: the bridge does not take the vehicle back", vehicle.mode);
            return self.end(End::Released(why));
        }
        self.set_budgets((journal.jam_left, journal.dropout_left));
        let (made, is_rest) = (journal.made, journal.is_rest);
        self.flying = Flying { plan: journal.plan, curve, made, nodes: Vec::new(), budgets: None, is_rest };
        self.is_resumed = true;
        match self.settings.mode {
            FlyMode::Mission => self.pick_mission_up(vehicle),
            FlyMode::Guided => self.pick_setpoints_up(vehicle),
        }
    }

    fn pick_mission_up(&mut self, vehicle: &Vehicle) {
        let items = match self.items_of(vehicle, &self.flying.plan, self.flying.is_rest) {
            Ok((items, nodes)) => {
                self.flying.nodes = nodes;
                items
            }
            Err(why) => return self.end(End::Failed(why)),
        };
        let talk = self.talk(vehicle.identity, List::Mission);
        let count = u16::try_from(items.len()).unwrap_or(u16::MAX);
        self.watch_over(Watch::new(talk, Delivered { count, opaque_id: 0 }), items);
        self.check = Some(Download::new(talk, self.pace()));
        self.go_on(0.0);
    }

    fn pick_setpoints_up(&mut self, vehicle: &Vehicle) {
        let nearest = self.times().map(|time| {
            let position = self.flying.curve.sample(time).position;
            (self.distance_m(vehicle, &position), time)
        });
        let nearest = nearest.min_by(|a, b| a.0.total_cmp(&b.0));
        match nearest {
            Some((distance, time)) if distance <= NEAR * self.settings.arrival_m => {
                self.go_on(time - self.world.start_time);
            }
            _ => {
                self.phase = Phase::Fly;
                self.give_up("the vehicle is not where the plan is, after the bridge was away".into());
            }
        }
    }

    /// Times of the plan that flies, close to each other.
    fn times(&self) -> impl Iterator<Item = f64> + use<> {
        let (begin, end) = (self.flying.curve.begin(), self.flying.curve.end());
        let count = u32::try_from(self.flying.plan.nodes()).unwrap_or(u32::MAX).saturating_mul(PLACES);
        (0..=count).map(move |place| begin + (end - begin) * f64::from(place) / f64::from(count.max(1)))
    }

    /// The plan goes on, `passed` seconds after its scenario's start.
    fn go_on(&mut self, passed: f64) {
        self.say(Level::Warn, "the plan goes on: the bridge was away in flight, and does not jam any more");
        (self.zero, self.passed) = (Some(self.now), passed);
        // The age of the plan counts on from where it goes on.
        self.flying.made = self.flying.made.min(self.scenario_time());
        self.phase = Phase::Fly;
        self.keep();
    }
}
