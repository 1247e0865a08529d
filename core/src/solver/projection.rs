//! The nearest feasible iterate in the velocity metric, by the alternating direction method of multipliers.
//!
//! For an iterate (e, r), a gradient g and a step alpha it finds the feasible (e', r') that minimises
//!
//! 1/2 |D1 (e' - e)|^2 + m/2 (r' - r)^2 + alpha g' (e' - e, r' - r),
//!
//! the point that a gradient step in the metric reaches once projected. Steps (D1 y), bends (D2 e) and positions
//! each have a copy that is projected on its ball or box alone; one banded system and one scalar equation pull the
//! copies together. The matrix depends on the number of nodes only, so it is factored once a plan. Multipliers are
//! kept between calls: late in a plan a handful of steps is enough. Positions have copies from when one has come to a wall of
//! the domain on: before, copies that nothing holds would only hold them where they were.
//!
//! The result keeps the bounds to about `tolerance`; bounds are drawn in by a margin for that reason, and
//! [`super::feasible`] makes what is left exact.
//!
//! Limits: [`super::Settings::projection_steps`] bounds the steps of one call.

use crate::math::{Point, Real, norm_squared, origin};
use crate::scenario::Domain;

use super::banded::{Coefficients, Factor};
use super::controls::{Bound, Budget, KINDS, PaceCopy, trim};
use super::coordinates::{AgentFrame, CONTROL_WEIGHT, Frame, Iterate};
use super::feasible::bend_bound;

/// Penalty of the position copies times N, relative to that of the steps and bends.
const PLACE_PENALTY: f64 = 10.0;
/// Bounds on the penalty, relative to the metric.
const PENALTY_RANGE: (f64, f64) = (1e-3, 1e4);
/// The penalty changes when the residuals, each relative to its own scale, differ by this factor.
const IMBALANCE: f64 = 4.0;
/// Looks at the residuals between two changes of the penalty.
const PATIENCE: usize = 2;
/// Over-relaxation.
const RELAXATION: f64 = 1.6;
/// Steps between two looks at the residuals.
const CHECK_EVERY: usize = 5;

/// A constrained quantity's copy inside its set, and its scaled multiplier.
#[derive(Clone, Copy, Debug)]
struct Copied<T, const DIM: usize> {
    inside: Point<T, DIM>,
    multiplier: Point<T, DIM>,
}

impl<T: Real, const DIM: usize> Copied<T, DIM> {
    const fn zeros() -> Self {
        Self { inside: origin(), multiplier: origin() }
    }

    /// What pulls at the quantity.
    fn pull(&self) -> Point<T, DIM> {
        self.inside - self.multiplier
    }

    /// Moves the copy to the point of the ball nearest to `value`, relaxed.
    fn hold_in_ball(&mut self, value: &Point<T, DIM>, radius: T, residual: &mut Residual<T>) {
        let wanted = self.relaxed(value);
        let length_squared = norm_squared(&wanted);
        let inside =
            if length_squared > radius * radius { wanted * (radius / length_squared.sqrt()) } else { wanted };
        self.settle(value, &wanted, inside, residual);
    }

    /// The same for a box.
    fn hold_in_box(&mut self, value: &Point<T, DIM>, [low, high]: &[Point<T, DIM>; 2], residual: &mut Residual<T>) {
        let wanted = self.relaxed(value);
        let inside = held_in_box(&wanted, low, high);
        self.settle(value, &wanted, inside, residual);
    }

    fn relaxed(&self, value: &Point<T, DIM>) -> Point<T, DIM> {
        let relaxation = T::real(RELAXATION);
        value * relaxation + self.inside * (T::one() - relaxation) + self.multiplier
    }

    fn settle(
        &mut self,
        value: &Point<T, DIM>,
        wanted: &Point<T, DIM>,
        inside: Point<T, DIM>,
        residual: &mut Residual<T>,
    ) {
        residual.moved = residual.moved.max(norm_squared(&(inside - self.inside)));
        residual.primal = residual.primal.max(norm_squared(&(value - inside)));
        self.inside = inside;
        self.multiplier = wanted - inside;
        residual.multiplier = residual.multiplier.max(norm_squared(&self.multiplier));
    }
}

/// How far the copies are from settled: the largest of each over all copies.
#[derive(Clone, Copy, Debug, Default)]
struct Residual<T> {
    /// From a quantity to its copy.
    primal: T,
    /// From a copy to where it was one step before.
    moved: T,
    /// Scaled multiplier.
    multiplier: T,
}

impl<T: Real> Residual<T> {
    /// The lengths, from their squares.
    fn roots(self) -> Self {
        Self { primal: self.primal.sqrt(), moved: self.moved.sqrt(), multiplier: self.multiplier.sqrt() }
    }
}

/// One agent's copies: a step into every node but the first, a bend and a position at every interior node.
#[derive(Clone, Debug)]
struct Copies<T, const DIM: usize, const NODES: usize> {
    step: [Copied<T, DIM>; NODES],
    /// Entry 0 is the change from the start velocity to the first step.
    bend: [Copied<T, DIM>; NODES],
    place: [Copied<T, DIM>; NODES],
}

impl<T: Real, const DIM: usize, const NODES: usize> Copies<T, DIM, NODES> {
    const fn zeros() -> Self {
        let none = Copied::zeros();
        Self { step: [none; NODES], bend: [none; NODES], place: [none; NODES] }
    }
}

/// The state of the projection, kept between calls.
#[derive(Clone, Debug)]
pub(super) struct Projection<T, const DIM: usize, const NODES: usize, const AGENTS: usize> {
    copies: [Copies<T, DIM, NODES>; AGENTS],
    /// The pace as each budget wants it.
    budgets: [[PaceCopy<T>; KINDS]; AGENTS],
    /// Factor without and with the start-velocity row.
    factor: [Factor<T, NODES>; 2],
    /// Penalty of steps and bends, relative to the metric.
    penalty: T,
    /// Step of the last call, to which the multipliers belong.
    last_step: T,
    /// Whether a position has come to a wall of the domain.
    met_wall: bool,
}

/// What one call needs besides the iterate.
pub(super) struct Request<'a, T, const DIM: usize, const AGENTS: usize> {
    pub(super) frame: &'a Frame<T, DIM, AGENTS>,
    pub(super) domain: &'a Domain<T, DIM>,
    /// alpha.
    pub(super) step: T,
    /// Bounds are drawn in by this part of themselves.
    pub(super) margin: T,
    /// Residual, in units of the largest speed, at which the projection is good enough.
    pub(super) tolerance: T,
    /// Largest number of steps.
    pub(super) steps_max: usize,
}

impl<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize> Projection<T, DIM, NODES, AGENTS> {
    pub(super) const fn empty() -> Self {
        Self {
            copies: [const { Copies::zeros() }; AGENTS],
            budgets: [[PaceCopy { inside: T::ZERO, multiplier: T::ZERO }; KINDS]; AGENTS],
            factor: [Factor::empty(), Factor::empty()],
            penalty: T::ZERO,
            last_step: T::ZERO,
            met_wall: false,
        }
    }

    /// Takes the scenario's grid and forgets all multipliers.
    pub(super) fn prepare(&mut self, frame: &Frame<T, DIM, AGENTS>) {
        self.penalty = T::one();
        self.met_wall = false;
        self.factor(frame);
        self.last_step = T::zero();
        self.forget(frame);
    }

    fn factor(&mut self, frame: &Frame<T, DIM, AGENTS>) {
        let place_penalty = self.place_penalty(frame);
        for (factor, has_start) in self.factor.iter_mut().zip([T::zero(), T::one()]) {
            let coefficients = Coefficients {
                zeroth: place_penalty,
                first: T::one() + self.penalty,
                second: self.penalty,
                at_start: self.penalty * has_start,
            };
            factor.factor(frame.intervals.saturating_sub(1), &coefficients);
        }
    }

    /// Whether positions have copies; where code is to be small, always.
    fn has_places(&self) -> bool {
        cfg!(feature = "compact") || self.met_wall
    }

    /// The slowest mode of D1'D1 has the eigenvalue (pi / N)^2; position copies answer on a softer scale.
    fn place_penalty(&self, frame: &Frame<T, DIM, AGENTS>) -> T {
        if !self.has_places() {
            return T::zero();
        }
        self.penalty * T::real(PLACE_PENALTY) / T::from_count(frame.intervals.max(1))
    }

    /// Moves the penalty towards balanced residuals: the multipliers of far targets want a stiff one.
    fn balance(&mut self, frame: &Frame<T, DIM, AGENTS>, residual: &Residual<T>) {
        let dual_scale = (residual.multiplier * self.penalty).max(T::EPSILON);
        let primal = residual.primal.max(T::EPSILON);
        let dual = (residual.moved * self.penalty / dual_scale).max(T::EPSILON);
        let ratio = (primal / dual).sqrt();
        let imbalance = T::real(IMBALANCE).sqrt();
        if ratio < imbalance && ratio * imbalance > T::one() {
            return;
        }
        let wanted = self.penalty * ratio.clamp_to(T::real(0.1), T::real(10.0));
        let penalty = wanted.clamp_to(T::real(PENALTY_RANGE.0), T::real(PENALTY_RANGE.1));
        let scale = self.penalty / penalty;
        self.penalty = penalty;
        self.scale_multipliers(frame, scale);
        self.factor(frame);
    }

    /// The copies that a problem has.
    fn used(&mut self, frame: &Frame<T, DIM, AGENTS>) -> impl Iterator<Item = &mut Copied<T, DIM>> {
        let (agents, nodes) = (frame.agent().count(), frame.intervals + 1);
        self.copies.iter_mut().take(agents).flat_map(move |Copies { step, bend, place }| {
            [step, bend, place].into_iter().flat_map(move |copies| copies.iter_mut().take(nodes))
        })
    }

    fn forget(&mut self, frame: &Frame<T, DIM, AGENTS>) {
        self.used(frame).for_each(|copied| *copied = Copied::zeros());
        for budget in self.budgets.iter_mut().flatten() {
            budget.multiplier = T::zero();
        }
    }

    /// Projects; returns the number of steps it took. `result` may hold anything before.
    pub(super) fn project(
        &mut self,
        request: &Request<'_, T, DIM, AGENTS>,
        iterate: &Iterate<T, DIM, NODES, AGENTS>,
        gradient: &Iterate<T, DIM, NODES, AGENTS>,
        result: &mut Iterate<T, DIM, NODES, AGENTS>,
    ) -> usize {
        if self.last_step > T::zero() {
            self.rescale(request);
        } else {
            self.last_step = request.step;
            self.seed(request, iterate);
        }
        result.pace = iterate.pace;
        for step in 1..=request.steps_max {
            self.pull_together(request, iterate, gradient, result);
            let mut squared = self.push_apart(request, iterate.pace, result);
            self.push_budgets(request, (iterate, gradient), result, &mut squared);
            if step % CHECK_EVERY != 0 {
                continue;
            }
            if !self.has_places() && is_outside(request, result) {
                self.wall(request, result);
                continue;
            }
            let residual = squared.roots();
            let dual = residual.moved * self.penalty / (T::one() + residual.multiplier * self.penalty);
            if residual.primal.max(dual) <= request.tolerance {
                settle_budgets(request.frame, result);
                return step;
            }
            if step % (CHECK_EVERY * PATIENCE) == 0 {
                self.balance(request.frame, &residual);
            }
        }
        settle_budgets(request.frame, result);
        request.steps_max
    }

    /// Gives positions copies, inside the walls.
    fn wall(&mut self, request: &Request<'_, T, DIM, AGENTS>, result: &Iterate<T, DIM, NODES, AGENTS>) {
        let frame = request.frame;
        self.met_wall = true;
        self.factor(frame);
        for ((copies, offsets), agent) in self.copies.iter_mut().zip(result.interior(frame)).zip(frame.agent()) {
            for (node, (place, offset)) in copies.place.iter_mut().zip(offsets).enumerate() {
                let [low, high] = walls(request, agent, node, result.pace);
                *place = Copied { inside: held_in_box(offset, &low, &high), multiplier: Point::zeros() };
            }
        }
    }

    /// Multipliers are proportional to the step that they resist.
    fn rescale(&mut self, request: &Request<'_, T, DIM, AGENTS>) {
        self.scale_multipliers(request.frame, request.step / self.last_step);
        self.last_step = request.step;
    }

    fn scale_multipliers(&mut self, frame: &Frame<T, DIM, AGENTS>, ratio: T) {
        self.used(frame).for_each(|copied| copied.multiplier *= ratio);
        for budget in self.budgets.iter_mut().flatten() {
            budget.multiplier *= ratio;
        }
    }

    /// Starts the copies at the iterate, on the first call; later ones go on from where the last one ended.
    fn seed(&mut self, request: &Request<'_, T, DIM, AGENTS>, iterate: &Iterate<T, DIM, NODES, AGENTS>) {
        let frame = request.frame;
        for budget in self.budgets.iter_mut().flatten() {
            budget.inside = iterate.pace;
        }
        for ((copies, offsets), agent) in self.copies.iter_mut().zip(iterate.interior(frame)).zip(frame.agent()) {
            let cruise = frame.cruise(agent, iterate.pace);
            let mut before = Point::<T, DIM>::zeros();
            let mut step_before = agent.start_velocity.map_or_else(Point::zeros, |velocity| velocity - cruise);
            let zero = Point::<T, DIM>::zeros();
            let all = offsets.iter().chain(core::iter::once(&zero));
            let slots = copies.step.iter_mut().zip(&mut copies.bend).zip(&mut copies.place);
            for (((step, bend), place), &offset) in slots.zip(all) {
                let change = offset - before;
                step.inside = change + cruise;
                bend.inside = change - step_before;
                place.inside = offset;
                (before, step_before) = (offset, change);
            }
        }
    }

    /// The unconstrained minimum of metric, gradient and penalties, copies held.
    fn pull_together(
        &self,
        request: &Request<'_, T, DIM, AGENTS>,
        iterate: &Iterate<T, DIM, NODES, AGENTS>,
        gradient: &Iterate<T, DIM, NODES, AGENTS>,
        result: &mut Iterate<T, DIM, NODES, AGENTS>,
    ) {
        let frame = request.frame;
        let count = T::from_count(frame.intervals.max(1));
        let step_penalty = self.penalty;
        let mut pace_pull = frame.inertia * iterate.pace - request.step * gradient.pace;
        let mut pace_weight = frame.inertia;
        for (copies, agent) in self.copies.iter().zip(frame.agent()) {
            let rate = agent.reach / count;
            pace_weight += step_penalty * count * norm_squared(&rate);
            let steps = copies.step.iter().take(frame.intervals);
            let pull = steps.fold(T::zero(), |sum, copied| sum + rate.dot(&copied.pull()));
            pace_pull += step_penalty * pull;
        }
        for ((agent, kind), bound) in frame.equipment() {
            let copied = self.budgets.get(agent).and_then(|kinds| kinds.get(kind as usize));
            if let (Bound::Level { .. }, Some(copied)) = (bound, copied) {
                pace_pull += step_penalty * frame.inertia * (copied.inside - copied.multiplier);
                pace_weight += step_penalty * frame.inertia;
            }
        }
        let pace = (pace_pull / pace_weight).clamp_to(frame.pace_min, iterate.pace * T::real(1.5));
        let sources =
            self.copies.iter().zip(iterate.interior(frame)).zip(gradient.interior(frame)).zip(frame.agent());
        for (offsets, (((copies, from), slopes), agent)) in result.interior_mut(frame).zip(sources) {
            let start = agent.start_velocity.map(|velocity| velocity - frame.cruise(agent, pace));
            let penalties = (self.penalty, self.place_penalty(frame));
            right_hand_side(request.step, penalties, copies, (from, slopes), start, offsets);
            let [without, with] = &self.factor;
            let factor = if start.is_some() { with } else { without };
            factor.solve(offsets);
        }
        result.pace = pace;
    }

    /// Gradient steps of the controls, projected on box and budget with the budget's copy of the pace.
    fn push_budgets(
        &mut self,
        request: &Request<'_, T, DIM, AGENTS>,
        (iterate, gradient): (&Iterate<T, DIM, NODES, AGENTS>, &Iterate<T, DIM, NODES, AGENTS>),
        result: &mut Iterate<T, DIM, NODES, AGENTS>,
        residual: &mut Residual<T>,
    ) {
        let frame = request.frame;
        let pace = result.pace;
        let step = request.step / T::real(CONTROL_WEIGHT);
        for ((agent, kind), bound) in frame.equipment() {
            let slot = (agent, kind);
            let from = iterate.levels(slot, frame.intervals).iter().zip(gradient.levels(slot, frame.intervals));
            let levels = result.levels_mut(slot, frame.intervals);
            for (level, (&here, &slope)) in levels.iter_mut().zip(from) {
                *level = here - slope * step;
            }
            let copied = self.budgets.get_mut(agent).and_then(|kinds| kinds.get_mut(kind as usize));
            let (Bound::Level { allowance }, Some(copied)) = (bound, copied) else { continue };
            let pace_weight = self.penalty * frame.inertia / T::real(CONTROL_WEIGHT);
            let wanted = pace + copied.multiplier;
            let inside = Budget { allowance, pace_weight }.project(levels, wanted);
            let scale = frame.inertia / T::from_count(frame.intervals);
            residual.moved = residual.moved.max((inside - copied.inside).squared() * scale);
            residual.primal = residual.primal.max((pace - inside).squared() * scale);
            copied.multiplier = wanted - inside;
            copied.inside = inside;
            residual.multiplier = residual.multiplier.max(copied.multiplier.squared() * scale);
        }
    }

    /// Projects every copy on its own set; returns the largest squared residuals.
    fn push_apart(
        &mut self,
        request: &Request<'_, T, DIM, AGENTS>,
        center: T,
        result: &Iterate<T, DIM, NODES, AGENTS>,
    ) -> Residual<T> {
        let frame = request.frame;
        let mut residual = Residual::default();
        let has_places = self.has_places();
        for ((copies, offsets), agent) in self.copies.iter_mut().zip(result.interior(frame)).zip(frame.agent()) {
            push_steps(request, copies, offsets, (center, result.pace), agent, &mut residual);
            if has_places {
                push_places(request, copies, offsets, result.pace, agent, &mut residual);
            }
        }
        residual
    }
}

/// Shortens levels to exactly what the budgets allow at the iterate's pace.
fn settle_budgets<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize>(
    frame: &Frame<T, DIM, AGENTS>,
    result: &mut Iterate<T, DIM, NODES, AGENTS>,
) {
    let pace = result.pace;
    for (slot, bound) in frame.equipment() {
        if let Bound::Level { allowance } = bound {
            trim(result.levels_mut(slot, frame.intervals), allowance * pace);
        }
    }
}

/// K e - alpha g + the pulls of the copies, node by node.
fn right_hand_side<T: Real, const DIM: usize, const NODES: usize>(
    step: T,
    (penalty, place_penalty): (T, T),
    copies: &Copies<T, DIM, NODES>,
    (from, slopes): (&[Point<T, DIM>], &[Point<T, DIM>]),
    start: Option<Point<T, DIM>>,
    offsets: &mut [Point<T, DIM>],
) {
    let size = offsets.len();
    let zero = Point::<T, DIM>::zeros();
    // Rows of D1' and D2' at interior node i take the steps into i and i + 1, the bends at i - 1, i and i + 1.
    let mut bend_before = zero;
    let mut before = zero;
    let after = from.iter().skip(1).chain(core::iter::once(&zero));
    let nodes = offsets.iter_mut().zip(from).zip(after).zip(slopes).enumerate();
    let steps = copies.step.iter().zip(copies.step.iter().skip(1));
    let bends = copies.bend.iter().skip(1).zip(copies.bend.iter().skip(2));
    for ((((index, (((offset, &here), &next), slope)), (into, out)), (bend, bend_next)), place) in
        nodes.zip(steps).zip(bends).zip(&copies.place)
    {
        let bend_here = bend.pull();
        let bend_after = if index + 1 < size { bend_next.pull() } else { zero };
        let stretched = here + here - before - next;
        let pulled = (into.pull() - out.pull()) * penalty
            + (bend_before + bend_after - bend_here - bend_here) * penalty
            + place.pull() * place_penalty;
        *offset = stretched - slope * step + pulled;
        if let (0, Some(start), Some(first)) = (index, start, copies.bend.first()) {
            // The row e_1 = start velocity - cruise + change.
            *offset += (first.pull() + start) * penalty;
        }
        bend_before = bend_here;
        before = here;
    }
}

/// Steps and bends of one agent.
fn push_steps<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize>(
    request: &Request<'_, T, DIM, AGENTS>,
    copies: &mut Copies<T, DIM, NODES>,
    offsets: &[Point<T, DIM>],
    (center, pace): (T, T),
    agent: &AgentFrame<T, DIM>,
    residual: &mut Residual<T>,
) {
    let kept = T::one() - request.margin;
    let cruise = request.frame.cruise(agent, pace);
    let bend_most = bend_bound(agent.bend_max, center, pace);
    let mut bend_radius = agent.first_bend(bend_most) * kept;
    let zero = Point::<T, DIM>::zeros();
    let mut before = zero;
    let mut step_before = agent.start_velocity.map(|velocity| velocity - cruise);
    let all = offsets.iter().chain(core::iter::once(&zero));
    for ((step, bend), &offset) in copies.step.iter_mut().zip(&mut copies.bend).zip(all) {
        let change = offset - before;
        step.hold_in_ball(&(change + cruise), kept, residual);
        if let Some(last) = step_before {
            bend.hold_in_ball(&(change - last), bend_radius, residual);
        }
        (before, step_before) = (offset, Some(change));
        bend_radius = bend_most * kept;
    }
}

/// Positions of one agent.
fn push_places<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize>(
    request: &Request<'_, T, DIM, AGENTS>,
    copies: &mut Copies<T, DIM, NODES>,
    offsets: &[Point<T, DIM>],
    pace: T,
    agent: &AgentFrame<T, DIM>,
    residual: &mut Residual<T>,
) {
    for (node, (place, offset)) in copies.place.iter_mut().zip(offsets).enumerate() {
        place.hold_in_box(offset, &walls(request, agent, node, pace), residual);
    }
}

/// The lowest and the highest offset of an interior node.
#[inline(always)]
fn walls<T: Real, const DIM: usize, const AGENTS: usize>(
    request: &Request<'_, T, DIM, AGENTS>,
    agent: &AgentFrame<T, DIM>,
    node: usize,
    pace: T,
) -> [Point<T, DIM>; 2] {
    let count = T::from_count(request.frame.intervals.max(1));
    let scale = pace / agent.stride;
    let line = agent.start + agent.line * (T::from_count(node + 1) / count);
    [(request.domain.min - line) * scale, (request.domain.max - line) * scale]
}

/// The point of a box nearest to `value`.
fn held_in_box<T: Real, const DIM: usize>(
    value: &Point<T, DIM>,
    low: &Point<T, DIM>,
    high: &Point<T, DIM>,
) -> Point<T, DIM> {
    let mut inside = *value;
    for ((component, &low), &high) in inside.iter_mut().zip(low.iter()).zip(high.iter()) {
        *component = component.clamp_to(low, high);
    }
    inside
}

/// Whether a position is outside the domain by more than the tolerance.
fn is_outside<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize>(
    request: &Request<'_, T, DIM, AGENTS>,
    result: &Iterate<T, DIM, NODES, AGENTS>,
) -> bool {
    result.interior(request.frame).zip(request.frame.agent()).any(|(offsets, agent)| {
        offsets.iter().enumerate().any(|(node, offset)| {
            let [low, high] = walls(request, agent, node, result.pace);
            norm_squared(&(offset - held_in_box(offset, &low, &high))) > request.tolerance.squared()
        })
    })
}

#[cfg(test)]
mod tests;
