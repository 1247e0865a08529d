//! A chart of measured points on two logarithmic axes, with fitted power laws as dashed lines.

use super::Picture;
use super::canvas::{Align, Area, Canvas, INK, Stroke, Type};
use super::colour;
use super::marks::{self, Entry, LABEL_TEXT, Numbers, SAMPLE};
use super::scale::{Scale, Spacing};

const WIDTH: f64 = 760.0;
const AREA: [f64; 2] = [640.0, 360.0];
const LEFT: f64 = 92.0;

/// Points that belong together, and the power law through them.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// What they are.
    pub words: String,
    /// Positive numbers [x, y], in order of x.
    pub points: Vec<[f64; 2]>,
    /// Exponent and factor of `y = factor x^exponent`.
    pub law: Option<(f64, f64)>,
}

/// A chart.
#[derive(Clone, Debug, PartialEq)]
pub struct Chart {
    /// Headline.
    pub title: String,
    /// The line below it.
    pub subtitle: String,
    /// What runs to the right, with its unit.
    pub x: String,
    /// What runs upwards, with its unit.
    pub y: String,
    /// The data.
    pub curves: Vec<Curve>,
}

/// Draws a chart.
#[must_use]
pub fn draw(chart: &Chart) -> Picture {
    let mut canvas = Canvas::new();
    marks::heading(&mut canvas, [LEFT - 62.0, 34.0], &chart.title, &chart.subtitle);
    let legend = marks::legend(&mut canvas, [LEFT - 62.0, 66.0], WIDTH - 60.0, &entries(chart));
    let area = Area { left: LEFT, top: 66.0 + legend + 14.0, width: AREA[0], height: AREA[1] };
    let (x, y) = (scale(chart, 0), scale(chart, 1));
    marks::grid_lines(&mut canvas, area, (&x, 6), (&y, 5));
    let at = |[across, up]: [f64; 2]| {
        [area.left + x.share(across) * area.width, area.bottom() - y.share(up) * area.height]
    };
    for (index, curve) in chart.curves.iter().enumerate() {
        if let (Some((exponent, factor)), Some(first), Some(last)) =
            (curve.law, curve.points.first(), curve.points.last())
        {
            let end = |across: f64| at([across, factor * across.powf(exponent)]);
            let stroke = Stroke::solid(colour::agent(index), 1.6).dashed("7 4");
            canvas.line(end(first[0]), end(last[0]), stroke);
        }
        for point in &curve.points {
            canvas.circle(at(*point), 5.0, colour::agent(index), Stroke::solid("#ffffff", 1.2));
        }
    }
    canvas.rectangle(area, "none", Stroke::solid(INK, 1.0));
    marks::x_axis(&mut canvas, area, &x, 6, Numbers::Shown);
    marks::y_axis(&mut canvas, area, &y, 5);
    let below = [area.left + 0.5 * area.width, area.bottom() + 46.0];
    canvas.text(below, &chart.x, Type::plain(LABEL_TEXT, Align::Middle));
    canvas.upward([LEFT - 62.0, area.top + 0.5 * area.height], &chart.y, Type::plain(LABEL_TEXT, Align::Middle));
    canvas.finish(WIDTH, area.bottom() + 64.0, &[])
}

fn entries(chart: &Chart) -> Vec<Entry> {
    let entry = |(index, curve): (usize, &Curve)| {
        let sample = move |canvas: &mut Canvas, [x, y]: [f64; 2]| {
            canvas.circle([x + 0.5 * SAMPLE, y], 5.0, colour::agent(index), Stroke::solid("#ffffff", 1.2));
        };
        let law = curve.law.map(|(exponent, _)| format!(", exponent {exponent:.2}")).unwrap_or_default();
        Entry { sample: Box::new(sample), words: format!("{}{law}", curve.words) }
    };
    chart.curves.iter().enumerate().map(entry).collect()
}

/// A logarithmic scale with room around the numbers of an axis.
fn scale(chart: &Chart, axis: usize) -> Scale {
    let numbers = chart.curves.iter().flat_map(|curve| &curve.points).map(|point| point[axis]);
    let (mut low, mut high) = (f64::INFINITY, 0.0_f64);
    for number in numbers.filter(|number| number.is_finite() && *number > 0.0) {
        low = low.min(number);
        high = high.max(number);
    }
    if low > high {
        (low, high) = (1.0, 10.0);
    }
    Scale { min: low / 1.3, max: high * 1.3, spacing: Spacing::Log }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_point_is_drawn_inside() {
        let points = vec![[25.0, 0.003], [400.0, 0.05]];
        let curve = Curve { words: "plan".into(), points, law: Some((1.01, 1e-4)) };
        let chart =
            Chart { title: "t".into(), subtitle: "s".into(), x: "nodes".into(), y: "s".into(), curves: vec![curve] };
        let (x, y) = (scale(&chart, 0), scale(&chart, 1));
        assert!(x.share(25.0) > 0.0 && x.share(400.0) < 1.0 && y.share(0.003) > 0.0 && y.share(0.05) < 1.0);
        // Two points and the sample of the legend.
        assert_eq!(draw(&chart).svg().matches("<circle").count(), 3);
        assert!(draw(&chart).svg().contains("exponent 1.01"));
    }
}
