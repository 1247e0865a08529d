//! Cells over the part of the domain that can be reached, and the moves between them.
//!
//! | symbol | name | unit | shape |
//! |---|---|---|---|
//! | | `low` | length unit | `DIM` |
//! | | `pitch` | length unit | `DIM`, about equal |
//! | | `counts` | cells | `DIM` |
//!
//! A path of length L between the foci start and goal stays in an ellipse whose long axis is L; the grid covers the
//! part of its bounding box that lies in the domain.

use crate::math::{Point, Real, norm, norm_squared};
use crate::scenario::Domain;

use super::sweep::Block;

/// Moves that a parent entry can tell apart.
pub(super) const MOVES_MAX: usize = 255;
/// Cells between the ends of a move that its cost looks at.
pub(super) const BETWEEN_MAX: usize = 5;
/// Dimensions there can be.
const DIM_MAX: usize = 3;
/// Part by which cells grow until they are few enough, and how often.
const GROWTH: f64 = 1.03;
const GROWTHS_MAX: usize = 256;

/// Equal boxes, numbered with the first coordinate fastest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Grid<T, const DIM: usize> {
    low: Point<T, DIM>,
    pub(super) pitch: Point<T, DIM>,
    pub(super) counts: [usize; DIM],
}

impl<T: Real, const DIM: usize> Grid<T, DIM> {
    /// As many cells as fit `cells_max` over what a path of `length` from `start` to `goal` can touch.
    pub(super) fn new(
        domain: &Domain<T, DIM>,
        (start, goal): (&Point<T, DIM>, &Point<T, DIM>),
        length: T,
        cells_max: usize,
    ) -> Self {
        let half = T::real(0.5);
        let line = goal - start;
        let straight = norm(&line);
        let long = (length * half).max(straight * half);
        let focus = straight * half;
        let short_squared = (long * long - focus * focus).max(T::zero());
        let mut low = Point::<T, DIM>::zeros();
        let mut sides = Point::<T, DIM>::zeros();
        for axis in 0..DIM {
            let extent = (short_squared + (line[axis] * half).squared()).sqrt();
            let middle = (start[axis] + goal[axis]) * half;
            low[axis] = (middle - extent).max(domain.min[axis]);
            sides[axis] = ((middle + extent).min(domain.max[axis]) - low[axis]).max(T::zero());
        }
        let widest = sides.iter().copied().fold(T::MIN_POSITIVE, T::max);
        let mut size = widest / T::from_count(cells_max.max(1));
        let mut counts = [1; DIM];
        for _ in 0..GROWTHS_MAX {
            for (count, &side) in counts.iter_mut().zip(sides.iter()) {
                *count = count_of(side / size, cells_max);
            }
            if counts.iter().fold(1, |product: usize, &count| product.saturating_mul(count)) <= cells_max {
                break;
            }
            size *= T::real(GROWTH);
        }
        let mut pitch = Point::<T, DIM>::zeros();
        for axis in 0..DIM {
            pitch[axis] = (sides[axis] / T::from_count(counts[axis])).max(widest * T::EPSILON);
        }
        Self { low, pitch, counts }
    }

    /// Number of cells.
    pub(super) fn cells(&self) -> usize {
        self.counts.iter().product()
    }

    /// Lowest corner, then sides of a cell, zeros where there is no such axis.
    pub(super) fn described(&self) -> [[T; DIM_MAX]; 2] {
        [self.low, self.pitch].map(|point| {
            let mut components = point.iter().copied();
            [(); DIM_MAX].map(|()| components.next().unwrap_or_default())
        })
    }

    /// Widest side of a cell.
    pub(super) fn size(&self) -> T {
        self.pitch.iter().copied().fold(T::zero(), T::max)
    }

    /// Half of a cell's horizontal diagonal.
    pub(super) fn half_diagonal(&self) -> T {
        let sum = self.pitch.iter().take(2).fold(T::zero(), |sum, &side| sum + side * side);
        sum.sqrt() * T::real(0.5)
    }

    /// Cell by cell: coordinates and centre.
    pub(super) fn iter(&self) -> impl Iterator<Item = ([usize; DIM], Point<T, DIM>)> + '_ {
        let mut next = [0; DIM];
        (0..self.cells()).map(move |_| {
            let here = next;
            for (coordinate, &count) in next.iter_mut().zip(&self.counts) {
                *coordinate += 1;
                if *coordinate < count {
                    break;
                }
                *coordinate = 0;
            }
            (here, self.center(&here))
        })
    }

    fn center(&self, at: &[usize; DIM]) -> Point<T, DIM> {
        let mut center = self.low;
        for ((component, &side), &coordinate) in center.iter_mut().zip(self.pitch.iter()).zip(at) {
            *component += side * (T::from_count(coordinate) + T::real(0.5));
        }
        center
    }

    /// Centre of the cell of that number.
    pub(super) fn center_of(&self, cell: usize) -> Point<T, DIM> {
        self.center(&self.coordinates(cell))
    }

    pub(super) fn coordinates(&self, cell: usize) -> [usize; DIM] {
        let mut rest = cell;
        self.counts.map(|count| {
            let coordinate = rest % count.max(1);
            rest /= count.max(1);
            coordinate
        })
    }

    /// Whether a position lies in a cell.
    pub(super) fn holds(&self, position: &Point<T, DIM>) -> bool {
        let mut axes = position.iter().zip(self.low.iter()).zip(self.pitch.iter().zip(&self.counts));
        axes.all(|((&at, &low), (&side, &count))| low <= at && at <= low + side * T::from_count(count))
    }

    /// Number of the cell that holds a position, or the nearest.
    pub(super) fn cell(&self, position: &Point<T, DIM>) -> usize {
        let (mut cell, mut stride) = (0, 1);
        for axis in 0..DIM {
            let share = (position[axis] - self.low[axis]) / self.pitch[axis];
            // Never more than the number of cells, so that the count is exact.
            let coordinate = count_of(share, self.counts[axis]) - 1;
            cell += coordinate * stride;
            stride *= self.counts[axis];
        }
        cell
    }
}

/// The smallest whole number above `value`, between 1 and `max`.
fn count_of<T: Real>(value: T, max: usize) -> usize {
    let (mut low, mut high) = (1, max.max(1));
    while low < high {
        let middle = low + (high - low) / 2;
        if T::from_count(middle) > value { high = middle } else { low = middle + 1 }
    }
    low
}

/// A move by whole cells.
#[derive(Clone, Copy, Debug)]
pub(super) struct Move {
    offset: [i8; DIM_MAX],
    /// Change of the cell's number.
    jump: i16,
    /// Changes of the cell's number back from the end to the cells between, the first `between` of them.
    back: [i16; BETWEEN_MAX],
    between: u8,
}

const STAY: Move = Move { offset: [0; DIM_MAX], jump: 0, back: [0; BETWEEN_MAX], between: 0 };

/// All moves within reach, the shortest first.
#[derive(Clone, Debug)]
pub(super) struct Moves {
    list: [Move; MOVES_MAX],
    count: usize,
}

impl Moves {
    pub(super) const fn none() -> Self {
        Self { list: [STAY; MOVES_MAX], count: 0 }
    }

    /// Collects the moves of at most `reach` length units; the longest are left out where there are too many.
    pub(super) fn collect<T: Real, const DIM: usize>(&mut self, grid: &Grid<T, DIM>, reach: T) {
        self.count = 0;
        let most = i8::try_from(BETWEEN_MAX + 1).unwrap_or(i8::MAX);
        let reach_squared = reach * reach * T::real(1.0 + 1e-6);
        // Ring by ring, so that what does not fit is what reaches farthest.
        for ring in 0..=most {
            let (side, before) = (usize::from(ring.unsigned_abs()) * 2 + 1, self.count);
            for index in 0..side.pow(u32::try_from(DIM).unwrap_or(0)) {
                let mut offset = [0_i8; DIM_MAX];
                let mut rest = index;
                for component in offset.iter_mut().take(DIM) {
                    *component = i8::try_from(rest % side).unwrap_or(0) - ring;
                    rest /= side;
                }
                let farthest = offset.iter().map(|cells| cells.abs()).max().unwrap_or(0);
                if farthest != ring {
                    continue;
                }
                let mut step = Point::<T, DIM>::zeros();
                for ((component, &cells), &side) in step.iter_mut().zip(&offset).zip(grid.pitch.iter()) {
                    *component = T::of_f32(f32::from(cells)) * side;
                }
                let fits = offset.iter().zip(&grid.counts).all(|(cells, &n)| usize::from(cells.unsigned_abs()) < n);
                if fits
                    && norm_squared(&step) <= reach_squared
                    && let Some(slot) = self.list.get_mut(self.count)
                {
                    *slot = Move::new(&offset, farthest, &grid.counts);
                    self.count += 1;
                }
            }
            // Rings farther out are out of reach too.
            if self.count == before {
                return;
            }
        }
    }

    /// The most cells that a move goes along an axis.
    pub(super) fn farthest(&self) -> usize {
        let cells = |step: &Move| step.offset.iter().map(|cells| usize::from(cells.unsigned_abs())).max();
        self.all().iter().filter_map(cells).max().unwrap_or(0)
    }

    /// The moves.
    pub(super) fn all(&self) -> &[Move] {
        self.list.get(..self.count).unwrap_or_default()
    }

    /// Where the move of that number into `to` comes from.
    pub(super) fn origin(&self, number: u8, to: usize) -> usize {
        self.list.get(usize::from(number)).map_or(to, |step| step.origin(to))
    }
}

impl Move {
    fn new<const DIM: usize>(offset: &[i8; DIM_MAX], farthest: i8, counts: &[usize; DIM]) -> Self {
        let flat = |share: f32| {
            let (mut sum, mut stride) = (0_i32, 1_i32);
            for (&cells, &count) in offset.iter().zip(counts) {
                // Half a cell away from zero, by the sign of the move: a move and its reverse see the same cells.
                let along = f32::from(cells) * share;
                let rounded = if along < 0.0 { (along - 0.499) as i32 } else { (along + 0.499) as i32 };
                sum += rounded * stride;
                stride = stride.saturating_mul(i32::try_from(count).unwrap_or(i32::MAX));
            }
            i16::try_from(sum).unwrap_or(0)
        };
        let between = u8::try_from(farthest - 1).unwrap_or(0);
        let mut back = [0; BETWEEN_MAX];
        for (entry, index) in back.iter_mut().zip(1..=between) {
            *entry = -flat(f32::from(index) / f32::from(farthest.unsigned_abs()));
        }
        Self { offset: *offset, jump: flat(1.0), back, between }
    }

    /// The cell that the move into `to` comes from.
    pub(super) fn origin(&self, to: usize) -> usize {
        to.wrapping_add_signed(-isize::from(self.jump))
    }

    /// Rows, and cells along a row.
    pub(super) fn by_rows<const DIM: usize>(&self, counts: &[usize; DIM]) -> (isize, isize) {
        let [ahead, ..] = self.offset.map(isize::from);
        let (mut aside, mut stride) = (0, 1);
        for (&cells, &count) in self.offset.iter().zip(counts).skip(1) {
            aside += isize::from(cells) * stride;
            stride *= isize::try_from(count).unwrap_or(isize::MAX);
        }
        (aside, ahead)
    }

    /// Whether the move into a row comes from one of a block; the first coordinate is that of no row.
    pub(super) fn comes_from<const DIM: usize>(&self, at: &[usize; DIM], block: &Block<DIM>) -> bool {
        (1..DIM.min(DIM_MAX)).all(|axis| {
            let from = at[axis].wrapping_add_signed(-isize::from(self.offset[axis]));
            block.low[axis] <= from && from <= block.high[axis]
        })
    }

    /// Cells by axis.
    pub(super) fn offset(&self) -> &[i8; DIM_MAX] {
        &self.offset
    }

    /// Changes of the cell's number back from the end to each of the cells between.
    pub(super) fn between(&self) -> impl ExactSizeIterator<Item = isize> {
        self.back.iter().take(usize::from(self.between)).map(|&back| isize::from(back))
    }
}
