//! The least distance between two agents, between the nodes too.
//!
//! | symbol | name | unit |
//! |---|---|---|
//! | s | `separation` | length unit |
//! | x_i - y_i | relative position at node i | length unit |
//!
//! All agents share the time grid, so that the relative position moves along a segment from node to node.
//!
//! Source: beyond the paper; section 3.3 has several agents and no such distance.

use crate::constraints::Worst;
use crate::constraints::clearance::nearest;
use crate::math::{Point, Real, norm};

/// Closest that two paths come, as a part of `separation` that is missing; 0 where none is.
pub fn excess<T: Real, const DIM: usize>(separation: T, path: &[Point<T, DIM>], other: &[Point<T, DIM>]) -> Worst<T> {
    let mut worst = Worst::none();
    let relative = path.iter().zip(other).map(|(a, b)| a - b);
    for (index, (from, to)) in relative.clone().zip(relative.skip(1)).enumerate() {
        let (_, place) = nearest(&from, &to);
        worst.raise(index + 1, (separation - norm(&place)) / separation);
    }
    worst
}
