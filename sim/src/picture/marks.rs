//! Marks that several pictures share: framed axes, colour bars, legends, arrowheads.

use super::canvas::{Align, Area, Canvas, FAINT, INK, Stroke, Type};
use super::colour;
use super::font;
use super::scale::{Scale, Spacing};

/// Height of the numbers beside ticks.
pub const TICK_TEXT: f64 = 14.0;
/// Height of axis labels and legends.
pub const LABEL_TEXT: f64 = 15.0;
/// Length of a tick.
const TICK: f64 = 5.0;

/// Ticks and numbers below an area. Numbers are left out with [`Numbers::Hidden`].
pub fn x_axis(canvas: &mut Canvas, area: Area, scale: &Scale, wanted: usize, numbers: Numbers) {
    for tick in scale.ticks(wanted) {
        let x = area.left + scale.share(tick.value) * area.width;
        canvas.line([x, area.bottom()], [x, area.bottom() + TICK], Stroke::solid(INK, 1.0));
        if numbers == Numbers::Shown {
            let baseline = area.bottom() + TICK + TICK_TEXT + 1.0;
            canvas.text([x, baseline], &tick.label, Type::plain(TICK_TEXT, Align::Middle));
        }
    }
}

/// Ticks and numbers left of an area; returns the width of the widest number.
pub fn y_axis(canvas: &mut Canvas, area: Area, scale: &Scale, wanted: usize) -> f64 {
    let mut widest = 0.0_f64;
    for tick in scale.ticks(wanted) {
        let y = area.bottom() - scale.share(tick.value) * area.height;
        let length = if tick.label.is_empty() { 0.6 * TICK } else { TICK };
        canvas.line([area.left - length, y], [area.left, y], Stroke::solid(INK, 1.0));
        let style = Type::plain(TICK_TEXT, Align::End);
        if !tick.label.is_empty() {
            canvas.text([area.left - TICK - 4.0, y + 0.36 * TICK_TEXT], &tick.label, style);
            widest = widest.max(font::width(&tick.label, TICK_TEXT));
        }
    }
    widest
}

/// Whether an axis carries numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Numbers {
    /// It does.
    Shown,
    /// Another axis below carries them.
    Hidden,
}

/// Faint lines across an area at the labelled ticks.
pub fn grid_lines(canvas: &mut Canvas, area: Area, x: (&Scale, usize), y: (&Scale, usize)) {
    let stroke = Stroke::solid("#e4e4e4", 1.0);
    for tick in x.0.ticks(x.1) {
        let at = area.left + x.0.share(tick.value) * area.width;
        canvas.line([at, area.top], [at, area.bottom()], stroke);
    }
    for tick in y.0.ticks(y.1).iter().filter(|tick| !tick.label.is_empty()) {
        let at = area.bottom() - y.0.share(tick.value) * area.height;
        canvas.line([area.left, at], [area.right(), at], stroke);
    }
}

/// The widest number that [`colour_bar`] writes beside `scale`.
#[must_use]
pub fn colour_bar_numbers(scale: &Scale) -> f64 {
    scale.ticks(6).iter().map(|tick| font::width(&tick.label, TICK_TEXT)).fold(0.0, f64::max)
}

/// A colour bar with numbers and a label at its right, pointed where values lie beyond its ends.
pub fn colour_bar(canvas: &mut Canvas, area: Area, scale: &Scale, label: &str, beyond: [bool; 2]) {
    let strips = 128_u32;
    let height = area.height / f64::from(strips);
    // From the top, each down to the lower end, so that no seam shows.
    for strip in (0..strips).rev() {
        let share = (f64::from(strip) + 0.5) / f64::from(strips);
        let tall = f64::from(strip + 1) * height;
        let band = Area { left: area.left, top: area.bottom() - tall, width: area.width, height: tall };
        canvas.rectangle(band, &colour::css(share), Stroke::solid("none", 0.0));
    }
    let rim = Stroke::solid(INK, 1.0);
    let middle = area.left + 0.5 * area.width;
    for (pointed, share, y, tip) in
        [(beyond[0], 0.0, area.bottom(), area.bottom() + 14.0), (beyond[1], 1.0, area.top, area.top - 14.0)]
    {
        if pointed {
            canvas.polygon(&[[area.left, y], [area.right(), y], [middle, tip]], &colour::css(share), rim);
        }
    }
    canvas.rectangle(area, "none", rim);
    for tick in scale.ticks(6) {
        let y = area.bottom() - scale.share(tick.value) * area.height;
        let length = if tick.label.is_empty() { 3.0 } else { 5.0 };
        canvas.line([area.right(), y], [area.right() + length, y], rim);
        let style = Type::plain(TICK_TEXT, Align::Start);
        canvas.text([area.right() + 9.0, y + 0.36 * TICK_TEXT], &tick.label, style);
    }
    let spacing = if scale.spacing == Spacing::Log { ", logarithmic scale" } else { "" };
    let x = area.right() + 9.0 + colour_bar_numbers(scale) + LABEL_TEXT + 6.0;
    let at = [x, area.top + 0.5 * area.height];
    canvas.upward(at, &format!("{label}{spacing}"), Type::plain(LABEL_TEXT, Align::Middle));
}

/// A title, and below it a line of smaller text.
pub fn heading(canvas: &mut Canvas, [x, y]: [f64; 2], title: &str, subtitle: &str) {
    canvas.text([x, y], title, Type::plain(20.0, Align::Start).bold());
    canvas.text([x, y + 22.0], subtitle, Type::plain(14.0, Align::Start).colour(FAINT));
}

/// Draws a legend's sample from the point given, which is at its left and middle.
pub type Sampler = Box<dyn Fn(&mut Canvas, [f64; 2])>;

/// One entry of a legend: what draws the sample (at its left middle) and the words beside it.
pub struct Entry {
    /// Draws a sample of [`SAMPLE`] width.
    pub sample: Sampler,
    /// What it stands for.
    pub words: String,
}

/// Width of a legend's sample.
pub const SAMPLE: f64 = 30.0;
/// Height of a line of the legend.
pub const LEGEND_LINE: f64 = 24.0;

/// Entries side by side in lines of at most `width`; returns the height they take.
pub fn legend(canvas: &mut Canvas, [left, top]: [f64; 2], width: f64, entries: &[Entry]) -> f64 {
    let (mut x, mut line) = (left, 0_u32);
    for entry in entries {
        let needs = SAMPLE + 7.0 + font::width(&entry.words, TICK_TEXT);
        if x > left && x + needs > left + width {
            x = left;
            line += 1;
        }
        let y = top + (f64::from(line) + 0.5) * LEGEND_LINE;
        (entry.sample)(canvas, [x, y]);
        let at = [x + SAMPLE + 7.0, y + 0.36 * TICK_TEXT];
        canvas.text(at, &entry.words, Type::plain(TICK_TEXT, Align::Start));
        x += needs + 24.0;
    }
    if entries.is_empty() { 0.0 } else { f64::from(line + 1) * LEGEND_LINE }
}

/// A filled arrowhead whose tip is ahead of `[x, y]` by half its length, pointing along `[dx, dy]`.
pub fn arrowhead(canvas: &mut Canvas, [x, y]: [f64; 2], [dx, dy]: [f64; 2], size: f64, fill: &str) {
    let length = dx.hypot(dy);
    if length < 1e-9 {
        return;
    }
    let (along, across) = ([dx / length * size, dy / length * size], [-dy / length * size, dx / length * size]);
    let at = |a: f64, b: f64| [x + a * along[0] + b * across[0], y + a * along[1] + b * across[1]];
    let outline = [at(0.9, 0.0), at(-0.7, 0.72), at(-0.35, 0.0), at(-0.7, -0.72)];
    canvas.polygon(&outline, fill, Stroke::solid("#ffffff", 1.3));
}
