//! Regions to keep out of or to stay in: circles and convex polygons, in three dimensions upright columns.
//!
//! | symbol | name | unit | shape |
//! |---|---|---|---|
//! | c, r | `center`, `radius` | length unit | 2, |
//! | v_k | `vertices` | length unit | 3 .. [`VERTICES_MAX`] points, counter-clockwise |
//! | n_k | `normals` | 1 | as many: outward, of the edge from v_k to v_(k+1) |
//! | s | `scale` | length unit | |
//!
//! The scale of a polygon, against which depths are measured as those of a circle are against its radius, is twice
//! its area over its perimeter: the radius of the circle inside where the polygon has one that touches all edges, and
//! never less than the radius of the largest circle inside, nor more than twice that.
//!
//! Source: (60); polygons and regions to stay in go beyond the paper. Limits: [`VERTICES_MAX`] vertices; polygons are
//! strictly convex.

use crate::constraints::clearance::{Clearance, clearance};
use crate::error::Fault;
use crate::math::{Point, Real, norm};

use super::Window;

/// Vertices that a polygon can have.
pub const VERTICES_MAX: usize = 12;

/// Distance of a vertex from the line through an edge that it does not belong to, relative to the extent of the
/// polygon, below which the polygon counts as not strictly convex: small for a drawn polygon, large against rounding
/// in single precision.
const CONVEXITY_MIN: f64 = 1e-5;

/// On which side of its boundary a region is flown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Side {
    /// Keep out.
    #[default]
    Outside,
    /// Stay in.
    Inside,
}

/// The outline of a region.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape<T> {
    /// A circle.
    Circle {
        /// Centre, length units.
        center: Point<T, 2>,
        /// Radius, length units.
        radius: T,
    },
    /// A convex polygon.
    Polygon(Polygon<T>),
}

/// A strictly convex polygon, checked when it was made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Polygon<T> {
    vertices: [Point<T, 2>; VERTICES_MAX],
    normals: [Point<T, 2>; VERTICES_MAX],
    count: usize,
    scale: T,
}

/// A circle or polygon (in three dimensions an upright column) that the segments of every path keep out of, or stay
/// in, (60).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Region<T> {
    /// Its outline.
    pub shape: Shape<T>,
    /// On which side of the outline paths stay.
    pub side: Side,
    /// Time in which it applies: to the segments that end in it.
    pub window: Window<T>,
}

impl<T: Real> Region<T> {
    /// Whether a horizontal position is on the wrong side, at a time when the region applies; the boundary is not.
    #[must_use]
    pub fn blocks(&self, position: &Point<T, 2>) -> bool {
        self.clearance(position, position).value < T::zero()
    }

    /// A circle that holds its boundary: centre and radius, length units.
    pub(crate) fn circle(&self) -> (Point<T, 2>, T) {
        match &self.shape {
            Shape::Circle { center, radius } => (*center, *radius),
            Shape::Polygon(polygon) => polygon.circle(),
        }
    }

    /// How far a horizontal position is from the wrong side, at a time when the region applies, length units: where it
    /// is on the wrong side, less how far it is from the right one.
    #[must_use]
    pub fn distance(&self, position: &Point<T, 2>) -> T {
        let from_center = |center: &Point<T, 2>| norm(&(position - center));
        match (&self.shape, self.side) {
            (Shape::Circle { center, radius }, Side::Outside) => from_center(center) - *radius,
            (Shape::Circle { center, radius }, Side::Inside) => *radius - from_center(center),
            (Shape::Polygon(polygon), _) => self.clearance(position, position).value * polygon.scale(),
        }
    }

    /// How far the segment between two horizontal positions is from breaking the region, at a time when it applies:
    /// see [`clearance`].
    #[must_use]
    pub fn clearance(&self, from: &Point<T, 2>, to: &Point<T, 2>) -> Clearance<T> {
        clearance(self, from, to)
    }
}

/// Twice the signed area of the triangle a, b, c: positive where it turns left.
fn turn<T: Real>(a: &Point<T, 2>, b: &Point<T, 2>, c: &Point<T, 2>) -> T {
    let (along, across) = (b - a, c - a);
    along.x * across.y - along.y * across.x
}

impl<T: Real> Polygon<T> {
    /// The circle around the mean of its vertices that holds it: centre and radius, length units.
    pub(crate) fn circle(&self) -> (Point<T, 2>, T) {
        let vertices = || self.vertices.iter().take(self.count);
        let center = vertices().fold(Point::zeros(), |sum, vertex| sum + vertex) / T::from_count(self.count.max(1));
        (center, vertices().map(|vertex| norm(&(vertex - center))).fold(T::zero(), T::max))
    }

    /// The polygon with these vertices (length units), in order along its boundary, in either direction.
    ///
    /// # Errors
    /// [`Fault::TooFew`] or [`Fault::TooMany`] vertices, [`Fault::NotFinite`], and [`Fault::NotConvex`] with the first
    /// vertex at which the boundary does not turn as it does elsewhere; a polygon without area, one with a vertex given
    /// twice or half way along an edge, and one that crosses itself are not convex either.
    pub fn new(vertices: &[Point<T, 2>]) -> Result<Self, Fault> {
        let count = vertices.len();
        if count < 3 {
            return Err(Fault::TooFew { count, need: 3 });
        }
        if count > VERTICES_MAX {
            return Err(Fault::TooMany { count, capacity: VERTICES_MAX });
        }
        if !vertices.iter().all(|vertex| vertex.iter().all(|component| component.finite())) {
            return Err(Fault::NotFinite);
        }
        let orientation = orientation(vertices)?;
        let mut stored = [Point::zeros(); VERTICES_MAX];
        for (slot, vertex) in stored.iter_mut().zip(vertices) {
            *slot = *vertex;
        }
        if orientation < T::zero() {
            stored.get_mut(..count).unwrap_or_default().reverse();
        }
        Ok(Self::measured(stored, count))
    }

    /// Adds normals and scale to vertices that are convex and counter-clockwise.
    fn measured(vertices: [Point<T, 2>; VERTICES_MAX], count: usize) -> Self {
        let mut polygon = Self { vertices, normals: [Point::zeros(); VERTICES_MAX], count, scale: T::zero() };
        let (mut normals, mut perimeter, mut area) = (polygon.normals, T::zero(), T::zero());
        let first = vertices.first().copied().unwrap_or_default();
        for (normal, (a, b)) in normals.iter_mut().zip(polygon.edges()) {
            let edge = b - a;
            let length = norm(&edge);
            *normal = Point::<T, 2>::new(edge.y, -edge.x) / length;
            perimeter += length;
            area += turn(&first, a, b);
        }
        polygon.normals = normals;
        polygon.scale = area / perimeter;
        polygon
    }

    /// The vertices, counter-clockwise, length units.
    #[must_use]
    pub fn vertices(&self) -> &[Point<T, 2>] {
        self.vertices.get(..self.count).unwrap_or_default()
    }

    /// Ends of the edges, counter-clockwise; the first begins at the first vertex.
    pub fn edges(&self) -> impl Iterator<Item = (&Point<T, 2>, &Point<T, 2>)> {
        let vertices = self.vertices();
        vertices.iter().zip(vertices.iter().cycle().skip(1))
    }

    /// The first end of every edge and its outward unit normal.
    pub(crate) fn sides(&self) -> impl Iterator<Item = (&Point<T, 2>, &Point<T, 2>)> {
        self.vertices().iter().zip(&self.normals)
    }

    /// What a depth is measured against, length units: see the module.
    #[must_use]
    pub const fn scale(&self) -> T {
        self.scale
    }
}

/// 1 where the vertices turn left, -1 where they turn right.
fn orientation<T: Real>(vertices: &[Point<T, 2>]) -> Result<T, Fault> {
    let after = |steps: usize| vertices.iter().cycle().skip(steps);
    let (mut area, mut extent) = (T::zero(), T::zero());
    let first = vertices.first().copied().unwrap_or_default();
    for (a, b) in vertices.iter().zip(after(1)) {
        area += turn(&first, a, b);
        extent = extent.max(norm(&(a - first)));
    }
    let sign = if area < T::zero() { -T::one() } else { T::one() };
    let least = T::real(CONVEXITY_MIN) * extent;
    let strictly_left = |a: &Point<T, 2>, b: &Point<T, 2>, c: &Point<T, 2>| {
        let length = norm(&(b - a));
        length > least && sign * turn(a, b, c) > least * length
    };
    for (index, ((a, b), c)) in vertices.iter().zip(after(1)).zip(after(2)).enumerate() {
        if !strictly_left(a, b, c) {
            return Err(Fault::NotConvex { vertex: (index + 1) % vertices.len() });
        }
    }
    // A star turns the same way at each of its points, but not every other vertex lies on one side of each edge.
    for (edge, (a, b)) in vertices.iter().zip(after(1)).enumerate() {
        for (index, c) in vertices.iter().enumerate() {
            let own = index == edge || index == (edge + 1) % vertices.len();
            if !own && !strictly_left(a, b, c) {
                return Err(Fault::NotConvex { vertex: index });
            }
        }
    }
    Ok(sign)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn made(vertices: &[[f64; 2]]) -> Result<Polygon<f64>, Fault> {
        let points: std::vec::Vec<_> = vertices.iter().map(|&[x, y]| Point::<f64, 2>::new(x, y)).collect();
        Polygon::new(&points)
    }

    #[test]
    fn both_directions_are_the_same_polygon() {
        let left = made(&[[0.0, 0.0], [4.0, 0.0], [4.0, 2.0], [0.0, 2.0]]).expect("convex");
        let right = made(&[[0.0, 2.0], [4.0, 2.0], [4.0, 0.0], [0.0, 0.0]]).expect("convex");
        assert_eq!(left, right);
        assert_eq!(left.normals[0], Point::<f64, 2>::new(0.0, -1.0));
        // Area 8, perimeter 12.
        assert!((left.scale() - 16.0 / 12.0).abs() < 1e-15, "{}", left.scale());
    }

    #[test]
    fn scale_of_a_regular_polygon_is_the_radius_of_the_circle_inside() {
        let corner = |k: u32| {
            let (sin, cos) = (f64::from(k) * std::f64::consts::TAU / 12.0).sin_cos();
            [30.0 + 2.0 * cos, -7.0 + 2.0 * sin]
        };
        let corners: std::vec::Vec<_> = (0..12).map(corner).collect();
        let inradius = 2.0 * (std::f64::consts::PI / 12.0).cos();
        assert!((made(&corners).expect("convex").scale() - inradius).abs() < 1e-13);
    }

    #[test]
    fn what_is_no_convex_polygon_is_refused_with_its_vertex() {
        let not_convex = |vertex| Err(Fault::NotConvex { vertex });
        type Case = (&'static [[f64; 2]], Result<Polygon<f64>, Fault>);
        let cases: [Case; 9] = [
            (&[[0.0, 0.0], [1.0, 0.0]], Err(Fault::TooFew { count: 2, need: 3 })),
            (&[[0.0, 0.0]; 13], Err(Fault::TooMany { count: 13, capacity: 12 })),
            (&[[0.0, 0.0], [1.0, 0.0], [f64::NAN, 1.0]], Err(Fault::NotFinite)),
            // A dent.
            (&[[0.0, 0.0], [4.0, 0.0], [1.0, 1.0], [0.0, 4.0]], not_convex(2)),
            (&[[0.0, 4.0], [1.0, 1.0], [4.0, 0.0], [0.0, 0.0]], not_convex(1)),
            // Half way along an edge.
            (&[[0.0, 0.0], [2.0, 0.0], [4.0, 0.0], [0.0, 4.0]], not_convex(1)),
            // Twice the same.
            (&[[0.0, 0.0], [4.0, 0.0], [4.0, 0.0], [0.0, 4.0]], not_convex(1)),
            (&[[1.0, 1.0]; 3], not_convex(1)),
            // No area.
            (&[[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]], not_convex(1)),
        ];
        for (vertices, expected) in cases {
            assert_eq!(made(vertices), expected, "{vertices:?}");
        }
        // A pentagram turns left at every point.
        let point = |k: u32| {
            let (sin, cos) = (f64::from(k * 2) * std::f64::consts::TAU / 5.0).sin_cos();
            [cos, sin]
        };
        let star: std::vec::Vec<_> = (0..5).map(point).collect();
        assert!(matches!(made(&star), Err(Fault::NotConvex { .. })), "{:?}", made(&star));
    }
}
