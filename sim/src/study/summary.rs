//! What a study found: quantiles of every figure, and pictures of how they are spread.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use serde::Serialize;

use super::record::Heading;
use super::{Figures, Run};
use crate::picture::Picture;
use crate::picture::distribution::{self, Panel, Sheet};
use crate::picture::scale::trimmed;

/// Shares at which quantiles are told.
const SHARES: [f64; 3] = [0.05, 0.5, 0.95];

/// A figure of a run: its name, its unit, and where to find it.
struct Figure {
    key: &'static str,
    name: &'static str,
    unit: &'static str,
    of: fn(&Figures) -> Option<f64>,
}

const FIGURES: [Figure; 5] = [
    Figure { key: "peak_detection", name: "peak detection", unit: "", of: |figures| figures.peak_detection },
    Figure { key: "mean_detection", name: "mean detection", unit: "", of: |figures| figures.mean_detection },
    Figure {
        key: "least_cep_m",
        name: "smallest location error (CEP)",
        unit: "m",
        of: |figures| figures.least_cep_m,
    },
    Figure { key: "mean_cep_m", name: "mean location error (CEP)", unit: "m", of: |figures| figures.mean_cep_m },
    Figure { key: "flight_time_s", name: "flight time", unit: "s", of: |figures| figures.flight_time },
];

/// The spread of one figure.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// Its name in files.
    pub figure: &'static str,
    /// Its name for people.
    #[serde(skip)]
    pub name: &'static str,
    /// Its unit.
    #[serde(skip)]
    pub unit: &'static str,
    /// Runs that have it.
    pub runs: usize,
    /// On paper.
    pub planned: Option<f64>,
    /// Mean over runs.
    pub mean: f64,
    /// The values below which 5, 50 and 95 % of the runs are.
    pub quantiles: [f64; 3],
    #[serde(skip)]
    values: Vec<f64>,
}

/// All that is told of a study.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Scenario, plan and what it is worth on paper.
    pub heading: Heading,
    /// Runs flown.
    pub runs: usize,
    /// Runs in which nothing went wrong.
    pub good: usize,
    /// How many runs had each failure.
    pub failures: BTreeMap<String, usize>,
    /// The spread of each figure that runs have.
    pub figures: Vec<Spread>,
    /// The largest distance from the plan.
    pub off_plan_m: Option<Spread>,
}

/// Sums up runs.
#[must_use]
pub fn summarise(heading: &Heading, runs: &BTreeMap<u64, Run>) -> Summary {
    let mut failures = BTreeMap::new();
    for failure in runs.values().flat_map(|run| &run.failures) {
        *failures.entry(failure.clone()).or_insert(0) += 1;
    }
    let spread_of = |figure: &Figure| {
        let values = runs.values().filter_map(|run| (figure.of)(&run.figures)).collect();
        spread(figure.key, figure.name, figure.unit, (figure.of)(&heading.planned), values)
    };
    let off = runs.values().map(|run| run.off_plan_m).collect();
    Summary {
        heading: heading.clone(),
        runs: runs.len(),
        good: runs.values().filter(|run| run.failures.is_empty()).count(),
        failures,
        figures: FIGURES.iter().filter_map(spread_of).collect(),
        off_plan_m: spread("off_plan_m", "largest distance from the plan", "m", None, off),
    }
}

fn spread(
    figure: &'static str,
    name: &'static str,
    unit: &'static str,
    planned: Option<f64>,
    mut values: Vec<f64>,
) -> Option<Spread> {
    values.retain(|value| value.is_finite());
    values.sort_by(f64::total_cmp);
    let runs = values.len();
    if runs == 0 {
        return None;
    }
    // The mean of sorted values: one order, whatever order the runs were flown in.
    let mean = values.iter().sum::<f64>() / runs as f64;
    let quantiles = SHARES.map(|share| quantile(&values, share));
    Some(Spread { figure, name, unit, runs, planned, mean, quantiles, values })
}

/// The value below which a share of the sorted values lies, linear between neighbours.
fn quantile(sorted: &[f64], share: f64) -> f64 {
    let place = share * (sorted.len().max(1) - 1) as f64;
    let below = place.floor() as usize;
    let low = sorted.get(below).copied().unwrap_or(f64::NAN);
    let high = sorted.get(below + 1).copied().unwrap_or(low);
    low + (high - low) * place.fract()
}

impl Summary {
    fn spreads(&self) -> impl Iterator<Item = &Spread> {
        self.figures.iter().chain(&self.off_plan_m)
    }

    /// The table that `quietpath study` prints.
    #[must_use]
    pub fn table(&self) -> String {
        let mut text = String::new();
        let _ = writeln!(text, "{} runs of {}, {} without failure", self.runs, self.heading.study, self.good);
        for (failure, count) in &self.failures {
            let share = 100.0 * *count as f64 / self.runs.max(1) as f64;
            let _ = writeln!(text, "  {failure}: {count} ({share:.1} %)");
        }
        let head = ["planned", "mean", "5 %", "median", "95 %"];
        let _ = write!(text, "\n{:<34}", "figure");
        for column in head {
            let _ = write!(text, " {column:>10}");
        }
        for spread in self.spreads() {
            let label =
                if spread.unit.is_empty() { spread.name.into() } else { format!("{}, {}", spread.name, spread.unit) };
            let planned = spread.planned.map_or_else(|| "-".to_owned(), short);
            let _ = write!(text, "\n{label:<34} {planned:>10} {:>10}", short(spread.mean));
            for value in spread.quantiles {
                let _ = write!(text, " {:>10}", short(value));
            }
        }
        text.push('\n');
        text
    }

    /// The picture of all spreads.
    #[must_use]
    pub fn picture(&self) -> Picture {
        let panel = |spread: &Spread| Panel {
            title: crate::illustrate::capitalised(spread.name),
            unit: spread.unit.to_owned(),
            values: spread.values.clone(),
            planned: spread.planned,
            quantiles: spread.quantiles,
        };
        let failures: Vec<String> = self.failures.iter().map(|(name, count)| format!("{name} {count}")).collect();
        let failed =
            if failures.is_empty() { "no failures".into() } else { format!("failures: {}", failures.join(", ")) };
        distribution::draw(&Sheet {
            title: format!("{}: {} flights", self.heading.study, self.runs),
            subtitle: failed,
            panels: self.spreads().map(panel).collect(),
        })
    }
}

/// A number with four digits.
fn short(value: f64) -> String {
    let digits = 4 - (value.abs().max(1e-300).log10().floor() as i32 + 1);
    let rounded = 10_f64.powi(digits);
    if value.abs() < 1e-3 || value.abs() >= 1e6 {
        trimmed(value)
    } else {
        trimmed((value * rounded).round() / rounded)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_linear_between_neighbours() {
        let sorted: Vec<f64> = (0..=20).map(f64::from).collect();
        assert_eq!(SHARES.map(|share| quantile(&sorted, share)), [1.0, 10.0, 19.0]);
        assert_eq!(quantile(&[3.0], 0.95), 3.0);
        assert_eq!(quantile(&[1.0, 2.0], 0.25), 1.25);
    }

    #[test]
    fn four_digits_are_kept() {
        assert_eq!([0.123_456, 12.345_6, 123_456.0].map(short), ["0.1235", "12.35", "123500"]);
    }
}
