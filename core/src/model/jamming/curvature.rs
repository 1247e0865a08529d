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
use crate::jet::{Jet, Line};
use crate::math::Real;
use crate::model::soft_square;
use crate::scenario::Susceptibility;

/// What varies of one emitter as a sensor sees it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Emission<T, const DIM: usize, const M: usize> {
    /// Sensor less emitter.
    pub offset: Line<T, DIM, M>,
    /// Index of the level among the variables.
    pub level: Option<usize>,
    /// Index of the azimuth.
    pub azimuth: Option<usize>,
}

impl<T: Real, const DIM: usize> Emitter<T, DIM> {
    /// What this emitter adds to the factor on the variance of a sensor.
    pub(crate) fn error_jet<const M: usize>(
        &self,
        emission: &Emission<T, DIM, M>,
        jam: &Susceptibility<T>,
        softening: T,
    ) -> Jet<T, M> {
        let half = jam.error_exponent * T::real(0.5);
        let offset = &emission.offset;
        let square = offset.square(soft_square(&offset.value, softening));
        let (strength, at) = self.strength(&offset.value, jam, softening);
        let slope = -half * strength / at;
        let bend = -(half + T::one()) * slope / at;
        let received = square.chain(strength, slope, bend).times(&Jet::variable(self.level, emission.level));
        received.times(&self.gain_jet(emission))
    }

    /// Beam gain towards a sensor. Source: (46), (47).
    #[expect(clippy::needless_range_loop, reason = "rows and columns by the letters of the equations")]
    fn gain_jet<const M: usize>(&self, emission: &Emission<T, DIM, M>) -> Jet<T, M> {
        let (zero, one, two) = (T::zero(), T::one(), T::real(2.0));
        let Beam::Directed { edge, scale, east, north } = self.beam else {
            return Jet::constant(one);
        };
        let mut components = emission.offset.value.iter().copied();
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
        for (flat, column) in columns.iter_mut().zip(&emission.offset.columns) {
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
        if let Some(entry) = emission.azimuth.and_then(|index| angle.gradient.get_mut(index)) {
            *entry -= one;
        }
        let square = scale * scale;
        let slope = -two * square * inside * sine;
        let bend = two * square * (sine * sine - inside * cosine);
        angle.chain(square * inside * inside, slope, bend)
    }
}
