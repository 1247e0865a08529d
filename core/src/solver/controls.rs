//! Jamming levels, jamming directions and power reductions as parts of the iterate.
//!
//! | symbol | name | unit | shape |
//! |---|---|---|---|
//! | z_i, alpha_i, theta_i | `Jam`, `Azimuth`, `Dropout` | 0 .. 1, rad, 0 .. 1 | N an agent, nodes 1 .. N |
//!
//! A level lies between 0 and 1, and its sum over the nodes times the interval within a budget, (49), (55). With
//! the interval h / r that is sum z_i <= r `allowance`: convex in levels and pace together. Projection on box and
//! budget is one root of a monotone function, found by safeguarded Newton steps.
//!
//! Limits: [`ROOT_STEPS`] bounds the steps of the root.

use crate::math::Real;

/// Kinds of controls an agent may have.
pub(super) const KINDS: usize = 3;

/// Which control; the order of storage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Jam,
    Azimuth,
    Dropout,
}

impl Kind {
    pub(super) const ALL: [Self; KINDS] = [Self::Jam, Self::Azimuth, Self::Dropout];
}

/// What a control may do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Bound<T> {
    /// The agent has no such equipment: always 0.
    Off,
    /// Any value: a direction.
    Free,
    /// 0 to 1, with a sum over the nodes of at most `allowance` times the pace.
    Level { allowance: T },
}

/// Largest number of steps to the root of a budget.
const ROOT_STEPS: usize = 60;

/// A budget's copy of the pace, and its scaled multiplier.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PaceCopy<T> {
    pub(super) inside: T,
    pub(super) multiplier: T,
}

/// Weights and bound of a budget projection.
#[derive(Clone, Copy, Debug)]
pub(super) struct Budget<T> {
    /// Sum of levels allowed at pace 1.
    pub(super) allowance: T,
    /// Weight of the squared change of the pace, over that of a level.
    pub(super) pace_weight: T,
}

impl<T: Real> Budget<T> {
    /// Moves `levels` to the nearest ones within 0 .. 1 and the budget of a pace that may move too; returns that
    /// pace.
    ///
    /// With the multiplier mu of the budget the levels are clip(z_i - mu) and the pace is
    /// `pace` + mu `allowance` / `pace_weight`; mu is 0, or the root of sum - `allowance` pace, which falls with mu.
    pub(super) fn project(&self, levels: &mut [T], pace: T) -> T {
        let (zero, one) = (T::zero(), T::one());
        let give = self.allowance / self.pace_weight;
        let excess = |mu: T, levels: &[T]| {
            let (mut sum, mut moving) = (zero, zero);
            for &level in levels {
                let moved = level - mu;
                sum += moved.clamp_to(zero, one);
                if moved > zero && moved < one {
                    moving += one;
                }
            }
            (sum - self.allowance * (pace + mu * give), -moving - self.allowance * give)
        };
        let mut mu = zero;
        let (mut value, mut slope) = excess(mu, levels);
        if value > zero {
            let mut low = zero;
            let mut high = levels.iter().copied().fold(zero, T::max).max(-pace / give.max(T::MIN_POSITIVE));
            for _ in 0..ROOT_STEPS {
                if value > zero {
                    low = mu;
                } else {
                    high = mu;
                }
                let newton = mu - value / slope;
                let next = if newton > low && newton < high { newton } else { (low + high) * T::real(0.5) };
                if next == mu {
                    break;
                }
                mu = next;
                (value, slope) = excess(mu, levels);
                if value == zero {
                    break;
                }
            }
        }
        for level in levels.iter_mut() {
            *level = (*level - mu).clamp_to(zero, one);
        }
        pace + mu * give
    }
}

/// Shortens levels in proportion where their sum exceeds `sum_max`, so that the budget holds exactly.
pub(super) fn trim<T: Real>(levels: &mut [T], sum_max: T) {
    let sum = levels.iter().fold(T::zero(), |sum, &level| sum + level);
    if sum > sum_max {
        // A rounding unit less, so that the sum of the shortened levels does not round above the bound.
        let share = sum_max.max(T::zero()) / sum * (T::one() - T::EPSILON * T::from_count(levels.len()));
        levels.iter_mut().for_each(|level| *level *= share);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Karush-Kuhn-Tucker conditions, looked at from outside.
    #[test]
    fn meets_the_budget_with_one_multiplier() {
        let targets = [0.2, 1.7, 0.9, -0.3, 0.55, 0.8, 0.1];
        let budget = Budget { allowance: 2.0, pace_weight: 5.0 };
        let mut levels = targets;
        let pace = budget.project(&mut levels, 0.9);
        let sum: f64 = levels.iter().sum();
        assert!((sum - 2.0 * pace).abs() < 1e-12, "{sum} of {}", 2.0 * pace);
        let mu = (pace - 0.9) * 5.0 / 2.0;
        assert!(mu > 0.0);
        for (level, target) in levels.iter().zip(targets) {
            assert!((level - (target - mu).clamp(0.0, 1.0)).abs() < 1e-12);
        }
    }

    #[test]
    fn leaves_what_is_within_the_budget() {
        let budget = Budget { allowance: 9.0, pace_weight: 1.0 };
        let mut levels = [0.5, 1.5, -0.5];
        assert_eq!(budget.project(&mut levels, 1.0), 1.0);
        assert_eq!(levels, [0.5, 1.0, 0.0]);
    }

    #[test]
    fn nothing_is_allowed_without_a_budget() {
        let budget = Budget { allowance: 0.0, pace_weight: 1.0 };
        let mut levels = [0.5, 1.5, 0.1];
        assert_eq!(budget.project(&mut levels, 1.0), 1.0);
        assert!(levels.iter().all(|&level: &f64| level.abs() < 1e-12), "{levels:?}");
    }

    #[test]
    fn trimmed_levels_sum_to_the_bound() {
        let mut levels = [0.3_f64, 0.9, 0.4];
        trim(&mut levels, 1.2);
        let sum: f64 = levels.iter().sum();
        assert!(sum <= 1.2 && sum > 1.2 - 1e-12);
    }
}
