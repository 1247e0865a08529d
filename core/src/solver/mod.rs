//! Finds the plan: a bounded-iteration projected gradient over paths and flight time.
//!
//! [`plan`] starts from straight lines at constant speed, or from the trajectory that a caller gives, and improves
//! it inside the feasible set. It is *anytime*: the incumbent in the [`Workspace`] is feasible from the first
//! moment, never gets worse, and is what a deadline or an iteration limit returns, with a [`Status`] that says
//! which.
//!
//! | symbol | name | unit | shape |
//! |---|---|---|---|
//! | e_i | `offset` | v_max h | N + 1 points an agent |
//! | r | `pace` | | 1 |
//! | alpha | `step` | | 1 |
//!
//! How it works, file by file:
//! - `coordinates`: the iterate. Paths are measured from the straight line in units of the distance flown in one
//!   interval at full speed; then the speed bound is a ball of radius 1 that does not depend on the flight time,
//!   flight time enters through one number, and both together form a convex set.
//! - `projection`: the nearest feasible iterate in the velocity (H1) metric, by the alternating direction method
//!   of multipliers around one banded factor.
//! - `feasible`: exact feasibility: the largest part of a step that keeps every bound.
//! - `projected_gradient`: spectral steps, a non-monotone line search, and smoothing of worst-case terms.
//! - `guard`: regions, separations and limits, which are not convex, as barriers and penalties.
//! - `refine`: a primal-dual interior point method with banded systems, from where the gradient leaves off.
//! - `obstacle`: what stands in the way where no feasible plan is found.
//! - `bounds`: the most that a plan takes, from the settings alone.
//! - `neighbours`: challengers of a good path, one decision changed.
//! - `turns`: memory that two of them share.
//! - `race`: candidates polished, challenged and compared.
//! - `global`: starts from dynamic programming ([`crate::warm_start`]), polished and compared.
//!
//! Limits: one basin from [`Start::Straight`] or [`Start::Given`]; the best of a few from [`Start::Global`].

mod banded;
mod bounds;
mod controls;
mod coordinates;
mod feasible;
mod global;
mod guard;
mod neighbours;
mod obstacle;
mod projected_gradient;
mod projection;
mod race;
mod refine;
mod settings;
mod sides;
mod start;
mod turns;
mod workspace;

pub use bounds::Bounds;
pub use obstacle::{Extent, Obstacle};
pub use settings::Settings;
pub use start::Start;
pub use workspace::Workspace;

use crate::constraints;
use crate::error::{Error, Fault, Item};
use crate::horizon::NEAR_ITERATIONS;
use crate::math::Real;
use crate::objective::{self, Extreme};
use crate::scenario::View;

/// Why the planner stopped. Every status but [`Status::Infeasible`] and [`Status::NonFinite`] comes with a feasible plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Status {
    /// The projected gradient vanished to the tolerance asked for.
    Converged,
    /// The iteration limit was reached first.
    IterationLimit,
    /// The caller's deadline came first.
    Deadline,
    /// No feasible plan was found; [`Outcome::obstacle`] says what stands in the way.
    Infeasible,
    /// No step along the projected gradient improves the plan any more, and the gradient has not vanished, or has left the
    /// range of the numbers.
    Stalled,
    /// The objective is not a finite number where planning begins.
    NonFinite,
}

impl Status {
    /// The word that plan files use.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Converged => "converged",
            Self::IterationLimit => "iteration_limit",
            Self::Deadline => "deadline",
            Self::Infeasible => "infeasible",
            Self::Stalled => "stalled",
            Self::NonFinite => "non_finite",
        }
    }
}

/// What a call of [`plan`] did; the plan itself is [`Workspace::best`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outcome<T, const DIM: usize> {
    /// Why it stopped.
    pub status: Status,
    /// What stands in the way, where the status is [`Status::Infeasible`].
    pub obstacle: Option<Obstacle<T, DIM>>,
    /// Objective of the plan, worst-case terms exact.
    pub objective: T,
    /// Projected-gradient iterations done.
    pub iterations: usize,
    /// Steps of the second-order refinement.
    pub refinements: usize,
    /// Banded systems factored, those that were not positive definite included.
    pub factorizations: usize,
    /// Evaluations of the objective, with or without gradient.
    pub evaluations: usize,
    /// Steps of the projection, over all iterations.
    pub projection_steps: usize,
}

/// Plans `scenario` from `start` into `workspace`.
///
/// `deadline` is asked once per iteration and ends the planning when it answers `true`; pass `&mut || false` for
/// none.
///
/// # Errors
/// Where the scenario does not fit the workspace, or has a start velocity that no feasible path can follow. The workspace then holds no plan.
pub fn plan<T, const DIM: usize, const NODES: usize, const SENSORS: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    settings: &Settings<T>,
    start: Start<'_, T, DIM, NODES, AGENTS>,
    workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
    deadline: &mut dyn FnMut() -> bool,
) -> Result<Outcome<T, DIM>, Error>
where
    T: Real,
{
    supported(scenario, SENSORS)?;
    workspace.best.resize(scenario.frame.intervals, scenario.agents.len())?;
    workspace.begin(scenario.frame.intervals);
    start::lay(scenario, settings, start, workspace)?;
    if start::is_straight_only(scenario) {
        let objective = objective::value(scenario, &workspace.best, Extreme::Exact, &mut workspace.scratch);
        let obstacle = Obstacle::along(scenario, &workspace.best, &mut workspace.scratch);
        let status = match obstacle {
            _ if !objective.finite() => Status::NonFinite,
            None => Status::Converged,
            Some(_) => Status::Infeasible,
        };
        return Ok(Outcome {
            status,
            obstacle,
            objective,
            iterations: 0,
            refinements: 0,
            factorizations: 0,
            evaluations: 1,
            projection_steps: 0,
        });
    }
    let first = objective::value(scenario, &workspace.best, Extreme::Exact, &mut workspace.scratch);
    let mut ledger = Ledger {
        best: first,
        iterations: 0,
        refinements: 0,
        factorizations: 0,
        evaluations: 1,
        projection_steps: 0,
        barrier: T::zero(),
        first: T::one(),
        inside: T::one(),
        times: Times::Free,
        patience: 0,
        rival: None,
        keeps: Keeps::Better,
    };
    let (status, closing) = if !first.finite() {
        (Status::NonFinite, None)
    } else if matches!(start, Start::Global) {
        global::search(scenario, settings, workspace, &mut ledger, deadline)
    } else {
        (improve_given(scenario, settings, workspace, &mut ledger, deadline), None)
    };
    let obstacle = if status == Status::Infeasible {
        closing.or_else(|| Obstacle::along(scenario, &workspace.best, &mut workspace.scratch))
    } else {
        None
    };
    // A refinement sums its merit in another order: what is reported is what the objective says of the plan, to the last bit.
    ledger.evaluations += 1;
    let objective = objective::value(scenario, &workspace.best, Extreme::Exact, &mut workspace.scratch);
    Ok(Outcome {
        status,
        obstacle,
        objective,
        iterations: ledger.iterations,
        refinements: ledger.refinements,
        factorizations: ledger.factorizations,
        evaluations: ledger.evaluations,
        projection_steps: ledger.projection_steps,
    })
}

/// Parts of the usual first barrier parameter, and of the usual way inside its bounds, for a plan that was given and is near:
/// the further it is drawn from its bounds, the more of it has to be found again.
const NEAR_BARRIER: f64 = 0.1;
const NEAR_INSIDE: f64 = 0.1;

/// [`improve`] for a plan that was given: it stays where it is feasible and nothing better comes of it.
///
/// With so few iterations as a plan nearby needs, one that is clear of regions and limits is refined as it is. One that all
/// but touches them is led away first, as the refinement is slow where it begins at its bounds, and may end in another basin.
fn improve_given<T, const DIM: usize, const NODES: usize, const SENSORS: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    settings: &Settings<T>,
    workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
    ledger: &mut Ledger<T>,
    deadline: &mut dyn FnMut() -> bool,
) -> Status
where
    T: Real,
{
    let given = ledger.best;
    workspace.base.assign(&workspace.best);
    let slack = guard::smallest_slack(scenario, &workspace.base, &mut workspace.scratch);
    let is_nearby = settings.iterations <= NEAR_ITERATIONS && slack >= T::real(projected_gradient::CLEAR_ENOUGH);
    let status = if is_nearby {
        (ledger.first, ledger.inside) = (T::real(NEAR_BARRIER), T::real(NEAR_INSIDE));
        race::polish(scenario, settings, workspace, ledger, deadline)
    } else {
        improve(scenario, settings, workspace, ledger, deadline)
    };
    if ledger.best <= given || !constraints::violations(scenario, &workspace.base, &mut workspace.scratch).feasible()
    {
        return status;
    }
    workspace.best.assign(&workspace.base);
    ledger.best = given;
    if matches!(status, Status::Deadline | Status::IterationLimit) { status } else { Status::Stalled }
}

/// Improves `workspace.best` inside its basin: projected gradient, then refinement. `ledger.best` becomes its
/// objective.
fn improve<T, const DIM: usize, const NODES: usize, const SENSORS: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    settings: &Settings<T>,
    workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
    ledger: &mut Ledger<T>,
    deadline: &mut dyn FnMut() -> bool,
) -> Status
where
    T: Real,
{
    let status = projected_gradient::descend(scenario, settings, workspace, ledger, deadline);
    let may_refine = !matches!(status, Status::Deadline | Status::Infeasible | Status::NonFinite);
    if may_refine && settings.refinements > 0 && !cfg!(feature = "first-order") {
        return refine::polish(scenario, settings, workspace, ledger, deadline).unwrap_or(status);
    }
    status
}

/// The counts and the incumbent of one plan.
struct Ledger<T> {
    best: T,
    iterations: usize,
    refinements: usize,
    factorizations: usize,
    evaluations: usize,
    projection_steps: usize,
    /// Barrier parameter that the last refinement ended with, where the incumbent is the plan it ended with; 0 otherwise.
    barrier: T,
    /// Part of the usual first barrier parameter that a refinement begins with: less where levels have been laid, which
    /// a barrier draws towards their middle.
    first: T,
    /// Part of the usual way inside its bounds that a plan is drawn before it is refined.
    inside: T,
    times: Times,
    /// Steps that a refinement takes beyond its limit while it has gained nothing or is not at a second barrier parameter.
    patience: usize,
    /// What the champion is worth in `workspace.champion`: a refinement ends once it comes to the same way, or has no more hope
    /// to be better.
    rival: Option<T>,
    keeps: Keeps,
}

/// Which flight times a refinement may take.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Times {
    /// Any.
    Free,
    /// Those at which no node crosses an instant at which terms change: between them the objective does not jump.
    Held,
}

/// What makes a trial the incumbent.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Keeps {
    /// A better objective.
    Better,
    /// Smaller violations.
    Clearer,
}

/// Refuses what does not fit.
fn supported<T: Real, const DIM: usize>(scenario: &View<'_, T, DIM>, sensors_max: usize) -> Result<(), Error> {
    if scenario.sensors.len() > sensors_max {
        let fault = Fault::TooMany { count: scenario.sensors.len(), capacity: sensors_max };
        return Err(Error::new(Item::Scenario, "sensor", fault));
    }
    Ok(())
}
