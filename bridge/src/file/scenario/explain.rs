//! The core's errors in the words and lines of the file, with what would be right; and warnings.

use quietpath_core::constraints::{self, Constraint};
use quietpath_core::error::{Error, Fault, Item};
use quietpath_core::scenario::{BeamPattern, Detection, Pooling, Side};
use quietpath_core::{Metric, Real};

use super::{MotionEntry, ScenarioFile};
use crate::file::reader::Source;
use crate::file::{FileError, Place, Warning};

impl ScenarioFile {
    /// Checks the scenario as the core would, in double precision.
    pub(super) fn validate(&self) -> Result<(), Box<FileError>> {
        match self.dimension {
            3 => self.to_core::<f64, 3>().map(|_| ()),
            _ => self.to_core::<f64, 2>().map(|_| ()),
        }
    }

    /// An error of the core, with its place in the file and what would be right.
    #[must_use]
    pub fn explain(&self, error: &Error) -> Box<FileError> {
        let prefix = match error.item {
            Item::Scenario => String::new(),
            item => format!("{item}."),
        };
        let mut field = format!("{prefix}{}", error.field);
        if let Fault::NotIncreasing { entry } = error.fault {
            field = format!("{field}[{entry}].t");
        }
        if let Fault::NotConvex { vertex } = error.fault {
            field = format!("{field}[{vertex}]");
        }
        let message = match error.fault {
            Fault::NotIncreasing { entry } => format!("must be later than the time of entry {}", entry - 1),
            Fault::Empty if error.field == "max" => "is missing".to_owned(),
            Fault::NotConvex { .. } => "is a corner at which the polygon is not strictly convex".to_owned(),
            Fault::InsideRegion { region } => {
                format!("lies inside {}, which is to be kept out of", self.region(region))
            }
            Fault::OutsideRegion { region } => {
                format!("lies outside {}, which is to be stayed in", self.region(region))
            }
            Fault::TooClose { other, distance, least } => format!(
                "is {distance} from that of {}, and agents must keep a `separation` of {least}",
                self.agent_name(other)
            ),
            fault => fault.to_string(),
        };
        let help = self.remedy(error);
        let place = self.source.locate(&field).map(|(span, _)| Place::of(&self.source.text, &span));
        Box::new(FileError { name: self.source.name.clone(), place, field, message, help })
    }

    /// An error about a field of the file that has nothing to do with the core.
    #[must_use]
    pub fn error_at(&self, field: &str, message: &str, help: &str) -> Box<FileError> {
        Box::new(located(&self.source, field.to_owned(), message, help))
    }

    /// What would be right.
    fn remedy(&self, error: &Error) -> String {
        match error.fault {
            Fault::NotFinite => "write a number such as 1.5".to_owned(),
            Fault::NotPositive { .. } => format!("give a number greater than 0{}", unit(error.field)),
            Fault::Negative { .. } => format!("give 0 or more{}", unit(error.field)),
            Fault::OutOfRange { min, max, .. } => format!("give a number from {min} to {max}{}", unit(error.field)),
            Fault::Empty => match error.field {
                "agent" => "add [[agent]] with `start`, `goal`, `speed_max` and `accel_max`".to_owned(),
                "objective.term" => "add [[objective.term]] with, for example, `metric = \"detection\"`".to_owned(),
                "track" => "add at least { t = 0.0, position = [..] }".to_owned(),
                _ => "give `min`, `max` or both".to_owned(),
            },
            Fault::TooFew { need, .. } => format!("give at least {need} corners, in order along the boundary"),
            Fault::NotConvex { .. } => {
                "give the corners in order, each of them turning the same way; split a region with a dent".to_owned()
            }
            Fault::InsideRegion { .. } | Fault::OutsideRegion { .. } => {
                "move it, change the region, or let the region apply for a while only with `from` or `until`"
                    .to_owned()
            }
            Fault::TooClose { .. } => "move one of the two, or choose a smaller `separation`".to_owned(),
            Fault::TooMany { capacity, .. } if error.field == "polygon" => {
                format!("draw it with at most {capacity} corners, or as several regions")
            }
            Fault::TooMany { capacity, .. } => {
                format!("use at most {capacity}, or build with more room: see `bridge/src/capacity.rs`")
            }
            Fault::OutsideDomain => self.outside(error),
            Fault::BoundsCrossed => "swap the two bounds: the lower one must be the smaller".to_owned(),
            Fault::NotIncreasing { entry } => self.late(error.item, entry),
            Fault::TooFewRanging { need, .. } => {
                format!("give at least {need} sensors a `ranging` table, or ask for `detection`, which needs none")
            }
            Fault::UnequalSamples { others, .. } => {
                format!("write `samples = {others}`, or choose `model = \"uncorrelated\"` in [pooling]")
            }
            Fault::NotWithPooling => {
                "betrayal is defined for single sensors: write `detection_model = \"none\"`, or leave [pooling] out"
                    .to_owned()
            }
            Fault::Unreachable { needed, .. } => {
                let enough = ceil_to_digits(self.start_time + needed);
                format!("`time.max = {enough}` would do; so would a faster agent or a nearer goal")
            }
            Fault::StartVelocity => "a slower start, a larger `accel_max` or a later `time.max` may do".to_owned(),
        }
    }

    /// `region[1] (south)`.
    pub(crate) fn region(&self, index: usize) -> String {
        let name = self.regions.get(index).map_or("", |region| region.name.as_str());
        format!("region[{index}] ({name})")
    }

    /// The name of an agent.
    pub(crate) fn agent_name(&self, index: usize) -> &str {
        self.agents.get(index).map_or("", |agent| agent.name.as_str())
    }

    /// Where a trajectory breaks a constraint, in the names of the file: `region[1] (south) is entered by uav1 at
    /// node 37`.
    #[must_use]
    pub fn describe<T: Real>(&self, place: &constraints::Place<T>) -> String {
        let (agent, node) = (self.agent_name(place.agent), place.node);
        match (place.constraint, place.index) {
            (Constraint::Duration, _) => "the flight arrives later than `time.max`".to_owned(),
            (Constraint::Region, Some(index)) => {
                let inside = self.regions.get(index).is_some_and(|region| region.side == Side::Inside);
                let verb = if inside { "left" } else { "entered" };
                format!("{} is {verb} by {agent} at node {node}", self.region(index))
            }
            (Constraint::Limit, Some(index)) => {
                let metric = self.limits.get(index).map_or("", |limit| limit.metric.name());
                format!("limit[{index}] ({metric}) is broken by {agent} at node {node}")
            }
            (Constraint::Separation, Some(other)) => {
                let other = self.agent_name(other);
                format!("{agent} and {other} come closer than `separation` on the way to node {node}")
            }
            (constraint, _) => format!("{} is broken by {agent} at node {node}", constraint.name()),
        }
    }

    /// Which coordinate is outside, and the bounds.
    fn outside(&self, error: &Error) -> String {
        let Item::Agent(index) = error.item else { return String::new() };
        let Some(agent) = self.agents.get(index) else { return String::new() };
        let position = if error.field == "goal" { &agent.goal } else { &agent.start };
        let bounds = self.domain.min.iter().zip(&self.domain.max);
        for ((axis, value), (low, high)) in ["east", "north", "up"].iter().zip(position).zip(bounds) {
            if value < low || value > high {
                return format!("its {axis} coordinate {value} must lie between {low} and {high}, see [domain]");
            }
        }
        String::new()
    }

    /// The two times of a track that are out of order.
    fn late(&self, item: Item, entry: usize) -> String {
        let Item::Sensor(index) = item else { return String::new() };
        let times = match self.sensors.get(index).map(|sensor| &sensor.motion) {
            Some(MotionEntry::Track(entries)) => entries.get(entry - 1).zip(entries.get(entry)),
            _ => None,
        };
        times.map_or_else(String::new, |(a, b)| format!("{} s follows {} s: give it a later time", b.time, a.time))
    }

    /// What is legal, but hardly meant.
    pub(super) fn warnings(&self) -> Vec<Warning> {
        let mut found = Vec::new();
        let mut warn = |field: String, message: &str, help: &str| {
            found.push(Warning(located(&self.source, field, message, help)));
        };
        for (index, sensor) in self.sensors.iter().enumerate() {
            if sensor.ranging.is_none() && sensor.detection.is_none() {
                let help = "give it a `ranging` or a `detection` table";
                warn(format!("sensor[{index}]"), "neither ranges nor detects, and so has no effect", help);
            }
        }
        let energy = |sensor: &super::SensorEntry| matches!(sensor.detection, Some(Detection::Energy { .. }));
        if self.pooling != Pooling::None && !self.sensors.iter().any(energy) {
            let help = "pooled sensors need `detection = { model = \"energy\", .. }`";
            warn("pooling".to_owned(), "has no effect: no sensor has an energy detector", help);
        }
        for (index, agent) in self.agents.iter().enumerate() {
            let Some(jammer) = agent.jammer else { continue };
            if jammer.budget == 0.0 {
                let help = "give a budget in seconds of full power";
                warn(format!("agent[{index}].jammer"), "has no `budget`, and so never jams", help);
            }
            let field = format!("agent[{index}].jammer.beam_width");
            let given = self.source.locate(&field).is_some_and(|(_, complete)| complete);
            if given && !matches!(jammer.pattern, BeamPattern::Cone { .. }) {
                warn(field, "is not used by this pattern", "choose `pattern = \"cone\"`, or leave it out");
            }
        }
        for (index, term) in self.terms.iter().enumerate() {
            let field = format!("objective.term[{index}]");
            if term.window.until <= self.start_time || term.window.from > self.time.max {
                warn(field, "never applies: its time lies outside the flight", "see `from` and `until`");
                continue;
            }
            let detects = |energy: bool| {
                self.sensors
                    .iter()
                    .filter_map(|sensor| sensor.detection)
                    .any(|detection| !energy || matches!(detection, Detection::Energy { .. }))
            };
            match term.metric {
                Metric::Detection if !detects(false) => {
                    warn(field, "is 0 everywhere: no sensor detects", "give sensors a `detection` table");
                }
                Metric::FalseAlarm if !detects(true) => {
                    let help = "false alarms need sensors with `detection = { model = \"energy\", .. }`";
                    warn(field, "is 0 everywhere: no sensor has false alarms", help);
                }
                _ => {}
            }
        }
        found
    }
}

fn located(source: &Source, field: String, message: &str, help: &str) -> FileError {
    let place = source.locate(&field).map(|(span, _)| Place::of(&source.text, &span));
    let (name, message, help) = (source.name.clone(), message.to_owned(), help.to_owned());
    FileError { name, place, field, message, help }
}

/// The unit of a field, to be read after a number.
fn unit(field: &str) -> &'static str {
    match field {
        "speed_max" => ", in length units per second",
        "accel_max" => ", in length units per second squared",
        "time.max" | "time.target" | "jammer.budget" | "dropout.budget" => ", in seconds",
        "radius" | "softening" | "separation" => ", in length units",
        "jammer.beam_width" => ", in radians",
        _ => "",
    }
}

/// The smallest number of six significant digits that is not below `value`.
fn ceil_to_digits(value: f64) -> f64 {
    let magnitude = value.abs().max(f64::MIN_POSITIVE).log10().floor();
    let scale = 10_f64.powf(5.0 - magnitude);
    let rounded = (value * scale).ceil() / scale;
    if rounded.is_finite() && rounded >= value { rounded } else { value }
}
