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
//! Source: section 4.1, and Remark 3.3.3 for seams.

use crate::constraints::Worst;
use crate::math::{Point, Real, norm};

/// Velocities and intervals of a path; a velocity is infinite where the interval is not longer than zero.
fn velocities<T: Real, const DIM: usize>(
    times: &[T],
    path: &[Point<T, DIM>],
) -> impl Iterator<Item = (T, Point<T, DIM>)> + Clone {
    let steps = path.iter().zip(path.iter().skip(1));
    let intervals = times.iter().zip(times.iter().skip(1)).map(|(&from, &to)| to - from);
    intervals.zip(steps).map(|(interval, (from, to))| {
        let velocity = if interval > T::zero() { (to - from) / interval } else { Point::repeat(T::INFINITY) };
        (interval, velocity)
    })
}

/// Largest speed over `speed_max`, less 1; 0 where none exceeds it. The node is that at the end of the interval.
pub fn speed_excess<T: Real, const DIM: usize>(speed_max: T, times: &[T], path: &[Point<T, DIM>]) -> Worst<T> {
    let mut worst = Worst::none();
    for (index, (_, velocity)) in velocities(times, path).enumerate() {
        worst.raise(index + 1, norm(&velocity) / speed_max - T::one());
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
    if let (Some(start), Some((interval, first))) = (approach.velocity, velocities.clone().next()) {
        let mean = T::real(0.5) * (interval + approach.interval.unwrap_or(interval));
        worst.raise(0, norm(&(first - start)) / mean / accel_max - T::one());
    }
    for (index, ((before, from), (after, to))) in velocities.clone().zip(velocities.skip(1)).enumerate() {
        let mean = T::real(0.5) * (before + after);
        worst.raise(index + 1, norm(&(to - from)) / mean / accel_max - T::one());
    }
    worst
}
