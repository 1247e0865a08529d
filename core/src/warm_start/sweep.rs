//! One slice of the dynamic programme: all moves from the cells that can be reached to those from which the goal can be.
//!
//! | symbol | name | unit | shape |
//! |---|---|---|---|
//! | | [`Block`] | cells | lowest and highest coordinates, both included |
//!
//! Moves come first and cells second: a move does the same to a whole row of cells, one after the other in memory, which is
//! what processors with vectors are quick at.
//!
//! Limits: a block is a box around what can be reached, which is round.

use crate::math::{Point, Real};

use super::grid::{Grid, Move};

/// Cells that are done together.
const CHUNK: usize = 32;

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

    /// Its rows along the first coordinate: number of the first cell, and of cells.
    pub(super) fn rows(&self, counts: &[usize; DIM]) -> impl Iterator<Item = (usize, usize)> {
        let (block, counts) = (*self, *counts);
        let sides = block.low.iter().zip(&block.high).skip(1).map(|(low, high)| high - low + 1);
        let (rows, length) = (sides.product(), block.high.first().zip(block.low.first()));
        let length = length.map_or(0, |(high, low)| high - low + 1);
        (0..rows).map(move |row| {
            let (mut rest, mut cell, mut stride) = (row, 0, 1);
            for (axis, ((&low, &high), &count)) in block.low.iter().zip(&block.high).zip(&counts).enumerate() {
                let side = if axis == 0 { 1 } else { high - low + 1 };
                cell += (low + rest % side.max(1)) * stride;
                rest /= side.max(1);
                stride *= count;
            }
            (cell, length)
        })
    }
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
    /// Takes the moves in turn from the block `alive` to the block `wanted`; `clear` is asked whether a move from a cell to
    /// another is open, or nothing is where it is `None`.
    pub(super) fn run<const DIM: usize>(
        &mut self,
        counts: &[usize; DIM],
        moves: &[Move],
        (alive, wanted): (&Block<DIM>, &Block<DIM>),
        mut clear: Option<impl FnMut(usize, usize) -> bool>,
    ) {
        for (number, step) in (0..=u8::MAX).zip(moves) {
            let Some(to) = alive.moved(step, counts).and_then(|moved| moved.meet(wanted)) else { continue };
            for (mut cell, mut left) in to.rows(counts) {
                while left > 0 {
                    let length = left.min(CHUNK);
                    self.relax((number, step), cell, length, clear.as_mut());
                    (cell, left) = (cell + length, left - length);
                }
            }
        }
    }

    /// One move to a row of cells from `first` on.
    #[inline]
    fn relax(
        &mut self,
        (number, step): (u8, &Move),
        first: usize,
        length: usize,
        clear: Option<&mut impl FnMut(usize, usize) -> bool>,
    ) {
        let from = step.origin(first);
        let Self { landscape, cost, next, parents, interval } = self;
        let row = |at: usize| landscape.get(at..at + length).unwrap_or_default();
        let before = cost.get(from..from + length).unwrap_or_default();
        let next = next.get_mut(first..first + length).unwrap_or_default();
        let parents = parents.get_mut(first..first + length).unwrap_or_default();
        let count = f32::from_count(step.between().count() + 1);
        let weight = *interval / count;
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
