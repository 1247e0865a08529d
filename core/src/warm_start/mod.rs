//! The global start: dynamic programming over cells and slices of time, for one agent with the others frozen.
//!
//! A local method finds the best path of the basin that it starts in, and the straight line may lie in a poor one.
//! `search` looks at all of them, coarsely: it cuts the part of the domain that can be reached into cells and the
//! flight into slices of a few cells each, and finds the cheapest way from start to goal,
//!
//! C_k(c) = min over cells b within reach of c of C_(k-1)(b) + dt mean of the running cost from b to c,
//!
//! where the running cost is the scenario's own at the slice's time. Start and goal are exact points. The result
//! keeps the reach per slice, not the acceleration bound, and is there to be projected on the bounds and polished.
//! A sweep knows the cheapest way for every number of slices, so that one is enough for all flight times of an agent that is
//! alone among sensors to be avoided. Elsewhere each has a sweep of its own: costs of worst-case terms and of other agents
//! depend on the flight time, and sensors that are sought have many good ways, of which different sweeps find different ones.
//!
//! | symbol | name | unit | shape |
//! |---|---|---|---|
//! | tau | `duration` | s | |
//! | | `reach` | cells a slice | |
//! | | `inflation` | | |
//! | C_k | `cost` | objective unit | cells |
//!
//! The lattice knows few directions, so that its paths are longer than need be: an `inflation` of the speed makes up
//! for that, and what is too fast the projection takes back.
//!
//! Costs have peaks at sensors that are narrower than a cell, and location errors are largest there: a cell that holds
//! a sensor costs what flying over the sensor does, where that is less than its centre, and the path goes there.
//!
//! Limits: 255 moves from a cell; a lagged reference point is taken as the present position; what budgets are worth is
//! told by prices, of an earlier path.

mod equipment;
mod field;
mod grid;
mod obstruction;
mod routes;
mod sweep;

use heapless::Vec;

use crate::math::{Point, Real, norm};
use crate::metrics::Sample;
use crate::scenario::{Agent, Reduce, View};
use crate::trajectory::Trajectory;

use field::{Field, SHARPNESS, Slice, Weights};
use grid::Moves;
use obstruction::{first_blocked, first_crossed};
use routes::{Plan, Route, SLICES_MAX, SLICES_MIN};
use sweep::{Block, Patch, Sweep};

pub(crate) use equipment::{Level, Prices, azimuth_of_nearest, equip, equip_elsewhere};
pub(crate) use field::LARGE_TEAM;
pub use obstruction::{Blocked, Obstruction};
pub(crate) use routes::{ROUTES_MAX, Routes};

/// Variants that [`variants`] lists at most.
pub const VARIANTS_MAX: usize = 8;
/// Largest running cost of a cell: sums of them are finite in single precision.
const RATE_MAX: f64 = 1e30;
/// Cost of a free cell, relative to that of a blocked one, where the question is what blocks the way.
const FREE: f64 = 1e-3;

/// How coarsely to search, and for what flight time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Variant<T> {
    /// Cells that a slice of time reaches, 3.5 to 4.5.
    pub reach: T,
    /// Factor on the speed, 1 to 1.25.
    pub inflation: T,
    /// Flight time, s.
    pub duration: T,
    /// Flight time that the grid is laid for, s: variants that share one share its costs.
    pub span: T,
    /// The shortest and the longest of other flight times that the sweep looks at too, s; `None` where costs depend on it.
    pub others: Option<[T; 2]>,
}

/// How blocked cells are told from free ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Caution {
    /// Regions grow by half a cell, and limits hold at the centre.
    Careful,
    /// Regions are as they are, and a limit that holds anywhere in the cell will do.
    Bold,
    /// Blocked cells can be crossed, at a price.
    Through,
}

/// Running cost of each of `CELLS` cells; kept from search to search where it does not change with time.
#[derive(Clone, Debug)]
pub(crate) struct Landscape<T, const CELLS: usize> {
    rates: [f32; CELLS],
    /// What they are of.
    surveyed: Survey<T>,
}

/// Memory of one search: room for `CELLS` cells, and for `PARENTS` entries, one a cell and inner slice.
#[derive(Clone, Debug)]
pub(crate) struct Tables<const CELLS: usize, const PARENTS: usize> {
    cost: [f32; CELLS],
    next: [f32; CELLS],
    parents: [u8; PARENTS],
    moves: Moves,
}

/// What a search works on.
pub(crate) struct Lattice<'a, T, const CELLS: usize, const PARENTS: usize> {
    pub(crate) landscape: &'a mut Landscape<T, CELLS>,
    pub(crate) tables: &'a mut Tables<CELLS, PARENTS>,
}

/// What a landscape that does not change with time depends on.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Survey<T> {
    is_known: bool,
    agent: usize,
    caution: Caution,
    /// Lowest corner, then sides of a cell.
    grid: [[T; 3]; 2],
    equipment: [T; 4],
    weights: Weights<T>,
}

/// A few searches that differ in what a lattice gets wrong, and in flight time where that is free.
#[must_use]
pub fn variants<T: Real, const DIM: usize>(scenario: &View<'_, T, DIM>) -> Vec<Variant<T>, VARIANTS_MAX> {
    let frame = &scenario.frame;
    let allowed = frame.time.max - frame.start_time;
    let target = frame.time.target - frame.start_time;
    let is_urged = frame.time.penalty > T::zero();
    // With a penalty the best arrival is near the target, before or after it; without, anywhere up to the end.
    let least = (scenario.shortest_flight() * T::real(1.02)).min(allowed);
    let most = if is_urged { target.max(least).min(allowed) } else { allowed };
    let at = |share: f64| least + (most - least) * T::real(share);
    let late = |part: f64| (most * T::real(1.0 + part)).min(allowed);
    let roomy = if is_urged { late(0.06) } else { at(0.5) };
    let mut all = Vec::new();
    // One sweep for all flight times finds the best way for each; what it does not find are others that are nearly as good.
    if scenario.agents.len() == 1 && scenario.is_avoiding() {
        let until = if is_urged { late(0.06) } else { most };
        for (reach, inflation) in [(4.0, 1.12), (3.5, 1.0)] {
            let (reach, inflation) = (T::real(reach), T::real(inflation));
            let others = Some([least, until]);
            let _ = all.push(Variant { reach, inflation, duration: most, span: until, others });
        }
        return all;
    }
    let list = if is_urged {
        [
            (4.0, 1.12, at(1.0)),
            (4.0, 1.12, at(0.5)),
            (4.0, 1.12, late(0.06)),
            (4.5, 1.25, at(1.0)),
            (3.5, 1.0, late(0.01)),
            (4.5, 1.25, late(0.06)),
            (4.0, 1.12, late(0.03)),
            (4.5, 1.25, at(0.2)),
        ]
    } else {
        [
            (4.0, 1.12, at(0.1)),
            (4.0, 1.12, at(0.3)),
            (4.0, 1.12, at(1.0)),
            (4.5, 1.25, at(0.03)),
            (4.0, 1.12, at(0.6)),
            (4.5, 1.25, at(0.2)),
            (3.5, 1.0, at(0.4)),
            (4.5, 1.25, at(0.8)),
        ]
    };
    // A large team takes one way, with time to spare: whatever is laid costs as much as the team is large.
    let list = if scenario.agents.len() < LARGE_TEAM { list } else { [(4.0, 1.12, roomy); VARIANTS_MAX] };
    let span = list.iter().fold(T::zero(), |span, &(_, _, duration)| span.max(duration));
    let count = if scenario.agents.len() < LARGE_TEAM { VARIANTS_MAX } else { 1 };
    for (reach, inflation, duration) in list.into_iter().take(count) {
        let (reach, inflation) = (T::real(reach), T::real(inflation));
        // There is room for as many as are listed.
        let _ = all.push(Variant { reach, inflation, duration, span, others: None });
    }
    all
}

/// Finds the cheapest lattice path of `agent` for each flight time of a variant, and writes the cheapest of them, at equal
/// times, to its track in `trajectory`, with its flight time.
///
/// `trajectory` must be of the scenario's size, with some path in every track: the other agents keep theirs, and that
/// of `agent` is where worst-case terms start from. Levels of jamming and dropout stay what they are: see [`equip`].
///
/// # Errors
/// Where there is no path, what closes the way. The path of `agent` is then not to be used.
pub(crate) fn search<
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
    (variant, prices): (&Variant<T>, Prices<T>),
    lattice: &mut Lattice<'_, T, CELLS, PARENTS>,
    scratch: &mut [Sample<T, DIM>],
) -> Result<Routes<T, DIM>, Obstruction<T, DIM>>
where
    T: Real,
{
    let nowhere = |agent: Option<&Agent<T, DIM>>| Obstruction {
        by: Blocked::Time,
        position: agent.map_or(Point::zeros(), |agent| agent.goal),
        time: scenario.frame.start_time + variant.duration,
    };
    let Some(equipped) = scenario.agents.get(agent) else { return Err(nowhere(None)) };
    let plan = Plan::new(&scenario.frame.domain, equipped, variant, (CELLS, PARENTS));
    let has_extremes = scenario.terms.iter().any(|term| term.reduce == Reduce::Extreme);
    let passes = if has_extremes { SHARPNESS.len() } else { 1 };
    let is_open = scenario.regions.is_empty() && scenario.limits.is_empty();
    for caution in [Caution::Careful, Caution::Bold] {
        let mut found = None;
        for pass in 0..passes {
            found = lattice.pass(scenario, trajectory, (agent, prices), (&plan, caution, pass), scratch);
            if found.is_none() {
                break;
            }
        }
        if let Some(found) = found {
            return Ok(found);
        }
        if is_open {
            break;
        }
    }
    match lattice.pass(scenario, trajectory, (agent, prices), (&plan, Caution::Through, 0), scratch) {
        Some(_) => Err(first_blocked(scenario, trajectory, agent, scratch).unwrap_or(nowhere(Some(equipped)))),
        None => Err(nowhere(Some(equipped))),
    }
}

impl<T: Real> Survey<T> {
    /// All zeros, as all memory is before it is used: then it takes no room in an image.
    const NOTHING: Self = Self {
        is_known: false,
        agent: 0,
        caution: Caution::Careful,
        grid: [[T::ZERO; 3]; 2],
        equipment: [T::ZERO; 4],
        weights: Weights::NOTHING,
    };
}

impl<T: Real, const CELLS: usize> Landscape<T, CELLS> {
    /// Of nothing.
    pub(crate) const EMPTY: Self = Self { rates: [0.0; CELLS], surveyed: Survey::NOTHING };

    /// Forgets what it is of, which belongs to a scenario.
    pub(crate) fn begin(&mut self) {
        self.surveyed = Survey::NOTHING;
    }
}

impl<const CELLS: usize, const PARENTS: usize> Tables<CELLS, PARENTS> {
    /// All zeros.
    pub(crate) const EMPTY: Self =
        Self { cost: [0.0; CELLS], next: [0.0; CELLS], parents: [0; PARENTS], moves: Moves::none() };
}

impl<T: Real, const CELLS: usize, const PARENTS: usize> Lattice<'_, T, CELLS, PARENTS> {
    /// One search; the cheapest path goes to the trajectory.
    fn pass<const DIM: usize, const NODES: usize, const AGENTS: usize>(
        &mut self,
        scenario: &View<'_, T, DIM>,
        trajectory: &mut Trajectory<T, DIM, NODES, AGENTS>,
        (agent, prices): (usize, Prices<T>),
        (plan, caution, pass): (&Plan<T, DIM>, Caution, usize),
        scratch: &mut [Sample<T, DIM>],
    ) -> Option<Routes<T, DIM>> {
        trajectory.set_duration(scenario.frame.start_time, plan.duration(plan.slices));
        let field = Field::new(scenario, trajectory, agent, prices, pass, scratch)?.of_lattice();
        if field.has_tangents() {
            // Costs are those of the path before this pass.
            self.landscape.begin();
        }
        self.tables.moves.collect(&plan.grid, plan.reach);
        let routes = self.sweep(&field, plan, caution, scratch)?;
        (routes.len() > 0).then_some(())?;
        routes.lay(0, scenario, trajectory, (agent, prices, pass), scratch);
        Some(routes)
    }

    /// All slices, and the cheapest ways that come to the goal; `None` where none can.
    fn sweep<const DIM: usize, const NODES: usize, const AGENTS: usize>(
        &mut self,
        field: &Field<'_, T, DIM, NODES, AGENTS>,
        plan: &Plan<T, DIM>,
        caution: Caution,
        scratch: &mut [Sample<T, DIM>],
    ) -> Option<Routes<T, DIM>> {
        let (cells, counts) = (plan.grid.cells(), &plan.grid.counts);
        let count = T::from_count(plan.slices);
        let (start, goal) = (&field.agent.start, &field.agent.goal);
        let farthest = self.tables.moves.farthest();
        let mut routes = Routes::of(plan);
        let mut alive = Patch::whole(plan.grid.around(start, T::zero())?);
        for number in 1..=plan.slices {
            let slice = field.slice(T::from_count(number - 1) / count, T::from_count(number) / count);
            let left = plan.reach * T::from_count(plan.slices - number);
            let wanted = plan.grid.around(goal, left)?;
            // The first slice goes straight from the start, as far as a slice reaches: farther than any move, where slices are few.
            let reached = if number == 1 {
                plan.grid.around(start, plan.reach)?.grown(1, counts)
            } else {
                alive.block.grown(farthest, counts)
            };
            let arrives = number >= plan.fewest;
            let needed = if arrives { reached.hull(&plan.grid.around(goal, T::zero())?) } else { reached };
            self.survey(field, plan, (number, &slice, &needed), caution, scratch);
            if arrives && let Some((cost, last)) = self.arrive(field, plan, &slice, caution) {
                let time = &field.scenario.frame.time;
                let late = (slice.end() - time.target).max(T::zero());
                let cost = cost + time.penalty * late * late;
                routes.enter(Route { cost, slices: number, cells: self.back(plan, number, last) });
            }
            if number == plan.slices {
                break;
            }
            self.tables.next.iter_mut().take(cells).for_each(|cost| *cost = f32::INFINITY);
            let Some(wanted) = wanted.meet(&reached) else { break };
            let wanted = Patch::of(&plan.grid, wanted, || plan.lens(field.agent, (number, plan.slices - number)));
            if number == 1 {
                self.depart(field, plan, &slice, caution);
            } else {
                self.advance(field, plan, (number, &slice), (&alive, &wanted), caution);
            }
            alive = wanted;
            core::mem::swap(&mut self.tables.cost, &mut self.tables.next);
        }
        Some(routes)
    }

    /// The cells of a way of so many slices that ends in `last`, back to that after the first slice.
    fn back<const DIM: usize>(&self, plan: &Plan<T, DIM>, slices: usize, last: usize) -> Vec<u16, SLICES_MAX> {
        let cells = plan.grid.cells();
        let (mut all, mut cell) = (Vec::new(), last);
        for number in (SLICES_MIN..=slices).rev() {
            // There is room for every slice, and cells are numbered with fewer bits.
            let _ = all.push(u16::try_from(cell).unwrap_or(u16::MAX));
            if number > SLICES_MIN {
                let parent = self.tables.parents.get((number - 3) * cells + cell).copied().unwrap_or(0);
                cell = self.tables.moves.origin(parent, cell);
            }
        }
        all
    }

    /// Running cost of every cell of a block, unless it is known already.
    fn survey<const DIM: usize, const NODES: usize, const AGENTS: usize>(
        &mut self,
        field: &Field<'_, T, DIM, NODES, AGENTS>,
        plan: &Plan<T, DIM>,
        (number, slice, needed): (usize, &Slice<T, DIM, AGENTS>, &Block<DIM>),
        caution: Caution,
        scratch: &mut [Sample<T, DIM>],
    ) {
        let key = Survey {
            is_known: true,
            agent: field.index,
            caution,
            grid: plan.grid.described(),
            equipment: field.equipment(),
            weights: slice.weights(),
        };
        if self.landscape.surveyed == key {
            return;
        }
        let is_lasting = !field.is_moving();
        self.landscape.surveyed = Survey { is_known: is_lasting, ..key };
        // What moves touch is as near to the start as their ends and to the goal as their beginnings, but for rounding.
        let touched = (!is_lasting && !cfg!(feature = "compact"))
            .then(|| plan.lens(field.agent, (number, plan.slices + 1 - number)).grown(plan.grid.size()));
        let needed = if is_lasting { Block::whole(&plan.grid.counts) } else { *needed };
        // A wall may be thinner than a cell: to be priced, it too has to grow.
        let margin = if caution == Caution::Bold { T::zero() } else { plan.grid.half_diagonal() };
        for ((at, center), rate) in plan.grid.iter().zip(&mut self.landscape.rates) {
            if !needed.holds(&at) || touched.as_ref().is_some_and(|touched| !touched.holds(&center)) {
                continue;
            }
            let way = norm(&(center - field.agent.start)) + norm(&(field.agent.goal - center));
            let cost = if way > plan.farthest + plan.grid.size() {
                T::INFINITY
            } else if caution == Caution::Through {
                if field.blocked(slice, &center, margin, scratch).is_some() { T::one() } else { T::real(FREE) }
            } else {
                field.best_rate(slice, (&center, &plan.grid.pitch), (caution, margin), scratch)
            };
            *rate = stored(cost);
        }
        if caution == Caution::Through {
            return;
        }
        for sensor in field.scenario.sensors {
            let place = field.scenario.sensor_state(sensor, slice.time()).0;
            let cell = plan.grid.cell(&place);
            if !plan.grid.holds(&place) || !needed.holds(&plan.grid.coordinates(cell)) {
                continue;
            }
            let rate = self.landscape.rates.get_mut(cell);
            if let Some(rate) = rate.filter(|rate| rate.finite()) {
                *rate = rate.min(stored(field.rate_across(slice, &place, &plan.grid.pitch, scratch)));
            }
        }
    }

    /// The first slice: from the start itself.
    fn depart<const DIM: usize, const NODES: usize, const AGENTS: usize>(
        &mut self,
        field: &Field<'_, T, DIM, NODES, AGENTS>,
        plan: &Plan<T, DIM>,
        slice: &Slice<T, DIM, AGENTS>,
        caution: Caution,
    ) {
        let start = field.agent.start;
        for (cell, (_, center)) in plan.grid.iter().enumerate() {
            if norm(&(center - start)) <= plan.reach && is_clear(field, slice, (&start, &center), caution) {
                let mean = self.mean_from(plan, &center, &start);
                if let Some(cost) = self.tables.next.get_mut(cell) {
                    *cost = (mean * plan.interval).to_f32();
                }
            }
        }
    }

    /// An inner slice: from cell to cell.
    fn advance<const DIM: usize, const NODES: usize, const AGENTS: usize>(
        &mut self,
        field: &Field<'_, T, DIM, NODES, AGENTS>,
        plan: &Plan<T, DIM>,
        (number, slice): (usize, &Slice<T, DIM, AGENTS>),
        patches: (&Patch<DIM>, &Patch<DIM>),
        caution: Caution,
    ) {
        let cells = plan.grid.cells();
        let Tables { cost, next, parents, moves } = &mut *self.tables;
        let Some(parents) = parents.get_mut((number - 2) * cells..(number - 1) * cells) else {
            return;
        };
        let landscape = &self.landscape.rates;
        let mut sweep = Sweep { landscape, cost, next, parents, interval: plan.interval.to_f32() };
        let is_open = caution == Caution::Through || field.scenario.regions.is_empty();
        let clear = (!is_open).then_some(|from: usize, to: usize| {
            is_clear(field, slice, (&plan.grid.center_of(from), &plan.grid.center_of(to)), caution)
        });
        sweep.run(&plan.grid.counts, moves.all(), patches, clear);
    }

    /// The last slice: to the goal itself.
    fn arrive<const DIM: usize, const NODES: usize, const AGENTS: usize>(
        &self,
        field: &Field<'_, T, DIM, NODES, AGENTS>,
        plan: &Plan<T, DIM>,
        slice: &Slice<T, DIM, AGENTS>,
        caution: Caution,
    ) -> Option<(T, usize)> {
        let goal = field.agent.goal;
        let mut best = None;
        let near = plan.grid.around(&goal, plan.reach)?;
        for cell in near.cells(&plan.grid.counts) {
            let before = T::of_f32(self.tables.cost.get(cell).copied().unwrap_or(f32::INFINITY));
            let center = plan.grid.center_of(cell);
            if before == T::INFINITY || norm(&(goal - center)) > plan.reach {
                continue;
            }
            let total = before + self.mean_from(plan, &center, &goal) * plan.interval;
            let is_better = best.is_none_or(|(least, _)| total < least) && total < T::INFINITY;
            if is_better && is_clear(field, slice, (&center, &goal), caution) {
                best = Some((total, cell));
            }
        }
        best
    }

    /// Mean of the running cost from a cell's centre to an end of the path, whose own cell is left out: the end may
    /// lie on the free side of it.
    fn mean_from<const DIM: usize>(&self, plan: &Plan<T, DIM>, center: &Point<T, DIM>, end: &Point<T, DIM>) -> T {
        let step = end - center;
        let size = plan.grid.size();
        let last = plan.grid.cell(end);
        let mut samples = 1;
        while T::from_count(samples) * size < norm(&step) && samples < grid::MOVES_MAX {
            samples += 1;
        }
        let (mut sum, mut count) = (T::zero(), 0);
        for sample in 0..=samples {
            let cell = plan.grid.cell(&(center + step * (T::from_count(sample) / T::from_count(samples))));
            if sample == 0 || cell != last {
                sum += T::of_f32(self.landscape.rates.get(cell).copied().unwrap_or(f32::INFINITY));
                count += 1;
            }
        }
        sum / T::from_count(count)
    }
}

/// A running cost as a landscape holds it; infinite where it is no number.
fn stored<T: Real>(cost: T) -> f32 {
    let most = T::real(RATE_MAX);
    if cost.finite() { cost.clamp_to(-most, most).to_f32() } else { f32::INFINITY }
}

/// Whether a move keeps out of all regions that are forbidden in the slice.
fn is_clear<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize>(
    field: &Field<'_, T, DIM, NODES, AGENTS>,
    slice: &Slice<T, DIM, AGENTS>,
    (from, to): (&Point<T, DIM>, &Point<T, DIM>),
    caution: Caution,
) -> bool {
    caution == Caution::Through || first_crossed(field.scenario, slice, (from, to)).is_none()
}

#[cfg(test)]
mod tests;
