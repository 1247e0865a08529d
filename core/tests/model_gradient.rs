//! Gradients against central differences, in `f64`.
//!
//! Scenarios and plans are those of `tests/data/model_golden.txt`: both reference points, two and three dimensions,
//! received signal strength and time of arrival with odd exponents, both detectors, moving sensors, every beam and
//! betrayal, dropout, up to three agents, nodes within 0.1 to 2 softenings of a sensor, far away and in between.
//!
//! Differences are of sixth order, with steps in proportion to the distance from the nearest sensor. Large steps
//! suffer from the order, and from the edge of a beam, small ones from rounding: the best of five is taken.

mod made_up;
#[path = "made_up/pooling.rs"]
mod pooling;

use made_up::{Golden, Made, Plan, Stored, scenarios};
use quietpath_core::math::norm;
use quietpath_core::metrics::Sample;
use quietpath_core::objective::{Extreme, gradient, value};
use quietpath_core::scenario::{AgentSet, Betrayal, Reduce, ReferencePoint, Sense, Term, Window};
use quietpath_core::{Metric, Point};

/// Steps of the differences, relative to the distance over which figures change.
const STEPS: [f64; 5] = [2e-2, 5e-3, 1e-3, 2e-4, 4e-5];
/// Largest difference allowed, relative to the derivatives of the same kind at the same node.
const RELATIVE: f64 = 1e-6;

/// One number of a plan.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Entry {
    Time(usize),
    Path(usize, usize, usize),
    Jam(usize, usize),
    Azimuth(usize, usize),
    Dropout(usize, usize),
}

impl Entry {
    fn of<const DIM: usize>(self, plan: &mut Plan<f64, DIM>) -> &mut f64 {
        match self {
            Self::Time(node) => &mut plan.times[node],
            Self::Path(agent, node, axis) => &mut plan.tracks[agent].path[node][axis],
            Self::Jam(agent, node) => &mut plan.tracks[agent].jam[node],
            Self::Azimuth(agent, node) => &mut plan.tracks[agent].azimuth[node],
            Self::Dropout(agent, node) => &mut plan.tracks[agent].dropout[node],
        }
    }

    /// Entries that a difference is judged together with: the components of a position.
    fn siblings<const DIM: usize>(self) -> Vec<Self> {
        match self {
            Self::Path(agent, node, _) => (0..DIM).map(|axis| Self::Path(agent, node, axis)).collect(),
            other => vec![other],
        }
    }
}

fn entries<const DIM: usize>(made: &Made<DIM>, golden: &Golden<DIM>) -> Vec<Entry> {
    let mut all = Vec::new();
    let detected = |agent: usize, node: usize| {
        golden.values.iter().any(|entry| (entry.0, entry.1) == (agent, node) && entry.2[0] > Some(0.999))
    };
    for node in 0..golden.plan.nodes() {
        all.push(Entry::Time(node));
        for (agent, listed) in made.agents.iter().enumerate() {
            all.extend((0..DIM).map(|axis| Entry::Path(agent, node, axis)));
            if let Some(jammer) = listed.jammer {
                // Some betrayals have a kink in the level at 0, where only one side is asked for.
                let kink = match jammer.betrayal {
                    Betrayal::Max { .. } => true,
                    Betrayal::Linear => detected(agent, node),
                    Betrayal::None | Betrayal::Sigmoid => false,
                };
                let smooth = golden.plan.tracks[agent].jam[node] != 0.0 || !kink;
                all.extend(smooth.then_some(Entry::Jam(agent, node)));
                all.push(Entry::Azimuth(agent, node));
            }
            all.push(Entry::Dropout(agent, node));
        }
    }
    all
}

/// Distance over which figures change: that to the nearest sensor, softening included.
fn scale<const DIM: usize>(made: &Made<DIM>, stored: &Stored<f64, DIM>, plan: &Plan<f64, DIM>, entry: Entry) -> f64 {
    let view = stored.view();
    let nearest = |position: &Point<f64, DIM>, time: f64| {
        let gap = |sensor| norm(&(position - view.sensor_state(sensor, time).0)).hypot(made.softening);
        view.sensors.iter().map(gap).fold(f64::MAX, f64::min)
    };
    match entry {
        Entry::Path(agent, node, _) => {
            let position = &plan.tracks[agent].path[node];
            let now = nearest(position, plan.times[node]);
            // With a lagged reference point the sensors of the next instant count, too.
            plan.times.get(node + 1).map_or(now, |&next| now.min(nearest(position, next)))
        }
        Entry::Time(node) => {
            let gaps = plan.active().iter().map(|track| nearest(&track.path[node], plan.times[node]));
            // Made-up sensors move at less than one length unit a second.
            gaps.fold(1.0, f64::min)
        }
        Entry::Dropout(agent, node) => 1.0 - plan.tracks[agent].dropout[node],
        Entry::Jam(..) | Entry::Azimuth(..) => 0.3,
    }
}

/// Sixth-order central difference of `figure`.
fn central<const DIM: usize>(
    plan: &Plan<f64, DIM>,
    entry: Entry,
    step: f64,
    figure: &mut impl FnMut(&Plan<f64, DIM>) -> f64,
) -> f64 {
    let mut at = |steps: f64| {
        let mut moved = plan.clone();
        *entry.of(&mut moved) += steps * step;
        figure(&moved)
    };
    let mut odd = |steps: f64| at(steps) - at(-steps);
    (45.0 * odd(1.0) - 9.0 * odd(2.0) + odd(3.0)) / (60.0 * step)
}

/// Compares all entries; returns how many and the largest relative difference.
fn compare<const DIM: usize>(
    made: &Made<DIM>,
    golden: &Golden<DIM>,
    entries: &[Entry],
    extreme: Extreme<f64>,
    what: &str,
) -> (usize, f64) {
    let stored = made.stored().expect("a valid scenario");
    let view = stored.view();
    let mut scratch = [Sample::default(); 8];
    // What was there before must not matter.
    let mut analytic = golden.plan.clone();
    gradient(&view, &golden.plan, extreme, &mut scratch, &mut analytic);
    let mut worst = 0.0_f64;
    for &entry in entries {
        let mut figure = |plan: &Plan<f64, DIM>| value(&view, plan, extreme, &mut scratch);
        let (size, reach) = (figure(&golden.plan).abs(), scale(made, &stored, &golden.plan, entry));
        let ours = *entry.of(&mut analytic);
        let mut size_of = |entry: Entry| entry.of(&mut analytic).abs();
        let magnitude = entry.siblings::<DIM>().into_iter().map(&mut size_of).fold(0.0, f64::max);
        // Derivatives that are nothing beside the figure itself drown in its rounding.
        let magnitude = magnitude.max(1e-6 * size / reach).max(1e-300);
        let (mut difference, mut numeric) = (f64::INFINITY, 0.0);
        for step in STEPS {
            let found = central(&golden.plan, entry, step * reach, &mut figure);
            if (ours - found).abs() / magnitude < difference {
                (difference, numeric) = ((ours - found).abs() / magnitude, found);
            }
        }
        assert!(difference <= RELATIVE, "{} {what} {entry:?}: {ours} is not {numeric}, {difference:.1e}", made.name);
        worst = worst.max(difference);
    }
    (entries.len(), worst)
}

/// Every metric alone, at one node alone.
fn each_metric<const DIM: usize>(made: &Made<DIM>) -> (usize, f64) {
    each_of(made, &Metric::ALL)
}

/// Each of some metrics alone, at one node alone.
fn each_of<const DIM: usize>(made: &Made<DIM>, metrics: &[Metric]) -> (usize, f64) {
    let (mut count, mut worst) = (0, 0.0_f64);
    for golden in &made.plans {
        for node in 1..golden.plan.nodes() {
            for &metric in metrics {
                let has = golden.values.iter().any(|(_, _, values)| {
                    Metric::ALL.iter().zip(values).any(|(other, value)| *other == metric && value.is_some())
                });
                if !has {
                    continue;
                }
                let time = golden.plan.times[node];
                let mut alone = made.clone();
                alone.time.penalty = 0.0;
                alone.terms = vec![Term {
                    metric,
                    sense: if node % 2 == 0 { Sense::Minimize } else { Sense::Maximize },
                    reduce: Reduce::Integral,
                    weight: 1.0,
                    agents: AgentSet::ALL,
                    window: Window { from: time - 1.0, until: time + 1.0 },
                }];
                let near = |entry: &Entry| match *entry {
                    Entry::Time(at) | Entry::Path(_, at, _) => at == node || at + 1 == node,
                    Entry::Jam(_, at) | Entry::Azimuth(_, at) | Entry::Dropout(_, at) => at == node,
                };
                let entries: Vec<_> = entries(made, golden).into_iter().filter(near).collect();
                let what = format!("{} at node {node}", metric.name());
                let found = compare(&alone, golden, &entries, Extreme::Exact, &what);
                (count, worst) = (count + found.0, worst.max(found.1));
            }
        }
    }
    (count, worst)
}

/// The whole objective with its own terms, extreme terms exact and smooth.
fn whole_objective<const DIM: usize>(made: &Made<DIM>) -> (usize, f64) {
    let (mut count, mut worst) = (0, 0.0_f64);
    let mut made = made.clone();
    // The penalty has a kink at its target.
    made.time.target -= 3.0;
    for golden in &made.plans {
        let entries = entries(&made, golden);
        for extreme in [Extreme::Exact, Extreme::Smooth { sharpness: 0.3 }] {
            if extreme == Extreme::Exact && tied(&made, golden) {
                continue;
            }
            let found = compare(&made, golden, &entries, extreme, &format!("{extreme:?}"));
            (count, worst) = (count + found.0, worst.max(found.1));
        }
    }
    (count, worst)
}

/// Whether an extreme term has two nodes so close to its worst value that a difference could change which it is.
fn tied<const DIM: usize>(made: &Made<DIM>, golden: &Golden<DIM>) -> bool {
    made.terms.iter().filter(|term| term.reduce == Reduce::Extreme).any(|term| {
        (0..made.agents.len()).any(|agent| {
            let sign = if term.sense == Sense::Minimize { 1.0 } else { -1.0 };
            let at_node = golden.values.iter().filter(|(of, node, _)| *of == agent && *node > 0);
            let metric = Metric::ALL.iter().position(|metric| *metric == term.metric).unwrap_or_default();
            let mut values: Vec<_> = at_node.filter_map(|(_, _, values)| Some(sign * values[metric]?)).collect();
            values.sort_by(f64::total_cmp);
            let (worst, second) = (values.pop().unwrap_or_default(), values.pop().unwrap_or_default());
            worst - second < 0.1 * worst.abs()
        })
    })
}

/// Runs a comparison over all scenarios and prints what it found.
fn over_all(what: &str, flat: fn(&Made<2>) -> (usize, f64), high: fn(&Made<3>) -> (usize, f64), least: usize) {
    let found: Vec<_> = scenarios::<2>().iter().map(flat).chain(scenarios::<3>().iter().map(high)).collect();
    let compared: usize = found.iter().map(|entry| entry.0).sum();
    let worst = found.iter().map(|entry| entry.1).fold(0.0, f64::max);
    println!("{what}: {compared} derivatives, worst relative difference {worst:.1e}");
    assert!(compared >= least, "only {compared} derivatives of {what} compared");
}

#[test]
fn metrics_one_by_one() {
    over_all("metrics", each_metric::<2>, each_metric::<3>, 10_000);
}

/// The same again with the other reference point.
#[test]
fn metrics_one_by_one_at_the_other_reference_point() {
    fn turned<const DIM: usize>(made: &Made<DIM>) -> (usize, f64) {
        let mut made = made.clone();
        made.reference_point = match made.reference_point {
            ReferencePoint::Current => ReferencePoint::Lagged,
            ReferencePoint::Lagged => ReferencePoint::Current,
        };
        each_metric(&made)
    }
    over_all("metrics", turned::<2>, turned::<3>, 10_000);
}

/// Detection and false alarms of pooled sensors, every other detector an energy detector.
#[test]
fn pooled_detection() {
    fn pooled<const DIM: usize>(made: &Made<DIM>) -> (usize, f64) {
        let found = pooling::pooled(made).map(|made| each_of(&made, &[Metric::Detection, Metric::FalseAlarm]));
        found.iter().fold((0, 0.0), |sum, entry| (sum.0 + entry.0, f64::max(sum.1, entry.1)))
    }
    over_all("pooled metrics", pooled::<2>, pooled::<3>, 5_000);
}

#[test]
fn whole_objectives() {
    over_all("objectives", whole_objective::<2>, whole_objective::<3>, 1000);
}
