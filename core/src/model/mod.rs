//! What one sensor makes of one agent: ranging, detection, jamming, dropout.
//!
//! Each part is a leaf of arithmetic: a figure of one sensor and its derivatives. How the sensors' figures combine
//! is the matter of [`crate::metrics`].
//!
//! | symbol | name | unit | shape |
//! |---|---|---|---|
//! | d^2 | `square`: squared softened distance | length unit squared | |
//! | sigma_j^2 | `variance` | length unit squared | |
//! | p_j | `probability` | | |
//! | z, alpha | `level`, `azimuth` | 0 .. 1, rad | |
//! | theta | `dropout` | 0 .. 1, 1 is silence | |
//!
//! Everything is a function of the squared distance, because the usual path-loss exponents then need no square
//! root, and derivatives no division by a distance. Where a sensor is at a time is
//! [`View::sensor_state`](crate::scenario::View::sensor_state).
//!
//! Limits: squared distances are held between `1 / Real::LARGE` and the largest number, variances between
//! `1 / Real::LARGE` and `Real::LARGE`; beyond, figures are flat and their derivatives zero.

pub mod betrayal;
pub mod detector;
pub mod dropout;
pub mod jamming;
pub mod ranging;

use crate::math::{Point, Real, norm_squared};

/// d^2 = `|offset|^2 + softening^2`, length unit squared.
#[inline]
#[must_use]
pub fn soft_square<T: Real, const DIM: usize>(offset: &Point<T, DIM>, softening: T) -> T {
    (norm_squared(offset) + softening * softening).clamp_to(T::one() / T::LARGE, T::MAX)
}
