//! Sweeps as files: figures as CSV, figures and plans as JSON, in the scenario's units.

use std::fmt::Write as _;

use quietpath_bridge::file::PlanFile;
use quietpath_core::scenario::Metric;
use serde::Serialize;

use super::sweep::{Point, Swept, spent};
use crate::report;

/// Mean and worst of a metric along one agent's path.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Figures {
    /// Name of the metric.
    pub metric: &'static str,
    /// Mean over time.
    pub mean: f64,
    /// Largest detection, smallest false alarm or location error.
    pub worst: f64,
}

/// One agent's figures.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AgentFigures {
    /// Name of the agent.
    pub name: String,
    /// A figure a metric.
    pub metrics: Vec<Figures>,
    /// Jamming budget spent, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub jam_spent: Option<f64>,
    /// Dropout budget spent, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dropout_spent: Option<f64>,
}

#[derive(Serialize)]
struct PointRecord<'a> {
    seconds: f64,
    share: f64,
    objective: f64,
    duration: f64,
    status: &'static str,
    feasible: bool,
    figures: Vec<AgentFigures>,
    plan: &'a PlanFile,
}

#[derive(Serialize)]
struct Record<'a> {
    scenario: &'a str,
    over: &'static str,
    share_of: &'static str,
    points: Vec<PointRecord<'a>>,
}

impl Point {
    /// The figures of every agent in the given metrics, those that the sensors give.
    #[must_use]
    pub fn figures(&self, metrics: &[Metric]) -> Vec<AgentFigures> {
        let (plan, assessment) = (&self.planned.plan, &self.planned.assessment);
        let figures = assessment.agents.iter().zip(&plan.agents).map(|(series, agent)| {
            let figures = metrics.iter().filter_map(|metric| {
                let values = series.metric(*metric)?;
                let pick = if *metric == Metric::Detection { f64::max } else { f64::min };
                let mean = report::mean(values, &assessment.times);
                Some(Figures { metric: metric.name(), mean, worst: report::extreme(values, pick).0 })
            });
            let total = |levels: &Option<Vec<f64>>| levels.as_ref().map(|levels| spent(levels, &assessment.times));
            AgentFigures {
                name: series.name.clone(),
                metrics: figures.collect(),
                jam_spent: total(&agent.jam),
                dropout_spent: total(&agent.dropout),
            }
        });
        figures.collect()
    }

    fn record(&self, metrics: &[Metric]) -> PointRecord<'_> {
        PointRecord {
            seconds: self.case.seconds,
            share: self.case.share,
            objective: self.planned.assessment.objective,
            duration: self.planned.plan.duration,
            status: self.planned.status.name(),
            feasible: self.planned.assessment.feasible,
            figures: self.figures(metrics),
            plan: &self.planned.plan,
        }
    }
}

/// Figures and plans.
///
/// # Errors
/// What the JSON writer says; figures that are not finite are written as `null`.
pub fn to_json(swept: &Swept, metrics: &[Metric]) -> Result<String, serde_json::Error> {
    let record = Record {
        scenario: swept.points.first().map_or("", |point| point.case.scenario.name.as_str()),
        over: swept.over.name(),
        share_of: swept.over.whole(),
        points: swept.points.iter().map(|point| point.record(metrics)).collect(),
    };
    serde_json::to_string(&record).map(|text| format!("{text}\n"))
}

/// Figures, a point a line.
#[must_use]
pub fn to_csv(swept: &Swept, metrics: &[Metric]) -> String {
    let mut text = String::new();
    for (index, point) in swept.points.iter().enumerate() {
        let mut row = vec![
            ("seconds".to_owned(), point.case.seconds.to_string()),
            ("share".to_owned(), point.case.share.to_string()),
            ("objective".to_owned(), point.planned.assessment.objective.to_string()),
            ("duration".to_owned(), point.planned.plan.duration.to_string()),
            ("status".to_owned(), point.planned.status.name().to_owned()),
            ("feasible".to_owned(), point.planned.assessment.feasible.to_string()),
        ];
        for agent in point.figures(metrics) {
            let name = &agent.name;
            for figures in &agent.metrics {
                row.push((format!("{name} mean {}", figures.metric), figures.mean.to_string()));
                row.push((format!("{name} worst {}", figures.metric), figures.worst.to_string()));
            }
            let spent = [("jam spent", agent.jam_spent), ("dropout spent", agent.dropout_spent)];
            row.extend(
                spent.into_iter().filter_map(|(what, it)| it.map(|it| (format!("{name} {what}"), it.to_string()))),
            );
        }
        let (names, values): (Vec<_>, Vec<_>) = row.into_iter().unzip();
        if index == 0 {
            let quoted: Vec<String> = names.iter().map(|name| quoted(name)).collect();
            let _ = writeln!(text, "{}", quoted.join(","));
        }
        let _ = writeln!(text, "{}", values.join(","));
    }
    text
}

/// Names of agents may hold anything.
fn quoted(name: &str) -> String {
    if name.contains([',', '"', '\n', '\r']) { format!("\"{}\"", name.replace('"', "\"\"")) } else { name.to_owned() }
}
