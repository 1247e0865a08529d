//! All memory that planning needs, owned by the caller.

use crate::math::Real;
use crate::metrics::Sample;
use crate::trajectory::Trajectory;
use crate::warm_start::Landscape;

use super::coordinates::Iterate;
use super::projection::Projection;
use super::turns::Turns;

/// Cells of the global start's lattice.
pub const LATTICE_CELLS: usize = if cfg!(feature = "compact") { 400 } else { 1024 };
/// Entries of the lattice's parents: one a cell and slice of time.
pub const LATTICE_PARENTS: usize = if cfg!(feature = "compact") { 12 } else { 16 } * LATTICE_CELLS;

/// Memory for planning `AGENTS` agents over `NODES` nodes among `SENSORS` sensors.
///
/// Its size is `size_of::<Workspace<..>>()`: a constant, to be placed in a static or a box. Nothing in it needs to
/// be kept between two plans except, where wanted, the plan itself.
#[derive(Clone, Debug)]
pub struct Workspace<T, const DIM: usize, const NODES: usize, const SENSORS: usize, const AGENTS: usize> {
    pub(super) best: Trajectory<T, DIM, NODES, AGENTS>,
    pub(super) trial: Trajectory<T, DIM, NODES, AGENTS>,
    pub(super) by_trajectory: Trajectory<T, DIM, NODES, AGENTS>,
    pub(super) iterate: Iterate<T, DIM, NODES, AGENTS>,
    pub(super) candidate: Iterate<T, DIM, NODES, AGENTS>,
    pub(super) next: Iterate<T, DIM, NODES, AGENTS>,
    pub(super) anchor: Iterate<T, DIM, NODES, AGENTS>,
    pub(super) gradient: Iterate<T, DIM, NODES, AGENTS>,
    pub(super) gradient_next: Iterate<T, DIM, NODES, AGENTS>,
    pub(super) projection: Projection<T, DIM, NODES, AGENTS>,
    /// What the global start begins with, and the best candidate so far.
    pub(super) base: Trajectory<T, DIM, NODES, AGENTS>,
    pub(super) champion: Trajectory<T, DIM, NODES, AGENTS>,
    /// The best candidate that goes another way.
    pub(super) second: Trajectory<T, DIM, NODES, AGENTS>,
    pub(super) landscape: Landscape<T, LATTICE_CELLS>,
    pub(super) turns: Turns<T, DIM, NODES, AGENTS>,
    pub(super) scratch: [Sample<T, DIM>; SENSORS],
}

impl<T: Real, const DIM: usize, const NODES: usize, const SENSORS: usize, const AGENTS: usize>
    Workspace<T, DIM, NODES, SENSORS, AGENTS>
{
    /// A workspace that holds no plan: all zeros, so that a static one takes no room in an image.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            best: Trajectory::empty(),
            trial: Trajectory::empty(),
            by_trajectory: Trajectory::empty(),
            iterate: Iterate::zeros(),
            candidate: Iterate::zeros(),
            next: Iterate::zeros(),
            anchor: Iterate::zeros(),
            gradient: Iterate::zeros(),
            gradient_next: Iterate::zeros(),
            projection: Projection::empty(),
            base: Trajectory::empty(),
            champion: Trajectory::empty(),
            second: Trajectory::empty(),
            landscape: Landscape::EMPTY,
            turns: Turns::EMPTY,
            scratch: [const { Sample::zeros() }; SENSORS],
        }
    }

    /// The plan: the best feasible trajectory that the last call found.
    #[must_use]
    pub const fn best(&self) -> &Trajectory<T, DIM, NODES, AGENTS> {
        &self.best
    }

    /// Takes on a problem of `intervals`: nothing of an earlier one stays where it would be read.
    // Inlined into `plan`, rustc 1.95 in the release profile makes that read beyond the agents and crash.
    #[inline(never)]
    pub(super) fn begin(&mut self, intervals: usize) {
        let Self { iterate, candidate, next, anchor, gradient, gradient_next, .. } = self;
        for each in [iterate, candidate, next, anchor, gradient, gradient_next] {
            each.pin_ends(intervals);
        }
    }

    /// The plan, and scratch to weigh it with.
    pub(crate) fn parts(&mut self) -> (&Trajectory<T, DIM, NODES, AGENTS>, &mut [Sample<T, DIM>]) {
        (&self.best, &mut self.scratch)
    }
}

impl<T: Real, const DIM: usize, const NODES: usize, const SENSORS: usize, const AGENTS: usize> Default
    for Workspace<T, DIM, NODES, SENSORS, AGENTS>
{
    fn default() -> Self {
        Self::new()
    }
}

/// What 64 intervals, 16 sensors and one agent take in single precision, where memory is shared.
const _: () = assert!(size_of::<Workspace<f32, 2, 65, 16, 1>>() - Turns::<f32, 2, 65, 1>::ROOM <= 64 * 1024);
