//! Where a node stands in its agent's Newton system, and how the derivatives of what it brings get there.
//!
//! | symbol | name |
//! |---|---|
//! | kappa = v h / r | `scale`: change of the position with the offset |
//! | 1 / r, h / r | `by_pace`, `interval` |
//! | | `along`: change of each variable with the pace |
//!
//! Derivatives come by the node's variables, and go to the unknowns that these depend on: offsets, controls, and the pace, by the
//! chain rule that [`super::assemble`] opens with.
//!
//! Limits: [`VARIABLES_MAX`] variables.

use crate::jet::Jet;
use crate::math::{Point, Real};
use crate::metrics::Variables;

use super::assemble::Source;
use super::block::Block;
use super::system::{COLUMNS, PACE, Part, System};

/// Most variables that a node has: position, the one before, three controls and time, in three dimensions.
pub(super) const VARIABLES_MAX: usize = 10;

/// What a variable of a node is to the system.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    Here(usize),
    Before(usize),
    Control(usize),
    Time,
}

/// A node of an agent.
pub(super) struct At<'a, T> {
    pub(super) agent_index: usize,
    pub(super) node: usize,
    pub(super) variables: Variables,
    pub(super) roles: &'a [Role],
    /// kappa, 1 / r and h / r.
    pub(super) scale: T,
    pub(super) by_pace: T,
    pub(super) interval: T,
}

/// What the value of a node enters the objective by.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Share {
    /// Times the interval, which depends on the pace.
    Integral,
    /// As it is.
    Node,
}

/// Which right-hand side a gradient goes to.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Target {
    /// That of the objective.
    Objective,
    /// That of the barriers, which the barrier parameter multiplies.
    Centre,
}

/// A node's place in the system, and how its variables move with the pace.
pub(super) struct Place<'a, T> {
    roles: &'a [Role],
    /// node - 1.
    index: usize,
    interior: usize,
    /// kappa.
    scale: T,
    /// 1 / r.
    by_pace: T,
    /// Change of each variable with the pace.
    along: [T; VARIABLES_MAX],
}

impl<'a, T: Real> Place<'a, T> {
    pub(super) fn new<const DIM: usize, const NODES: usize, const AGENTS: usize>(
        source: &Source<'_, T, DIM, NODES, AGENTS>,
        at: &At<'a, T>,
        time: T,
    ) -> Self {
        let (scale, by_pace) = (at.scale, at.by_pace);
        let shrinking = -scale * by_pace;
        let offsets = source.iterate.offset.get(at.agent_index).map(|nodes| nodes.as_slice()).unwrap_or_default();
        let offset = |node: usize, component: usize| {
            offsets.get(node).and_then(|offset| offset.get(component)).copied().unwrap_or_default()
        };
        let mut along = [T::zero(); VARIABLES_MAX];
        for (along, role) in along.iter_mut().zip(at.roles) {
            *along = match *role {
                Role::Here(component) => offset(at.node, component) * shrinking,
                Role::Before(component) => offset(at.node - 1, component) * shrinking,
                Role::Control(_) => T::zero(),
                Role::Time => -(time - source.frame.start_time) * by_pace,
            };
        }
        let interior = source.frame.intervals.saturating_sub(1);
        Self { roles: at.roles, index: at.node - 1, interior, scale, by_pace, along }
    }

    /// Factor between a variable and its unknown.
    fn factor(&self, role: Role) -> T {
        match role {
            Role::Here(_) | Role::Before(_) => self.scale,
            Role::Control(_) => T::one(),
            Role::Time => T::zero(),
        }
    }

    /// Adds `weight` times an integral's derivatives, where the position is all that varies.
    #[inline]
    pub(super) fn add_position<const DIM: usize, const NODES: usize, const M: usize>(
        &self,
        jet: &Jet<T, M>,
        weight: T,
        system: &mut System<T, DIM, NODES>,
    ) {
        let factor = self.scale * weight;
        let pair = factor * self.scale;
        let (mut slope, mut bend) = (T::zero(), T::zero());
        let (mut moved, mut column) = (Point::<T, DIM>::zeros(), Point::<T, DIM>::zeros());
        let mut block = Block::<T, DIM>::zeros();
        for a in 0..M.min(DIM) {
            let mut along = T::zero();
            for b in 0..M.min(DIM) {
                along += jet.hessian[a][b] * self.along[b];
                block[(a, b)] = pair * jet.hessian[a][b];
            }
            slope += jet.gradient[a] * self.along[a];
            bend += along * self.along[a];
            moved[a] = factor * jet.gradient[a];
            column[a] = factor * (along - T::real(2.0) * jet.gradient[a] * self.by_pace);
        }
        system.border[PACE][PACE] += weight * (bend - T::real(4.0) * slope * self.by_pace);
        system.border_right[PACE] -= weight * slope;
        if self.index >= self.interior {
            return;
        }
        let rows = system.rows.get_mut(self.index).zip(system.columns[PACE].path.get_mut(self.index));
        if let Some(((row, by_pace), right)) = rows.zip(system.right.path.get_mut(self.index)) {
            row.here += block;
            *by_pace += column;
            *right -= moved;
        }
    }

    /// Adds `weight` times a jet's second derivatives.
    pub(super) fn add<const DIM: usize, const NODES: usize, const M: usize>(
        &self,
        jet: &Jet<T, M>,
        weight: T,
        share: Share,
        system: &mut System<T, DIM, NODES>,
    ) {
        let two = T::real(2.0);
        let mut slope = T::zero();
        let mut bend = T::zero();
        for (a, &role) in self.roles.iter().enumerate().take(M) {
            let mut along = T::zero();
            for (b, &change) in self.along.iter().enumerate().take(M) {
                along += jet.hessian[a][b] * change;
            }
            slope += jet.gradient[a] * self.along[a];
            bend += along * self.along[a];
            // What scales with the pace itself: kappa, and the interval where there is one.
            let scaled = match (role, share) {
                (Role::Here(_) | Role::Before(_), Share::Integral) => -two,
                (Role::Here(_) | Role::Before(_), Share::Node) | (Role::Control(_), Share::Integral) => -T::one(),
                _ => T::zero(),
            };
            let factor = self.factor(role) * weight;
            self.add_to_column(role, PACE, factor * (along + scaled * jet.gradient[a] * self.by_pace), system);
            for (b, &other) in self.roles.iter().enumerate().take(M) {
                self.add_pair(role, other, factor * self.factor(other) * jet.hessian[a][b], system);
            }
        }
        let own = match share {
            Share::Integral => -T::real(4.0) * slope * self.by_pace,
            Share::Node => -two * slope * self.by_pace,
        };
        system.border[PACE][PACE] += weight * (bend + own);
    }

    /// Adds minus `weight` times a jet's first derivatives to the right-hand side.
    pub(super) fn add_slopes<const DIM: usize, const NODES: usize, const M: usize>(
        &self,
        jet: &Jet<T, M>,
        weight: T,
        target: Target,
        system: &mut System<T, DIM, NODES>,
    ) {
        let (part, border) = match target {
            Target::Objective => (&mut system.right, &mut system.border_right),
            Target::Centre => (&mut system.centre, &mut system.border_centre),
        };
        let mut along = T::zero();
        for (a, &role) in self.roles.iter().enumerate().take(M) {
            along += jet.gradient[a] * self.along[a];
            self.add_to_right(role, -weight * self.factor(role) * jet.gradient[a], part);
        }
        border[PACE] -= weight * along;
    }

    /// Adds the barrier of one node of a worst value epsilon: slack epsilon - sign E.
    pub(super) fn add_worst<const DIM: usize, const NODES: usize, const M: usize>(
        &self,
        jet: &Jet<T, M>,
        sign: T,
        (slack, multiplier): (T, T),
        column: usize,
        system: &mut System<T, DIM, NODES>,
    ) {
        // Worst values have columns of their own, so that there is one.
        let column = column.min(COLUMNS - 1);
        let (stiffness, push) = (multiplier / slack, T::one() / slack);
        let mut outer = *jet;
        for a in 0..M {
            for b in 0..M {
                outer.hessian[a][b] =
                    multiplier * sign * jet.hessian[a][b] + stiffness * jet.gradient[a] * jet.gradient[b];
            }
            outer.gradient[a] = multiplier * sign * jet.gradient[a];
        }
        self.add(&outer, T::one(), Share::Node, system);
        let mut along = T::zero();
        for (a, &role) in self.roles.iter().enumerate().take(M) {
            along += jet.gradient[a] * self.along[a];
            self.add_to_column(role, column, -stiffness * sign * jet.gradient[a] * self.factor(role), system);
            // The gradient of -mu ln(epsilon - sign E).
            self.add_to_right(role, -push * sign * jet.gradient[a] * self.factor(role), &mut system.centre);
        }
        system.border[column][column] += stiffness;
        system.border[column][PACE] -= stiffness * sign * along;
        system.border[PACE][column] -= stiffness * sign * along;
        system.border_centre[column] += push;
        system.border_centre[PACE] -= push * sign * along;
    }

    fn add_pair<const DIM: usize, const NODES: usize>(
        &self,
        role: Role,
        other: Role,
        value: T,
        system: &mut System<T, DIM, NODES>,
    ) {
        let here = self.index < self.interior;
        let before = self.index.checked_sub(1);
        let row = system.rows.get_mut(self.index);
        let local = system.local.get_mut(self.index);
        let entry = match (role, other) {
            (Role::Here(a), Role::Here(b)) if here => row.and_then(|row| row.here.get_mut((a, b))),
            (Role::Here(a), Role::Before(b)) if here && before.is_some() => {
                row.and_then(|row| row.one.get_mut((a, b)))
            }
            (Role::Before(a), Role::Before(b)) => {
                before.and_then(|before| system.rows.get_mut(before)).and_then(|row| row.here.get_mut((a, b)))
            }
            (Role::Control(a), Role::Control(b)) => {
                local.and_then(|local| local.matrix.get_mut(a)).and_then(|matrix| matrix.get_mut(b))
            }
            (Role::Control(a), Role::Here(b)) if here => {
                local.and_then(|local| local.here.get_mut(a)).and_then(|point| point.get_mut(b))
            }
            (Role::Control(a), Role::Before(b)) if before.is_some() => {
                local.and_then(|local| local.before.get_mut(a)).and_then(|point| point.get_mut(b))
            }
            _ => None,
        };
        if let Some(entry) = entry {
            *entry += value;
        }
    }

    fn add_to_column<const DIM: usize, const NODES: usize>(
        &self,
        role: Role,
        column: usize,
        value: T,
        system: &mut System<T, DIM, NODES>,
    ) {
        if let Some(part) = system.columns.get_mut(column) {
            add_to_part(self, role, value, part);
        }
    }

    fn add_to_right<const DIM: usize, const NODES: usize>(
        &self,
        role: Role,
        value: T,
        part: &mut Part<T, DIM, NODES>,
    ) {
        add_to_part(self, role, value, part);
    }
}

fn add_to_part<T: Real, const DIM: usize, const NODES: usize>(
    place: &Place<'_, T>,
    role: Role,
    value: T,
    part: &mut Part<T, DIM, NODES>,
) {
    let entry = match role {
        Role::Here(component) if place.index < place.interior => {
            part.path.get_mut(place.index).and_then(|point| point.get_mut(component))
        }
        Role::Before(component) => {
            let before = place.index.checked_sub(1);
            before.and_then(|before| part.path.get_mut(before)).and_then(|point| point.get_mut(component))
        }
        Role::Control(kind) => part.control.get_mut(place.index).and_then(|kinds| kinds.get_mut(kind)),
        _ => None,
    };
    if let Some(entry) = entry {
        *entry += value;
    }
}
