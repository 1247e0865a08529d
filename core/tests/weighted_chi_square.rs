//! Tails of weighted chi-square sums against contour integration, against their own derivatives and against themselves.
//!
//! `data/weighted_chi_square.txt` is written by `tools/weighted_chi_square.py`. `cargo test -p quietpath-core --test
//! weighted_chi_square -- --nocapture` prints the errors by degrees and by weights.

use quietpath_core::Real;
use quietpath_core::special::{Part, chi_square_tail, weighted_chi_square_tail};

const GOLDEN: &str = include_str!("data/weighted_chi_square.txt");

struct Case {
    parts: Vec<Part<f64>>,
    /// Threshold, upper tail, density.
    tails: Vec<[f64; 3]>,
}

fn golden() -> Vec<Case> {
    let mut cases: Vec<Case> = Vec::new();
    for line in GOLDEN.lines().filter(|line| !line.starts_with('#')) {
        if let Some(parts) = line.strip_prefix("parts ") {
            let part = |text: &str| {
                let fields: Vec<&str> = text.split(':').collect();
                let number = |index: usize| fields[index].parse::<f64>().expect("a number");
                Part { degrees: number(0) as u32, weight: number(1), coupling: number(2) }
            };
            cases.push(Case { parts: parts.split(' ').map(part).collect(), tails: Vec::new() });
        } else {
            let numbers: Vec<f64> = line.split(' ').map(|field| field.parse().expect("a number")).collect();
            cases.last_mut().expect("parts first").tails.push(numbers.try_into().expect("three numbers"));
        }
    }
    assert!(cases.len() > 200, "the golden table is short: {} cases", cases.len());
    cases
}

fn tail<T: Real>(parts: &[Part<f64>], threshold: f64) -> quietpath_core::special::WeightedTail<T> {
    let part = |part: &Part<f64>| Part {
        degrees: part.degrees,
        weight: T::real(part.weight),
        coupling: T::real(part.coupling),
    };
    weighted_chi_square_tail(parts.iter().map(part), T::real(threshold))
}

/// Errors of one group of cases: of the tail, of the density, and how many figures.
#[derive(Clone, Copy, Default)]
struct Group {
    upper: f64,
    middle: f64,
    density: f64,
    count: usize,
}

/// Smallest degrees of a part with at least half the largest weight or coupling: what the far tail hangs on.
fn leading(parts: &[Part<f64>]) -> u32 {
    let size = |part: &Part<f64>| part.weight + part.coupling;
    let most = parts.iter().map(size).fold(0.0, f64::max);
    parts.iter().filter(|part| size(part) > 0.5 * most).map(|part| part.degrees).min().unwrap_or(0)
}

/// The error of the method, by the degrees of the leading parts; bounds are what was measured, rounded up.
#[test]
fn saddlepoint_is_as_near_to_the_exact_tails_as_its_documentation_says() {
    let bounds = [(1, 0.14), (2, 0.05), (6, 0.015), (19, 0.0045), (99, 9e-4), (u32::MAX, 1e-4)];
    for coupled in [false, true] {
        let mut groups = [Group::default(); 6];
        for case in golden() {
            if case.parts.iter().any(|part| part.coupling > 0.0) != coupled {
                continue;
            }
            let leading = leading(&case.parts);
            let at = bounds.iter().position(|(most, _)| leading <= *most).expect("a group");
            for [threshold, upper, density] in &case.tails {
                let found = tail::<f64>(&case.parts, *threshold);
                let error = (found.upper / upper - 1.0).abs();
                let group = &mut groups[at];
                group.upper = group.upper.max(error);
                if *upper > 1e-3 {
                    group.middle = group.middle.max(error);
                }
                group.density = group.density.max((found.density / density - 1.0).abs());
                group.count += 1;
                assert!(error.is_finite(), "{:?} {threshold} {found:?}", case.parts);
            }
        }
        for ((most, bound), group) in bounds.iter().zip(groups) {
            println!(
                "coupled {coupled}, leading degrees up to {most}: {} tails, worst {:.1e}, above 1e-3 {:.1e}, density {:.1e}",
                group.count, group.upper, group.middle, group.density
            );
            assert!(group.upper <= *bound);
        }
    }
}

/// Sixth-order central differences of the tail by threshold, weight and coupling.
#[test]
fn derivatives_are_those_of_the_tail() {
    let (mut worst, mut count, mut at) = (0.0_f64, 0, String::new());
    for case in golden() {
        for [threshold, ..] in &case.tails {
            let found = tail::<f64>(&case.parts, *threshold);
            let mut see = |ours: f64, scale: f64, figure: &dyn Fn(f64) -> f64| {
                let mut best = f64::INFINITY;
                for step in [2e-2, 5e-3, 1e-3] {
                    let h = step * scale;
                    let odd = |steps: f64| figure(steps * h) - figure(-steps * h);
                    let numeric = (45.0 * odd(1.0) - 9.0 * odd(2.0) + odd(3.0)) / (60.0 * h);
                    // Relative to the derivative, or to the smaller tail over the distance in which things change.
                    let size = ours.abs().max(1e-3 * found.density * threshold / scale);
                    best = best.min((ours - numeric).abs() / size);
                }
                count += 1;
                if best > worst || best.is_nan() {
                    (worst, at) = (best, format!("{:?} {threshold}: {ours}", case.parts));
                }
            };
            let deviation: f64 = case
                .parts
                .iter()
                .map(|p| 2.0 * f64::from(p.degrees) * (p.weight + p.coupling).powi(2))
                .sum::<f64>()
                .sqrt();
            see(-found.density, deviation.min(0.1 * threshold), &|move_by| {
                tail::<f64>(&case.parts, threshold + move_by).upper
            });
            for (index, part) in case.parts.iter().enumerate() {
                let by = found.by_part(part);
                let relative = (deviation / threshold).min(0.1);
                let moved = |weight: f64, coupling: f64| {
                    let mut parts = case.parts.clone();
                    parts[index].weight += weight;
                    parts[index].coupling += coupling;
                    tail::<f64>(&parts, *threshold).upper
                };
                see(by.weight, part.weight * relative, &|by| moved(by, 0.0));
                if part.coupling > 0.0 {
                    see(by.coupling, part.coupling * relative, &|by| moved(0.0, by));
                }
            }
        }
    }
    println!("{count} derivatives, worst relative difference {worst:.1e} at {at}");
    assert!(count > 10_000 && worst < 1e-6, "{worst:e} at {at}");
}

#[test]
fn equal_weights_give_the_chi_square_tail() {
    let mut worst = 0.0_f64;
    for degrees in [[1, 1, 1], [2, 5, 9], [40, 1, 300], [4096, 4096, 4096]] {
        let total: u32 = degrees.iter().sum();
        for weight in [1e-9, 0.3, 1e5] {
            let parts = degrees.map(|degrees| Part { degrees, weight, coupling: 0.0 });
            for deviations in [-3.0, -1e-9, 0.0, 1e-5, 1.0, 6.0] {
                let t = f64::from(total) + deviations * (2.0 * f64::from(total)).sqrt();
                if t <= 0.0 {
                    continue;
                }
                let (found, exact) = (tail::<f64>(&parts, t * weight), chi_square_tail(total, t));
                worst = worst.max((found.upper / exact.upper - 1.0).abs());
                worst = worst.max((found.density * weight / exact.density - 1.0).abs());
            }
        }
    }
    println!("equal weights: worst relative difference {worst:.1e}");
    assert!(worst < 1e-11, "{worst:e}");
}

/// Couplings alone, or a single part, are one chi-square variable; parts that weigh nothing are none.
#[test]
fn one_eigenvalue_gives_the_chi_square_tail_itself() {
    let exact = chi_square_tail(7, 9.0 / 1.5);
    let part = |weight, coupling| Part { degrees: 7, weight, coupling };
    for parts in [vec![part(1.5, 0.0)], vec![part(0.25, 1.25), part(0.0, 0.0)], vec![part(0.0, 1.0), part(0.0, 0.5)]]
    {
        let found = tail::<f64>(&parts, 9.0);
        assert_eq!((found.upper, found.density), (exact.upper, exact.density / 1.5));
        assert_eq!(found.by_part(&parts[0]).coupling, exact.density / 1.5 * 6.0);
    }
}

/// The order of parts, the unit, and a part cut in two do not matter.
#[test]
fn order_unit_and_division_do_not_matter() {
    for case in golden() {
        for [threshold, ..] in &case.tails {
            let plain = tail::<f64>(&case.parts, *threshold);
            let mut parts = case.parts.clone();
            parts.reverse();
            parts.iter_mut().for_each(|part| (part.weight, part.coupling) = (part.weight * 3e7, part.coupling * 3e7));
            let turned = tail::<f64>(&parts, threshold * 3e7);
            assert!((turned.upper / plain.upper - 1.0).abs() < 1e-10, "{parts:?} {threshold}");
            let coupled = parts.iter().any(|part| part.coupling > 0.0);
            if let (Some(part), false) = (parts.iter_mut().find(|part| part.degrees > 1), coupled) {
                part.degrees -= 1;
                let rest = Part { degrees: 1, ..*part };
                parts.push(rest);
                let cut = tail::<f64>(&parts, threshold * 3e7);
                assert!((cut.upper / plain.upper - 1.0).abs() < 1e-10, "{parts:?} {threshold}");
            }
        }
    }
}

#[test]
fn single_precision_follows_double() {
    let (mut worst, mut slope) = (0.0_f64, 0.0_f64);
    for case in golden() {
        for [threshold, ..] in &case.tails {
            let (single, double) = (tail::<f32>(&case.parts, *threshold), tail::<f64>(&case.parts, *threshold));
            worst = worst.max((f64::from(single.upper) / double.upper - 1.0).abs());
            slope = slope.max((f64::from(single.density) / double.density - 1.0).abs());
        }
    }
    println!("f32: worst relative difference to f64 {worst:.1e}, of the density {slope:.1e}");
    assert!(worst < 3e-4 && slope < 3e-4, "{worst:e} {slope:e}");
}

/// Every magnitude of threshold and of spread gives a probability and finite derivatives, in either precision.
#[test]
fn edges_are_finite_and_sensible() {
    fn all<T: Real>(exponents: std::ops::RangeInclusive<i32>) {
        for coupling in [0.0, 1e-30, 1e-6, 1.0, 1e8] {
            for (degrees, spread) in [(1, 1.0), (1, 1e-30), (3, 1e-6), (1000, 0.1), (40_960, 1e-3)] {
                let parts: Vec<Part<T>> = (0..5)
                    .map(|index| Part {
                        degrees,
                        weight: T::real(f64::powi(spread, index)),
                        coupling: T::real(coupling * f64::from(index)),
                    })
                    .collect();
                let mut before = T::one();
                for exponent in exponents.clone() {
                    let threshold = T::real(2.0_f64.powi(exponent));
                    let found = weighted_chi_square_tail(parts.iter().copied(), threshold);
                    let what = format!("{parts:?} {threshold} {found:?}");
                    assert!(found.upper >= T::zero() && found.upper <= T::one(), "{what}");
                    assert!(found.upper <= before * (T::one() + T::real(1e-3)), "not falling: {before} {what}");
                    assert!(found.density >= T::zero() && found.density.finite(), "{what}");
                    before = found.upper;
                    for part in &parts {
                        let by = found.by_part(part);
                        assert!(by.weight.finite() && by.coupling.finite(), "{by:?} {part:?} {what}");
                    }
                }
                assert!(before == T::zero());
            }
        }
        let parts = [Part { degrees: 2, weight: T::one(), coupling: T::zero() }; 2];
        let upper = |threshold: T| weighted_chi_square_tail(parts.iter().copied(), threshold).upper;
        assert_eq!((upper(T::zero()), upper(-T::INFINITY), upper(T::INFINITY)), (T::one(), T::one(), T::zero()));
        assert!(upper(T::zero() / T::zero()).is_not_a_number());
        assert_eq!(weighted_chi_square_tail(core::iter::empty::<Part<T>>(), T::one()).upper, T::zero());
    }
    all::<f64>(-300..=300);
    all::<f32>(-100..=100);
}
