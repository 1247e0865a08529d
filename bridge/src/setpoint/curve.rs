//! A plan as a curve in time.
//!
//! A plan is nodes. Between them the curve is the cubic that passes through both with the mean of the velocities of
//! the two intervals that meet there, so that position and velocity are continuous and every node is met on time.
//!
//! | symbol | name | unit |
//! |---|---|---|
//! | x_i, t_i | nodes and their times | length units, s |
//! | w_i = (x_i - x_(i-1)) / (t_i - t_(i-1)) | velocity of an interval | length units / s |
//! | v_i | velocity at a node: (w_i + w_(i+1)) / 2; w at the ends | length units / s |
//!
//! Limits: in a turn the curve lies outside the plan's straight segments, by at most an eighth of the acceleration times
//! the interval squared, and its acceleration is exact in a steady turn and up to three times the plan's where the
//! turn changes sides from node to node.

use crate::file::PlanFile;

/// Where the vehicle is meant to be at one time. Length units and seconds; east, north and, in three dimensions, up.
#[derive(Clone, Debug, PartialEq)]
pub struct Sample {
    /// Position.
    pub position: Vec<f64>,
    /// Velocity.
    pub velocity: Vec<f64>,
    /// Acceleration.
    pub acceleration: Vec<f64>,
}

impl Sample {
    /// Rest at a position.
    #[must_use]
    pub fn rest(position: &[f64]) -> Self {
        let zero = vec![0.0; position.len()];
        Self { position: position.to_vec(), velocity: zero.clone(), acceleration: zero }
    }
}

/// One agent's plan as a curve: the cubic described at the top of its file.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    times: Vec<f64>,
    nodes: Vec<Vec<f64>>,
    velocities: Vec<Vec<f64>>,
}

impl Curve {
    /// The curve of an agent's path; `None` where the plan has no such agent, fewer than two nodes, or any number that
    /// is not finite.
    #[must_use]
    pub fn of(plan: &PlanFile, agent: &str) -> Option<Self> {
        let nodes = plan.agents.iter().find(|entry| entry.name == agent)?.path.clone();
        let times = plan.node_times();
        let is_finite = nodes.iter().flatten().chain(&times).all(|number| number.is_finite());
        let increases = times.iter().zip(times.iter().skip(1)).all(|(a, b)| a < b);
        let dimension = nodes.first()?.len();
        let is_even = nodes.iter().all(|node| node.len() == dimension);
        if !(is_finite && increases && is_even && nodes.len() >= 2 && nodes.len() == times.len()) {
            return None;
        }
        let steps = nodes.iter().zip(nodes.iter().skip(1)).zip(times.iter().zip(times.iter().skip(1)));
        let intervals: Vec<Vec<f64>> = steps
            .map(|((from, to), (begin, end))| {
                from.iter().zip(to).map(|(from, to)| (to - from) / (end - begin)).collect()
            })
            .collect();
        let before = intervals.first().into_iter().chain(&intervals);
        let after = intervals.iter().chain(intervals.last());
        let mean = |(a, b): (&Vec<f64>, &Vec<f64>)| a.iter().zip(b).map(|(a, b)| 0.5 * (a + b)).collect();
        let velocities = before.zip(after).map(mean).collect();
        Some(Self { times, nodes, velocities })
    }

    /// The same curve, beginning with a velocity, length units / s, where it has as many components.
    #[must_use]
    pub fn from_velocity(mut self, velocity: &[f64]) -> Self {
        if let Some(first) = self.velocities.first_mut().filter(|first| first.len() == velocity.len()) {
            first.copy_from_slice(velocity);
        }
        self
    }

    /// Time of the first node, s.
    #[must_use]
    pub fn begin(&self) -> f64 {
        self.times.first().copied().unwrap_or_default()
    }

    /// Time of the last node, s.
    #[must_use]
    pub fn end(&self) -> f64 {
        self.times.last().copied().unwrap_or_default()
    }

    /// Index of the interval at a time, from 0: that between nodes i and i + 1. Before the first it is the first.
    #[must_use]
    pub fn interval(&self, time: f64) -> usize {
        let passed = self.times.iter().take_while(|node| **node <= time).count();
        passed.saturating_sub(1).min(self.nodes.len().saturating_sub(2))
    }

    /// Where to be at a time of the plan, s: at rest at the first node before, and at the last one after.
    #[must_use]
    pub fn sample(&self, time: f64) -> Sample {
        let ends = (self.nodes.first(), self.nodes.last());
        match ends {
            (Some(first), _) if time < self.begin() => return Sample::rest(first),
            (_, Some(last)) if time >= self.end() => return Sample::rest(last),
            _ => {}
        }
        let at = self.interval(time);
        let pair = |list: &'_ Vec<Vec<f64>>| -> Option<(Vec<f64>, Vec<f64>)> {
            Some((list.get(at)?.clone(), list.get(at + 1)?.clone()))
        };
        let (Some(nodes), Some(velocities)) = (pair(&self.nodes), pair(&self.velocities)) else {
            return Sample::rest(&[]);
        };
        let begin = self.times.get(at).copied().unwrap_or_default();
        let span = self.times.get(at + 1).copied().unwrap_or_default() - begin;
        let s = (time - begin) / span;
        let mut sample = Sample { position: Vec::new(), velocity: Vec::new(), acceleration: Vec::new() };
        let ends = nodes.0.iter().zip(&nodes.1).zip(velocities.0.iter().zip(&velocities.1));
        for ((x0, x1), (v0, v1)) in ends {
            let [position, velocity, acceleration] = hermite([*x0, *x1], [v0 * span, v1 * span], s);
            sample.position.push(position);
            sample.velocity.push(velocity / span);
            sample.acceleration.push(acceleration / (span * span));
        }
        sample
    }
}

/// Value, first and second derivative at s, 0 to 1, of the cubic with the given ends and end slopes.
fn hermite([x0, x1]: [f64; 2], [m0, m1]: [f64; 2], s: f64) -> [f64; 3] {
    let cubic = 2.0 * (x0 - x1) + m0 + m1;
    let square = 3.0 * (x1 - x0) - 2.0 * m0 - m1;
    [
        x0 + s * (m0 + s * (square + s * cubic)),
        m0 + s * (2.0 * square + 3.0 * s * cubic),
        2.0 * square + 6.0 * s * cubic,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::file::plan::AgentPlan;

    fn plan(path: Vec<Vec<f64>>, times: Option<Vec<f64>>) -> PlanFile {
        let agents = vec![AgentPlan { name: "uav1".into(), path, ..AgentPlan::default() }];
        PlanFile { start_time: 10.0, duration: 40.0, times, agents, ..PlanFile::default() }
    }

    fn turn() -> Curve {
        let node = |index: usize| {
            let angle = 0.2 * index as f64;
            vec![10.0 * angle.sin(), 10.0 * angle.cos(), 1.0]
        };
        Curve::of(&plan((0..21).map(node).collect(), None), "uav1").expect("a curve")
    }

    #[test]
    fn every_node_is_met_on_time_and_nothing_jumps() {
        let curve = turn();
        for node in 0..21 {
            let time = 10.0 + 2.0 * node as f64;
            let (before, at) = (curve.sample(time - 1e-7), curve.sample(time));
            let apart = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(apart(&at.position, &curve.nodes[node]) < 1e-12, "node {node}");
            if (1..20).contains(&node) {
                assert!(apart(&at.velocity, &before.velocity) < 1e-6, "node {node}");
                assert!(apart(&at.position, &before.position) < 1e-6, "node {node}");
            }
        }
        assert_eq!(curve.sample(9.0), Sample::rest(&curve.nodes[0]));
        assert_eq!(curve.sample(51.0), Sample::rest(&curve.nodes[20]));
    }

    #[test]
    fn velocity_and_acceleration_are_derivatives_and_those_of_a_steady_turn() {
        let curve = turn();
        let step = 1e-4;
        for index in 0..200 {
            let time = 14.1 + 0.15 * index as f64;
            let (low, at, high) = (curve.sample(time - step), curve.sample(time), curve.sample(time + step));
            let is_inside = curve.interval(time - step) == curve.interval(time + step);
            for axis in 0..3 {
                let difference = (high.position[axis] - low.position[axis]) / (2.0 * step);
                assert!((difference - at.velocity[axis]).abs() < 1e-6, "{time}");
                let difference = (high.velocity[axis] - low.velocity[axis]) / (2.0 * step);
                assert!(!is_inside || (difference - at.acceleration[axis]).abs() < 1e-6, "{time}");
            }
            // 10 length units around, 0.1 rad/s: 1 length unit/s, 0.1 length units/s^2, up to the chord.
            let norm = |vector: &[f64]| vector.iter().map(|part| part * part).sum::<f64>().sqrt();
            assert!((norm(&at.velocity) - 1.0).abs() < 0.02 && (norm(&at.acceleration) - 0.1).abs() < 0.02, "{time}");
        }
    }

    #[test]
    fn plans_that_cannot_be_flown_are_no_curves() {
        let path = vec![vec![0.0, 0.0], vec![1.0, 1.0], vec![2.0, 2.0]];
        assert!(Curve::of(&plan(path.clone(), Some(vec![0.0, 1.0, 4.0])), "uav1").is_some());
        assert_eq!(Curve::of(&plan(path.clone(), Some(vec![0.0, 1.0, 1.0])), "uav1"), None);
        assert_eq!(Curve::of(&plan(path.clone(), Some(vec![0.0, 1.0])), "uav1"), None);
        assert_eq!(Curve::of(&plan(path.clone(), None), "uav2"), None);
        let mut broken = path.clone();
        broken[1][0] = f64::NAN;
        assert_eq!(Curve::of(&plan(broken, None), "uav1"), None);
        assert_eq!(Curve::of(&plan(path[..1].to_vec(), None), "uav1"), None);
    }
}
