//! One symmetric banded matrix, factored once, solved many times.
//!
//! With K the second-difference matrix of the interior nodes (2 on the diagonal, -1 beside it, ends held), the
//! projection needs A = `first` K + `second` K^2 + `zeroth` I, which has two diagonals on either side. It is
//! factored as L D L'; a solve costs 5 multiplications a node and component.
//!
//! Limits: `NODES` bounds the number of interior nodes. A is positive definite for positive coefficients.

use crate::math::{Point, Real};

/// Coefficients of A = `zeroth` I + `first` K + `second` K^2, and what the first node adds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Coefficients<T> {
    pub(super) zeroth: T,
    pub(super) first: T,
    pub(super) second: T,
    /// Added to the first diagonal entry only: the start-velocity row.
    pub(super) at_start: T,
}

/// A row of the factor: entries of L one and two columns to the left, and 1 / D.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Row<T> {
    one: T,
    two: T,
    inverse: T,
}

/// The factor of A for a number of interior nodes.
#[derive(Clone, Debug)]
pub(super) struct Factor<T, const NODES: usize> {
    rows: [Row<T>; NODES],
    size: usize,
}

impl<T: Real, const NODES: usize> Factor<T, NODES> {
    /// A factor of nothing.
    pub(super) const fn empty() -> Self {
        let row = Row { one: T::ZERO, two: T::ZERO, inverse: T::ZERO };
        Self { rows: [row; NODES], size: 0 }
    }

    /// Factors A for `size` interior nodes.
    pub(super) fn factor(&mut self, size: usize, coefficients: &Coefficients<T>) {
        let Coefficients { zeroth, first, second, at_start } = *coefficients;
        let (two, four) = (T::real(2.0), T::real(4.0));
        let beside = -first - four * second;
        self.size = size.min(NODES);
        // Of the rows above: D one and two rows up, and L's left neighbour one row up.
        let (mut d_one, mut d_two, mut left_above) = (T::one(), T::one(), T::zero());
        for (index, row) in self.rows.iter_mut().take(size).enumerate() {
            let is_end = index == 0 || index + 1 == size;
            let ends_missing = if size == 1 {
                two
            } else if is_end {
                T::one()
            } else {
                T::zero()
            };
            let mut diagonal = zeroth + two * first + (T::real(6.0) - ends_missing) * second;
            if index == 0 {
                diagonal += at_start;
            }
            let left_two = if index >= 2 { second / d_two } else { T::zero() };
            let left_one = if index >= 1 { (beside - left_two * d_two * left_above) / d_one } else { T::zero() };
            let pivot = diagonal - left_two * left_two * d_two - left_one * left_one * d_one;
            *row = Row { one: left_one, two: left_two, inverse: T::one() / pivot };
            (d_two, d_one, left_above) = (d_one, pivot, left_one);
        }
    }

    /// Replaces the right-hand side `values` by the solution of A x = values, component by component.
    pub(super) fn solve<const DIM: usize>(&self, values: &mut [Point<T, DIM>]) {
        let rows = self.rows.get(..self.size).unwrap_or_default();
        let (mut above, mut above_two) = (Point::<T, DIM>::zeros(), Point::<T, DIM>::zeros());
        for (row, value) in rows.iter().zip(values.iter_mut()) {
            *value -= above * row.one + above_two * row.two;
            (above_two, above) = (above, *value);
        }
        // What the rows below subtract from this one: `one` of the next row, `two` of the one after.
        let mut below = Point::<T, DIM>::zeros();
        let mut below_two = Point::<T, DIM>::zeros();
        let (mut one, mut two, mut two_next) = (T::zero(), T::zero(), T::zero());
        let used = values.len().min(rows.len());
        let used_values = values.get_mut(..used).unwrap_or_default();
        let used_rows = rows.get(..used).unwrap_or_default();
        for (row, value) in used_rows.iter().zip(used_values.iter_mut()).rev() {
            *value = *value * row.inverse - below * one - below_two * two;
            (below_two, below) = (below, *value);
            (two, two_next) = (two_next, row.two);
            one = row.one;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A x by its definition, K applied once and twice.
    fn product(coefficients: &Coefficients<f64>, x: &[f64]) -> std::vec::Vec<f64> {
        let k = |v: &[f64]| -> std::vec::Vec<f64> {
            let at = |i: isize| if i < 0 { 0.0 } else { v.get(i as usize).copied().unwrap_or(0.0) };
            (0..v.len() as isize).map(|i| 2.0 * at(i) - at(i - 1) - at(i + 1)).collect()
        };
        let (once, twice) = (k(x), k(&k(x)));
        let mut y: std::vec::Vec<f64> = (0..x.len())
            .map(|i| coefficients.zeroth * x[i] + coefficients.first * once[i] + coefficients.second * twice[i])
            .collect();
        y[0] += coefficients.at_start * x[0];
        y
    }

    #[test]
    fn solves_what_the_definition_multiplies() {
        let coefficients = Coefficients { zeroth: 0.3, first: 2.0, second: 0.7, at_start: 0.9 };
        for size in 1..9 {
            let x: std::vec::Vec<f64> = (0..size).map(|i| f64::from(i * i) - 3.0 * f64::from(i) + 0.5).collect();
            let mut values: std::vec::Vec<Point<f64, 2>> =
                product(&coefficients, &x).iter().map(|&y| Point::<f64, 2>::new(y, -2.0 * y)).collect();
            let mut factor = Factor::<f64, 16>::empty();
            factor.factor(x.len(), &coefficients);
            factor.solve(&mut values);
            for (value, expected) in values.iter().zip(&x) {
                assert!((value[0] - expected).abs() < 1e-12, "size {size}: {} is not {expected}", value[0]);
                assert!((value[1] + 2.0 * expected).abs() < 1e-12);
            }
        }
    }
}
