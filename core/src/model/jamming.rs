//! Jamming: emitters, their beams, and what they do to a sensor's distance estimator.
//!
//! | symbol | name | unit | shape |
//! |---|---|---|---|
//! | x_m | `position` of emitter m | length unit | `DIM` |
//! | z_m | `level` | 0 .. 1 | |
//! | alpha_m | `azimuth` | rad, counter-clockwise from east | |
//! | a_m | beam gain towards the sensor | 0 .. 1 | |
//! | c_j, rho_j | `error_gain`, `error_exponent` | | |
//!
//! sigma_j^2 is multiplied by 1 + sum over m of c_j z_m a_m / d(x_m, y_j)^rho_j. Beams turn about the vertical:
//! cos is that of the horizontal angle between azimuth and sensor, 1 straight above or below. Isotropic: a = 1.
//! Cosine: a = max(0, cos)^2. Cone of full width beta: a = max(0, cos - cos(beta/2))^2 / (1 - cos(beta/2))^2.
//!
//! Source: (38)-(42), (46)-(48); the paper multiplies the whole variance by the gain, which makes a sensor
//! outside the beam perfect: here the gain stands on the jamming term alone.

mod curvature;

pub(crate) use curvature::Emission;

use crate::math::{Point, Real, power};
use crate::model::soft_square;
use crate::scenario::{BeamPattern, Jammer, Susceptibility};

/// How the gain depends on the cosine of the angle from the azimuth.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Beam<T> {
    Isotropic,
    /// a = (max(0, cos - `edge`) `scale`)^2 towards (`east`, `north`).
    Directed {
        edge: T,
        scale: T,
        east: T,
        north: T,
    },
}

/// One agent's jammer at one instant, and the derivatives collected for it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Emitter<T, const DIM: usize> {
    /// Index of the agent that carries it.
    pub agent: usize,
    pub(crate) position: Point<T, DIM>,
    pub(crate) level: T,
    beam: Beam<T>,
    /// Derivatives by position, level and azimuth.
    pub adjoint: EmitterAdjoint<T, DIM>,
}

/// Derivatives of a figure by what an emitter does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmitterAdjoint<T, const DIM: usize> {
    /// By the position, 1 / length unit.
    pub position: Point<T, DIM>,
    /// By the level.
    pub level: T,
    /// By the azimuth, 1 / rad.
    pub azimuth: T,
}

/// A gain, with its derivatives by the azimuth and by the horizontal offset sensor - emitter.
struct Gain<T> {
    value: T,
    by_azimuth: T,
    by_east: T,
    by_north: T,
}

impl<T: Real, const DIM: usize> Emitter<T, DIM> {
    /// The jammer of agent `agent`, at `position`, working at `level` towards `azimuth` (rad).
    #[must_use]
    pub fn new(agent: usize, jammer: &Jammer<T>, position: Point<T, DIM>, level: T, azimuth: T) -> Self {
        let directed = |edge: T| {
            let (north, east) = azimuth.sin_cos();
            // A cone too narrow for the precision keeps a finite gain.
            Beam::Directed { edge, scale: T::one() / (T::one() - edge).max(T::EPSILON), east, north }
        };
        let beam = match jammer.pattern {
            BeamPattern::Isotropic => Beam::Isotropic,
            BeamPattern::Cosine => directed(T::zero()),
            BeamPattern::Cone { beam_width } => directed((beam_width * T::real(0.5)).sin_cos().1),
        };
        let adjoint = EmitterAdjoint { position: Point::zeros(), level: T::zero(), azimuth: T::zero() };
        Self { agent, position, level, beam, adjoint }
    }

    /// Beam gain towards a sensor at `offset` from the emitter. Source: (46), (47).
    #[inline]
    fn gain(&self, offset: &Point<T, DIM>) -> Gain<T> {
        let (zero, one) = (T::zero(), T::one());
        let Beam::Directed { edge, scale, east, north } = self.beam else {
            return Gain { value: one, by_azimuth: zero, by_east: zero, by_north: zero };
        };
        let mut components = offset.iter().copied();
        let u = components.next().unwrap_or_default();
        let v = components.next().unwrap_or_default();
        let length = (u * u + v * v).sqrt();
        if length == zero {
            let value = ((one - edge) * scale).squared();
            return Gain { value, by_azimuth: zero, by_east: zero, by_north: zero };
        }
        let (u, v) = (u / length, v / length);
        let cosine = east * u + north * v;
        let sine = east * v - north * u;
        let inside = ((cosine - edge) * scale).max(zero);
        let by_cosine = T::real(2.0) * inside * scale;
        // Turning the offset by an angle turns the azimuth back by it: d cos / d angle = -sine.
        let by_turn = -by_cosine * sine / length;
        Gain { value: inside * inside, by_azimuth: by_cosine * sine, by_east: -v * by_turn, by_north: u * by_turn }
    }

    /// c_j / d^rho and d^2 towards a sensor at `offset` from the emitter.
    #[inline]
    fn strength(&self, offset: &Point<T, DIM>, jam: &Susceptibility<T>, softening: T) -> (T, T) {
        let square = soft_square(offset, softening);
        let strength = jam.error_gain / power(square, jam.error_exponent * T::real(0.5));
        (strength.min(T::LARGE), square)
    }
}

/// The factor that jamming puts on the variance of a sensor at `place`. Source: (42), (47).
#[inline]
#[must_use]
pub fn error_factor<T: Real, const DIM: usize>(
    emitters: &[Emitter<T, DIM>],
    place: &Point<T, DIM>,
    jam: &Susceptibility<T>,
    softening: T,
) -> T {
    let mut factor = T::one();
    for emitter in emitters.iter().filter(|emitter| emitter.level != T::zero()) {
        let offset = place - emitter.position;
        let (strength, _) = emitter.strength(&offset, jam, softening);
        factor += strength * emitter.level * emitter.gain(&offset).value;
    }
    factor
}

/// Adds `coefficient` times the derivatives of [`error_factor`] to the emitters' adjoints, and returns that by
/// the position of the sensor.
///
/// An emitter at level 0 has a derivative too: that by its level.
#[inline]
pub fn pull_error_factor<T: Real, const DIM: usize>(
    emitters: &mut [Emitter<T, DIM>],
    place: &Point<T, DIM>,
    jam: &Susceptibility<T>,
    softening: T,
    coefficient: T,
) -> Point<T, DIM> {
    let mut by_place = Point::zeros();
    if jam.error_gain == T::zero() {
        return by_place;
    }
    for emitter in emitters {
        let offset = place - emitter.position;
        let (strength, square) = emitter.strength(&offset, jam, softening);
        let gain = emitter.gain(&offset);
        let scaled = coefficient * strength;
        let of_gain = scaled * emitter.level;
        let mut by_offset = offset * (-jam.error_exponent * of_gain * gain.value / square);
        for (component, slope) in by_offset.iter_mut().zip([gain.by_east, gain.by_north]) {
            *component += of_gain * slope;
        }
        emitter.adjoint.level += scaled * gain.value;
        emitter.adjoint.azimuth += of_gain * gain.by_azimuth;
        emitter.adjoint.position -= by_offset;
        by_place += by_offset;
    }
    by_place
}
