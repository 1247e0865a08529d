//! How long and how precisely to plan.

use crate::math::Real;

/// Bounds on the planner's work. Iteration counts, not clocks: the same settings give the same plan everywhere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings<T> {
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

impl<T: Real> Default for Settings<T> {
    /// Enough for the published scenarios to come to rest.
    fn default() -> Self {
        Self {
            iterations: 600,
            refinements: 120,
            projection_steps: 200,
            line_search_steps: 12,
            tolerance: T::real(1e-7).max(T::EPSILON * T::real(8.0)),
            margin: T::real(2e-6).max(T::EPSILON * T::real(64.0)),
        }
    }
}
