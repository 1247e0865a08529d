//! Memory that the lattice of the global start and the refinement have by turns: neither needs what the other leaves.
//!
//! Limits: whoever takes it from the other finds all zeros.

use crate::math::Real;
use crate::warm_start::Tables;

use super::refine::Refinement;
use super::workspace::{LATTICE_CELLS, LATTICE_PARENTS};

/// Whose turn it is.
// Empty memory is all zeros, and so is the number of the first variant: a static workspace takes no room in an image.
#[derive(Clone, Debug)]
#[repr(u8)]
#[expect(clippy::large_enum_variant, reason = "there is no heap to put either on")]
pub(super) enum Turns<T, const DIM: usize, const NODES: usize, const AGENTS: usize> {
    Lattice(Tables<T, LATTICE_CELLS, LATTICE_PARENTS>),
    Refinement(Refinement<T, DIM, NODES, AGENTS>),
}

impl<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize> Turns<T, DIM, NODES, AGENTS> {
    /// The lattice's, empty.
    pub(super) const LATTICE: Self = Self::Lattice(Tables::EMPTY);
    /// The refinement's, empty. A constant, so that no copy of it comes onto the stack; it lies in an image in full, because it is
    /// not all zeros, but there is more flash than RAM.
    const REFINEMENT: Self = Self::Refinement(Refinement::EMPTY);

    /// For the lattice; `None` never comes.
    pub(super) fn lattice(&mut self) -> Option<&mut Tables<T, LATTICE_CELLS, LATTICE_PARENTS>> {
        if !matches!(self, Self::Lattice(_)) {
            *self = Self::LATTICE;
        }
        if let Self::Lattice(tables) = self { Some(tables) } else { None }
    }

    /// For the refinement; `None` never comes.
    pub(super) fn refinement(&mut self) -> Option<&mut Refinement<T, DIM, NODES, AGENTS>> {
        if !matches!(self, Self::Refinement(_)) {
            *self = Self::REFINEMENT;
        }
        if let Self::Refinement(refinement) = self { Some(refinement) } else { None }
    }
}
