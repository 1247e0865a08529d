//! What is wanted: the terms of the objective, and limits on metrics.
//!
//! Source: sections 2.1, 2.3 and 4.1; (61), (62). Limits: [`AgentSet`] tells 32 agents apart.

use super::Window;

/// The figure that an objective term or a limit is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Metric {
    /// Combined probability of detection, (19).
    Detection,
    /// Combined probability of a false alarm, (27).
    FalseAlarm,
    /// Squared circular error probable, trace P, length unit squared: E1 of section 2.3.1.
    Cep2,
    /// Circular error probable, length unit, (11).
    Cep,
    /// Area of the 95 % error ellipse, length unit squared; in three dimensions a volume proxy, (16).
    Aee,
    /// Geometric dilution of position, (18).
    Gdop,
    /// Natural logarithm of [`Metric::Cep2`].
    LogCep2,
    /// Natural logarithm of [`Metric::Cep`].
    LogCep,
    /// Natural logarithm of [`Metric::Aee`].
    LogAee,
    /// Natural logarithm of [`Metric::Gdop`].
    LogGdop,
}

impl Metric {
    /// All metrics, in the order of the paper.
    pub const ALL: [Self; 10] = [
        Self::Detection,
        Self::FalseAlarm,
        Self::Cep2,
        Self::Cep,
        Self::Aee,
        Self::Gdop,
        Self::LogCep2,
        Self::LogCep,
        Self::LogAee,
        Self::LogGdop,
    ];

    /// The name that scenario files use.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Detection => "detection",
            Self::FalseAlarm => "false_alarm",
            Self::Cep2 => "cep2",
            Self::Cep => "cep",
            Self::Aee => "aee",
            Self::Gdop => "gdop",
            Self::LogCep2 => "log_cep2",
            Self::LogCep => "log_cep",
            Self::LogAee => "log_aee",
            Self::LogGdop => "log_gdop",
        }
    }

    /// Whether the metric is a location error, and so needs ranging sensors.
    #[must_use]
    pub const fn is_location_error(self) -> bool {
        !matches!(self, Self::Detection | Self::FalseAlarm)
    }

    /// Whether the metric is the logarithm of another.
    #[must_use]
    pub const fn is_logarithm(self) -> bool {
        matches!(self, Self::LogCep2 | Self::LogCep | Self::LogAee | Self::LogGdop)
    }
}

/// Which way a metric is wanted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Sense {
    /// Small is good.
    #[default]
    Minimize,
    /// Large is good.
    Maximize,
}

/// How a metric along the path becomes one figure.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Reduce {
    /// Integral over time, (3), (5).
    #[default]
    Integral,
    /// Worst value along the path, (4).
    Extreme,
}

/// The agents that a term is about: bit k stands for agent k.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct AgentSet(pub u32);

impl AgentSet {
    /// Every agent.
    pub const ALL: Self = Self(u32::MAX);

    /// Whether agent `index` belongs to the set.
    #[inline]
    #[must_use]
    pub const fn contains(self, index: usize) -> bool {
        index < 32 && (self.0 >> index) & 1 == 1
    }
}

/// One term of the objective: `weight * agent weight * reduce(metric)`, with a minus sign where maximised.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Term<T> {
    /// The figure.
    pub metric: Metric,
    /// Which way it is wanted.
    pub sense: Sense,
    /// How it is reduced along the path.
    pub reduce: Reduce,
    /// Weight, not negative.
    pub weight: T,
    /// Agents that it is about.
    pub agents: AgentSet,
    /// Time in which it applies.
    pub window: Window<T>,
}

/// Bounds on a metric at every node but the first, (61), (62).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limit<T> {
    /// The figure.
    pub metric: Metric,
    /// Smallest value allowed.
    pub min: Option<T>,
    /// Largest value allowed.
    pub max: Option<T>,
}
