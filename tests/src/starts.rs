//! First plans to start a local search from: the straight line, and random detours that are flyable.
//!
//! | symbol | name | unit | shape |
//! |---|---|---|---|
//! | s | share of the way | | |
//! | a_m | amplitude of mode m, drawn | length units | dimension |
//!
//! A detour is the straight line plus sum over m = 1 .. `MODES` of a_m sin(pi m s), kept in the domain and flown at
//! constant speed, slowly enough for both bounds. A detour that is too long for `time.max` is made smaller.
//!
//! Limits: start velocities are not followed; a detour that crosses a region or exceeds a limit is thrown away.

use fastrand::Rng;
use quietpath_bridge::file::plan::AgentPlan;
use quietpath_bridge::file::scenario::AgentEntry;
use quietpath_bridge::file::{PlanFile, ScenarioFile};
use quietpath_bridge::planning::assess;

/// Modes of a detour.
const MODES: u32 = 3;
/// Largest amplitude of the first mode, in sides of the domain.
const AMPLITUDE: f64 = 0.5;
/// Draws until a detour is feasible.
const DRAWS_MAX: usize = 60;
/// Halvings of a detour that is too long.
const HALVINGS_MAX: usize = 8;
/// Points of the curve before it is cut into equal steps.
const POINTS: usize = 400;
/// Room that the flight time leaves on speed and acceleration.
const ROOM: f64 = 1.02;

/// Straight lines at constant speed, without controls; the target time where it can be met.
#[must_use]
pub fn straight(scenario: &ScenarioFile) -> PlanFile {
    let curves: Vec<_> = scenario.agents.iter().map(|agent| detour(scenario, agent, &[])).collect();
    let shortest = shortest(scenario, &curves);
    with_duration(scenario, curves, (shortest * ROOM).max(scenario.time.target).min(allowed(scenario)))
}

/// A feasible random plan; none where none was found in `DRAWS_MAX` draws.
#[must_use]
pub fn random(scenario: &ScenarioFile, random: &mut Rng) -> Option<PlanFile> {
    (0..DRAWS_MAX).find_map(|_| {
        let plan = draw(scenario, random)?;
        assess(scenario, &plan, "a detour").is_ok_and(|found| found.feasible).then_some(plan)
    })
}

fn draw(scenario: &ScenarioFile, random: &mut Rng) -> Option<PlanFile> {
    let amplitudes: Vec<Vec<Vec<f64>>> = scenario.agents.iter().map(|_| amplitudes(scenario, random)).collect();
    let mut size = random.f64();
    for _ in 0..HALVINGS_MAX {
        let curve = |(agent, modes): (&AgentEntry, &Vec<Vec<f64>>)| {
            let scaled: Vec<Vec<f64>> =
                modes.iter().map(|mode| mode.iter().map(|part| part * size).collect()).collect();
            detour(scenario, agent, &scaled)
        };
        let curves: Vec<_> = scenario.agents.iter().zip(&amplitudes).map(curve).collect();
        let shortest = shortest(scenario, &curves) * ROOM;
        if shortest < allowed(scenario) {
            let duration = shortest.max(scenario.time.target).min(allowed(scenario));
            let mut plan = with_duration(scenario, curves, duration);
            lay_controls(scenario, &mut plan, random);
            return Some(plan);
        }
        size *= 0.5;
    }
    None
}

fn amplitudes(scenario: &ScenarioFile, random: &mut Rng) -> Vec<Vec<f64>> {
    let sides: Vec<f64> =
        scenario.domain.min.iter().zip(&scenario.domain.max).map(|(low, high)| high - low).collect();
    let mut mode = |number: u32| -> Vec<f64> {
        let one = |side: &f64| (2.0 * random.f64() - 1.0) * AMPLITUDE * side / f64::from(number);
        sides.iter().map(one).collect()
    };
    (1..=MODES).map(&mut mode).collect()
}

/// N + 1 points at equal distances along the line with its detour.
fn detour(scenario: &ScenarioFile, agent: &AgentEntry, modes: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let point = |index: usize| -> Vec<f64> {
        let share = index as f64 / POINTS as f64;
        let ends = agent.start.iter().zip(&agent.goal).zip(scenario.domain.min.iter().zip(&scenario.domain.max));
        ends.enumerate()
            .map(|(axis, ((start, goal), (low, high)))| {
                let bend = |(mode, amplitude): (usize, &Vec<f64>)| {
                    let wave = (std::f64::consts::PI * (mode + 1) as f64 * share).sin();
                    amplitude.get(axis).copied().unwrap_or_default() * wave
                };
                let aside: f64 = modes.iter().enumerate().map(bend).sum();
                ((goal - start).mul_add(share, *start) + aside).clamp(*low, *high)
            })
            .collect()
    };
    let curve: Vec<Vec<f64>> = (0..=POINTS).map(point).collect();
    let mut path = equal_steps(&curve, scenario.intervals);
    for (place, exact) in [(0, &agent.start), (scenario.intervals, &agent.goal)] {
        if let Some(end) = path.get_mut(place) {
            end.clone_from(exact);
        }
    }
    path
}

/// Points that lie at equal distances along a polyline.
fn equal_steps(curve: &[Vec<f64>], intervals: usize) -> Vec<Vec<f64>> {
    let lengths: Vec<f64> = curve.windows(2).map(|pair| apart(&pair[0], &pair[1])).collect();
    let total: f64 = lengths.iter().sum();
    let mut path = Vec::with_capacity(intervals + 1);
    let (mut piece, mut before) = (0, 0.0);
    for node in 0..=intervals {
        let wanted = total * node as f64 / intervals as f64;
        while piece + 1 < lengths.len() && before + lengths[piece] < wanted {
            before += lengths[piece];
            piece += 1;
        }
        let share = if lengths[piece] > 0.0 { ((wanted - before) / lengths[piece]).clamp(0.0, 1.0) } else { 0.0 };
        path.push(curve[piece].iter().zip(&curve[piece + 1]).map(|(a, b)| (b - a).mul_add(share, *a)).collect());
    }
    path
}

fn apart(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

/// Shortest time in which all agents can fly their paths with equal intervals, s.
fn shortest(scenario: &ScenarioFile, paths: &[Vec<Vec<f64>>]) -> f64 {
    let intervals = scenario.intervals as f64;
    let one = |(agent, path): (&AgentEntry, &Vec<Vec<f64>>)| {
        let step = path.windows(2).map(|pair| apart(&pair[0], &pair[1])).fold(0.0, f64::max);
        let bend = |three: &[Vec<f64>]| {
            let middle: Vec<f64> = three[0].iter().zip(&three[2]).map(|(a, b)| 0.5 * (a + b)).collect();
            2.0 * apart(&middle, &three[1])
        };
        let bend = path.windows(3).map(bend).fold(0.0, f64::max);
        intervals * (step / agent.speed_max).max((bend / agent.accel_max).sqrt())
    };
    scenario.agents.iter().zip(paths).map(one).fold(0.0, f64::max)
}

fn allowed(scenario: &ScenarioFile) -> f64 {
    scenario.time.max - scenario.start_time
}

fn with_duration(scenario: &ScenarioFile, paths: Vec<Vec<Vec<f64>>>, duration: f64) -> PlanFile {
    let agent = |(entry, path): (&AgentEntry, Vec<Vec<f64>>)| AgentPlan {
        name: entry.name.clone(),
        path,
        ..AgentPlan::default()
    };
    PlanFile {
        scenario: scenario.name.clone(),
        start_time: scenario.start_time,
        duration,
        agents: scenario.agents.iter().zip(paths).map(agent).collect(),
        ..PlanFile::default()
    }
}

/// Levels that use up to the whole budget, and directions that turn slowly.
fn lay_controls(scenario: &ScenarioFile, plan: &mut PlanFile, random: &mut Rng) {
    let duration = plan.duration;
    let mut level = |budget: f64, nodes: usize| -> Vec<f64> {
        let mean = (budget / duration * random.f64()).min(0.5);
        let (phase, turns) = (random.f64(), f64::from(random.u32(0..4)));
        let wave = |node: usize| {
            let angle = std::f64::consts::TAU * (phase + turns * node as f64 / nodes as f64);
            if node == 0 { 0.0 } else { mean * 0.95 * (1.0 + 0.9 * angle.sin() * f64::from(turns > 0.0)) }
        };
        (0..nodes).map(wave).collect()
    };
    let nodes = plan.nodes();
    for (agent, entry) in plan.agents.iter_mut().zip(&scenario.agents) {
        agent.jam = entry.jammer.as_ref().map(|jammer| level(jammer.budget, nodes));
        agent.dropout = entry.dropout.as_ref().map(|dropout| level(dropout.budget, nodes));
    }
    for (agent, entry) in plan.agents.iter_mut().zip(&scenario.agents) {
        let (first, turn) = (random.f64() * std::f64::consts::TAU, (2.0 * random.f64() - 1.0) * 3.0);
        agent.azimuth = entry
            .jammer
            .as_ref()
            .map(|_| (0..nodes).map(|node| turn.mul_add(node as f64 / nodes as f64, first)).collect());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn random_starts_are_feasible_and_differ() {
        let mut rng = Rng::with_seed(3);
        for name in ["square8-detection", "square8-jam", "dropout4-17", "volume8-detection", "square8-team"] {
            let scenario = crate::scenario(name);
            let plans: Vec<_> = (0..5).filter_map(|_| random(&scenario, &mut rng)).collect();
            assert_eq!(plans.len(), 5, "{name}");
            let length = |plan: &PlanFile| assess(&scenario, plan, name).map(|found| found.agents[0].length);
            assert!((length(&plans[0]).expect("fits") - length(&plans[1]).expect("fits")).abs() > 1e-6);
        }
    }
}
