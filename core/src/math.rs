//! The only door to floating-point functions.
//!
//! Everything above the four operations goes through `libm`, on the host too: `libm` gives the same
//! bits on x86-64 and Cortex-M, the platform's own library does not, and a plan in `f32` must be
//! bit for bit the same on both.
//!
//! Limits: `f32` and `f64` only; no SIMD types.

use core::fmt::{Debug, Display};
use core::ops::Neg;

use nalgebra::{ArrayStorage, SVector, Scalar};
use num_traits::{ConstZero, NumAssign};

/// A position, velocity or direction: `DIM` components, east, north and, in three dimensions, up.
pub type Point<T, const DIM: usize> = SVector<T, DIM>;

/// The origin, as a constant: what memory is filled with that costs nothing in an image.
#[must_use]
pub const fn origin<T: Real, const DIM: usize>() -> Point<T, DIM> {
    Point::from_array_storage(ArrayStorage([[T::ZERO; DIM]]))
}

/// A floating-point number that the planner can be compiled for: `f32` or `f64`.
///
/// Methods have the meaning of their `libm` namesakes.
pub trait Real:
    Scalar + Copy + Debug + Display + Default + PartialOrd + NumAssign + ConstZero + Neg<Output = Self> + Send + Sync
{
    /// Distance from 1 to the next larger number.
    const EPSILON: Self;
    /// Smallest positive normal number.
    const MIN_POSITIVE: Self;
    /// Largest finite number.
    const MAX: Self;
    /// About the square root of `MAX`: figures held below it have finite products.
    const LARGE: Self;
    /// Positive infinity.
    const INFINITY: Self;
    /// Archimedes' constant.
    const PI: Self;

    /// The nearest number to `value`.
    fn real(value: f64) -> Self;
    /// A constant in this precision, out of its two spellings.
    ///
    /// Indexing a table of both costs no conversion at run time, which `real` would on a target without a
    /// double precision unit.
    fn spelled(single: f32, double: f64) -> Self;
    /// `self` in double precision, exactly.
    fn to_f64(self) -> f64;
    /// The nearest number in single precision.
    fn to_f32(self) -> f32;
    /// `value`, exactly.
    fn of_f32(value: f32) -> Self;
    /// The nearest number to `count`.
    fn from_count(count: usize) -> Self;
    /// Neither infinite nor NaN.
    fn finite(self) -> bool;
    /// NaN.
    fn is_not_a_number(self) -> bool;
    /// Square root.
    fn sqrt(self) -> Self;
    /// e to the power of `self`.
    fn exp(self) -> Self;
    /// e to the power of `self`, less 1.
    fn exp_m1(self) -> Self;
    /// Natural logarithm.
    fn ln(self) -> Self;
    /// Natural logarithm of 1 + `self`.
    fn ln_1p(self) -> Self;
    /// `self` to the power of `exponent`.
    fn powf(self, exponent: Self) -> Self;
    /// Sine and cosine of `self` radians.
    fn sin_cos(self) -> (Self, Self);
    /// Angle of the vector (`other`, `self`) from the first axis, radians.
    fn atan2(self, other: Self) -> Self;
    /// Complementary error function.
    fn erfc(self) -> Self;
    /// Magnitude.
    fn abs(self) -> Self;
    /// Largest integer not above `self`.
    fn floor(self) -> Self;

    /// The smaller of two numbers; the other one where one is NaN.
    #[inline]
    fn min(self, other: Self) -> Self {
        if other < self || self.is_not_a_number() { other } else { self }
    }

    /// The larger of two numbers; the other one where one is NaN.
    #[inline]
    fn max(self, other: Self) -> Self {
        if other > self || self.is_not_a_number() { other } else { self }
    }

    /// `self` held between `low` and `high`.
    #[inline]
    fn clamp_to(self, low: Self, high: Self) -> Self {
        self.max(low).min(high)
    }

    /// `self` times itself.
    #[inline]
    fn squared(self) -> Self {
        self * self
    }
}

macro_rules! real {
    ($type:ident, $large:literal, $single:ident, $double:ident, $spelling:expr, $sqrt:ident, $exp:ident,
     $expm1:ident, $log:ident, $log1p:ident, $pow:ident,
     $sincos:ident, $atan2:ident, $erfc:ident, $fabs:ident, $floor:ident) => {
        impl Real for $type {
            const EPSILON: Self = $type::EPSILON;
            const MIN_POSITIVE: Self = $type::MIN_POSITIVE;
            const MAX: Self = $type::MAX;
            const LARGE: Self = $large;
            const INFINITY: Self = $type::INFINITY;
            const PI: Self = core::$type::consts::PI;

            #[inline]
            fn real(value: f64) -> Self {
                value as $type
            }
            #[inline]
            fn spelled($single: f32, $double: f64) -> Self {
                $spelling
            }
            #[inline]
            fn to_f64(self) -> f64 {
                f64::from(self)
            }
            #[inline]
            fn to_f32(self) -> f32 {
                self as f32
            }
            #[inline]
            fn of_f32(value: f32) -> Self {
                $type::from(value)
            }
            #[inline]
            fn from_count(count: usize) -> Self {
                count as $type
            }
            #[inline]
            fn finite(self) -> bool {
                self.is_finite()
            }
            #[inline]
            fn is_not_a_number(self) -> bool {
                self.is_nan()
            }
            #[inline]
            fn sqrt(self) -> Self {
                libm::$sqrt(self)
            }
            #[inline]
            fn exp(self) -> Self {
                libm::$exp(self)
            }
            #[inline]
            fn exp_m1(self) -> Self {
                libm::$expm1(self)
            }
            #[inline]
            fn ln(self) -> Self {
                libm::$log(self)
            }
            #[inline]
            fn ln_1p(self) -> Self {
                libm::$log1p(self)
            }
            #[inline]
            fn powf(self, exponent: Self) -> Self {
                libm::$pow(self, exponent)
            }
            #[inline]
            fn sin_cos(self) -> (Self, Self) {
                libm::$sincos(self)
            }
            #[inline]
            fn atan2(self, other: Self) -> Self {
                libm::$atan2(self, other)
            }
            #[inline]
            fn erfc(self) -> Self {
                libm::$erfc(self)
            }
            #[inline]
            fn abs(self) -> Self {
                libm::$fabs(self)
            }
            #[inline]
            fn floor(self) -> Self {
                libm::$floor(self)
            }
        }
    };
}

real!(
    f32, 1e19, single, _double, single, sqrtf, expf, expm1f, logf, log1pf, powf, sincosf, atan2f, erfcf, fabsf,
    floorf
);
real!(f64, 1e154, _single, double, double, sqrt, exp, expm1, log, log1p, pow, sincos, atan2, erfc, fabs, floor);

/// Sum of the squares of the components.
#[inline]
#[must_use]
pub fn norm_squared<T: Real, const DIM: usize>(vector: &Point<T, DIM>) -> T {
    let mut sum = T::zero();
    for &component in vector.iter() {
        sum += component * component;
    }
    sum
}

/// Euclidean length.
#[inline]
#[must_use]
pub fn norm<T: Real, const DIM: usize>(vector: &Point<T, DIM>) -> T {
    norm_squared(vector).sqrt()
}

/// `sqrt(|x - y|^2 + softening^2)`, the distance that every metric uses.
///
/// Softening keeps metrics finite and differentiable at a sensor.
#[inline]
#[must_use]
pub fn soft_distance<T: Real, const DIM: usize>(x: &Point<T, DIM>, y: &Point<T, DIM>, softening: T) -> T {
    (norm_squared(&(x - y)) + softening * softening).sqrt()
}

/// `base^exponent`, with `pow` called only where the exponent is not one of the usual ones.
///
/// Path-loss exponents are 1, 2, 4 or a half of such a number in most scenarios, and `pow` is by far the
/// most expensive operation of the model. The model works from squares of distances, so that the usual ones
/// arrive here halved.
#[inline]
#[must_use]
pub fn power<T: Real>(base: T, exponent: T) -> T {
    let magnitude = exponent.abs();
    let is = |value: f64| magnitude == T::real(value);
    let power = if is(1.0) {
        base
    } else if is(2.0) {
        base * base
    } else if is(0.5) {
        base.sqrt()
    } else if is(0.0) {
        T::one()
    } else if is(3.0) {
        base * base * base
    } else if is(1.5) {
        base * base.sqrt()
    } else if is(4.0) {
        base.squared().squared()
    } else if is(0.25) {
        base.sqrt().sqrt()
    } else if is(2.5) {
        base.squared() * base.sqrt()
    } else {
        return base.powf(exponent);
    };
    if exponent < T::zero() { T::one() / power } else { power }
}
/// Enters a value into a list that holds those of least rank in order; where it is full, the one of greatest rank goes.
pub(crate) fn keep_least<T: Real, V, const N: usize>(list: &mut heapless::Vec<V, N>, new: V, rank: impl Fn(&V) -> T) {
    if list.is_full() && list.last().is_some_and(|last| rank(&new) < rank(last)) {
        list.pop();
    }
    // What ranks above all of a full list has no place.
    let _ = list.push(new);
    let mut after: Option<&mut V> = None;
    for here in list.iter_mut().rev() {
        if let Some(after) = after.filter(|after| rank(after) < rank(here)) {
            core::mem::swap(after, here);
        }
        after = Some(here);
    }
}
