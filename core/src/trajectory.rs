//! Paths and controls of all agents on one time grid: what the planner decides.
//!
//! | symbol | name | unit | shape |
//! |---|---|---|---|
//! | t_i | `times` | s | N + 1 |
//! | x_i | `path` | scenario length unit | N + 1 points an agent |
//! | z_i | `jam` | 0 .. 1 | N + 1 an agent |
//! | alpha_i | `azimuth` | rad, counter-clockwise from east | N + 1 an agent |
//! | theta_i | `dropout` | 0 .. 1, 1 is silence | N + 1 an agent |
//!
//! The planner keeps the intervals equal (section 4.1); a path flown in steps may have unequal ones.
//! A gradient has the same shape, each entry the derivative by its namesake.
//!
//! Limits: `NODES` holds N + 1 nodes, `AGENTS` agents.

use core::cell::Cell;

use crate::error::{Error, Fault, Item};
use crate::math::{Point, Real, origin};
use crate::scenario::View;

/// One agent's path and controls; entries past the last node are zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Track<T, const DIM: usize, const NODES: usize> {
    /// Positions x_i, length units.
    pub path: [Point<T, DIM>; NODES],
    /// Jamming levels z_i, 0 to 1.
    pub jam: [T; NODES],
    /// Jamming directions alpha_i, rad.
    pub azimuth: [T; NODES],
    /// Reductions of transmit power theta_i, 0 to 1; 1 is silence.
    pub dropout: [T; NODES],
}

impl<T: Real, const DIM: usize, const NODES: usize> Track<T, DIM, NODES> {
    /// All zeros.
    #[must_use]
    pub const fn zeros() -> Self {
        let zero = [T::ZERO; NODES];
        Self { path: [origin(); NODES], jam: zero, azimuth: zero, dropout: zero }
    }
}

/// Paths and controls of all agents, or a derivative by them.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory<T, const DIM: usize, const NODES: usize, const AGENTS: usize> {
    intervals: usize,
    agents: usize,
    /// Node times t_i, s.
    pub times: [T; NODES],
    /// One track an agent; past the last agent they are zero.
    pub tracks: [Track<T, DIM, NODES>; AGENTS],
}

impl<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize> Trajectory<T, DIM, NODES, AGENTS> {
    /// All zeros, on no interval.
    #[must_use]
    pub const fn empty() -> Self {
        Self { intervals: 0, agents: 0, times: [T::ZERO; NODES], tracks: [Track::zeros(); AGENTS] }
    }

    /// All zeros, of the given size.
    ///
    /// # Errors
    /// `grid.intervals` or `agent` where they exceed the capacities.
    pub fn zeros(intervals: usize, agents: usize) -> Result<Self, Error> {
        let mut zeros = Self::empty();
        zeros.resize(intervals, agents)?;
        Ok(zeros)
    }

    /// Becomes a copy of another, of the part that is used: capacities may be much larger than the problem.
    pub(crate) fn assign(&mut self, from: &Self) {
        (self.intervals, self.agents) = (from.intervals, from.agents);
        let nodes = self.nodes();
        copy_used(&from.times, &mut self.times, nodes);
        for (mine, theirs) in self.active_mut().iter_mut().zip(from.active()) {
            copy_used(&theirs.path, &mut mine.path, nodes);
            copy_used(&theirs.jam, &mut mine.jam, nodes);
            copy_used(&theirs.azimuth, &mut mine.azimuth, nodes);
            copy_used(&theirs.dropout, &mut mine.dropout, nodes);
        }
    }

    /// Sets the number of intervals and of agents; entries keep their values.
    ///
    /// # Errors
    /// `grid.intervals` or `agent` where they exceed the capacities.
    pub fn resize(&mut self, intervals: usize, agents: usize) -> Result<(), Error> {
        if intervals >= NODES {
            let fault = Fault::TooMany { count: intervals, capacity: NODES.saturating_sub(1) };
            return Err(Error::new(Item::Scenario, "grid.intervals", fault));
        }
        if agents > AGENTS {
            let fault = Fault::TooMany { count: agents, capacity: AGENTS };
            return Err(Error::new(Item::Scenario, "agent", fault));
        }
        self.intervals = intervals;
        self.agents = agents;
        Ok(())
    }

    /// Straight lines from start to goal at constant speed, without jamming or dropout.
    ///
    /// # Errors
    /// `grid.intervals` or `agent` where the scenario exceeds the capacities.
    pub fn straight(scenario: &View<'_, T, DIM>, duration: T) -> Result<Self, Error> {
        let mut straight = Self::empty();
        straight.lay_straight(scenario, duration)?;
        Ok(straight)
    }

    /// Becomes [`Trajectory::straight`], where it is: handed over, a trajectory of large capacities is copied from stack to stack
    /// on its way.
    ///
    /// # Errors
    /// As there.
    pub(crate) fn lay_straight(&mut self, scenario: &View<'_, T, DIM>, duration: T) -> Result<(), Error> {
        let intervals = scenario.frame.intervals;
        self.resize(intervals, scenario.agents.len())?;
        self.set_duration(scenario.frame.start_time, duration);
        for (track, agent) in self.tracks.iter_mut().zip(scenario.agents) {
            for controls in [&mut track.jam, &mut track.azimuth, &mut track.dropout] {
                controls.iter_mut().take(intervals + 1).for_each(|control| *control = T::zero());
            }
            for (node, position) in track.path.iter_mut().enumerate().take(intervals + 1) {
                let share = T::from_count(node) / T::from_count(intervals);
                *position = agent.start + (agent.goal - agent.start) * share;
            }
            if let Some(goal) = track.path.get_mut(intervals) {
                *goal = agent.goal;
            }
        }
        Ok(())
    }

    /// Intervals N.
    #[must_use]
    pub const fn intervals(&self) -> usize {
        self.intervals
    }

    /// Nodes, N + 1.
    #[must_use]
    pub const fn nodes(&self) -> usize {
        self.intervals + 1
    }

    /// Number of agents.
    #[must_use]
    pub const fn agents(&self) -> usize {
        self.agents
    }

    /// Time at node 0, s.
    #[must_use]
    pub fn start_time(&self) -> T {
        self.times.first().copied().unwrap_or_default()
    }

    /// Flight time tau, s.
    #[must_use]
    pub fn duration(&self) -> T {
        self.times.get(self.intervals).copied().unwrap_or_default() - self.start_time()
    }

    /// The interval that ends at a node, s; 0 where there is none.
    #[must_use]
    pub fn interval(&self, node: usize) -> T {
        let time = |node: usize| self.times.get(node).copied().unwrap_or_default();
        if node == 0 || node > self.intervals { T::zero() } else { time(node) - time(node - 1) }
    }

    /// Takes the first `count` intervals off, or all there are: node `count` becomes node 0.
    pub fn advance(&mut self, count: usize) {
        let count = count.min(self.intervals);
        let left = self.intervals - count;
        drop_front(&mut self.times, count, left, T::zero());
        for track in self.active_mut() {
            drop_front(&mut track.path, count, left, Point::zeros());
            for control in [&mut track.jam, &mut track.azimuth, &mut track.dropout] {
                drop_front(control, count, left, T::zero());
            }
        }
        self.intervals = left;
    }

    /// Appends a node of another trajectory.
    ///
    /// # Errors
    /// `grid.intervals` where there is no room.
    pub fn append(&mut self, other: &Self, node: usize) -> Result<(), Error> {
        let end = self.nodes();
        self.resize(end, self.agents)?;
        copy_entry(&other.times, node, &mut self.times, end);
        for (track, theirs) in self.active_mut().iter_mut().zip(other.active()) {
            copy_entry(&theirs.path, node, &mut track.path, end);
            copy_entry(&theirs.jam, node, &mut track.jam, end);
            copy_entry(&theirs.azimuth, node, &mut track.azimuth, end);
            copy_entry(&theirs.dropout, node, &mut track.dropout, end);
        }
        Ok(())
    }

    /// Lays N equal intervals over `duration` seconds from `start_time`.
    pub fn set_duration(&mut self, start_time: T, duration: T) {
        let nodes = self.nodes();
        let interval = duration / T::from_count(self.intervals.max(1));
        for (node, time) in self.times.iter_mut().enumerate().take(nodes) {
            *time = start_time + interval * T::from_count(node);
        }
    }

    /// The tracks of the agents there are.
    #[must_use]
    pub fn active(&self) -> &[Track<T, DIM, NODES>] {
        self.tracks.get(..self.agents).unwrap_or_default()
    }

    /// The tracks of the agents there are, to change.
    pub fn active_mut(&mut self) -> &mut [Track<T, DIM, NODES>] {
        let agents = self.agents.min(AGENTS);
        self.tracks.get_mut(..agents).unwrap_or_default()
    }
}

/// Moves entries `count` .. `count + left` to the front, and clears those behind them.
fn drop_front<V: Copy>(list: &mut [V], count: usize, left: usize, nothing: V) {
    shift(list, count);
    list.get_mut(left + 1..).unwrap_or_default().fill(nothing);
}

/// Moves entries from `count` on to the front; those behind them stay what they are.
pub(crate) fn shift<V: Copy>(list: &mut [V], count: usize) {
    let list = Cell::from_mut(list).as_slice_of_cells();
    for (to, from) in list.iter().zip(list.iter().skip(count)) {
        to.set(from.get());
    }
}

fn copy_used<V: Copy>(from: &[V], to: &mut [V], count: usize) {
    to.iter_mut().zip(from).take(count).for_each(|(to, from)| *to = *from);
}

fn copy_entry<V: Copy>(from: &[V], at: usize, to: &mut [V], end: usize) {
    if let (Some(&entry), Some(slot)) = (from.get(at), to.get_mut(end)) {
        *slot = entry;
    }
}
