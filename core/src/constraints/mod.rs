//! How far a trajectory is from keeping the scenario's constraints.
//!
//! | constraint | measured as | scale |
//! |---|---|---|
//! | `duration` | t_N - T | T |
//! | `start`, `goal` | distance from it | widest side of the domain |
//! | `domain` | farthest coordinate outside | widest side of the domain |
//! | `speed` | \|x_i - x_(i-1)\| / h_i | `speed_max` |
//! | `accel` | change of velocity over the mean of two neighbouring intervals | `accel_max` |
//! | `jam_bounds`, `dropout_bounds` | outside 0 .. 1 | 1 |
//! | `jam_budget`, `dropout_budget` | sum of h_i z_i, h_i theta_i | budget, at least 1 s |
//! | `limit` | metric outside its limits at nodes 1 .. N | the upper limit, else the lower, at least 1e-9 |
//! | `region` | depth of a segment on the wrong side | radius, or scale of the polygon |
//! | `separation` | missing distance between two agents, between nodes too | `separation` |
//!
//! [`violations`] has the largest of each, [`worst_place`] the largest of all with the place where it is; both look at
//! the same figures. Slacks with derivatives, for the planner, are in [`clearance`].
//!
//! A trajectory is feasible when none exceeds [`TOLERANCE`]. What is not a number counts as an infinite violation,
//! and so does an interval that is not longer than zero.
//!
//! Source: (49), (55), (60)-(62), section 4.1. Limits: the start is the scenario's; scratch as in
//! [`crate::objective`].

pub mod budget;
pub mod clearance;
pub mod domain;
pub mod kinematic;
pub mod limit;
pub mod region;
pub mod separation;

mod place;

pub use place::{Constraint, Place, Worst};

use crate::constraints::kinematic::Approach;
use crate::math::{Point, Real, norm};
use crate::metrics::Sample;
use crate::scenario::{Domain, View};
use crate::trajectory::Trajectory;

/// A trajectory is feasible when no violation exceeds this part of its scale.
pub const TOLERANCE: f64 = 1e-4;

/// The largest violation of each constraint, relative to its scale; none is negative.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Violations<T> {
    /// Arrival after `time.max`.
    pub duration: T,
    /// Distance of node 0 from the start.
    pub start: T,
    /// Distance of node N from the goal.
    pub goal: T,
    /// Nodes outside the domain.
    pub domain: T,
    /// Speed above the agent's.
    pub speed: T,
    /// Acceleration above the agent's.
    pub accel: T,
    /// Jamming levels outside 0 to 1.
    pub jam_bounds: T,
    /// Dropout outside 0 to 1.
    pub dropout_bounds: T,
    /// Jamming beyond its budget.
    pub jam_budget: T,
    /// Dropout beyond its budget.
    pub dropout_budget: T,
    /// Metrics outside their limits.
    pub limit: T,
    /// Segments on the wrong side of a region.
    pub region: T,
    /// Agents too close to each other.
    pub separation: T,
}

impl<T: Real> Violations<T> {
    fn slot(&mut self, constraint: Constraint) -> &mut T {
        match constraint {
            Constraint::Duration => &mut self.duration,
            Constraint::Start => &mut self.start,
            Constraint::Goal => &mut self.goal,
            Constraint::Domain => &mut self.domain,
            Constraint::Speed => &mut self.speed,
            Constraint::Accel => &mut self.accel,
            Constraint::JamBounds => &mut self.jam_bounds,
            Constraint::DropoutBounds => &mut self.dropout_bounds,
            Constraint::JamBudget => &mut self.jam_budget,
            Constraint::DropoutBudget => &mut self.dropout_budget,
            Constraint::Limit => &mut self.limit,
            Constraint::Region => &mut self.region,
            Constraint::Separation => &mut self.separation,
        }
    }

    /// The largest violation of a constraint.
    #[must_use]
    pub fn of(&self, constraint: Constraint) -> T {
        *self.clone().slot(constraint)
    }

    /// Names and figures, in the order of the fields.
    pub fn iter(&self) -> impl Iterator<Item = (&'static str, T)> {
        Constraint::ALL.map(|constraint| (constraint.name(), self.of(constraint))).into_iter()
    }

    /// The largest violation and its name; the first of equals.
    #[must_use]
    pub fn worst(&self) -> (&'static str, T) {
        let mut worst = ("duration", self.duration);
        for entry in self.iter() {
            if entry.1 > worst.1 {
                worst = entry;
            }
        }
        worst
    }

    /// Whether no violation exceeds [`TOLERANCE`].
    #[must_use]
    pub fn feasible(&self) -> bool {
        self.worst().1 <= T::real(TOLERANCE)
    }
}

/// Raises `worst` to `found`; to infinity where that is not a number.
fn raise<T: Real>(worst: &mut T, found: T) {
    if found.is_not_a_number() {
        *worst = T::INFINITY;
    } else if found > *worst {
        *worst = found;
    }
}

/// Widest side of the domain, length units.
fn span<T: Real, const DIM: usize>(domain: &Domain<T, DIM>) -> T {
    let sides = domain.max - domain.min;
    sides.iter().fold(T::zero(), |widest, &side| widest.max(side))
}

/// The largest violation of each constraint over all agents.
pub fn violations<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    trajectory: &Trajectory<T, DIM, NODES, AGENTS>,
    scratch: &mut [Sample<T, DIM>],
) -> Violations<T> {
    let mut found = Violations::default();
    survey(scenario, trajectory, scratch, &mut |place| raise(found.slot(place.constraint), place.amount));
    found
}

/// The largest violation of all and where it is; the first of equals, and `None` where nothing is violated.
///
/// Its amount is that of [`Violations::worst`].
pub fn worst_place<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    trajectory: &Trajectory<T, DIM, NODES, AGENTS>,
    scratch: &mut [Sample<T, DIM>],
) -> Option<Place<T>> {
    let mut worst: Option<Place<T>> = None;
    survey(scenario, trajectory, scratch, &mut |place| {
        let worse = match worst {
            Some(worst) if place.amount == worst.amount => (place.constraint as usize) < worst.constraint as usize,
            Some(worst) => place.amount > worst.amount,
            None => place.amount > T::zero(),
        };
        if worse {
            worst = Some(place);
        }
    });
    worst
}

/// Visits the largest violation of every constraint by every agent, of limits and regions each by itself.
fn survey<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    trajectory: &Trajectory<T, DIM, NODES, AGENTS>,
    scratch: &mut [Sample<T, DIM>],
    visit: &mut impl FnMut(Place<T>),
) {
    let nodes = trajectory.nodes();
    let times = trajectory.times.get(..nodes).unwrap_or_default();
    let arrival = times.last().copied().unwrap_or_default();
    let mut late = Worst::none();
    late.raise(nodes - 1, (arrival - scenario.frame.time.max) / scenario.frame.time.max);
    visit(Place { constraint: Constraint::Duration, index: None, agent: 0, node: late.node, amount: late.amount });
    for (agent, track) in trajectory.active().iter().enumerate() {
        let mut at = |constraint, index, worst: Worst<T>| {
            visit(Place { constraint, index, agent, node: worst.node, amount: worst.amount });
        };
        let path = track.path.get(..nodes).unwrap_or_default();
        own_bounds(scenario, trajectory, agent, &mut |constraint, worst| at(constraint, None, worst));
        let limits = limit::excess(scenario, trajectory, agent, scratch);
        for (index, worst) in limits.into_iter().enumerate().take(scenario.limits.len()) {
            at(Constraint::Limit, Some(index), worst);
        }
        for (index, region) in scenario.regions.iter().enumerate() {
            at(Constraint::Region, Some(index), region::excess(region, times, path));
        }
        if let Some(least) = scenario.frame.separation {
            for (other, track) in trajectory.active().iter().enumerate().skip(agent + 1) {
                let theirs = track.path.get(..nodes).unwrap_or_default();
                at(Constraint::Separation, Some(other), separation::excess(least, path, theirs));
            }
        }
    }
}

/// Visits the bounds that an agent has to itself: ends, domain, speed, acceleration, controls.
fn own_bounds<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    trajectory: &Trajectory<T, DIM, NODES, AGENTS>,
    agent: usize,
    visit: &mut impl FnMut(Constraint, Worst<T>),
) {
    let nodes = trajectory.nodes();
    let times = trajectory.times.get(..nodes).unwrap_or_default();
    let (Some(track), Some(agent)) = (trajectory.active().get(agent), scenario.agents.get(agent)) else { return };
    let path = track.path.get(..nodes).unwrap_or_default();
    let span = span(&scenario.frame.domain);
    let off = |node: usize, wanted: &Point<T, DIM>| {
        let mut worst = Worst::none();
        worst.raise(node, path.get(node).map_or(T::INFINITY, |position| norm(&(position - wanted)) / span));
        worst
    };
    visit(Constraint::Start, off(0, &agent.start));
    visit(Constraint::Goal, off(nodes - 1, &agent.goal));
    visit(Constraint::Domain, domain::excess(&scenario.frame.domain, path).relative_to(span));
    visit(Constraint::Speed, kinematic::speed_excess(agent.speed_max, times, path));
    let approach = Approach { velocity: agent.start_velocity, interval: scenario.frame.start_interval };
    visit(Constraint::Accel, kinematic::accel_excess(agent.accel_max, approach, times, path));
    let jam = track.jam.get(..nodes).unwrap_or_default();
    let jam_budget = agent.jammer.map_or(T::zero(), |jammer| jammer.budget);
    visit(Constraint::JamBounds, budget::bounds_excess(jam));
    visit(Constraint::JamBudget, budget::excess(jam_budget, times, jam));
    let dropout = track.dropout.get(..nodes).unwrap_or_default();
    let dropout_budget = agent.dropout.map_or(T::zero(), |dropout| dropout.budget);
    visit(Constraint::DropoutBounds, budget::bounds_excess(dropout));
    visit(Constraint::DropoutBudget, budget::excess(dropout_budget, times, dropout));
}
