//! How much room a plan leaves to every constraint, in the units that people read.
//!
//! | constraint | figure | bound | unit |
//! |---|---|---|---|
//! | duration | arrival | `time.max` | s |
//! | start, goal | distance of the path's end from it | the core's tolerance | m |
//! | domain | least distance of a node from an edge | 0 | m |
//! | speed, accel | largest along the path | the agent's | m/s, m/s^2 |
//! | jam budget, dropout budget | integral over time | the agent's | s |
//! | limit | extreme at nodes 1 .. N | `min`, `max` | the metric's, in metres |
//! | region | least distance from the outline, negative on its wrong side | 0 | m |
//! | separation | least distance between two agents, between nodes too | `separation` | m |
//!
//! These are for reading. Whether a plan is feasible is the core's to say, relative to scales of its own: see
//! [`quietpath_core::constraints`]. Limits: circles count as polygons of `CORNERS` corners.

use quietpath_bridge::file::plan::AgentPlan;
use quietpath_bridge::file::scenario::{AgentEntry, RegionEntry};
use quietpath_bridge::file::{PlanFile, ScenarioFile};
use quietpath_bridge::planning::{AgentSeries, Assessment};
use quietpath_core::constraints::TOLERANCE;
use quietpath_core::scenario::Side;

use crate::report::extreme;
use crate::units::Presentation;

/// Corners of a circle: nearer to it than a ten-thousandth of its radius.
const CORNERS: u32 = 360;
/// Places of a leg at which its depth in a region is looked at.
const PARTS: u32 = 16;

/// On which side of its bound a figure has to stay.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sense {
    /// Not above it.
    AtMost,
    /// Not below it.
    AtLeast,
}

/// A constraint, what the plan makes of it, and what is allowed.
#[derive(Clone, Debug, PartialEq)]
pub struct Margin {
    /// Name of the constraint, as [`quietpath_core::constraints::Constraint`] has it.
    pub constraint: &'static str,
    /// Whom and what it is about.
    pub about: String,
    /// What was found.
    pub found: f64,
    /// What is allowed.
    pub bound: f64,
    /// On which side of the bound it has to stay.
    pub sense: Sense,
    /// Unit of both; empty for none.
    pub unit: &'static str,
}

impl Margin {
    /// Room that is left, in the figure's unit; negative where the bound is broken.
    #[must_use]
    pub fn room(&self) -> f64 {
        match self.sense {
            Sense::AtMost => self.bound - self.found,
            Sense::AtLeast => self.found - self.bound,
        }
    }
}

/// The margins of every constraint that the scenario has.
#[must_use]
pub fn margins(scenario: &ScenarioFile, plan: &PlanFile, assessment: &Assessment) -> Vec<Margin> {
    let at_most = |constraint, about: String, found, bound, unit| Margin {
        constraint,
        about,
        found,
        bound,
        sense: Sense::AtMost,
        unit,
    };
    let arrival = plan.start_time + plan.duration;
    let mut rows = vec![at_most("duration", "arrival".into(), arrival, scenario.time.max, "s")];
    for ((entry, agent), series) in scenario.agents.iter().zip(&plan.agents).zip(&assessment.agents) {
        rows.extend(own(scenario, entry, agent, series));
        let times = plan.node_times();
        let budgets = [
            ("jam_budget", "jamming", entry.jammer.map(|jammer| jammer.budget), &agent.jam),
            ("dropout_budget", "dropout", entry.dropout.map(|dropout| dropout.budget), &agent.dropout),
        ];
        for (constraint, word, budget, levels) in budgets {
            if let Some(budget) = budget {
                let spent = integral(levels.as_deref().unwrap_or_default(), &times);
                rows.push(at_most(constraint, format!("{} {word}", agent.name), spent, budget, "s"));
            }
        }
        rows.extend(limits(scenario, series));
        rows.extend(scenario.regions.iter().map(|region| clearance(scenario, region, agent, &times)));
    }
    rows.extend(distances(scenario, plan));
    rows
}

/// Ends, domain, speed and acceleration of one agent.
fn own(scenario: &ScenarioFile, entry: &AgentEntry, agent: &AgentPlan, series: &AgentSeries) -> Vec<Margin> {
    let unit_m = scenario.frame.unit_m;
    let most = |values: &[f64]| values.iter().copied().fold(0.0, f64::max) * unit_m;
    let off =
        |end: Option<&Vec<f64>>, wanted: &[f64]| end.map_or(f64::INFINITY, |end| distance(end, wanted) * unit_m);
    let row = |constraint, what: &str, found, bound, unit| Margin {
        constraint,
        about: format!("{} {what}", agent.name),
        found,
        bound,
        sense: Sense::AtMost,
        unit,
    };
    let edge = |point: &Vec<f64>| {
        let sides = scenario.domain.min.iter().zip(&scenario.domain.max);
        let rooms = point.iter().zip(sides).map(|(at, (low, high))| (at - low).min(high - at));
        rooms.fold(f64::INFINITY, f64::min)
    };
    let room = agent.path.iter().map(edge).fold(f64::INFINITY, f64::min) * unit_m;
    let sides = scenario.domain.max.iter().zip(&scenario.domain.min).map(|(high, low)| high - low);
    let near = TOLERANCE * sides.fold(0.0, f64::max) * unit_m;
    vec![
        row("start", "off its start", off(agent.path.first(), &entry.start), near, "m"),
        row("goal", "off its goal", off(agent.path.last(), &entry.goal), near, "m"),
        Margin { sense: Sense::AtLeast, ..row("domain", "to the domain's edge", room, 0.0, "m") },
        row("speed", "top speed", most(&series.speed), entry.speed_max * unit_m, "m/s"),
        row("accel", "top acceleration", most(&series.accel), entry.accel_max * unit_m, "m/s\u{b2}"),
    ]
}

fn limits(scenario: &ScenarioFile, series: &AgentSeries) -> Vec<Margin> {
    let mut rows = Vec::new();
    for limit in &scenario.limits {
        let shown = Presentation::of(limit.metric, scenario.dimension, scenario.frame.unit_m);
        let values = series.metric(limit.metric).unwrap_or_default();
        let bounds = [
            (limit.min, Sense::AtLeast, f64::min as fn(f64, f64) -> f64, "least"),
            (limit.max, Sense::AtMost, f64::max, "largest"),
        ];
        for (bound, sense, pick, word) in bounds {
            let Some(bound) = bound else { continue };
            rows.push(Margin {
                constraint: "limit",
                about: format!("{} {word} {}", series.name, shown.label()),
                found: shown.convert(extreme(values, pick).0),
                bound: shown.convert(bound),
                sense,
                // The label has it already.
                unit: "",
            });
        }
    }
    rows
}

/// Least distance of a path from a region's outline while it applies, negative on the wrong side.
fn clearance(scenario: &ScenarioFile, region: &RegionEntry, agent: &AgentPlan, times: &[f64]) -> Margin {
    let ring = region.outline.ring(CORNERS);
    let mut least = f64::INFINITY;
    for (leg, end) in agent.path.windows(2).zip(times.iter().skip(1)) {
        let [from, to] = leg else { continue };
        if *end >= region.window.from && *end < region.window.until {
            least = least.min(signed(&ring, region.side, flat(from), flat(to)));
        }
    }
    let about = format!("{} to {}", agent.name, region.name);
    let found = least * scenario.frame.unit_m;
    Margin { constraint: "region", about, found, bound: 0.0, sense: Sense::AtLeast, unit: "m" }
}

/// Least distance of a leg from a ring, negative where a part of it is on the wrong side: seen at [`PARTS`] places.
fn signed(ring: &[[f64; 2]], side: Side, from: [f64; 2], to: [f64; 2]) -> f64 {
    let edges = || ring.iter().zip(ring.iter().cycle().skip(1));
    let place = |part: u32| {
        let share = f64::from(part) / f64::from(PARTS);
        [from[0] + share * (to[0] - from[0]), from[1] + share * (to[1] - from[1])]
    };
    let depth = |point: [f64; 2]| edges().map(|(a, b)| off(point, *a, *b)).fold(f64::INFINITY, f64::min);
    let wrong = (0..=PARTS).map(place).filter(|point| holds(ring, *point) == (side == Side::Outside));
    let deepest = wrong.map(depth).fold(0.0, f64::max);
    let gap = edges().map(|(a, b)| between(from, to, *a, *b)).fold(f64::INFINITY, f64::min);
    if deepest > 0.0 { -deepest } else { gap }
}

/// Least distances between agents; none where the scenario asks for none.
fn distances(scenario: &ScenarioFile, plan: &PlanFile) -> Vec<Margin> {
    let Some(separation) = scenario.separation else { return Vec::new() };
    let unit_m = scenario.frame.unit_m;
    let mut rows = Vec::new();
    for (index, one) in plan.agents.iter().enumerate() {
        for other in plan.agents.iter().skip(index + 1) {
            let relative: Vec<Vec<f64>> = one
                .path
                .iter()
                .zip(&other.path)
                .map(|(a, b)| a.iter().zip(b).map(|(a, b)| a - b).collect())
                .collect();
            let least = relative.windows(2).map(nearest_to_origin).fold(f64::INFINITY, f64::min);
            rows.push(Margin {
                constraint: "separation",
                about: format!("{} to {}", one.name, other.name),
                found: least * unit_m,
                bound: separation * unit_m,
                sense: Sense::AtLeast,
                unit: "m",
            });
        }
    }
    rows
}

/// Integral of a control over time: each value holds over the interval that ends at its node.
fn integral(levels: &[f64], times: &[f64]) -> f64 {
    let intervals = times.iter().zip(times.iter().skip(1)).map(|(a, b)| b - a);
    intervals.zip(levels.iter().skip(1)).map(|(interval, level)| interval * level).sum()
}

fn flat(point: &[f64]) -> [f64; 2] {
    [point.first().copied().unwrap_or(f64::NAN), point.get(1).copied().unwrap_or(f64::NAN)]
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

fn nearest_to_origin(leg: &[Vec<f64>]) -> f64 {
    let [from, to] = leg else { return f64::INFINITY };
    let along: Vec<f64> = from.iter().zip(to).map(|(a, b)| b - a).collect();
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let length_squared = dot(&along, &along);
    let share = if length_squared > 0.0 { (-dot(from, &along) / length_squared).clamp(0.0, 1.0) } else { 0.0 };
    let nearest: Vec<f64> = from.iter().zip(&along).map(|(at, by)| at + share * by).collect();
    dot(&nearest, &nearest).sqrt()
}

/// Distance of a point from a segment.
pub(crate) fn off([x, y]: [f64; 2], a: [f64; 2], b: [f64; 2]) -> f64 {
    nearest_to_origin(&[vec![a[0] - x, a[1] - y], vec![b[0] - x, b[1] - y]])
}

/// Distance between two segments; 0 where they cross.
fn between(a: [f64; 2], b: [f64; 2], c: [f64; 2], d: [f64; 2]) -> f64 {
    let turn = |a: [f64; 2], b: [f64; 2], c: [f64; 2]| (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    let crossing = turn(a, b, c) * turn(a, b, d) < 0.0 && turn(c, d, a) * turn(c, d, b) < 0.0;
    if crossing { 0.0 } else { off(a, c, d).min(off(b, c, d)).min(off(c, a, b)).min(off(d, a, b)) }
}

/// Whether a convex ring, counter-clockwise, holds a point.
pub(crate) fn holds(ring: &[[f64; 2]], [x, y]: [f64; 2]) -> bool {
    let mut edges = ring.iter().zip(ring.iter().cycle().skip(1));
    edges.all(|(a, b)| (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]) > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use quietpath_bridge::file::scenario::Outline;

    const SCENARIO: &str = include_str!("../scenarios/square8-detection.toml");

    fn scenario(more: &str) -> ScenarioFile {
        ScenarioFile::parse("s.toml", &format!("{SCENARIO}\n{more}")).unwrap().scenario
    }

    #[test]
    fn a_region_has_room_outside_and_lacks_it_inside() {
        let scenario = scenario("[[region]]\nname = \"r\"\ncenter = [5.0, 3.0]\nradius = 1.0\n");
        let path = |y: f64| AgentPlan {
            name: "uav1".into(),
            path: vec![vec![0.8, y], vec![9.0, y]],
            ..AgentPlan::default()
        };
        let unit_m = scenario.frame.unit_m;
        let room = |y| clearance(&scenario, &scenario.regions[0], &path(y), &[0.0, 1.0]).room() / unit_m;
        assert!((room(4.5) - 0.5).abs() < 1e-3, "{}", room(4.5));
        assert!((room(3.5) + 0.5).abs() < 0.01, "{}", room(3.5));
        let inside =
            AgentPlan { name: "uav1".into(), path: vec![vec![5.0, 3.0], vec![5.5, 3.0]], ..AgentPlan::default() };
        let short = clearance(&scenario, &scenario.regions[0], &inside, &[0.0, 1.0]).room() / unit_m;
        assert!((short + 1.0).abs() < 1e-3, "the start lies in the middle: {short}");
    }

    #[test]
    fn a_ring_holds_what_is_in_it() {
        let ring = Outline::Polygon(vec![[0.0, 0.0], [0.0, 2.0], [2.0, 0.0]]).ring(3);
        assert!(holds(&ring, [0.5, 0.5]));
        assert!(!holds(&ring, [1.5, 1.5]));
    }

    #[test]
    fn a_budget_is_spent_over_the_interval_that_ends_at_the_node() {
        assert!((integral(&[9.0, 1.0, 0.5], &[0.0, 1.0, 3.0]) - 2.0).abs() < 1e-12);
    }
}
