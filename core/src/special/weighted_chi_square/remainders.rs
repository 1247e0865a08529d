//! Remainders of the logarithm: `ln(1+u) = u - u^2 f2 = u - u^2/2 + u^3 f3 = u - u^2/2 + u^3/3 - u^4 f4`.
//!
//! `f2`, `f3`, `f4` are 1/2, 1/3, 1/4 at u = 0, positive and regular: f2 = 1/2 - u f3, f3 = 1/3 - u f4.
//!
//! With `x = u/(2+u)` and `ln(1+u) = 2 artanh x = 2x + 2x^3/3 + 2x^5 Z`, `Z = 1/5 + x^2/7 + ..`,
//! `f4 = (1-x) (4 - 2x + 2x^2/3) / 16 - (1-x)^4 x Z / 8`: nothing cancels to leading order. Outside 1/2 <= 1+u <= 2 the
//! definitions themselves are used.
//!
//! Limits: u above -1.

use crate::math::Real;
use crate::special::table::ATANH;
use crate::special::uniform;

const ATANH_SINGLE: [f32; ATANH.len()] = uniform::narrowed(&ATANH);

/// See the [module](self).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Remainders<T> {
    pub f2: T,
    pub f3: T,
    pub f4: T,
}

impl<T: Real> Remainders<T> {
    #[inline]
    pub(super) fn of(u: T) -> Self {
        let (one, half, third) = (T::one(), T::real(0.5), T::real(1.0 / 3.0));
        let x = u / (u + T::real(2.0));
        let square = x * x;
        if square > T::real(1.0 / 9.0) {
            // Divided by u before the powers are, which may overflow.
            let f2 = (one - (one + u).ln() / u) / u;
            let f3 = (half - f2) / u;
            return Self { f2, f3, f4: (third - f3) / u };
        }
        let series = fifth_on(square);
        let rest = one - x;
        let head = rest * (T::real(0.25) - x * T::real(0.125) + square * T::real(1.0 / 24.0));
        let f4 = head - rest.squared().squared() * x * series * T::real(0.125);
        let f3 = third - u * f4;
        Self { f2: half - u * f3, f3, f4 }
    }
}

/// 1/5 + square/7 + ..
#[inline]
fn fifth_on<T: Real>(square: T) -> T {
    let terms = if T::EPSILON.to_f64() > 1e-10 { 8 } else { ATANH.len() };
    let mut sum = T::zero();
    for (&single, &double) in ATANH_SINGLE.iter().zip(&ATANH).take(terms).skip(1).rev() {
        sum = sum * square + T::spelled(single, double);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    /// u, f2, f3, f4: the definitions in mpmath with 60 digits, rounded once.
    const GOLDEN: [(f64, f64, f64, f64); 19] = [
        (-0.999, 5.920590539470537, 5.426016556026564, 5.0977810036969275),
        (-0.9, 1.7315865345605503, 1.368429482845056, 1.1501068327908028),
        (-0.6, 0.8785853663170974, 0.6309756105284956, 0.4960704619919372),
        (-0.5, 0.7725887222397813, 0.5451774444795625, 0.4236882222924583),
        (-0.49, 0.7636174646554169, 0.5379948258273815, 0.4176765152939757),
        (-0.1, 0.5360515657826301, 0.36051565782630124, 0.27182324492967896),
        (-0.001, 0.5003335835335001, 0.33358353350014297, 0.2502001668096489),
        (-1e-08, 0.5000000033333334, 0.33333333583333336, 0.250000002),
        (1e-12, 0.49999999999966666, 0.33333333333308335, 0.2499999999998),
        (1e-05, 0.4999966666916665, 0.3333308333533332, 0.24999800001666653),
        (0.01, 0.4966914683191715, 0.3308531680828482, 0.2480165250485118),
        (0.3, 0.4181748392500994, 0.2727505358330019, 0.20194265833443803),
        (0.99, 0.30799445083521987, 0.19394499915634358, 0.1407962971484745),
        (1.0, 0.3068528194400547, 0.19314718055994531, 0.14018615277338803),
        (1.01, 0.3057202999010054, 0.19235613871187585, 0.13958138081332425),
        (2.0, 0.22534692783297258, 0.13732653608351372, 0.09800339862490981),
        (10.0, 0.07602104727201629, 0.04239789527279837, 0.029093543806053498),
        (1000.0, 0.0009930912452206849, 0.0004990069087547793, 0.00033283432642457856),
        (1000000000.0, 9.999999792767341e-10, 4.99999999e-10, 3.3333333283333335e-10),
    ];

    #[test]
    fn remainders_match_their_definitions_in_sixty_digits() {
        let mut worst = 0.0_f64;
        for &(u, f2, f3, f4) in &GOLDEN {
            let found = Remainders::of(u);
            for (value, expected) in [(found.f2, f2), (found.f3, f3), (found.f4, f4)] {
                worst = worst.max((value / expected - 1.0).abs());
            }
        }
        assert!(worst < 3e-15, "{worst:e}");
    }
}
