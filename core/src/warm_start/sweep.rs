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
    fn rows(&self, counts: &[usize; DIM]) -> impl Iterator<Item = (usize, usize)> {
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
pub(super) struct Sweep<'a, T> {
    pub(super) landscape: &'a [T],
    pub(super) cost: &'a [T],
    pub(super) next: &'a mut [T],
    pub(super) parents: &'a mut [u8],
    /// Length of the slice, s.
    pub(super) interval: T,
}

impl<T: Real> Sweep<'_, T> {
    /// Takes the moves in turn from the block `alive` to the block `wanted`; `clear` is asked whether a move from a cell to
    /// another is open, or nothing is where it is `None`.
    pub(super) fn run<const DIM: usize>(
        &mut self,
        grid: &Grid<T, DIM>,
        moves: &[Move],
        (alive, wanted): (&Block<DIM>, &Block<DIM>),
        mut clear: Option<impl FnMut(usize, usize) -> bool>,
    ) {
        for (number, step) in (0..=u8::MAX).zip(moves) {
            let Some(to) = alive.moved(step, &grid.counts).and_then(|moved| moved.meet(wanted)) else { continue };
            for (mut cell, mut left) in to.rows(&grid.counts) {
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
        let mut between = step.between().map(|back| row(first.wrapping_add_signed(back)));
        let half = T::real(0.5);
        let ends = row(first).iter().zip(row(from)).map(|(&near, &far)| (near + far) * half);
        let count = T::from_count(step.between().count() + 1);
        let weight = *interval / count;
        let mut keep = |(((best, parent), &before), sum): (((&mut T, &mut u8), &T), T)| {
            let total = before + sum * weight;
            let is_better = total < *best;
            *best = if is_better { total } else { *best };
            *parent = if is_better { number } else { *parent };
        };
        let cells = next.iter_mut().zip(parents).zip(before);
        if let Some(clear) = clear {
            let mut sums = [T::zero(); CHUNK];
            sums.iter_mut().zip(ends).for_each(|(sum, end)| *sum = end);
            for row in between {
                sums.iter_mut().zip(row).for_each(|(sum, &rate)| *sum += rate);
            }
            for (index, (((best, parent), &before), &sum)) in cells.zip(&sums).enumerate() {
                let total = before + sum * weight;
                if total < *best && clear(from + index, first + index) {
                    (*best, *parent) = (total, number);
                }
            }
            return;
        }
        if cfg!(feature = "compact") {
            let mut sums = [T::zero(); CHUNK];
            sums.iter_mut().zip(ends).for_each(|(sum, end)| *sum = end);
            for row in between {
                sums.iter_mut().zip(row).for_each(|(sum, &rate)| *sum += rate);
            }
            cells.zip(sums).for_each(&mut keep);
            return;
        }
        // Each number of cells between is a loop of its own, which the compiler makes one of vectors.
        match [between.next(), between.next(), between.next()] {
            [None, ..] => cells.zip(ends).for_each(&mut keep),
            [Some(a), None, _] => cells.zip(ends.zip(a).map(|(sum, &a)| sum + a)).for_each(&mut keep),
            [Some(a), Some(b), None] => {
                cells.zip(ends.zip(a).zip(b).map(|((sum, &a), &b)| sum + a + b)).for_each(&mut keep);
            }
            [Some(a), Some(b), Some(c)] => {
                let mut sums = [T::zero(); CHUNK];
                let inner = ends.zip(a).zip(b).zip(c).map(|(((sum, &a), &b), &c)| sum + a + b + c);
                sums.iter_mut().zip(inner).for_each(|(sum, inner)| *sum = inner);
                for row in between {
                    sums.iter_mut().zip(row).for_each(|(sum, &rate)| *sum += rate);
                }
                cells.zip(sums).for_each(&mut keep);
            }
        }
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
