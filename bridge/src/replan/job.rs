//! The problem of the rest of the flight, and when its answer may fly.
//!
//! A plan takes time to make, so it is made for a time ahead: the *seam*, the flying plan's first node after `lead` from
//! now. Nodes keep every constraint, which the curve between them need not. The rest of the flight begins there with the
//! position and velocity that the flying plan has then, and drops the nodes that are flown: the tail of the flying plan
//! is a plan of the rest, and where the planner starts from, so its answer is no worse.
//!
//! Limits: one agent.

use quietpath_core::scenario::{Dropout, Jammer};
use serde::{Deserialize, Serialize};

use crate::file::scenario::ScenarioFile;
use crate::file::{PlanFile, plan::AgentPlan};
use crate::setpoint::Curve;

/// Intervals below which the rest is not worth planning anew.
const INTERVALS_MIN: usize = 4;
/// How far a plan may begin from where the flying plan is at the seam, as a share of the way flown in one of its
/// intervals.
const SEAM_TOLERANCE: f64 = 0.05;
/// Relative difference of intervals that are the same.
const EVEN_TOLERANCE: f64 = 1e-6;
/// Budgets below this are none, s.
const BUDGET_MIN: f64 = 1e-9;

/// An agent's jammer and dropout.
pub type Budgets = (Option<Jammer<f64>>, Option<Dropout<f64>>);

/// A problem for the planner.
#[derive(Clone, Debug)]
pub struct Job {
    /// Counts up; an answer names its job.
    pub number: u64,
    /// The rest of the flight.
    pub scenario: ScenarioFile,
    /// The tail of the flying plan.
    pub tail: PlanFile,
    /// When it takes over, s of the scenario.
    pub seam: f64,
}

/// What came out of a job.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Answer {
    /// The job's number.
    pub number: u64,
    /// The plan and whether it is feasible, or why there is none.
    pub result: Result<(PlanFile, bool), String>,
}

/// Why a plan may not fly.
#[derive(Clone, Debug, PartialEq)]
pub enum Rejected {
    /// It is not the answer to the last question.
    Stale,
    /// There is no plan.
    Failed(String),
    /// It breaks a constraint.
    Infeasible,
    /// It holds numbers that are not finite, or has no shape.
    Malformed,
    /// The seam has passed.
    Late,
    /// It does not begin where the vehicle is going to be.
    Elsewhere,
}

impl std::fmt::Display for Rejected {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Stale => f.write_str("it answers an earlier question"),
            Self::Failed(why) => write!(f, "the planner failed: {why}"),
            Self::Infeasible => f.write_str("it breaks a constraint"),
            Self::Malformed => f.write_str("it holds numbers that are not finite"),
            Self::Late => f.write_str("it came after the time at which it was to take over"),
            Self::Elsewhere => f.write_str("it does not begin where the vehicle is going to be"),
        }
    }
}

/// The rest of a flight, from the first node that is not before `earliest`, s of the scenario; `None` where too little is
/// left to plan. `world` is the scenario as it is known now.
#[must_use]
pub fn rest(number: u64, world: &ScenarioFile, flying: &PlanFile, earliest: f64) -> Option<Job> {
    let times = flying.node_times();
    let first = times.iter().position(|time| *time >= earliest)?;
    let (seam, last) = (times.get(first).copied()?, times.last().copied()?);
    let intervals = times.len().checked_sub(first + 1)?;
    let agent_plan = flying.agents.first()?;
    let curve = Curve::of(flying, &agent_plan.name)?;
    let interval = (last - seam) / intervals as f64;
    // Nodes of unequal times are not those of a new plan: the curve between them is.
    let sampled = || (0..=intervals).map(|node| curve.sample(seam + interval * node as f64).position).collect();
    let nodes = || agent_plan.path.iter().skip(first).cloned().collect();
    let mut steps =
        times.windows(2).skip(first).map(|pair| pair.last().zip(pair.first()).map_or(0.0, |(b, a)| b - a));
    let is_even = steps.all(|step| (step - interval).abs() <= EVEN_TOLERANCE * interval);
    let mut path: Vec<Vec<f64>> = if is_even { nodes() } else { sampled() };
    path.first_mut()?.clone_from(agent_plan.path.get(first)?);
    problem(number, world, flying, seam, path)
}

/// The rest of a flight from any time on: for a plan that cannot wait for a node. Its nodes are spread anew over the straight
/// segments of the flying plan, and so keep the bound on speed; where they break another constraint the planner begins from
/// nothing. They are no closer than the scenario's nodes along the whole flight: than those of the flying plan, every plan
/// would have one less than the one before it.
#[must_use]
pub fn rest_at(number: u64, world: &ScenarioFile, flying: &PlanFile, seam: f64) -> Option<Job> {
    let times = flying.node_times();
    let last = times.last().copied()?;
    let interval = (last - world.start_time) / world.intervals as f64;
    // Casts of floats saturate; what is beyond the end has no intervals.
    let intervals = ((last - seam) / interval + EVEN_TOLERANCE) as usize;
    let agent_plan = flying.agents.first()?;
    let curve = Curve::of(flying, &agent_plan.name)?;
    let interval = (last - seam) / intervals as f64;
    let at = |node: usize| straight(&times, &agent_plan.path, seam + interval * node as f64);
    let mut path = (0..=intervals).map(at).collect::<Option<Vec<_>>>()?;
    *path.first_mut()? = curve.sample(seam).position;
    problem(number, world, flying, seam, path)
}

/// What flies from the node before a time on, up to where another plan begins, and that plan; `None` where it does not
/// begin at a node of what flies. Up to the seam the controls are those of what flies.
#[must_use]
pub fn joined(flying: &PlanFile, next: &PlanFile, now: f64) -> Option<PlanFile> {
    let (old, new) = (flying.node_times(), next.node_times());
    let seam = *new.first()?;
    let from = old.iter().rposition(|time| *time < now).unwrap_or(0);
    let until = old.iter().position(|time| (time - seam).abs() < 1e-6).filter(|until| *until >= from)?;
    let times: Vec<f64> = old.iter().take(until + 1).skip(from).chain(new.iter().skip(1)).copied().collect();
    let start_time = *times.first()?;
    let agents = flying.agents.iter().zip(&next.agents).map(|(old, new)| AgentPlan {
        name: new.name.clone(),
        path: old.path.iter().take(until + 1).skip(from).chain(new.path.iter().skip(1)).cloned().collect(),
        jam: chained(&old.jam, &new.jam, (from, until), (old.path.len(), new.path.len())),
        azimuth: chained(&old.azimuth, &new.azimuth, (from, until), (old.path.len(), new.path.len())),
        dropout: chained(&old.dropout, &new.dropout, (from, until), (old.path.len(), new.path.len())),
    });
    let duration = times.last()? - start_time;
    let agents = agents.collect();
    Some(PlanFile {
        scenario: next.scenario.clone(),
        start_time,
        duration,
        times: Some(times),
        agents,
        ..PlanFile::default()
    })
}

/// A control of what flies at the nodes from one to another, then that of another plan behind its first node.
fn chained(
    old: &Option<Vec<f64>>,
    new: &Option<Vec<f64>>,
    (from, until): (usize, usize),
    (old_nodes, new_nodes): (usize, usize),
) -> Option<Vec<f64>> {
    if old.is_none() && new.is_none() {
        return None;
    }
    let whole = |values: &Option<Vec<f64>>, nodes| values.clone().unwrap_or_else(|| vec![0.0; nodes]);
    let (old, new) = (whole(old, old_nodes), whole(new, new_nodes));
    Some(old.into_iter().take(until + 1).skip(from).chain(new.into_iter().skip(1)).collect())
}

/// The jammer and dropout of a scenario's agent with what is left of their budgets at a time of the plan that flies.
#[must_use]
pub fn budgets_at(world: &ScenarioFile, flying: &PlanFile, time: f64) -> Option<Budgets> {
    let (times, agent, plan) = (flying.node_times(), world.agents.first()?, flying.agents.first()?);
    let jammer = agent
        .jammer
        .map(|jammer| Jammer { budget: left(jammer.budget, &times, plan.jam.as_deref(), time), ..jammer });
    let dropout =
        agent.dropout.map(|dropout| Dropout { budget: left(dropout.budget, &times, plan.dropout.as_deref(), time) });
    Some((jammer, dropout))
}

/// Where straight segments between nodes are at a time.
fn straight(times: &[f64], path: &[Vec<f64>], time: f64) -> Option<Vec<f64>> {
    let after = times.iter().position(|node| *node >= time).unwrap_or(times.len().checked_sub(1)?).max(1);
    let (from, to) = (times.get(after - 1)?, times.get(after)?);
    let share = ((time - from) / (to - from)).clamp(0.0, 1.0);
    let ends = path.get(after - 1)?.iter().zip(path.get(after)?);
    Some(ends.map(|(a, b)| a + share * (b - a)).collect())
}

/// The problem of the rest from a seam on, with the nodes of what flies until the end.
fn problem(number: u64, world: &ScenarioFile, flying: &PlanFile, seam: f64, mut path: Vec<Vec<f64>>) -> Option<Job> {
    let times = flying.node_times();
    let intervals = path.len().checked_sub(1).filter(|intervals| *intervals >= INTERVALS_MIN)?;
    let duration = times.last()? - seam;
    let interval = duration / intervals as f64;
    let agent_plan = flying.agents.first()?;
    let mut scenario = world.clone();
    scenario.start_time = seam;
    scenario.intervals = intervals;
    let agent = scenario.agents.first_mut()?;
    agent.start.clone_from(path.first()?);
    agent.start_velocity = Some(Curve::of(flying, &agent_plan.name)?.sample(seam).velocity);
    path.last_mut()?.clone_from(&agent.goal);
    (agent.jammer, agent.dropout) = budgets_at(world, flying, seam)?;
    let control = |values: &Option<Vec<f64>>, budget: f64| {
        let values = values.as_ref()?;
        Some(fit(resampled(&times, values, seam, interval, intervals), interval, budget))
    };
    let jam = control(&agent_plan.jam, agent.jammer.map_or(0.0, |jammer| jammer.budget));
    let dropout = control(&agent_plan.dropout, agent.dropout.map_or(0.0, |dropout| dropout.budget));
    let azimuth = agent_plan.azimuth.as_ref().map(|values| resampled(&times, values, seam, interval, intervals));
    let agents = vec![AgentPlan { name: agent_plan.name.clone(), path, jam, azimuth, dropout }];
    let tail =
        PlanFile { scenario: flying.scenario.clone(), start_time: seam, duration, agents, ..PlanFile::default() };
    Some(Job { number, scenario, tail, seam })
}

/// A control at the nodes of the rest.
fn resampled(times: &[f64], values: &[f64], seam: f64, interval: f64, intervals: usize) -> Vec<f64> {
    (0..=intervals).map(|node| step_value(times, values, seam + interval * node as f64)).collect()
}

/// A control lowered to its budget, which nodes at other times may exceed.
fn fit(control: Vec<f64>, interval: f64, budget: f64) -> Vec<f64> {
    let spent = interval * control.iter().skip(1).sum::<f64>();
    // Rounding is not worth a change.
    let share = if spent > budget * (1.0 + EVEN_TOLERANCE) { budget / spent } else { 1.0 };
    control.into_iter().map(|value| value * share).collect()
}

/// The value of a control at a time: that of the node at the end of the interval, as the integrals count it.
#[must_use]
pub fn step_value(times: &[f64], values: &[f64], time: f64) -> f64 {
    let node = times.iter().position(|node| *node >= time).unwrap_or(values.len().saturating_sub(1));
    values.get(node).copied().unwrap_or_default()
}

/// What is left of a budget at the seam.
fn left(budget: f64, times: &[f64], values: Option<&[f64]>, seam: f64) -> f64 {
    let spent: f64 = (times.iter().zip(times.iter().skip(1)))
        .zip(values.unwrap_or_default().iter().skip(1))
        .map(|((from, to), value)| (to.min(seam) - from).max(0.0) * value)
        .sum();
    let left = (budget - spent).max(0.0);
    if left < BUDGET_MIN { 0.0 } else { left }
}

/// The curve of a plan that may fly.
///
/// # Errors
/// Why it may not. The flying plan goes on.
pub fn judge(asked: &Job, answer: &Answer, now: f64, flying: &Curve) -> Result<(PlanFile, Curve), Rejected> {
    if answer.number != asked.number {
        return Err(Rejected::Stale);
    }
    let (plan, feasible) = answer.result.as_ref().map_err(|why| Rejected::Failed(why.clone()))?;
    let agent = plan.agents.first().ok_or(Rejected::Malformed)?;
    let controls = [&agent.jam, &agent.azimuth, &agent.dropout];
    if !controls.into_iter().flatten().flatten().all(|number| number.is_finite()) {
        return Err(Rejected::Malformed);
    }
    let here = flying.sample(asked.seam);
    // It takes over with the velocity that the flying plan has: the setpoints do not jump.
    let curve = Curve::of(plan, &agent.name).ok_or(Rejected::Malformed)?.from_velocity(&here.velocity);
    if !feasible {
        return Err(Rejected::Infeasible);
    }
    if now > asked.seam {
        return Err(Rejected::Late);
    }
    let there = curve.sample(asked.seam);
    let start = asked.scenario.agents.first().map(|agent| agent.start.as_slice()).unwrap_or_default();
    let far = |from: &[f64]| from.iter().zip(&there.position).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
    let interval = (curve.end() - curve.begin()) / plan.nodes().max(2) as f64;
    let speed = asked.scenario.agents.first().map_or(0.0, |agent| agent.speed_max);
    let is_here = far(start) <= SEAM_TOLERANCE * speed * interval && there.position.len() == here.position.len();
    if is_here && (curve.begin() - asked.seam).abs() < 1e-6 {
        Ok((plan.clone(), curve))
    } else {
        Err(Rejected::Elsewhere)
    }
}
