//! Memory that the lattice of the global start and the refinement have by turns: neither needs what the other leaves.
//!
//! With the feature `roomy` each has its own. Otherwise whoever takes it from the other clears all of it, which takes as long
//! as capacities are large, whatever the problem.

use crate::math::Real;
use crate::warm_start::Tables;

use super::refine::Refinement;
use super::workspace::{LATTICE_CELLS, LATTICE_PARENTS};

pub(super) use layout::Turns;

/// What the lattice works on.
type LatticeTables = Tables<LATTICE_CELLS, LATTICE_PARENTS>;

#[cfg(feature = "roomy")]
mod layout {
    use super::{LatticeTables, Real, Refinement};

    /// Memory of both.
    #[derive(Clone, Debug)]
    pub(in crate::solver) struct Turns<T, const DIM: usize, const NODES: usize, const AGENTS: usize> {
        lattice: LatticeTables,
        refinement: Refinement<T, DIM, NODES, AGENTS>,
    }

    impl<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize> Turns<T, DIM, NODES, AGENTS> {
        /// All zeros.
        pub(in crate::solver) const EMPTY: Self =
            Self { lattice: LatticeTables::EMPTY, refinement: Refinement::EMPTY };
        /// Bytes more than where memory is shared: what the smaller of both takes.
        pub(in crate::solver) const ROOM: usize = {
            let (lattice, refinement) = (size_of::<LatticeTables>(), size_of::<Refinement<T, DIM, NODES, AGENTS>>());
            if lattice < refinement { lattice } else { refinement }
        };

        /// For the lattice.
        pub(in crate::solver) fn lattice(&mut self) -> Option<&mut LatticeTables> {
            Some(&mut self.lattice)
        }

        /// For the refinement.
        pub(in crate::solver) fn refinement(&mut self) -> Option<&mut Refinement<T, DIM, NODES, AGENTS>> {
            Some(&mut self.refinement)
        }
    }
}

#[cfg(not(feature = "roomy"))]
mod layout {
    use super::{LatticeTables, Real, Refinement};

    /// Whose turn it is.
    // Empty memory is all zeros, and so is the number of the first variant: a static workspace takes no room in an image.
    #[derive(Clone, Debug)]
    #[repr(u8)]
    #[expect(clippy::large_enum_variant, reason = "there is no heap to put either on")]
    pub(in crate::solver) enum Turns<T, const DIM: usize, const NODES: usize, const AGENTS: usize> {
        Lattice(LatticeTables),
        Refinement(Refinement<T, DIM, NODES, AGENTS>),
    }

    impl<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize> Turns<T, DIM, NODES, AGENTS> {
        /// The lattice's, empty.
        pub(in crate::solver) const EMPTY: Self = Self::Lattice(LatticeTables::EMPTY);
        /// Bytes more than where memory is shared.
        pub(in crate::solver) const ROOM: usize = 0;
        /// The refinement's, empty. A constant, so that no copy of it comes onto the stack; it lies in an image in full,
        /// because it is not all zeros, but there is more flash than RAM.
        const REFINEMENT: Self = Self::Refinement(Refinement::EMPTY);

        /// For the lattice; `None` never comes.
        pub(in crate::solver) fn lattice(&mut self) -> Option<&mut LatticeTables> {
            if !matches!(self, Self::Lattice(_)) {
                *self = Self::EMPTY;
            }
            if let Self::Lattice(tables) = self { Some(tables) } else { None }
        }

        /// For the refinement; `None` never comes.
        pub(in crate::solver) fn refinement(&mut self) -> Option<&mut Refinement<T, DIM, NODES, AGENTS>> {
            if !matches!(self, Self::Refinement(_)) {
                *self = Self::REFINEMENT;
            }
            if let Self::Refinement(refinement) = self { Some(refinement) } else { None }
        }
    }
}
