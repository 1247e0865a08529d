//! The series: every figure along the flight against its limits, over time.
//!
//! One small diagram a figure, two side by side, all with the same time axis. Agents keep the colours of the
//! landscape; limits are dashed, and faint lines mark where steps begin. A positive figure that spans decades is drawn logarithmically.

use super::Picture;
use super::canvas::{Align, Area, Canvas, FAINT, INK, Stroke, Type};
use super::colour;
use super::font;
use super::marks::{self, Entry, LABEL_TEXT, Numbers, SAMPLE};
use super::scale::{Kind, Scale, trimmed};

const WIDTH: f64 = 1000.0;
const PANEL: [f64; 2] = [396.0, 132.0];
const LEFT: f64 = 78.0;
const COLUMN: f64 = 490.0;
const ROW: f64 = 188.0;

/// One agent's values of a figure: (time, value), times in the unit of the sheet.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// Index of the agent, for its colour.
    pub agent: usize,
    /// Points in order of time; a value that is not finite interrupts the line.
    pub points: Vec<[f64; 2]>,
}

/// A bound that is drawn dashed.
#[derive(Clone, Debug, PartialEq)]
pub struct Bound {
    /// Its value, in the panel's unit.
    pub value: f64,
    /// `max` or `min`, and the agent's name where it is one agent's own.
    pub words: String,
}

/// One small diagram.
#[derive(Clone, Debug, PartialEq)]
pub struct Panel {
    /// The figure's name.
    pub title: String,
    /// Its unit; empty for none.
    pub unit: String,
    /// What kind of number it is.
    pub kind: Kind,
    /// A line an agent.
    pub lines: Vec<Line>,
    /// Its limits.
    pub bounds: Vec<Bound>,
}

/// All diagrams of a plan.
#[derive(Clone, Debug, PartialEq)]
pub struct Sheet {
    /// Headline.
    pub title: String,
    /// The line below it.
    pub subtitle: String,
    /// Unit of time on the axes.
    pub time_unit: &'static str,
    /// First and last time.
    pub time: [f64; 2],
    /// Names of the agents.
    pub agents: Vec<String>,
    /// Times at which steps begin, but the first.
    pub steps: Vec<f64>,
    /// The diagrams, row by row.
    pub panels: Vec<Panel>,
}

/// Draws the diagrams.
#[must_use]
pub fn draw(sheet: &Sheet) -> Picture {
    let mut canvas = Canvas::new();
    marks::heading(&mut canvas, [LEFT - 48.0, 34.0], &sheet.title, &sheet.subtitle);
    let legend = marks::legend(&mut canvas, [LEFT - 48.0, 66.0], WIDTH - 60.0, &entries(sheet));
    let top = 66.0 + legend + 34.0;
    let mut bottom = top;
    for (index, panel) in sheet.panels.iter().enumerate() {
        let (column, row) = ((index % 2) as f64, (index / 2) as f64);
        let area = Area { left: LEFT + column * COLUMN, top: top + row * ROW, width: PANEL[0], height: PANEL[1] };
        let lowest = index + 2 >= sheet.panels.len();
        draw_panel(&mut canvas, area, panel, sheet, if lowest { Numbers::Shown } else { Numbers::Hidden });
        if lowest {
            let label = format!("time ({})", sheet.time_unit);
            let at = [area.left + 0.5 * area.width, area.bottom() + 44.0];
            canvas.text(at, &label, Type::plain(LABEL_TEXT, Align::Middle));
        }
        bottom = area.bottom();
    }
    canvas.finish(WIDTH, bottom + 62.0, &[])
}

fn entries(sheet: &Sheet) -> Vec<Entry> {
    let mut entries = Vec::new();
    for (index, name) in sheet.agents.iter().enumerate() {
        let sample = move |canvas: &mut Canvas, [x, y]: [f64; 2]| {
            canvas.line([x, y], [x + SAMPLE, y], Stroke::solid(colour::agent(index), 2.4));
        };
        entries.push(Entry { sample: Box::new(sample), words: name.clone() });
    }
    let sample = |canvas: &mut Canvas, [x, y]: [f64; 2]| canvas.line([x, y], [x + SAMPLE, y], limit_stroke());
    entries.push(Entry { sample: Box::new(sample), words: "limit".into() });
    if !sheet.steps.is_empty() {
        let sample = |canvas: &mut Canvas, [x, y]: [f64; 2]| {
            let middle = x + 0.5 * SAMPLE;
            canvas.line([middle, y - 9.0], [middle, y + 9.0], STEP_STROKE);
        };
        entries.push(Entry { sample: Box::new(sample), words: "a step begins".into() });
    }
    entries
}

const STEP_STROKE: Stroke<'static> = Stroke::solid("#b08fc7", 1.2).dashed("2 3");

const fn limit_stroke() -> Stroke<'static> {
    Stroke::solid("#444444", 1.4).dashed("7 4")
}

fn draw_panel(canvas: &mut Canvas, area: Area, panel: &Panel, sheet: &Sheet, numbers: Numbers) {
    let time = &Scale::linear(sheet.time[0], sheet.time[1].max(sheet.time[0] + 1e-9));
    let unit = if panel.unit.is_empty() { String::new() } else { format!(" ({})", panel.unit) };
    let title = format!("{}{unit}", panel.title);
    canvas.text([area.left, area.top - 9.0], &title, Type::plain(LABEL_TEXT, Align::Start).bold());
    let scale = value_scale(panel);
    let named: Vec<String> =
        panel.bounds.iter().map(|bound| format!("{} {}", bound.words, trimmed(bound.value))).collect();
    let words = named.join(", ");
    if font::width(&title, LABEL_TEXT).mul_add(1.12, font::width(&words, 13.0)) < area.width - 10.0 {
        canvas.text([area.right(), area.top - 9.0], &words, Type::plain(13.0, Align::End).colour(FAINT));
    }
    marks::grid_lines(canvas, area, (time, 6), (&scale, 4));
    for step in &sheet.steps {
        let x = area.left + time.share(*step) * area.width;
        canvas.line([x, area.top], [x, area.bottom()], STEP_STROKE);
    }
    let at = |[x, y]: [f64; 2]| {
        [area.left + time.share(x) * area.width, area.bottom() - scale.share(y).clamp(-0.02, 1.02) * area.height]
    };
    for line in &panel.lines {
        for run in line.points.split(|[_, value]| !value.is_finite()).filter(|run| !run.is_empty()) {
            let points: Vec<_> = run.iter().map(|point| at(*point)).collect();
            canvas.polyline(&points, Stroke::solid(colour::agent(line.agent), 2.2));
        }
    }
    // On top, so that a figure that rides on its limit does not hide it.
    for bound in &panel.bounds {
        canvas.line(at([time.min, bound.value]), at([time.max, bound.value]), limit_stroke());
    }
    canvas.rectangle(area, "none", Stroke::solid(INK, 1.0));
    marks::x_axis(canvas, area, time, 6, numbers);
    marks::y_axis(canvas, area, &scale, 4);
}

/// The scale that shows a panel's values and bounds.
#[must_use]
pub fn value_scale(panel: &Panel) -> Scale {
    let values = panel.lines.iter().flat_map(|line| line.points.iter().map(|[_, value]| *value));
    Scale::covering(values.chain(panel.bounds.iter().map(|bound| bound.value)), panel.kind)
}

/// Unit of time that suits a flight, and how many seconds it has.
#[must_use]
pub fn time_unit(duration: f64) -> (&'static str, f64) {
    if duration <= 600.0 {
        ("s", 1.0)
    } else if duration <= 10_800.0 {
        ("min", 60.0)
    } else {
        ("h", 3600.0)
    }
}

#[cfg(test)]
mod tests {
    use super::super::scale::Spacing;
    use super::*;

    fn panel(bound: f64) -> Panel {
        Panel {
            title: "speed".into(),
            unit: "m/s".into(),
            kind: Kind::Positive,
            lines: vec![Line { agent: 0, points: vec![[0.0, 8.0], [1.0, 10.0]] }],
            bounds: vec![Bound { value: bound, words: "max".into() }],
        }
    }

    #[test]
    fn a_limit_is_on_the_scale() {
        assert!(value_scale(&panel(12.0)).max > 12.0);
        // Far above, the data would be a line at zero on a linear scale.
        let far = value_scale(&panel(1e6));
        assert!(far.max > 1e6 && far.share(8.0) > 0.001 && far.spacing == Spacing::Log);
    }

    #[test]
    fn long_flights_are_told_in_minutes_and_hours() {
        assert_eq!(time_unit(115.0).0, "s");
        assert_eq!(time_unit(5400.0).0, "min");
        assert_eq!(time_unit(14_000.0), ("h", 3600.0));
    }
}
