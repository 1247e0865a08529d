//! Curves: diagrams of one quantity each over a shared axis, several curves in each, told apart by colour and dash.
//!
//! | part | drawn as |
//! |---|---|
//! | curve | line of its colour; a value that is not finite interrupts it |
//! | points of their own | dots on the line |
//! | silence | white core of the line where the transmitter is silent, as on the landscape |

use super::Picture;
use super::canvas::{Align, Area, Canvas, INK, Stroke, Type};
use super::marks::{self, Entry, LABEL_TEXT, Numbers, SAMPLE};
use super::scale::{Kind, Scale};

const WIDTH: f64 = 1000.0;
/// Room left of a diagram for its numbers.
const LEFT: f64 = 86.0;
/// Room between the right end of a diagram and the next column.
const GAP: f64 = 18.0;
/// Room above a diagram for its title.
const ABOVE: f64 = 42.0;

/// One curve.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Colour, as CSS.
    pub colour: String,
    /// Dash pattern; empty for a solid line.
    pub dash: &'static str,
    /// Whether its points show.
    pub dots: Dots,
    /// Points in order of x.
    pub points: Vec<[f64; 2]>,
    /// Level of silence at each point, 0 to 1, holding back to the point before; may be empty.
    pub silence: Vec<f64>,
}

/// Whether the points of a curve show.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dots {
    /// As dots.
    Shown,
    /// The line alone shows.
    Hidden,
}

/// One diagram.
#[derive(Clone, Debug, PartialEq)]
pub struct Diagram {
    /// The quantity and its unit.
    pub title: String,
    /// What kind of number it is.
    pub kind: Kind,
    /// Its curves.
    pub curves: Vec<Curve>,
}

/// What the legend says of a curve that is in every diagram.
#[derive(Clone, Debug, PartialEq)]
pub struct Key {
    /// Colour, as CSS.
    pub colour: String,
    /// Dash pattern; empty for a solid line.
    pub dash: &'static str,
    /// What it stands for.
    pub words: String,
}

/// Diagrams on a sheet.
#[derive(Clone, Debug, PartialEq)]
pub struct Sheet {
    /// Headline.
    pub title: String,
    /// The line below it.
    pub subtitle: String,
    /// Quantity and unit of the shared axis.
    pub label: String,
    /// Its ends.
    pub x: [f64; 2],
    /// The legend.
    pub keys: Vec<Key>,
    /// The diagrams, row by row.
    pub diagrams: Vec<Diagram>,
    /// Diagrams side by side.
    pub columns: usize,
    /// Height of a diagram.
    pub height: f64,
}

/// Draws the sheet.
#[must_use]
pub fn draw(sheet: &Sheet) -> Picture {
    let mut canvas = Canvas::new();
    marks::heading(&mut canvas, [30.0, 34.0], &sheet.title, &sheet.subtitle);
    let legend = marks::legend(&mut canvas, [30.0, 66.0], WIDTH - 60.0, &entries(sheet));
    let columns = sheet.columns.max(1);
    let column = (WIDTH - GAP) / columns as f64;
    let scale = Scale::linear(sheet.x[0], sheet.x[1].max(sheet.x[0] + 1e-9));
    let (top, row) = (70.0 + legend + ABOVE, sheet.height + ABOVE + 16.0);
    let mut bottom = top;
    for (index, diagram) in sheet.diagrams.iter().enumerate() {
        let left = LEFT + (index % columns) as f64 * column;
        let top = top + (index / columns) as f64 * row;
        let area = Area { left, top, width: column - LEFT - GAP, height: sheet.height };
        let lowest = index + columns >= sheet.diagrams.len();
        draw_one(&mut canvas, area, diagram, &scale, if lowest { Numbers::Shown } else { Numbers::Hidden });
        if lowest {
            let at = [area.left + 0.5 * area.width, area.bottom() + 44.0];
            canvas.text(at, &sheet.label, Type::plain(LABEL_TEXT, Align::Middle));
        }
        bottom = bottom.max(area.bottom());
    }
    canvas.finish(WIDTH, bottom + 62.0, &[])
}

fn entries(sheet: &Sheet) -> Vec<Entry> {
    let mut entries = Vec::new();
    for key in &sheet.keys {
        let (colour, dash) = (key.colour.clone(), key.dash);
        let sample = move |canvas: &mut Canvas, [x, y]: [f64; 2]| {
            canvas.line([x, y], [x + SAMPLE, y], Stroke::solid(&colour, 2.6).dashed(dash));
        };
        entries.push(Entry { sample: Box::new(sample), words: key.words.clone() });
    }
    let mut curves = sheet.diagrams.iter().flat_map(|diagram| &diagram.curves);
    if curves.any(|curve| curve.silence.iter().any(|level| is_silent(*level))) {
        let sample = |canvas: &mut Canvas, [x, y]: [f64; 2]| {
            canvas.line([x, y], [x + SAMPLE, y], Stroke::solid("#555555", 5.0));
            canvas.line([x, y], [x + SAMPLE, y], Stroke::solid("#ffffff", 2.0));
        };
        entries.push(Entry { sample: Box::new(sample), words: "dropout (transmitter silent)".into() });
    }
    entries
}

fn is_silent(level: f64) -> bool {
    level >= 0.5
}

fn draw_one(canvas: &mut Canvas, area: Area, diagram: &Diagram, x: &Scale, numbers: Numbers) {
    canvas.text([area.left, area.top - 10.0], &diagram.title, Type::plain(LABEL_TEXT, Align::Start).bold());
    let values = diagram.curves.iter().flat_map(|curve| curve.points.iter().map(|[_, value]| *value));
    let y = Scale::covering(values, diagram.kind);
    let ticks = [wanted(area.width, 85.0), wanted(area.height, 34.0)];
    marks::grid_lines(canvas, area, (x, ticks[0]), (&y, ticks[1]));
    for curve in &diagram.curves {
        draw_curve(canvas, curve, |[a, b]| {
            [area.left + x.share(a) * area.width, area.bottom() - y.share(b) * area.height]
        });
    }
    canvas.rectangle(area, "none", Stroke::solid(INK, 1.0));
    marks::x_axis(canvas, area, x, ticks[0], numbers);
    marks::y_axis(canvas, area, &y, ticks[1]);
}

fn wanted(length: f64, apart: f64) -> usize {
    (length / apart).clamp(2.0, 10.0) as usize
}

fn draw_curve(canvas: &mut Canvas, curve: &Curve, at: impl Fn([f64; 2]) -> [f64; 2]) {
    for run in curve.points.split(|[_, value]| !value.is_finite()).filter(|run| !run.is_empty()) {
        let points: Vec<_> = run.iter().map(|point| at(*point)).collect();
        canvas.polyline(&points, Stroke::solid(&curve.colour, 2.4).dashed(curve.dash));
        if curve.dots == Dots::Shown {
            for point in points {
                canvas.circle(point, 4.2, &curve.colour, Stroke::solid("#ffffff", 1.2));
            }
        }
    }
    let silent = || {
        let pairs = curve.points.windows(2).zip(curve.silence.iter().skip(1));
        pairs.filter(|(ends, level)| is_silent(**level) && ends.iter().all(|[_, value]| value.is_finite()))
    };
    for stroke in [Stroke::solid(&curve.colour, 5.4), Stroke::solid("#ffffff", 2.0)] {
        for (ends, _) in silent() {
            let points: Vec<_> = ends.iter().map(|point| at(*point)).collect();
            canvas.polyline(&points, stroke);
        }
    }
}
