//! Second derivatives against central differences of the gradient, and first ones against the gradient, in `f64`.
//!
//! Scenarios and plans are those of `tests/data/model_golden.txt`, as in `model_gradient.rs`: each metric alone at each
//! node alone, by everything that each agent does there, both reference points.

mod made_up;
#[path = "made_up/pooling.rs"]
mod pooling;

use made_up::{Golden, Made, Plan, Stored, scenarios};
use quietpath_core::jet::Jet;
use quietpath_core::math::norm;
use quietpath_core::metrics::{Needs, Sample, Values};
use quietpath_core::objective::curvature::{
    Extremes, Integrals, Single, Slope, Slopes, Variables, Weigh, Weighted, node_curvature,
};
use quietpath_core::objective::{Extreme, gradient, node_values};
use quietpath_core::scenario::{AgentSet, Betrayal, Reduce, ReferencePoint, Sense, Term, View, Window};
use quietpath_core::{Metric, Point};

/// Steps of the differences, relative to the distance over which figures change.
const STEPS: [f64; 4] = [2e-2, 5e-3, 1e-3, 2e-4];
/// Largest difference allowed between first derivatives, relative to those of the same kind.
const FIRST: f64 = 1e-9;
/// The same for second derivatives and differences of first ones.
const SECOND: f64 = 1e-5;
/// The same for the few where the weights of the sensors lie many orders of magnitude apart.
const LOOSE: f64 = 1e-2;
/// How many those may be, of all.
const LOOSE_SHARE: f64 = 3e-3;

/// What comparisons found.
#[derive(Clone, Copy, Debug, Default)]
struct Found {
    compared: usize,
    loose: usize,
    worst: f64,
}

impl Found {
    fn enter(&mut self, difference: f64) {
        self.compared += 1;
        self.loose += usize::from(difference > SECOND);
        self.worst = self.worst.max(difference);
    }

    fn and(self, other: Self) -> Self {
        Self {
            compared: self.compared + other.compared,
            loose: self.loose + other.loose,
            worst: self.worst.max(other.worst),
        }
    }
}

/// What one variable is.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Position(usize),
    Reference(usize),
    Level,
    Azimuth,
    Dropout,
    Time,
}

const fn everything(dim: usize) -> Variables {
    Variables {
        position: Some(0),
        reference: Some(dim),
        level: Some(2 * dim),
        azimuth: Some(2 * dim + 1),
        dropout: Some(2 * dim + 2),
        time: Some(2 * dim + 3),
    }
}

fn kind(dim: usize, index: usize) -> Kind {
    match index {
        index if index < dim => Kind::Position(index),
        index if index < 2 * dim => Kind::Reference(index - dim),
        index => [Kind::Level, Kind::Azimuth, Kind::Dropout, Kind::Time][index - 2 * dim],
    }
}

impl Kind {
    fn of<const DIM: usize>(self, plan: &mut Plan<f64, DIM>, agent: usize, node: usize) -> &mut f64 {
        let track = &mut plan.tracks[agent];
        match self {
            Self::Position(axis) => &mut track.path[node][axis],
            Self::Reference(axis) => &mut track.path[node - 1][axis],
            Self::Level => &mut track.jam[node],
            Self::Azimuth => &mut track.azimuth[node],
            Self::Dropout => &mut track.dropout[node],
            Self::Time => &mut plan.times[node],
        }
    }

    /// Whether two variables are components of the same thing.
    fn is_akin(self, other: Self) -> bool {
        std::mem::discriminant(&self) == std::mem::discriminant(&other)
    }
}

/// Distance over which figures change, by one variable.
fn reach<const DIM: usize>(
    made: &Made<DIM>,
    view: &View<'_, f64, DIM>,
    plan: &Plan<f64, DIM>,
    (agent, node): (usize, usize),
    kind: Kind,
) -> f64 {
    let nearest = |position: &Point<f64, DIM>| {
        let gap = |sensor| norm(&(position - view.sensor_state(sensor, plan.times[node]).0)).hypot(made.softening);
        view.sensors.iter().map(gap).fold(f64::MAX, f64::min)
    };
    let track = &plan.tracks[agent];
    match kind {
        Kind::Position(_) => nearest(&track.path[node]),
        Kind::Reference(_) => nearest(&track.path[node - 1]),
        Kind::Level | Kind::Azimuth => 0.3,
        Kind::Dropout => 1.0 - track.dropout[node],
        Kind::Time => {
            let all = plan.active().iter().flat_map(|track| [track.path[node], track.path[node - 1]]);
            all.map(|position| nearest(&position)).fold(1.0, f64::min)
        }
    }
}

/// Gradient of the sum of the integrands at a node, the only one in the terms' window, by the variables of `agent`.
fn slopes<const DIM: usize, const M: usize>(
    view: &View<'_, f64, DIM>,
    plan: &Plan<f64, DIM>,
    (agent, node): (usize, usize),
) -> [f64; M] {
    let mut scratch = [Sample::default(); 8];
    let mut found = plan.clone();
    gradient(view, plan, Extreme::Exact, &mut scratch, &mut found);
    let interval = plan.times[node] - plan.times[node - 1];
    // The earlier time enters through the interval alone.
    found.times[node] += found.times[node - 1];
    let entry = |index| *kind(DIM, index).of(&mut found, agent, node) / interval;
    let mut slopes: [f64; M] = std::array::from_fn(entry);
    if view.frame.reference_point == ReferencePoint::Current {
        slopes[DIM..2 * DIM].fill(0.0);
    }
    slopes
}

/// Sixth-order difference of the slopes by variable `index`, with the given step.
fn central<const DIM: usize, const M: usize>(
    view: &View<'_, f64, DIM>,
    plan: &Plan<f64, DIM>,
    at: (usize, usize),
    index: usize,
    step: f64,
) -> [f64; M] {
    let mut sum = [0.0; M];
    for (steps, factor) in [(1.0, 45.0), (2.0, -9.0), (3.0, 1.0)] {
        for side in [1.0, -1.0] {
            let mut moved = plan.clone();
            *kind(DIM, index).of(&mut moved, at.0, at.1) += side * steps * step;
            for (entry, slope) in sum.iter_mut().zip(slopes::<DIM, M>(view, &moved, at)) {
                *entry += side * factor * slope / (60.0 * step);
            }
        }
    }
    sum
}

/// Compares value, gradient and Hessian at one node by the variables of one agent.
fn compare<const DIM: usize, const M: usize>(
    made: &Made<DIM>,
    golden: &Golden<DIM>,
    at: (usize, usize),
    what: &str,
) -> Found {
    let stored: Stored<f64, DIM> = made.stored().expect("a valid scenario");
    let view = stored.view();
    let plan = &golden.plan;
    let mut scratch = [Sample::default(); 8];
    let weigh = Integrals { scenario: &view, time: plan.times[at.1] };
    let variables = everything(DIM);
    let jet: Jet<f64, M> = node_curvature(&view, plan, at.0, at.1, &variables, &weigh, &mut scratch);
    let reaches: [f64; M] = std::array::from_fn(|index| reach(made, &view, plan, at, kind(DIM, index)));
    let akin = |index: usize| (0..M).filter(move |other| kind(DIM, *other).is_akin(kind(DIM, index)));
    let slopes: [f64; M] = slopes(&view, plan, at);
    let largest = |index: usize| akin(index).map(|other| slopes[other].abs()).fold(0.0, f64::max);
    for a in 0..M {
        let magnitude = largest(a).max(1e-3 * jet.value.abs() / reaches[a]).max(1e-300);
        let difference = (jet.gradient[a] - slopes[a]).abs() / magnitude;
        assert!(
            difference <= FIRST,
            "{} {what} {:?}: {} is not {}",
            made.name,
            kind(DIM, a),
            jet.gradient[a],
            slopes[a]
        );
    }
    let kinked = kink(made, golden, at);
    let mut found = Found::default();
    for b in (0..M).filter(|index| !(kinked && kind(DIM, *index) == Kind::Level)) {
        let tried = STEPS.map(|step| central::<DIM, M>(&view, plan, at, b, step * reaches[b]));
        for a in 0..M {
            assert_eq!(jet.hessian[a][b], jet.hessian[b][a]);
            let block = akin(a).flat_map(|row| akin(b).map(move |column| jet.hessian[row][column].abs()));
            let small = (1e-5 * largest(a) / reaches[b]).max(1e-7 * jet.value.abs() / (reaches[a] * reaches[b]));
            // Variables that hardly interact: beside what they do alone, a mixed derivative drowns in rounding.
            let own = |index| akin(index).map(|row| jet.hessian[row][row].abs()).fold(0.0, f64::max);
            let small = small.max(1e-6 * f64::sqrt(own(a) * own(b)));
            let magnitude = block.fold(small, f64::max).max(1e-300);
            let difference =
                tried.iter().map(|column| (column[a] - jet.hessian[a][b]).abs() / magnitude).fold(f64::MAX, f64::min);
            let pair = (kind(DIM, a), kind(DIM, b));
            assert!(
                difference <= LOOSE,
                "{} {what} {pair:?}: {} is not {:?}, {difference:.1e}",
                made.name,
                jet.hessian[a][b],
                tried.map(|column| column[a])
            );
            found.enter(difference);
        }
    }
    found
}

/// Whether the level has a kink at 0, as in `model_gradient.rs`.
fn kink<const DIM: usize>(made: &Made<DIM>, golden: &Golden<DIM>, (agent, node): (usize, usize)) -> bool {
    let detected = golden.values.iter().any(|entry| (entry.0, entry.1) == (agent, node) && entry.2[0] > Some(0.999));
    golden.plan.tracks[agent].jam[node] == 0.0
        && match made.agents[agent].jammer.map(|jammer| jammer.betrayal) {
            Some(Betrayal::Max { .. }) => true,
            Some(Betrayal::Linear) => detected,
            _ => false,
        }
}

/// The scenario with one metric as its objective, at one node alone.
fn alone<const DIM: usize>(made: &Made<DIM>, metric: Metric, time: f64, sense: Sense) -> Made<DIM> {
    let mut alone = made.clone();
    alone.time.penalty = 0.0;
    alone.terms = vec![Term {
        metric,
        sense,
        reduce: Reduce::Integral,
        weight: 1.0,
        agents: AgentSet::ALL,
        window: Window { from: time - 1.0, until: time + 1.0 },
    }];
    alone
}

fn metrics_of<const DIM: usize>(golden: &Golden<DIM>) -> Vec<Metric> {
    let has = |index: usize| golden.values.iter().any(|(_, _, values)| values[index].is_some());
    Metric::ALL.into_iter().enumerate().filter(|(index, _)| has(*index)).map(|(_, metric)| metric).collect()
}

fn each_metric<const DIM: usize, const M: usize>(made: &Made<DIM>) -> Found {
    let mut found = Found::default();
    for golden in &made.plans {
        for node in 1..golden.plan.nodes() {
            for metric in metrics_of(golden) {
                let sense = if node % 2 == 0 { Sense::Minimize } else { Sense::Maximize };
                let alone = alone(made, metric, golden.plan.times[node], sense);
                for agent in 0..made.agents.len() {
                    let what = format!("{} of agent {agent} at node {node}", metric.name());
                    found = found.and(compare::<DIM, M>(&alone, golden, (agent, node), &what));
                }
            }
        }
    }
    found
}

/// Detection and false alarms of pooled sensors, in the plane and in space.
#[test]
fn pooled_detection() {
    fn pooled<const DIM: usize, const M: usize>(made: &Made<DIM>) -> Found {
        let mut found = Found::default();
        for made in pooling::pooled(made) {
            for (golden, node) in
                made.plans.iter().flat_map(|golden| (1..golden.plan.nodes()).map(move |n| (golden, n)))
            {
                for metric in [Metric::Detection, Metric::FalseAlarm] {
                    let alone = alone(&made, metric, golden.plan.times[node], Sense::Minimize);
                    for agent in 0..made.agents.len() {
                        let what = format!("{:?} {} of agent {agent} at node {node}", made.pooling, metric.name());
                        found = found.and(compare::<DIM, M>(&alone, golden, (agent, node), &what));
                    }
                }
            }
        }
        found
    }
    let flat = scenarios().iter().map(pooled::<2, 8>).fold(Found::default(), Found::and);
    report("pooled metrics", [flat].into_iter().chain(scenarios().iter().map(pooled::<3, 10>)));
}

fn turned<const DIM: usize>(made: &Made<DIM>) -> Made<DIM> {
    let mut made = made.clone();
    made.reference_point = match made.reference_point {
        ReferencePoint::Current => ReferencePoint::Lagged,
        ReferencePoint::Lagged => ReferencePoint::Current,
    };
    made
}

fn report(what: &str, found: impl Iterator<Item = Found>) {
    let Found { compared, loose, worst } = found.fold(Found::default(), Found::and);
    println!(
        "{what}: {compared} second derivatives, worst relative difference {worst:.1e}, {loose} above {SECOND:.0e}"
    );
    assert!(compared >= 50_000, "only {compared} second derivatives of {what} compared");
    assert!((loose as f64) <= LOOSE_SHARE * compared as f64, "{loose} of {compared} {what} are loose");
}

#[test]
fn metrics_in_the_plane() {
    report("metrics in the plane", scenarios().iter().map(each_metric::<2, 8>));
}

#[test]
fn metrics_in_the_plane_at_the_other_reference_point() {
    report("metrics in the plane, turned", scenarios().iter().map(|made| each_metric::<2, 8>(&turned(made))));
}

#[test]
fn metrics_in_space() {
    report("metrics in space", scenarios().iter().map(each_metric::<3, 10>));
}

#[test]
fn metrics_in_space_at_the_other_reference_point() {
    report("metrics in space, turned", scenarios().iter().map(|made| each_metric::<3, 10>(&turned(made))));
}

/// Fewer variables, in any order and in the layout that has a path of its own, give the same derivatives.
fn fewer_variables<const DIM: usize, const M: usize>(made: &Made<DIM>) {
    let stored = made.stored().expect("a valid scenario");
    let view = stored.view();
    let mut scratch = [Sample::default(); 8];
    for golden in &made.plans {
        for (agent, node) in (0..made.agents.len()).flat_map(|agent| (1..3).map(move |node| (agent, node))) {
            let weigh = Integrals { scenario: &view, time: golden.plan.times[node] };
            let mut at =
                |variables| node_curvature(&view, &golden.plan, agent, node, &variables, &weigh, &mut scratch);
            let whole: Jet<f64, M> = at(everything(DIM));
            let alone: Jet<f64, DIM> =
                node_curvature(&view, &golden.plan, agent, node, &Variables::POSITION, &weigh, &mut scratch);
            let size = whole.hessian.iter().take(DIM).flatten().fold(1e-300, |size, entry| entry.abs().max(size));
            for a in 0..DIM {
                for b in 0..DIM {
                    let difference = (whole.hessian[a][b] - alone.hessian[a][b]).abs();
                    assert!(difference <= 1e-9 * size, "{} {agent} {node}: {difference:e} of {size:e}", made.name);
                }
            }
            let turned: Jet<f64, 3> = node_curvature(
                &view,
                &golden.plan,
                agent,
                node,
                &Variables { dropout: Some(0), azimuth: Some(2), level: Some(1), ..Variables::default() },
                &weigh,
                &mut scratch,
            );
            for (a, from) in [2 * DIM + 2, 2 * DIM, 2 * DIM + 1].into_iter().enumerate() {
                let size = whole.gradient[from].abs().max(1e-12);
                assert!((turned.gradient[a] - whole.gradient[from]).abs() <= 1e-9 * size, "{}", made.name);
            }
        }
    }
}

#[test]
fn fewer_variables_give_the_same() {
    scenarios::<2>().iter().for_each(fewer_variables::<2, 8>);
    scenarios::<3>().iter().for_each(fewer_variables::<3, 10>);
}

/// A single metric of one agent by itself: its value, and by another agent's jammer.
fn single_metrics<const DIM: usize, const M: usize>(made: &Made<DIM>) -> usize {
    let stored = made.stored().expect("a valid scenario");
    let view = stored.view();
    let mut scratch = [Sample::default(); 8];
    let mut across = 0;
    for golden in &made.plans {
        for metric in metrics_of(golden) {
            for (agent, node) in (0..made.agents.len()).flat_map(|agent| (1..4).map(move |node| (agent, node))) {
                let single = Single { agent, metric };
                let mut at = |varied, variables| -> Jet<f64, M> {
                    node_curvature(&view, &golden.plan, varied, node, &variables, &single, &mut scratch)
                };
                let own = at(agent, everything(DIM));
                let value = node_values(&view, &golden.plan, agent, node, &mut [Sample::default(); 8]).get(metric);
                let value = value.expect("a metric that the plan has");
                assert!((own.value - value).abs() <= 1e-12 * value.abs(), "{} {}", made.name, metric.name());
                let other = (agent + 1) % made.agents.len();
                if other != agent && made.agents[other].jammer.is_some() && metric.is_location_error() {
                    // Raising an own level must change the other's figure by the same as a difference does.
                    let by = at(other, everything(DIM)).gradient[2 * DIM];
                    let shifted = |step: f64| {
                        let mut plan = golden.plan.clone();
                        plan.tracks[other].jam[node] += step;
                        node_values(&view, &plan, agent, node, &mut [Sample::default(); 8])
                            .get(metric)
                            .expect("a metric")
                    };
                    let numeric =
                        [1e-4, 1e-5, 1e-6, 1e-7].map(|step| (shifted(step) - shifted(-step)) / (2.0 * step));
                    let gap = numeric.iter().map(|found| (by - found).abs()).fold(f64::MAX, f64::min);
                    assert!(gap <= 1e-5 * by.abs().max(1e-3 * value.abs()), "{by} {numeric:?}");
                    across += usize::from(by.abs() > 1e-3 * value.abs());
                }
            }
        }
    }
    across
}

#[test]
fn single_metrics_have_their_values_and_feel_others_jamming() {
    let flat: usize = scenarios::<2>().iter().map(single_metrics::<2, 8>).sum();
    let high: usize = scenarios::<3>().iter().map(single_metrics::<3, 10>).sum();
    assert!(flat + high > 50, "{flat} {high}");
}

/// Slope and bend of a function of a metric, as of a barrier: here -ln(2 E0 - E).
#[derive(Clone, Copy)]
struct Barrier {
    metric: Metric,
    bound: f64,
}

impl Weigh<f64> for Barrier {
    fn needs(&self, _: usize) -> Needs {
        let mut needs = Needs::default();
        needs.add(self.metric);
        needs
    }
    fn add_slopes(&self, _: usize, values: &Values<f64>, slopes: &mut Slopes<f64>) {
        let slack = self.bound - values.get(self.metric).expect("a metric");
        slopes
            .push(Slope { metric: self.metric, first: 1.0 / slack, second: 1.0 / (slack * slack) })
            .expect("room for one");
    }
}

#[test]
fn a_barrier_has_the_second_derivatives_of_its_chain() {
    let mut compared = 0;
    for made in scenarios::<2>() {
        let stored = made.stored().expect("a valid scenario");
        let view = stored.view();
        let mut scratch = [Sample::default(); 8];
        let golden = &made.plans[0];
        for metric in metrics_of(golden) {
            let single = Single { agent: 0, metric };
            let mut only = golden.plan.clone();
            only.resize(made.intervals, 1).unwrap();
            let plain: Jet<f64, 2> = node_curvature(&view, &only, 0, 3, &Variables::POSITION, &single, &mut scratch);
            let barrier = Barrier { metric, bound: plain.value + plain.value.abs() + 0.1 };
            let slack = barrier.bound - plain.value;
            let bent: Jet<f64, 2> = node_curvature(&view, &only, 0, 3, &Variables::POSITION, &barrier, &mut scratch);
            for a in 0..2 {
                for b in 0..2 {
                    let chain = plain.hessian[a][b] / slack + plain.gradient[a] * plain.gradient[b] / (slack * slack);
                    let size = plain.hessian[a][a].abs() / slack + (plain.gradient[a] / slack).powi(2) + chain.abs();
                    assert!((bent.hessian[a][b] - chain).abs() <= 1e-10 * size.max(1e-300), "{}", metric.name());
                    compared += 1;
                }
            }
        }
    }
    assert!(compared >= 100, "{compared}");
}

/// The whole objective with smooth extremes: what `Weighted` gives, less the square of each term's gradient.
#[test]
fn smooth_extremes_leave_the_square_of_their_gradient() {
    let sharpness = 0.7;
    let mut compared = 0;
    for made in scenarios::<2>() {
        if made.reference_point == ReferencePoint::Lagged || made.agents.len() > 1 {
            continue;
        }
        let mut made = made.clone();
        let metric = if made.sensors.iter().any(|sensor| sensor.ranging.is_some()) {
            Metric::LogCep
        } else {
            Metric::Detection
        };
        let mut term = alone(&made, metric, 0.0, Sense::Maximize).terms[0];
        (term.window, term.reduce, term.weight) = (Window::always(), Reduce::Extreme, 1.7);
        made.terms = vec![term];
        let stored = made.stored().expect("a valid scenario");
        let view = stored.view();
        let mut scratch = [Sample::default(); 8];
        let extreme = Extreme::Smooth { sharpness };
        let plan = &made.plans[0].plan;
        let extremes = Extremes::new(&view, plan, extreme, &mut scratch);
        let mut slope = plan.clone();
        gradient(&view, plan, extreme, &mut scratch, &mut slope);
        for node in 1..plan.nodes() {
            let (time, interval) = (plan.times[node], plan.times[node] - plan.times[node - 1]);
            let weigh = Weighted { scenario: &view, extremes: &extremes, node, time, interval };
            let jet: Jet<f64, 2> = node_curvature(&view, plan, 0, node, &Variables::POSITION, &weigh, &mut scratch);
            let here = slope.tracks[0].path[node];
            let weight = 1.7 * made.agents[0].weight;
            let reach = reach(&made, &view, plan, (0, node), Kind::Position(0));
            for a in 0..2 {
                assert!((jet.gradient[a] - here[a]).abs() <= 1e-9 * norm(&here), "{node}: {:?} {here}", jet.gradient);
                for b in 0..2 {
                    let step = 1e-4 * reach;
                    let mut shifted = |side: f64| {
                        let mut moved = plan.clone();
                        moved.tracks[0].path[node][b] += side * step;
                        let mut found = plan.clone();
                        gradient(&view, &moved, extreme, &mut scratch, &mut found);
                        found.tracks[0].path[node][a]
                    };
                    let numeric =
                        (8.0 * (shifted(1.0) - shifted(-1.0)) - (shifted(2.0) - shifted(-2.0))) / (12.0 * step);
                    let ours = jet.hessian[a][b] - sharpness / weight * here[a] * here[b];
                    let size = jet.hessian[0][0].abs().max(jet.hessian[1][1].abs()).max(norm(&here) / reach);
                    assert!((ours - numeric).abs() <= 1e-5 * size, "{} {node}: {ours} {numeric}", made.name);
                    compared += 1;
                }
            }
        }
    }
    assert!(compared >= 30, "{compared}");
}
