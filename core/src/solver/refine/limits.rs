//! The barriers of limits, as what is made of the metrics of a node.

use crate::math::Real;
use crate::metrics::{Needs, Values};
use crate::objective::curvature::{Slope, Slopes, Weigh};
use crate::objective::merit::slacks;
use crate::scenario::View;

/// Barriers of the limits: psi = -ln g, without mu.
pub(super) struct Limits<'a, T, const DIM: usize> {
    pub(super) scenario: &'a View<'a, T, DIM>,
}

impl<T: Real, const DIM: usize> Weigh<T> for Limits<'_, T, DIM> {
    fn needs(&self, _: usize) -> Needs {
        let mut needs = Needs::default();
        self.scenario.limits.iter().for_each(|limit| needs.add(limit.metric));
        needs
    }

    fn add_slopes(&self, _: usize, values: &Values<T>, slopes: &mut Slopes<T>) {
        for limit in self.scenario.limits {
            let Some(value) = values.get(limit.metric) else { continue };
            let (mut first, mut second) = (T::zero(), T::zero());
            for (slack, by_value) in slacks(limit, value).into_iter().flatten() {
                let push = T::one() / slack;
                first -= push * by_value;
                second += push / slack * by_value * by_value;
            }
            let _ = slopes.push(Slope { metric: limit.metric, first, second });
        }
    }
}
