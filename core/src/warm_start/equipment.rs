//! Jamming and silence along a path: what of each budget goes where.
//!
//! | symbol | name | unit | shape |
//! |---|---|---|---|
//! | z | level | 0 .. 1 | nodes |
//! | g(z) | gain: cost at level 0 less that at z | objective unit / s | nodes |
//! | lambda | price of a second at level 1 | objective unit / s | 1 a budget |
//!
//! A node takes the level of a few for which g(z) - lambda z is largest, and the price is the one at which the budget is
//! used up: the Lagrangian relaxation of (49) and (55). Gains need not be concave, and those of silence are not: it does
//! most where it is complete. A beam points where it does most, of the directions to all ranging sensors.
//!
//! The same prices tell the lattice what a cell costs to an agent that will be silent, or jam, where it pays.
//!
//! Limits: three levels; silence is chosen after jamming; a lagged reference point is taken as the present position.

use crate::constraints::region::horizontal;
use crate::math::{Point, Real, norm_squared};
use crate::metrics::Sample;
use crate::scenario::{Agent, BeamPattern, View};
use crate::trajectory::{Track, Trajectory};

use super::Tables;
use super::field::{Field, SHARPNESS};

/// Part of a budget that is laid out, so that rounding does not exceed it.
const SPENT: f64 = 0.999;
/// Gain of a node that a limit leaves no choice.
const GAIN_MAX: f64 = 1e12;
/// Halvings of the price.
const HALVINGS: usize = 30;

/// What a second of jamming and of silence is worth elsewhere on the flight, objective unit / s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Prices<T> {
    pub(crate) jam: T,
    pub(crate) dropout: T,
}

/// What an agent does besides flying.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Doing<T> {
    /// Jamming level.
    pub(super) level: T,
    /// Direction of jamming, rad.
    pub(super) azimuth: T,
    /// Reduction of transmit power.
    pub(super) dropout: T,
}

/// Levels to choose from besides 0: what the budget allows evenly, and all.
pub(super) fn levels<T: Real>(budget: T, duration: T) -> [T; 2] {
    let even = (budget / duration.max(T::MIN_POSITIVE)).clamp_to(T::zero(), T::one());
    // Without prices, all would be taken everywhere.
    [even, if cfg!(feature = "compact") { even } else { T::one() }]
}

/// Lays levels and directions of `agent` along its path anew; returns their prices.
///
/// They are estimates: whoever lays them asks the objective whether they are better.
pub(crate) fn equip<
    T,
    const DIM: usize,
    const NODES: usize,
    const AGENTS: usize,
    const CELLS: usize,
    const PARENTS: usize,
>(
    scenario: &View<'_, T, DIM>,
    trajectory: &mut Trajectory<T, DIM, NODES, AGENTS>,
    agent: usize,
    tables: &mut Tables<CELLS, PARENTS>,
    scratch: &mut [Sample<T, DIM>],
) -> Prices<T>
where
    T: Real,
{
    let mut prices = Prices::default();
    let Some(equipped) = scenario.agents.get(agent) else { return prices };
    let duration = trajectory.duration();
    if let Some(jammer) = &equipped.jammer {
        if jammer.pattern != BeamPattern::Isotropic {
            aim(scenario, trajectory, agent, levels(jammer.budget, duration)[0], scratch);
        }
        prices.jam = lay(scenario, trajectory, (agent, Level::Jam), (jammer.budget, Where::Best), tables, scratch);
    }
    if let Some(dropout) = equipped.dropout {
        prices.dropout =
            lay(scenario, trajectory, (agent, Level::Dropout), (dropout.budget, Where::Best), tables, scratch);
    }
    prices
}

/// Lays one kind of level where it does most of all places where it is not now: all at once to another place is what no
/// local step can do. False where the agent has no such level.
pub(crate) fn equip_elsewhere<
    T,
    const DIM: usize,
    const NODES: usize,
    const AGENTS: usize,
    const CELLS: usize,
    const PARENTS: usize,
>(
    scenario: &View<'_, T, DIM>,
    trajectory: &mut Trajectory<T, DIM, NODES, AGENTS>,
    (agent, level): (usize, Level),
    tables: &mut Tables<CELLS, PARENTS>,
    scratch: &mut [Sample<T, DIM>],
) -> bool
where
    T: Real,
{
    let Some(budget) = scenario.agents.get(agent).and_then(|agent| level.budget(agent)) else { return false };
    lay(scenario, trajectory, (agent, level), (budget, Where::Elsewhere), tables, scratch);
    true
}

/// Which budget.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Level {
    Jam,
    Dropout,
}

/// Which nodes may have a level.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Where {
    /// All.
    Best,
    /// Those that have less than half of it now.
    Elsewhere,
}

impl Level {
    pub(crate) const ALL: [Self; 2] = [Self::Jam, Self::Dropout];

    /// Seconds at level 1 that an agent has, where it has this level.
    fn budget<T: Real, const DIM: usize>(self, agent: &Agent<T, DIM>) -> Option<T> {
        match self {
            Self::Jam => agent.jammer.map(|jammer| jammer.budget),
            Self::Dropout => agent.dropout.map(|dropout| dropout.budget),
        }
    }

    fn of<T, const DIM: usize, const NODES: usize>(self, track: &mut Track<T, DIM, NODES>) -> &mut [T; NODES] {
        match self {
            Self::Jam => &mut track.jam,
            Self::Dropout => &mut track.dropout,
        }
    }
}

/// Lays one kind of level; returns its price.
fn lay<T, const DIM: usize, const NODES: usize, const AGENTS: usize, const CELLS: usize, const PARENTS: usize>(
    scenario: &View<'_, T, DIM>,
    trajectory: &mut Trajectory<T, DIM, NODES, AGENTS>,
    (agent, kind): (usize, Level),
    (budget, place): (T, Where),
    tables: &mut Tables<CELLS, PARENTS>,
    scratch: &mut [Sample<T, DIM>],
) -> T
where
    T: Real,
{
    let (duration, intervals) = (trajectory.duration(), trajectory.intervals());
    let levels = levels(budget, duration);
    // As many levels of 1 as the budget has intervals.
    let allowance = T::from_count(intervals) * budget / duration * T::real(SPENT);
    let gains = [&mut tables.cost, &mut tables.next].map(|gains| gains.get_mut(..intervals).unwrap_or_default());
    weigh(scenario, trajectory, (agent, kind), levels, gains, scratch);
    if let (Where::Elsewhere, Some(track)) = (place, trajectory.tracks.get_mut(agent)) {
        let nodes = kind.of(track).iter().skip(1).take(intervals);
        for (_, gains) in
            nodes.zip(tables.cost.iter_mut().zip(&mut tables.next)).filter(|(level, _)| **level > T::real(0.5))
        {
            (*gains.0, *gains.1) = (0.0, 0.0);
        }
    }
    let gains = [&tables.cost, &tables.next].map(|gains| gains.get(..intervals).unwrap_or_default());
    let price = price(gains, levels, allowance);
    if let Some(track) = trajectory.tracks.get_mut(agent) {
        let nodes = kind.of(track).get_mut(1..=intervals).unwrap_or_default();
        allot(gains, levels, price, allowance, nodes);
    }
    price[1]
}

/// Gain of each level at each node, less what is there already.
fn weigh<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    trajectory: &Trajectory<T, DIM, NODES, AGENTS>,
    (agent, kind): (usize, Level),
    levels: [T; 2],
    [half, full]: [&mut [f32]; 2],
    scratch: &mut [Sample<T, DIM>],
) {
    let Some(field) = Field::new(scenario, trajectory, agent, Prices::default(), SHARPNESS.len(), scratch) else {
        return;
    };
    for (index, (half, full)) in half.iter_mut().zip(full).enumerate() {
        let Some((slice, position, doing)) = field.node(index + 1) else { return };
        let at = |level: T| match kind {
            Level::Jam => Doing { level, dropout: T::zero(), ..doing },
            Level::Dropout => Doing { dropout: level, ..doing },
        };
        let none = field.rate_at(&slice, &position, &at(T::zero()), scratch);
        for (gain, level) in [half, full].into_iter().zip(levels) {
            let there = field.rate_at(&slice, &position, &at(level), scratch);
            // Where a limit forbids both there is nothing to choose.
            let gained = if there < T::INFINITY { none - there } else { T::zero() };
            *gain = gained.min(T::real(GAIN_MAX)).to_f32();
        }
    }
}

/// The level that pays most at a price.
fn choice<T: Real>(gains: [f32; 2], levels: [T; 2], price: T) -> T {
    let [half, full] = gains.map(T::of_f32);
    let worth = [half - price * levels[0], full - price * levels[1]];
    if worth[1] > T::zero() && worth[1] >= worth[0] {
        levels[1]
    } else if worth[0] > T::zero() {
        levels[0]
    } else {
        T::zero()
    }
}

/// The prices between which the budget is used up: at the first it is exceeded, unless that is 0, at the second it is kept.
fn price<T: Real>([half, full]: [&[f32]; 2], levels: [T; 2], allowance: T) -> [T; 2] {
    let used = |price: T| {
        let all = half.iter().zip(full);
        all.fold(T::zero(), |sum, (&half, &full)| sum + choice([half, full], levels, price))
    };
    let least = levels[0].max(T::MIN_POSITIVE);
    let high = half
        .iter()
        .map(|&gain| T::of_f32(gain) / least)
        .chain(full.iter().map(|&gain| T::of_f32(gain)))
        .fold(T::zero(), T::max);
    if used(T::zero()) <= allowance || !high.finite() {
        return [T::zero(); 2];
    }
    let mut between = [T::zero(), high];
    for _ in 0..HALVINGS {
        let middle = (between[0] + between[1]) * T::real(0.5);
        let side = usize::from(used(middle) <= allowance);
        if let Some(end) = between.get_mut(side) {
            *end = middle;
        }
    }
    between
}

/// Writes the levels: those at the higher price, and what is left to those who would pay the lower, first come, first served.
fn allot<T: Real>(gains: [&[f32]; 2], levels: [T; 2], price: [T; 2], allowance: T, nodes: &mut [T]) {
    let mut left = allowance;
    let all = || gains[0].iter().zip(gains[1]).map(|(&half, &full)| [half, full]);
    for (node, gains) in nodes.iter_mut().zip(all()) {
        *node = choice(gains, levels, price[1]);
        left -= *node;
    }
    for (node, gains) in nodes.iter_mut().zip(all()) {
        let more = (choice(gains, levels, price[0]) - *node).min(left).max(T::zero());
        *node += more;
        left -= more;
    }
}

/// Points the beam of an agent at each node at the ranging sensor where that pays most, with at least `level`.
fn aim<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize>(
    scenario: &View<'_, T, DIM>,
    trajectory: &mut Trajectory<T, DIM, NODES, AGENTS>,
    agent: usize,
    level: T,
    scratch: &mut [Sample<T, DIM>],
) {
    for node in 1..trajectory.nodes() {
        let Some(field) = Field::new(scenario, trajectory, agent, Prices::default(), SHARPNESS.len(), scratch) else {
            return;
        };
        let Some((slice, position, doing)) = field.node(node) else { return };
        let doing = Doing { level: doing.level.max(level), ..doing };
        let mut best = (field.rate_at(&slice, &position, &doing, scratch), doing.azimuth);
        for sensor in scenario.sensors.iter().filter(|sensor| sensor.ranging.is_some()) {
            let offset = scenario.sensor_state(sensor, slice.time()).0 - position;
            let azimuth = direction(&offset);
            let rate = field.rate_at(&slice, &position, &Doing { azimuth, ..doing }, scratch);
            if rate < best.0 {
                best = (rate, azimuth);
            }
        }
        if let Some(azimuth) = trajectory.tracks.get_mut(agent).and_then(|track| track.azimuth.get_mut(node)) {
            *azimuth = best.1;
        }
    }
}

/// Direction to the nearest ranging sensor, rad; 0 where there is none.
pub(crate) fn azimuth_of_nearest<T: Real, const DIM: usize>(
    scenario: &View<'_, T, DIM>,
    position: &Point<T, DIM>,
    time: T,
) -> T {
    let mut nearest = (T::INFINITY, T::zero());
    for sensor in scenario.sensors.iter().filter(|sensor| sensor.ranging.is_some()) {
        let offset = scenario.sensor_state(sensor, time).0 - position;
        let square = norm_squared(&offset);
        if square < nearest.0 {
            nearest = (square, direction(&offset));
        }
    }
    nearest.1
}

/// Counter-clockwise from east, rad.
fn direction<T: Real, const DIM: usize>(offset: &Point<T, DIM>) -> T {
    let flat = horizontal(offset);
    flat[1].atan2(flat[0])
}
