//! Symmetric positive definite systems with blocks of one node, each coupled to its two neighbours on either side.
//!
//! The speed bound couples neighbouring nodes, the acceleration bound those two apart: a block matrix with two
//! diagonals on either side, factored as L D L' in O(N), without a root.
//!
//! Limits: `NODES` bounds the number of blocks.

use nalgebra::{ArrayStorage, SMatrix};

use crate::math::{Point, Real};

/// A block: `DIM` x `DIM`.
pub(super) type Block<T, const DIM: usize> = SMatrix<T, DIM, DIM>;

/// The blocks of one row on and left of the diagonal.
#[derive(Clone, Copy, Debug)]
pub(super) struct BlockRow<T, const DIM: usize> {
    /// On the diagonal.
    pub(super) here: Block<T, DIM>,
    /// One to the left.
    pub(super) one: Block<T, DIM>,
    /// Two to the left.
    pub(super) two: Block<T, DIM>,
}

impl<T: Real, const DIM: usize> BlockRow<T, DIM> {
    pub(super) const fn zeros() -> Self {
        let none = Block::from_array_storage(ArrayStorage([[T::ZERO; DIM]; DIM]));
        Self { here: none, one: none, two: none }
    }
}

/// The factor of a positive definite block: a unit lower triangle, with one over the pivots on its diagonal; `None` if it is
/// not.
fn triangle<T: Real, const DIM: usize>(block: &Block<T, DIM>, floor: T) -> Option<Block<T, DIM>> {
    // Entries of the triangle, and the same times their pivots.
    let (mut lower, mut whole) = (Block::<T, DIM>::zeros(), Block::<T, DIM>::zeros());
    for row in 0..DIM {
        let mut pivot = block[(row, row)];
        for column in 0..row {
            let mut entry = block[(row, column)];
            for k in 0..column {
                entry -= whole[(row, k)] * lower[(column, k)];
            }
            whole[(row, column)] = entry;
            lower[(row, column)] = entry * lower[(column, column)];
            pivot -= entry * lower[(row, column)];
        }
        if pivot.is_not_a_number() || pivot <= floor {
            return None;
        }
        lower[(row, row)] = T::one() / pivot;
    }
    Some(lower)
}

/// L^-1 v.
fn forward<T: Real, const DIM: usize>(lower: &Block<T, DIM>, vector: &Point<T, DIM>) -> Point<T, DIM> {
    let mut result = *vector;
    for row in 0..DIM {
        for k in 0..row {
            let known = result[k];
            result[row] -= lower[(row, k)] * known;
        }
    }
    result
}

/// L^-T v.
fn backward<T: Real, const DIM: usize>(lower: &Block<T, DIM>, vector: &Point<T, DIM>) -> Point<T, DIM> {
    let mut result = *vector;
    for row in (0..DIM).rev() {
        for k in row + 1..DIM {
            let known = result[k];
            result[row] -= lower[(k, row)] * known;
        }
    }
    result
}

/// M L^-T: every row of M, forward.
fn right_divide<T: Real, const DIM: usize>(matrix: &Block<T, DIM>, lower: &Block<T, DIM>) -> Block<T, DIM> {
    let mut result = *matrix;
    for row in 0..DIM {
        for column in 0..DIM {
            for k in 0..column {
                let known = result[(row, k)];
                result[(row, column)] -= known * lower[(column, k)];
            }
        }
    }
    result
}

/// M D^-1.
fn scaled<T: Real, const DIM: usize>(matrix: &Block<T, DIM>, lower: &Block<T, DIM>) -> Block<T, DIM> {
    let mut result = *matrix;
    for row in 0..DIM {
        for column in 0..DIM {
            result[(row, column)] *= lower[(column, column)];
        }
    }
    result
}

/// Replaces the rows of a matrix by those of its factor; false if it is not positive definite.
#[must_use]
pub(super) fn factor<T: Real, const DIM: usize>(rows: &mut [BlockRow<T, DIM>], floor: T) -> bool {
    // Rows one and two above.
    let mut above = BlockRow::<T, DIM>::zeros();
    let mut above_two = BlockRow::<T, DIM>::zeros();
    for (index, row) in rows.iter_mut().enumerate() {
        // Entries of the factor times their pivots.
        let (mut one, mut two) = (Block::<T, DIM>::zeros(), Block::<T, DIM>::zeros());
        if index >= 2 {
            two = right_divide(&row.two, &above_two.here);
        }
        if index >= 1 {
            one = right_divide(&(row.one - two * above.one.transpose()), &above.here);
        }
        (row.one, row.two) = (scaled(&one, &above.here), scaled(&two, &above_two.here));
        let here = row.here - two * row.two.transpose() - one * row.one.transpose();
        let Some(lower) = triangle(&here, floor) else { return false };
        row.here = lower;
        (above_two, above) = (above, *row);
    }
    true
}

/// Replaces right-hand sides by their solutions, with rows that [`factor`] has factored.
///
/// Every node waits for the one before: several sides at once take little longer than one.
pub(super) fn solve<T: Real, const DIM: usize, const SIDES: usize>(
    rows: &[BlockRow<T, DIM>],
    mut sides: [&mut [Point<T, DIM>]; SIDES],
) {
    let count = sides.iter().map(|side| side.len()).fold(rows.len(), usize::min);
    let rows = rows.get(..count).unwrap_or_default();
    let mut known = [Known::nothing(); SIDES];
    for (index, row) in rows.iter().enumerate() {
        for (known, side) in known.iter_mut().zip(&mut sides) {
            if let Some(value) = side.get_mut(index) {
                known.forward(row, value);
            }
        }
    }
    let mut pulls = [Pulls::nothing(); SIDES];
    for (index, row) in rows.iter().enumerate().rev() {
        for (pulls, side) in pulls.iter_mut().zip(&mut sides) {
            if let Some(value) = side.get_mut(index) {
                pulls.backward(row, value);
            }
        }
    }
}

/// What the two rows above came out as.
#[derive(Clone, Copy)]
struct Known<T, const DIM: usize> {
    one: Point<T, DIM>,
    two: Point<T, DIM>,
}

impl<T: Real, const DIM: usize> Known<T, DIM> {
    fn nothing() -> Self {
        Self { one: Point::zeros(), two: Point::zeros() }
    }

    #[inline(always)]
    fn forward(&mut self, row: &BlockRow<T, DIM>, value: &mut Point<T, DIM>) {
        let rest = *value - row.one * self.one - row.two * self.two;
        *value = forward(&row.here, &rest);
        (self.two, self.one) = (self.one, *value);
    }
}

/// What the two rows below take from this one, and from the next.
#[derive(Clone, Copy)]
struct Pulls<T, const DIM: usize> {
    one: Point<T, DIM>,
    two: Point<T, DIM>,
    two_next: Point<T, DIM>,
}

impl<T: Real, const DIM: usize> Pulls<T, DIM> {
    fn nothing() -> Self {
        Self { one: Point::zeros(), two: Point::zeros(), two_next: Point::zeros() }
    }

    #[inline(always)]
    fn backward(&mut self, row: &BlockRow<T, DIM>, value: &mut Point<T, DIM>) {
        let mut rest = -(self.one + self.two);
        for component in 0..DIM {
            rest[component] += value[component] * row.here[(component, component)];
        }
        *value = backward(&row.here, &rest);
        self.one = row.one.transpose() * *value;
        self.two = self.two_next;
        self.two_next = row.two.transpose() * *value;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    fn rows(size: usize) -> Vec<BlockRow<f64, 2>> {
        (0..size)
            .map(|index| {
                let k = index as f64;
                BlockRow {
                    here: Block::<f64, 2>::new(6.0 + k, 0.5, 0.5, 7.0),
                    one: Block::<f64, 2>::new(-1.0, 0.2, 0.1, -1.5),
                    two: Block::<f64, 2>::new(0.3, -0.1, 0.2, 0.4 + 0.01 * k),
                }
            })
            .collect()
    }

    fn product(rows: &[BlockRow<f64, 2>], x: &[Point<f64, 2>]) -> Vec<Point<f64, 2>> {
        let mut y: Vec<Point<f64, 2>> = rows.iter().zip(x).map(|(row, x)| row.here * x).collect();
        for index in 0..rows.len() {
            for (gap, block) in [(1, rows[index].one), (2, rows[index].two)] {
                if index >= gap {
                    y[index] += block * x[index - gap];
                    y[index - gap] += block.transpose() * x[index];
                }
            }
        }
        y
    }

    #[test]
    fn solves_what_the_definition_multiplies() {
        for size in 1..8 {
            let matrix = rows(size);
            let x: Vec<_> = (0..size).map(|k| Point::<f64, 2>::new(1.0 + k as f64, 0.3 - k as f64)).collect();
            let mut values = product(&matrix, &x);
            let mut factored = matrix.clone();
            assert!(factor(&mut factored, 0.0));
            let mut again = values.clone();
            solve(&factored, [&mut values, &mut again]);
            assert_eq!(values, again);
            for (value, expected) in values.iter().zip(&x) {
                assert!(
                    (value - expected).iter().all(|error| error.abs() < 1e-12),
                    "size {size}: {value} {expected}"
                );
            }
        }
    }

    #[test]
    fn says_what_is_not_positive_definite() {
        let mut matrix = rows(4);
        matrix[2].here[(1, 1)] = -3.0;
        assert!(!factor(&mut matrix, 0.0));
    }
}
