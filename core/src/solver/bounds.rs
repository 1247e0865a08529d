//! The most that one call of [`super::plan`] does, from its [`Settings`] alone: what a deadline on a microcontroller is
//! worked out from.
//!
//! | start | what is counted |
//! |---|---|
//! | straight, given | one descent and one refinement |
//! | global | for each lattice path, each challenger ([`super::neighbours`]) and the straight line, a projection and a short descent and refinement; in full, the best two at each of their flight times, and the plan with levels anew |
//!
//! With [`Settings::candidates`] at 1 there are no challengers, and one is polished in full.
//!
//! A descent has a stage that leads clear of regions and limits and then all others, each with its iterations; an iteration
//! is one projection and one line search; a step of the refinement factors until the system is definite, and halves until
//! the merit falls.
//!
//! Limits: the lattice itself is bounded by its cells ([`super::workspace`]) and not counted here; an evaluation visits
//! every node of every agent once, and each visit every sensor.

use crate::math::Real;
use crate::warm_start::{LARGE_TEAM, Level, VARIANTS_MAX};

use super::{Settings, global, neighbours, projected_gradient, race, refine};

/// The largest counts that an [`super::Outcome`] can have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Bounds {
    /// Projected-gradient iterations.
    pub iterations: usize,
    /// Steps of the second-order refinement.
    pub refinements: usize,
    /// Banded systems factored, an agent.
    pub factorizations: usize,
    /// Evaluations of the objective, with or without gradient.
    pub evaluations: usize,
    /// Steps of the projection.
    pub projection_steps: usize,
}

impl<T: Real> Settings<T> {
    /// The most that a plan from [`super::Start::Straight`] or [`super::Start::Given`] takes.
    #[must_use]
    pub const fn bounds_near(&self) -> Bounds {
        let improved = self.improvement(self.iterations, self.refinements);
        // The start, and the plan as it is reported.
        Bounds { evaluations: improved.evaluations + 2, ..improved }
    }

    /// The most that a plan from [`super::Start::Global`] for a number of agents takes.
    #[must_use]
    pub const fn bounds_everywhere(&self, agents: usize) -> Bounds {
        let short = self.improvement(
            smaller(self.iterations, race::POLISH_ITERATIONS),
            if self.refinements > race::POLISH_REFINEMENTS {
                race::POLISH_REFINEMENTS + race::PATIENCE
            } else {
                self.refinements
            },
        );
        let long = self.improvement(self.iterations, self.refinements);
        let hurried = smaller(if self.variants == 0 { 1 } else { self.variants }, VARIANTS_MAX);
        let unhurried = smaller(self.variants, VARIANTS_MAX);
        let laid = global::orders_max(agents) * (hurried + unhurried);
        // The plan and the second, each at one flight time after another; levels and directions anew. Where nothing is feasible,
        // one is cleared first.
        let (challengers, finished) = if self.candidates > 1 {
            let retimed = 2 * race::RETIMES_MAX;
            let elsewhere = agents * Level::ALL.len();
            let again = if agents < LARGE_TEAM { 0 } else { 1 };
            let changed = neighbours::SIDES_MAX + elsewhere + again + retimed * neighbours::TIMES_MAX;
            (changed, 3 + retimed + race::EQUIPS_MAX)
        } else {
            (0, 2)
        };
        let polished = 1 + laid + challengers;
        let projected = laid + challengers;
        Bounds {
            iterations: polished * short.iterations + finished * long.iterations,
            refinements: polished * short.refinements + finished * long.refinements,
            factorizations: polished * short.factorizations + finished * long.factorizations,
            // The start, a line that waits, and the plan as it is reported.
            evaluations: 3 + projected + polished * (short.evaluations + 1) + finished * (long.evaluations + 1),
            projection_steps: projected * global::PROJECTION_STEPS
                + polished * short.projection_steps
                + finished * long.projection_steps,
        }
    }

    /// A descent and a refinement.
    const fn improvement(&self, iterations: usize, refinements: usize) -> Bounds {
        // Clear of what is in the way first, then through all stages.
        let descended = 2 * iterations;
        Bounds {
            iterations: descended,
            refinements,
            factorizations: refinements * refine::SHIFTS_MAX,
            // Its value for either, for what is cleared before, and for a refinement once more where an instant holds it up; the
            // first gradient of every stage, of two more where it is cleared before, then a line search each, and each success
            // judged exactly.
            evaluations: 4
                + (3 + projected_gradient::STAGES_MAX)
                + descended * (self.line_search_steps + 1)
                + refinements * (refine::HALVINGS_MAX + 1),
            projection_steps: descended * self.projection_steps,
        }
    }
}

const fn smaller(a: usize, b: usize) -> usize {
    if a < b { a } else { b }
}
