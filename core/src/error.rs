//! What can be wrong with a scenario, and where.
//!
//! An [`Error`] names the place by the words of the scenario file (`agent[0].speed_max`), so that a program
//! that read a file can point at the line, and firmware can print it without one.
//!
//! Statuses of a plan (`IterationLimit`, `Infeasible` ..) are not errors: see [`crate::solver::Status`].

use core::fmt;

/// The part of a scenario that an error is about; indices count from 0 in file order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Item {
    /// The scenario itself: grid, time, domain, softening.
    Scenario,
    /// An agent, by index.
    Agent(usize),
    /// A sensor, by index.
    Sensor(usize),
    /// A term of the objective, by index.
    Term(usize),
    /// A region, by index.
    Region(usize),
    /// A limit, by index.
    Limit(usize),
}

impl fmt::Display for Item {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Scenario => f.write_str("scenario"),
            Self::Agent(index) => write!(f, "agent[{index}]"),
            Self::Sensor(index) => write!(f, "sensor[{index}]"),
            Self::Term(index) => write!(f, "objective.term[{index}]"),
            Self::Region(index) => write!(f, "region[{index}]"),
            Self::Limit(index) => write!(f, "limit[{index}]"),
        }
    }
}

/// What is wrong.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Fault {
    /// A number is NaN or infinite.
    NotFinite,
    /// A number must be greater than zero.
    NotPositive {
        /// What was given.
        value: f64,
    },
    /// A number must not be negative.
    Negative {
        /// What was given.
        value: f64,
    },
    /// A number is outside its range.
    OutOfRange {
        /// What was given.
        value: f64,
        /// Smallest number allowed.
        min: f64,
        /// Largest number allowed.
        max: f64,
    },
    /// A list needs at least one entry.
    Empty,
    /// A list is longer than this build has room for.
    TooMany {
        /// Entries given.
        count: usize,
        /// Entries that fit.
        capacity: usize,
    },
    /// A list needs more entries.
    TooFew {
        /// Entries given.
        count: usize,
        /// Entries needed.
        need: usize,
    },
    /// A polygon is not strictly convex.
    NotConvex {
        /// Index of the first vertex at which it is seen.
        vertex: usize,
    },
    /// A position lies in a region to keep out of, at a time when it applies.
    InsideRegion {
        /// The region, by index.
        region: usize,
    },
    /// A position lies outside a region to stay in, at a time when it applies.
    OutsideRegion {
        /// The region, by index.
        region: usize,
    },
    /// Two agents start or arrive too close together.
    TooClose {
        /// The other agent, by index.
        other: usize,
        /// Their distance, length units.
        distance: f64,
        /// Least distance allowed, length units.
        least: f64,
    },
    /// A position lies outside the domain.
    OutsideDomain,
    /// A lower bound is not below its upper bound.
    BoundsCrossed,
    /// Times of a track must increase from entry to entry.
    NotIncreasing {
        /// Index of the first entry that does not.
        entry: usize,
    },
    /// Location error needs more ranging sensors.
    TooFewRanging {
        /// Ranging sensors there are.
        have: usize,
        /// Ranging sensors needed: one more than the dimension.
        need: usize,
    },
    /// Sensors that pool correlated signals need the same number of samples.
    UnequalSamples {
        /// What was given.
        samples: u32,
        /// What the sensors before it have.
        others: u32,
    },
    /// The model has no meaning for this together with pooled sensors.
    NotWithPooling,
    /// Even the straight line at full speed takes longer than the time there is.
    Unreachable {
        /// Seconds that the straight line takes at full speed.
        needed: f64,
        /// Seconds there are.
        allowed: f64,
    },
    /// The acceleration bound cannot take the start velocity to a path that ends at the goal in time.
    StartVelocity,
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotFinite => f.write_str("is not a finite number"),
            Self::NotPositive { value } => write!(f, "must be greater than 0, not {value}"),
            Self::Negative { value } => write!(f, "must not be negative, but is {value}"),
            Self::OutOfRange { value, min, max } => write!(f, "must lie between {min} and {max}, but is {value}"),
            Self::Empty => f.write_str("needs at least one entry"),
            Self::TooMany { count, capacity } => {
                write!(f, "has {count} entries, and this build has room for {capacity}")
            }
            Self::TooFew { count, need } => write!(f, "has {count} entries, and needs at least {need}"),
            Self::NotConvex { vertex } => write!(f, "is not strictly convex at entry {vertex}"),
            Self::InsideRegion { region } => write!(f, "lies inside region[{region}], which is to be kept out of"),
            Self::OutsideRegion { region } => write!(f, "lies outside region[{region}], which is to be stayed in"),
            Self::TooClose { other, distance, least } => {
                write!(f, "is {distance} from that of agent[{other}], closer than `separation`, which is {least}")
            }
            Self::OutsideDomain => f.write_str("lies outside the domain"),
            Self::BoundsCrossed => f.write_str("has a lower bound that is not below its upper bound"),
            Self::NotIncreasing { entry } => {
                write!(f, "has times that do not increase: entry {entry} is not later than the one before it")
            }
            Self::TooFewRanging { have, need } => {
                write!(f, "needs at least {need} sensors with `ranging`, and there are {have}")
            }
            Self::UnequalSamples { samples, others } => write!(
                f,
                "must be the same for all sensors that pool correlated signals: {others} so far, and here {samples}"
            ),
            Self::NotWithPooling => f.write_str("must be `none` where sensors pool their signals"),
            Self::Unreachable { needed, allowed } => write!(
                f,
                "cannot be reached: the straight line at full speed takes {needed:.6} s, and there are {allowed:.6} s"
            ),
            Self::StartVelocity => f.write_str(
                "cannot be followed to the goal within the speed and acceleration bounds in the time there is",
            ),
        }
    }
}

/// An invalid scenario: the item, its field, and what is wrong with it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Error {
    /// The part of the scenario.
    pub item: Item,
    /// The field in the words of the scenario file, with dots between levels: `ranging.path_loss`.
    pub field: &'static str,
    /// What is wrong with it.
    pub fault: Fault,
}

impl Error {
    /// An error about `field` of `item`.
    #[must_use]
    pub const fn new(item: Item, field: &'static str, fault: Fault) -> Self {
        Self { item, field, fault }
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.item {
            Item::Scenario => write!(f, "{} {}", self.field, self.fault),
            item => write!(f, "{item}.{} {}", self.field, self.fault),
        }
    }
}

impl core::error::Error for Error {}
