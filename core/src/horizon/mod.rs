//! The rolling horizon: a flight that is planned anew, step by step, as more of the world is seen.
//!
//! A step plans the rest of the flight in the world as it is seen at its beginning; the first intervals of that plan are
//! flown, and the next step begins where they end. [`Horizon`] keeps what one step leaves to the next: where the agents
//! are, how fast, what is left of their budgets, and the *tail*, the part of the plan that is not flown yet.
//!
//! | symbol | name | unit |
//! |---|---|---|
//! | T_i, C_i | begin of step i, and the end of what is flown of its plan | s |
//! | h_0, h | interval flown last, and first interval of the next plan | s |
//! | v_0, v_1 | velocities on them | length unit / s |
//!
//! - Steps drop the nodes that were flown and keep the interval, so that the tail is a plan of the rest as it stands. It
//!   is where a step starts from, and what stays in force if the step finds nothing better: a flight is feasible from
//!   beginning to end wherever its first plan is and the world does not close the way.
//! - The tail is as good a start as its world has not changed. So a step refines it: as it is where it is clear of regions and
//!   limits and the settings allow a refinement of its own, and after a few projected-gradient iterations, [`NEAR_ITERATIONS`],
//!   otherwise. Either costs a small part of the first step; where no feasible plan is found, it takes as many as the settings
//!   allow, and then searches everywhere.
//! - Each step may choose another flight time, and so another interval. At the seam, the change of velocity counts over
//!   the mean of the intervals on both sides: |v_1 - v_0| <= a (h_0 + h) / 2, as everywhere in the path that was flown.
//! - Budgets are those of the whole flight; what was flown is taken off them.
//! - The objective of a step is that of the scenario it is given, which may be another one each time.
//! - Time is an argument and nothing waits: a caller plans when it sees fit, with the sensors it sees.
//!
//! ```text
//! Horizon::new -> replan -> fly | resume -> replan -> fly ..
//! ```
//!
//! Source: section 3.5, Remark 3.3. Limits: nodes are not refilled, so that the last steps plan with few; a step with
//! fewer than two intervals left keeps its plan.

mod cadence;
mod outlook;
mod reveal;

pub use cadence::Cadence;
pub use reveal::{Reveal, reveal};

use heapless::Vec;

use crate::constraints::violations;
use crate::error::{Error, Fault, Item};
use crate::math::{Point, Real};
use crate::metrics::Sample;
use crate::objective::{self, Extreme};
use crate::scenario::{Agent, View};
use crate::solver::{self, Outcome, Settings, Start, Status, Workspace};
use crate::trajectory::Trajectory;

use outlook::Outlook;

/// Projected-gradient iterations of a step before its plan is refined, where it has to bring the tail clear of what came too
/// near; a tail that is clear is refined as it is.
pub const NEAR_ITERATIONS: usize = 4;
/// Part of a budget below which what is left of it counts as nothing, or as many rounding units if they are more.
const NOTHING_LEFT: f64 = 1e-9;
const ROUNDING_UNITS: f64 = 64.0;

/// Where a step looks for a plan.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Search {
    /// Near the tail; everywhere if nothing feasible is found there.
    #[default]
    Tail,
    /// Near the tail and everywhere, the better of the two.
    Anew,
}

/// Which plan is in force after a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Choice {
    /// The one that the step found.
    New,
    /// The tail, because nothing feasible and better was found.
    Tail,
}

/// What a step did; the plan in force is [`Horizon::tail`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step<T, const DIM: usize> {
    /// Begin of the step, s.
    pub time: T,
    /// Which plan is in force now.
    pub choice: Choice,
    /// Whether it is feasible in the world as seen. A tail may not be: the world may have closed its way.
    pub feasible: bool,
    /// How much the world looks different along the tail than it did at the step before: the mean change of what the
    /// objective integrates, over the span of its values along the first plan; 0 at the first step. See [`Cadence`].
    pub change: T,
    /// What the planner did: its last status, the objective of the rest of the plan in force in the world as seen, and
    /// all counts together.
    pub outcome: Outcome<T, DIM>,
}

/// Where an agent was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct State<T, const DIM: usize> {
    /// Position, length units.
    pub position: Point<T, DIM>,
    /// Velocity, length units per s.
    pub velocity: Point<T, DIM>,
}

/// What was taken of an agent's budgets, s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Spent<T> {
    /// Integral of the jamming level.
    pub jam: T,
    /// Integral of the power reduction.
    pub dropout: T,
}

/// How an agent came to where it is.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Past<T, const DIM: usize> {
    velocity: Option<Point<T, DIM>>,
    spent: Spent<T>,
}

/// A flight that is planned in steps.
#[derive(Clone, Debug)]
pub struct Horizon<T, const DIM: usize, const NODES: usize, const AGENTS: usize> {
    tail: Trajectory<T, DIM, NODES, AGENTS>,
    flown: Trajectory<T, DIM, NODES, AGENTS>,
    past: [Past<T, DIM>; AGENTS],
    /// h_0, where the start of the tail is a seam.
    interval: Option<T>,
    outlook: Outlook<T, NODES, AGENTS>,
    is_planned: bool,
}

impl<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize> Horizon<T, DIM, NODES, AGENTS> {
    /// A flight at its beginning: agents stand at their starts, and the tail is the straight line until
    /// [`Horizon::replan`] makes a plan.
    ///
    /// # Errors
    /// `grid.intervals` or `agent` where the scenario exceeds the capacities.
    pub fn new(mission: &View<'_, T, DIM>) -> Result<Self, Error> {
        let allowed = mission.frame.time.max - mission.frame.start_time;
        let tail = Trajectory::straight(mission, allowed)?;
        let mut past = [Past { velocity: None, spent: Spent { jam: T::zero(), dropout: T::zero() } }; AGENTS];
        for (past, agent) in past.iter_mut().zip(mission.agents) {
            past.velocity = agent.start_velocity;
        }
        let mut flown = tail.clone();
        flown.resize(0, mission.agents.len())?;
        Ok(Self { tail, flown, past, interval: None, outlook: Outlook::empty(), is_planned: false })
    }

    /// The plan in force, from where the agents are to their goals. Its node 0 is the last that was flown.
    #[must_use]
    pub const fn tail(&self) -> &Trajectory<T, DIM, NODES, AGENTS> {
        &self.tail
    }

    /// What was flown so far, from the start on; its intervals need not be equal.
    #[must_use]
    pub const fn flown(&self) -> &Trajectory<T, DIM, NODES, AGENTS> {
        &self.flown
    }

    /// What was taken of an agent's budgets; nothing for an agent that does not exist.
    #[must_use]
    pub fn spent(&self, agent: usize) -> Spent<T> {
        let nothing = Spent { jam: T::zero(), dropout: T::zero() };
        self.past.get(agent).map_or(nothing, |past| past.spent)
    }

    /// Whether the agents have arrived.
    #[must_use]
    pub const fn has_arrived(&self) -> bool {
        self.tail.intervals() == 0
    }

    /// Plans the rest of the flight in the world as it is seen now. What is found comes into force if it is feasible and
    /// better than the tail, or feasible where the tail is not; otherwise the tail stays.
    ///
    /// `seen` has the agents of the mission, with the budgets of the whole flight; their starts, the start time and the
    /// number of intervals are the horizon's own. Sensors, regions, limits and objective may differ from step to step.
    /// `deadline` is asked as in [`solver::plan`].
    ///
    /// # Errors
    /// Where `seen` has another number of agents, or more sensors than the workspace; where the first step has a start
    /// velocity that cannot be followed. The tail stays in force.
    pub fn replan<const SENSORS: usize>(
        &mut self,
        seen: &View<'_, T, DIM>,
        settings: &Settings<T>,
        search: Search,
        workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
        deadline: &mut dyn FnMut() -> bool,
    ) -> Result<Step<T, DIM>, Error> {
        let agents = self.agents_now(seen)?;
        self.clear_empty_budgets(&agents);
        let rest = self.rest(seen, &agents);
        let need = ranging_needed(&rest);
        if let (false, Some(error)) = (self.is_planned, need) {
            return Err(error);
        }
        let change = self.outlook.change(&rest, &self.tail, workspace.parts().1);
        let mut now = Worth::of(&rest, &self.tail, workspace.parts().1);
        let mut outcome = nothing_done(&now, need);
        let mut choice = Choice::Tail;
        let is_fixed = self.is_planned && (need.is_some() || self.tail.intervals() < 2 || is_overdue(&rest));
        for reach in Reach::ALL {
            if is_fixed || !self.is_wanted(reach, search, &now, &outcome) {
                continue;
            }
            let start = if reach == Reach::Everywhere { Start::Global } else { Start::Given(&self.tail) };
            match solver::plan(&rest, &reach.settings(settings), start, workspace, deadline) {
                Ok(done) => {
                    add(&mut outcome, &done);
                    let (best, scratch) = workspace.parts();
                    let found = Worth::of(&rest, best, scratch);
                    if found.beats(&now) || !self.is_planned {
                        self.tail.clone_from(best);
                        (now, choice, self.is_planned) = (found, Choice::New, true);
                    }
                }
                // The straight line may not be able to follow the velocity; the tail does.
                Err(error) if error.fault == Fault::StartVelocity && self.is_planned => {}
                Err(error) => return Err(error),
            }
        }
        outcome.objective = now.objective;
        if now.feasible {
            outcome.obstacle = None;
        } else {
            outcome.status = Status::Infeasible;
        }
        self.outlook.take(&rest, &self.tail, workspace.parts().1);
        Ok(Step { time: rest.frame.start_time, choice, feasible: now.feasible, change, outcome })
    }

    /// Whether a step has to look so far, after what it has found and done so far.
    fn is_wanted(&self, reach: Reach, search: Search, now: &Worth<T>, done: &Outcome<T, DIM>) -> bool {
        match reach {
            Reach::Near => self.is_planned,
            // Nothing feasible there, or what cannot be refined and was not finished.
            Reach::Around => {
                let is_unfinished = done.refinements == 0 && done.status == Status::IterationLimit;
                self.is_planned && (!now.feasible || is_unfinished)
            }
            Reach::Everywhere => !self.is_planned || search == Search::Anew || !now.feasible,
        }
    }

    /// Flies the next `intervals` of the plan in force, or those that are left; returns how many.
    pub fn fly(&mut self, intervals: usize) -> usize {
        let count = intervals.min(self.tail.intervals());
        for node in 1..=count {
            // A record that is full stops growing.
            let _ = self.flown.append(&self.tail, node);
            self.spend(node, self.tail.interval(node));
        }
        if count > 0 {
            let interval = self.tail.interval(count);
            for (past, track) in self.past.iter_mut().zip(self.tail.active()) {
                let ends = (track.path.get(count - 1), track.path.get(count));
                past.velocity = if let (Some(from), Some(to)) = ends { Some((to - from) / interval) } else { None };
            }
            self.interval = Some(interval);
            self.tail.advance(count);
            self.outlook.advance(count);
        }
        count
    }

    /// Goes on from where the agents were found at `time` (s), one state an agent, instead of where the plan has them.
    ///
    /// Intervals that end by then are flown, the running one in part; the last is never flown whole. The rest of the tail
    /// is bent to begin at the states, with equal intervals to the same arrival, or as long as planned where that has
    /// passed. It may not be feasible until the next [`Horizon::replan`]: that begins by projecting it on the bounds.
    ///
    /// # Errors
    /// Another number of states than of agents; a state or time that is not finite. Nothing is changed then.
    pub fn resume(&mut self, time: T, states: &[State<T, DIM>]) -> Result<(), Error> {
        count_agents(states.len(), self.tail.agents())?;
        let is_finite = |state: &State<T, DIM>| {
            state.position.iter().chain(state.velocity.iter()).all(|component| component.finite())
        };
        if !time.finite() {
            return Err(Error::new(Item::Scenario, "start_time", Fault::NotFinite));
        }
        if let Some(agent) = states.iter().position(|state| !is_finite(state)) {
            return Err(Error::new(Item::Agent(agent), "start", Fault::NotFinite));
        }
        let planned = self.tail.times.iter().take(self.tail.nodes()).skip(1);
        let passed = planned.take_while(|&&planned| planned <= time).count();
        self.fly(passed.min(self.tail.intervals().saturating_sub(1)));
        if self.has_arrived() {
            return Ok(());
        }
        let running = time - self.tail.start_time();
        let rest = self.tail.start_time() + self.tail.duration() - time;
        let duration = if rest > T::zero() { rest } else { self.tail.duration() };
        self.bend(states);
        if running > T::zero() {
            self.spend(1, running);
            self.tail.set_duration(time, duration);
            let _ = self.flown.append(&self.tail, 0);
        } else {
            self.tail.set_duration(time, duration);
            let last = self.flown.intervals();
            for (track, state) in self.flown.active_mut().iter_mut().zip(states) {
                track.path.iter_mut().skip(last).take(1).for_each(|position| *position = state.position);
            }
        }
        self.interval = None;
        Ok(())
    }

    /// Moves the tail to begin at the states, its nodes less and less towards the goal.
    fn bend(&mut self, states: &[State<T, DIM>]) {
        let nodes = self.tail.nodes();
        let count = T::from_count(self.tail.intervals().max(1));
        let tracks = self.tail.active_mut().iter_mut().zip(&mut self.past).zip(states);
        for ((track, past), state) in tracks {
            past.velocity = Some(state.velocity);
            let off = track.path.first().map_or_else(Point::zeros, |planned| state.position - planned);
            for (node, position) in track.path.iter_mut().enumerate().take(nodes - 1) {
                *position += off * (T::one() - T::from_count(node) / count);
            }
            for control in [&mut track.jam, &mut track.dropout] {
                if let [first, second, ..] = control.as_mut_slice() {
                    *first = *second;
                }
            }
        }
    }

    /// Takes `seconds` at the controls of a node off the budgets.
    fn spend(&mut self, node: usize, seconds: T) {
        for (past, track) in self.past.iter_mut().zip(self.tail.active()) {
            past.spent.jam += seconds * track.jam.get(node).copied().unwrap_or_default();
            past.spent.dropout += seconds * track.dropout.get(node).copied().unwrap_or_default();
        }
    }

    /// The agents as the rest of the flight has them: where they are, how fast, and with what is left of their budgets.
    fn agents_now(&self, seen: &View<'_, T, DIM>) -> Result<Vec<Agent<T, DIM>, AGENTS>, Error> {
        count_agents(seen.agents.len(), self.tail.agents())?;
        let mut agents = Vec::new();
        for ((agent, past), track) in seen.agents.iter().zip(&self.past).zip(self.tail.active()) {
            let mut now = *agent;
            now.start = track.path.first().copied().unwrap_or(agent.start);
            now.start_velocity = past.velocity;
            now.jammer = agent.jammer.and_then(|mut jammer| {
                jammer.budget = left(jammer.budget, past.spent.jam)?;
                Some(jammer)
            });
            now.dropout = agent.dropout.and_then(|mut dropout| {
                dropout.budget = left(dropout.budget, past.spent.dropout)?;
                Some(dropout)
            });
            // As many as the tail has, so that there is room.
            let _ = agents.push(now);
        }
        Ok(agents)
    }

    /// Switches off for good what has no budget left: what rounding may have left of it in the tail.
    fn clear_empty_budgets(&mut self, agents: &[Agent<T, DIM>]) {
        for (track, agent) in self.tail.active_mut().iter_mut().zip(agents) {
            if agent.jammer.is_none() {
                track.jam.fill(T::zero());
            }
            if agent.dropout.is_none() {
                track.dropout.fill(T::zero());
            }
        }
    }

    /// The problem that is left.
    fn rest<'a>(&self, seen: &View<'a, T, DIM>, agents: &'a [Agent<T, DIM>]) -> View<'a, T, DIM> {
        let mut frame = seen.frame;
        frame.intervals = self.tail.intervals();
        frame.start_time = self.tail.start_time();
        frame.start_interval = self.interval;
        View { frame, agents, ..*seen }
    }
}

/// How far a step looks for a plan, in the order of trying.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Reach {
    /// From the tail, with few iterations.
    Near,
    /// From the tail, with as many as it takes.
    Around,
    /// From everywhere.
    Everywhere,
}

impl Reach {
    const ALL: [Self; 3] = [Self::Near, Self::Around, Self::Everywhere];

    fn settings<T: Real>(self, given: &Settings<T>) -> Settings<T> {
        let iterations = if self == Self::Near { given.iterations.min(NEAR_ITERATIONS) } else { given.iterations };
        Settings { iterations, ..*given }
    }
}

/// What a plan is worth in the world as seen.
struct Worth<T> {
    objective: T,
    feasible: bool,
}

impl<T: Real> Worth<T> {
    fn of<const DIM: usize, const NODES: usize, const AGENTS: usize>(
        scenario: &View<'_, T, DIM>,
        plan: &Trajectory<T, DIM, NODES, AGENTS>,
        scratch: &mut [Sample<T, DIM>],
    ) -> Self {
        let objective = objective::value(scenario, plan, Extreme::Exact, scratch);
        Self { objective, feasible: violations(scenario, plan, scratch).feasible() }
    }

    fn beats(&self, other: &Self) -> bool {
        let is_better = other.objective.is_not_a_number() || self.objective < other.objective;
        self.feasible && self.objective.finite() && (is_better || !other.feasible)
    }
}

/// What is left of a budget, s; `None` where that is nothing but rounding.
fn left<T: Real>(budget: T, spent: T) -> Option<T> {
    let nothing = budget * T::real(NOTHING_LEFT).max(T::EPSILON * T::real(ROUNDING_UNITS));
    Some(budget - spent).filter(|&left| left > nothing)
}

/// Refuses a list that does not have one entry an agent.
fn count_agents(count: usize, agents: usize) -> Result<(), Error> {
    match count {
        few if few < agents => Err(Error::new(Item::Scenario, "agent", Fault::TooFew { count, need: agents })),
        many if many > agents => Err(Error::new(Item::Scenario, "agent", Fault::TooMany { count, capacity: agents })),
        _ => Ok(()),
    }
}

/// The first term or limit that asks for a location error which too few sensors are seen for.
fn ranging_needed<T: Real, const DIM: usize>(seen: &View<'_, T, DIM>) -> Option<Error> {
    let have = seen.sensors.iter().filter(|sensor| sensor.ranging.is_some()).count();
    let terms = seen.terms.iter().enumerate().map(|(index, term)| (Item::Term(index), term.metric));
    let limits = seen.limits.iter().enumerate().map(|(index, limit)| (Item::Limit(index), limit.metric));
    let (item, _) = terms.chain(limits).find(|(_, metric)| metric.is_location_error() && have <= DIM)?;
    Some(Error::new(item, "metric", Fault::TooFewRanging { have, need: DIM + 1 }))
}

/// Whether there is no time left to plan in.
fn is_overdue<T: Real, const DIM: usize>(rest: &View<'_, T, DIM>) -> bool {
    rest.frame.time.max - rest.frame.start_time <= rest.frame.time.max.abs() * T::EPSILON
}

/// The outcome of a step in which nothing was planned.
fn nothing_done<T: Real, const DIM: usize>(tail: &Worth<T>, need: Option<Error>) -> Outcome<T, DIM> {
    Outcome {
        status: if need.is_some() { Status::NonFinite } else { Status::Converged },
        obstacle: None,
        objective: tail.objective,
        iterations: 0,
        refinements: 0,
        factorizations: 0,
        evaluations: 1,
        projection_steps: 0,
    }
}

/// Adds the counts of another call of the planner; its status is the last.
fn add<T: Real, const DIM: usize>(sum: &mut Outcome<T, DIM>, done: &Outcome<T, DIM>) {
    (sum.status, sum.obstacle) = (done.status, done.obstacle);
    sum.iterations += done.iterations;
    sum.refinements += done.refinements;
    sum.factorizations += done.factorizations;
    sum.evaluations += done.evaluations;
    sum.projection_steps += done.projection_steps;
}
