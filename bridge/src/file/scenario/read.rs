//! From text to [`ScenarioFile`].

use std::path::Path;

use quietpath_core::Metric;
use quietpath_core::horizon::{Cadence, Reveal};
use quietpath_core::scenario::{
    AgentSet, BeamPattern, Betrayal, Detection, Dropout, Jammer, Limit, Pooling, Ranging, Reduce, ReferencePoint,
    Sense, Side, Susceptibility, Term, Timing, Window,
};

use super::study::study;
use super::{
    AgentEntry, Bounds, FrameSpec, KnotEntry, Loaded, MotionEntry, Origin, Outline, RegionEntry, Rolling,
    ScenarioFile, SensorEntry,
};
use crate::capacity;
use crate::file::FileError;
use crate::file::error::suggestion;
use crate::file::reader::{Outcome, Source, Table, Value};

pub(super) const TOP: &[&str] = &[
    "name",
    "dimension",
    "softening",
    "reference_point",
    "pooling",
    "start_time",
    "separation",
    "frame",
    "grid",
    "time",
    "domain",
    "agent",
    "sensor",
    "objective",
    "region",
    "limit",
    "rolling",
    "study",
];
pub(super) const JAMMER: &[&str] = &["pattern", "beam_width", "budget", "detection_model", "q", "live"];
pub(super) const AGENT: &[&str] =
    &["name", "start", "goal", "start_velocity", "speed_max", "accel_max", "weight", "jammer", "dropout"];
pub(super) const SENSOR: &[&str] = &["name", "position", "track", "ranging", "detection", "jam"];
pub(super) const TERM: &[&str] = &["metric", "sense", "reduce", "weight", "agents", "from", "until"];

impl ScenarioFile {
    /// Reads a scenario file; `-` is standard input.
    ///
    /// # Errors
    /// The file cannot be read, or anything that [`ScenarioFile::parse`] refuses.
    pub fn read(path: &str) -> Result<Loaded, Box<FileError>> {
        let help = "give the path of a scenario file, or `-` to read it from standard input";
        let (name, text) = crate::file::read_text(path, help)?;
        Self::parse(&name, &text)
    }

    /// Reads a scenario from text; `name` is what errors call the file.
    ///
    /// # Errors
    /// The first thing that is wrong: broken TOML, keys that are unknown or missing, values of a wrong type or
    /// out of range, and all that [`quietpath_core::Scenario::new`] refuses.
    pub fn parse(name: &str, text: &str) -> Result<Loaded, Box<FileError>> {
        let source = Source { name: name.to_owned(), text: text.to_owned() };
        let scenario = scenario(&source)?;
        scenario.validate()?;
        let warnings = scenario.warnings();
        Ok(Loaded { scenario, warnings })
    }
}

fn scenario(source: &Source) -> Outcome<ScenarioFile> {
    let document = source.document()?;
    let top = Table::top(source, &document, TOP)?;
    let stem = Path::new(&source.name).file_stem().map(|stem| stem.to_string_lossy().into_owned());
    let dimension = dimension(&top)?;
    let points = [("current", ReferencePoint::Current), ("lagged", ReferencePoint::Lagged)];
    let agents = agents(&top, dimension)?;
    let intervals = intervals(&top)?;
    Ok(ScenarioFile {
        source: source.clone(),
        name: top.text_optional("name")?.or(stem).unwrap_or_default(),
        dimension,
        softening: top.number_or("softening", 1e-3)?,
        reference_point: top.choice("reference_point", &points, Some(ReferencePoint::Current))?,
        pooling: pooling(&top)?,
        start_time: top.number_or("start_time", 0.0)?,
        separation: positive_optional(&top, "separation")?,
        frame: frame(&top)?,
        intervals,
        time: timing(&top)?,
        domain: domain(&top, dimension)?,
        sensors: sensors(&top, dimension)?,
        terms: terms(&top, &agents)?,
        agents,
        regions: regions(&top)?,
        limits: limits(&top)?,
        rolling: rolling(&top, intervals)?,
        study: study(&top)?,
    })
}

/// A table that must be there.
fn section<'a>(top: &Table<'a>, key: &str, keys: &'static [&'static str], example: &str) -> Outcome<Table<'a>> {
    let help = format!("add a section [{key}] with {example}");
    top.table(key, keys)?.ok_or_else(|| top.error(key, "is missing", help))
}

pub(super) fn positive_optional(table: &Table<'_>, key: &str) -> Outcome<Option<f64>> {
    match table.number_optional(key)? {
        Some(value) if value <= 0.0 => {
            Err(table.error(key, format!("must be greater than 0, not {value}"), "give a positive number"))
        }
        other => Ok(other),
    }
}

fn dimension(top: &Table<'_>) -> Outcome<usize> {
    let Some(value) = top.optional("dimension") else { return Ok(2) };
    match value.count()? {
        dimension @ (2 | 3) => Ok(dimension),
        other => Err(value.error(format!("must be 2 or 3, not {other}"), "2 is east, north; 3 is east, north, up")),
    }
}

fn frame(top: &Table<'_>) -> Outcome<FrameSpec> {
    let keys = &["unit_m", "latitude_deg", "longitude_deg", "altitude_m"];
    let Some(table) = top.table("frame", keys)? else { return Ok(FrameSpec { unit_m: 1.0, origin: None }) };
    let unit_m = positive_optional(&table, "unit_m")?.unwrap_or(1.0);
    let degrees = |key: &str, limit: f64| -> Outcome<Option<f64>> {
        match table.number_optional(key)? {
            Some(value) if value.abs() > limit => {
                let message = format!("must lie between -{limit} and {limit}, but is {value}");
                Err(table.error(key, message, "give degrees, north and east positive"))
            }
            other => Ok(other),
        }
    };
    let (latitude, longitude) = (degrees("latitude_deg", 90.0)?, degrees("longitude_deg", 180.0)?);
    let altitude = table.number_optional("altitude_m")?;
    let together = "latitude_deg, longitude_deg and altitude_m place a scenario together; \
                    without latitude and longitude it can be planned, but not flown";
    let origin = match (latitude, longitude, altitude) {
        (Some(latitude_deg), Some(longitude_deg), Some(altitude_m)) => {
            Some(Origin { latitude_deg, longitude_deg, altitude_m })
        }
        (None, None, _) => None,
        (None, _, _) => return Err(table.error("latitude_deg", "is missing", together)),
        (_, None, _) => return Err(table.error("longitude_deg", "is missing", together)),
        (_, _, None) => return Err(table.error("altitude_m", "is missing", together)),
    };
    Ok(FrameSpec { unit_m, origin })
}

fn intervals(top: &Table<'_>) -> Outcome<usize> {
    let grid = section(top, "grid", &["intervals"], "`intervals = 60`")?;
    let value = grid.required("intervals", "60")?;
    let room = format!("use 1 to {} intervals", capacity::INTERVALS);
    match value.count()? {
        0 => Err(value.error("must be greater than 0, not 0", room)),
        many if many > capacity::INTERVALS => {
            let capacity = capacity::INTERVALS;
            Err(value.error(format!("is {many}, and this build has room for {capacity} intervals"), room))
        }
        intervals => Ok(intervals),
    }
}

fn timing(top: &Table<'_>) -> Outcome<Timing<f64>> {
    let time = section(top, "time", &["max", "target", "penalty"], "`max = 300.0`")?;
    Ok(Timing {
        max: time.required("max", "300.0")?.number()?,
        target: time.number_or("target", 0.0)?,
        penalty: time.number_or("penalty", 0.0)?,
    })
}

fn domain(top: &Table<'_>, dimension: usize) -> Outcome<Bounds> {
    let domain = section(top, "domain", &["min", "max"], "`min = [..]` and `max = [..]`")?;
    Ok(Bounds {
        min: domain.required("min", "[0.0, 0.0]")?.point(dimension)?,
        max: domain.required("max", "[10.0, 10.0]")?.point(dimension)?,
    })
}

fn agents(top: &Table<'_>, dimension: usize) -> Outcome<Vec<AgentEntry>> {
    let mut agents: Vec<AgentEntry> = Vec::new();
    for (index, table) in top.tables("agent", AGENT)?.iter().enumerate() {
        let name = table.text_optional("name")?.unwrap_or_else(|| format!("uav{}", index + 1));
        if name.is_empty() {
            return Err(table.error("name", "must not be empty", "give every agent a name of its own"));
        }
        if let Some(first) = agents.iter().position(|agent| agent.name == name) {
            let message = format!("is `{name}`, the name of agent[{first}] already");
            return Err(table.error("name", message, "give every agent a name of its own"));
        }
        let velocity = table.optional("start_velocity").map(|value| value.point(dimension)).transpose()?;
        agents.push(AgentEntry {
            name,
            start: table.required("start", "[0.0, 0.0]")?.point(dimension)?,
            goal: table.required("goal", "[10.0, 10.0]")?.point(dimension)?,
            start_velocity: velocity,
            speed_max: table.number("speed_max")?,
            accel_max: table.number("accel_max")?,
            weight: table.number_or("weight", 1.0)?,
            jammer: jammer(table)?,
            jammer_live: jammer_live(table)?,
            dropout: dropout(table)?,
        });
    }
    Ok(agents)
}

fn jammer(agent: &Table<'_>) -> Outcome<Option<Jammer<f64>>> {
    let Some(table) = agent.table("jammer", JAMMER)? else { return Ok(None) };
    let patterns = [("isotropic", 0), ("cosine", 1), ("cone", 2)];
    let pattern = match table.choice("pattern", &patterns, Some(0))? {
        0 => BeamPattern::Isotropic,
        1 => BeamPattern::Cosine,
        _ => BeamPattern::Cone { beam_width: table.required("beam_width", "1.5")?.number()? },
    };
    let q = table.number_or("q", 15.0)?;
    let models = [
        ("none", Betrayal::None),
        ("max", Betrayal::Max { q }),
        ("linear", Betrayal::Linear),
        ("sigmoid", Betrayal::Sigmoid),
    ];
    let betrayal = table.choice("detection_model", &models, Some(Betrayal::None))?;
    // A number that the chosen model does not use must still be a number.
    table.number_optional("beam_width")?;
    Ok(Some(Jammer { pattern, betrayal, budget: table.number_or("budget", 0.0)? }))
}

/// Whether the scenario allows its jammer to be switched on in flight.
fn jammer_live(agent: &Table<'_>) -> Outcome<bool> {
    let Some(table) = agent.table("jammer", JAMMER)? else { return Ok(false) };
    Ok(table.optional("live").map(|value| value.truth()).transpose()?.unwrap_or(false))
}

fn dropout(agent: &Table<'_>) -> Outcome<Option<Dropout<f64>>> {
    let Some(table) = agent.table("dropout", &["budget"])? else { return Ok(None) };
    Ok(Some(Dropout { budget: table.number_or("budget", 0.0)? }))
}

fn sensors(top: &Table<'_>, dimension: usize) -> Outcome<Vec<SensorEntry>> {
    let read = |(index, table): (usize, Table<'_>)| {
        Ok(SensorEntry {
            name: table.text_optional("name")?.unwrap_or_else(|| format!("s{}", index + 1)),
            motion: motion(&table, dimension)?,
            ranging: table.optional("ranging").map(|value| ranging(&value)).transpose()?,
            detection: table.optional("detection").map(|value| detection(&value)).transpose()?,
            jam: susceptibility(&table)?,
        })
    };
    top.tables("sensor", SENSOR)?.into_iter().enumerate().map(read).collect()
}

fn motion(sensor: &Table<'_>, dimension: usize) -> Outcome<MotionEntry> {
    match (sensor.optional("position"), sensor.optional("track")) {
        (Some(position), None) => Ok(MotionEntry::Fixed(position.point(dimension)?)),
        (None, Some(_)) => {
            let knot = |knot: Table<'_>| {
                let time = knot.required("t", "0.0")?.number()?;
                Ok(KnotEntry { time, position: knot.required("position", "[0.0, 0.0]")?.point(dimension)? })
            };
            let entries = sensor.tables("track", &["t", "position"])?.into_iter().map(knot);
            Ok(MotionEntry::Track(entries.collect::<Outcome<_>>()?))
        }
        (Some(_), Some(_)) => {
            let help = "keep `position` for a sensor that stays, `track` for one that moves";
            Err(sensor.error("track", "must not stand beside `position`", help))
        }
        (None, None) => {
            let help =
                "add `position = [..]`, or `track = [{ t = 0.0, position = [..] }, ..]` for a sensor that moves";
            Err(sensor.error("position", "is missing", help))
        }
    }
}

fn ranging(value: &Value<'_>) -> Outcome<Ranging<f64>> {
    let rss: &[&str] = &["model", "scale", "path_loss"];
    let toa: &[&str] = &["model", "c1", "c2", "path_loss"];
    let table = value.variant("model", &[("rss", rss), ("toa", toa)])?;
    let path_loss = table.number("path_loss")?;
    if table.text_optional("model")?.as_deref() == Some("rss") {
        return Ok(Ranging::Rss { scale: table.number("scale")?, path_loss });
    }
    Ok(Ranging::Toa { c1: table.number("c1")?, c2: table.number("c2")?, path_loss })
}

fn detection(value: &Value<'_>) -> Outcome<Detection<f64>> {
    let proxy: &[&str] = &["model", "scale", "epsilon", "path_loss"];
    let energy: &[&str] = &["model", "samples", "signal", "noise", "log_threshold", "path_loss"];
    let table = value.variant("model", &[("proxy", proxy), ("energy", energy)])?;
    let path_loss = table.number("path_loss")?;
    if table.text_optional("model")?.as_deref() == Some("proxy") {
        return Ok(Detection::Proxy { scale: table.number("scale")?, epsilon: table.number("epsilon")?, path_loss });
    }
    let samples = table.required("samples", "100")?.count()?;
    Ok(Detection::Energy {
        // Beyond u32 lies beyond the core's own bound, which the core reports.
        samples: u32::try_from(samples).unwrap_or(u32::MAX),
        signal: table.number("signal")?,
        noise: table.number("noise")?,
        log_threshold: table.number("log_threshold")?,
        path_loss,
    })
}

fn pooling(top: &Table<'_>) -> Outcome<Pooling<f64>> {
    let Some(value) = top.optional("pooling") else { return Ok(Pooling::None) };
    let uncorrelated: &[&str] = &["model", "log_threshold"];
    let correlated: &[&str] = &["model", "log_threshold", "correlation"];
    let table = value.variant("model", &[("uncorrelated", uncorrelated), ("correlated", correlated)])?;
    let log_threshold = table.number("log_threshold")?;
    if table.text_optional("model")?.as_deref() == Some("uncorrelated") {
        return Ok(Pooling::Uncorrelated { log_threshold });
    }
    Ok(Pooling::Correlated { log_threshold, correlation: table.number("correlation")? })
}

fn susceptibility(sensor: &Table<'_>) -> Outcome<Susceptibility<f64>> {
    let keys = &["error_gain", "error_exponent", "detect_gain", "detect_exponent"];
    let table = sensor.table("jam", keys)?;
    let number = |key: &str, default: f64| match &table {
        Some(table) => table.number_or(key, default),
        None => Ok(default),
    };
    Ok(Susceptibility {
        error_gain: number("error_gain", 0.0)?,
        error_exponent: number("error_exponent", 2.0)?,
        detect_gain: number("detect_gain", 0.0)?,
        detect_exponent: number("detect_exponent", 2.0)?,
    })
}

fn window(table: &Table<'_>) -> Outcome<Window<f64>> {
    Ok(Window { from: table.number_or("from", f64::NEG_INFINITY)?, until: table.number_or("until", f64::INFINITY)? })
}

fn metric(table: &Table<'_>) -> Outcome<Metric> {
    let metrics: Vec<(&str, Metric)> = Metric::ALL.iter().map(|metric| (metric.name(), *metric)).collect();
    table.choice("metric", &metrics, None)
}

fn terms(top: &Table<'_>, agents: &[AgentEntry]) -> Outcome<Vec<Term<f64>>> {
    let Some(objective) = top.table("objective", &["term"])? else { return Ok(Vec::new()) };
    let senses = [("min", Sense::Minimize), ("max", Sense::Maximize)];
    let reduces = [("integral", Reduce::Integral), ("extreme", Reduce::Extreme)];
    let read = |table: Table<'_>| {
        Ok(Term {
            metric: metric(&table)?,
            sense: table.choice("sense", &senses, Some(Sense::Minimize))?,
            reduce: table.choice("reduce", &reduces, Some(Reduce::Integral))?,
            weight: table.number_or("weight", 1.0)?,
            agents: agent_set(&table, agents)?,
            window: window(&table)?,
        })
    };
    objective.tables("term", TERM)?.into_iter().map(read).collect()
}

fn agent_set(term: &Table<'_>, agents: &[AgentEntry]) -> Outcome<AgentSet> {
    let Some(list) = term.optional("agents") else { return Ok(AgentSet::ALL) };
    let names: Vec<&str> = agents.iter().map(|agent| agent.name.as_str()).collect();
    let entries = list.entries()?;
    if entries.is_empty() {
        let help = format!("leave it out for all agents, or name some: {}", crate::file::error::listed(&names));
        return Err(list.error("needs at least one entry", help));
    }
    let mut set = 0;
    for entry in entries {
        let given = entry.text()?;
        match names.iter().position(|name| *name == given) {
            Some(index) => set |= 1_u32.checked_shl(u32::try_from(index).unwrap_or(u32::MAX)).unwrap_or(0),
            None => {
                let message = format!("names `{given}`, and there is no such agent");
                return Err(entry.error(message, suggestion(given, &names, "agents here are")));
            }
        }
    }
    Ok(AgentSet(set))
}

fn regions(top: &Table<'_>) -> Outcome<Vec<RegionEntry>> {
    let read = |(index, table): (usize, Table<'_>)| {
        let side = match table.optional("inside").map(|value| value.truth()).transpose()? {
            Some(true) => Side::Inside,
            _ => Side::Outside,
        };
        Ok(RegionEntry {
            name: table.text_optional("name")?.unwrap_or_else(|| format!("region{}", index + 1)),
            outline: outline(&table)?,
            side,
            window: window(&table)?,
        })
    };
    let keys = &["name", "center", "radius", "polygon", "inside", "from", "until"];
    top.tables("region", keys)?.into_iter().enumerate().map(read).collect()
}

/// A circle or a polygon.
fn outline(region: &Table<'_>) -> Outcome<Outline> {
    let Some(polygon) = region.optional("polygon") else {
        let help = "add `center = [..]` and `radius = ..`, or `polygon = [[..], [..], [..]]`";
        let center = region.optional("center").ok_or_else(|| region.error("center", "is missing", help))?;
        return Ok(Outline::Circle { center: horizontal(&center)?, radius: region.number("radius")? });
    };
    for key in ["center", "radius"] {
        if region.optional(key).is_some() {
            let help = "keep `polygon`, or `center` and `radius` for a circle";
            return Err(region.error(key, "must not stand beside `polygon`", help));
        }
    }
    polygon.entries()?.iter().map(horizontal).collect::<Outcome<_>>().map(Outline::Polygon)
}

/// A pair of numbers, whatever the dimension.
fn horizontal(value: &Value<'_>) -> Outcome<[f64; 2]> {
    match value.point(2)?.as_slice() {
        &[east, north] => Ok([east, north]),
        _ => Err(value.error("must have 2 numbers", "write [east, north]")),
    }
}

fn limits(top: &Table<'_>) -> Outcome<Vec<Limit<f64>>> {
    let read = |table: Table<'_>| {
        let (min, max) = (table.number_optional("min")?, table.number_optional("max")?);
        Ok(Limit { metric: metric(&table)?, min, max })
    };
    top.tables("limit", &["metric", "min", "max"])?.into_iter().map(read).collect()
}

fn rolling(top: &Table<'_>, intervals: usize) -> Outcome<Option<Rolling>> {
    let Some(table) = top.table("rolling", &["steps", "adaptive", "reveal"])? else { return Ok(None) };
    let known = [("current", Reveal::Current), ("predicted", Reveal::Predicted), ("known", Reveal::Known)];
    let reveal = table.choice("reveal", &known, Some(Reveal::Current))?;
    let adaptive = table.table("adaptive", &["shortest", "longest", "change"])?;
    let cadence = match (table.optional("steps"), adaptive) {
        (Some(steps), None) => Cadence::Even { steps: within(&steps, [1, intervals], "such as 18")? },
        (None, Some(lengths)) => adaptive_steps(&lengths, intervals)?,
        (Some(_), Some(_)) => {
            let help =
                "keep `steps` for steps of equal length, `adaptive` for steps that follow the change that is seen";
            return Err(table.error("adaptive", "must not stand beside `steps`", help));
        }
        (None, None) => {
            let help = "add `steps = 18`, or `adaptive = { shortest = 1, longest = 10, change = 0.05 }`";
            return Err(table.error("steps", "is missing", help));
        }
    };
    Ok(Some(Rolling { cadence, reveal }))
}

fn adaptive_steps(lengths: &Table<'_>, intervals: usize) -> Outcome<Cadence<f64>> {
    let shortest = within(&lengths.required("shortest", "1")?, [1, intervals], "the intervals of the shortest step")?;
    let longest =
        within(&lengths.required("longest", "10")?, [shortest, intervals], "the intervals of the longest step")?;
    let change = lengths.required("change", "0.05")?;
    match change.number()? {
        much if much > 0.0 => Ok(Cadence::Adaptive { shortest, longest, change: much }),
        little => {
            let help = "give the mean change of the metric along the plan, as a part of its span, from which on steps shorten";
            Err(change.error(format!("must be greater than 0, not {little}"), help))
        }
    }
}

/// A whole number between two bounds.
fn within(value: &Value<'_>, [least, most]: [usize; 2], what: &str) -> Outcome<usize> {
    match value.count()? {
        0 => Err(value.error("must be greater than 0, not 0", format!("give a whole number, {what}"))),
        count if (least..=most).contains(&count) => Ok(count),
        count => {
            let help = format!("give a whole number, {what}; the flight has {most} intervals");
            Err(value.error(format!("must lie between {least} and {most}, but is {count}"), help))
        }
    }
}
