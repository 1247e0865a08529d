#!/usr/bin/env python3
"""Derives the constants of `core/src/special/table.rs`.

    python3 -m venv /tmp/venv && /tmp/venv/bin/pip install mpmath
    /tmp/venv/bin/python core/tools/special_tables.py > core/src/special/table.rs
    /tmp/venv/bin/python core/tools/special_tables.py --check     # truncation error, term count by term count

Bulk series. With a = N/2, x = t/2, lambda = x/a, mu = lambda - 1 and eta^2/2 = mu - ln(1 + mu), eta of the sign of mu,

    Q(a, x) = erfc(eta sqrt(a/2)) / 2 + w B(eta),     w = exp(-a eta^2/2) / (sqrt(2 pi a) Gamma*(a)),

where Gamma*(a) = Gamma(a) / (sqrt(2 pi / a) (a/e)^a). Differentiate with respect to eta, insert
dQ/dx = -x^(a-1) e^-x / Gamma(a), and B = sum b_n eta^n has to satisfy

    eta B = B'/a + g(eta) - Gamma*(a),   g(eta) = eta / mu = sum g_n eta^n,

that is b_(n-1) = g_n + (n+1)/a b_(n+1) for n >= 1. Read downward from b = 0 above the last g_n kept, this sums
Temme's expansion sum C_k(eta) a^-k over all k at once, so one row of g_n replaces the triangle of coefficients.
g_n is exact here: mu(eta) = sum m_k eta^k follows from eta (1 + mu) = mu mu', and g = eta / mu.

Stirling series. ln Gamma*(a) = sum B_2k / (2k (2k-1) a^(2k-1)); below N = 40 its values are tabulated.
"""

import sys
from fractions import Fraction
from math import comb

BULK_TERMS = 28
STIRLING_TERMS = 6
TABULATED_BELOW = 40
ATANH_TERMS = 16


def bulk_coefficients(count):
    """g_1 .. g_count as exact fractions."""
    # m[1] = 1; the coefficient of eta^n in mu mu' = eta (1 + mu) gives m[n].
    m = [Fraction(0), Fraction(1)]
    for n in range(2, count + 2):
        inner = sum(m[i] * m[n + 1 - i] * (n + 1 - i) for i in range(2, n))
        # terms i = 1 and i = n: m_n n + m_n = (n + 1) m_n
        m.append((m[n - 1] - inner) / (n + 1))
    # g mu / eta = 1
    g = [Fraction(1)]
    for n in range(1, count + 1):
        g.append(-sum(g[i] * m[n - i + 1] for i in range(n)))
    return g[1:]


def stirling_coefficients(count):
    """B_2k / (2k (2k-1)) for k = 1 .. count."""
    bernoulli = [Fraction(1)]
    for n in range(1, 2 * count + 1):
        bernoulli.append(-sum(comb(n + 1, k) * bernoulli[k] for k in range(n)) / (n + 1))
    return [bernoulli[2 * k] / (2 * k * (2 * k - 1)) for k in range(1, count + 1)]


def ln_gamma_star(mp, a):
    a = mp.mpf(a)
    return mp.loggamma(a) - mp.log(2 * mp.pi / a) / 2 - a * mp.log(a) + a


def literal(value):
    text = repr(float(value)).replace("e-0", "e-")
    return text


def table(name, doc, values):
    values = [literal(v) for v in values]
    lines = [f"/// {line}" if line else "///" for line in doc]
    lines += [f"pub(super) const {name}: [f64; {len(values)}] = ["]
    lines += [f"    {v}," for v in values]
    lines += ["];"]
    return "\n".join(lines)


def main():
    import mpmath as mp

    mp.mp.dps = 50
    tables = [
        table(
            "BULK",
            ["`g_1, g_2, ..`: `eta / (lambda - 1)` in powers of `eta`; `g_0 = 1`."],
            bulk_coefficients(BULK_TERMS),
        ),
        table(
            "STIRLING",
            ["`B_2k / (2k (2k - 1))`, k = 1, 2, ..: `ln Gamma*(a)` in odd powers of `1/a`."],
            stirling_coefficients(STIRLING_TERMS),
        ),
        table(
            "LN_GAMMA_STAR",
            ["`ln Gamma*(N/2)` for N = 1, 2, .., 39."],
            [ln_gamma_star(mp, mp.mpf(n) / 2) for n in range(1, TABULATED_BELOW)],
        ),
        table(
            "ATANH",
            ["`1 / (2k + 3)`, k = 0, 1, ..: `(artanh(v) - v) / v^3` in powers of `v^2`."],
            [Fraction(1, 2 * k + 3) for k in range(ATANH_TERMS)],
        ),
    ]
    head = [
        "//! Constants of the chi-square tail, derived and written by `core/tools/special_tables.py`: exact fractions and",
        "//! 50-digit logarithms, each rounded once. Not edited by hand.",
        "",
    ]
    print("\n".join(head) + "\n" + "\n\n".join(tables))


def check():
    """Largest error of w B(eta) against the smaller tail, in eta bands, for a few a and term counts."""
    import mpmath as mp

    mp.mp.dps = 60
    g = [mp.mpf(f.numerator) / f.denominator for f in bulk_coefficients(70)]

    def bulk(a, eta, terms):
        here = above = total = mp.mpf(0)
        for n in range(terms, 0, -1):
            new = g[n - 1] + (n + 1) / a * above
            total = total * eta + new
            here, above = new, here
        return total

    print("relative error of the smaller tail: a, eta, then (terms: error)")
    for a in (20, 32, 64, 128, 256, 500, 1000, 5000, 20480):
        a = mp.mpf(a)
        for eta in (0.0, 0.125, 0.25, 0.5, 0.75, 1.0):
            row = []
            for terms in (6, 8, 10, 12, 14, 16, 18, 20, 22, 24, 26, 28, 30, 32, 34, 36):
                worst = 0
                for sign in (1, -1):
                    e = sign * mp.mpf(eta)
                    z = abs(e) * mp.sqrt(a / 2)
                    scale = mp.sqrt(2 * mp.pi * a) * mp.exp(z * z)
                    error = bulk(a, e, terms) - bulk(a, e, 70)
                    tail = mp.erfc(z) / 2 * scale + sign * bulk(a, e, 70)
                    worst = max(worst, abs(error / tail))
                row.append(f"{terms}:{mp.nstr(worst, 2)}")
            print(mp.nstr(a, 6), eta, " ".join(row))


if __name__ == "__main__":
    check() if "--check" in sys.argv else main()
