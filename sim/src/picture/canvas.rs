//! A sheet to draw on: the shapes that the pictures need, as SVG elements.
//!
//! Lengths are in units of the SVG, y downwards. Coordinates keep two decimals.

use svg::Document;
use svg::node::element::{
    Circle, ClipPath, Definitions, Group, Image, Line, Path, Pattern, Polyline, Rectangle, Text,
};
use svg::node::{Node, Value};

use super::Picture;
use super::font;

/// Colour of text and axes.
pub const INK: &str = "#222222";
/// Colour of secondary text.
pub const FAINT: &str = "#666666";

/// Where a text stands relative to its point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Align {
    /// The point is at its left end.
    Start,
    /// The point is below its middle.
    Middle,
    /// The point is at its right end.
    End,
}

/// How a text looks.
#[derive(Clone, Copy, Debug)]
pub struct Type {
    /// Height of the font.
    pub size: f64,
    /// Colour.
    pub colour: &'static str,
    /// Alignment.
    pub align: Align,
    /// `normal` or `bold`.
    pub weight: &'static str,
}

impl Type {
    /// Plain text of a size, in ink.
    #[must_use]
    pub const fn plain(size: f64, align: Align) -> Self {
        Self { size, colour: INK, align, weight: "normal" }
    }

    /// The same in bold.
    #[must_use]
    pub const fn bold(self) -> Self {
        Self { weight: "bold", ..self }
    }

    /// The same in another colour.
    #[must_use]
    pub const fn colour(self, colour: &'static str) -> Self {
        Self { colour, ..self }
    }
}

/// A stroke.
#[derive(Clone, Copy, Debug)]
pub struct Stroke<'a> {
    /// Colour.
    pub colour: &'a str,
    /// Width.
    pub width: f64,
    /// Dash pattern; empty for a solid line.
    pub dash: &'a str,
    /// Opacity, 0 to 1.
    pub opacity: f64,
}

impl<'a> Stroke<'a> {
    /// A solid line.
    #[must_use]
    pub const fn solid(colour: &'a str, width: f64) -> Self {
        Self { colour, width, dash: "", opacity: 1.0 }
    }

    /// The same, dashed.
    #[must_use]
    pub const fn dashed(self, dash: &'a str) -> Self {
        Self { dash, ..self }
    }

    /// The same, let through.
    #[must_use]
    pub const fn opacity(self, opacity: f64) -> Self {
        Self { opacity, ..self }
    }

    fn apply(self, node: &mut impl Node) {
        node.assign("stroke", self.colour);
        node.assign("stroke-width", round(self.width));
        if !self.dash.is_empty() {
            node.assign("stroke-dasharray", self.dash);
        }
        if self.opacity < 1.0 {
            node.assign("stroke-opacity", self.opacity);
        }
    }
}

/// A rectangle on the sheet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Area {
    /// Left edge.
    pub left: f64,
    /// Upper edge.
    pub top: f64,
    /// Width.
    pub width: f64,
    /// Height.
    pub height: f64,
}

impl Area {
    /// Right edge.
    #[must_use]
    pub fn right(&self) -> f64 {
        self.left + self.width
    }

    /// Lower edge.
    #[must_use]
    pub fn bottom(&self) -> f64 {
        self.top + self.height
    }
}

/// A group of shapes: the whole sheet or a clipped part of it.
#[derive(Clone, Debug)]
pub struct Canvas {
    group: Group,
}

impl Canvas {
    /// Nothing drawn.
    #[must_use]
    pub fn new() -> Self {
        Self { group: Group::new() }
    }

    /// Shapes that show only inside the clip of that name.
    #[must_use]
    pub fn clipped(clip: &str) -> Self {
        Self { group: Group::new().set("clip-path", format!("url(#{clip})")) }
    }

    /// Shapes that let through what is below them as one, also where they overlap each other.
    #[must_use]
    pub fn faded(opacity: f64) -> Self {
        Self { group: Group::new().set("opacity", opacity) }
    }

    /// Puts the shapes of another group on top.
    pub fn place(&mut self, other: Self) {
        self.group.append(other.group);
    }

    /// A line of text.
    pub fn text(&mut self, [x, y]: [f64; 2], text: &str, style: Type) {
        self.group.append(written(text, style).set("x", round(x)).set("y", round(y)));
    }

    /// A line of text with a white rim, to stand on pictures.
    pub fn label(&mut self, [x, y]: [f64; 2], text: &str, style: Type) {
        let rimmed = written(text, style)
            .set("stroke", "#ffffff")
            .set("stroke-width", 3.4)
            .set("stroke-linejoin", "round")
            .set("stroke-opacity", 0.9)
            .set("paint-order", "stroke");
        self.group.append(rimmed.set("x", round(x)).set("y", round(y)));
    }

    /// A line of text that runs upwards.
    pub fn upward(&mut self, [x, y]: [f64; 2], text: &str, style: Type) {
        let turned = format!("translate({} {}) rotate(-90)", round(x), round(y));
        self.group.append(written(text, style).set("transform", turned));
    }

    /// A straight line.
    pub fn line(&mut self, [x1, y1]: [f64; 2], [x2, y2]: [f64; 2], stroke: Stroke<'_>) {
        let mut line =
            Line::new().set("x1", round(x1)).set("y1", round(y1)).set("x2", round(x2)).set("y2", round(y2));
        stroke.apply(&mut line);
        self.group.append(line);
    }

    /// A line through points.
    pub fn polyline(&mut self, points: &[[f64; 2]], stroke: Stroke<'_>) {
        let mut line = Polyline::new()
            .set("points", listed(points))
            .set("fill", "none")
            .set("stroke-linejoin", "round")
            .set("stroke-linecap", if stroke.dash.is_empty() { "round" } else { "butt" });
        stroke.apply(&mut line);
        self.group.append(line);
    }

    /// A filled area between points, with a rim.
    pub fn polygon(&mut self, points: &[[f64; 2]], fill: &str, rim: Stroke<'_>) {
        let outline = format!("M{}Z", listed(points));
        let mut shape = Path::new().set("d", outline).set("fill", fill).set("stroke-linejoin", "round");
        rim.apply(&mut shape);
        self.group.append(shape);
    }

    /// All of an area but what lies between points, with a rim.
    pub fn around(&mut self, area: Area, points: &[[f64; 2]], fill: &str, rim: Stroke<'_>) {
        let (left, top, right, bottom) = (area.left, area.top, area.right(), area.bottom());
        let frame = [[left, top], [right, top], [right, bottom], [left, bottom]];
        let outline = format!("M{}ZM{}Z", listed(&frame), listed(points));
        let mut shape = Path::new().set("d", outline).set("fill", fill).set("fill-rule", "evenodd");
        rim.apply(&mut shape);
        self.group.append(shape);
    }

    /// A circle; `fill` may be a pattern.
    pub fn circle(&mut self, [x, y]: [f64; 2], radius: f64, fill: &str, rim: Stroke<'_>) {
        let mut circle =
            Circle::new().set("cx", round(x)).set("cy", round(y)).set("r", round(radius)).set("fill", fill);
        rim.apply(&mut circle);
        self.group.append(circle);
    }

    /// A rectangle.
    pub fn rectangle(&mut self, area: Area, fill: &str, rim: Stroke<'_>) {
        let mut shape = placed(Rectangle::new(), area).set("fill", fill);
        rim.apply(&mut shape);
        self.group.append(shape);
    }

    /// A raster picture, stretched over an area.
    pub fn image(&mut self, area: Area, data_uri: String) {
        let image = Image::new()
            .set("x", round(area.left))
            .set("y", round(area.top))
            .set("width", round(area.width))
            .set("height", round(area.height))
            .set("preserveAspectRatio", "none")
            .set("href", data_uri);
        self.group.append(image);
    }

    /// The finished picture, `width` by `height` units, with the clips by name and a hatching called `hatch`.
    #[must_use]
    pub fn finish(self, width: f64, height: f64, clips: &[(&str, Area)]) -> Picture {
        let mut definitions = Definitions::new().add(hatching());
        for (name, area) in clips {
            definitions = definitions.add(ClipPath::new().set("id", *name).add(placed(Rectangle::new(), *area)));
        }
        let sheet = Rectangle::new().set("width", "100%").set("height", "100%").set("fill", "#ffffff");
        let document = Document::new()
            .set("width", round(width.ceil()))
            .set("height", round(height.ceil()))
            .set("viewBox", (0.0, 0.0, width.ceil(), height.ceil()))
            .set("font-family", font::FAMILY)
            .add(definitions)
            .add(sheet)
            .add(self.group);
        Picture { svg: format!("{document}\n") }
    }
}

fn hatching() -> Pattern {
    let stripe = Line::new().set("x1", 0).set("y1", 0).set("x2", 0).set("y2", 8);
    Pattern::new()
        .set("id", "hatch")
        .set("width", 8)
        .set("height", 8)
        .set("patternUnits", "userSpaceOnUse")
        .set("patternTransform", "rotate(45)")
        .add(Rectangle::new().set("width", 8).set("height", 8).set("fill", "#ffffff").set("fill-opacity", 0.5))
        .add(stripe.set("stroke", "#333333").set("stroke-width", 2.4).set("stroke-opacity", 0.75))
}

fn placed(shape: Rectangle, area: Area) -> Rectangle {
    shape
        .set("x", round(area.left))
        .set("y", round(area.top))
        .set("width", round(area.width))
        .set("height", round(area.height))
}

fn written(text: &str, style: Type) -> Text {
    let anchor = match style.align {
        Align::Start => "start",
        Align::Middle => "middle",
        Align::End => "end",
    };
    let text = Text::new(printable(text)).set("font-size", round(style.size)).set("fill", style.colour);
    let text = if style.weight == "normal" { text } else { text.set("font-weight", style.weight) };
    if style.align == Align::Start { text } else { text.set("text-anchor", anchor) }
}

/// XML has no way to write control characters.
fn printable(text: &str) -> String {
    text.chars().map(|letter| if letter.is_control() { '\u{fffd}' } else { letter }).collect()
}

fn listed(points: &[[f64; 2]]) -> String {
    points.iter().map(|[x, y]| format!("{},{}", round(*x), round(*y))).collect::<Vec<_>>().join(" ")
}

/// Two decimals are a hundredth of a pixel.
fn round(value: f64) -> Rounded {
    Rounded((value * 100.0).round() / 100.0 + 0.0)
}

#[derive(Clone, Copy, Debug)]
struct Rounded(f64);

impl std::fmt::Display for Rounded {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.fmt(f)
    }
}

impl From<Rounded> for Value {
    fn from(rounded: Rounded) -> Self {
        rounded.0.into()
    }
}
