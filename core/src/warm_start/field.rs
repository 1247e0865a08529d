//! What it costs one agent to be somewhere in a slice of time, and whether it may be there.
//!
//! The cost is the scenario's own: every term that is active in the slice, by the part of the slice that lies in its
//! window, with sign and weights. The other agents stay on their tracks; where the agent jams, their terms count too.
//! The agent jams, and is silent, where that pays at the prices that its budgets have ([`super::equipment`]).
//!
//! A worst-case term is its log-sum-exp along the path, majorised by its tangent at an earlier path: that is a sum
//! along the path again, and minimising it never makes the smoothed worst value worse.

use core::cell::Cell;

use heapless::Vec;

use crate::constraints::region::horizontal;
use crate::math::{Point, Real};
use crate::metrics::{Digits, Needs, Sample, Situation, Values, figures};
use crate::model::jamming::Emitter;
use crate::objective::needed_values;
use crate::scenario::{
    Agent, BeamPattern, Betrayal, Limit, Reduce, Region, Sense, StoredSensor, TERMS_MAX, Term, View, Window,
};
use crate::trajectory::Trajectory;

use super::equipment::{Doing, Prices, azimuth_of_nearest, levels};
use super::{Blocked, Caution};

/// Agents of a large team.
pub(crate) const LARGE_TEAM: usize = 3;
/// exp of more than this is held, for the sake of single precision.
const EXPONENT_MAX: f64 = 60.0;
/// Sharpness of worst-case terms by pass, over the spread of the metric along the path before.
pub(super) const SHARPNESS: [f64; 3] = [10.0, 30.0, 60.0];

/// The tangent of one worst-case term.
#[derive(Clone, Copy, Debug)]
struct Tangent<T> {
    sharpness: T,
    level: T,
    /// Per second, at the level.
    scale: T,
}

/// The problem of one agent.
pub(super) struct Field<'a, T, const DIM: usize, const NODES: usize, const AGENTS: usize> {
    pub(super) scenario: &'a View<'a, T, DIM>,
    trajectory: &'a Trajectory<T, DIM, NODES, AGENTS>,
    pub(super) index: usize,
    pub(super) agent: &'a Agent<T, DIM>,
    tangents: [Tangent<T>; TERMS_MAX],
    prices: Prices<T>,
    /// Whether what jamming does to others counts.
    heeds_others: bool,
    /// Levels of jamming and of dropout to choose from, where there is such equipment.
    jam: Option<[T; 2]>,
    dropout: Option<[T; 2]>,
}

/// A slice of time.
pub(super) struct Slice<T, const DIM: usize, const AGENTS: usize> {
    window: Window<T>,
    time: T,
    /// Coefficient of each term for this agent, and what it needs.
    own: Weights<T>,
    /// The others: where they are, and their coefficients.
    others: Vec<(Point<T, DIM>, Weights<T>), AGENTS>,
    emitters: Vec<Emitter<T, DIM>, AGENTS>,
    /// What the others cost while this agent does not jam, once it was asked for.
    idle: Cell<Option<T>>,
}

/// Coefficient of each term, and what they need.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Weights<T> {
    of_term: [T; TERMS_MAX],
    needs: Needs,
}

impl<T: Real> Weights<T> {
    pub(super) const NOTHING: Self = Self {
        of_term: [T::ZERO; TERMS_MAX],
        needs: Needs { detection: false, false_alarm: false, location: false },
    };
}

impl<'a, T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize> Field<'a, T, DIM, NODES, AGENTS> {
    /// `None` where there is no such agent. `pass` counts from 0 how often the tangents have been moved.
    pub(super) fn new(
        scenario: &'a View<'a, T, DIM>,
        trajectory: &'a Trajectory<T, DIM, NODES, AGENTS>,
        index: usize,
        prices: Prices<T>,
        pass: usize,
        scratch: &mut [Sample<T, DIM>],
    ) -> Option<Self> {
        let agent = scenario.agents.get(index)?;
        let duration = trajectory.duration();
        let none = Tangent { sharpness: T::zero(), level: T::zero(), scale: T::zero() };
        let mut field = Self {
            scenario,
            trajectory,
            index,
            agent,
            tangents: [none; TERMS_MAX],
            prices,
            heeds_others: true,
            jam: agent.jammer.map(|jammer| levels(jammer.budget, duration)),
            dropout: agent.dropout.map(|dropout| levels(dropout.budget, duration)),
        };
        for (number, term) in scenario.terms.iter().enumerate() {
            if term.reduce == Reduce::Extreme {
                let tangent = field.tangent(term, pass, scratch);
                if let Some(slot) = field.tangents.get_mut(number) {
                    *slot = tangent;
                }
            }
        }
        Some(field)
    }

    /// The same, for a lattice: in a large team, what jamming does to others is left to levels and polish, since it costs as
    /// much to ask as the team is large.
    pub(super) fn of_lattice(mut self) -> Self {
        self.heeds_others = self.scenario.agents.len() < LARGE_TEAM;
        self
    }

    /// Whether costs change from slice to slice with more than the terms' windows.
    pub(super) fn is_moving(&self) -> bool {
        let has_others = self.scenario.agents.len() > 1;
        let has_jammers = self.scenario.agents.iter().any(|agent| agent.jammer.is_some());
        self.scenario.sensors.iter().any(StoredSensor::is_moving)
            || has_others && has_jammers
            || self.scenario.regions.iter().any(|region| region.window != Window::always())
    }

    /// Whether costs depend on the path before, as those of worst-case terms do.
    pub(super) fn has_tangents(&self) -> bool {
        self.scenario.terms.iter().any(|term| term.reduce == Reduce::Extreme)
    }

    /// What costs depend on besides time and place: even levels, and prices.
    pub(super) fn equipment(&self) -> [T; 4] {
        let even = |levels: Option<[T; 2]>| levels.map_or(T::zero(), |levels| levels[0]);
        [even(self.jam), even(self.dropout), self.prices.jam, self.prices.dropout]
    }

    /// A node of the agent's track: the slice that ends there, where it is and what it does.
    pub(super) fn node(&self, node: usize) -> Option<(Slice<T, DIM, AGENTS>, Point<T, DIM>, Doing<T>)> {
        let track = self.trajectory.tracks.get(self.index)?;
        let share = |node: usize| T::from_count(node) / T::from_count(self.trajectory.intervals().max(1));
        let (&level, &azimuth, &dropout) = (track.jam.get(node)?, track.azimuth.get(node)?, track.dropout.get(node)?);
        let slice = self.slice(share(node.saturating_sub(1)), share(node));
        Some((slice, *track.path.get(node)?, Doing { level, azimuth, dropout }))
    }

    /// The tangent at the path as it is.
    fn tangent(&self, term: &Term<T>, pass: usize, scratch: &mut [Sample<T, DIM>]) -> Tangent<T> {
        let (sign, needs) = (sign(term), Needs::of([term.metric]));
        let (mut low, mut high) = (T::INFINITY, -T::INFINITY);
        let mut sum = T::zero();
        let mut sharpness = T::one();
        // First the range, then the sum that needs it.
        for round in 0..2 {
            for node in 1..self.trajectory.nodes() {
                let time = self.trajectory.times.get(node).copied().unwrap_or_default();
                if !term.window.holds(time) {
                    continue;
                }
                let values = needed_values(self.scenario, self.trajectory, (self.index, node), needs, scratch);
                let Some(value) = values.get(term.metric) else {
                    continue;
                };
                if round == 0 {
                    (low, high) = (low.min(sign * value), high.max(sign * value));
                } else {
                    sum += (sharpness * (sign * value - high)).exp();
                }
            }
            let relative = SHARPNESS.get(pass).or(SHARPNESS.last()).copied().unwrap_or(1.0);
            sharpness = T::real(relative) / (high - low).max(high.abs() * T::real(1e-3)).max(T::MIN_POSITIVE);
        }
        let interval = self.trajectory.duration() / T::from_count(self.trajectory.intervals().max(1));
        let whole = sharpness * sum * interval;
        let scale = if whole > T::zero() { T::one() / whole } else { T::zero() };
        Tangent { sharpness, level: high, scale }
    }

    /// The slice from share `from` to share `until` of the flight.
    pub(super) fn slice(&self, from: T, until: T) -> Slice<T, DIM, AGENTS> {
        let (start, duration) = (self.trajectory.start_time(), self.trajectory.duration());
        let window = Window { from: start + duration * from, until: start + duration * until };
        let middle = (from + until) * T::real(0.5);
        let mut own = self.weights(self.index, &window);
        for limit in self.scenario.limits {
            own.needs.add(limit.metric);
        }
        let mut slice = Slice {
            window,
            time: start + duration * middle,
            own,
            others: Vec::new(),
            emitters: Vec::new(),
            idle: Cell::new(None),
        };
        let place = T::from_count(self.trajectory.intervals()) * middle;
        for (index, (agent, track)) in self.scenario.agents.iter().zip(self.trajectory.active()).enumerate() {
            if index == self.index {
                continue;
            }
            let node = (1..self.trajectory.intervals()).take_while(|&node| T::from_count(node) <= place).count();
            let share = place - T::from_count(node);
            let entry = |list: &[T]| list.get(node + 1).copied().unwrap_or_default();
            let (Some(a), Some(b)) = (track.path.get(node), track.path.get(node + 1)) else {
                continue;
            };
            let position = a + (b - a) * share;
            if let Some(jammer) = &agent.jammer {
                let (level, azimuth) = (entry(&track.jam), entry(&track.azimuth));
                // One an agent at most, so there is room; the same for the others.
                let _ = slice.emitters.push(Emitter::new(index, jammer, position, level, azimuth));
            }
            if self.agent.jammer.is_some() && self.heeds_others {
                let _ = slice.others.push((position, self.weights(index, &window)));
            }
        }
        slice
    }

    /// Coefficients of the terms for an agent, by the part of the slice that they are active in.
    fn weights(&self, agent: usize, window: &Window<T>) -> Weights<T> {
        let mut weights = Weights { of_term: [T::zero(); TERMS_MAX], needs: Needs::default() };
        let agent_weight = self.scenario.agents.get(agent).map_or(T::zero(), |agent| agent.weight);
        let length = (window.until - window.from).max(T::MIN_POSITIVE);
        for (term, weight) in self.scenario.terms.iter().zip(&mut weights.of_term) {
            let overlap = term.window.until.min(window.until) - term.window.from.max(window.from);
            let active = (overlap / length).clamp_to(T::zero(), T::one());
            // The tangents are those of this agent's own path.
            let counts = term.reduce == Reduce::Integral || agent == self.index;
            if term.agents.contains(agent) && counts {
                *weight = sign(term) * term.weight * agent_weight * active;
            }
            if *weight != T::zero() {
                weights.needs.add(term.metric);
            }
        }
        weights
    }

    /// Cost a second of being at `position`, what is used of budgets at its price.
    pub(super) fn rate(
        &self,
        slice: &Slice<T, DIM, AGENTS>,
        position: &Point<T, DIM>,
        scratch: &mut [Sample<T, DIM>],
    ) -> T {
        let mut doing = Doing { level: T::zero(), azimuth: T::zero(), dropout: T::zero() };
        let mut best = self.rate_at(slice, position, &doing, scratch);
        if let Some(levels) = self.jam {
            doing.azimuth = self.azimuth(slice.time, position);
            for level in levels {
                let paid = self.prices.jam * level;
                let rate = self.rate_at(slice, position, &Doing { level, ..doing }, scratch) + paid;
                if rate < best {
                    (best, doing.level) = (rate, level);
                }
            }
        }
        let jammed = self.prices.jam * doing.level;
        for dropout in self.dropout.into_iter().flatten() {
            let paid = self.prices.dropout * dropout + jammed;
            best = best.min(self.rate_at(slice, position, &Doing { dropout, ..doing }, scratch) + paid);
        }
        best
    }

    /// Mean cost a second of flying across a cell over `place`, along its axes.
    pub(super) fn rate_across(
        &self,
        slice: &Slice<T, DIM, AGENTS>,
        place: &Point<T, DIM>,
        pitch: &Point<T, DIM>,
        scratch: &mut [Sample<T, DIM>],
    ) -> T {
        let mut sum = T::zero();
        let mut count = 0;
        // Midpoints of quarters of two straight ways across, east and north.
        for (axis, &side) in pitch.iter().enumerate().take(2) {
            for share in [-0.375, -0.125, 0.125, 0.375] {
                let mut position = *place;
                if let Some(component) = position.iter_mut().nth(axis) {
                    *component += side * T::real(share);
                }
                sum += self.rate(slice, &position, scratch);
                count += 1;
            }
        }
        sum / T::from_count(count.max(1))
    }

    /// Cost a second of being at `position` and doing that.
    pub(super) fn rate_at(
        &self,
        slice: &Slice<T, DIM, AGENTS>,
        position: &Point<T, DIM>,
        &Doing { level, azimuth, dropout }: &Doing<T>,
        scratch: &mut [Sample<T, DIM>],
    ) -> T {
        let mut with_own = Vec::<_, AGENTS>::new();
        let mut emitters = slice.emitters.as_slice();
        if let (Some(jammer), true) = (&self.agent.jammer, level > T::zero()) {
            // One an agent at most, so there is room.
            let _ = with_own.extend_from_slice(emitters);
            let _ = with_own.push(Emitter::new(self.index, jammer, *position, level, azimuth));
            emitters = &with_own;
        }
        let betrayal = self.agent.jammer.map_or(Betrayal::None, |jammer| jammer.betrayal);
        let here = Situation { time: slice.time, position: *position, reference: None, dropout, level, betrayal };
        let values = figures(self.scenario, &here, emitters, (slice.own.needs, Digits::Few), scratch);
        if self.scenario.limits.iter().any(|limit| is_outside(limit, &values)) {
            return T::INFINITY;
        }
        let mut rate = self.price(&slice.own, &values);
        if !slice.others.is_empty() {
            let known = slice.idle.get().filter(|_| level == T::zero() && !cfg!(feature = "compact"));
            let others = known.unwrap_or_else(|| self.rate_of_others(slice, emitters, scratch));
            if level == T::zero() {
                slice.idle.set(Some(others));
            }
            rate += others;
        }
        if rate.finite() { rate } else { T::INFINITY }
    }

    /// Cost a second of the other agents, who are where they are.
    #[inline(always)]
    fn rate_of_others(
        &self,
        slice: &Slice<T, DIM, AGENTS>,
        emitters: &[Emitter<T, DIM>],
        scratch: &mut [Sample<T, DIM>],
    ) -> T {
        let mut rate = T::zero();
        for (position, weights) in slice.others.iter().filter(|(_, weights)| !weights.needs.nothing()) {
            let (dropout, level, betrayal) = (T::zero(), T::zero(), Betrayal::None);
            let there =
                Situation { time: slice.time, position: *position, reference: None, dropout, level, betrayal };
            rate +=
                self.price(weights, &figures(self.scenario, &there, emitters, (weights.needs, Digits::Few), scratch));
        }
        rate
    }

    /// Terms, summed.
    fn price(&self, weights: &Weights<T>, values: &Values<T>) -> T {
        let mut sum = T::zero();
        for ((term, &weight), tangent) in self.scenario.terms.iter().zip(&weights.of_term).zip(&self.tangents) {
            let (true, Some(value)) = (weight != T::zero(), values.get(term.metric)) else {
                continue;
            };
            sum += match term.reduce {
                Reduce::Integral => weight * value,
                Reduce::Extreme => {
                    let exponent = tangent.sharpness * (sign(term) * value - tangent.level);
                    weight.abs() * tangent.scale * exponent.min(T::real(EXPONENT_MAX)).exp()
                }
            };
        }
        sum
    }

    /// Direction to the nearest ranging sensor, where jamming does most.
    fn azimuth(&self, time: T, position: &Point<T, DIM>) -> T {
        if self.agent.jammer.is_none_or(|jammer| jammer.pattern == BeamPattern::Isotropic) {
            return T::zero();
        }
        azimuth_of_nearest(self.scenario, position, time)
    }

    /// What forbids being at `position`, or within the margin of it.
    pub(super) fn blocked(
        &self,
        slice: &Slice<T, DIM, AGENTS>,
        position: &Point<T, DIM>,
        margin: T,
        scratch: &mut [Sample<T, DIM>],
    ) -> Option<Blocked> {
        let flat = horizontal(position);
        for (index, region) in self.scenario.regions.iter().enumerate() {
            if slice.meets(region) && region.distance(&flat) < margin {
                return Some(Blocked::Region(index));
            }
        }
        if self.scenario.limits.is_empty() || self.rate(slice, position, scratch) < T::INFINITY {
            return None;
        }
        let betrayal = Betrayal::None;
        let (dropout, level) = (T::zero(), T::zero());
        let here = Situation { time: slice.time, position: *position, reference: None, dropout, level, betrayal };
        let needs = Needs::of_limits(self.scenario.limits);
        let values = figures(self.scenario, &here, &slice.emitters, (needs, Digits::Few), scratch);
        let found = self.scenario.limits.iter().position(|limit| is_outside(limit, &values));
        found.map(Blocked::Limit)
    }

    /// The most favourable position of a cell: its centre, or where caution is thrown to the wind a quarter towards
    /// its corners.
    pub(super) fn best_rate(
        &self,
        slice: &Slice<T, DIM, AGENTS>,
        (center, pitch): (&Point<T, DIM>, &Point<T, DIM>),
        (caution, margin): (Caution, T),
        scratch: &mut [Sample<T, DIM>],
    ) -> T {
        let flat = horizontal(center);
        let is_near = |region: &&Region<T>| region.distance(&flat) < margin;
        if self.scenario.regions.iter().filter(is_near).any(|region| slice.meets(region)) {
            return T::INFINITY;
        }
        let rate = self.rate(slice, center, scratch);
        if rate < T::INFINITY || caution == Caution::Careful || self.scenario.limits.is_empty() {
            return rate;
        }
        let mut best = rate;
        for corner in 0..1_usize << DIM {
            let mut position = *center;
            for (axis, (component, &side)) in position.iter_mut().zip(pitch.iter()).enumerate() {
                let quarter = side * T::real(0.25);
                *component += if (corner >> axis) & 1 == 1 { quarter } else { -quarter };
            }
            best = best.min(self.rate(slice, &position, scratch));
        }
        best
    }
}

impl<T: Real, const DIM: usize, const AGENTS: usize> Slice<T, DIM, AGENTS> {
    /// The middle of the slice, s.
    pub(super) fn time(&self) -> T {
        self.time
    }

    /// The end of the slice, s.
    pub(super) fn end(&self) -> T {
        self.window.until
    }

    /// Coefficients of the terms: slices with the same cost the same, where nothing moves.
    pub(super) fn weights(&self) -> Weights<T> {
        self.own
    }

    /// Whether a region is forbidden at some time of the slice.
    pub(super) fn meets(&self, region: &Region<T>) -> bool {
        region.window.from < self.window.until && self.window.from < region.window.until
    }
}

fn is_outside<T: Real>(limit: &Limit<T>, values: &Values<T>) -> bool {
    values
        .get(limit.metric)
        .is_some_and(|value| limit.max.is_some_and(|max| value > max) || limit.min.is_some_and(|min| value < min))
}

/// 1 where a term is minimised, -1 where it is maximised.
fn sign<T: Real>(term: &Term<T>) -> T {
    match term.sense {
        Sense::Minimize => T::one(),
        Sense::Maximize => -T::one(),
    }
}
