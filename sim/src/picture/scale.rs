//! Axes of numbers: where the ticks stand, how they are written, and how values become shares of a length.
//!
//! A [`Scale`] is linear or logarithmic (base 10). [`Scale::of_values`] looks at the data: it leaves out the
//! outermost percent at either end, so that one peak does not wash out the rest, and turns logarithmic where a
//! positive figure spans more than `DECADES_FOR_LOG` decades.

/// Span from which a positive figure is drawn logarithmically, decades.
const DECADES_FOR_LOG: f64 = 1.5;
/// Share of the values left out at either end of a colour scale.
const TRIMMED: f64 = 0.01;
/// Decades that a logarithmic scale keeps at most, counted from its top.
const DECADES_MAX: f64 = 12.0;

/// How the values between the ends are laid out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Spacing {
    /// In proportion.
    Linear,
    /// In proportion to the logarithm.
    Log,
}

/// What may be done with the numbers of a figure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A probability: linear from 0, never beyond 1.
    Probability,
    /// A positive quantity: logarithmic where it spans decades.
    Positive,
    /// A quantity that may well be zero: linear from 0.
    Magnitude,
    /// Any number: linear.
    Signed,
}

/// A range of numbers on an axis or a colour bar.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// Smallest value shown.
    pub min: f64,
    /// Largest value shown.
    pub max: f64,
    /// Layout between them.
    pub spacing: Spacing,
}

/// A tick: its value and what is written beside it.
#[derive(Clone, Debug, PartialEq)]
pub struct Tick {
    /// Where it stands.
    pub value: f64,
    /// What is written; empty for a minor tick.
    pub label: String,
}

impl Scale {
    /// A linear scale.
    #[must_use]
    pub const fn linear(min: f64, max: f64) -> Self {
        Self { min, max, spacing: Spacing::Linear }
    }

    /// A colour scale for `values`, without the outermost percent at either end.
    #[must_use]
    pub fn of_values(values: &[f64], kind: Kind) -> Self {
        let mut sorted: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
        sorted.sort_by(f64::total_cmp);
        let (low, high) = (quantile(&sorted, TRIMMED), quantile(&sorted, 1.0 - TRIMMED));
        match kind {
            Kind::Probability => Self::linear(0.0, if high > 0.0 { nice_above(high).min(1.0) } else { 1.0 }),
            Kind::Positive if low > 0.0 && (high / low).log10() > DECADES_FOR_LOG => {
                let min = low.max(high / 10_f64.powf(DECADES_MAX));
                Self { min, max: high, spacing: Spacing::Log }
            }
            Kind::Magnitude => widened(0.0, high),
            Kind::Positive | Kind::Signed => widened(low, high),
        }
    }

    /// An axis that shows all of `values`, with a little room.
    #[must_use]
    pub fn covering(values: impl Iterator<Item = f64>, kind: Kind) -> Self {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for value in values.filter(|value| value.is_finite()) {
            low = low.min(value);
            high = high.max(value);
        }
        if low > high {
            return Self::linear(0.0, 1.0);
        }
        match kind {
            Kind::Positive if low > 0.0 && (high / low).log10() > DECADES_FOR_LOG => {
                Self { min: low / 1.25, max: high * 1.25, spacing: Spacing::Log }
            }
            Kind::Probability if high > 0.0 => Self::linear(0.0, (1.12 * high).min(high.max(1.0) * 1.02)),
            Kind::Probability | Kind::Positive | Kind::Magnitude => {
                Self::linear(0.0, if high > 0.0 { high * 1.12 } else { 1.0 })
            }
            Kind::Signed => {
                let room = (high - low).max(1e-9 * high.abs()).max(1e-12) * 0.08;
                Self::linear(low - room, high + room)
            }
        }
    }

    /// Where `value` lies between the ends: 0 at `min`, 1 at `max`, beyond them outside that range.
    #[must_use]
    pub fn share(&self, value: f64) -> f64 {
        match self.spacing {
            Spacing::Linear => (value - self.min) / (self.max - self.min),
            Spacing::Log => (value / self.min).ln() / (self.max / self.min).ln(),
        }
    }

    /// Ticks: about `wanted` with labels, and minor ones between decades.
    #[must_use]
    pub fn ticks(&self, wanted: usize) -> Vec<Tick> {
        match self.spacing {
            Spacing::Linear => linear_ticks(self.min, self.max, wanted),
            Spacing::Log => log_ticks(self.min, self.max, wanted),
        }
    }
}

/// The value below which `share` of the sorted values lie; 0 for none.
fn quantile(sorted: &[f64], share: f64) -> f64 {
    let place = share * sorted.len().saturating_sub(1) as f64;
    let below = place.floor() as usize;
    let low = sorted.get(below).copied().unwrap_or(0.0);
    let high = sorted.get(below + 1).copied().unwrap_or(low);
    low + (high - low) * place.fract()
}

/// A linear scale that is not empty.
fn widened(low: f64, high: f64) -> Scale {
    if high > low {
        return Scale::linear(low, high);
    }
    let room = if low == 0.0 { 1.0 } else { 0.5 * low.abs() };
    Scale::linear(low - room, low + room)
}

/// The smallest of 1, 1.5, 2, 3, 4, 5, 6, 8 times a power of ten that is not below `value`.
fn nice_above(value: f64) -> f64 {
    let power = 10_f64.powf(value.log10().floor());
    let steps = [1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0];
    steps.into_iter().map(|step| step * power).find(|top| *top >= value).unwrap_or(10.0 * power)
}

/// The step of 1, 2 or 5 times a power of ten that gives about `wanted` ticks.
fn nice_step(span: f64, wanted: usize) -> f64 {
    let raw = span / wanted.max(1) as f64;
    let power = 10_f64.powf(raw.log10().floor());
    let lead = raw / power;
    let nice = if lead < 1.5 {
        1.0
    } else if lead < 3.5 {
        2.0
    } else if lead < 7.5 {
        5.0
    } else {
        10.0
    };
    nice * power
}

fn linear_ticks(min: f64, max: f64, wanted: usize) -> Vec<Tick> {
    let span = max - min;
    if !(span.is_finite() && span > 0.0) {
        return Vec::new();
    }
    let step = nice_step(span, wanted);
    let (first, slack) = ((min / step - 1e-9).ceil(), 1e-9 * span);
    let mut ticks = Vec::new();
    // A step is never below a twentieth of `span / wanted`, so the bound is never met.
    for count in 0..20 * wanted.max(1) {
        let value = (first + count as f64) * step;
        if value > max + slack {
            break;
        }
        let value = if value.abs() < 1e-9 * step { 0.0 } else { value };
        ticks.push(Tick { value, label: label(value, step, min.abs().max(max.abs())) });
    }
    ticks
}

/// A number written with the decimals that `step` asks for.
fn label(value: f64, step: f64, largest: f64) -> String {
    if !(1e-3..1e5).contains(&largest) {
        return scientific(value, step);
    }
    let decimals = (-(step.log10() + 1e-9).floor()).clamp(0.0, 9.0) as usize;
    format!("{value:.decimals$}").replace('-', "\u{2212}")
}

fn scientific(value: f64, step: f64) -> String {
    if value == 0.0 {
        return "0".into();
    }
    let exponent = value.abs().log10().floor();
    let lead = value / 10_f64.powf(exponent);
    let decimals = (exponent - (step.log10() + 1e-9).floor()).clamp(0.0, 6.0) as usize;
    let power = power_of_ten(exponent);
    format!("{lead:.decimals$}\u{b7}{power}").replace('-', "\u{2212}")
}

fn log_ticks(min: f64, max: f64, wanted: usize) -> Vec<Tick> {
    let (low, high) = (min.log10().floor(), max.log10().ceil());
    let inside = |value: f64| value >= min * (1.0 - 1e-9) && value <= max * (1.0 + 1e-9);
    let decades = (max.log10() + 1e-9).floor() - (min.log10() - 1e-9).ceil() + 1.0;
    let every = (decades / wanted.max(1) as f64).ceil().max(1.0);
    let mut ticks = Vec::new();
    let mut exponent = low;
    while exponent <= high {
        for lead in 1..10_u32 {
            let value = f64::from(lead) * 10_f64.powf(exponent);
            if !inside(value) {
                continue;
            }
            let major = lead == 1 && (exponent / every).fract() == 0.0;
            // With fewer than three decades in sight, powers of ten alone would leave too few numbers to read.
            let named = major || (decades < 3.0 && matches!(lead, 1 | 2 | 5));
            let label = match (named, lead) {
                (false, _) => String::new(),
                (true, 1) => power_of_ten(exponent),
                (true, _) => plain_or_power(lead, exponent),
            };
            if named || every <= 1.0 {
                ticks.push(Tick { value, label });
            }
        }
        exponent += 1.0;
    }
    ticks
}

fn plain_or_power(lead: u32, exponent: f64) -> String {
    if (-3.0..=3.0).contains(&exponent) {
        let value = f64::from(lead) * 10_f64.powf(exponent);
        return trimmed(value);
    }
    format!("{lead}\u{b7}{}", power_of_ten(exponent))
}

/// A power of ten: plain from 0.001 to 1000, with a raised exponent beyond.
fn power_of_ten(exponent: f64) -> String {
    if (-3.0..=3.0).contains(&exponent) {
        return trimmed(10_f64.powf(exponent));
    }
    let raised = |digit: char| match digit {
        '-' => '\u{207b}',
        '0' => '\u{2070}',
        '1' => '\u{b9}',
        '2' => '\u{b2}',
        '3' => '\u{b3}',
        other => char::from_u32(0x2070 + other.to_digit(10).unwrap_or(0)).unwrap_or(other),
    };
    let digits: String = format!("{exponent:.0}").chars().map(raised).collect();
    format!("10{digits}")
}

/// A number with at most six significant digits and no trailing zeros.
#[must_use]
pub fn trimmed(value: f64) -> String {
    if value == 0.0 {
        return "0".into();
    }
    if !value.is_finite() {
        return value.to_string();
    }
    let exponent = value.abs().log10().floor();
    if !(-4.0..=6.0).contains(&exponent) {
        return format!("{value:.3e}");
    }
    let decimals = (5.0 - exponent).clamp(0.0, 9.0) as usize;
    let text = format!("{value:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(scale: Scale, wanted: usize) -> Vec<String> {
        scale.ticks(wanted).into_iter().map(|tick| tick.label).filter(|label| !label.is_empty()).collect()
    }

    #[test]
    fn linear_ticks_are_round() {
        assert_eq!(labels(Scale::linear(0.0, 1.0), 5), ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]);
        assert_eq!(labels(Scale::linear(-3.0, 1.0), 4), ["\u{2212}3", "\u{2212}2", "\u{2212}1", "0", "1"]);
        assert_eq!(labels(Scale::linear(0.0, 123.0), 5), ["0", "20", "40", "60", "80", "100", "120"]);
    }

    #[test]
    fn wide_log_ticks_are_powers_of_ten() {
        let scale = Scale { min: 1e-5, max: 1e-1, spacing: Spacing::Log };
        assert_eq!(labels(scale, 6), ["10\u{207b}\u{2075}", "10\u{207b}\u{2074}", "0.001", "0.01", "0.1"]);
    }

    #[test]
    fn narrow_log_ticks_have_numbers_between() {
        let scale = Scale { min: 0.3, max: 30.0, spacing: Spacing::Log };
        assert_eq!(labels(scale, 6), ["0.5", "1", "2", "5", "10", "20"]);
    }

    #[test]
    fn a_peak_does_not_stretch_the_colours() {
        let mut values: Vec<f64> = (0..1000).map(|k| 1.0 + f64::from(k) / 1000.0).collect();
        values.push(1e9);
        let scale = Scale::of_values(&values, Kind::Positive);
        assert!(scale.max < 2.1, "{scale:?}");
    }

    #[test]
    fn decades_turn_logarithmic_and_probabilities_do_not() {
        let values: Vec<f64> = (0..1000).map(|k| 10_f64.powf(f64::from(k) / 200.0 - 5.0)).collect();
        assert_eq!(Scale::of_values(&values, Kind::Positive).spacing, Spacing::Log);
        assert_eq!(Scale::of_values(&values, Kind::Probability).spacing, Spacing::Linear);
    }

    #[test]
    fn equal_values_still_make_a_scale() {
        for value in [0.0, 3.0, -2.0] {
            let scale = Scale::of_values(&[value; 4], Kind::Signed);
            assert!((scale.share(value) - 0.5).abs() < 1e-12, "{scale:?}");
        }
        assert_eq!(Scale::covering([f64::NAN].into_iter(), Kind::Positive), Scale::linear(0.0, 1.0));
    }

    #[test]
    fn small_steps_far_from_zero_keep_their_digits() {
        assert_eq!(labels(Scale::linear(100.0, 100.3), 3), ["100.0", "100.1", "100.2", "100.3"]);
        assert_eq!(
            labels(Scale::linear(0.0, 2e-5), 2),
            ["0", "1\u{b7}10\u{207b}\u{2075}", "2\u{b7}10\u{207b}\u{2075}"]
        );
    }
}
