//! Which constraint a trajectory breaks, and where: what a message about an infeasible plan needs.

use core::fmt;

use crate::math::Real;

/// The constraints, in the order of [`super::Violations`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Constraint {
    /// Arrival by `time.max`.
    Duration,
    /// Node 0 at the start.
    Start,
    /// Node N at the goal.
    Goal,
    /// Nodes inside the domain.
    Domain,
    /// Speed of the agent.
    Speed,
    /// Acceleration of the agent.
    Accel,
    /// Jamming levels between 0 and 1.
    JamBounds,
    /// Dropout between 0 and 1.
    DropoutBounds,
    /// Integral of the jamming level.
    JamBudget,
    /// Integral of the dropout.
    DropoutBudget,
    /// Limits on metrics.
    Limit,
    /// Regions.
    Region,
    /// Distance between agents.
    Separation,
}

impl Constraint {
    /// All of them.
    pub const ALL: [Self; 13] = [
        Self::Duration,
        Self::Start,
        Self::Goal,
        Self::Domain,
        Self::Speed,
        Self::Accel,
        Self::JamBounds,
        Self::DropoutBounds,
        Self::JamBudget,
        Self::DropoutBudget,
        Self::Limit,
        Self::Region,
        Self::Separation,
    ];

    /// The name that reports use.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Duration => "duration",
            Self::Start => "start",
            Self::Goal => "goal",
            Self::Domain => "domain",
            Self::Speed => "speed",
            Self::Accel => "accel",
            Self::JamBounds => "jam_bounds",
            Self::DropoutBounds => "dropout_bounds",
            Self::JamBudget => "jam_budget",
            Self::DropoutBudget => "dropout_budget",
            Self::Limit => "limit",
            Self::Region => "region",
            Self::Separation => "separation",
        }
    }
}

/// Where a constraint is broken most.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place<T> {
    /// The constraint.
    pub constraint: Constraint,
    /// Which of the limits or regions, by index; for [`Constraint::Separation`] the other agent.
    pub index: Option<usize>,
    /// The agent, by index; 0 for [`Constraint::Duration`], which is everybody's.
    pub agent: usize,
    /// The node; of a segment the node that it ends in, of a whole path the last.
    pub node: usize,
    /// By how much, relative to the scale of the constraint; never negative.
    pub amount: T,
}

impl<T: Real> fmt::Display for Place<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (name, agent, node) = (self.constraint.name(), self.agent, self.node);
        match (self.constraint, self.index) {
            (Constraint::Duration, _) => f.write_str("the arrival is later than time.max"),
            (Constraint::Separation, Some(other)) => {
                write!(f, "agent[{agent}] and agent[{other}] come closer than separation at node {node}")
            }
            (_, Some(index)) => write!(f, "{name}[{index}] is broken by agent[{agent}] at node {node}"),
            (_, None) => write!(f, "{name} is broken by agent[{agent}] at node {node}"),
        }
    }
}

/// The largest violation along a path, and its node.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Worst<T> {
    /// By how much; 0 where nothing is violated.
    pub amount: T,
    /// The node.
    pub node: usize,
}

impl<T: Real> Worst<T> {
    /// Nothing violated.
    #[must_use]
    pub fn none() -> Self {
        Self { amount: T::zero(), node: 0 }
    }

    /// Takes what was found at a node where that is worse; as infinite where it is not a number.
    pub fn raise(&mut self, node: usize, found: T) {
        let before = self.amount;
        super::raise(&mut self.amount, found);
        if self.amount > before {
            self.node = node;
        }
    }

    /// The same in other units.
    #[must_use]
    pub fn relative_to(self, scale: T) -> Self {
        Self { amount: self.amount / scale, node: self.node }
    }
}
