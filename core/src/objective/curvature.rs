//! Second derivatives of a node's part of the objective, by what one agent does there.
//!
//! | symbol | name | shape |
//! |---|---|---|
//! | u | [`Variables`]: x_i, r0, z_i, alpha_i, theta_i of one agent, and t_i | `M` |
//! | E_km(u) | metric m of agent k at the node | |
//! | psi_km | what is made of it | |
//!
//! [`node_curvature`] differentiates phi(u) = sum of psi_km(E_km(u)) twice:
//! phi_a = sum of psi' E_a, and phi_ab = sum of psi' E_ab + psi'' E_a E_b. What psi is, a [`Weigh`] says by its
//! derivatives at the node: [`Single`] is one metric (for limits), [`Integrals`] the integrands of the objective,
//! [`Weighted`] everything that the objective makes of the node. A barrier on a limit is a slope and a bend more.
//!
//! An integral is a sum of h_i E(u_i): its mixed derivative by h_i and u_i is the gradient that `Integrals` gives.
//! Smooth extreme terms couple the nodes; `Weighted` gives the part that is the node's own, and what is left is
//! minus `sharpness` / W times the square of the whole term's gradient, W its weight times the agent's.
//!
//! Other agents' figures are part of phi where they depend on the variables: through this agent's jamming, or
//! through sensors that move with the node time. Their derivatives by their own variables are not asked for.
//!
//! Source: sections 2.3, 3.1, 3.2 and 4.1. Limits: kinks (a proxy detector at 1, a variance that is held, the edge of
//! a beam, capped betrayal) have the derivatives of one side. `M` too small for the variables leaves those past it
//! out.

use heapless::Vec;

use super::merit::Merit;
use super::tally::{self, Tally, Which};
use super::{Emitters, Extreme, lay_emitters, situation, survey};
use crate::jet::Jet;
use crate::math::Real;
use crate::metrics::curvature::{Around, Focus, LocationJets, detection, false_alarm, location};
use crate::metrics::{Adjoint, Needs, Sample, Situation, Values, forward, place};
use crate::model::jamming::Emitter;
use crate::scenario::{LIMITS_MAX, Metric, TERMS_MAX, View};
use crate::trajectory::Trajectory;

pub use crate::metrics::Variables;

/// Slopes that a [`Weigh`] can give for one agent: a term each, a limit each.
pub const SLOPES_MAX: usize = TERMS_MAX + LIMITS_MAX;

/// The derivatives of what is made of a metric, at its value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slope<T> {
    /// The metric.
    pub metric: Metric,
    /// psi', per unit of the metric.
    pub first: T,
    /// psi'', per unit of the metric squared.
    pub second: T,
}

/// Slopes of one agent's metrics; those of the same metric add up.
pub type Slopes<T> = Vec<Slope<T>, SLOPES_MAX>;

/// What is made of the metrics of a node.
pub trait Weigh<T> {
    /// Groups of figures of `agent` that have slopes.
    fn needs(&self, agent: usize) -> Needs;

    /// Adds the slopes at the values that the figures have; those that were not needed are zero or `None`.
    fn add_slopes(&self, agent: usize, values: &Values<T>, slopes: &mut Slopes<T>);
}

/// One metric of one agent, as it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Single {
    /// Whose metric.
    pub agent: usize,
    /// Which.
    pub metric: Metric,
}

impl<T: Real> Weigh<T> for Single {
    fn needs(&self, agent: usize) -> Needs {
        let mut needs = Needs::default();
        if agent == self.agent {
            needs.add(self.metric);
        }
        needs
    }

    fn add_slopes(&self, agent: usize, _: &Values<T>, slopes: &mut Slopes<T>) {
        if agent == self.agent {
            let _ = slopes.push(Slope { metric: self.metric, first: T::one(), second: T::zero() });
        }
    }
}

/// The integrands of the objective at a time: sign, weight and agent weight, without the interval.
#[derive(Clone, Copy, Debug)]
pub struct Integrals<'a, T, const DIM: usize> {
    /// The problem.
    pub scenario: &'a View<'a, T, DIM>,
    /// The node's time, s.
    pub time: T,
}

impl<T: Real, const DIM: usize> Weigh<T> for Integrals<'_, T, DIM> {
    #[inline]
    fn needs(&self, agent: usize) -> Needs {
        tally::needs(self.scenario, agent, self.time, Which::Integrals)
    }

    #[inline]
    fn add_slopes(&self, agent: usize, _: &Values<T>, slopes: &mut Slopes<T>) {
        tally::integral_slopes(self.scenario, agent, self.time, T::one(), slopes);
    }
}

/// The worst values along a path, from which the share of each node follows.
#[derive(Clone, Copy, Debug)]
pub struct Extremes<T, const AGENTS: usize>(Tally<T, AGENTS>);

impl<T: Real, const AGENTS: usize> Extremes<T, AGENTS> {
    /// Visits all nodes once, where there are terms that are reduced to their worst value.
    pub fn new<const DIM: usize, const NODES: usize>(
        scenario: &View<'_, T, DIM>,
        trajectory: &Trajectory<T, DIM, NODES, AGENTS>,
        extreme: Extreme<T>,
        scratch: &mut [Sample<T, DIM>],
    ) -> Self {
        let merit = Merit::plain(extreme);
        let mut tally = Tally::new(&merit);
        survey(scenario, trajectory, Which::Extremes, &merit, (&mut tally, &mut T::zero()), scratch);
        Self(tally)
    }
}

/// Everything that the objective makes of one node: integral terms times the interval, extreme terms times the
/// node's share, and the node's own part of the bend that smoothing brings.
#[derive(Clone, Copy, Debug)]
pub struct Weighted<'a, T, const DIM: usize, const AGENTS: usize> {
    /// The problem.
    pub scenario: &'a View<'a, T, DIM>,
    /// The worst values along the path.
    pub extremes: &'a Extremes<T, AGENTS>,
    /// The node.
    pub node: usize,
    /// Its time t_i, s.
    pub time: T,
    /// Its interval h_i, s.
    pub interval: T,
}

impl<T: Real, const DIM: usize, const AGENTS: usize> Weigh<T> for Weighted<'_, T, DIM, AGENTS> {
    #[inline]
    fn needs(&self, agent: usize) -> Needs {
        tally::needs(self.scenario, agent, self.time, Which::All)
    }

    #[inline]
    fn add_slopes(&self, agent: usize, values: &Values<T>, slopes: &mut Slopes<T>) {
        tally::integral_slopes(self.scenario, agent, self.time, self.interval, slopes);
        self.extremes.0.extreme_slopes(self.scenario, agent, self.node, self.time, values, slopes);
    }
}

/// phi at `node` with its first and second derivatives by the `variables` of `agent`.
///
/// `value` is the sum of psi' E, phi itself where psi is linear. A node or agent that does not exist has no part in
/// phi. `scratch` needs one entry a sensor.
pub fn node_curvature<T, const DIM: usize, const NODES: usize, const AGENTS: usize, const M: usize>(
    scenario: &View<'_, T, DIM>,
    trajectory: &Trajectory<T, DIM, NODES, AGENTS>,
    agent: usize,
    node: usize,
    variables: &Variables,
    weigh: &impl Weigh<T>,
    scratch: &mut [Sample<T, DIM>],
) -> Jet<T, M>
where
    T: Real,
{
    let mut sum = Jet::constant(T::zero());
    let mut emitters = Emitters::<T, DIM, AGENTS>::new();
    lay_emitters(scenario, trajectory, node, &mut emitters);
    let emits = emitters.iter().any(|emitter| emitter.agent == agent);
    let moves = variables.time.is_some() && scenario.sensors.iter().any(|sensor| sensor.is_moving());
    for other in 0..trajectory.agents() {
        let mut needs = weigh.needs(other);
        let mut focus = Focus { direct: *variables, emitter: agent, emission: *variables };
        if other != agent {
            focus.direct = variables.shared();
            needs = Needs {
                detection: needs.detection && moves,
                false_alarm: needs.false_alarm && moves,
                location: needs.location && (moves || emits),
            };
        }
        if needs.nothing() {
            continue;
        }
        let Some(situation) = situation(scenario, trajectory, other, node) else {
            continue;
        };
        let part = Part { scenario, situation: &situation, emitters: &emitters, focus: &focus, needs };
        let slopes = |values: &Values<T>, slopes: &mut Slopes<T>| weigh.add_slopes(other, values, slopes);
        // The common case with the layout known when it is compiled.
        let is_common = focus.direct == Variables::POSITION && emitters.is_empty();
        let own = if is_common && !cfg!(feature = "compact") {
            let focus = Focus { direct: Variables::POSITION, emitter: 0, emission: Variables::POSITION };
            Part { focus: &focus, emitters: &[], ..part }.jet::<M, false>(slopes, scratch)
        } else if M >= 2 * DIM && part.is_apart() && !cfg!(feature = "compact") {
            part.any_jet::<M, true>(&slopes, scratch)
        } else {
            part.any_jet::<M, false>(&slopes, scratch)
        };
        sum.add(&own, T::one());
    }
    sum.mirrored()
}

/// One agent's figures, for the derivatives by what `focus` says.
struct Part<'a, T, const DIM: usize> {
    scenario: &'a View<'a, T, DIM>,
    situation: &'a Situation<T, DIM>,
    emitters: &'a [Emitter<T, DIM>],
    focus: &'a Focus,
    needs: Needs,
}

impl<T: Real, const DIM: usize> Part<'_, T, DIM> {
    /// Whether the first variables are the position, and those after them a reference point of its own.
    fn is_apart(&self) -> bool {
        let direct = &self.focus.direct;
        self.situation.reference.is_some() && (direct.position, direct.reference) == (Some(0), Some(DIM))
    }

    /// Compiled once, whatever the slopes.
    #[inline(never)]
    fn any_jet<const M: usize, const APART: bool>(
        &self,
        slopes: &dyn Fn(&Values<T>, &mut Slopes<T>),
        scratch: &mut [Sample<T, DIM>],
    ) -> Jet<T, M> {
        self.jet::<M, APART>(slopes, scratch)
    }

    #[inline(always)]
    fn jet<const M: usize, const APART: bool>(
        &self,
        add_slopes: impl Fn(&Values<T>, &mut Slopes<T>),
        scratch: &mut [Sample<T, DIM>],
    ) -> Jet<T, M> {
        let Self { scenario, situation, emitters, focus, needs } = *self;
        let outcome;
        let (mut values, covariance) = if needs.location {
            let only = Needs { location: true, ..Needs::default() };
            outcome = forward(scenario, situation, emitters, only, scratch);
            (outcome.values, outcome.covariance.as_ref())
        } else {
            place(scenario, situation, scratch);
            (Values::default(), None)
        };
        let mut sum = Jet::constant(T::zero());
        let nothing = Jet::constant(T::zero());
        let (mut detected, mut alarmed) = (nothing, nothing);
        if needs.detection {
            detected = detection(scenario, situation, scratch, &focus.direct);
            values.detection = detected.value;
        }
        if needs.false_alarm {
            alarmed = false_alarm(scenario, scratch, &focus.direct);
            values.false_alarm = alarmed.value;
        }
        let mut slopes = Slopes::new();
        add_slopes(&values, &mut slopes);
        let mut adjoint = Adjoint::default();
        for slope in &slopes {
            adjoint.add(slope.metric, slope.first, &values);
        }
        sum.add(&detected, adjoint.detection);
        sum.add(&alarmed, adjoint.false_alarm);
        let located = covariance.map(|covariance| {
            let around = Around { situation, emitters, softening: scenario.frame.softening, focus };
            location::<_, _, _, APART>(covariance, &around, scenario.sensors, scratch, &adjoint.location)
        });
        if let Some(located) = &located {
            for a in 0..M {
                for b in a..M {
                    sum.hessian[a][b] += located.hessian[a][b];
                }
            }
        }
        for slope in &slopes {
            match (slope.metric, &located) {
                (Metric::Detection, _) => sum.add_square(&detected.gradient, slope.second),
                (Metric::FalseAlarm, _) => sum.add_square(&alarmed.gradient, slope.second),
                (_, None) => {}
                (metric, Some(located)) => add_location(&mut sum, metric, slope, &values, located),
            }
        }
        sum
    }
}

/// Adds value and gradient of a location error, and the second derivatives that its first ones cause.
///
/// The errors are exponentials e^(d.L) of the three logarithms L, or those d.L themselves.
#[inline(always)]
#[expect(clippy::needless_range_loop, reason = "rows and columns by the letters of the equations")]
fn add_location<T: Real, const M: usize>(
    sum: &mut Jet<T, M>,
    metric: Metric,
    slope: &Slope<T>,
    values: &Values<T>,
    located: &LocationJets<T, M>,
) {
    let Some(value) = values.get(metric) else {
        return;
    };
    let mut by = Adjoint::default();
    by.add(metric, T::one(), values);
    let by = by.location;
    let mut gradient = [T::zero(); M];
    for a in 0..M {
        gradient[a] = by.ln_trace * located.ln_trace[a]
            + by.ln_det * located.ln_det[a]
            + by.ln_variance_sum * located.ln_variance_sum[a];
        sum.gradient[a] += slope.first * gradient[a];
    }
    sum.value += slope.first * value;
    let bend = if metric.is_logarithm() { slope.second } else { slope.second + slope.first / value };
    if bend != T::zero() {
        sum.add_square(&gradient, bend);
    }
}
