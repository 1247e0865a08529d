//! Distributions: a histogram a figure, with the value on paper and the quantiles.
//!
//! | part | drawn as |
//! |---|---|
//! | runs | bars of equal width from the smallest value to the largest |
//! | 5 to 95 % | band behind the bars |
//! | median | solid line |
//! | planned | dashed line |

use super::Picture;
use super::canvas::{Align, Area, Canvas, INK, Stroke, Type};
use super::colour;
use super::marks::{self, Entry, LABEL_TEXT, Numbers, SAMPLE};
use super::scale::Scale;

const WIDTH: f64 = 1000.0;
const LEFT: f64 = 86.0;
const COLUMN: f64 = 490.0;
const AREA: [f64; 2] = [380.0, 150.0];
const ROW: f64 = 244.0;
/// Bars for many runs; few runs get fewer.
const BARS_MAX: usize = 36;
const BAND: &str = "#dbe7f3";
const BAR: &str = "#5b8db8";

/// One histogram.
#[derive(Clone, Debug, PartialEq)]
pub struct Panel {
    /// The figure.
    pub title: String,
    /// Its unit; empty for none.
    pub unit: String,
    /// Its value in every run.
    pub values: Vec<f64>,
    /// Its value on paper.
    pub planned: Option<f64>,
    /// The values below which 5, 50 and 95 % of the runs are.
    pub quantiles: [f64; 3],
}

/// All histograms of a study.
#[derive(Clone, Debug, PartialEq)]
pub struct Sheet {
    /// Headline.
    pub title: String,
    /// The line below it.
    pub subtitle: String,
    /// The histograms, row by row.
    pub panels: Vec<Panel>,
}

/// Draws the histograms.
#[must_use]
pub fn draw(sheet: &Sheet) -> Picture {
    let mut canvas = Canvas::new();
    marks::heading(&mut canvas, [30.0, 34.0], &sheet.title, &sheet.subtitle);
    let legend = marks::legend(&mut canvas, [30.0, 66.0], WIDTH - 60.0, &entries(sheet));
    let top = 66.0 + legend + 40.0;
    let mut bottom = top;
    for (index, panel) in sheet.panels.iter().enumerate() {
        let (column, row) = ((index % 2) as f64, (index / 2) as f64);
        let area = Area { left: LEFT + column * COLUMN, top: top + row * ROW, width: AREA[0], height: AREA[1] };
        histogram(&mut canvas, area, panel);
        bottom = bottom.max(area.bottom());
    }
    canvas.finish(WIDTH, bottom + 62.0, &[])
}

fn entries(sheet: &Sheet) -> Vec<Entry> {
    let block = |fill: &'static str| {
        move |canvas: &mut Canvas, [x, y]: [f64; 2]| {
            let area = Area { left: x, top: y - 7.0, width: SAMPLE, height: 14.0 };
            canvas.rectangle(area, fill, Stroke::solid("none", 0.0));
        }
    };
    let line = |dash: &'static str, colour: &'static str| {
        move |canvas: &mut Canvas, [x, y]: [f64; 2]| {
            canvas.line([x, y], [x + SAMPLE, y], Stroke::solid(colour, 2.2).dashed(dash));
        }
    };
    let mut entries = vec![
        Entry { sample: Box::new(block(BAR)), words: "runs".into() },
        Entry { sample: Box::new(block(BAND)), words: "5 to 95 % of them".into() },
        Entry { sample: Box::new(line("", INK)), words: "median".into() },
    ];
    if sheet.panels.iter().any(|panel| panel.planned.is_some()) {
        entries.push(Entry { sample: Box::new(line("6 4", colour::agent(0))), words: "planned".into() });
    }
    entries
}

/// Bars for so many runs: about the square root.
fn bars(runs: usize) -> usize {
    ((runs as f64).sqrt().ceil() as usize).clamp(1, BARS_MAX)
}

/// The lower end of the bars, their width, and how many values fall into each.
fn count(values: &[f64]) -> (f64, f64, Vec<usize>) {
    let low = values.iter().copied().fold(f64::INFINITY, f64::min);
    let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let wanted = bars(values.len());
    let (low, width) = if high > low {
        (low, (high - low) / wanted as f64)
    } else {
        // All the same: one bar around it.
        let width = if low == 0.0 { 1.0 } else { 0.1 * low.abs() };
        (low - 0.5 * width, width)
    };
    let mut counts = vec![0; wanted];
    for value in values {
        let bar = (((value - low) / width) as usize).min(wanted - 1);
        if let Some(count) = counts.get_mut(bar) {
            *count += 1;
        }
    }
    (low, width, counts)
}

fn histogram(canvas: &mut Canvas, area: Area, panel: &Panel) {
    canvas.text([area.left, area.top - 10.0], &panel.title, Type::plain(LABEL_TEXT, Align::Start).bold());
    let (low, width, counts) = count(&panel.values);
    let high = low + width * counts.len() as f64;
    let planned = panel.planned.filter(|value| value.is_finite());
    let ends = [planned.unwrap_or(low).min(low), planned.unwrap_or(high).max(high)];
    let room = 0.04 * (ends[1] - ends[0]);
    let x = Scale::linear(ends[0] - room, ends[1] + room);
    let most = counts.iter().copied().max().unwrap_or(0).max(1);
    let y = Scale::linear(0.0, 1.08 * most as f64);
    let across = |value: f64| area.left + x.share(value) * area.width;
    let [five, median, ninety_five] = panel.quantiles;
    let band = Area { left: across(five), width: across(ninety_five) - across(five), ..area };
    canvas.rectangle(band, BAND, Stroke::solid("none", 0.0));
    for (bar, count) in counts.iter().enumerate().filter(|(_, count)| **count > 0) {
        let (from, to) = (across(low + width * bar as f64), across(low + width * (bar + 1) as f64));
        let height = y.share(*count as f64) * area.height;
        let box_ = Area { left: from, top: area.bottom() - height, width: to - from, height };
        canvas.rectangle(box_, BAR, Stroke::solid("#ffffff", 0.8));
    }
    let line = |canvas: &mut Canvas, value: f64, stroke: Stroke<'_>| {
        canvas.line([across(value), area.top], [across(value), area.bottom()], stroke);
    };
    line(canvas, median, Stroke::solid(INK, 2.2));
    if let Some(planned) = planned {
        line(canvas, planned, Stroke::solid(colour::agent(0), 2.2).dashed("6 4"));
    }
    canvas.rectangle(area, "none", Stroke::solid(INK, 1.0));
    marks::x_axis(canvas, area, &x, 5, Numbers::Shown);
    marks::y_axis(canvas, area, &y, 3);
    let unit = if panel.unit.is_empty() { "probability".to_owned() } else { panel.unit.clone() };
    let middle = Type::plain(LABEL_TEXT, Align::Middle);
    canvas.text([area.left + 0.5 * area.width, area.bottom() + 44.0], &unit, middle);
    canvas.upward([area.left - 56.0, area.top + 0.5 * area.height], "runs", middle);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_run_is_in_one_bar() {
        let values: Vec<f64> = (0..100).map(f64::from).collect();
        let (low, width, counts) = count(&values);
        assert_eq!((low, counts.len(), counts.iter().sum::<usize>()), (0.0, 10, 100));
        assert!((width - 9.9).abs() < 1e-12);
        assert_eq!(count(&[5.0; 9]).2.iter().sum::<usize>(), 9);
    }
}
