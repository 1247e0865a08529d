//! Figures of samples.

/// The value below which `share` of the values lie, linear between neighbours; NaN of none.
#[must_use]
pub fn quantile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let place = share * sorted.len().saturating_sub(1) as f64;
    let low = sorted.get(place.floor() as usize).copied().unwrap_or(f64::NAN);
    let high = sorted.get(place.ceil() as usize).copied().unwrap_or(low);
    (high - low).mul_add(place.fract(), low)
}

/// The middle value; NaN of none.
#[must_use]
pub fn median(values: &[f64]) -> f64 {
    quantile(values, 0.5)
}

/// Difference from a reference, relative to max(1, |reference|): negative is better.
#[must_use]
pub fn gap(objective: f64, reference: f64) -> f64 {
    (objective - reference) / reference.abs().max(1.0)
}

/// Exponent and factor of `y = factor x^exponent` by least squares of the logarithms, for points `[x, y]`.
#[must_use]
pub fn power_law(points: &[[f64; 2]]) -> (f64, f64) {
    let count = points.len() as f64;
    let logs: Vec<[f64; 2]> = points.iter().map(|[x, y]| [x.ln(), y.ln()]).collect();
    let mean = |axis: usize| logs.iter().map(|point| point[axis]).sum::<f64>() / count;
    let (x, y) = (mean(0), mean(1));
    let square: f64 = logs.iter().map(|point| (point[0] - x) * (point[0] - x)).sum();
    let product: f64 = logs.iter().map(|point| (point[0] - x) * (point[1] - y)).sum();
    let exponent = product / square;
    (exponent, exponent.mul_add(-x, y).exp())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_lie_between_neighbours() {
        assert_eq!((median(&[3.0, 1.0, 2.0]), quantile(&[0.0, 10.0], 0.9)), (2.0, 9.0));
        assert!(median(&[]).is_nan());
    }

    #[test]
    fn gaps_of_small_figures_are_absolute() {
        assert_eq!((gap(-198.0, -200.0), gap(0.3, 0.2)), (0.01, 0.3 - 0.2));
    }

    #[test]
    fn a_power_law_is_found() {
        let points: Vec<[f64; 2]> = (1..6).map(|x| [f64::from(x), 3.0 * f64::from(x).powf(1.5)]).collect();
        let (exponent, factor) = power_law(&points);
        assert!((exponent - 1.5).abs() < 1e-12 && (factor - 3.0).abs() < 1e-12);
    }
}
