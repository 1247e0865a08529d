//! Fills an agent's Newton system: second derivatives of objective and barriers, and minus the first ones.
//!
//! With kappa = v h / r the position is x_i = line + kappa e_i and the node time t_i = t_0 + i h / r, so that along the
//! pace dx_i = -kappa e_i / r and dt_i = -(t_i - t_0) / r, each with second derivative -2 / r times itself.
//! Second derivatives of the metrics come from [`crate::objective::curvature`]; bounds add
//! lambda (grad g grad g' / g - g''), the primal-dual form of a logarithmic barrier.

use heapless::Vec;

use crate::jet::Jet;
use crate::math::{Point, Real, norm_squared};
use crate::metrics::{Sample, Variables};
use crate::objective::curvature::{Integrals, Single, node_curvature};
use crate::scenario::{Domain, ReferencePoint, View};
use crate::solver::controls::{Bound, KINDS, Kind};
use crate::solver::coordinates::{AgentFrame, Frame, Iterate};
use crate::trajectory::Trajectory;

use super::barrier::{Multipliers, Range, for_each_wall, held};
use super::extremes::Extremes;
use super::limits::Limits;
use super::place::{At, Place, Role, Share, Target, VARIABLES_MAX};
use super::rows::{Ball, for_each_ball, index};
use super::system::{BUDGETS, EXTREMES, PACE, System};

/// What one agent's assembly reads.
pub(super) struct Source<'a, T, const DIM: usize, const NODES: usize, const AGENTS: usize> {
    /// The problem with its integral terms only.
    pub(super) plain: &'a View<'a, T, DIM>,
    pub(super) frame: &'a Frame<T, DIM, AGENTS>,
    pub(super) iterate: &'a Iterate<T, DIM, NODES, AGENTS>,
    /// `iterate`, written out.
    pub(super) trajectory: &'a Trajectory<T, DIM, NODES, AGENTS>,
    pub(super) extremes: &'a Extremes<T>,
    /// mu.
    pub(super) barrier: T,
    /// Multipliers are taken within this factor of mu / g.
    pub(super) range: Range<T>,
}

impl<T: Real, const DIM: usize, const NODES: usize, const AGENTS: usize> Source<'_, T, DIM, NODES, AGENTS> {
    /// Adds what the bounds of `agent` bring to `system`.
    pub(super) fn bounds(
        &self,
        index: usize,
        agent: &AgentFrame<T, DIM>,
        multipliers: &mut Multipliers<T, DIM, NODES>,
        system: &mut System<T, DIM, NODES>,
    ) {
        let Some(offsets) = self.iterate.interior(self.frame).nth(index) else { return };
        self.balls(agent, offsets, multipliers, system);
        let domain = &self.plain.frame.domain;
        self.walls(domain, agent, offsets, multipliers, system);
        self.levels(index, agent, multipliers, system);
    }

    /// Adds what the nodes of `agent` bring; their integrals, everything that the agent affects counted.
    pub(super) fn nodes(
        &self,
        index: usize,
        agent: &AgentFrame<T, DIM>,
        system: &mut System<T, DIM, NODES>,
        scratch: &mut [Sample<T, DIM>],
    ) -> T {
        let (variables, roles) = self.variables(agent);
        let pace = self.iterate.pace;
        let scale = agent.stride / pace;
        let mut at = At {
            agent_index: index,
            node: 0,
            variables,
            roles: &roles,
            scale,
            by_pace: T::one() / pace,
            interval: self.frame.interval / pace,
        };
        let mut sum = T::zero();
        for node in 1..=self.frame.intervals {
            at.node = node;
            sum += self.node(&at, system, scratch);
        }
        sum * at.interval
    }

    fn balls(
        &self,
        agent: &AgentFrame<T, DIM>,
        offsets: &[Point<T, DIM>],
        multipliers: &mut Multipliers<T, DIM, NODES>,
        system: &mut System<T, DIM, NODES>,
    ) {
        let intervals = self.frame.intervals;
        for_each_ball(self.frame, agent, offsets, self.iterate.pace, |place, ball| {
            let Some(multiplier) = multipliers.of_ball(place, intervals) else { return };
            let push = T::one() / ball.slack();
            *multiplier = held(*multiplier, self.barrier * push, self.range);
            add_ball(ball, *multiplier, push, system);
        });
    }

    fn walls(
        &self,
        domain: &Domain<T, DIM>,
        agent: &AgentFrame<T, DIM>,
        offsets: &[Point<T, DIM>],
        multipliers: &mut Multipliers<T, DIM, NODES>,
        system: &mut System<T, DIM, NODES>,
    ) {
        for_each_wall(self.frame, domain, agent, (offsets, self.iterate.pace), |wall| {
            let Some(multiplier) = multipliers.of_wall(wall) else { return };
            let push = T::one() / wall.slack;
            *multiplier = held(*multiplier, self.barrier * push, self.range);
            let stiffness = *multiplier * push;
            let (by_offset, by_pace) = (wall.by_offset, wall.by_pace);
            let Some(row) = system.rows.get_mut(wall.node) else { return };
            if let Some(entry) = row.here.get_mut((wall.component, wall.component)) {
                *entry += stiffness;
            }
            let component = |point: Option<&mut Point<T, DIM>>, change: T| {
                if let Some(component) = point.and_then(|point| point.get_mut(wall.component)) {
                    *component += change;
                }
            };
            component(system.columns[PACE].path.get_mut(wall.node), stiffness * by_offset * by_pace);
            system.border[PACE][PACE] += stiffness * by_pace * by_pace;
            component(system.centre.path.get_mut(wall.node), push * by_offset);
            system.border_centre[PACE] += push * by_pace;
        });
    }

    fn levels(
        &self,
        index: usize,
        agent: &AgentFrame<T, DIM>,
        multipliers: &mut Multipliers<T, DIM, NODES>,
        system: &mut System<T, DIM, NODES>,
    ) {
        let one = T::one();
        for (kind, bound) in Kind::ALL.into_iter().zip(agent.controls) {
            let Bound::Level { allowance } = bound else { continue };
            let column = BUDGETS + usize::from(kind == Kind::Dropout);
            let kind_index = kind as usize;
            let levels = self.iterate.levels((index, kind), self.frame.intervals);
            let used = levels.iter().fold(T::zero(), |sum, &level| sum + level);
            let rest = allowance * self.iterate.pace - used;
            let [low, high] = &mut multipliers.level;
            let sides = low[kind_index].iter_mut().zip(&mut high[kind_index]);
            let nodes =
                system.local.iter_mut().zip(&mut system.centre.control).zip(&mut system.columns[column].control);
            for ((((local, right), border), &level), (low, high)) in nodes.zip(levels).zip(sides) {
                *low = held(*low, self.barrier / level, self.range);
                *high = held(*high, self.barrier / (one - level), self.range);
                local.matrix[kind_index][kind_index] += *low / level + *high / (one - level);
                right[kind_index] += one / level - one / (one - level) - one / rest;
                border[kind_index] = -one;
            }
            let budget = &mut multipliers.budget[kind_index];
            *budget = held(*budget, self.barrier / rest, self.range);
            system.border[column][PACE] = allowance;
            system.border[PACE][column] = allowance;
            system.border[column][column] = -rest / *budget;
            system.border_centre[PACE] += allowance / rest;
        }
    }

    /// Objective, limits and worst values at a node; returns its part of the objective, a second.
    fn node(&self, at: &At<'_, T>, system: &mut System<T, DIM, NODES>, scratch: &mut [Sample<T, DIM>]) -> T {
        // Fewer layouts take less code, and more figures that are zero.
        match at.roles.len() {
            0..=4 if cfg!(feature = "compact") => self.node_of::<4>(at, system, scratch),
            3.. if cfg!(feature = "compact") => self.node_of::<VARIABLES_MAX>(at, system, scratch),
            0..=2 => self.node_of::<2>(at, system, scratch),
            3 => self.node_of::<3>(at, system, scratch),
            4 => self.node_of::<4>(at, system, scratch),
            5 | 6 => self.node_of::<6>(at, system, scratch),
            _ => self.node_of::<VARIABLES_MAX>(at, system, scratch),
        }
    }

    fn node_of<const M: usize>(
        &self,
        at: &At<'_, T>,
        system: &mut System<T, DIM, NODES>,
        scratch: &mut [Sample<T, DIM>],
    ) -> T {
        let (scenario, trajectory) = (self.plain, self.trajectory);
        let time = trajectory.times.get(at.node).copied().unwrap_or_default();
        let place = Place::new(self, at, time);
        let (agent, node) = (at.agent_index, at.node);
        let integrals = Integrals { scenario, time };
        let jet: Jet<T, M> = node_curvature(scenario, trajectory, agent, node, &at.variables, &integrals, scratch);
        let jet = self.shared(jet, at);
        let value = jet.value;
        if M == DIM && !cfg!(feature = "compact") {
            place.add_position(&jet, at.interval, system);
        } else {
            place.add_slopes(&jet, at.interval, Target::Objective, system);
            place.add(&jet, at.interval, Share::Integral, system);
        }
        if !scenario.limits.is_empty() {
            let limits = Limits { scenario };
            let jet: Jet<T, M> = node_curvature(scenario, trajectory, agent, node, &at.variables, &limits, scratch);
            let jet = self.shared(jet, at);
            place.add_slopes(&jet, T::one(), Target::Centre, system);
            place.add(&jet, self.barrier, Share::Node, system);
        }
        for worst in self.extremes.of(agent).filter(|worst| worst.term.window.holds(time)) {
            let own = Single { agent, metric: worst.term.metric };
            let jet: Jet<T, M> = node_curvature(scenario, trajectory, agent, node, &at.variables, &own, scratch);
            let sign = worst.sign();
            let slack = worst.value - sign * jet.value;
            let slot = worst.slot;
            place.add_worst(&jet, sign, (slack, self.barrier / slack), EXTREMES + slot, system);
        }
        value
    }

    /// The jet without what other agents' jets of the same node count too: how everyone's figures change with time.
    #[inline(always)]
    fn shared<const M: usize>(&self, mut jet: Jet<T, M>, at: &At<'_, T>) -> Jet<T, M> {
        if M == DIM {
            // Positions are no one else's.
            return jet;
        }
        let Some(time) = at.variables.time.filter(|&time| time < M && self.frame.agents > 1) else { return jet };
        let part = T::one() / T::from_count(self.frame.agents);
        jet.gradient[time] *= part;
        jet.hessian[time][time] *= part;
        jet
    }

    /// Which variables the nodes of an agent have, and what each is to the system.
    fn variables(&self, agent: &AgentFrame<T, DIM>) -> (Variables, Vec<Role, VARIABLES_MAX>) {
        let mut roles = Vec::<Role, VARIABLES_MAX>::new();
        let mut variables = Variables { position: Some(0), ..Variables::default() };
        let mut push = |role| {
            let index = roles.len();
            roles.push(role).ok().map(|()| index)
        };
        for component in 0..DIM {
            let _ = push(Role::Here(component));
        }
        if self.plain.frame.reference_point == ReferencePoint::Lagged {
            variables.reference = push(Role::Before(0));
            for component in 1..DIM {
                let _ = push(Role::Before(component));
            }
        }
        let [jam, azimuth, dropout] = agent.controls.map(|bound| bound != Bound::Off);
        if jam {
            variables.level = push(Role::Control(Kind::Jam as usize));
        }
        if azimuth {
            variables.azimuth = push(Role::Control(Kind::Azimuth as usize));
        }
        if dropout {
            variables.dropout = push(Role::Control(Kind::Dropout as usize));
        }
        if self.plain.sensors.iter().any(|sensor| sensor.is_moving()) {
            variables.time = push(Role::Time);
        }
        (variables, roles)
    }
}

/// Adds a bound on speed or acceleration.
fn add_ball<T: Real, const DIM: usize, const NODES: usize>(
    ball: &Ball<T, DIM>,
    multiplier: T,
    by_slack: T,
    system: &mut System<T, DIM, NODES>,
) {
    let (two, four) = (T::real(2.0), T::real(4.0));
    let interior = system.intervals.saturating_sub(1);
    let stiffness = four * multiplier * by_slack;
    let mut bend = ball.value * ball.value.transpose() * stiffness;
    for k in 0..DIM {
        bend[(k, k)] += two * multiplier;
    }
    let by_radius = ball.value * (-stiffness * ball.radius * ball.radius_by_pace);
    let along_pace = bend * ball.by_pace + by_radius;
    let radial = two * multiplier * ball.radius_by_pace * ball.radius_by_pace;
    let push = two * by_slack;
    system.border[PACE][PACE] += ball.by_pace.dot(&(along_pace + by_radius))
        + radial * (ball.radius * ball.radius + norm_squared(&ball.value)) * by_slack;
    system.border_centre[PACE] += push * ball.half_slack_by_pace();
    for (a, &weight_a) in ball.weights.iter().enumerate() {
        let Some(row) = index(ball.first, a).filter(|&row| row < interior && weight_a != T::zero()) else { continue };
        let [column, right] = [&mut system.columns[PACE], &mut system.centre];
        let Some((column, right)) = column.path.get_mut(row).zip(right.path.get_mut(row)) else { continue };
        *column += along_pace * weight_a;
        *right -= ball.value * (push * weight_a);
        for (b, &weight_b) in ball.weights.iter().enumerate().take(a + 1) {
            if index(ball.first, b).is_none() {
                continue;
            }
            let Some(row) = system.rows.get_mut(row) else { continue };
            let entry = match a - b {
                0 => &mut row.here,
                1 => &mut row.one,
                _ => &mut row.two,
            };
            *entry += bend * (weight_a * weight_b);
        }
    }
}

/// Adds the barrier of a region or separation to the agent that flies the segment: its gradient, and that squared.
///
/// `by_ends` are the derivatives by the positions at both ends of the segment that ends at `node`.
pub(super) fn add_segment<T: Real, const DIM: usize, const NODES: usize>(
    system: &mut System<T, DIM, NODES>,
    (offsets, scale, pace): (&[Point<T, DIM>; NODES], T, T),
    node: usize,
    (barrier, slack): (T, T),
    by_ends: &[Point<T, DIM>; 2],
) {
    let push = T::one() / slack;
    let stiffness = barrier * push / slack;
    let interior = system.intervals.saturating_sub(1);
    let [by_from, by_to] = by_ends;
    let zero = Point::<T, DIM>::zeros();
    let moved = |node: usize| offsets.get(node).copied().unwrap_or(zero) * (-scale / pace);
    let from = node.checked_sub(2);
    let to = Some(node - 1).filter(|&to| to < interior);
    let before = if node >= 1 { moved(node - 1) } else { zero };
    let by_pace = by_from.dot(&before) + by_to.dot(&moved(node));
    let (a, b) = (by_from * scale, by_to * scale);
    let (column, right) = (&mut system.columns[PACE].path, &mut system.centre.path);
    for (place, by_end) in [(from, a), (to, b)] {
        let Some(place) = place else { continue };
        let Some(((row, border), right)) =
            system.rows.get_mut(place).zip(column.get_mut(place)).zip(right.get_mut(place))
        else {
            continue;
        };
        row.here += by_end * by_end.transpose() * stiffness;
        *border += by_end * (stiffness * by_pace);
        *right += by_end * push;
    }
    if let (Some(_), Some(row)) = (from, to.and_then(|to| system.rows.get_mut(to))) {
        row.one += b * a.transpose() * stiffness;
    }
    system.border[PACE][PACE] += stiffness * by_pace * by_pace;
    system.border_centre[PACE] += push * by_pace;
}

/// Kinds of controls, for the sizes of this module.
const _: () = assert!(KINDS == 3, "a budget column each for jamming and dropout");
