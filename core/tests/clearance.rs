//! Slacks of regions and of the separation: sign, size and derivative against what dense sampling sees.
//!
//! Shapes and segments are drawn from a fixed sequence. Sampling knows nothing of normals or axes: it asks of many
//! places of the segment whether they are inside, by counting how often a ray crosses the outline.

use std::f64::consts::TAU;

use quietpath_core::Point;
use quietpath_core::constraints::clearance::{Clearance, clearance, separation_clearance};
use quietpath_core::constraints::region::depth;
use quietpath_core::math::{norm, norm_squared};
use quietpath_core::scenario::{Polygon, Region, Shape, Side, Window};

type Flat = Point<f64, 2>;

/// Places of a segment, and of an edge, that are looked at.
const SAMPLES: u32 = 400;

/// A fixed sequence of numbers that look random: splitmix64.
struct Draws(u64);

impl Draws {
    fn number(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut bits = self.0;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        let share = ((bits ^ (bits >> 31)) >> 11) as f64 / (1_u64 << 53) as f64;
        low + (high - low) * share
    }

    fn point<const DIM: usize>(&mut self, low: f64, high: f64) -> Point<f64, DIM> {
        Point::from_fn(|_, _| self.number(low, high))
    }

    /// A polygon with its corners on an ellipse, in either direction.
    fn polygon(&mut self) -> Vec<Flat> {
        let count = self.number(3.0, 13.0) as usize;
        let (center, wide, high) = (self.point::<2>(-1.0, 1.0), self.number(0.5, 2.0), self.number(0.5, 2.0));
        let (first, turn) = (self.number(0.0, TAU), if self.number(0.0, 1.0) < 0.5 { 1.0 } else { -1.0 });
        let corner = |draws: &mut Self, index: usize| {
            let angle = first + turn * TAU * (index as f64 + draws.number(-0.35, 0.35)) / count as f64;
            center + Flat::new(wide * angle.cos(), high * angle.sin())
        };
        (0..count).map(|index| corner(self, index)).collect()
    }

    fn region(&mut self, kind: usize) -> Region<f64> {
        let shape = if kind < 2 {
            Shape::Circle { center: self.point(-1.0, 1.0), radius: self.number(0.5, 2.0) }
        } else {
            Shape::Polygon(Polygon::new(&self.polygon()).expect("corners on an ellipse are convex"))
        };
        let side = if kind.is_multiple_of(2) { Side::Outside } else { Side::Inside };
        Region { shape, side, window: Window::always() }
    }

    /// A segment: long, short, or far from anything.
    fn segment(&mut self) -> (Flat, Flat) {
        let reach = [0.7, 2.0, 5.0][self.number(0.0, 3.0) as usize];
        let from: Flat = self.point(-reach, reach);
        let to =
            if self.number(0.0, 1.0) < 0.3 { from + self.point::<2>(-0.2, 0.2) } else { self.point(-reach, reach) };
        (from, to)
    }
}

/// Whether a ray to the east crosses the outline an odd number of times.
fn is_inside(shape: &Shape<f64>, place: &Flat) -> bool {
    match shape {
        Shape::Circle { center, radius } => norm(&(place - center)) < *radius,
        Shape::Polygon(polygon) => {
            let crosses = |(a, b): &(&Flat, &Flat)| {
                (a.y > place.y) != (b.y > place.y) && place.x < a.x + (place.y - a.y) / (b.y - a.y) * (b.x - a.x)
            };
            polygon.edges().filter(crosses).count() % 2 == 1
        }
    }
}

fn along(from: &Flat, to: &Flat) -> impl Iterator<Item = Flat> {
    (0..=SAMPLES).map(move |index| from + (to - from) * (f64::from(index) / f64::from(SAMPLES)))
}

/// Places on the outline.
fn outline(shape: &Shape<f64>) -> Vec<Flat> {
    match shape {
        Shape::Circle { center, radius } => {
            let at = |k: u32| f64::from(k) / 2000.0 * TAU;
            (0..2000).map(|k| center + Flat::new(at(k).cos(), at(k).sin()) * *radius).collect()
        }
        Shape::Polygon(polygon) => polygon.edges().flat_map(|(a, b)| along(a, b).collect::<Vec<_>>()).collect(),
    }
}

#[test]
fn signs_are_those_of_dense_sampling() {
    let mut draws = Draws(1);
    let mut seen = [[0; 2]; 4];
    for case in 0..8000 {
        let kind = case % 4;
        let region = draws.region(kind);
        let (from, to) = draws.segment();
        let value = clearance(&region, &from, &to).value;
        let wrong = |place: Flat| is_inside(&region.shape, &place) == (region.side == Side::Outside);
        let broken = along(&from, &to).any(wrong);
        // Rounding on the boundary aside, and what passes between two samples.
        let what = format!("{region:?} {from} {to}: {value}");
        assert!(!(broken && value > 1e-12), "kept, says {what}");
        assert!(broken || value > -2e-2, "broken, says {what}");
        assert_eq!(depth(&region, &from, &to) > 1e-12, value < -1e-12, "{what}");
        seen[kind][usize::from(broken)] += 1;
    }
    println!("kept and broken of each kind: {seen:?}");
    assert!(seen.iter().flatten().all(|count| *count > 200), "{seen:?}");
}

#[test]
fn points_agree_with_blocks() {
    let mut draws = Draws(2);
    for case in 0..4000 {
        let region = draws.region(case % 4);
        let place: Flat = draws.point(-3.0, 3.0);
        let wrong = is_inside(&region.shape, &place) == (region.side == Side::Outside);
        assert_eq!(region.blocks(&place), wrong, "{region:?} {place}");
    }
}

#[test]
fn distances_outside_are_those_of_dense_sampling() {
    let mut draws = Draws(3);
    let mut compared = 0;
    while compared < 150 {
        let region = draws.region(2 * (compared % 2));
        let (from, to) = draws.segment();
        let value = clearance(&region, &from, &to).value;
        if value <= 0.0 {
            continue;
        }
        let distance = match &region.shape {
            Shape::Circle { radius, .. } => ((value + 1.0).sqrt() - 1.0) * radius,
            Shape::Polygon(polygon) => value * polygon.scale(),
        };
        let outline = outline(&region.shape);
        let gaps =
            along(&from, &to).flat_map(|place| outline.iter().map(move |other| norm_squared(&(place - other))));
        let sampled = gaps.fold(f64::INFINITY, f64::min).sqrt();
        // The nearest sample lies within half a step of segment and outline: farther by no more than that.
        let step = norm(&(to - from)) / f64::from(SAMPLES) + 0.013;
        assert!(
            sampled >= distance - 1e-9 && sampled <= distance + step,
            "{region:?} {from} {to}: {distance} {sampled}"
        );
        compared += 1;
    }
}

#[test]
fn a_depth_is_the_least_shift_that_takes_the_segment_out() {
    let mut draws = Draws(4);
    let mut compared = 0;
    while compared < 500 {
        let region = draws.region(2);
        let Shape::Polygon(polygon) = &region.shape else { continue };
        let (from, to) = draws.segment();
        let found = clearance(&region, &from, &to);
        if found.value >= 0.0 {
            continue;
        }
        let depth = -found.value * polygon.scale();
        let way = (found.by_from + found.by_to) * polygon.scale();
        assert!((norm(&way) - 1.0).abs() < 1e-9, "a shift of the whole by a unit is worth a unit: {way}");
        let shifted = |shift: Flat| clearance(&region, &(from + shift), &(to + shift)).value;
        assert!(shifted(way * depth).abs() < 1e-9, "{region:?} {from} {to}");
        for k in 0..64 {
            let angle = f64::from(k) / 64.0 * TAU;
            let less = Flat::new(angle.cos(), angle.sin()) * (0.99 * depth);
            assert!(shifted(less) < 0.0, "{region:?} {from} {to}");
        }
        compared += 1;
    }
}

/// Compares derivatives with differences, one coordinate of `ends` after the other; `None` at a kink.
fn differs<const DIM: usize, const ENDS: usize>(
    ends: [Point<f64, DIM>; ENDS],
    analytic: [Point<f64, DIM>; ENDS],
    value: impl Fn(&[Point<f64, DIM>; ENDS]) -> f64,
) -> Option<f64> {
    let step = 1e-6;
    let here = value(&ends);
    let mut worst = 0.0_f64;
    for end in 0..ENDS {
        for axis in 0..DIM {
            let at = |steps: f64| {
                let mut moved = ends;
                moved[end][axis] += steps * step;
                value(&moved)
            };
            let (back, ahead) = ((here - at(-1.0)) / step, (at(1.0) - here) / step);
            if (ahead - back).abs() > 1e-2 {
                return None;
            }
            let central = (8.0 * (at(1.0) - at(-1.0)) - (at(2.0) - at(-2.0))) / (12.0 * step);
            worst = worst.max((analytic[end][axis] - central).abs());
        }
    }
    Some(worst)
}

fn assert_derivatives(what: &str, found: &[Option<f64>], kinks_max: f64) {
    let smooth: Vec<f64> = found.iter().flatten().copied().collect();
    let worst = smooth.iter().fold(0.0_f64, |worst, difference| worst.max(*difference));
    let kinks = 1.0 - smooth.len() as f64 / found.len() as f64;
    println!("{what}: {} compared, worst difference {worst:.1e}, kinks {kinks:.4}", smooth.len());
    assert!(kinks <= kinks_max, "{what}: {kinks} of the cases are at a kink");
    // A second difference of up to 1e-2 / 1e-6 passes for smooth.
    assert!(worst < 1e-6, "{what}: {worst:.1e}");
}

#[test]
fn derivatives_are_those_of_differences() {
    let mut draws = Draws(5);
    for (kind, what) in
        ["outside a circle", "inside a circle", "outside a polygon", "inside a polygon"].iter().enumerate()
    {
        let mut found = Vec::new();
        for _ in 0..4000 {
            let region = draws.region(kind);
            let (from, to) = draws.segment();
            // A segment that is a point has a kink wherever the nearest place depends on the direction that it gets.
            if norm(&(to - from)) < 1e-2 {
                continue;
            }
            let Clearance { by_from, by_to, .. } = clearance(&region, &from, &to);
            found.push(differs([from, to], [by_from, by_to], |[a, b]| clearance(&region, a, b).value));
        }
        assert_derivatives(what, &found, 0.002);
    }
}

fn separation<const DIM: usize>(seed: u64) {
    let mut draws = Draws(seed);
    let mut found = Vec::new();
    for _ in 0..2000 {
        let ends: [Point<f64, DIM>; 4] = std::array::from_fn(|_| draws.point(-1.0, 1.0));
        let least = draws.number(0.2, 2.0);
        let value = |ends: &[Point<f64, DIM>; 4]| separation_clearance(least, &ends[0], &ends[1], &ends[2], &ends[3]);
        let here = value(&ends);
        let analytic = [here.by_from, here.by_to, -here.by_from, -here.by_to];
        found.push(differs(ends, analytic, |ends| value(ends).value));
        let place = |k: u32| {
            let share = f64::from(k) / 2000.0;
            (ends[0] - ends[2]) * (1.0 - share) + (ends[1] - ends[3]) * share
        };
        let closest = (0..=2000).map(|k| norm(&place(k))).fold(f64::INFINITY, f64::min);
        let distance = (here.value + 1.0).sqrt() * least;
        assert!(distance <= closest + 1e-12 && closest < distance + 2e-3, "{ends:?}: {distance} {closest}");
    }
    assert_derivatives("separation", &found, 0.002);
}

#[test]
fn separation_is_that_of_dense_sampling_and_its_derivatives_those_of_differences() {
    separation::<2>(6);
    separation::<3>(7);
}

#[test]
fn values_are_continuous_where_a_segment_shrinks_to_a_point() {
    let mut draws = Draws(8);
    for case in 0..400 {
        let region = draws.region(case % 4);
        let (place, aside) = (draws.point::<2>(-2.0, 2.0), draws.point::<2>(-1e-9, 1e-9));
        let (point, short) = (clearance(&region, &place, &place), clearance(&region, &place, &(place + aside)));
        assert!((point.value - short.value).abs() < 1e-7, "{region:?} {place}");
        let way = (point.by_from + point.by_to) - (short.by_from + short.by_to);
        assert!(norm(&way) < 1e-6 || region.side == Side::Inside || short.value < 0.0, "{region:?} {place}: {way}");
    }
}

#[test]
fn what_is_not_finite_is_not_a_number() {
    let mut draws = Draws(9);
    for kind in 0..4 {
        let region = draws.region(kind);
        let (good, bad) = (Flat::zeros(), Flat::new(0.0, f64::NAN));
        assert!(clearance(&region, &good, &bad).value.is_nan() && clearance(&region, &bad, &good).value.is_nan());
        assert!(depth(&region, &good, &bad).is_nan() && depth(&region, &bad, &good).is_nan());
    }
    let far = Point::<f64, 3>::new(f64::INFINITY, 0.0, 0.0);
    assert!(separation_clearance(1.0, &far, &far, &Point::zeros(), &Point::zeros()).value.is_nan());
}

#[test]
fn single_precision_has_the_same_signs() {
    let mut draws = Draws(10);
    let single = |place: &Flat| Point::<f32, 2>::new(place.x as f32, place.y as f32);
    for case in 0..2000 {
        let region = draws.region(case % 4);
        let shape = match &region.shape {
            Shape::Circle { center, radius } => Shape::Circle { center: single(center), radius: *radius as f32 },
            Shape::Polygon(polygon) => {
                let corners: Vec<_> = polygon.vertices().iter().map(single).collect();
                Shape::Polygon(Polygon::new(&corners).expect("convex in single precision, too"))
            }
        };
        let region_single = Region { shape, side: region.side, window: Window::always() };
        let (from, to) = draws.segment();
        let (double, ours) =
            (clearance(&region, &from, &to).value, clearance(&region_single, &single(&from), &single(&to)).value);
        assert!(
            (f64::from(ours) - double).abs() < 2e-5 * (1.0 + double.abs()),
            "{region:?} {from} {to}: {ours} {double}"
        );
    }
}
