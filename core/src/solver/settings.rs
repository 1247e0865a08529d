//! How long and how precisely to plan.

use crate::math::Real;
use crate::warm_start::VARIANTS_MAX;

use super::global::CANDIDATES_MAX;

/// Bounds on the planner's work. Iteration counts, not clocks: the same settings give the same plan everywhere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings<T> {
    /// Largest number of lattice paths that [`super::Start::Global`] lays for each penalty on lateness; at least one is laid.
    pub variants: usize,
    /// Number of lattice paths that [`super::Start::Global`] polishes whatever they promise; later ones it polishes where they
    /// promise more than all before. With more than one, the best is challenged, and the best two are polished to the end.
    pub candidates: usize,
    /// Largest number of projected-gradient iterations, over all smoothing stages.
    pub iterations: usize,
    /// Largest number of steps of the second-order refinement; 0 leaves the projected gradient alone.
    pub refinements: usize,
    /// Largest number of steps of one projection.
    pub projection_steps: usize,
    /// Largest number of trial points of one line search.
    pub line_search_steps: usize,
    /// A plan has converged when a step predicts a change of the objective below this part of max(1, |objective|).
    pub tolerance: T,
    /// Bounds are kept with this relative margin, so that an inexact projection still is feasible.
    pub margin: T,
}

impl<T: Real> Settings<T> {
    /// Little work, for a microcontroller: two lattice paths, the better of which is polished, a tenth of the default
    /// iterations or fewer, and a coarse end.
    #[must_use]
    pub fn frugal() -> Self {
        Self {
            variants: 2,
            candidates: 1,
            iterations: 40,
            refinements: 6,
            projection_steps: 40,
            tolerance: T::real(1e-3),
            ..Self::default()
        }
    }
}

impl<T: Real> Default for Settings<T> {
    /// Enough for the published scenarios to come to rest.
    fn default() -> Self {
        Self {
            variants: VARIANTS_MAX,
            candidates: CANDIDATES_MAX,
            iterations: 600,
            refinements: 120,
            projection_steps: 200,
            line_search_steps: 12,
            tolerance: T::real(1e-7).max(T::EPSILON * T::real(8.0)),
            margin: T::real(2e-6).max(T::EPSILON * T::real(64.0)),
        }
    }
}
