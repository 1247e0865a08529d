//! Outlines made fit for a scenario: convex, with few corners, never smaller where they are to keep out of.

use quietpath_core::scenario::VERTICES_MAX;

/// An outline, m.
#[derive(Clone, Debug, PartialEq)]
pub enum Fit {
    /// As it was.
    AsItIs(Vec<[f64; 2]>),
    /// Its convex hull.
    Hull(Vec<[f64; 2]>),
    /// The circle around it: centre and radius.
    Circle([f64; 2], f64),
}

/// The smallest outline here that holds all corners; `None` for fewer than three corners, or corners on a line.
#[must_use]
pub fn fitted(corners: &[[f64; 2]]) -> Option<Fit> {
    let hull = hull(corners);
    if hull.len() < 3 {
        return None;
    }
    if hull.len() > VERTICES_MAX {
        let share = 1.0 / hull.len() as f64;
        let center =
            hull.iter().fold([0.0, 0.0], |sum, corner| [sum[0] + share * corner[0], sum[1] + share * corner[1]]);
        let reach = |corner: &[f64; 2]| (corner[0] - center[0]).hypot(corner[1] - center[1]);
        return Some(Fit::Circle(center, hull.iter().map(reach).fold(0.0, f64::max)));
    }
    Some(if hull.len() == corners.len() { Fit::AsItIs(hull) } else { Fit::Hull(hull) })
}

/// The convex hull, counter-clockwise, without corners on its edges (Andrew's monotone chain).
fn hull(corners: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut sorted = corners.to_vec();
    sorted.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    sorted.dedup();
    let half = |points: &mut dyn Iterator<Item = [f64; 2]>| {
        let mut chain: Vec<[f64; 2]> = Vec::new();
        for point in points {
            while let [.., a, b] = chain.as_slice() {
                if (b[0] - a[0]) * (point[1] - a[1]) - (b[1] - a[1]) * (point[0] - a[0]) > 0.0 {
                    break;
                }
                chain.pop();
            }
            chain.push(point);
        }
        chain.pop();
        chain
    };
    let mut ring = half(&mut sorted.iter().copied());
    ring.extend(half(&mut sorted.iter().rev().copied()));
    ring
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dent_is_filled_and_a_square_stays() {
        let square = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]];
        assert!(matches!(fitted(&square), Some(Fit::AsItIs(ring)) if ring.len() == 4));
        let dented = [[0.0, 0.0], [2.0, 0.0], [1.0, 1.0], [2.0, 2.0], [0.0, 2.0]];
        assert!(matches!(fitted(&dented), Some(Fit::Hull(ring)) if ring.len() == 4));
        assert_eq!(fitted(&[[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]]), None);
    }

    #[test]
    fn many_corners_become_the_circle_around_them() {
        let ring: Vec<[f64; 2]> =
            (0..40).map(|k| f64::from(k) * 0.157).map(|a| [3.0 * a.cos(), 3.0 * a.sin()]).collect();
        let Some(Fit::Circle(center, radius)) = fitted(&ring) else { panic!("{:?}", fitted(&ring)) };
        assert!(ring.iter().all(|corner| (corner[0] - center[0]).hypot(corner[1] - center[1]) <= radius));
        assert!(radius < 3.1, "{radius}");
    }
}
