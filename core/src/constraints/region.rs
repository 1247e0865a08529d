//! Regions to keep out of or to stay in, in three dimensions upright columns.
//!
//! | symbol | name | unit |
//! |---|---|---|
//! | c, r | `center`, `radius` | length unit |
//! | s | scale of a polygon | length unit |
//!
//! What counts is the segment between two nodes, not its ends, so that no corner is cut. A region with a window
//! concerns the segments that end in it. The depth of a segment is relative to the radius of a circle, or to the scale
//! of a polygon: (r - distance) / r outside a circle, (largest distance - r) / r inside one; for a polygon the least
//! shift that takes the segment out of it, or an end into it edge by edge, over s.
//!
//! Source: (60).

use crate::constraints::Worst;
use crate::constraints::clearance::{clearance, nearest};
use crate::math::{Point, Real, norm};
use crate::scenario::{Region, Shape, Side};

/// The horizontal part of a position.
pub fn horizontal<T: Real, const DIM: usize>(position: &Point<T, DIM>) -> Point<T, 2> {
    let mut components = position.iter().copied();
    Point::<T, 2>::new(components.next().unwrap_or_default(), components.next().unwrap_or_default())
}

/// How deep the segment between two horizontal positions is on the wrong side, relative to radius or scale; not
/// positive where it is not.
pub fn depth<T: Real>(region: &Region<T>, from: &Point<T, 2>, to: &Point<T, 2>) -> T {
    match (&region.shape, region.side) {
        (Shape::Circle { center, radius }, Side::Outside) => {
            let (_, place) = nearest(&(from - center), &(to - center));
            (*radius - norm(&place)) / *radius
        }
        (Shape::Circle { center, radius }, Side::Inside) => {
            let (a, b) = (norm(&(from - center)), norm(&(to - center)));
            // A sum would hide nothing, a maximum hides what is not a number.
            let farthest = if b > a || b.is_not_a_number() { b } else { a };
            (farthest - *radius) / *radius
        }
        (Shape::Polygon(_), _) => -clearance(region, from, to).value,
    }
}

/// Deepest that a segment of the path is on the wrong side; 0 where none is.
pub fn excess<T: Real, const DIM: usize>(region: &Region<T>, times: &[T], path: &[Point<T, DIM>]) -> Worst<T> {
    let mut worst = Worst::none();
    let segments = path.iter().zip(path.iter().skip(1));
    for (index, (&end, (from, to))) in times.iter().skip(1).zip(segments).enumerate() {
        if region.window.holds(end) {
            worst.raise(index + 1, depth(region, &horizontal(from), &horizontal(to)));
        }
    }
    worst
}
