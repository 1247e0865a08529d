//! From [`ScenarioFile`] to the core's scenario, in either precision and dimension.

use quietpath_core::error::{Error, Item};
use quietpath_core::scenario::{
    Agent, AgentSet, BeamPattern, Betrayal, Detection, Domain, Draft, Dropout, Jammer, Knot, Limit, Motion, Polygon,
    Pooling, Ranging, Reduce, ReferencePoint, Region, Sense, Sensor, Shape, Susceptibility, Term, Timing, Window,
};
use quietpath_core::{Metric, Point, Real, Scenario};

use super::{AgentEntry, MotionEntry, Outline, RegionEntry, ScenarioFile, SensorEntry};
use crate::capacity::HostScenario;
use crate::file::FileError;

impl ScenarioFile {
    /// The core's scenario, on the heap because it holds room for [`crate::capacity::KNOTS`] track entries.
    ///
    /// # Errors
    /// What [`quietpath_core::Scenario::new`] refuses, with its place in the file; a `DIM` that is not the
    /// file's dimension.
    pub fn to_core<T: Real, const DIM: usize>(&self) -> Result<Box<HostScenario<T, DIM>>, Box<FileError>> {
        if DIM != self.dimension {
            let message = format!("has {} dimensions, and {DIM} were asked for", self.dimension);
            return Err(Box::new(FileError::whole(self.file_name(), message, "")));
        }
        self.draft().map_err(|error| self.explain(&error))
    }

    fn draft<T: Real, const DIM: usize>(&self) -> Result<Box<HostScenario<T, DIM>>, Error> {
        let agents: Vec<Agent<T, DIM>> = self.agents.iter().map(agent).collect();
        let tracks: Vec<Vec<Knot<T, DIM>>> = self.sensors.iter().map(knots).collect();
        let sensors: Vec<Sensor<'_, T, DIM>> =
            self.sensors.iter().zip(&tracks).map(|(entry, track)| sensor(entry, track)).collect();
        let terms: Vec<Term<T>> = self.terms.iter().map(term).collect();
        let regions: Vec<Region<T>> = self.regions.iter().enumerate().map(region).collect::<Result<_, _>>()?;
        let limits: Vec<Limit<T>> = (self.limits.iter())
            .map(|limit| Limit { metric: limit.metric, min: limit.min.map(T::real), max: limit.max.map(T::real) })
            .collect();
        let draft = Draft {
            softening: T::real(self.softening),
            reference_point: self.reference_point,
            pooling: pooling(self.pooling),
            intervals: self.intervals,
            start_time: T::real(self.start_time),
            time: Timing {
                max: T::real(self.time.max),
                target: T::real(self.time.target),
                penalty: T::real(self.time.penalty),
            },
            domain: Domain { min: point(&self.domain.min), max: point(&self.domain.max) },
            agents: &agents,
            sensors: &sensors,
            terms: &terms,
            separation: self.separation.map(T::real),
            regions: &regions,
            limits: &limits,
        };
        HostScenario::new(&draft).map(Box::new)
    }
}

impl SensorEntry {
    /// Whether the core takes this sensor, in a scenario of some dimension.
    ///
    /// # Errors
    /// What is wrong with it, in the words of the core.
    pub(crate) fn check(&self, dimension: usize) -> Result<(), String> {
        match dimension {
            3 => alone::<3>(self),
            _ => alone::<2>(self),
        }
        .map_err(|error| format!("{} {}", error.field, error.fault))
    }
}

/// Checks a sensor in the smallest scenario that there is, with the core's own checks.
fn alone<const DIM: usize>(entry: &SensorEntry) -> Result<(), Error> {
    let track: Vec<Knot<f64, DIM>> = knots(entry);
    let (start, goal) = (Point::repeat(0.0), Point::repeat(1.0));
    let agent = Agent {
        start,
        goal,
        start_velocity: None,
        speed_max: 1.0,
        accel_max: 1.0,
        weight: 1.0,
        jammer: None,
        dropout: None,
    };
    let term = Term {
        metric: Metric::Detection,
        sense: Sense::Minimize,
        reduce: Reduce::Integral,
        weight: 1.0,
        agents: AgentSet::ALL,
        window: Window::always(),
    };
    let draft = Draft {
        softening: 1.0,
        reference_point: ReferencePoint::Current,
        pooling: Pooling::None,
        intervals: 1,
        start_time: 0.0,
        time: Timing { max: 10.0, target: 0.0, penalty: 0.0 },
        domain: Domain { min: start, max: goal },
        agents: &[agent],
        sensors: &[sensor(entry, &track)],
        terms: &[term],
        separation: None,
        regions: &[],
        limits: &[],
    };
    // An observation makes two entries of a track.
    Scenario::<f64, DIM, 1, 1, 2>::new(&draft).map(|_| ())
}

/// The first `DIM` numbers; zero where there are fewer.
pub(crate) fn point<T: Real, const DIM: usize>(numbers: &[f64]) -> Point<T, DIM> {
    let mut point = Point::<T, DIM>::zeros();
    for (component, number) in point.iter_mut().zip(numbers) {
        *component = T::real(*number);
    }
    point
}

fn window<T: Real>(window: &Window<f64>) -> Window<T> {
    Window { from: T::real(window.from), until: T::real(window.until) }
}

fn region<T: Real>((index, entry): (usize, &RegionEntry)) -> Result<Region<T>, Error> {
    let shape = match &entry.outline {
        Outline::Circle { center, radius } => Shape::Circle { center: point(center), radius: T::real(*radius) },
        Outline::Polygon(corners) => {
            let corners: Vec<_> = corners.iter().map(|corner| point(corner)).collect();
            let polygon = Polygon::new(&corners);
            Shape::Polygon(polygon.map_err(|fault| Error::new(Item::Region(index), "polygon", fault))?)
        }
    };
    Ok(Region { shape, side: entry.side, window: window(&entry.window) })
}

fn agent<T: Real, const DIM: usize>(entry: &AgentEntry) -> Agent<T, DIM> {
    Agent {
        start: point(&entry.start),
        goal: point(&entry.goal),
        start_velocity: entry.start_velocity.as_deref().map(point),
        speed_max: T::real(entry.speed_max),
        accel_max: T::real(entry.accel_max),
        weight: T::real(entry.weight),
        jammer: entry.jammer.as_ref().map(jammer),
        dropout: entry.dropout.map(|dropout| Dropout { budget: T::real(dropout.budget) }),
    }
}

fn jammer<T: Real>(jammer: &Jammer<f64>) -> Jammer<T> {
    Jammer {
        pattern: match jammer.pattern {
            BeamPattern::Isotropic => BeamPattern::Isotropic,
            BeamPattern::Cosine => BeamPattern::Cosine,
            BeamPattern::Cone { beam_width } => BeamPattern::Cone { beam_width: T::real(beam_width) },
        },
        betrayal: match jammer.betrayal {
            Betrayal::None => Betrayal::None,
            Betrayal::Max { q } => Betrayal::Max { q: T::real(q) },
            Betrayal::Linear => Betrayal::Linear,
            Betrayal::Sigmoid => Betrayal::Sigmoid,
        },
        budget: T::real(jammer.budget),
    }
}

fn knots<T: Real, const DIM: usize>(sensor: &SensorEntry) -> Vec<Knot<T, DIM>> {
    match &sensor.motion {
        MotionEntry::Fixed(_) => Vec::new(),
        MotionEntry::Track(entries) => {
            entries.iter().map(|entry| Knot { time: T::real(entry.time), position: point(&entry.position) }).collect()
        }
    }
}

fn sensor<'a, T: Real, const DIM: usize>(entry: &SensorEntry, track: &'a [Knot<T, DIM>]) -> Sensor<'a, T, DIM> {
    Sensor {
        motion: match &entry.motion {
            MotionEntry::Fixed(position) => Motion::Fixed(point(position)),
            MotionEntry::Track(_) => Motion::Track(track),
        },
        ranging: entry.ranging.map(|ranging| match ranging {
            Ranging::Rss { scale, path_loss } => {
                Ranging::Rss { scale: T::real(scale), path_loss: T::real(path_loss) }
            }
            Ranging::Toa { c1, c2, path_loss } => {
                Ranging::Toa { c1: T::real(c1), c2: T::real(c2), path_loss: T::real(path_loss) }
            }
        }),
        detection: entry.detection.map(detection),
        jam: Susceptibility {
            error_gain: T::real(entry.jam.error_gain),
            error_exponent: T::real(entry.jam.error_exponent),
            detect_gain: T::real(entry.jam.detect_gain),
            detect_exponent: T::real(entry.jam.detect_exponent),
        },
    }
}

fn detection<T: Real>(detection: Detection<f64>) -> Detection<T> {
    match detection {
        Detection::Proxy { scale, epsilon, path_loss } => {
            Detection::Proxy { scale: T::real(scale), epsilon: T::real(epsilon), path_loss: T::real(path_loss) }
        }
        Detection::Energy { samples, signal, noise, log_threshold, path_loss } => Detection::Energy {
            samples,
            signal: T::real(signal),
            noise: T::real(noise),
            log_threshold: T::real(log_threshold),
            path_loss: T::real(path_loss),
        },
    }
}

fn pooling<T: Real>(pooling: Pooling<f64>) -> Pooling<T> {
    match pooling {
        Pooling::None => Pooling::None,
        Pooling::Uncorrelated { log_threshold } => Pooling::Uncorrelated { log_threshold: T::real(log_threshold) },
        Pooling::Correlated { log_threshold, correlation } => {
            Pooling::Correlated { log_threshold: T::real(log_threshold), correlation: T::real(correlation) }
        }
    }
}

fn term<T: Real>(term: &Term<f64>) -> Term<T> {
    Term {
        metric: term.metric,
        sense: term.sense,
        reduce: term.reduce,
        weight: T::real(term.weight),
        agents: term.agents,
        window: window(&term.window),
    }
}
