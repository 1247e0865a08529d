//! Advice on a scenario: what is legal and can be read, and will hardly give what was meant.
//!
//! | advice on | found by |
//! |---|---|
//! | time | shortest flight against `time.max` and `time.target` |
//! | reach | cells of a grid, flooded from the start around the regions that always apply |
//! | room | start and goal against regions and the edges of the domain |
//! | grid | way flown in an interval against the sizes of regions and between sensors |
//! | sensors | what each alone makes of the metrics that are asked for, anywhere in the domain |
//! | landscape | how much the first metric differs from place to place |
//!
//! Limits: the grid has `CELLS` cells along the longer side, so that a gap narrower than one may be missed; sensors are
//! looked at where they are at the start and at the end.

use std::fmt::Write as _;

use anstyle::AnsiColor;
use quietpath_bridge::file::scenario::{MotionEntry, SensorEntry};
use quietpath_bridge::file::{FileError, ScenarioFile};
use quietpath_bridge::planning;
use quietpath_core::Metric;
use quietpath_core::scenario::Side;

use crate::commands::landscape::view;
use crate::margins::{holds, off};
use crate::units;

/// Cells along the longer side.
const CELLS: usize = 200;
/// Cells along the longer side for looking at metrics.
const COARSE: usize = 40;
/// Corners of a circle.
const CORNERS: u32 = 90;
/// A slack in time below this part of the shortest flight leaves no way around anything.
const TIGHT: f64 = 0.02;
/// A probability below this is as good as none.
const FAINT: f64 = 1e-3;
/// A landscape that differs by less than this part gives nothing to choose.
const FLAT: f64 = 0.01;
/// Nearer to a region or an edge than this part of the domain leaves no room.
const NEAR: f64 = 0.01;

/// What is said about a scenario.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Advice {
    /// Figures that are good to know: names and values.
    pub facts: Vec<(String, String)>,
    /// What is odd, and what may help.
    pub items: Vec<(String, String)>,
    /// Whether every goal can be reached.
    pub reachable: bool,
}

impl Advice {
    fn say(&mut self, what: String, help: &str) {
        self.items.push((what, help.to_owned()));
    }

    /// What `quietpath check` prints.
    #[must_use]
    pub fn text(&self) -> String {
        let mut text = String::new();
        for (name, value) in &self.facts {
            let _ = writeln!(text, "{name:<24}{value}");
        }
        let style = AnsiColor::Yellow.on_default().bold();
        for (what, help) in &self.items {
            let _ = write!(text, "\n{style}advice:{style:#} {what}\n  help: {help}\n");
        }
        if self.items.is_empty() {
            text.push_str("\nnothing to advise\n");
        }
        text
    }
}

/// Looks a scenario over.
///
/// # Errors
/// As [`planning::landscapes`].
pub fn advise(scenario: &ScenarioFile) -> Result<Advice, Box<FileError>> {
    let mut advice = Advice { reachable: true, ..Advice::default() };
    let unit_m = scenario.frame.unit_m;
    let size = |axis: usize| side(scenario, axis) * unit_m;
    let moving = scenario.sensors.iter().filter(|sensor| matches!(sensor.motion, MotionEntry::Track(_))).count();
    let mut fact = |name: &str, value: String| advice.facts.push((name.to_owned(), value));
    fact("scenario", scenario.name.clone());
    fact("domain", format!("{} by {}", units::length(size(0)), units::length(size(1))));
    fact("sensors", format!("{}, {moving} of them moving", scenario.sensors.len()));
    time(scenario, &mut advice);
    reach(scenario, &mut advice);
    room(scenario, &mut advice);
    grid(scenario, &mut advice);
    sensors(scenario, &mut advice)?;
    landscape(scenario, &mut advice)?;
    Ok(advice)
}

fn side(scenario: &ScenarioFile, axis: usize) -> f64 {
    let edge = |bounds: &[f64]| bounds.get(axis).copied().unwrap_or_default();
    edge(&scenario.domain.max) - edge(&scenario.domain.min)
}

fn longer(scenario: &ScenarioFile) -> f64 {
    side(scenario, 0).max(side(scenario, 1))
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

fn time(scenario: &ScenarioFile, advice: &mut Advice) {
    for agent in &scenario.agents {
        let straight = distance(&agent.start, &agent.goal) / agent.speed_max;
        let slack = scenario.time.max - scenario.start_time - straight;
        let percent = 100.0 * slack / straight;
        let value = format!("{}, {percent:.0} % slack until time.max", units::duration(straight));
        advice.facts.push((format!("{} straight flight", agent.name), value));
        if slack < TIGHT * straight {
            advice.say(
                format!(
                    "{} can hardly leave the straight line: `time.max` leaves {percent:.1} % of slack",
                    agent.name
                ),
                "a later `time.max` or a larger `speed_max` gives it a choice",
            );
        }
        let late = scenario.start_time + straight - scenario.time.target;
        if scenario.time.penalty > 0.0 && scenario.time.target > 0.0 && late > 0.0 {
            advice.say(
                format!(
                    "{} always pays for being late: `time.target` is {late:.1} s before its earliest arrival",
                    agent.name
                ),
                "choose a later `time.target`, or leave it out",
            );
        }
    }
}

/// Whether cells of the domain are free, row by row from the south.
struct Floor {
    columns: usize,
    rows: usize,
    free: Vec<bool>,
}

impl Floor {
    /// Regions that apply always close their cells.
    fn of(scenario: &ScenarioFile) -> Self {
        let at = view(scenario, Metric::Detection, CELLS);
        let (columns, rows) = (at.columns, at.rows);
        let always = |from: f64, until: f64| from == f64::NEG_INFINITY && until == f64::INFINITY;
        let rings: Vec<_> = scenario
            .regions
            .iter()
            .filter(|region| always(region.window.from, region.window.until))
            .map(|region| (region.outline.ring(CORNERS), region.side))
            .collect();
        let center = |axis: usize, index: usize, count: usize| {
            let low = scenario.domain.min.get(axis).copied().unwrap_or_default();
            low + side(scenario, axis) * (index as f64 + 0.5) / count as f64
        };
        let open = |cell: usize| {
            let place = [center(0, cell % columns, columns), center(1, cell / columns, rows)];
            rings.iter().all(|(ring, side)| holds(ring, place) == (*side == Side::Inside))
        };
        Self { columns, rows, free: (0..columns * rows).map(open).collect() }
    }

    fn cell(&self, scenario: &ScenarioFile, place: &[f64]) -> usize {
        let index = |axis: usize, count: usize| {
            let low = scenario.domain.min.get(axis).copied().unwrap_or_default();
            let share = (place.get(axis).copied().unwrap_or(low) - low) / side(scenario, axis);
            ((share * count as f64) as usize).min(count - 1)
        };
        index(1, self.rows) * self.columns + index(0, self.columns)
    }

    /// Cells that can be reached from one, that one counted as free.
    fn flood(&self, from: usize) -> Vec<bool> {
        let mut reached = vec![false; self.free.len()];
        let mut edge = vec![from];
        while let Some(cell) = edge.pop() {
            let Some(mark) = reached.get_mut(cell).filter(|mark| !**mark) else { continue };
            *mark = true;
            let (column, row) = (cell % self.columns, cell / self.columns);
            let mut neighbours = Vec::with_capacity(4);
            neighbours.extend((column > 0).then(|| cell - 1));
            neighbours.extend((column + 1 < self.columns).then_some(cell + 1));
            neighbours.extend((row > 0).then(|| cell - self.columns));
            neighbours.extend((row + 1 < self.rows).then_some(cell + self.columns));
            edge.extend(neighbours.into_iter().filter(|next| self.free.get(*next).copied().unwrap_or(false)));
        }
        reached
    }
}

fn reach(scenario: &ScenarioFile, advice: &mut Advice) {
    let floor = Floor::of(scenario);
    let free = floor.free.iter().filter(|free| **free).count();
    if scenario.regions.is_empty() {
        return;
    }
    let percent = 100.0 * free as f64 / floor.free.len() as f64;
    advice.facts.push(("free space".into(), format!("{percent:.0} % of the domain, where regions always apply")));
    let mut seen = vec![false; floor.free.len()];
    for agent in &scenario.agents {
        let (start, goal) = (floor.cell(scenario, &agent.start), floor.cell(scenario, &agent.goal));
        let reached = floor.flood(start);
        // A goal at the edge of a region may have its cell's centre inside.
        let beside = [0, 1, floor.columns].into_iter().flat_map(|step| [goal.checked_sub(step), Some(goal + step)]);
        if !beside.flatten().any(|cell| reached.get(cell).copied().unwrap_or(false)) {
            advice.reachable = false;
            advice.say(
                format!("{} cannot reach its goal: regions that always apply close every way", agent.name),
                "move a region, make it smaller, or let it apply for a while only with `from` or `until`",
            );
        }
        seen.iter_mut().zip(&reached).for_each(|(seen, reached)| *seen |= reached);
    }
    let islands = floor.free.iter().zip(&seen).filter(|(free, seen)| **free && !**seen).count();
    if advice.reachable && islands * 100 > floor.free.len() {
        let percent = 100.0 * islands as f64 / floor.free.len() as f64;
        advice.say(
            format!("{percent:.0} % of the domain is free and cannot be reached: regions cut it off"),
            "that may be meant; no plan will go there",
        );
    }
}

fn room(scenario: &ScenarioFile, advice: &mut Advice) {
    let near = NEAR * longer(scenario);
    let unit_m = scenario.frame.unit_m;
    for agent in &scenario.agents {
        for (word, place) in [("start", &agent.start), ("goal", &agent.goal)] {
            let flat = [place.first().copied().unwrap_or_default(), place.get(1).copied().unwrap_or_default()];
            for region in &scenario.regions {
                let ring = region.outline.ring(CORNERS);
                let edges = ring.iter().zip(ring.iter().cycle().skip(1));
                let gap = edges.map(|(a, b)| off(flat, *a, *b)).fold(f64::INFINITY, f64::min);
                if gap < near {
                    advice.say(
                        format!(
                            "the {word} of {} is {} from the outline of {}",
                            agent.name,
                            units::length(gap * unit_m),
                            region.name
                        ),
                        "a vehicle is blown about: leave it room",
                    );
                }
            }
        }
    }
}

fn grid(scenario: &ScenarioFile, advice: &mut Advice) {
    let unit_m = scenario.frame.unit_m;
    let fastest = scenario.agents.iter().map(|agent| agent.speed_max).fold(0.0, f64::max);
    let straight =
        scenario.agents.iter().map(|agent| distance(&agent.start, &agent.goal) / agent.speed_max).fold(0.0, f64::max);
    let step = fastest * straight.max(scenario.time.target - scenario.start_time) / scenario.intervals as f64;
    advice.facts.push(("way in an interval".into(), format!("about {}", units::length(step * unit_m))));
    let places: Vec<&[f64]> = scenario.sensors.iter().map(first_place).collect();
    let gaps =
        places.iter().enumerate().flat_map(|(index, a)| places.iter().skip(index + 1).map(move |b| distance(a, b)));
    let gap = gaps.filter(|gap| *gap > 0.0).fold(f64::INFINITY, f64::min);
    if gap.is_finite() && step > gap {
        advice.say(
            format!(
                "an interval is longer than the way between two sensors: {} against {}",
                units::length(step * unit_m),
                units::length(gap * unit_m)
            ),
            "what lies between nodes is not seen: raise `grid.intervals`",
        );
    }
}

fn first_place(sensor: &SensorEntry) -> &[f64] {
    match &sensor.motion {
        MotionEntry::Fixed(position) => position,
        MotionEntry::Track(knots) => knots.first().map_or(&[], |knot| &knot.position),
    }
}

/// Whether location errors are asked for, and whether detection is.
fn wanted(scenario: &ScenarioFile) -> [bool; 2] {
    let metrics =
        || scenario.terms.iter().map(|term| term.metric).chain(scenario.limits.iter().map(|limit| limit.metric));
    [metrics().any(Metric::is_location_error), metrics().any(|metric| !metric.is_location_error())]
}

fn sensors(scenario: &ScenarioFile, advice: &mut Advice) -> Result<(), Box<FileError>> {
    let [location, detection] = wanted(scenario);
    for sensor in &scenario.sensors {
        // Those that have neither are warned about when the file is read.
        let (ranges, detects) = (sensor.ranging.is_some(), sensor.detection.is_some());
        if (ranges || detects) && !(ranges && location || detects && detection) {
            advice.say(
                format!("{} does nothing here: no objective and no limit asks for what it measures", sensor.name),
                "add a term or a limit, give it the other table, or leave it out",
            );
            continue;
        }
        let asked = scenario.terms.iter().any(|term| !term.metric.is_location_error());
        if !detects || !asked || (ranges && location) {
            continue;
        }
        let mut alone = scenario.clone();
        alone.sensors = vec![sensor.clone()];
        // What one sensor cannot give must not be asked for.
        alone.terms.retain(|term| !term.metric.is_location_error());
        alone.limits.clear();
        let mut highest = 0.0_f64;
        for time in [scenario.start_time, scenario.time.max] {
            let at = planning::View { time, ..view(scenario, Metric::Detection, COARSE) };
            highest = planning::landscape(&alone, &at)?.values.iter().copied().fold(highest, f64::max);
        }
        if highest < FAINT {
            advice.say(
                format!(
                    "{} hardly sees anything: its probability of detection is at most {highest:.1e} in the domain",
                    sensor.name
                ),
                "look at its `detection` numbers, its place, and `frame.unit_m`",
            );
        }
    }
    Ok(())
}

fn landscape(scenario: &ScenarioFile, advice: &mut Advice) -> Result<(), Box<FileError>> {
    let Some(metric) = scenario.terms.first().map(|term| term.metric) else { return Ok(()) };
    let at = view(scenario, metric, COARSE);
    let mut values: Vec<f64> = planning::landscape(scenario, &at)?.values;
    values.retain(|value| value.is_finite());
    values.sort_by(f64::total_cmp);
    let at =
        |share: f64| values.get((share * (values.len().max(1) - 1) as f64) as usize).copied().unwrap_or(f64::NAN);
    let (low, high) = (at(0.02), at(0.98));
    let shown = |value: f64| crate::picture::scale::trimmed(value);
    advice.facts.push((format!("{} in the domain", metric.name()), format!("{} to {}", shown(low), shown(high))));
    if high - low < FLAT * high.abs().max(low.abs()) {
        advice.say(
            format!("`{}` hardly differs from place to place: there is little to choose", metric.name()),
            "look at the sensors' numbers and `frame.unit_m`, or draw it with `quietpath landscape`",
        );
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCENARIO: &str = include_str!("../scenarios/square8-detection.toml");

    fn advice(change: impl Fn(&str) -> String) -> Advice {
        let text = change(SCENARIO);
        advise(&ScenarioFile::parse("s.toml", &text).unwrap().scenario).unwrap()
    }

    fn says(advice: &Advice, words: &str) -> bool {
        advice.items.iter().any(|(what, _)| what.contains(words))
    }

    #[test]
    fn a_good_scenario_gets_no_advice() {
        let advice = advice(str::to_owned);
        assert!(advice.items.is_empty() && advice.reachable, "{advice:?}");
    }

    #[test]
    fn a_wall_closes_every_way_and_a_gap_opens_it() {
        let wall = |to: f64| {
            advice(|text| {
                format!(
                    "{text}\n[[region]]\nname = \"wall\"\npolygon = [[4.9, -1.0], [5.1, -1.0], [5.1, {to}], [4.9, {to}]]\n"
                )
            })
        };
        assert!(!wall(11.0).reachable && says(&wall(11.0), "cannot reach its goal"));
        assert!(wall(9.5).reachable);
    }

    #[test]
    fn each_oddity_is_named() {
        let late =
            advice(|text| text.replace("max = 300.0", "max = 96.5").replace("target = 114.962255", "target = 50.0"));
        assert!(says(&late, "can hardly leave the straight line") && says(&late, "always pays"), "{late:?}");
        let coarse = advice(|text| text.replace("intervals = 60", "intervals = 3"));
        assert!(says(&coarse, "longer than the way between two sensors"), "{coarse:?}");
        let deaf = advice(|text| text.replace("scale = 0.3, epsilon", "scale = 0.000001, epsilon"));
        assert!(says(&deaf, "s1 hardly sees anything"), "{deaf:?}");
        let idle = advice(|text| {
            format!(
                "{text}\n[[sensor]]\nname = \"idle\"\nposition = [3.0, 9.0]\nranging = {{ model = \"rss\", scale = 1.0, path_loss = 2.0 }}\n"
            )
        });
        assert!(says(&idle, "idle does nothing here"), "{idle:?}");
        let near =
            advice(|text| format!("{text}\n[[region]]\nname = \"close\"\ncenter = [0.8, 2.05]\nradius = 1.0\n"));
        assert!(says(&near, "from the outline of close"), "{near:?}");
    }
}
