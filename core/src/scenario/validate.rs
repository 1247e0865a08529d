//! The checks behind [`super::Scenario::new`], one function an item.
//!
//! Every check names the item and the field in the words of the scenario file.

use super::{
    Agent, BeamPattern, Betrayal, Detection, Domain, Draft, Limit, Motion, Pooling, Ranging, Region, Sensor, Shape,
    Side, Term, Window,
};
use crate::constraints::TOLERANCE;
use crate::constraints::region::{depth, horizontal};
use crate::error::{Error, Fault, Item};
use crate::math::{Point, Real, norm};

/// Largest number of samples of the energy detector, the paper's N.
const SAMPLES_MAX: u32 = 40_960;

/// A field of an item, and the questions that can be asked of its number.
struct Field(Item, &'static str);

impl Field {
    fn fails<V>(&self, fault: Fault) -> Result<V, Error> {
        Err(Error::new(self.0, self.1, fault))
    }

    fn finite<T: Real>(&self, value: T) -> Result<(), Error> {
        if value.finite() { Ok(()) } else { self.fails(Fault::NotFinite) }
    }

    fn positive<T: Real>(&self, value: T) -> Result<(), Error> {
        self.finite(value)?;
        if value > T::zero() { Ok(()) } else { self.fails(Fault::NotPositive { value: value.to_f64() }) }
    }

    fn not_negative<T: Real>(&self, value: T) -> Result<(), Error> {
        self.finite(value)?;
        if value >= T::zero() { Ok(()) } else { self.fails(Fault::Negative { value: value.to_f64() }) }
    }

    fn all_finite<T: Real, const DIM: usize>(&self, point: &Point<T, DIM>) -> Result<(), Error> {
        if point.iter().all(|component| component.finite()) { Ok(()) } else { self.fails(Fault::NotFinite) }
    }

    fn inside<T: Real, const DIM: usize>(&self, point: &Point<T, DIM>, domain: &Domain<T, DIM>) -> Result<(), Error> {
        self.all_finite(point)?;
        let holds = |(&component, (&low, &high)): (&T, (&T, &T))| low <= component && component <= high;
        let inside = point.iter().zip(domain.min.iter().zip(domain.max.iter())).all(holds);
        if inside { Ok(()) } else { self.fails(Fault::OutsideDomain) }
    }
}

/// Checks everything that does not depend on capacities.
pub(super) fn check<T: Real, const DIM: usize>(draft: &Draft<'_, T, DIM>) -> Result<(), Error> {
    let scenario = |field| Field(Item::Scenario, field);
    scenario("softening").positive(draft.softening)?;
    scenario("start_time").finite(draft.start_time)?;
    scenario("time.max").positive(draft.time.max)?;
    scenario("time.target").not_negative(draft.time.target)?;
    scenario("time.penalty").not_negative(draft.time.penalty)?;
    if draft.intervals == 0 {
        return scenario("grid.intervals").fails(Fault::NotPositive { value: 0.0 });
    }
    domain(&draft.domain)?;
    for (field, is_empty) in [("agent", draft.agents.is_empty()), ("objective.term", draft.terms.is_empty())] {
        if is_empty {
            return scenario(field).fails(Fault::Empty);
        }
    }
    for (index, entry) in draft.agents.iter().enumerate() {
        agent(Item::Agent(index), entry, draft)?;
    }
    for (index, entry) in draft.sensors.iter().enumerate() {
        sensor(Item::Sensor(index), entry)?;
    }
    pooling(draft)?;
    let ranging = draft.sensors.iter().filter(|sensor| sensor.ranging.is_some()).count();
    for (index, entry) in draft.terms.iter().enumerate() {
        term(Item::Term(index), entry, DIM, ranging)?;
    }
    for (index, entry) in draft.regions.iter().enumerate() {
        region(Item::Region(index), entry)?;
    }
    for (index, entry) in draft.limits.iter().enumerate() {
        limit(Item::Limit(index), entry, DIM, ranging)?;
    }
    region_ends(draft)?;
    separation(draft)
}

fn domain<T: Real, const DIM: usize>(domain: &Domain<T, DIM>) -> Result<(), Error> {
    Field(Item::Scenario, "domain.min").all_finite(&domain.min)?;
    Field(Item::Scenario, "domain.max").all_finite(&domain.max)?;
    if domain.min.iter().zip(domain.max.iter()).any(|(low, high)| low >= high) {
        return Field(Item::Scenario, "domain.min").fails(Fault::BoundsCrossed);
    }
    Ok(())
}

fn agent<T: Real, const DIM: usize>(
    item: Item,
    agent: &Agent<T, DIM>,
    draft: &Draft<'_, T, DIM>,
) -> Result<(), Error> {
    let field = |name| Field(item, name);
    field("start").inside(&agent.start, &draft.domain)?;
    field("goal").inside(&agent.goal, &draft.domain)?;
    field("speed_max").positive(agent.speed_max)?;
    field("accel_max").positive(agent.accel_max)?;
    field("weight").not_negative(agent.weight)?;
    if let Some(velocity) = agent.start_velocity {
        field("start_velocity").all_finite(&velocity)?;
    }
    if let Some(jammer) = agent.jammer {
        field("jammer.budget").not_negative(jammer.budget)?;
        if let BeamPattern::Cone { beam_width } = jammer.pattern {
            field("jammer.beam_width").positive(beam_width)?;
            let turn = T::PI + T::PI;
            if beam_width > turn {
                let (value, max) = (beam_width.to_f64(), turn.to_f64());
                return field("jammer.beam_width").fails(Fault::OutOfRange { value, min: 0.0, max });
            }
        }
        if let Betrayal::Max { q } = jammer.betrayal {
            field("jammer.q").finite(q)?;
            if q < T::one() {
                let (value, max) = (q.to_f64(), f64::from(f32::MAX));
                return field("jammer.q").fails(Fault::OutOfRange { value, min: 1.0, max });
            }
        }
    }
    if let Some(dropout) = agent.dropout {
        field("dropout.budget").not_negative(dropout.budget)?;
    }
    let needed = norm(&(agent.goal - agent.start)) / agent.speed_max;
    let allowed = draft.time.max - draft.start_time;
    if needed > allowed || allowed <= T::zero() {
        let (needed, allowed) = (needed.to_f64(), allowed.to_f64());
        return field("goal").fails(Fault::Unreachable { needed, allowed });
    }
    Ok(())
}

fn sensor<T: Real, const DIM: usize>(item: Item, sensor: &Sensor<'_, T, DIM>) -> Result<(), Error> {
    let field = |name| Field(item, name);
    match sensor.motion {
        Motion::Fixed(position) => field("position").all_finite(&position)?,
        Motion::Track([]) => return field("track").fails(Fault::Empty),
        Motion::Track(entries) => {
            for knot in entries {
                field("track").finite(knot.time)?;
                field("track").all_finite(&knot.position)?;
            }
            let late = entries.iter().zip(entries.iter().skip(1)).position(|(a, b)| b.time <= a.time);
            if let Some(index) = late {
                return field("track").fails(Fault::NotIncreasing { entry: index + 1 });
            }
        }
        Motion::Steady(sighting) => {
            field("time").finite(sighting.time)?;
            field("position").all_finite(&sighting.position)?;
            field("velocity").all_finite(&sighting.velocity)?;
        }
    }
    match sensor.ranging {
        Some(Ranging::Rss { scale, path_loss }) => {
            field("ranging.scale").positive(scale)?;
            field("ranging.path_loss").positive(path_loss)?;
        }
        Some(Ranging::Toa { c1, c2, path_loss }) => {
            field("ranging.c1").positive(c1)?;
            field("ranging.c2").not_negative(c2)?;
            field("ranging.path_loss").positive(path_loss)?;
        }
        None => {}
    }
    detection(item, sensor.detection)?;
    field("jam.error_gain").not_negative(sensor.jam.error_gain)?;
    field("jam.error_exponent").finite(sensor.jam.error_exponent)?;
    field("jam.detect_gain").not_negative(sensor.jam.detect_gain)?;
    field("jam.detect_exponent").finite(sensor.jam.detect_exponent)
}

fn detection<T: Real>(item: Item, detection: Option<Detection<T>>) -> Result<(), Error> {
    let field = |name| Field(item, name);
    match detection {
        Some(Detection::Proxy { scale, epsilon, path_loss }) => {
            field("detection.scale").not_negative(scale)?;
            field("detection.epsilon").not_negative(epsilon)?;
            field("detection.path_loss").positive(path_loss)
        }
        Some(Detection::Energy { samples, signal, noise, log_threshold, path_loss }) => {
            if samples == 0 || samples > SAMPLES_MAX {
                let range = Fault::OutOfRange { value: f64::from(samples), min: 1.0, max: f64::from(SAMPLES_MAX) };
                return field("detection.samples").fails(range);
            }
            field("detection.signal").positive(signal)?;
            field("detection.noise").positive(noise)?;
            field("detection.log_threshold").finite(log_threshold)?;
            field("detection.path_loss").positive(path_loss)
        }
        None => Ok(()),
    }
}

/// One test of all energy detectors: what betrays a jammer to a single sensor has no counterpart there.
fn pooling<T: Real, const DIM: usize>(draft: &Draft<'_, T, DIM>) -> Result<(), Error> {
    let scenario = |field| Field(Item::Scenario, field);
    match draft.pooling {
        Pooling::None => return Ok(()),
        Pooling::Uncorrelated { log_threshold } => scenario("pooling.log_threshold").finite(log_threshold)?,
        Pooling::Correlated { log_threshold, correlation } => {
            scenario("pooling.log_threshold").finite(log_threshold)?;
            let field = scenario("pooling.correlation");
            field.finite(correlation)?;
            if correlation < T::zero() || correlation > T::one() {
                return field.fails(Fault::OutOfRange { value: correlation.to_f64(), min: 0.0, max: 1.0 });
            }
            same_samples(draft)?;
        }
    }
    for (index, agent) in draft.agents.iter().enumerate() {
        if agent.jammer.is_some_and(|jammer| jammer.betrayal != Betrayal::None) {
            return Field(Item::Agent(index), "jammer.detection_model").fails(Fault::NotWithPooling);
        }
    }
    Ok(())
}

/// Correlated signals are sampled at the same instants.
fn same_samples<T: Real, const DIM: usize>(draft: &Draft<'_, T, DIM>) -> Result<(), Error> {
    let mut others = None;
    for (index, sensor) in draft.sensors.iter().enumerate() {
        let Some(Detection::Energy { samples, .. }) = sensor.detection else {
            continue;
        };
        let others = *others.get_or_insert(samples);
        if samples != others {
            return Field(Item::Sensor(index), "detection.samples").fails(Fault::UnequalSamples { samples, others });
        }
    }
    Ok(())
}

fn window<T: Real>(item: Item, window: &Window<T>) -> Result<(), Error> {
    if window.from < window.until { Ok(()) } else { Field(item, "from").fails(Fault::BoundsCrossed) }
}

fn term<T: Real>(item: Item, term: &Term<T>, dimension: usize, ranging: usize) -> Result<(), Error> {
    Field(item, "weight").not_negative(term.weight)?;
    window(item, &term.window)?;
    metric(item, term.metric.is_location_error(), dimension, ranging)
}

fn metric(item: Item, is_location_error: bool, dimension: usize, have: usize) -> Result<(), Error> {
    let need = dimension + 1;
    if is_location_error && have < need {
        return Field(item, "metric").fails(Fault::TooFewRanging { have, need });
    }
    Ok(())
}

fn region<T: Real>(item: Item, region: &Region<T>) -> Result<(), Error> {
    // A polygon was checked when it was made.
    if let Shape::Circle { center, radius } = &region.shape {
        Field(item, "center").all_finite(center)?;
        Field(item, "radius").positive(*radius)?;
    }
    window(item, &region.window)
}

/// Refuses a start or goal that no plan can keep out of a region, or in one: where the region applies to the first, or
/// the last, interval of every plan that leaves and arrives in time.
fn region_ends<T: Real, const DIM: usize>(draft: &Draft<'_, T, DIM>) -> Result<(), Error> {
    let fastest = |agent: &Agent<T, DIM>| norm(&(agent.goal - agent.start)) / agent.speed_max;
    let shortest = draft.agents.iter().map(fastest).fold(T::zero(), Real::max);
    let longest = draft.time.max - draft.start_time;
    let always = |window: &Window<T>, share: T| {
        window.holds(draft.start_time + shortest * share) && window.holds(draft.start_time + longest * share)
    };
    let first_interval = T::one() / T::from_count(draft.intervals);
    for (index, agent) in draft.agents.iter().enumerate() {
        for (name, position, share) in [("start", &agent.start, first_interval), ("goal", &agent.goal, T::one())] {
            let position = horizontal(position);
            let breaks = |region: &Region<T>| {
                always(&region.window, share) && depth(region, &position, &position) > T::real(TOLERANCE)
            };
            if let Some((region, broken)) = draft.regions.iter().enumerate().find(|(_, region)| breaks(region)) {
                return Field(Item::Agent(index), name).fails(match broken.side {
                    Side::Outside => Fault::InsideRegion { region },
                    Side::Inside => Fault::OutsideRegion { region },
                });
            }
        }
    }
    Ok(())
}

/// Refuses agents that start or arrive closer together than they may come.
fn separation<T: Real, const DIM: usize>(draft: &Draft<'_, T, DIM>) -> Result<(), Error> {
    let Some(least) = draft.separation else { return Ok(()) };
    Field(Item::Scenario, "separation").positive(least)?;
    for (index, agent) in draft.agents.iter().enumerate() {
        for (other, before) in draft.agents.iter().enumerate().take(index) {
            for (name, a, b) in [("start", &before.start, &agent.start), ("goal", &before.goal, &agent.goal)] {
                let distance = norm(&(a - b));
                if (least - distance) / least > T::real(TOLERANCE) {
                    let (distance, least) = (distance.to_f64(), least.to_f64());
                    return Field(Item::Agent(index), name).fails(Fault::TooClose { other, distance, least });
                }
            }
        }
    }
    Ok(())
}

fn limit<T: Real>(item: Item, limit: &Limit<T>, dimension: usize, ranging: usize) -> Result<(), Error> {
    for (name, bound) in [("min", limit.min), ("max", limit.max)] {
        if let Some(value) = bound {
            Field(item, name).finite(value)?;
        }
    }
    match (limit.min, limit.max) {
        (None, None) => return Field(item, "max").fails(Fault::Empty),
        (Some(low), Some(high)) if low > high => {
            return Field(item, "min").fails(Fault::BoundsCrossed);
        }
        _ => {}
    }
    metric(item, limit.metric.is_location_error(), dimension, ranging)
}
