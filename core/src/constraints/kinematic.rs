//! Speed and acceleration.
//!
//! | symbol | name | unit | shape |
//! |---|---|---|---|
//! | h_i = t_i - t_(i-1) | interval | s | N |
//! | v_i = (x_i - x_(i-1)) / h_i | velocity | length unit / s | N |
//! | a_i = 2 (v_(i+1) - v_i) / (h_(i+1) + h_i) | acceleration | length unit / s^2 | N - 1 |
//!
//! |v_i| <= speed_max, |a_i| <= accel_max, and with a start velocity also |v_1 - v| / h_1 <= accel_max; where the start
//! is a seam that an interval h_0 leads up to, 2 |v_1 - v| / (h_1 + h_0) <= accel_max.
//!
//! Positions and times are rounded to what the number type holds, and velocities and accelerations can be known to within
//! what that makes of them only; so much is not held against a path. In double precision it is nothing, in single precision
//! it is what short intervals far from the origin have.
//!
//! Source: section 4.1, and Remark 3.3.3 for seams.

use crate::constraints::Worst;
use crate::math::{Point, Real, norm};

/// A velocity, the interval that it is flown for, and how far the rounding of positions and times may have moved it.
#[derive(Clone, Copy)]
struct Flown<T, const DIM: usize> {
    interval: T,
    velocity: Point<T, DIM>,
    rounding: T,
}

/// Velocities of a path; infinite where the interval is not longer than zero.
fn velocities<T: Real, const DIM: usize>(
    times: &[T],
    path: &[Point<T, DIM>],
) -> impl Iterator<Item = Flown<T, DIM>> + Clone {
    let steps = path.iter().zip(path.iter().skip(1));
    let ends = times.iter().zip(times.iter().skip(1));
    ends.zip(steps).map(|((&start, &end), (from, to))| {
        let interval = end - start;
        if interval > T::zero() {
            let velocity = (to - from) / interval;
            let places = norm(from) + norm(to) + norm(&velocity) * (start.abs() + end.abs());
            Flown { interval, velocity, rounding: T::EPSILON * places / interval }
        } else {
            Flown { interval, velocity: Point::repeat(T::INFINITY), rounding: T::zero() }
        }
    })
}

/// Largest speed over `speed_max`, less 1; 0 where none exceeds it. The node is that at the end of the interval.
pub fn speed_excess<T: Real, const DIM: usize>(speed_max: T, times: &[T], path: &[Point<T, DIM>]) -> Worst<T> {
    let mut worst = Worst::none();
    for (index, flown) in velocities(times, path).enumerate() {
        worst.raise(index + 1, (norm(&flown.velocity) - flown.rounding) / speed_max - T::one());
    }
    worst
}

/// How an agent comes to the start: its velocity (length units per s), where that is given, and the interval flown at it
/// (s), where there was one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Approach<T, const DIM: usize> {
    /// Velocity before the start.
    pub velocity: Option<Point<T, DIM>>,
    /// Interval before the start.
    pub interval: Option<T>,
}

/// Largest acceleration over `accel_max`, less 1; 0 where none exceeds it.
pub fn accel_excess<T: Real, const DIM: usize>(
    accel_max: T,
    approach: Approach<T, DIM>,
    times: &[T],
    path: &[Point<T, DIM>],
) -> Worst<T> {
    let mut worst = Worst::none();
    let velocities = velocities(times, path);
    let half = T::real(0.5);
    if let (Some(start), Some(first)) = (approach.velocity, velocities.clone().next()) {
        let mean = half * (first.interval + approach.interval.unwrap_or(first.interval));
        let change = norm(&(first.velocity - start)) - first.rounding;
        worst.raise(0, change / mean / accel_max - T::one());
    }
    for (index, (from, to)) in velocities.clone().zip(velocities.skip(1)).enumerate() {
        let mean = half * (from.interval + to.interval);
        let change = norm(&(to.velocity - from.velocity)) - from.rounding - to.rounding;
        worst.raise(index + 1, change / mean / accel_max - T::one());
    }
    worst
}
