//! One slice of the dynamic programme: all moves from the cells that can be reached to those from which the goal can be.
//!
//! | symbol | name | unit | shape |
//! |---|---|---|---|
//! | | [`Block`] | cells | lowest and highest coordinates, both included |
//! | | [`Lens`] | length unit | what a path can reach from the start and still reach the goal from |
//! | | [`Patch`] | cells | what of a block is in a lens |
//!
//! A move does the same to a whole row of cells, one after the other in memory, which is what processors with vectors are quick
//! at. Where every move is open, [`LANES`] cells of a row take all moves in turn; where they must be asked one by one, or code is
//! to be small, a move takes all rows.
//!
//! Limits: rows past [`ROWS_MAX`] are as wide as the block, which is a box around what can be reached.

use heapless::Vec;

use crate::math::{Point, Real, norm_squared};

use super::grid::{BETWEEN_MAX, Grid, Move};

/// Cells that are done together, move by move.
const CHUNK: usize = 32;
/// Cells that take all moves in turn, where any move is open: rows are hardly longer.
const LANES: usize = 8;
/// Infinities, zeros and infinities, [`LANES`] of each: added to the lanes, a part of it keeps those out that are before a row's first
/// cell or past its last, without a choice for each.
const FRAME: [f32; 3 * LANES] = {
    let mut frame = [f32::INFINITY; 3 * LANES];
    let mut lane = 0;
    while lane < LANES {
        frame[LANES + lane] = 0.0;
        lane += 1;
    }
    frame
};
/// Whether patches are smaller than their blocks; where code is to be small they are not.
const HAS_ROWS: bool = !cfg!(feature = "compact");
/// Rows of a patch that know where they begin and end.
const ROWS_MAX: usize = if HAS_ROWS { 192 } else { 0 };
/// Sides of a cell by which a cell that a move looks at may be off its line: half a diagonal, and rounding.
const ASTRAY: f64 = 1.0;
/// Part of a cell by which a patch is larger than its lens, for rounding.
const EDGE: f32 = 0.01;

/// A box of cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Block<const DIM: usize> {
    pub(super) low: [usize; DIM],
    pub(super) high: [usize; DIM],
}

impl<const DIM: usize> Block<DIM> {
    /// All cells of a grid.
    pub(super) fn whole(counts: &[usize; DIM]) -> Self {
        Self { low: [0; DIM], high: counts.map(|count| count.saturating_sub(1)) }
    }

    /// The smallest block that holds both.
    pub(super) fn hull(&self, other: &Self) -> Self {
        let mut hull = *self;
        for ((low, high), (&a, &b)) in hull.low.iter_mut().zip(&mut hull.high).zip(other.low.iter().zip(&other.high))
        {
            (*low, *high) = ((*low).min(a), (*high).max(b));
        }
        hull
    }

    /// What is in both; `None` where nothing is.
    pub(super) fn meet(&self, other: &Self) -> Option<Self> {
        let mut both = *self;
        for ((low, high), (&a, &b)) in both.low.iter_mut().zip(&mut both.high).zip(other.low.iter().zip(&other.high))
        {
            (*low, *high) = ((*low).max(a), (*high).min(b));
            if *low > *high {
                return None;
            }
        }
        Some(both)
    }

    /// The block that a move takes this one to, within the grid; `None` where that is nowhere.
    fn moved(&self, step: &Move, counts: &[usize; DIM]) -> Option<Self> {
        let mut moved = *self;
        let axes = moved.low.iter_mut().zip(&mut moved.high).zip(counts);
        for (((low, high), &count), &cells) in axes.zip(step.offset()) {
            let ahead = isize::from(cells);
            *high = high.checked_add_signed(ahead)?.min(count.saturating_sub(1));
            *low = low.checked_add_signed(ahead).unwrap_or(0);
            if *low > *high {
                return None;
            }
        }
        Some(moved)
    }

    /// This block and as many cells around it, within the grid.
    pub(super) fn grown(&self, cells: usize, counts: &[usize; DIM]) -> Self {
        let mut grown = *self;
        for ((low, high), &count) in grown.low.iter_mut().zip(&mut grown.high).zip(counts) {
            *low = low.saturating_sub(cells);
            *high = (*high + cells).min(count.saturating_sub(1));
        }
        grown
    }

    /// Whether a cell is in it.
    pub(super) fn holds(&self, at: &[usize; DIM]) -> bool {
        at.iter().zip(self.low.iter().zip(&self.high)).all(|(at, (low, high))| low <= at && at <= high)
    }

    /// Its rows along the first coordinate, by number among all rows of the grid.
    pub(super) fn rows(&self, counts: &[usize; DIM]) -> Rows<DIM> {
        let mut left = 1;
        for axis in 1..DIM {
            left *= self.high[axis] - self.low[axis] + 1;
        }
        Rows { block: *self, counts: *counts, next: self.low, left }
    }

    /// Its cells.
    pub(super) fn cells(&self, counts: &[usize; DIM]) -> impl Iterator<Item = usize> + use<DIM> {
        let ([low, high], across) = (self.across(), counts.first().copied().unwrap_or(1));
        self.rows(counts).flat_map(move |row| row * across + low..row * across + high)
    }

    /// Its first coordinates, from the lowest to the one after the highest.
    fn across(&self) -> [usize; 2] {
        let side = self.low.first().zip(self.high.first());
        side.map_or([0; 2], |(&low, &high)| [low, high + 1])
    }
}

/// Numbers of a block's rows, one after the other.
pub(super) struct Rows<const DIM: usize> {
    block: Block<DIM>,
    counts: [usize; DIM],
    next: [usize; DIM],
    left: usize,
}

impl<const DIM: usize> Rows<DIM> {
    /// Coordinates of the first cell of the next row.
    #[inline(always)]
    fn advance(&mut self) -> Option<[usize; DIM]> {
        self.left = self.left.checked_sub(1)?;
        let at = self.next;
        for axis in 1..DIM {
            if self.next[axis] < self.block.high[axis] {
                self.next[axis] += 1;
                break;
            }
            self.next[axis] = self.block.low[axis];
        }
        Some(at)
    }
}

impl<const DIM: usize> Iterator for Rows<DIM> {
    type Item = usize;

    #[cfg_attr(feature = "compact", inline(never))]
    fn next(&mut self) -> Option<usize> {
        let at = self.advance()?;
        Some(row_of(&at, &self.counts))
    }
}

/// What is near enough to both ends of the path: a ball around each.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lens<T, const DIM: usize>(pub(super) [(Point<T, DIM>, T); 2]);

impl<T: Real, const DIM: usize> Lens<T, DIM> {
    /// This lens and what is as near to it as the longest move strays from its line, with cells of that size.
    pub(super) fn grown(self, size: T) -> Self {
        Self(self.0.map(|(end, radius)| (end, radius + size * T::real(ASTRAY))))
    }

    /// Whether a position is in it.
    pub(super) fn holds(&self, position: &Point<T, DIM>) -> bool {
        self.0.iter().all(|(end, radius)| norm_squared(&(position - end)) <= *radius * *radius)
    }
}

/// The part of a block that is in a lens: from the first cell of a row to the one after the last.
#[derive(Clone, Debug)]
pub(super) struct Patch<const DIM: usize> {
    pub(super) block: Block<DIM>,
    /// Number of the block's first row among all rows of the grid.
    first: usize,
    /// Of all rows from that on, as many as there is room for; the others are as wide as the block.
    rows: Vec<[u16; 2], ROWS_MAX>,
}

impl<const DIM: usize> Patch<DIM> {
    /// All of a block.
    pub(super) fn whole(block: Block<DIM>) -> Self {
        Self { block, first: 0, rows: Vec::new() }
    }

    /// What of a block is in a lens, and of its edge a little more.
    pub(super) fn of<T: Real>(grid: &Grid<T, DIM>, block: Block<DIM>, lens: impl FnOnce() -> Lens<T, DIM>) -> Self {
        if !HAS_ROWS {
            return Self::whole(block);
        }
        let lens = lens();
        let counts = &grid.counts;
        let [first, last] = [row_of(&block.low, counts), row_of(&block.high, counts)];
        let across = counts.first().copied().unwrap_or(1);
        let pitch = grid.pitch.iter().next().copied().unwrap_or(T::one());
        let mut patch = Self { block, first, rows: Vec::new() };
        for row in (first..=last).take(ROWS_MAX) {
            let center = grid.center_of(row * across);
            let [mut low, mut high] = block.across();
            for (end, radius) in &lens.0 {
                let offset = end - center;
                let along = offset.iter().next().copied().unwrap_or_default();
                let rest = *radius * *radius - (norm_squared(&offset) - along * along);
                if rest < T::zero() {
                    high = 0;
                    break;
                }
                let half = rest.sqrt();
                let [from, until] = [(along - half) / pitch, (along + half) / pitch].map(T::to_f32);
                let from = (from - EDGE).max(0.0);
                let begin = from as usize;
                low = low.max(if from > begin as f32 { begin + 1 } else { begin });
                high = high.min(if until < -EDGE { 0 } else { (until + EDGE) as usize + 1 });
            }
            let range = [low, high.max(low)].map(|cell| u16::try_from(cell).unwrap_or(u16::MAX));
            // No more than there is room for.
            let _ = patch.rows.push(range);
        }
        patch
    }

    /// The cells of a row that are in it, from the first coordinate to the one after the last.
    fn range(&self, row: usize) -> [usize; 2] {
        let known = self.rows.get(row.wrapping_sub(self.first));
        known.map_or(self.block.across(), |range| range.map(usize::from))
    }
}

/// Number of a cell's row among all rows of the grid.
fn row_of<const DIM: usize>(at: &[usize; DIM], counts: &[usize; DIM]) -> usize {
    let (mut row, mut stride) = (0, 1);
    for axis in 1..DIM {
        row += at[axis] * stride;
        stride *= counts[axis];
    }
    row
}

/// What one slice works on; all lists are of cells.
pub(super) struct Sweep<'a> {
    pub(super) landscape: &'a [f32],
    pub(super) cost: &'a [f32],
    pub(super) next: &'a mut [f32],
    pub(super) parents: &'a mut [u8],
    /// Length of the slice, s.
    pub(super) interval: f32,
}

impl Sweep<'_> {
    /// Takes the moves in turn from what is `alive` to what is `wanted`; `clear` is asked whether a move from a cell to
    /// another is open, or nothing is where it is `None`.
    pub(super) fn run<const DIM: usize>(
        &mut self,
        counts: &[usize; DIM],
        moves: &[Move],
        (alive, wanted): (&Patch<DIM>, &Patch<DIM>),
        mut clear: Option<impl FnMut(usize, usize) -> bool>,
    ) {
        let across = counts.first().copied().unwrap_or(1);
        if HAS_ROWS && clear.is_none() {
            return self.run_open(counts, moves, (alive, wanted));
        }
        for (number, step) in (0..=u8::MAX).zip(moves) {
            let moved = alive.block.moved(step, counts).and_then(|moved| moved.meet(&wanted.block));
            let Some(to) = moved else { continue };
            let weight = self.interval / f32::from_count(step.between().count() + 1);
            let (aside, ahead) = if HAS_ROWS { step.by_rows(counts) } else { (0, 0) };
            for row in to.rows(counts) {
                let [mut low, mut high] = to.across();
                if HAS_ROWS {
                    let from = alive.range(row.wrapping_add_signed(-aside));
                    let from = from.map(|cell| cell.saturating_add_signed(ahead));
                    for [begin, end] in [wanted.range(row), from] {
                        (low, high) = (low.max(begin), high.min(end));
                    }
                }
                let mut cell = row * across + low;
                let mut left = high.saturating_sub(low);
                while left > 0 {
                    let length = left.min(CHUNK);
                    self.relax((number, step, weight), cell, length, clear.as_mut());
                    (cell, left) = (cell + length, left - length);
                }
            }
        }
    }

    /// The same where every move is open: cell by cell, eight at once, each with all moves in turn, so that the best so far need
    /// not be stored before the next.
    fn run_open<const DIM: usize>(
        &mut self,
        counts: &[usize; DIM],
        moves: &[Move],
        (alive, wanted): (&Patch<DIM>, &Patch<DIM>),
    ) {
        let across = counts.first().copied().unwrap_or(1);
        let weights = core::array::from_fn(|between| self.interval / f32::from_count(between + 1));
        let mut rows = wanted.block.rows(counts);
        while let Some(at) = rows.advance() {
            let row = row_of(&at, counts);
            let [mut begin, high] = wanted.range(row);
            while begin < high {
                let end = high.min(begin + LANES);
                self.take_least(((row, row * across), &at, [begin, end]), moves, alive, (counts, &weights));
                begin = end;
            }
        }
    }

    /// Enters the least of all moves to the cells `begin..end` of a row, [`LANES`] at the most.
    #[inline(always)]
    fn take_least<const DIM: usize>(
        &mut self,
        ((row, first), at, [begin, end]): ((usize, usize), &[usize; DIM], [usize; 2]),
        moves: &[Move],
        alive: &Patch<DIM>,
        (counts, weights): (&[usize; DIM], &[f32; BETWEEN_MAX + 1]),
    ) {
        // The last cells of a list are done with some before them.
        let last = self.next.len().min(self.parents.len()).saturating_sub(LANES);
        let cell = (first + begin).min(last);
        let shift = first + begin - cell;
        let near = fetch(self.landscape, cell);
        let (mut best, mut by) = (fetch(self.next, cell), [u32::MAX; LANES]);
        for (number, step) in (0_u32..).zip(moves) {
            if !step.comes_from(at, &alive.block) {
                continue;
            }
            let (aside, ahead) = step.by_rows(counts);
            let [low, high] =
                alive.range(row.wrapping_add_signed(-aside)).map(|cell| cell.saturating_add_signed(ahead));
            let (low, high) = (low.max(begin), high.min(end));
            if low >= high {
                continue;
            }
            let origin = step.origin(cell);
            let (far, before) = (fetch(self.landscape, origin), fetch(self.cost, origin));
            let mut totals = [0.0; LANES];
            for lane in 0..LANES {
                totals[lane] = (near[lane] + far[lane]) * 0.5;
            }
            let between = step.between();
            let weight = weights[between.len().min(BETWEEN_MAX)];
            for back in between {
                let rates = fetch(self.landscape, cell.wrapping_add_signed(back));
                for lane in 0..LANES {
                    totals[lane] += rates[lane];
                }
            }
            // Infinite where the lane is before the first cell, and where it is past the last.
            let early = fetch(&FRAME, (LANES + begin).wrapping_sub(low + shift));
            let late = fetch(&FRAME, (2 * LANES + begin).wrapping_sub(high + shift));
            for lane in 0..LANES {
                let total = before[lane] + totals[lane] * weight + (early[lane] + late[lane]);
                let is_better = total < best[lane];
                best[lane] = if is_better { total } else { best[lane] };
                by[lane] = if is_better { number } else { by[lane] };
            }
        }
        let cells = self.next.iter_mut().zip(self.parents.iter_mut()).skip(cell);
        for ((next, parent), (best, by)) in cells.zip(best.into_iter().zip(by)) {
            *next = best;
            *parent = u8::try_from(by).unwrap_or(*parent);
        }
    }

    /// One move to a row of cells from `first` on; `weight` is what the sum of the rates on its way counts, s.
    #[inline]
    fn relax(
        &mut self,
        (number, step, weight): (u8, &Move, f32),
        first: usize,
        length: usize,
        clear: Option<&mut impl FnMut(usize, usize) -> bool>,
    ) {
        let from = step.origin(first);
        let Self { landscape, cost, next, parents, .. } = self;
        let row = |at: usize| landscape.get(at..at + length).unwrap_or_default();
        let before = cost.get(from..from + length).unwrap_or_default();
        let next = next.get_mut(first..first + length).unwrap_or_default();
        let parents = parents.get_mut(first..first + length).unwrap_or_default();
        // One loop a step, and no choice in any: the compiler makes each one of vectors.
        let mut totals = [0.0; CHUNK];
        for ((total, &near), &far) in totals.iter_mut().zip(row(first)).zip(row(from)) {
            *total = (near + far) * 0.5;
        }
        for back in step.between() {
            for (total, &rate) in totals.iter_mut().zip(row(first.wrapping_add_signed(back))) {
                *total += rate;
            }
        }
        for (total, &before) in totals.iter_mut().zip(before) {
            *total = before + *total * weight;
        }
        let Some(clear) = clear else { return keep(number, &totals, next, parents) };
        for (index, ((best, parent), &total)) in next.iter_mut().zip(parents).zip(&totals).enumerate() {
            if total < *best && clear(from + index, first + index) {
                (*best, *parent) = (total, number);
            }
        }
    }
}

/// The entries of a list from `at` on; infinity past its end.
#[inline(always)]
fn fetch(list: &[f32], at: usize) -> [f32; LANES] {
    let found = list.get(at..).and_then(|rest| rest.first_chunk::<LANES>());
    found.copied().unwrap_or_else(|| fetch_edge(list, at))
}

#[cold]
#[inline(never)]
fn fetch_edge(list: &[f32], at: usize) -> [f32; LANES] {
    core::array::from_fn(|lane| list.get(at.wrapping_add(lane)).copied().unwrap_or(f32::INFINITY))
}

/// Enters a move where its total is less than the best so far.
#[inline]
fn keep(number: u8, totals: &[f32; CHUNK], next: &mut [f32], parents: &mut [u8]) {
    let mut better = [0_u8; CHUNK];
    for ((better, best), &total) in better.iter_mut().zip(next).zip(totals) {
        let is_better = total < *best;
        *better = if is_better { u8::MAX } else { 0 };
        *best = if is_better { total } else { *best };
    }
    for (parent, &better) in parents.iter_mut().zip(&better) {
        *parent = *parent & !better | number & better;
    }
}

impl<T: Real, const DIM: usize> Grid<T, DIM> {
    /// The cells whose centres may be within `distance` of a position; `None` where none is.
    pub(super) fn around(&self, position: &Point<T, DIM>, distance: T) -> Option<Block<DIM>> {
        let reach = Point::<T, DIM>::repeat(distance);
        let block = Block {
            low: self.coordinates(self.cell(&(position - reach))),
            high: self.coordinates(self.cell(&(position + reach))),
        };
        block.meet(&Block::whole(&self.counts))
    }
}

// Where code is to be small, a patch is its whole block.
#[cfg(all(test, not(feature = "compact")))]
mod tests {
    use super::*;
    use crate::scenario::Domain;

    /// Every cell of the block whose centre is in the lens, and none that is off it by more than its edge.
    fn holds_what_its_lens_holds<const DIM: usize>(goal: Point<f64, DIM>, radii: [f64; 2]) {
        let start = Point::<f64, DIM>::repeat(1.0);
        let domain = Domain { min: Point::zeros(), max: Point::repeat(10.0) };
        let grid = Grid::new(&domain, (&start, &goal), 16.0, 600);
        let lens = |more: f64| Lens([(start, radii[0] + more), (goal, radii[1] + more)]);
        let block = grid.around(&goal, radii[1]).expect("the goal is in the grid");
        let patch = Patch::of(&grid, block, || lens(0.0));
        let edge = 2.0 * f64::from(EDGE) * grid.size();
        let (mut inside, mut outside) = (0, 0);
        for (cell, (at, center)) in grid.iter().enumerate() {
            let [low, high] = patch.range(row_of(&at, &grid.counts));
            let is_in = block.holds(&at) && (low..high).contains(&(cell % grid.counts[0]));
            assert!(is_in || !block.holds(&at) || !lens(0.0).holds(&center), "{at:?} is left out");
            assert!(!is_in || lens(edge).holds(&center), "{at:?} is not in the lens");
            (inside, outside) = (inside + usize::from(is_in), outside + usize::from(block.holds(&at) && !is_in));
        }
        assert!(inside > 10 && outside > 10, "{inside} of {}", inside + outside);
    }

    #[test]
    fn a_patch_is_a_lens() {
        holds_what_its_lens_holds(Point::<f64, 2>::new(9.0, 8.0), [7.0, 5.0]);
        holds_what_its_lens_holds(Point::<f64, 2>::new(9.0, 1.0), [4.0, 5.5]);
        holds_what_its_lens_holds(Point::<f64, 3>::new(9.0, 8.0, 3.0), [7.0, 6.0]);
    }
}
