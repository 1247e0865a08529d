//! Plan files: a plan as JSON, in the units of its scenario.
//!
//! ```json
//! {"scenario": "..", "start_time": 0.0, "duration": 110.0, "objective": 12.3, "status": "converged",
//!  "timing": {"plan_seconds": 0.01},
//!  "agents": [{"name": "uav1", "path": [[0.8, 1.0], ..], "jam": [..], "azimuth": [..], "dropout": [..]}]}
//! ```
//!
//! | key | unit | shape |
//! |---|---|---|
//! | `start_time`, `duration` | s | |
//! | `times` | s | N + 1; only of a path flown in steps |
//! | `path` | length units | N + 1 points |
//! | `jam`, `dropout` | 0 .. 1 | N + 1, or left out for zeros |
//! | `azimuth` | rad, counter-clockwise from east | N + 1, or left out for zeros |
//!
//! Numbers are written with the fewest digits that read back as the same bits. Other keys are ignored in
//! reading, and a plan may stand inside an object as its `plan`.

use std::fmt::Write as _;

use serde::{Deserialize, Serialize};

use super::error::listed;
use super::{FileError, Place, ScenarioFile};

/// How long things took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PlanTiming {
    /// The planning call alone, s.
    pub plan_seconds: f64,
}

/// One agent's path and controls.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AgentPlan {
    /// Name of the agent.
    pub name: String,
    /// Positions, length units, N + 1.
    pub path: Vec<Vec<f64>>,
    /// Jamming levels, 0 to 1, N + 1; zeros where left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub jam: Option<Vec<f64>>,
    /// Jamming directions, rad, N + 1; zeros where left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub azimuth: Option<Vec<f64>>,
    /// Reductions of transmit power, 0 to 1, N + 1; zeros where left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dropout: Option<Vec<f64>>,
}

/// A plan, as its file holds it. See the [module](self).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PlanFile {
    /// Name of the scenario.
    #[serde(default)]
    pub scenario: String,
    /// Time at node 0, s.
    #[serde(default)]
    pub start_time: f64,
    /// Flight time, s.
    pub duration: f64,
    /// The objective that the plan claims.
    #[serde(default)]
    pub objective: Option<f64>,
    /// How planning ended.
    #[serde(default)]
    pub status: Option<String>,
    /// How long planning took.
    #[serde(default)]
    pub timing: Option<PlanTiming>,
    /// Node times, s, N + 1; equal intervals where left out.
    #[serde(default)]
    pub times: Option<Vec<f64>>,
    /// Paths and controls, in the order of the scenario's agents.
    pub agents: Vec<AgentPlan>,
}

/// A file that holds a plan as its `plan`, beside other things.
#[derive(Deserialize)]
struct Wrapped {
    plan: PlanFile,
}

impl PlanFile {
    /// Reads a plan file; `-` is standard input.
    ///
    /// # Errors
    /// The file cannot be read, or what [`PlanFile::parse`] refuses.
    pub fn read(path: &str) -> Result<Self, Box<FileError>> {
        let (name, text) = super::read_text(path, "give the path of a plan, as `quietpath plan` writes it")?;
        Self::parse(&name, &text)
    }

    /// Reads a plan from text; `name` is what errors call the file.
    ///
    /// # Errors
    /// Broken JSON, missing keys, wrong types, by field and line. Whether it fits a scenario is for
    /// [`PlanFile::fits`] to say.
    pub fn parse(name: &str, text: &str) -> Result<Self, Box<FileError>> {
        // A first look without types: broken JSON has no field, and a wrapped plan has its own shape.
        let value: Result<Probe, _> = serde_json::from_str(text);
        let wrapped = value.map_err(|error| json_error(name, text, "", &error))?.plan.is_some();
        let mut json = serde_json::Deserializer::from_str(text);
        let plan = if wrapped {
            serde_path_to_error::deserialize(&mut json).map(|wrapped: Wrapped| wrapped.plan)
        } else {
            serde_path_to_error::deserialize(&mut json)
        };
        plan.map_err(|error| {
            let field = error.path().to_string();
            json_error(name, text, if field == "." { "" } else { &field }, error.inner())
        })
    }

    /// Writes the plan as JSON, one node a line.
    #[must_use]
    pub fn to_json(&self) -> String {
        let mut out = String::from("{\n");
        let mut entry = |key: &str, value: String| {
            let _ = writeln!(out, "  \"{key}\": {value},");
        };
        entry("scenario", json(&self.scenario));
        entry("start_time", json(&self.start_time));
        entry("duration", json(&self.duration));
        if let Some(objective) = self.objective {
            entry("objective", json(&objective));
        }
        if let Some(status) = &self.status {
            entry("status", json(status));
        }
        if let Some(timing) = self.timing {
            entry("timing", json(&timing));
        }
        if let Some(times) = &self.times {
            entry("times", json(times));
        }
        out.push_str("  \"agents\": [");
        for (index, agent) in self.agents.iter().enumerate() {
            let separator = if index == 0 { "" } else { "," };
            let nodes: Vec<String> = agent.path.iter().map(|point| format!("        {}", json(point))).collect();
            let _ = write!(out, "{separator}\n    {{\n      \"name\": {},\n", json(&agent.name));
            let _ = write!(out, "      \"path\": [\n{}\n      ]", nodes.join(",\n"));
            for (key, control) in [("jam", &agent.jam), ("azimuth", &agent.azimuth), ("dropout", &agent.dropout)] {
                if let Some(values) = control {
                    let _ = write!(out, ",\n      \"{key}\": {}", json(values));
                }
            }
            out.push_str("\n    }");
        }
        out.push_str("\n  ]\n}\n");
        out
    }

    /// Nodes N + 1, of the first agent.
    #[must_use]
    pub fn nodes(&self) -> usize {
        self.agents.first().map_or(0, |agent| agent.path.len())
    }

    /// Node times, s: as given, or equal intervals.
    #[must_use]
    pub fn node_times(&self) -> Vec<f64> {
        let nodes = self.nodes();
        let interval = self.duration / (nodes.max(2) - 1) as f64;
        let equal = |node: usize| self.start_time + interval * node as f64;
        self.times.clone().unwrap_or_else(|| (0..nodes).map(equal).collect())
    }

    /// Checks that the plan has the shape of the scenario; `name` is what errors call the plan's file.
    ///
    /// The number of intervals is the plan's own: a plan need not have been made on the scenario's grid.
    ///
    /// # Errors
    /// Agents that are missing, unknown or in another order, positions of another dimension, lists of different
    /// lengths, too many nodes, a flight time that is not positive, times that do not increase.
    pub fn fits(&self, name: &str, scenario: &ScenarioFile) -> Result<(), Box<FileError>> {
        let fail = |field: String, message: String, help: &str| misfit(name, field, message, help);
        if self.duration <= 0.0 {
            let message = format!("must be greater than 0, not {}", self.duration);
            return fail("duration".into(), message, "give the flight time in seconds");
        }
        let expected: Vec<&str> = scenario.agents.iter().map(|agent| agent.name.as_str()).collect();
        for (index, agent) in self.agents.iter().enumerate() {
            let field = format!("agents[{index}].name");
            match expected.iter().position(|name| *name == agent.name) {
                Some(place) if place == index => {}
                Some(place) => {
                    let message = format!("is `{}`, which is agent[{place}] of the scenario", agent.name);
                    return fail(field, message, "keep the order of the scenario's agents");
                }
                None => {
                    let message = format!("is `{}`, and the scenario has no such agent", agent.name);
                    return fail(field, message, &format!("its agents are {}", listed(&expected)));
                }
            }
        }
        if let Some(missing) = expected.get(self.agents.len()) {
            return fail(
                "agents".into(),
                format!("has no `{missing}`"),
                "give a path for every agent of the scenario",
            );
        }
        self.shape(name, scenario.dimension)
    }

    /// Checks the lengths of all lists.
    fn shape(&self, name: &str, dimension: usize) -> Result<(), Box<FileError>> {
        let fail = |field: String, message: String, help: &str| misfit(name, field, message, help);
        let (nodes, capacity) = (self.nodes(), crate::capacity::NODES);
        if !(2..=capacity).contains(&nodes) {
            let message = format!("has {nodes} nodes");
            return fail(
                "agents[0].path".into(),
                message,
                &format!("a path has 2 to {capacity} nodes in this build"),
            );
        }
        let wrong = |field: String, count: usize| {
            let help = "all lists have one entry a node, N + 1 of them";
            fail(field, format!("has {count} entries, and agents[0].path has {nodes}"), help)
        };
        for (index, agent) in self.agents.iter().enumerate() {
            if agent.path.len() != nodes {
                return wrong(format!("agents[{index}].path"), agent.path.len());
            }
            if let Some(node) = agent.path.iter().position(|point| point.len() != dimension) {
                let count = agent.path.get(node).map_or(0, Vec::len);
                let message = format!("must have {dimension} numbers, not {count}");
                return fail(format!("agents[{index}].path[{node}]"), message, "use the scenario's dimension");
            }
            for (key, control) in [("jam", &agent.jam), ("azimuth", &agent.azimuth), ("dropout", &agent.dropout)] {
                // An empty list stands for zeros, as one that is left out does.
                if let Some(values) = control.as_ref().filter(|values| !values.is_empty() && values.len() != nodes) {
                    return wrong(format!("agents[{index}].{key}"), values.len());
                }
            }
        }
        if let Some(times) = &self.times {
            if times.len() != nodes {
                return wrong("times".into(), times.len());
            }
            if let Some(late) = times.iter().zip(times.iter().skip(1)).position(|(a, b)| b <= a) {
                let message = "must be later than the time before it".to_owned();
                return fail(format!("times[{}]", late + 1), message, "times must increase from node to node");
            }
        }
        Ok(())
    }
}

/// A plan that does not have the shape of its scenario.
fn misfit(name: &str, field: String, message: String, help: &str) -> Result<(), Box<FileError>> {
    let (name, help) = (name.to_owned(), help.to_owned());
    Err(Box::new(FileError { name, place: None, field, message, help }))
}

/// Whether the top of a file has a `plan`.
#[derive(Deserialize)]
struct Probe {
    #[serde(default)]
    plan: Option<serde::de::IgnoredAny>,
}

/// Compact JSON. Numbers of a plan are finite, and text is always valid, so that nothing can fail.
fn json<V: Serialize>(value: &V) -> String {
    serde_json::to_string(value).unwrap_or_else(|_| "null".to_owned())
}

/// An error of the JSON reader with its place.
fn json_error(name: &str, text: &str, field: &str, error: &serde_json::Error) -> Box<FileError> {
    let line_start: usize = text.split_inclusive('\n').take(error.line().saturating_sub(1)).map(str::len).sum();
    let at = (line_start + error.column().saturating_sub(1)).min(text.len());
    let at = (0..=at).rev().find(|at| text.is_char_boundary(*at)).unwrap_or(0);
    // The reader repeats the place at the end of its message.
    let full = error.to_string();
    let message = full.split(" at line ").next().unwrap_or(&full).to_owned();
    let (message, help) = if error.is_data() || !field.is_empty() {
        (format!("is wrong: {message}"), "see the plan that `quietpath plan` writes")
    } else {
        (format!("is not valid JSON: {message}"), "numbers must be finite, text in \"quotes\"; JSON has no NaN")
    };
    let place = (error.line() > 0).then(|| Place::of(text, &(at..at)));
    let (name, field, help) = (name.to_owned(), field.to_owned(), help.to_owned());
    Box::new(FileError { name, place, field, message, help })
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCENARIO: &str = include_str!("../../../sim/scenarios/square8-detection.toml");
    const GOOD: &str = r#"{
  "scenario": "square8-detection",
  "duration": 120.0,
  "extra": {"kept": false},
  "agents": [
    {"name": "uav1",
     "path": [[0.8, 1.0],
              [4.0, 4.0],
              [8.5, 6.7]],
     "jam": [0, 0, 0]}
  ]
}"#;

    fn fits(text: &str) -> Result<PlanFile, String> {
        let scenario = ScenarioFile::parse("s.toml", SCENARIO).expect("scenario").scenario;
        let plan = PlanFile::parse("p.json", text).map_err(|error| error.to_string())?;
        plan.fits("p.json", &scenario).map_err(|error| error.to_string())?;
        Ok(plan)
    }

    #[test]
    fn each_bad_plan_names_its_field() {
        fits(GOOD).expect("the plan that the cases spoil is good");
        let cases = [
            ("[4.0, 4.0]", "[4.0, NaN]", "p.json:8: is not valid JSON: expected value"),
            ("[4.0, 4.0]", "[4.0, 1e999]", "p.json:8: agents[0].path[1][1] is wrong: number out of range"),
            (
                "[4.0, 4.0]",
                "[4.0, null]",
                "p.json:8: agents[0].path[1][1] is wrong: invalid type: null, expected f64",
            ),
            ("[4.0, 4.0]", "[4.0]", "p.json: agents[0].path[1] must have 2 numbers, not 1"),
            ("\"name\": \"uav1\",", "", "p.json:10: agents[0] is wrong: missing field `name`"),
            (
                "\"uav1\"",
                "\"uav7\"",
                "p.json: agents[0].name is `uav7`, and the scenario has no such agent\n  help: its agents are `uav1`",
            ),
            ("[0, 0, 0]", "[0, 0]", "p.json: agents[0].jam has 2 entries, and agents[0].path has 3"),
            ("120.0", "-1", "p.json: duration must be greater than 0, not -1"),
            (
                "\"extra\"",
                "\"times\": [0, 5, 5], \"extra\"",
                "p.json: times[2] must be later than the time before it",
            ),
            ("\"extra\"", "\"times\": [0, 5], \"extra\"", "p.json: times has 2 entries, and agents[0].path has 3"),
            ("\"duration\": 120.0,", "", "p.json:12: is wrong: missing field `duration`"),
            ("]}\n  ]", "]}\n", "p.json:12: is not valid JSON: "),
        ];
        let mut wrong = Vec::new();
        for (part, spoilt, says) in cases {
            assert!(GOOD.contains(part), "{part}");
            let error = fits(&GOOD.replacen(part, spoilt, 1)).expect_err(says);
            if !error.starts_with(says) || !error.contains("\n  help: ") {
                wrong.push(format!("expected {says}\n{error}"));
            }
        }
        assert!(wrong.is_empty(), "{}", wrong.join("\n"));
        let error = fits(r#"{"duration": 1.0, "agents": []}"#).expect_err("no agent");
        assert!(error.starts_with("p.json: agents has no `uav1`"), "{error}");
        PlanFile::read("/no/such.json").expect_err("missing file");
        let team = include_str!("../../../sim/scenarios/square8-team.toml");
        let team = ScenarioFile::parse("team.toml", team).expect("scenario").scenario;
        let agent = |name: &str| AgentPlan { name: name.into(), path: vec![vec![1.0; 2]; 3], ..AgentPlan::default() };
        let agents = vec![agent("uav2"), agent("uav1")];
        let swapped = PlanFile { duration: 1.0, agents, ..PlanFile::default() };
        let error = swapped.fits("p.json", &team).expect_err("swapped").to_string();
        assert!(error.starts_with("p.json: agents[0].name is `uav2`, which is agent[1]"), "{error}");
    }

    #[test]
    fn numbers_come_back_bit_for_bit() {
        // A fixed linear congruential walk over mantissas and exponents.
        let mut state = 0x9E37_79B9_7F4A_7C15_u64;
        let mut number = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let mantissa = (state >> 11) as f64 / 9_007_199_254_740_992.0;
            mantissa * 10_f64.powi((state % 40) as i32 - 20)
        };
        let path: Vec<Vec<f64>> = (0..500).map(|_| vec![number(), -number()]).collect();
        let values: Vec<f64> = (0..500).map(|_| number()).collect();
        let agent = AgentPlan { name: "a \"b\"\n".into(), path, jam: Some(values.clone()), ..AgentPlan::default() };
        let plan = PlanFile {
            scenario: "x".into(),
            start_time: number(),
            duration: number(),
            objective: Some(-number()),
            status: Some("converged".into()),
            timing: Some(PlanTiming { plan_seconds: number() }),
            times: Some(values),
            agents: vec![agent.clone(), agent],
        };
        let text = plan.to_json();
        assert_eq!(PlanFile::parse("p.json", &text).expect("own text"), plan);
        let wrapped = format!("{{\"summary\": {{\"x\": 1}}, \"plan\": {text}}}");
        assert_eq!(PlanFile::parse("p.json", &wrapped).expect("wrapped"), plan);
    }
}
