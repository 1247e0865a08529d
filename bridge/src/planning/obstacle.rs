//! What stands in the way of a feasible plan, whatever the dimension and precision.

use quietpath_core::Real;
use quietpath_core::constraints::Constraint;
use quietpath_core::scenario::{Limit, Side};
use quietpath_core::solver::{self, Extent};

use crate::file::ScenarioFile;

/// Why there is no feasible plan: see [`quietpath_core::solver::Obstacle`].
#[derive(Clone, Debug, PartialEq)]
pub struct Obstacle {
    /// The constraint.
    pub constraint: Constraint,
    /// Which of the regions or limits, by index; for a separation the other agent.
    pub index: Option<usize>,
    /// The agent, by index.
    pub agent: usize,
    /// Where the agent is stopped, length units.
    pub position: Vec<f64>,
    /// When it would be there, s.
    pub time: f64,
    /// The best path that was found, or every way.
    pub extent: Extent,
}

impl<T: Real, const DIM: usize> From<&solver::Obstacle<T, DIM>> for Obstacle {
    fn from(found: &solver::Obstacle<T, DIM>) -> Self {
        let solver::Obstacle { constraint, index, agent, extent, .. } = *found;
        let position = found.position.iter().map(|part| part.to_f64()).collect();
        Self { constraint, index, agent, position, time: found.time.to_f64(), extent }
    }
}

impl Obstacle {
    /// What stands in the way, in the names of the file: `region[0] (keep-out) closes every way of uav1 that was searched:
    /// entered near [1.2, 3.4] at 35 s`.
    #[must_use]
    pub fn describe(&self, scenario: &ScenarioFile) -> String {
        let agent = scenario.agent_name(self.agent);
        let (place, at) = (self.place(scenario), figures(self.time, 0.01));
        let (closes, yet) = match self.extent {
            Extent::EveryWay => {
                (format!("closes every way of {agent} that was searched: it is"), "on every way that was searched")
            }
            Extent::BestPath => {
                (format!("stops {agent}: on the best path that was found it is"), "on the best path that was found")
            }
        };
        match (self.constraint, self.index) {
            (Constraint::Duration, _) => {
                format!("{agent} cannot reach its goal by `time.max` {yet}")
            }
            (Constraint::Region, Some(index)) => {
                let inside = scenario.regions.get(index).is_some_and(|region| region.side == Side::Inside);
                let verb = if inside { "left" } else { "entered" };
                format!("{} {closes} {verb} near {place} at {at} s", scenario.region(index))
            }
            (Constraint::Limit, Some(index)) => {
                let bounds = scenario.limits.get(index).map_or_else(String::new, bounds);
                format!("limit[{index}] ({bounds}) {closes} broken near {place} at {at} s")
            }
            (Constraint::Separation, Some(other)) => {
                let other = scenario.agent_name(other);
                format!("{agent} and {other} come closer than `separation` {yet}: near {place} at {at} s")
            }
            (constraint, _) => format!("{} is broken by {agent} {yet}: near {place} at {at} s", constraint.name()),
        }
    }

    /// What may help.
    #[must_use]
    pub const fn remedy(&self) -> &'static str {
        match self.constraint {
            Constraint::Region => {
                "a smaller region, one that applies for a while only (`from`, `until`), a wider `domain` or a later `time.max` may open a way"
            }
            Constraint::Limit => "a looser limit, a wider `domain` or a later `time.max` may open a way",
            Constraint::Separation => "a smaller `separation`, other starts or goals, or a later `time.max` may do",
            _ => "a later `time.max` or a faster agent may do",
        }
    }

    /// `[1.2, 3.4]`, to a thousandth of the domain.
    fn place(&self, scenario: &ScenarioFile) -> String {
        let sides = scenario.domain.min.iter().zip(&scenario.domain.max).map(|(low, high)| high - low);
        let step = sides.fold(0.0, f64::max) * 1e-3;
        let parts: Vec<_> = self.position.iter().map(|part| figures(*part, step)).collect();
        format!("[{}]", parts.join(", "))
    }
}

/// `detection <= 0.2`.
fn bounds(limit: &Limit<f64>) -> String {
    let name = limit.metric.name();
    match (limit.min, limit.max) {
        (Some(min), Some(max)) => format!("{min} <= {name} <= {max}"),
        (Some(min), None) => format!("{name} >= {min}"),
        (None, Some(max)) => format!("{name} <= {max}"),
        (None, None) => name.to_owned(),
    }
}

/// A number with the decimals that a step of this size has a use for, without trailing zeros.
fn figures(value: f64, step: f64) -> String {
    let decimals = (-step.log10()).ceil().clamp(0.0, 9.0);
    let scale = 10_f64.powf(decimals);
    ((value * scale).round() / scale).to_string()
}
