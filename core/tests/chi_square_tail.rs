//! The chi-square tail against 60-digit arithmetic, against its own derivative and against itself.
//!
//! `data/chi_square_tail.csv` is written by `tools/chi_square_tail.py`. `cargo test -p quietpath-core --test
//! chi_square_tail -- --nocapture` prints the worst errors.

use quietpath_core::Real;
use quietpath_core::special::{chi_square_tail, gaussian_tail, ln_chi_square_tail};

const GOLDEN: &str = include_str!("data/chi_square_tail.csv");
const TARGET_DOUBLE: f64 = 1e-12;
const TARGET_SINGLE: f64 = 1e-4;
/// Where tails and density are above 1e-3.
const TARGET_SINGLE_MIDDLE: f64 = 3e-6;

/// One line of the golden table; `t` is a number of single precision.
struct Row {
    degrees: u32,
    t: f64,
    upper: f64,
    density: f64,
    ln_upper: f64,
    ln_lower: f64,
}

fn golden() -> Vec<Row> {
    let rows: Vec<Row> = GOLDEN
        .lines()
        .filter(|line| !line.starts_with('#'))
        .map(|line| {
            let fields: Vec<f64> = line.split(',').map(|field| field.parse().expect("a number")).collect();
            let [degrees, t, upper, density, ln_upper, ln_lower] = fields.try_into().expect("six fields");
            Row { degrees: degrees as u32, t, upper, density, ln_upper, ln_lower }
        })
        .collect();
    assert!(rows.len() > 1000, "the golden table is short: {} rows", rows.len());
    rows
}

/// The largest relative error seen, and where.
#[derive(Default)]
struct Worst {
    error: f64,
    at: String,
    count: usize,
}

impl Worst {
    fn see(&mut self, value: f64, expected: f64, row: &Row) {
        let error = (value - expected).abs() / expected.abs();
        self.count += 1;
        // A NaN counts as the worst there is.
        if error.is_nan() || error > self.error {
            self.error = error;
            self.at = format!("N = {}, t = {}: {value:e}, not {expected:e}", row.degrees, row.t);
        }
    }

    fn report(&self, name: &str, target: f64) {
        println!("{name}: worst relative error {:.1e} of {} ({})", self.error, self.count, self.at);
        assert!(self.count > 100, "{name}: only {} values", self.count);
        assert!(self.error <= target, "{name}: {:e} at {}", self.error, self.at);
    }
}

/// Worst errors over the golden table where the tails lie between `least` and 1.
fn compare<T: Real>(least: f64, target: f64, label: &str) {
    let (mut upper, mut lower) = (Worst::default(), Worst::default());
    let (mut density, mut ln_upper, mut ln_lower) = (Worst::default(), Worst::default(), Worst::default());
    for row in golden() {
        let t = T::real(row.t);
        let tail = chi_square_tail(row.degrees, t);
        let ln_tail = ln_chi_square_tail(row.degrees, t);
        if row.upper >= least {
            upper.see(tail.upper.to_f64(), row.upper, &row);
        }
        if row.ln_lower >= least.ln() {
            lower.see(ln_tail.ln_lower.to_f64().exp(), row.ln_lower.exp(), &row);
        }
        if row.density >= least {
            density.see(tail.density.to_f64(), row.density, &row);
        }
        if -row.ln_upper >= least {
            ln_upper.see(ln_tail.ln_upper.to_f64(), row.ln_upper, &row);
        }
        if -row.ln_lower >= least {
            ln_lower.see(ln_tail.ln_lower.to_f64(), row.ln_lower, &row);
        }
    }
    upper.report(&format!("{label} upper"), target);
    lower.report(&format!("{label} lower, from its logarithm"), target);
    density.report(&format!("{label} density"), target);
    ln_upper.report(&format!("{label} ln upper"), target);
    ln_lower.report(&format!("{label} ln lower"), target);
}

#[test]
fn double_precision_matches_the_golden_tails() {
    compare::<f64>(1e-300, TARGET_DOUBLE, "f64");
}

#[test]
fn single_precision_matches_the_golden_tails() {
    compare::<f32>(1e-20, TARGET_SINGLE, "f32");
}

#[test]
fn single_precision_is_closer_still_in_the_middle() {
    compare::<f32>(1e-3, TARGET_SINGLE_MIDDLE, "f32 middle");
}

#[test]
fn gaussian_tail_matches_the_chi_square_tail_with_one_degree() {
    // Q_1(s²) = 2 Q(s), and its density in t is that of s over s.
    for step in 1..=370 {
        let s = 0.1 * f64::from(step);
        let (gauss, chi) = (gaussian_tail(s), chi_square_tail(1, s * s));
        assert!((2.0 * gauss.upper - chi.upper).abs() <= TARGET_DOUBLE * chi.upper, "{s}");
        assert!((gauss.density / s - chi.density).abs() <= TARGET_DOUBLE * chi.density, "{s}");
        assert!((gaussian_tail(-s).upper + gauss.upper - 1.0).abs() < 1e-15, "{s}");
    }
}

#[test]
fn density_is_minus_the_slope_of_the_upper_tail() {
    for degrees in [1, 2, 3, 10, 21, 39, 40, 41, 100, 999, 2000, 40960] {
        let deviation = (2.0 * f64::from(degrees)).sqrt();
        for step in -30..=30 {
            let t = f64::from(degrees) + 0.1 * f64::from(step) * deviation;
            let h = 1e-3 * deviation.min(t);
            if t <= 0.1 {
                continue;
            }
            // Fourth-order central difference: h^4 of truncation, and the rounding of a tail near 1 over h.
            let at = |offset: f64| chi_square_tail(degrees, t + offset * h).upper;
            let slope = (8.0 * (at(1.0) - at(-1.0)) - (at(2.0) - at(-2.0))) / (12.0 * h);
            let density = chi_square_tail(degrees, t).density;
            let tolerance = 1e-9 * density + 1e-15 / h;
            assert!((slope + density).abs() < tolerance, "N = {degrees}, t = {t}: {slope} {density}");
        }
    }
}

#[test]
fn upper_tail_falls_with_t_and_rises_with_degrees() {
    for degrees in (1..=130).chain([257, 999, 1000, 2600, 10_400, 40_959]) {
        let mean = f64::from(degrees);
        let (mut last, mut last_single) = (1.0, 1.0_f32);
        for step in 1..=400 {
            let t = mean * 0.01 * f64::from(step);
            let upper = chi_square_tail(degrees, t).upper;
            assert!(upper <= last && upper >= 0.0, "N = {degrees}, t = {t}: {upper} after {last}");
            assert!(chi_square_tail(degrees + 1, t).upper >= upper * (1.0 - 1e-12), "N = {degrees}, t = {t}");
            last = upper;
            let single = chi_square_tail(degrees, t as f32).upper;
            assert!(single <= last_single * (1.0 + 4.0 * f32::EPSILON), "N = {degrees}, t = {t}: f32 {single}");
            last_single = single;
        }
    }
}

#[test]
fn even_tails_are_continuous_across_every_change_of_method() {
    // Q_(N+2) - Q_N = 2 density_(N+2) for any N: ties N below the cutover to N above it.
    for degrees in 30..=50 {
        for step in 1..=400 {
            let t = 0.25 * f64::from(step);
            let (here, next) = (chi_square_tail(degrees, t), chi_square_tail(degrees + 2, t));
            let residual = next.upper - here.upper - 2.0 * next.density;
            assert!(residual.abs() < 1e-13 * next.upper, "N = {degrees}, t = {t}: {residual}");
        }
    }
}

#[test]
fn tails_are_continuous_in_t_across_every_change_of_method() {
    // eta = ±1/8, ±1/4, ±1/2, ±1: x/a by Newton's method on x/a - 1 - ln(x/a) = eta²/2.
    for eta in [-1.0_f64, -0.5, -0.25, -0.125, 0.125, 0.25, 0.5, 1.0] {
        let mut ratio = 1.0 + eta;
        ratio = ratio.max(0.3);
        for _ in 0..60 {
            ratio -= (ratio - 1.0 - ratio.ln() - 0.5 * eta * eta) / (1.0 - 1.0 / ratio);
        }
        for degrees in [40, 41, 64, 129, 256, 600] {
            let t = f64::from(degrees) * ratio;
            let (below, above) = (t * (1.0 - 1e-9), t * (1.0 + 1e-9));
            let (a, b) = (ln_chi_square_tail(degrees, below), ln_chi_square_tail(degrees, above));
            let tail = chi_square_tail(degrees, t);
            let step = tail.density * (above - below);
            let by_upper = b.ln_upper.exp() - a.ln_upper.exp() + step;
            let by_lower = b.ln_lower.exp() - a.ln_lower.exp() - step;
            assert!(by_upper.abs() < 1e-12 * tail.upper, "N = {degrees}, eta = {eta}: {by_upper}");
            assert!(by_lower.abs() < 1e-12 * a.ln_lower.exp(), "N = {degrees}, eta = {eta}: {by_lower}");
        }
    }
}

#[test]
fn edges_are_finite_and_sensible() {
    for degrees in [0, 1, 2, 3, 39, 40, 41, 40_960, u32::MAX] {
        for t in [0.0, -0.0, -1.0, f64::NEG_INFINITY] {
            let (tail, ln_tail) = (chi_square_tail(degrees, t), ln_chi_square_tail(degrees, t));
            assert_eq!((tail.upper, tail.density), (1.0, 0.0));
            assert_eq!((ln_tail.ln_upper, ln_tail.ln_lower), (0.0, f64::NEG_INFINITY));
        }
        for t in [f64::MAX, f64::INFINITY] {
            let (tail, ln_tail) = (chi_square_tail(degrees, t), ln_chi_square_tail(degrees, t));
            assert_eq!((tail.upper, tail.density), (0.0, 0.0));
            assert!(ln_tail.ln_upper < -1e300 && ln_tail.ln_lower == 0.0, "{degrees} {t} {ln_tail:?}");
        }
        assert!(chi_square_tail(degrees, f64::NAN).upper.is_nan());
        assert!(ln_chi_square_tail(degrees, f64::NAN).ln_lower.is_nan());
        // Every magnitude of either precision.
        for exponent in -1074..=1023 {
            let t = 2.0_f64.powi(exponent);
            let (tail, ln_tail) = (chi_square_tail(degrees, t), ln_chi_square_tail(degrees, t));
            assert!((0.0..=1.0).contains(&tail.upper) && tail.density >= 0.0, "{degrees} {t:e} {tail:?}");
            assert!(tail.density.is_finite() || degrees < 2, "{degrees} {t:e} {tail:?}");
            assert!(ln_tail.ln_upper <= 0.0 && ln_tail.ln_lower <= 0.0, "{degrees} {t:e} {ln_tail:?}");
        }
        for exponent in -149..=127 {
            let t = 2.0_f32.powi(exponent);
            let (tail, ln_tail) = (chi_square_tail(degrees, t), ln_chi_square_tail(degrees, t));
            assert!((0.0..=1.0).contains(&tail.upper) && tail.density >= 0.0, "{degrees} {t:e} {tail:?}");
            assert!(tail.density.is_finite() || degrees < 2, "{degrees} {t:e} {tail:?}");
            assert!(ln_tail.ln_upper <= 0.0 && ln_tail.ln_lower <= 0.0, "{degrees} {t:e} {ln_tail:?}");
        }
    }
}
