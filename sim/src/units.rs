//! From the scenario's units to the ones that people read.
//!
//! Pictures and summaries are in metres; plan and CSV files keep the scenario's length unit. A metric with the
//! dimension length^p is multiplied by `unit_m`^p, its logarithm gets p ln `unit_m` added.
//!
//! | metric | p, two dimensions | p, three |
//! |---|---|---|
//! | detection, false alarm | 0 | 0 |
//! | CEP^2 | 2 | 2 |
//! | CEP | 1 | 1 |
//! | AEE | 2 | 3 (a volume proxy) |
//! | GDOP (18): CEP over a sum of variances, c = 1 | -1 | -1 |

use quietpath_core::scenario::Metric;

use crate::picture::scale::Kind;

/// Domains at least this wide are drawn in kilometres, m.
const KILOMETRES_FROM: f64 = 5000.0;

/// How a metric is called, measured and drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Presentation {
    /// Name for people.
    pub name: &'static str,
    /// Name without "logarithm of" and short enough for an axis.
    pub short: &'static str,
    /// Unit in metres; empty for none.
    pub unit: &'static str,
    /// What kind of number it is.
    pub kind: Kind,
    factor: f64,
    offset: f64,
}

impl Presentation {
    /// The presentation of a metric in a scenario of `dimension` whose length unit is `unit_m` metres.
    #[must_use]
    pub fn of(metric: Metric, dimension: usize, unit_m: f64) -> Self {
        let (power, unit) = match base(metric) {
            Metric::Cep2 => (2, "m\u{b2}"),
            Metric::Cep => (1, "m"),
            Metric::Aee if dimension == 3 => (3, "m\u{b3}"),
            Metric::Aee => (2, "m\u{b2}"),
            Metric::Gdop => (-1, "1/m"),
            _ => (0, ""),
        };
        let factor = unit_m.powi(power);
        let (name, short) = (name(metric), short(metric));
        if base(metric) == metric {
            let kind = if metric.is_location_error() { Kind::Positive } else { Kind::Probability };
            Self { name, short, unit, kind, factor, offset: 0.0 }
        } else {
            Self { name, short, unit, kind: Kind::Signed, factor: 1.0, offset: factor.ln() }
        }
    }

    /// A value in the scenario's units, in metres.
    #[must_use]
    pub fn convert(&self, value: f64) -> f64 {
        value * self.factor + self.offset
    }

    /// Short name and unit, for an axis.
    #[must_use]
    pub fn label(&self) -> String {
        match (self.unit, self.kind) {
            ("", Kind::Signed) => format!("ln {}", self.short),
            ("", _) => self.short.to_owned(),
            ("1/m", Kind::Signed) => format!("ln ({} \u{b7} m)", self.short),
            (unit, Kind::Signed) => format!("ln ({} / {unit})", self.short),
            (unit, _) => format!("{} ({unit})", self.short),
        }
    }
}

/// The metric whose logarithm this is, or itself.
#[must_use]
pub const fn base(metric: Metric) -> Metric {
    match metric {
        Metric::LogCep2 => Metric::Cep2,
        Metric::LogCep => Metric::Cep,
        Metric::LogAee => Metric::Aee,
        Metric::LogGdop => Metric::Gdop,
        other => other,
    }
}

const fn name(metric: Metric) -> &'static str {
    match metric {
        Metric::Detection => "probability of detection",
        Metric::FalseAlarm => "probability of a false alarm",
        Metric::Cep2 => "circular error probable (CEP), squared",
        Metric::Cep => "circular error probable (CEP)",
        Metric::Aee => "area of the error ellipse (AEE)",
        Metric::Gdop => "geometric dilution of position (GDOP)",
        Metric::LogCep2 => "logarithm of the squared CEP",
        Metric::LogCep => "logarithm of the CEP",
        Metric::LogAee => "logarithm of the AEE",
        Metric::LogGdop => "logarithm of the GDOP",
    }
}

const fn short(metric: Metric) -> &'static str {
    match base(metric) {
        Metric::Cep2 => "CEP\u{b2}",
        Metric::Cep => "CEP",
        Metric::Aee => "AEE",
        Metric::Gdop => "GDOP",
        other => name(other),
    }
}

/// Unit of the axes of a domain `extent` metres wide, and how many metres it has.
#[must_use]
pub fn axis_unit(extent: f64) -> (&'static str, f64) {
    if extent >= KILOMETRES_FROM { ("km", 1000.0) } else { ("m", 1.0) }
}

/// A length in m or km with three or four digits.
#[must_use]
pub fn length(metres: f64) -> String {
    if metres.abs() >= 1000.0 { format!("{:.3} km", metres / 1000.0) } else { format!("{metres:.1} m") }
}

/// A span of time in s, and in min or h where it is long.
#[must_use]
pub fn duration(seconds: f64) -> String {
    match crate::picture::series::time_unit(seconds) {
        ("s", _) => format!("{seconds:.2} s"),
        (unit, size) => format!("{seconds:.1} s ({:.2} {unit})", seconds / size),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn metrics_convert_by_their_dimension() {
        let convert = |metric, dimension| Presentation::of(metric, dimension, 100.0).convert(2.0);
        assert_eq!(convert(Metric::Detection, 2).to_bits(), 2.0_f64.to_bits());
        assert!((convert(Metric::Cep, 2) - 200.0).abs() < 1e-9);
        assert!((convert(Metric::Aee, 2) - 2e4).abs() < 1e-6);
        assert!((convert(Metric::Aee, 3) - 2e6).abs() < 1e-4);
        assert!((convert(Metric::Gdop, 2) - 0.02).abs() < 1e-12);
        assert!((convert(Metric::LogAee, 2) - (2.0 + 1e4_f64.ln())).abs() < 1e-12);
    }

    #[test]
    fn labels_have_units_and_logarithms_have_none() {
        let label = |metric| Presentation::of(metric, 2, 100.0).label();
        assert_eq!(label(Metric::Detection), "probability of detection");
        assert_eq!(label(Metric::Aee), "AEE (m\u{b2})");
        assert_eq!(label(Metric::LogAee), "ln (AEE / m\u{b2})");
        assert_eq!(label(Metric::LogGdop), "ln (GDOP \u{b7} m)");
    }

    #[test]
    fn lengths_and_times_read_well() {
        assert_eq!(length(958.04), "958.0 m");
        assert_eq!(length(13_724.0), "13.724 km");
        assert_eq!(duration(115.262), "115.26 s");
        assert_eq!(duration(11_436.7), "11436.7 s (3.18 h)");
    }
}
