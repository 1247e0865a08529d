//! What stands in the way of a feasible plan, and where.

use crate::constraints::{Constraint, TOLERANCE, worst_place};
use crate::math::{Point, Real};
use crate::metrics::Sample;
use crate::scenario::View;
use crate::trajectory::Trajectory;
use crate::warm_start::{Blocked, Obstruction};

/// How much is known to be closed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Extent {
    /// The search over the whole domain found no way that keeps the constraint, at the resolution of its lattice.
    EveryWay,
    /// The best path that was found breaks the constraint.
    BestPath,
}

/// Why there is no feasible plan: the constraint, whom it stops, and where.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Obstacle<T, const DIM: usize> {
    /// The constraint; [`Constraint::Duration`] where the flight time is too short for any way.
    pub constraint: Constraint,
    /// Which of the regions or limits, by index; for [`Constraint::Separation`] the other agent.
    pub index: Option<usize>,
    /// The agent, by index.
    pub agent: usize,
    /// Where the agent is stopped, length units.
    pub position: Point<T, DIM>,
    /// When it would be there, s.
    pub time: T,
    /// One path, or all of them.
    pub extent: Extent,
}

impl<T: Real, const DIM: usize> Obstacle<T, DIM> {
    /// What closes every way of the lattice to `agent`.
    pub(super) fn closing(agent: usize, obstruction: &Obstruction<T, DIM>) -> Self {
        let (constraint, index) = match obstruction.by {
            Blocked::Region(index) => (Constraint::Region, Some(index)),
            Blocked::Limit(index) => (Constraint::Limit, Some(index)),
            Blocked::Time => (Constraint::Duration, None),
        };
        let Obstruction { position, time, .. } = *obstruction;
        Self { constraint, index, agent, position, time, extent: Extent::EveryWay }
    }

    /// What a trajectory breaks most; `None` where it is feasible.
    pub(super) fn along<const NODES: usize, const AGENTS: usize>(
        scenario: &View<'_, T, DIM>,
        trajectory: &Trajectory<T, DIM, NODES, AGENTS>,
        scratch: &mut [Sample<T, DIM>],
    ) -> Option<Self> {
        let place = worst_place(scenario, trajectory, scratch).filter(|place| place.amount > T::real(TOLERANCE))?;
        let position = *trajectory.tracks.get(place.agent)?.path.get(place.node)?;
        let time = *trajectory.times.get(place.node)?;
        let (constraint, index, agent) = (place.constraint, place.index, place.agent);
        Some(Self { constraint, index, agent, position, time, extent: Extent::BestPath })
    }
}
