//! Slacks of everything that is kept by its own barrier here, their multipliers, and how far a step may go.
//!
//! | symbol | name | shape |
//! |---|---|---|
//! | g | slack: speed, acceleration, box, levels, budgets, pace | many |
//! | lambda | multiplier, close to mu / g | as g |
//!
//! Regions, separations and limits have their barrier in [`crate::solver::guard`].

use crate::math::{Point, Real, origin};
use crate::scenario::Domain;
use crate::solver::controls::{Bound, KINDS};
use crate::solver::coordinates::{AgentFrame, Frame, Iterate};

use super::rows::for_each_ball;

/// A factor, and one over it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Range<T> {
    most: T,
    least: T,
}

impl<T: Real> Range<T> {
    pub(super) fn of(factor: T) -> Self {
        Self { most: factor, least: T::one() / factor }
    }
}

/// A multiplier within a factor of its central value mu / g.
#[inline]
pub(super) fn held<T: Real>(multiplier: T, central: T, range: Range<T>) -> T {
    multiplier.max(central * range.least).min(central * range.most)
}

/// The multipliers of one agent; those of worst values are always central.
#[derive(Clone, Debug)]
pub(super) struct Multipliers<T, const DIM: usize, const NODES: usize> {
    /// Steps, then bends, by interval.
    pub(super) ball: [[T; NODES]; 2],
    /// Lower and upper bounds of positions, by interior index.
    pub(super) place: [[Point<T, DIM>; NODES]; 2],
    /// Lower and upper bounds of levels, by kind and node - 1.
    pub(super) level: [[[T; NODES]; KINDS]; 2],
    pub(super) budget: [T; KINDS],
}

impl<T: Real, const DIM: usize, const NODES: usize> Multipliers<T, DIM, NODES> {
    pub(super) const fn zeros() -> Self {
        let none = [T::ZERO; NODES];
        Self { ball: [none; 2], place: [[origin(); NODES]; 2], level: [[none; KINDS]; 2], budget: [T::ZERO; KINDS] }
    }

    /// The multiplier of a ball by its place in the order of the visitor.
    pub(super) fn of_ball(&mut self, place: usize, intervals: usize) -> Option<&mut T> {
        let [steps, bends] = &mut self.ball;
        if place < intervals { steps.get_mut(place) } else { bends.get_mut(place - intervals) }
    }

    /// The multiplier of a box side.
    pub(super) fn of_wall(&mut self, wall: &Wall<T>) -> Option<&mut T> {
        self.place.get_mut(wall.side)?.get_mut(wall.node)?.get_mut(wall.component)
    }
}

/// A box side at an interior node: slack and its derivatives by the offset's component and by the pace.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wall<T> {
    pub(super) node: usize,
    pub(super) component: usize,
    /// 0 for the lower side, 1 for the upper.
    pub(super) side: usize,
    pub(super) slack: T,
    pub(super) by_offset: T,
    pub(super) by_pace: T,
}

/// Visits the box sides of an agent.
pub(super) fn for_each_wall<T: Real, const DIM: usize, const AGENTS: usize>(
    frame: &Frame<T, DIM, AGENTS>,
    domain: &Domain<T, DIM>,
    agent: &AgentFrame<T, DIM>,
    (offsets, pace): (&[Point<T, DIM>], T),
    mut visit: impl FnMut(&Wall<T>),
) {
    // The box as seen from the start, and by how much of it each node is further on.
    let (low, high) = ((domain.min - agent.start) / agent.stride, (domain.max - agent.start) / agent.stride);
    let advance = agent.line / (T::from_count(frame.intervals.max(1)) * agent.stride);
    for (node, offset) in offsets.iter().enumerate() {
        let along = advance * T::from_count(node + 1);
        let (low, high) = (low - along, high - along);
        for (component, ((&value, &low), &high)) in offset.iter().zip(low.iter()).zip(high.iter()).enumerate() {
            let one = T::one();
            visit(&Wall { node, component, side: 0, slack: value - low * pace, by_offset: one, by_pace: -low });
            visit(&Wall { node, component, side: 1, slack: high * pace - value, by_offset: -one, by_pace: high });
        }
    }
}

/// A sum of logarithms that takes one logarithm for many numbers.
#[derive(Clone, Copy, Debug)]
pub(super) struct LogSum<T> {
    product: T,
    sum: T,
}

impl<T: Real> LogSum<T> {
    pub(super) fn new() -> Self {
        Self { product: T::one(), sum: T::zero() }
    }

    /// Adds ln `number`; minus infinity for what is not positive.
    #[inline]
    pub(super) fn add(&mut self, number: T) {
        if number.is_not_a_number() || number <= T::zero() {
            self.sum = -T::INFINITY;
            return;
        }
        self.product *= number;
        if self.product < T::one() / T::LARGE.sqrt() || self.product > T::LARGE.sqrt() {
            self.sum += self.product.ln();
            self.product = T::one();
        }
    }

    pub(super) fn total(&self) -> T {
        self.sum + self.product.ln()
    }
}

/// Sum of the logarithms of all slacks; minus infinity where one is not positive.
pub(super) fn log_slacks<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize>(
    frame: &Frame<T, DIM, AGENTS>,
    domain: &Domain<T, DIM>,
    iterate: &Iterate<T, DIM, NODES, AGENTS>,
) -> T {
    let mut logs = LogSum::new();
    frame.pace_slacks(iterate.pace).into_iter().flatten().for_each(|slack| logs.add(slack));
    for (offsets, agent) in iterate.interior(frame).zip(frame.agent()) {
        for_each_ball(frame, agent, offsets, iterate.pace, |_, ball| logs.add(ball.slack()));
        for_each_wall(frame, domain, agent, (offsets, iterate.pace), |wall| logs.add(wall.slack));
    }
    for (slot, bound) in frame.equipment() {
        let Bound::Level { allowance } = bound else { continue };
        let mut rest = allowance * iterate.pace;
        for &level in iterate.levels(slot, frame.intervals) {
            logs.add(level);
            logs.add(T::one() - level);
            rest -= level;
        }
        logs.add(rest);
    }
    logs.total()
}

/// Largest share of a step of levels that keeps them, and their budgets, inside.
pub(super) fn level_share<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize>(
    frame: &Frame<T, DIM, AGENTS>,
    from: &Iterate<T, DIM, NODES, AGENTS>,
    to: &Iterate<T, DIM, NODES, AGENTS>,
) -> T {
    let mut share = T::one();
    let mut keep = |slack: T, slack_there: T| {
        if slack_there < T::zero() {
            share = share.min(slack / (slack - slack_there));
        }
    };
    for (slot, bound) in frame.equipment() {
        let Bound::Level { allowance } = bound else { continue };
        let mut rest = (allowance * from.pace, allowance * to.pace);
        for (&a, &b) in from.levels(slot, frame.intervals).iter().zip(to.levels(slot, frame.intervals)) {
            keep(a, b);
            keep(T::one() - a, T::one() - b);
            rest = (rest.0 - a, rest.1 - b);
        }
        keep(rest.0, rest.1);
    }
    share
}
