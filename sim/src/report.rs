//! The summaries and tables that commands print.
//!
//! Figures are in metres and seconds; styles show on terminals alone, and are removed in a pipe.

use std::fmt::Write as _;

use anstyle::{AnsiColor, Style};
use quietpath_bridge::file::{PlanFile, ScenarioFile};
use quietpath_bridge::planning::{AgentSeries, Assessment, Choice, Obstacle, Step};
use quietpath_core::constraints::TOLERANCE;
use quietpath_core::scenario::{Metric, Sense};

use crate::units::{self, Presentation};

/// A claimed objective agrees with the recomputed one when they differ by no more than this part of it.
const AGREEMENT: f64 = 1e-6;

const GOOD: Style = AnsiColor::Green.on_default().bold();
const BAD: Style = AnsiColor::Red.on_default().bold();
const LABEL: Style = Style::new().dimmed();

/// Width of the labels of a summary.
const COLUMN: usize = 24;

/// The summary of a plan.
#[must_use]
pub fn summary(scenario: &ScenarioFile, plan: &PlanFile, assessment: &Assessment) -> String {
    let mut text = String::new();
    let mut row = |label: &str, value: &str| {
        let _ = writeln!(text, "{LABEL}{label:<COLUMN$}{LABEL:#}{value}");
    };
    row("scenario", &scenario.name);
    row("status", &status(plan.status.as_deref().unwrap_or("unknown"), assessment.feasible));
    row("objective", &trimmed_to(assessment.objective, 9));
    row("flight time", &units::duration(plan.duration));
    let several = assessment.agents.len() > 1;
    for agent in &assessment.agents {
        if several {
            row(&format!("-- {}", agent.name), "");
        }
        for (label, value) in agent_rows(scenario, assessment, agent) {
            row(label, &value);
        }
    }
    row("worst violation", &violation(assessment));
    if let Some(timing) = plan.timing {
        row("planning time", &span(timing.plan_seconds));
    }
    text
}

/// What each step did, a step a line; nothing where there are none.
#[must_use]
pub fn steps(steps: &[Step]) -> String {
    let mut text = String::new();
    if steps.is_empty() {
        return text;
    }
    let _ = writeln!(
        text,
        "\n{:>4} {:>12} {:>9}  {:<4}  {:<15} {:>16}  {:<8} {:>10} {:>8}",
        "step", "begins", "intervals", "plan", "status", "objective ahead", "feasible", "planning", "change"
    );
    for (index, step) in steps.iter().enumerate() {
        let feasible = if step.feasible { "yes".to_owned() } else { format!("{BAD}{:<8}{BAD:#}", "no") };
        let _ = writeln!(
            text,
            "{:>4} {:>12} {:>9}  {:<4}  {:<15} {:>16}  {feasible:<8} {:>10} {:>8.4}",
            index + 1,
            format!("{:.1} s", step.time()),
            step.intervals,
            choice(step.choice),
            step.status.name().replace('_', " "),
            step.plan.objective.map(|value| trimmed_to(value, 9)).unwrap_or_default(),
            span(step.plan_seconds()),
            step.change,
        );
    }
    text
}

/// Which plan a step flies: one of its own, or the rest of the one before.
#[must_use]
pub const fn choice(choice: Choice) -> &'static str {
    match choice {
        Choice::New => "new",
        Choice::Tail => "kept",
    }
}

/// Why there is no feasible plan, and what may help.
#[must_use]
pub fn obstacle(scenario: &ScenarioFile, obstacle: &Obstacle) -> String {
    let (found, help) = (obstacle.describe(scenario), obstacle.remedy());
    format!("\n{BAD}no feasible plan{BAD:#}: {found}\n  help: {help}\n")
}

pub(crate) fn agent_rows(
    scenario: &ScenarioFile,
    assessment: &Assessment,
    agent: &AgentSeries,
) -> Vec<(&'static str, String)> {
    let mut rows = vec![("path length", units::length(agent.length * scenario.frame.unit_m))];
    if let Some(values) = agent.metric(Metric::Detection) {
        let (peak, node) = extreme(values, f64::max);
        rows.push(("peak detection", format!("{peak:.4} at {}", instant(assessment, node))));
        rows.push(("mean detection", format!("{:.4}", mean(values, &assessment.times))));
    }
    if let Some(values) = agent.metric(Metric::FalseAlarm).filter(|values| values.iter().any(|value| *value > 0.0)) {
        rows.push(("mean false alarm", trimmed_to(mean(values, &assessment.times), 4)));
    }
    if let Some(values) = agent.metric(Metric::Cep) {
        let (least, node) = extreme(values, f64::min);
        let presentation = Presentation::of(Metric::Cep, scenario.dimension, scenario.frame.unit_m);
        let metres = trimmed_to(presentation.convert(least), 4);
        rows.push(("smallest location error", format!("{metres} m (CEP) at {}", instant(assessment, node))));
    }
    rows
}

/// The extreme of the values at nodes 1 .. N, and its node.
pub(crate) fn extreme(values: &[f64], pick: fn(f64, f64) -> f64) -> (f64, usize) {
    let mut best = (f64::NAN, 0);
    for (node, value) in values.iter().enumerate().skip(1) {
        if best.0.is_nan() || (pick(best.0, *value) - best.0).abs() > 0.0 {
            best = (*value, node);
        }
    }
    best
}

/// The mean over time of the values at nodes 1 .. N, each over the interval that ends there.
pub(crate) fn mean(values: &[f64], times: &[f64]) -> f64 {
    let intervals = times.iter().zip(times.iter().skip(1)).map(|(a, b)| b - a);
    let (sum, total) = intervals
        .zip(values.iter().skip(1))
        .fold((0.0, 0.0), |(sum, total), (interval, value)| (sum + interval * value, total + interval));
    sum / total
}

fn instant(assessment: &Assessment, node: usize) -> String {
    assessment.times.get(node).map(|time| format!("{time:.1} s")).unwrap_or_default()
}

fn status(word: &str, feasible: bool) -> String {
    let style = if feasible { GOOD } else { BAD };
    format!("{style}{}{style:#}", word.replace('_', " "))
}

fn violation(assessment: &Assessment) -> String {
    let (name, size) = assessment.worst;
    if !assessment.feasible {
        return format!("{BAD}{name}: {size:.3e} of its scale, {TOLERANCE:e} allowed{BAD:#}");
    }
    if size > 0.0 {
        return format!("feasible ({name}: {size:.1e} of its scale, {TOLERANCE:e} allowed)");
    }
    "feasible".into()
}

/// A span of time with a unit that suits it.
pub(crate) fn span(seconds: f64) -> String {
    if seconds < 1.0 { format!("{:.1} ms", 1e3 * seconds) } else { format!("{seconds:.2} s") }
}

/// A number with so many significant digits, without trailing zeros.
pub(crate) fn trimmed_to(value: f64, digits: i32) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    let exponent = value.abs().log10().floor() as i32;
    if !(-4..=8).contains(&exponent) {
        let decimals = usize::try_from(digits - 1).unwrap_or(0);
        return format!("{value:.decimals$e}");
    }
    let decimals = usize::try_from(digits - 1 - exponent).unwrap_or(0);
    let text = format!("{value:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').into() } else { text }
}

/// Whether the objective that a plan claims is the one that it has; `None` where it claims none.
#[must_use]
pub fn claim_holds(assessment: &Assessment) -> Option<bool> {
    let recomputed = assessment.objective;
    assessment.claimed.map(|claimed| (claimed - recomputed).abs() <= AGREEMENT * recomputed.abs().max(1.0))
}

/// The tables of `quietpath check`.
#[must_use]
pub fn check(scenario: &ScenarioFile, plan: &PlanFile, assessment: &Assessment) -> String {
    let mut text = String::new();
    let _ = writeln!(text, "scenario   {}", scenario.name);
    let _ = writeln!(text, "objective  {}{}", trimmed_to(assessment.objective, 12), claim(assessment));
    if !plan.scenario.is_empty() && plan.scenario != scenario.name {
        let _ = writeln!(text, "{BAD}note:{BAD:#} the plan was made for the scenario `{}`", plan.scenario);
    }
    let _ = writeln!(text, "\n{:<16} {:>14} {:>10}  verdict", "constraint", "violation", "allowed");
    for (name, size) in &assessment.violations {
        let verdict = if *size <= TOLERANCE { "ok".into() } else { format!("{BAD}violated{BAD:#}") };
        let shown = if *size == 0.0 { "0".to_owned() } else { format!("{size:.3e}") };
        let _ = writeln!(text, "{name:<16} {shown:>14} {TOLERANCE:>10e}  {verdict}");
    }
    let _ = writeln!(text, "\n{:<24} {:>14} {:>22}", "figure", "along the path", "limit");
    for (label, found, limit) in figures(scenario, plan, assessment) {
        let _ = writeln!(text, "{label:<24} {found:>14} {limit:>22}");
    }
    let worst = assessment.worst;
    let verdict = if assessment.feasible {
        format!("{GOOD}feasible{GOOD:#}")
    } else {
        let place = assessment.place.map_or_else(|| worst.0.to_owned(), |place| scenario.describe(&place));
        format!("{BAD}not feasible{BAD:#}: {place}, by {:.3e} of its scale", worst.1)
    };
    let _ = writeln!(text, "\n{verdict}");
    text
}

fn claim(assessment: &Assessment) -> String {
    match (claim_holds(assessment), assessment.claimed) {
        (Some(true), _) => " (as the plan claims)".into(),
        (Some(false), Some(claimed)) => {
            format!(" {BAD}but the plan claims {}{BAD:#}", trimmed_to(claimed, 12))
        }
        _ => " (the plan claims none)".into(),
    }
}

/// What was flown against what is allowed, in metres and seconds; metrics with limits in the scenario's units.
fn figures(scenario: &ScenarioFile, plan: &PlanFile, assessment: &Assessment) -> Vec<(String, String, String)> {
    let unit = scenario.frame.unit_m;
    let arrival = plan.start_time + plan.duration;
    let mut rows = vec![(
        "arrival".to_owned(),
        format!("{} s", trimmed_to(arrival, 6)),
        format!("{} s", trimmed_to(scenario.time.max, 6)),
    )];
    for (series, agent) in assessment.agents.iter().zip(&scenario.agents) {
        let most = |values: &[f64]| values.iter().copied().fold(0.0, f64::max);
        let row = |what: &str, found: f64, limit: f64, unit: &str| {
            let shown = |value: f64| format!("{} {unit}", trimmed_to(value, 5));
            (format!("{} {what}", agent.name), shown(found), shown(limit))
        };
        rows.push(row("top speed", most(&series.speed) * unit, agent.speed_max * unit, "m/s"));
        rows.push(row("top acceleration", most(&series.accel) * unit, agent.accel_max * unit, "m/s\u{b2}"));
        for limit in &scenario.limits {
            let values = series.metric(limit.metric).unwrap_or_default();
            let bounds = [(limit.min, Sense::Minimize, "min"), (limit.max, Sense::Maximize, "max")];
            for (bound, sense, word) in bounds {
                let pick = if sense == Sense::Minimize { f64::min } else { f64::max };
                if let Some(bound) = bound {
                    let found = trimmed_to(extreme(values, pick).0, 6);
                    let label = format!("{} {word} {}", agent.name, limit.metric.name());
                    rows.push((label, found, trimmed_to(bound, 6)));
                }
            }
        }
    }
    rows
}

/// Which constraints a flight kept: a vehicle flies a hair beside its plan.
#[must_use]
pub fn kept(assessment: &Assessment) -> String {
    let broken: Vec<String> = (assessment.violations.iter())
        .filter(|(_, size)| *size > TOLERANCE)
        .map(|(name, size)| format!("{} (by {:.2} %)", name.replace('_', " "), 100.0 * size))
        .collect();
    if broken.is_empty() { "all kept".into() } else { format!("all kept but {}", broken.join(", ")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_weighs_by_time_and_leaves_out_node_0() {
        let mean = mean(&[100.0, 1.0, 4.0], &[0.0, 1.0, 3.0]);
        assert!((mean - 3.0).abs() < 1e-12, "{mean}");
    }

    #[test]
    fn extremes_leave_out_node_0() {
        assert_eq!(extreme(&[9.0, 1.0, 3.0, 2.0], f64::max), (3.0, 2));
        assert_eq!(extreme(&[0.0, 1.0, 3.0, 2.0], f64::min), (1.0, 1));
    }

    #[test]
    fn numbers_keep_their_digits() {
        assert_eq!(trimmed_to(52.761_412_345, 9), "52.7614123");
        assert_eq!(trimmed_to(0.001_5, 4), "0.0015");
        assert_eq!(trimmed_to(1.25e12, 4), "1.250e12");
        assert_eq!(trimmed_to(120.0, 6), "120");
    }
}
