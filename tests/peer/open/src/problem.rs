//! A scenario as OpEn wants it: cost, gradient, constraint rows, and their transposed derivative.

use std::cell::RefCell;

use optimization_engine::FunctionCallResult;
use quietpath_bridge::capacity::{HostScenario, HostTrajectory, SENSORS};
use quietpath_bridge::file::ScenarioFile;
use quietpath_core::math::{norm, norm_squared};
use quietpath_core::metrics::Sample;
use quietpath_core::objective::{self, Extreme};
use quietpath_core::scenario::Reduce;
use quietpath_core::{Point, Trajectory};
use serde_json::{Value, json};

/// Room for evaluations.
struct Memory<const DIM: usize> {
    trajectory: HostTrajectory<f64, DIM>,
    gradient: HostTrajectory<f64, DIM>,
    scratch: Vec<Sample<f64, DIM>>,
}

/// A scenario and its coordinates.
pub struct Problem<const DIM: usize> {
    scenario: Box<HostScenario<f64, DIM>>,
    intervals: usize,
    /// Flight time of the first guess, s, and the longest allowed.
    first: f64,
    allowed: f64,
    /// Distance flown in one of the first intervals at full speed, and what acceleration adds to it.
    speed: f64,
    accel: f64,
    /// Diagonal and lower diagonal of the factor L.
    factor: Vec<[f64; 2]>,
    width: f64,
    /// What the cost is multiplied by.
    scale: f64,
    /// Flight time over the first one's is 1 + `pace` times the last entry of u: the penalty on late arrival would
    /// otherwise be stiff by orders of magnitude.
    pace: f64,
    memory: RefCell<Box<Memory<DIM>>>,
}

impl<const DIM: usize> Problem<DIM> {
    /// Scales and factors.
    ///
    /// # Errors
    /// What the peer does not model.
    pub fn new(file: &ScenarioFile) -> Result<Self, String> {
        let [agent] = file.agents.as_slice() else { return Err("several agents are not modelled".into()) };
        let is_plain = agent.jammer.is_none()
            && agent.dropout.is_none()
            && agent.start_velocity.is_none()
            && file.regions.is_empty()
            && file.limits.is_empty()
            && file.terms.iter().all(|term| term.reduce == Reduce::Integral);
        if !is_plain {
            return Err("controls, regions, limits and worst cases are not modelled".into());
        }
        let scenario = file.to_core::<f64, DIM>().map_err(|error| error.to_string())?;
        let view = scenario.view();
        let (start, goal) = (view.agents[0].start, view.agents[0].goal);
        let allowed = view.frame.time.max - view.frame.start_time;
        let shortest = norm(&(goal - start)) / agent.speed_max;
        let wanted = if file.time.penalty > 0.0 { file.time.target } else { 1.3 * shortest };
        let wanted = wanted.max(1.05 * shortest);
        let first = if wanted < allowed { wanted } else { 0.5 * (shortest + allowed) };
        let intervals = file.intervals;
        let h = first / intervals as f64;
        let mut factor = Vec::with_capacity(intervals - 1);
        let mut lower = 0.0_f64;
        for _ in 1..intervals {
            let diagonal = (2.0 - lower * lower).sqrt();
            factor.push([diagonal, lower]);
            lower = -1.0 / diagonal;
        }
        let width = (view.frame.domain.max - view.frame.domain.min).max();
        let memory = Memory {
            trajectory: Trajectory::straight(&view, first).map_err(|error| format!("{error:?}"))?,
            gradient: Trajectory::empty(),
            scratch: vec![Sample::default(); SENSORS],
        };
        let mut problem = Self {
            intervals,
            first,
            allowed,
            speed: agent.speed_max * h,
            accel: agent.accel_max * h * h,
            factor,
            width,
            scale: 1.0,
            pace: 1.0,
            memory: RefCell::new(Box::new(memory)),
            scenario,
        };
        let guess = problem.first();
        let mut slope = vec![0.0; guess.len()];
        problem.slope(&guess, &mut slope).map_err(|error| format!("{error:?}"))?;
        slope.pop();
        problem.scale = 1.0 / slope.iter().fold(1e-6, |most: f64, entry| most.max(entry.abs()));
        problem.pace = 1.0 / (2.0 * file.time.penalty * first * first * problem.scale).sqrt().max(1.0);
        Ok(problem)
    }

    /// The straight line.
    pub fn first(&self) -> Vec<f64> {
        vec![0.0; DIM * (self.intervals - 1) + 1]
    }

    /// Flight time over the first one's.
    fn stretch(&self, u: &[f64]) -> f64 {
        self.pace.mul_add(u.last().copied().unwrap_or_default(), 1.0)
    }

    /// Bounds on u: only flight time has any.
    pub fn bounds(&self) -> (Vec<f64>, Vec<f64>) {
        let inner = DIM * (self.intervals - 1);
        let bounds = |end: f64, fill: f64| [vec![fill; inner], vec![end]].concat();
        let last = |stretch: f64| (stretch - 1.0) / self.pace;
        (bounds(last(1e-3), -1e9), bounds(last(self.allowed / self.first), 1e9))
    }

    /// Bounds on the rows: speeds, accelerations, positions.
    pub fn row_bounds(&self) -> (Vec<f64>, Vec<f64>) {
        let (n, domain) = (self.intervals, self.scenario.view().frame.domain);
        let side = |point: Point<f64, DIM>| (1..n).flat_map(move |_| point.iter().copied().collect::<Vec<_>>());
        let low = std::iter::repeat_n(-1e9, 2 * n - 1).chain(side(domain.min / self.width)).collect();
        let high = std::iter::repeat_n(0.0, 2 * n - 1).chain(side(domain.max / self.width)).collect();
        (low, high)
    }

    /// x = line + c L^-T u.
    fn path(&self, u: &[f64]) -> Vec<Point<f64, DIM>> {
        let view = self.scenario.view();
        let (start, goal, n) = (view.agents[0].start, view.agents[0].goal, self.intervals);
        let mut path: Vec<Point<f64, DIM>> =
            (0..=n).map(|node| start + (goal - start) * (node as f64 / n as f64)).collect();
        path[n] = goal;
        let mut after = Point::<f64, DIM>::zeros();
        let mut lower_after = 0.0;
        for inner in (0..n - 1).rev() {
            let [diagonal, lower] = self.factor[inner];
            let entry = Point::<f64, DIM>::from_column_slice(&u[DIM * inner..DIM * (inner + 1)]);
            after = (entry - after * lower_after) / diagonal;
            lower_after = lower;
            path[inner + 1] += after * self.speed;
        }
        path
    }

    /// The transposed map: from derivatives by nodes to derivatives by u.
    fn path_back(&self, by_node: &[Point<f64, DIM>], out: &mut [f64]) {
        let mut before = Point::<f64, DIM>::zeros();
        for (inner, [diagonal, lower]) in self.factor.iter().enumerate() {
            before = (by_node[inner + 1] * self.speed - before * *lower) / *diagonal;
            out[DIM * inner..DIM * (inner + 1)].copy_from_slice(before.as_slice());
        }
    }

    fn lay(&self, u: &[f64], memory: &mut Memory<DIM>) {
        let start = self.scenario.view().frame.start_time;
        memory.trajectory.set_duration(start, self.first * self.stretch(u));
        let path = self.path(u);
        memory.trajectory.tracks[0].path[..path.len()].copy_from_slice(&path);
    }

    pub fn cost(&self, u: &[f64], cost: &mut f64) -> FunctionCallResult {
        let memory = &mut **self.memory.borrow_mut();
        self.lay(u, memory);
        let view = self.scenario.view();
        *cost = self.scale * objective::value(&view, &memory.trajectory, Extreme::Exact, &mut memory.scratch);
        Ok(())
    }

    pub fn slope(&self, u: &[f64], slope: &mut [f64]) -> FunctionCallResult {
        let memory = &mut **self.memory.borrow_mut();
        self.lay(u, memory);
        let view = self.scenario.view();
        let Memory { trajectory, gradient, scratch } = memory;
        objective::gradient(&view, trajectory, Extreme::Exact, scratch, gradient);
        self.path_back(&gradient.tracks[0].path[..=self.intervals], slope);
        let by_time = (0..=self.intervals).map(|node| gradient.times[node] * node as f64 / self.intervals as f64);
        slope[u.len() - 1] = self.pace * self.first * by_time.sum::<f64>();
        slope.iter_mut().for_each(|entry| *entry *= self.scale);
        Ok(())
    }

    pub fn rows(&self, u: &[f64], rows: &mut [f64]) -> FunctionCallResult {
        let (path, n, r) = (self.path(u), self.intervals, self.stretch(u));
        for i in 0..n {
            rows[i] = norm_squared(&(path[i + 1] - path[i])) / self.speed.powi(2) - r * r;
        }
        for i in 1..n {
            let bend = path[i + 1] - path[i] * 2.0 + path[i - 1];
            rows[n - 1 + i] = norm_squared(&bend) / self.accel.powi(2) - r.powi(4);
            let place = path[i] / self.width;
            rows[2 * n - 1 + DIM * (i - 1)..2 * n - 1 + DIM * i].copy_from_slice(place.as_slice());
        }
        Ok(())
    }

    pub fn rows_back(&self, u: &[f64], weights: &[f64], out: &mut [f64]) -> FunctionCallResult {
        let (path, n, r) = (self.path(u), self.intervals, self.stretch(u));
        let mut by_node = vec![Point::<f64, DIM>::zeros(); n + 1];
        let mut by_time = 0.0;
        for i in 0..n {
            let part = (path[i + 1] - path[i]) * (2.0 * weights[i] / self.speed.powi(2));
            by_node[i + 1] += part;
            by_node[i] -= part;
            by_time -= 2.0 * r * weights[i];
        }
        for i in 1..n {
            let weight = weights[n - 1 + i];
            let part = (path[i + 1] - path[i] * 2.0 + path[i - 1]) * (2.0 * weight / self.accel.powi(2));
            by_node[i + 1] += part;
            by_node[i] -= part * 2.0;
            by_node[i - 1] += part;
            by_time -= 4.0 * r.powi(3) * weight;
            let place = &weights[2 * n - 1 + DIM * (i - 1)..2 * n - 1 + DIM * i];
            by_node[i] += Point::<f64, DIM>::from_column_slice(place) / self.width;
        }
        self.path_back(&by_node, out);
        out[u.len() - 1] = self.pace * by_time;
        Ok(())
    }

    /// The plan, as a plan file has it.
    pub fn plan(&self, u: &[f64], file: &ScenarioFile) -> Value {
        let path: Vec<Vec<f64>> = self.path(u).iter().map(|node| node.iter().copied().collect()).collect();
        json!({
            "scenario": file.name,
            "start_time": file.start_time,
            "duration": self.first * self.stretch(u),
            "agents": [{ "name": file.agents[0].name, "path": path }],
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Derivatives of cost and rows against central differences, away from the straight line.
    #[test]
    fn derivatives_are_those_of_the_values() {
        // The host's trajectories pass through the stack, several times over without optimisation.
        let thread = std::thread::Builder::new().stack_size(crate::STACK_BYTES).spawn(compare).expect("a thread");
        thread.join().expect("the comparison holds");
    }

    fn compare() {
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../sim/scenarios/square8-mixed.toml");
        let scenario = ScenarioFile::read(file).expect("it is there").scenario;
        let problem = Problem::<2>::new(&scenario).expect("it is modelled");
        let mut u = problem.first();
        let count = u.len();
        for (k, entry) in u.iter_mut().enumerate() {
            *entry += 0.3 * (k as f64).sin();
        }
        let rows = problem.row_bounds().0.len();
        let weights: Vec<f64> = (0..rows).map(|k| (1.3 * k as f64).cos()).collect();
        let merit = |u: &[f64]| {
            let (mut cost, mut values) = (0.0, vec![0.0; rows]);
            problem.cost(u, &mut cost).expect("a cost");
            problem.rows(u, &mut values).expect("rows");
            cost + values.iter().zip(&weights).map(|(a, b)| a * b).sum::<f64>()
        };
        let (mut slope, mut back) = (vec![0.0; count], vec![0.0; count]);
        problem.slope(&u, &mut slope).expect("a slope");
        problem.rows_back(&u, &weights, &mut back).expect("a slope");
        for k in [0, 1, 7, 40, count - 2, count - 1] {
            let (mut above, mut below) = (u.clone(), u.clone());
            above[k] += 1e-6;
            below[k] -= 1e-6;
            let difference = (merit(&above) - merit(&below)) / 2e-6;
            let exact = slope[k] + back[k];
            assert!((difference - exact).abs() < 1e-5 * exact.abs().max(1.0), "{k}: {exact} against {difference}");
        }
    }
}
