//! On which sides of things a path passes.
//!
//! Paths with the same ends can be bent into each other unless something lies between them. What does here are sensors and
//! regions: hills and holes of what a flight costs, and walls. A path has of each how often it passes on its eastern side
//! northward, less how often southward; paths that have the same of all go the same way, which a local method seldom leaves.
//!
//! Limits: sides are those in the horizontal plane, at the nodes' times; paths are told apart by a digest of 64 bits.

use crate::constraints::region::horizontal;
use crate::math::{Point, Real};
use crate::scenario::View;
use crate::trajectory::Trajectory;

/// Digest of the sides on which all agents pass everything.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Sides(u64);

/// Start and factor of the digest, Fowler, Noll and Vo's.
const DIGEST: (u64, u64) = (0xcbf2_9ce4_8422_2325, 0x0100_0000_01b3);

impl Sides {
    /// Of a trajectory.
    pub(super) fn of<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize>(
        scenario: &View<'_, T, DIM>,
        trajectory: &Trajectory<T, DIM, NODES, AGENTS>,
    ) -> Self {
        let mut digest = DIGEST.0;
        let mut take = |passes: i8| digest = (digest ^ u64::from(passes.to_le_bytes()[0])).wrapping_mul(DIGEST.1);
        for track in trajectory.active() {
            let places = track.path.iter().zip(&trajectory.times).take(trajectory.nodes());
            let places = places.map(|(place, &time)| (horizontal(place), time));
            for sensor in scenario.sensors {
                let at = |time| horizontal(&scenario.sensor_state(sensor, time).0);
                take(passes(places.clone().map(|(place, time)| place - at(time))));
            }
            for region in scenario.regions {
                let middle = region.circle().0;
                take(passes(places.clone().map(|(place, _)| place - middle)));
            }
        }
        Self(digest)
    }
}

/// Passes of the eastern side of the origin northward, less those southward.
fn passes<T: Real>(places: impl Iterator<Item = Point<T, 2>>) -> i8 {
    let zero = T::zero();
    let mut passes = 0_i8;
    let mut before: Option<Point<T, 2>> = None;
    for here in places {
        if let Some(before) = before {
            let (is_south, was_south) = (here[1] < zero, before[1] < zero);
            // Who goes north past the origin on its eastern side turns left about it, and who goes south there right.
            let turn = before[0] * here[1] - before[1] * here[0];
            if was_south && !is_south && turn > zero {
                passes = passes.saturating_add(1);
            } else if !was_south && is_south && turn < zero {
                passes = passes.saturating_sub(1);
            }
        }
        before = Some(here);
    }
    passes
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    fn of(path: &[(f64, f64)]) -> i8 {
        passes(path.iter().map(|&(east, north)| Point::<f64, 2>::new(east, north)))
    }

    #[test]
    fn sides_differ_and_detours_do_not_matter() {
        let east = [(0.0, -2.0), (1.0, -0.5), (1.0, 0.5), (0.0, 2.0)];
        let west = east.map(|(x, y)| (-x, y));
        assert_eq!((of(&east), of(&west)), (1, 0));
        // Back and forth across the line on one side.
        let wavering = [(0.0, -2.0), (1.0, 0.5), (1.5, -0.5), (2.0, 0.5), (0.0, 2.0)];
        assert_eq!(of(&wavering), 1);
        let once_round = [(0.0, -2.0), (1.0, 0.5), (-1.0, 0.5), (-1.0, -0.5), (1.0, -0.5), (1.0, 0.5), (0.0, 2.0)];
        assert_eq!(of(&once_round), 2);
        let back: Vec<_> = east.iter().rev().copied().collect();
        assert_eq!(of(&back), -1);
    }
}
