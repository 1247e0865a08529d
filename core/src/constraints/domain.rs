//! The box that the flight stays in: min <= x_i <= max, every coordinate, every node.
//!
//! Source: section 4.1.

use crate::constraints::Worst;
use crate::math::{Point, Real};
use crate::scenario::Domain;

/// Farthest that a coordinate of a node lies outside, length units; 0 where none does.
pub fn excess<T: Real, const DIM: usize>(domain: &Domain<T, DIM>, path: &[Point<T, DIM>]) -> Worst<T> {
    let mut worst = Worst::none();
    for (node, position) in path.iter().enumerate() {
        for (&component, (&low, &high)) in position.iter().zip(domain.min.iter().zip(domain.max.iter())) {
            worst.raise(node, low - component);
            worst.raise(node, component - high);
        }
    }
    worst
}
