//! Numbers that carry their first and second derivatives.
//!
//! | symbol | name | shape |
//! |---|---|---|
//! | f | `value` | |
//! | f_a | `gradient` | `M` |
//! | f_ab | `hessian` | `M` x `M` |
//!
//! Forward differentiation of second order: a chain rule carries (f, f_a, f_ab) through g(f) as
//! (g, g' f_a, g' f_ab + g'' f_a f_b), a product rule through f g. What the derivatives are by is the caller's
//! choice. Arithmetic touches the upper triangle of `hessian` alone; [`Jet::mirrored`] completes it.
//!
//! Limits: `M` variables, all of them carried by every jet.

use crate::math::{Point, Real};

/// A number with its first and second derivatives by `M` variables.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jet<T, const M: usize> {
    /// The number.
    pub value: T,
    /// Its derivatives.
    pub gradient: [T; M],
    /// Its second derivatives.
    pub hessian: [[T; M]; M],
}

/// How a vector depends on the variables, which it is linear in: some of them are its components, and one is the time in which
/// it moves.
///
/// It is laid once a node, for all sensors: arrays that are filled by index stay in memory, and are waited for when they are read.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Axes<T, const DIM: usize, const M: usize> {
    /// Derivative by each variable, at rest.
    columns: [Point<T, DIM>; M],
    /// Second derivatives of the square, at rest; upper triangle.
    twice: [[T; M]; M],
    /// Which variable is the time, where one is.
    time: Option<[T; M]>,
}

/// First and second derivatives of a function of two numbers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surface<T> {
    pub value: T,
    pub by_first: T,
    pub by_second: T,
    pub first_twice: T,
    pub mixed: T,
    pub second_twice: T,
}

impl<T: Real, const M: usize> Jet<T, M> {
    /// A number that depends on nothing.
    #[inline]
    #[must_use]
    pub fn constant(value: T) -> Self {
        Self { value, gradient: [T::zero(); M], hessian: [[T::zero(); M]; M] }
    }

    /// The variable of that index; a constant where there is none.
    #[inline]
    #[must_use]
    pub fn variable(value: T, index: Option<usize>) -> Self {
        let mut jet = Self::constant(value);
        if let Some(entry) = index.and_then(|index| jet.gradient.get_mut(index)) {
            *entry = T::one();
        }
        jet
    }

    /// g(self), of the given value, slope and bend (first and second derivative) at `self.value`.
    #[inline]
    #[must_use]
    pub fn chain(&self, value: T, slope: T, bend: T) -> Self {
        let mut jet = Self::constant(value);
        for a in 0..M {
            jet.gradient[a] = slope * self.gradient[a];
            let bent = bend * self.gradient[a];
            for b in a..M {
                jet.hessian[a][b] = slope * self.hessian[a][b] + bent * self.gradient[b];
            }
        }
        jet
    }

    /// g(self, other).
    #[inline]
    pub(crate) fn chain_two(&self, other: &Self, surface: &Surface<T>) -> Self {
        let mut jet = Self::constant(surface.value);
        for a in 0..M {
            let (first, second) = (self.gradient[a], other.gradient[a]);
            jet.gradient[a] = surface.by_first * first + surface.by_second * second;
            let by_first = surface.first_twice * first + surface.mixed * second;
            let by_second = surface.mixed * first + surface.second_twice * second;
            for b in a..M {
                jet.hessian[a][b] = surface.by_first * self.hessian[a][b]
                    + surface.by_second * other.hessian[a][b]
                    + by_first * self.gradient[b]
                    + by_second * other.gradient[b];
            }
        }
        jet
    }

    /// `self` times `other`.
    #[inline]
    #[must_use]
    pub fn times(&self, other: &Self) -> Self {
        let mut jet = Self::constant(self.value * other.value);
        for a in 0..M {
            jet.gradient[a] = self.value * other.gradient[a] + other.value * self.gradient[a];
            for b in a..M {
                jet.hessian[a][b] = self.value * other.hessian[a][b]
                    + other.value * self.hessian[a][b]
                    + self.gradient[a] * other.gradient[b]
                    + other.gradient[a] * self.gradient[b];
            }
        }
        jet
    }

    /// `self` times a number that is linear in one variable: `other` in value, `slope` times `unit` in gradient.
    #[inline(always)]
    #[must_use]
    #[expect(clippy::needless_range_loop, reason = "rows and columns by the letters of the equations")]
    pub(crate) fn times_linear(&self, other: T, slope: T, unit: &[T; M]) -> Self {
        let mut jet = Self::constant(self.value * other);
        for a in 0..M {
            jet.gradient[a] = other * self.gradient[a] + self.value * slope * unit[a];
            let (along, across) = (slope * self.gradient[a], slope * unit[a]);
            for b in a..M {
                jet.hessian[a][b] = other * self.hessian[a][b] + along * unit[b] + across * self.gradient[b];
            }
        }
        jet
    }

    /// `self` times a constant, plus another.
    #[inline]
    #[must_use]
    pub fn affine(&self, factor: T, shift: T) -> Self {
        let mut jet = self.chain(factor * self.value + shift, factor, T::zero());
        // The bend of zero must not meet an infinity.
        for a in 0..M {
            for b in a..M {
                jet.hessian[a][b] = factor * self.hessian[a][b];
            }
        }
        jet
    }

    /// Adds `factor` times `other`.
    #[inline]
    pub fn add(&mut self, other: &Self, factor: T) {
        self.value += factor * other.value;
        for a in 0..M {
            self.gradient[a] += factor * other.gradient[a];
            for b in a..M {
                self.hessian[a][b] += factor * other.hessian[a][b];
            }
        }
    }

    /// Adds `factor` times the outer product of `slopes` with itself to the second derivatives.
    #[inline]
    #[expect(clippy::needless_range_loop, reason = "rows and columns by the letters of the equations")]
    pub fn add_square(&mut self, slopes: &[T; M], factor: T) {
        for a in 0..M {
            let scaled = factor * slopes[a];
            for b in a..M {
                self.hessian[a][b] += scaled * slopes[b];
            }
        }
    }

    /// The same with the lower triangle of `hessian` equal to the upper one.
    #[inline]
    #[must_use]
    pub fn mirrored(mut self) -> Self {
        for a in 0..M {
            for b in 0..a {
                self.hessian[a][b] = self.hessian[b][a];
            }
        }
        self
    }
}

/// 1 at `index`, 0 elsewhere.
#[inline(always)]
pub(crate) fn unit<T: Real, const M: usize>(index: Option<usize>) -> [T; M] {
    core::array::from_fn(|a| if index == Some(a) { T::one() } else { T::zero() })
}

impl<T: Real, const DIM: usize, const M: usize> Axes<T, DIM, M> {
    /// The components are `sign` times the variables from `first` on; the time is variable number `time`.
    #[inline(always)]
    pub(crate) fn new(first: Option<usize>, sign: T, time: Option<usize>) -> Self {
        let column = |a: usize| {
            Point::from_fn(|k, _| if first.is_some_and(|first| a == first + k) { sign } else { T::zero() })
        };
        let columns: [Point<T, DIM>; M] = core::array::from_fn(column);
        let mut twice = [[T::zero(); M]; M];
        for a in 0..M {
            twice[a][a] = T::real(2.0) * columns[a].dot(&columns[a]);
        }
        Self { columns, twice, time: time.filter(|&time| time < M).map(|time| unit(Some(time))) }
    }

    /// Derivative by each variable, at a `velocity`.
    #[inline(always)]
    pub(crate) fn columns(&self, velocity: &Point<T, DIM>) -> [Point<T, DIM>; M] {
        let mut columns = self.columns;
        if let Some(time) = self.moving(velocity) {
            for a in 0..M {
                columns[a] += velocity * time[a];
            }
        }
        columns
    }

    /// Sum of the squares of the components of `vector`; `value` is that sum, softening included.
    #[inline(always)]
    pub(crate) fn square(&self, vector: &Point<T, DIM>, velocity: &Point<T, DIM>, value: T) -> Jet<T, M> {
        let two = T::real(2.0);
        let mut jet = Jet { value, gradient: [T::zero(); M], hessian: self.twice };
        for a in 0..M {
            jet.gradient[a] = two * self.columns[a].dot(vector);
        }
        if let Some(time) = self.moving(velocity) {
            let (approach, bend) = (two * velocity.dot(vector), two * velocity.dot(velocity));
            for a in 0..M {
                jet.gradient[a] += approach * time[a];
                let along = two * self.columns[a].dot(velocity);
                for b in a..M {
                    let across = two * self.columns[b].dot(velocity);
                    jet.hessian[a][b] += along * time[b] + across * time[a] + bend * time[a] * time[b];
                }
            }
        }
        jet
    }

    /// Which variable is the time, where that moves the vector.
    #[inline(always)]
    fn moving(&self, velocity: &Point<T, DIM>) -> Option<&[T; M]> {
        self.time.as_ref().filter(|_| velocity.iter().any(|component| *component != T::zero()))
    }
}
