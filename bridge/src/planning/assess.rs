//! What a written plan is worth.

use quietpath_core::constraints::{Place, violations, worst_place};
use quietpath_core::objective::{Extreme, node_values, value};
use quietpath_core::{Metric, Real, Trajectory};

use crate::capacity::HostTrajectory;
use crate::file::scenario::point;
use crate::file::{FileError, PlanFile, ScenarioFile};

/// Objective, violations and series of a plan, in scenario units.
#[derive(Clone, Debug, PartialEq)]
pub struct Assessment {
    /// The objective, recomputed.
    pub objective: f64,
    /// The objective that the plan claims.
    pub claimed: Option<f64>,
    /// The largest violation of each constraint, relative to its scale, by name.
    pub violations: Vec<(&'static str, f64)>,
    /// Name and size of the largest violation.
    pub worst: (&'static str, f64),
    /// Where the largest violation is, where there is one; [`ScenarioFile::describe`] puts it into words.
    pub place: Option<Place<f64>>,
    /// Whether no violation exceeds [`quietpath_core::constraints::TOLERANCE`].
    pub feasible: bool,
    /// Node times, s, N + 1.
    pub times: Vec<f64>,
    /// One for each agent, in order.
    pub agents: Vec<AgentSeries>,
    /// Position of each sensor at each node's time, length units.
    pub sensors: Vec<Vec<Vec<f64>>>,
}

/// One agent's figures along its path.
#[derive(Clone, Debug, PartialEq)]
pub struct AgentSeries {
    /// Name of the agent.
    pub name: String,
    /// Value at each node, N + 1, of every metric that the scenario's sensors give.
    pub metrics: Vec<(Metric, Vec<f64>)>,
    /// Speed on each interval, length units per s, N.
    pub speed: Vec<f64>,
    /// Acceleration at each inner node, length units per s^2, N - 1.
    pub accel: Vec<f64>,
    /// Length of the path, length units.
    pub length: f64,
}

impl AgentSeries {
    /// The series of a metric, where the sensors give it.
    #[must_use]
    pub fn metric(&self, metric: Metric) -> Option<&[f64]> {
        self.metrics.iter().find(|(kind, _)| *kind == metric).map(|(_, series)| series.as_slice())
    }
}

/// Recomputes everything about a plan from its path and controls; `name` is what errors call the plan's file.
///
/// # Errors
/// The plan does not have the shape of the scenario: see [`PlanFile::fits`].
pub fn assess(scenario: &ScenarioFile, plan: &PlanFile, name: &str) -> Result<Assessment, Box<FileError>> {
    plan.fits(name, scenario)?;
    super::on_large_stack(|| match scenario.dimension {
        3 => assess_in::<3>(scenario, plan),
        _ => assess_in::<2>(scenario, plan),
    })
}

fn assess_in<const DIM: usize>(scenario: &ScenarioFile, plan: &PlanFile) -> Result<Assessment, Box<FileError>> {
    let problem = scenario.to_core::<f64, DIM>()?;
    let view = problem.view();
    let trajectory = trajectory::<f64, DIM>(plan).map_err(|error| scenario.explain(&error))?;
    let mut scratch = super::scratch::<DIM>();
    let found = violations(&view, &trajectory, &mut scratch);
    let place = worst_place(&view, &trajectory, &mut scratch);
    let times = plan.node_times();
    let sensor =
        |sensor| times.iter().map(|time| view.sensor_state(sensor, *time).0.iter().copied().collect()).collect();
    let sensors = view.sensors.iter().map(sensor).collect();
    let agents = (plan.agents.iter().enumerate())
        .map(|(index, agent)| {
            let values: Vec<_> =
                (0..times.len()).map(|node| node_values(&view, &trajectory, index, node, &mut scratch)).collect();
            let series = |metric: &Metric| {
                let along: Option<Vec<f64>> = values.iter().map(|at_node| at_node.get(*metric)).collect();
                along.map(|along| (*metric, along))
            };
            let (speed, accel, length) = kinematics(&agent.path, &times);
            let metrics = Metric::ALL.iter().filter_map(series).collect();
            AgentSeries { name: agent.name.clone(), metrics, speed, accel, length }
        })
        .collect();
    Ok(Assessment {
        objective: value(&view, &trajectory, Extreme::Exact, &mut scratch),
        claimed: plan.objective,
        violations: found.iter().collect(),
        worst: found.worst(),
        place,
        feasible: found.feasible(),
        times,
        agents,
        sensors,
    })
}

/// The plan as the core holds it.
pub(super) fn trajectory<T: Real, const DIM: usize>(
    plan: &PlanFile,
) -> Result<Box<HostTrajectory<T, DIM>>, quietpath_core::Error> {
    let intervals = plan.nodes().saturating_sub(1);
    let mut trajectory: Box<HostTrajectory<T, DIM>> = Box::new(Trajectory::zeros(intervals, plan.agents.len())?);
    for (slot, time) in trajectory.times.iter_mut().zip(plan.node_times()) {
        *slot = T::real(time);
    }
    for (track, agent) in trajectory.active_mut().iter_mut().zip(&plan.agents) {
        for (slot, position) in track.path.iter_mut().zip(&agent.path) {
            *slot = point(position);
        }
        let controls = [
            (&mut track.jam, &agent.jam),
            (&mut track.azimuth, &agent.azimuth),
            (&mut track.dropout, &agent.dropout),
        ];
        for (slots, values) in controls {
            for (slot, value) in slots.iter_mut().zip(values.iter().flatten()) {
                *slot = T::real(*value);
            }
        }
    }
    Ok(trajectory)
}

/// Speed on each interval, acceleration at each inner node, and the length of the path.
fn kinematics(path: &[Vec<f64>], times: &[f64]) -> (Vec<f64>, Vec<f64>, f64) {
    let norm = |vector: &[f64]| vector.iter().map(|component| component * component).sum::<f64>().sqrt();
    let minus = |a: &[f64], b: &[f64]| -> Vec<f64> { a.iter().zip(b).map(|(a, b)| a - b).collect() };
    let steps: Vec<Vec<f64>> = path.iter().zip(path.iter().skip(1)).map(|(a, b)| minus(b, a)).collect();
    let intervals: Vec<f64> = times.iter().zip(times.iter().skip(1)).map(|(a, b)| b - a).collect();
    let velocity = |(step, interval): (&Vec<f64>, &f64)| step.iter().map(|part| part / interval).collect();
    let velocities: Vec<Vec<f64>> = steps.iter().zip(&intervals).map(velocity).collect();
    let accel = (velocities.iter().zip(velocities.iter().skip(1)))
        .zip(intervals.iter().zip(intervals.iter().skip(1)))
        .map(|((before, after), (h, next))| norm(&minus(after, before)) / (0.5 * (h + next)))
        .collect();
    let speed = velocities.iter().map(|velocity| norm(velocity)).collect();
    (speed, accel, steps.iter().map(|step| norm(step)).sum())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn acceleration_is_the_change_of_velocity_over_the_mean_interval() {
        let path = [vec![0.0, 0.0], vec![1.0, 0.0], vec![1.0, 4.0]];
        let (speed, accel, length) = kinematics(&path, &[0.0, 1.0, 3.0]);
        assert_eq!((speed, length), (vec![1.0, 2.0], 5.0));
        assert_eq!(accel, [5.0_f64.sqrt() / 1.5]);
    }
}
