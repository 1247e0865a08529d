//! Second-order refinement: a feasible primal-dual interior point method with banded Newton systems.
//!
//! It starts from a feasible plan drawn a little inside its bounds and follows the central path of logarithmic
//! barriers: each step solves one Newton system in O(N), goes as far as bounds and the merit allow, and so stays
//! strictly feasible throughout. Flight time, budgets and worst values are the border of the system; agents are
//! coupled through the flight time exactly and through jamming by the gradient alone.
//!
//! | symbol | name |
//! |---|---|
//! | mu | `barrier` |
//! | g, lambda | slack, multiplier |
//! | delta | `shift`: multiple of the metric that makes an indefinite system definite |
//!
//! A system's matrix does not depend on the barrier parameter that its step aims at, and the step is linear in it. So mu is
//! chosen once the system is solved: where its step for the old mu would gain nothing to speak of, the same system gives the
//! step for a smaller one.
//!
//! The objective jumps where a node crosses an instant at which terms change. A step that would take the flight time across
//! is cut short again and again; after two, the flight time is held between its jumps.
//!
//! Limits: [`Settings::refinements`] steps, and a few more for a candidate of the race; local, from the basin of its start;
//! not used where a scenario has more than two worst-case terms an agent.

mod assemble;
mod barrier;
mod block;
mod central_path;
mod extremes;
mod limits;
mod newton;
mod place;
mod rows;
mod system;

use heapless::Vec;

use crate::math::Real;
use crate::scenario::{Reduce, TERMS_MAX, Term, View};

use super::controls::Bound;
use super::coordinates::Frame;
use super::{Ledger, Settings, Status, Times, Workspace, guard, neighbours};
use barrier::{Multipliers, Range};
use central_path::CentralPath;
use extremes::Extremes;
use system::System;

pub(super) use central_path::HALVINGS_MAX;
pub(super) use newton::SHIFTS_MAX;
/// Part of the pace that a start gives up to come inside its bounds.
const INSIDE: f64 = 0.02;
/// First barrier parameter over max(1, |objective|).
const FIRST_BARRIER: f64 = 1e-3;
/// Last barrier parameter over max(1, |objective|).
const LAST_BARRIER: f64 = 1e-11;

/// One for each agent; none where nothing is refined.
#[cfg(not(feature = "first-order"))]
type Each<V, const AGENTS: usize> = [V; AGENTS];
#[cfg(feature = "first-order")]
type Each<V, const AGENTS: usize> = [V; 0];

/// Memory of a refinement.
#[derive(Clone, Debug)]
pub(super) struct Refinement<T, const DIM: usize, const NODES: usize, const AGENTS: usize> {
    systems: Each<System<T, DIM, NODES>, AGENTS>,
    multipliers: Each<Multipliers<T, DIM, NODES>, AGENTS>,
}

impl<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize> Refinement<T, DIM, NODES, AGENTS> {
    /// All zeros.
    pub(super) const EMPTY: Self =
        Self { systems: [const { System::empty() }; _], multipliers: [const { Multipliers::zeros() }; _] };
}

/// Improves the incumbent `workspace.best`, which must be feasible and clear of regions and limits.
pub(super) fn polish<T, const DIM: usize, const NODES: usize, const SENSORS: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    settings: &Settings<T>,
    workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
    ledger: &mut Ledger<T>,
    deadline: &mut dyn FnMut() -> bool,
) -> Option<Status>
where
    T: Real,
{
    let mut frame = Frame::<T, DIM, AGENTS>::new(scenario, workspace.best.duration());
    if ledger.times == Times::Held {
        frame.hold(neighbours::piece(scenario, workspace.best.duration()));
    }
    let mut integral_terms = Vec::<Term<T>, TERMS_MAX>::new();
    for term in scenario.terms.iter().filter(|term| term.reduce == Reduce::Integral) {
        let _ = integral_terms.push(*term);
    }
    let plain = View { terms: &integral_terms, ..*scenario };
    frame.collapse(&workspace.best, &mut workspace.iterate);
    workspace.trial.assign(&workspace.best);
    let is_inside = ledger.barrier > T::zero()
        && barrier::log_slacks(&frame, &scenario.frame.domain, &workspace.iterate).finite()
        && guard::smallest_slack(scenario, &workspace.best, &mut workspace.scratch) > T::zero();
    if !is_inside && !draw_inside(scenario, &frame, workspace, ledger.inside) {
        return None;
    }
    frame.expand(&workspace.iterate, &mut workspace.trial);
    let extremes = Extremes::new(scenario, &workspace.trial, &mut workspace.scratch)?;
    let scale = ledger.best.abs().max(T::one());
    let first = T::real(FIRST_BARRIER) * scale * ledger.first;
    let mut path = CentralPath {
        scenario,
        plain: &plain,
        settings,
        frame: &frame,
        extremes,
        is_guarded: guard::is_needed(scenario),
        is_laid: false,
        is_spent: false,
        objective: T::zero(),
        logs: T::zero(),
        barrier: if is_inside { ledger.barrier.min(first) } else { first },
        barrier_last: T::real(LAST_BARRIER).max(T::EPSILON) * scale,
        pace_multipliers: [T::zero(); 2],
        range: Range::of(T::one()),
        shift: T::zero(),
        times: ledger.times,
    };
    let status = path.follow_through(workspace, ledger, deadline);
    ledger.barrier = path.barrier;
    Some(status)
}

/// Draws the incumbent, in `workspace.iterate`, inside its bounds by `part` of the usual way; false if that fails.
fn draw_inside<T, const DIM: usize, const NODES: usize, const SENSORS: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    frame: &Frame<T, DIM, AGENTS>,
    workspace: &mut Workspace<T, DIM, NODES, SENSORS, AGENTS>,
    part: T,
) -> bool
where
    T: Real,
{
    let domain = &scenario.frame.domain;
    workspace.candidate.assign(&workspace.iterate, frame);
    let mut inside = T::real(INSIDE) * part;
    for _ in 0..4 {
        let Workspace { iterate, candidate, trial, scratch, .. } = workspace;
        // The same path, flown a little slower.
        let slower = candidate.pace.min(frame.pace_max.unwrap_or(T::MAX)) * (T::one() - inside);
        let pace = slower.max(frame.pace_min + (candidate.pace - frame.pace_min) * T::real(0.5));
        let share = pace / candidate.pace;
        iterate.pace = pace;
        for ((mine, theirs), agent) in iterate.interior_mut(frame).zip(candidate.interior(frame)).zip(frame.agent()) {
            let count = T::from_count(frame.intervals);
            let gap = inside * T::real(0.2);
            for (node, (mine, theirs)) in mine.iter_mut().zip(theirs).enumerate() {
                *mine = theirs * share;
                let line = agent.start + agent.line * (T::from_count(node + 1) / count);
                let low = (domain.min - line) * (pace / agent.stride);
                let high = (domain.max - line) * (pace / agent.stride);
                for ((value, &low), &high) in mine.iter_mut().zip(low.iter()).zip(high.iter()) {
                    let gap = gap.min((high - low) * T::real(0.25));
                    *value = value.clamp_to(low + gap, high - gap);
                }
            }
        }
        for (slot, bound) in frame.equipment() {
            let Bound::Level { allowance } = bound else { continue };
            let levels = iterate.levels_mut(slot, frame.intervals);
            let mut sum = T::zero();
            for (mine, &theirs) in levels.iter_mut().zip(candidate.levels(slot, frame.intervals)) {
                *mine = inside + (T::one() - inside - inside) * theirs;
                sum += *mine;
            }
            let most = allowance * pace * (T::one() - inside);
            if sum > most {
                levels.iter_mut().for_each(|level| *level *= most / sum);
            }
        }
        let is_inside = barrier::log_slacks(frame, domain, iterate).finite();
        frame.expand(iterate, trial);
        if is_inside && guard::smallest_slack(scenario, trial, scratch) > T::zero() {
            return true;
        }
        inside *= T::real(0.2);
    }
    false
}
