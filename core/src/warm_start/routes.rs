//! What a sweep of the lattice finds: how the flight is cut into slices, the cheapest ways by number of slices, and how one is
//! laid at a trajectory's nodes.
//!
//! Limits: [`SLICES_MAX`] slices, and [`ROUTES_MAX`] ways a sweep.

use heapless::Vec;

use crate::math::{Point, Real, keep_least};
use crate::metrics::Sample;
use crate::scenario::{Agent, Domain, View};
use crate::trajectory::{Track, Trajectory};

use super::Variant;
use super::equipment::Prices;
use super::field::{Field, Slice};
use super::grid::Grid;
use super::sweep::Lens;

/// Speed factor that the grid is laid for, whatever the variant's, so that all variants share its costs.
const INFLATION_MAX: f64 = 1.25;
/// Fewest and most slices of a flight.
pub(super) const SLICES_MIN: usize = 2;
pub(super) const SLICES_MAX: usize = if cfg!(feature = "compact") { 32 } else { 72 };
/// Flight times of one sweep that are kept, those of the cheapest ways.
pub(crate) const ROUTES_MAX: usize = if cfg!(feature = "compact") { 2 } else { 8 };
/// Times that the corners of a path are rounded, each over one node to either side.
const ROUNDINGS: usize = 2;

/// Ways of one sweep, the cheapest first.
#[derive(Clone, Debug)]
pub(crate) struct Routes<T, const DIM: usize> {
    pub(super) plan: Plan<T, DIM>,
    pub(super) list: Vec<Route<T>, ROUTES_MAX>,
}

/// The cheapest way of so many slices.
#[derive(Clone, Debug)]
pub(super) struct Route<T> {
    /// Penalty on late arrival included.
    pub(super) cost: T,
    pub(super) slices: usize,
    /// Where it is after every slice but the last, the last of them first.
    pub(super) cells: Vec<u16, SLICES_MAX>,
}

/// Grid, slices and reach of one search.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plan<T, const DIM: usize> {
    pub(super) grid: Grid<T, DIM>,
    /// Slices of the longest flight time.
    pub(super) slices: usize,
    /// Slices of the shortest.
    pub(super) fewest: usize,
    /// Distance that one slice reaches, length units.
    pub(super) reach: T,
    /// Length of a slice, s.
    pub(super) interval: T,
    /// The longest flight time, s.
    pub(super) longest: T,
    /// Longest way that any variant on this grid goes, length units.
    pub(super) farthest: T,
}

impl<T: Real, const DIM: usize> Routes<T, DIM> {
    /// None yet.
    pub(super) fn of(plan: &Plan<T, DIM>) -> Self {
        Self { plan: *plan, list: Vec::new() }
    }

    /// How many there are.
    pub(crate) fn len(&self) -> usize {
        self.list.len()
    }

    /// Estimated cost of the cheapest, the penalty on late arrival included.
    #[cfg(test)]
    pub(crate) fn cost(&self) -> T {
        self.list.first().map_or(T::INFINITY, |route| route.cost)
    }

    /// Writes one of them, counted from the cheapest, at equal times to the track of `agent`, with its flight time; after `pass`, as the field counts them.
    pub(crate) fn lay<const NODES: usize, const AGENTS: usize>(
        &self,
        number: usize,
        scenario: &View<'_, T, DIM>,
        trajectory: &mut Trajectory<T, DIM, NODES, AGENTS>,
        (agent, prices, pass): (usize, Prices<T>, usize),
        scratch: &mut [Sample<T, DIM>],
    ) {
        let Some(route) = self.list.get(number) else { return };
        trajectory.set_duration(scenario.frame.start_time, self.plan.duration(route.slices));
        let Some(field) = Field::new(scenario, trajectory, agent, prices, pass, scratch) else { return };
        let track = trace(&field.of_lattice(), &self.plan, route, trajectory, scratch);
        if let (Some(slot), Some(track)) = (trajectory.tracks.get_mut(agent), track) {
            *slot = track;
        }
    }

    /// Keeps what is among the cheapest.
    pub(super) fn enter(&mut self, new: Route<T>) {
        keep_least(&mut self.list, new, |route| route.cost);
    }
}

impl<T: Real, const DIM: usize> Plan<T, DIM> {
    /// Lays the grid, and cuts the flight into slices that reach about the variant's number of cells.
    pub(super) fn new(
        domain: &Domain<T, DIM>,
        agent: &Agent<T, DIM>,
        variant: &Variant<T>,
        (cells_max, parents_max): (usize, usize),
    ) -> Self {
        let way = agent.speed_max * variant.duration * variant.inflation;
        let farthest =
            agent.speed_max * variant.span.max(variant.duration) * T::real(INFLATION_MAX).max(variant.inflation);
        let mut cells = cells_max;
        loop {
            let grid = Grid::new(domain, (&agent.start, &agent.goal), farthest, cells);
            // Never less than the variant's reach: a lattice that falls a little short of a whole cell loses it.
            let count = T::from_count(slices(way / (grid.size() * variant.reach.max(T::one()))));
            let interval = variant.duration / count;
            let [shortest, longest] = variant.others.unwrap_or([variant.duration; 2]);
            // A flight time that is a whole number of slices is one more or less where it is rounded.
            let [most, fewest] = [(longest, 1e-3), (shortest, 1.0 - 1e-3)]
                .map(|(duration, part)| slices(duration / interval + T::real(part)));
            if grid.cells() * (most - SLICES_MIN) <= parents_max || cells <= 1 {
                let fewest = fewest.min(most);
                return Self { grid, slices: most, fewest, reach: way / count, interval, longest, farthest };
            }
            cells -= (cells / 16).max(1);
        }
    }

    /// What so many slices reach from the start, and from which so many reach the goal.
    pub(super) fn lens(&self, agent: &Agent<T, DIM>, (behind, ahead): (usize, usize)) -> Lens<T, DIM> {
        Lens(
            [(agent.start, behind), (agent.goal, ahead)]
                .map(|(end, slices)| (end, self.reach * T::from_count(slices))),
        )
    }

    /// Flight time of so many slices, s.
    pub(super) fn duration(&self, slices: usize) -> T {
        (self.interval * T::from_count(slices)).min(self.longest)
    }
}

/// As many slices as there are whole ones, but some.
fn slices<T: Real>(wanted: T) -> usize {
    (SLICES_MIN..SLICES_MAX).take_while(|&slices| T::from_count(slices + 1) <= wanted).count() + SLICES_MIN
}

/// A route at the trajectory's nodes.
fn trace<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize>(
    field: &Field<'_, T, DIM, NODES, AGENTS>,
    plan: &Plan<T, DIM>,
    route: &Route<T>,
    trajectory: &Trajectory<T, DIM, NODES, AGENTS>,
    scratch: &mut [Sample<T, DIM>],
) -> Option<Track<T, DIM, NODES>> {
    let mut track = *trajectory.tracks.get(field.index)?;
    let intervals = T::from_count(trajectory.intervals().max(1));
    let count = T::from_count(route.slices);
    let mut end = field.agent.goal;
    let mut node = trajectory.intervals();
    // Cells lie between slices; before the first is the start.
    let cells = route.cells.iter().map(|&cell| Some(usize::from(cell))).chain([None]);
    for (number, cell) in (1..=route.slices).rev().zip(cells) {
        let first = T::from_count(number - 1) / count;
        let slice = field.slice(first, T::from_count(number) / count);
        let from = cell.map_or(field.agent.start, |cell| waypoint(field, plan, &slice, cell, scratch));
        while node > 0 && T::from_count(node) / intervals > first {
            let share = (T::from_count(node) / intervals - first) * count;
            let position = from + (end - from) * share.min(T::one());
            *track.path.get_mut(node)? = position;
            node -= 1;
        }
        end = from;
    }
    *track.path.first_mut()? = field.agent.start;
    *track.path.get_mut(trajectory.intervals())? = field.agent.goal;
    // A corner costs steps of the projection; where sensors are sought, it may be at one.
    if field.scenario.is_avoiding() {
        smooth(track.path.get_mut(..trajectory.nodes())?);
    }
    Some(track)
}

/// Rounds the corners of a path.
fn smooth<T: Real, const DIM: usize>(path: &mut [Point<T, DIM>]) {
    for _ in 0..ROUNDINGS {
        let Some(mut before) = path.first().copied() else { return };
        for index in 1..path.len().saturating_sub(1) {
            let Some([here, after]) = path.get_mut(index..=index + 1) else { continue };
            let rounded = (before + *after) * T::real(0.25) + *here * T::real(0.5);
            before = *here;
            *here = rounded;
        }
    }
}

/// Where a path that visits `cell` passes: its centre, or a sensor in it over which flying is cheaper.
fn waypoint<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize>(
    field: &Field<'_, T, DIM, NODES, AGENTS>,
    plan: &Plan<T, DIM>,
    slice: &Slice<T, DIM, AGENTS>,
    cell: usize,
    scratch: &mut [Sample<T, DIM>],
) -> Point<T, DIM> {
    let center = plan.grid.center_of(cell);
    let mut best = (field.rate(slice, &center, scratch), center);
    for sensor in field.scenario.sensors {
        let place = field.scenario.sensor_state(sensor, slice.time()).0;
        if plan.grid.cell(&place) == cell && plan.grid.holds(&place) {
            let rate = field.rate_across(slice, &place, &plan.grid.pitch, scratch);
            if rate < best.0 {
                best = (rate, place);
            }
        }
    }
    best.1
}
