//! Second derivatives of what jamming does to a sensor's distance estimator.
//!
//! | symbol | name | unit |
//! |---|---|---|
//! | o | `offset` sensor - emitter | length unit |
//! | phi | angle of o, less the azimuth | rad |
//! | s = z g(phi) S(`abs(o)^2`) | one emitter's part of the factor, less 1 | |
//!
//! d phi / d(u, v) = (-v, u) / l^2 over the horizontal components u, v of the offset, l its length; the second
//! derivatives are 2uv / l^4, (v^2 - u^2) / l^4 and -2uv / l^4. Everything else is the chain rule.
//!
//! Source: (42), (46), (47). Limits: as the parent's; the edge of a beam has the second derivatives of its inside.

use super::{Beam, Emitter};
use crate::jet::{Axes, Jet};
use crate::math::{Point, Real};
use crate::scenario::Susceptibility;

/// What varies of one emitter as a sensor sees it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Emission<T, const DIM: usize, const M: usize> {
    /// Of sensor less emitter.
    pub axes: Axes<T, DIM, M>,
    /// Which variable is the level: 1 there.
    pub level: [T; M],
    /// Which is the azimuth.
    pub azimuth: [T; M],
}

impl<T: Real, const DIM: usize> Emitter<T, DIM> {
    /// What this emitter adds to the factor on the variance of a sensor at `offset` from it, which moves at `velocity`.
    pub(crate) fn error_jet<const M: usize>(
        &self,
        emission: &Emission<T, DIM, M>,
        (offset, velocity): (&Point<T, DIM>, &Point<T, DIM>),
        jam: &Susceptibility<T>,
        softening: T,
    ) -> Jet<T, M> {
        let half = jam.error_exponent * T::real(0.5);
        let (strength, at) = self.strength(offset, jam, softening);
        let square = emission.axes.square(offset, velocity, at);
        let slope = -half * strength / at;
        let bend = -(half + T::one()) * slope / at;
        let received = square.chain(strength, slope, bend).times_linear(self.level, T::one(), &emission.level);
        if self.beam == Beam::Isotropic {
            received
        } else {
            received.times(&self.gain_jet(emission, offset, velocity))
        }
    }

    /// Beam gain towards a sensor. Source: (46), (47).
    #[expect(clippy::needless_range_loop, reason = "rows and columns by the letters of the equations")]
    fn gain_jet<const M: usize>(
        &self,
        emission: &Emission<T, DIM, M>,
        offset: &Point<T, DIM>,
        velocity: &Point<T, DIM>,
    ) -> Jet<T, M> {
        let (zero, one, two) = (T::zero(), T::one(), T::real(2.0));
        let Beam::Directed { edge, scale, east, north } = self.beam else {
            return Jet::constant(one);
        };
        let mut components = offset.iter().copied();
        let (u, v) = (components.next().unwrap_or_default(), components.next().unwrap_or_default());
        let length = (u * u + v * v).sqrt();
        if length == zero {
            return Jet::constant(((one - edge) * scale).squared());
        }
        let (u, v) = (u / length, v / length);
        let (cosine, sine) = (east * u + north * v, east * v - north * u);
        let inside = (cosine - edge).max(zero);
        if inside == zero {
            return Jet::constant(zero);
        }
        // The angle, by azimuth and offset.
        let mut angle = Jet::constant(zero);
        let mut columns = [(zero, zero); M];
        for (flat, column) in columns.iter_mut().zip(&emission.axes.columns(velocity)) {
            let mut components = column.iter().copied();
            let (du, dv) = (components.next().unwrap_or_default(), components.next().unwrap_or_default());
            *flat = (du / length, dv / length);
        }
        for a in 0..M {
            let (du, dv) = columns[a];
            angle.gradient[a] = u * dv - v * du;
            let along_u = two * u * v * du + (v * v - u * u) * dv;
            let along_v = (v * v - u * u) * du - two * u * v * dv;
            for b in a..M {
                angle.hessian[a][b] = along_u * columns[b].0 + along_v * columns[b].1;
            }
        }
        for a in 0..M {
            angle.gradient[a] -= emission.azimuth[a];
        }
        let square = scale * scale;
        let slope = -two * square * inside * sine;
        let bend = two * square * (sine * sine - inside * cosine);
        angle.chain(square * inside * inside, slope, bend)
    }
}
