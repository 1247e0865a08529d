//! How far a segment is from breaking a region, or two agents from coming too close: slack and derivative.
//!
//! | symbol | name | unit |
//! |---|---|---|
//! | a, b | ends of a segment, in a region its horizontal ones | length unit |
//! | d | distance of the segment from a centre, a polygon, or the origin | length unit |
//! | r, s | radius, scale of a polygon | length unit |
//! | g | `value` | 1 |
//!
//! g is positive where the constraint is kept, 0 on its boundary, negative where it is broken:
//!
//! | constraint | g | kinks |
//! |---|---|---|
//! | outside a circle | d^2 / r^2 - 1 | where a = b |
//! | inside a circle | 1 - max(\|a - c\|, \|b - c\|)^2 / r^2 | where both ends are as far |
//! | outside a polygon | d / s; inside, less the depth / s | where the nearest places change |
//! | inside a polygon | smallest distance of an end from an edge's line / s, inwards | where another becomes smallest |
//! | apart | d^2 / separation^2 - 1 of the relative segment, from the origin | where it is a point |
//!
//! The depth in a polygon is the least shift that takes the segment out of it: by the theorem of the separating axis
//! the smallest overlap along the normals of the edges and that of the segment, so that the sign is exact however
//! the two lie. At a kink the derivative is that of one of the sides.
//!
//! Between nodes both agents move at constant velocity, and so does one as seen by the other: the relative positions
//! at the ends of an interval span a segment, whose distance from the origin is the least distance between the agents.
//!
//! Source: (60), and beyond it. Limits: what is not finite has a `value` that is not a number.

use crate::math::{Point, Real, norm, norm_squared};
use crate::scenario::{Polygon, Region, Shape, Side};

/// A slack and its derivatives by the ends of a segment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clearance<T, const DIM: usize = 2> {
    /// g: not negative where the constraint is kept.
    pub value: T,
    /// Derivative by the first end, per length unit.
    pub by_from: Point<T, DIM>,
    /// Derivative by the second end, per length unit.
    pub by_to: Point<T, DIM>,
}

impl<T: Real, const DIM: usize> Clearance<T, DIM> {
    /// Of a direction at the place of the segment that lies at `share` of the way.
    fn at(share: T, value: T, direction: &Point<T, DIM>) -> Self {
        Self { value, by_from: direction * (T::one() - share), by_to: direction * share }
    }

    fn not_a_number() -> Self {
        Self { value: T::real(f64::NAN), by_from: Point::zeros(), by_to: Point::zeros() }
    }
}

/// How far the segment between two horizontal positions is from breaking the region, its window aside.
pub fn clearance<T: Real>(region: &Region<T>, from: &Point<T, 2>, to: &Point<T, 2>) -> Clearance<T> {
    if !finite(from) || !finite(to) {
        return Clearance::not_a_number();
    }
    match (&region.shape, region.side) {
        (Shape::Circle { center, radius }, Side::Outside) => beyond(*radius, &(from - center), &(to - center)),
        (Shape::Circle { center, radius }, Side::Inside) => inside_circle(*radius, &(from - center), &(to - center)),
        (Shape::Polygon(polygon), Side::Outside) => outside_polygon(polygon, from, to),
        (Shape::Polygon(polygon), Side::Inside) => inside_polygon(polygon, from, to),
    }
}

/// How far two agents are from coming closer than `separation` (length units) between two neighbouring nodes: the
/// first flies from `from` to `to`, the other one from `other_from` to `other_to`.
///
/// The derivatives are those by `from` and `to`; by `other_from` and `other_to` they are the same with the other sign.
pub fn separation_clearance<T: Real, const DIM: usize>(
    separation: T,
    from: &Point<T, DIM>,
    to: &Point<T, DIM>,
    other_from: &Point<T, DIM>,
    other_to: &Point<T, DIM>,
) -> Clearance<T, DIM> {
    let (a, b) = (from - other_from, to - other_to);
    if finite(&a) && finite(&b) { beyond(separation, &a, &b) } else { Clearance::not_a_number() }
}

fn finite<T: Real, const DIM: usize>(position: &Point<T, DIM>) -> bool {
    position.iter().all(|component| component.finite())
}

/// The place of a segment that is nearest to the origin: its share of the way, and itself. Half the way where the
/// segment is a point.
pub(super) fn nearest<T: Real, const DIM: usize>(from: &Point<T, DIM>, to: &Point<T, DIM>) -> (T, Point<T, DIM>) {
    let segment = to - from;
    let length_squared = norm_squared(&segment);
    let share = if length_squared > T::zero() {
        (-from.dot(&segment) / length_squared).clamp_to(T::zero(), T::one())
    } else {
        T::real(0.5)
    };
    (share, from + segment * share)
}

/// d^2 / r^2 - 1 of a segment from the origin. The nearest place is stationary along the segment, or held at an end:
/// its share has no part in the derivative.
fn beyond<T: Real, const DIM: usize>(radius: T, from: &Point<T, DIM>, to: &Point<T, DIM>) -> Clearance<T, DIM> {
    let (share, place) = nearest(from, to);
    let relative = place / radius;
    Clearance::at(share, norm_squared(&relative) - T::one(), &(relative * (T::real(2.0) / radius)))
}

fn inside_circle<T: Real>(radius: T, from: &Point<T, 2>, to: &Point<T, 2>) -> Clearance<T> {
    let (a, b) = (from / radius, to / radius);
    let (first, second) = (norm_squared(&a), norm_squared(&b));
    let (share, farthest, place) = if second > first { (T::one(), second, b) } else { (T::zero(), first, a) };
    Clearance::at(share, T::one() - farthest, &(place * (T::real(-2.0) / radius)))
}

/// Smallest distance of the ends from the lines through the edges, inwards: the polygon is convex, and holds the
/// segment where it holds its ends.
fn inside_polygon<T: Real>(polygon: &Polygon<T>, from: &Point<T, 2>, to: &Point<T, 2>) -> Clearance<T> {
    let mut least = Clearance::at(T::zero(), T::INFINITY, &Point::zeros());
    for (vertex, normal) in polygon.sides() {
        let (a, b) = (-normal.dot(&(from - vertex)), -normal.dot(&(to - vertex)));
        let (share, distance) = if b < a { (T::one(), b) } else { (T::zero(), a) };
        if distance < least.value {
            least = Clearance::at(share, distance, &-normal);
        }
    }
    scaled(least, polygon)
}

fn outside_polygon<T: Real>(polygon: &Polygon<T>, from: &Point<T, 2>, to: &Point<T, 2>) -> Clearance<T> {
    let mut gap = edge_gap(polygon, from, to);
    if let Some(other) = own_gap(polygon, from, to)
        && other.value > gap.value
    {
        gap = other;
    }
    // Where a vertex and an end are nearest, an axis shows less than the distance between them.
    if gap.value > T::zero() {
        let distance = distance(polygon, from, to);
        let rounding = T::one() + T::real(64.0) * T::EPSILON;
        if distance.value > gap.value * rounding {
            gap = distance;
        }
    }
    scaled(gap, polygon)
}

fn scaled<T: Real>(of: Clearance<T>, polygon: &Polygon<T>) -> Clearance<T> {
    let scale = polygon.scale();
    Clearance { value: of.value / scale, by_from: of.by_from / scale, by_to: of.by_to / scale }
}

/// Largest gap between segment and polygon along the normals of the edges; an overlap is negative.
fn edge_gap<T: Real>(polygon: &Polygon<T>, from: &Point<T, 2>, to: &Point<T, 2>) -> Clearance<T> {
    let mut widest = Clearance::at(T::zero(), -T::INFINITY, &Point::zeros());
    for (vertex, normal) in polygon.sides() {
        let (a, b) = (normal.dot(&(from - vertex)), normal.dot(&(to - vertex)));
        let (share, gap) = if b < a { (T::one(), b) } else { (T::zero(), a) };
        if gap > widest.value {
            widest = Clearance::at(share, gap, normal);
        }
    }
    widest
}

/// Gap along the normal of the segment, on the side where it is larger; none where the segment is a point.
///
/// The line through the segment turns with its ends: at the foot of the vertex, `share` of the way along, it moves by
/// the mean of their movements, weighted by the share.
fn own_gap<T: Real>(polygon: &Polygon<T>, from: &Point<T, 2>, to: &Point<T, 2>) -> Option<Clearance<T>> {
    let segment = to - from;
    let length = norm(&segment);
    if length <= T::zero() {
        return None;
    }
    let left = Point::<T, 2>::new(-segment.y, segment.x) / length;
    let first = polygon.vertices().first()?;
    let height = |vertex: &Point<T, 2>| left.dot(&(vertex - from));
    let mut lowest = (height(first), first);
    let mut highest = lowest;
    for vertex in polygon.vertices() {
        let entry = (height(vertex), vertex);
        if entry.0 < lowest.0 {
            lowest = entry;
        }
        if entry.0 > highest.0 {
            highest = entry;
        }
    }
    let (gap, vertex, away) =
        if lowest.0 >= -highest.0 { (lowest.0, lowest.1, -left) } else { (-highest.0, highest.1, left) };
    let share = (vertex - from).dot(&segment) / (length * length);
    Some(Clearance::at(share, gap, &away))
}

/// Distance of a segment from a polygon that it does not meet.
fn distance<T: Real>(polygon: &Polygon<T>, from: &Point<T, 2>, to: &Point<T, 2>) -> Clearance<T> {
    let mut least = (T::INFINITY, T::zero(), Point::<T, 2>::zeros());
    let mut take = |share: T, offset: Point<T, 2>| {
        let squared = norm_squared(&offset);
        if squared < least.0 {
            least = (squared, share, offset);
        }
    };
    for (a, b) in polygon.edges() {
        let (share, place) = nearest(&(from - a), &(to - a));
        take(share, place);
        take(T::zero(), -nearest(&(a - from), &(b - from)).1);
        take(T::one(), -nearest(&(a - to), &(b - to)).1);
    }
    let distance = least.0.sqrt();
    let direction = if distance > T::zero() { least.2 / distance } else { Point::zeros() };
    Clearance::at(least.1, distance, &direction)
}
