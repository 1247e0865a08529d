//! Vehicles and what they carry.
//!
//! | symbol | name | unit | shape |
//! |---|---|---|---|
//! | x_0, X | `start`, `goal` | scenario length unit | `DIM` |
//! | v_max, a_max | `speed_max`, `accel_max` | unit/s, unit/s^2 | |
//! | q | `q` of [`Betrayal::Max`] | | |
//!
//! Source: sections 2, 3.1 and 3.2. Limits: one jammer and one dropout budget an agent.

use crate::math::Point;

/// How the strength of a jamming signal falls off from its direction: a(alpha, x, y) of section 3.1.2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BeamPattern<T> {
    /// The same in all directions: a = 1.
    Isotropic,
    /// a = max(0, cos)^2 of the angle from the azimuth.
    Cosine,
    /// The cone of full width `beam_width`, (47).
    Cone {
        /// Full width beta, rad.
        beam_width: T,
    },
}

/// How an agent's own jamming raises the probability that it is detected.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Betrayal<T> {
    /// Not at all.
    None,
    /// (44): the q-norm of detection probability and jamming level.
    Max {
        /// Exponent q, greater than 1.
        q: T,
    },
    /// (45): in proportion to the jamming level received.
    Linear,
    /// p + (1 - p) (2 S(k) - 1) with the logistic function S.
    Sigmoid,
}

/// A jamming payload.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jammer<T> {
    /// Directivity.
    pub pattern: BeamPattern<T>,
    /// What the emission does to the jammer's own detection.
    pub betrayal: Betrayal<T>,
    /// Largest integral of the level over the flight, s, (49).
    pub budget: T,
}

/// A transmitter that can fall silent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dropout<T> {
    /// Largest integral of the power reduction over the flight, s, (55).
    pub budget: T,
}

/// A vehicle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Agent<T, const DIM: usize> {
    /// Position at the start time, length units.
    pub start: Point<T, DIM>,
    /// Position at arrival, length units.
    pub goal: Point<T, DIM>,
    /// Velocity at the start time, length units per s; `None` leaves it free.
    pub start_velocity: Option<Point<T, DIM>>,
    /// Largest speed, length units per s.
    pub speed_max: T,
    /// Largest acceleration, length units per s^2.
    pub accel_max: T,
    /// Weight of the agent in every term of the objective.
    pub weight: T,
    /// Jamming payload, where there is one.
    pub jammer: Option<Jammer<T>>,
    /// Intermittent communication, where it is allowed.
    pub dropout: Option<Dropout<T>>,
}
