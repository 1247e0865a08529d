//! The sums over all parts at one tilt, with what the rank one adds.
//!
//! | symbol | meaning |
//! |---|---|
//! | h, m | 1 + v a, a / h |
//! | S1, S2 | sum c/h, sum c/h^2 |
//! | T2, T3 | sum ca/h^2, sum ca/h^3 |
//! | R3, R4 | sum ca^2/h^3, sum ca^2/h^4 |
//! | Q4 | sum ca^3/h^4 |
//! | k, G | 1 / (1 + v S1), k - 1 |
//!
//! A = sum N m^2 f2 + N k (k S1^2 f2(G) + T2), B = sum N m^2/2 + N (S2^2 k^2/2 + T3 k),
//! E = sum N m^3 f3 + N (S1^3 k^3 f3(G) + R3 k + S1 T2 k^2 - v T2^2 k^2 / 2), and k'(s) = sum N m + N S2 k.
//!
//! Derivatives by v: S1' = -T2, S2' = -2 T3, T2' = -2 R3, T3' = -3 R4, R3' = -3 Q4, k' = -S2 k^2, A' = -2 E, and of the
//! remainders (m^2 f2)' = -2 m^3 f3, (m^3 f3)' = -3 m^4 f4.

use super::Part;
use super::remainders::Remainders;
use crate::math::Real;

/// First and second derivative of the cumulant generating function; `None` beyond its pole.
///
/// Returns k'(s) and minus its derivative by v.
#[inline]
pub(super) fn slope<T: Real>(parts: impl Iterator<Item = Part<T>>, degrees: T, tilt: T) -> Option<(T, T)> {
    let (zero, one) = (T::zero(), T::one());
    let (mut first, mut second) = (zero, zero);
    let (mut s1, mut s2, mut t3) = (zero, zero, zero);
    for part in parts {
        let h = one + tilt * part.weight;
        if h <= zero {
            return None;
        }
        let inverse = one / h;
        let count = T::real(f64::from(part.degrees));
        let m = part.weight * inverse;
        first += count * m;
        second += count * m * m;
        let share = part.coupling * inverse;
        s1 += share;
        s2 += share * inverse;
        t3 += share * inverse * m;
    }
    let pole = one + tilt * s1;
    if pole <= zero {
        return None;
    }
    let k = one / pole;
    let both = s2 * k;
    Some((first + degrees * both, second + degrees * (T::real(2.0) * t3 * k + both * both)))
}

/// All sums at the saddlepoint.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Sums<T> {
    /// N of the coupled parts.
    pub degrees: T,
    pub tilt: T,
    pub k: T,
    pub s1: T,
    pub s2: T,
    pub t2: T,
    pub t3: T,
    pub r3: T,
    pub a: T,
    pub b: T,
    pub e: T,
    /// Derivatives of B and E by v; that of A is -2 E.
    pub b_slope: T,
    pub e_slope: T,
}

impl<T: Real> Sums<T> {
    pub(super) fn at(parts: impl Iterator<Item = Part<T>>, degrees: T, tilt: T) -> Self {
        let one = T::one();
        let mut sums = Self { degrees, tilt, k: one, ..Self::default() };
        let (mut r4, mut q4) = (T::zero(), T::zero());
        for part in parts {
            let inverse = one / (one + tilt * part.weight);
            let m = part.weight * inverse;
            sums.add(T::real(f64::from(part.degrees)), m);
            let share = part.coupling * inverse;
            let (second, third) = (share * inverse, share * m);
            sums.s1 += share;
            sums.s2 += second;
            sums.t2 += third;
            sums.t3 += second * m;
            sums.r3 += third * m;
            r4 += second * m * m;
            q4 += third * m * m;
        }
        if sums.s1 > T::zero() {
            sums.add_rank_one(r4, q4);
        }
        sums
    }

    /// One chi-square variable with `degrees` degrees and weight 1, tilted to m = `ratio`, u = `ratio` - 1 = `excess`.
    pub(super) fn single(degrees: T, ratio: T, excess: T) -> Self {
        let mut sums = Self::default();
        sums.add_with(degrees, ratio, &Remainders::of(excess));
        sums
    }

    #[inline]
    fn add(&mut self, count: T, m: T) {
        let remainders = Remainders::of(-self.tilt * m);
        self.add_with(count, m, &remainders);
    }

    #[inline]
    fn add_with(&mut self, count: T, m: T, remainders: &Remainders<T>) {
        let second = count * m * m;
        let third = second * m;
        self.a += second * remainders.f2;
        self.b += T::real(0.5) * second;
        self.e += third * remainders.f3;
        self.b_slope -= third;
        self.e_slope -= T::real(3.0) * third * m * remainders.f4;
    }

    fn add_rank_one(&mut self, r4: T, q4: T) {
        let (one, two, three, half) = (T::one(), T::real(2.0), T::real(3.0), T::real(0.5));
        let Self { degrees, tilt, s1, s2, t2, t3, r3, .. } = *self;
        let k = one / (one + tilt * s1);
        let k_slope = -s2 * k * k;
        let remainders = Remainders::of(-tilt * s1 * k);
        let cube = s1 * s1 * s1 * k * k;
        self.k = k;
        self.a += degrees * k * (k * s1 * s1 * remainders.f2 + t2);
        self.b += degrees * (half * s2 * s2 * k * k + t3 * k);
        self.e += degrees * k * (cube * remainders.f3 + r3 + k * (s1 * t2 - half * tilt * t2 * t2));
        self.b_slope += degrees * (-two * s2 * t3 * k * k + s2 * s2 * k * k_slope - three * r4 * k + t3 * k_slope);
        self.e_slope += degrees
            * (three * k_slope * cube * remainders.f4
                - three * t2 * s1 * s1 * k * k * k * remainders.f3
                - three * q4 * k
                + r3 * k_slope
                - t2 * t2 * k * k
                - two * s1 * r3 * k * k
                + two * s1 * t2 * k * k_slope
                - half * t2 * t2 * k * k
                + two * tilt * t2 * r3 * k * k
                - tilt * t2 * t2 * k * k_slope);
    }

    /// 1/w - 1/r and its derivatives by A, B, E.
    #[inline]
    pub(super) fn gap(&self) -> Gap<T> {
        let half = T::real(0.5);
        let (root_a, root_b) = (self.a.sqrt(), self.b.sqrt());
        let both = T::one() / (root_a + root_b);
        let by_e = -both / (root_a * root_b);
        let value = self.e * by_e;
        let by_a = -half * value * (T::one() / root_a + both) / root_a;
        let by_b = -half * value * (T::one() / root_b + both) / root_b;
        let by_tilt = -T::real(2.0) * self.e * by_a + self.b_slope * by_b + self.e_slope * by_e;
        Gap { root_a, root_b, value, by_a, by_b, by_e, by_tilt }
    }
}

/// The regular part of 1/w.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Gap<T> {
    pub root_a: T,
    pub root_b: T,
    pub value: T,
    pub by_a: T,
    pub by_b: T,
    pub by_e: T,
    /// Along the tilt, A, B and E moving with it.
    pub by_tilt: T,
}
