//! What closes the way where the lattice finds none.
//!
//! The cheapest path on which blocked cells only cost more is the one that crosses least of them; what it crosses first
//! is what is named.
//!
//! Limits: one constraint is named where several close the way together.

use crate::constraints::region::horizontal;
use crate::math::{Point, Real};
use crate::metrics::Sample;
use crate::scenario::{Region, View};
use crate::trajectory::Trajectory;

use super::equipment::Prices;
use super::field::{Field, Slice};

/// What keeps a path from the goal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Blocked {
    /// A region, by index.
    Region(usize),
    /// A limit on a metric, by index.
    Limit(usize),
    /// The flight time: it is too short for the way.
    Time,
}

/// What closes the way, and where.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Obstruction<T, const DIM: usize> {
    /// The constraint.
    pub by: Blocked,
    /// First blocked position of the path that crosses least of what is blocked, length units.
    pub position: Point<T, DIM>,
    /// When it would be there, s.
    pub time: T,
}

/// The first blocked position along the path of `agent`.
pub(super) fn first_blocked<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    trajectory: &Trajectory<T, DIM, NODES, AGENTS>,
    agent: usize,
    scratch: &mut [Sample<T, DIM>],
) -> Option<Obstruction<T, DIM>> {
    let field = Field::new(scenario, trajectory, agent, Prices::default(), 0, scratch)?;
    let count = T::from_count(trajectory.intervals().max(1));
    let path = &trajectory.tracks.get(agent)?.path;
    for node in 1..trajectory.nodes() {
        let slice = field.slice(T::from_count(node - 1) / count, T::from_count(node) / count);
        let (before, position, time) = (path.get(node - 1)?, *path.get(node)?, *trajectory.times.get(node)?);
        if let Some(by) = field.blocked(&slice, &position, T::zero(), scratch) {
            return Some(Obstruction { by, position, time });
        }
        // A wall may be thinner than a step.
        if let Some(region) = first_crossed(scenario, &slice, (before, &position)) {
            let position = (before + position) * T::real(0.5);
            return Some(Obstruction { by: Blocked::Region(region), position, time });
        }
    }
    None
}

/// The first region, by index, that a move breaks in the slice.
pub(super) fn first_crossed<T: Real, const DIM: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    slice: &Slice<T, DIM, AGENTS>,
    (from, to): (&Point<T, DIM>, &Point<T, DIM>),
) -> Option<usize> {
    let breaks = |region: &Region<T>| region.clearance(&horizontal(from), &horizontal(to)).value < T::zero();
    scenario.regions.iter().position(|region| slice.meets(region) && breaks(region))
}
