//! Bounds and budgets of jamming and dropout.
//!
//! 0 <= z_i <= 1 at every node, and sum over i = 1 .. N of h_i z_i <= budget, s; theta_i likewise.
//!
//! Source: (49), (55).

use crate::constraints::Worst;
use crate::math::Real;

/// Farthest that a control lies outside 0 to 1.
pub fn bounds_excess<T: Real>(control: &[T]) -> Worst<T> {
    let mut worst = Worst::none();
    for (node, &entry) in control.iter().enumerate() {
        worst.raise(node, -entry);
        worst.raise(node, entry - T::one());
    }
    worst
}

/// Integral of a control over its budget (s), relative to the budget or 1 s, whichever is more; 0 where it is not
/// exceeded.
pub fn excess<T: Real>(budget: T, times: &[T], control: &[T]) -> Worst<T> {
    let mut worst = Worst::none();
    worst.raise(control.len().saturating_sub(1), (integral(times, control) - budget) / budget.max(T::one()));
    worst
}

/// Sum over i = 1 .. N of h_i times the control, s.
pub fn integral<T: Real>(times: &[T], control: &[T]) -> T {
    let mut sum = T::zero();
    for ((&from, &to), &entry) in times.iter().zip(times.iter().skip(1)).zip(control.iter().skip(1)) {
        sum += (to - from) * entry;
    }
    sum
}
