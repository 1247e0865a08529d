#!/usr/bin/env python3
"""Writes the golden chi-square tails of `core/tests/data/chi_square_tail.csv`.

    python3 -m venv /tmp/venv && /tmp/venv/bin/pip install mpmath
    /tmp/venv/bin/python core/tests/tools/chi_square_tail.py > core/tests/data/chi_square_tail.csv

60 digits throughout. The upper tail is (23) summed as written, in full: e^-x sum x^k/k! for even N, erfc(sqrt x) and the
half-integer powers for odd N. The lower tail is its power series. Where the two add up to 1 they check each other,
and at small N mpmath's own gammainc checks both. Every t is a number of single precision, so one table serves both.
"""

import struct
import sys

import mpmath as mp

DEGREES = [1, 2, 3, 4, 5, 7, 10, 21, 38, 39, 40, 41, 63, 64, 99, 100, 101, 257, 500, 999, 1000, 1001, 2000, 4096,
           10001, 20480, 40959, 40960]
# Powers of ten of the smaller tail: lower tail, then upper tail.
LOWER = [300, 150, 60, 30, 20, 15, 10, 6, 3, 1, 0.5]
UPPER = [0.31, 0.5, 1, 2, 3, 4, 6, 8, 10, 13, 16, 19, 25, 40, 60, 100, 150, 200, 250, 299]
RATIOS = [0.2, 0.301, 0.303, 0.5, 0.99, 1.0, 1.01, 2.0, 2.357, 2.359]

mp.mp.dps = 60


def single(value):
    return struct.unpack("f", struct.pack("f", float(value)))[0]


def weight(a, x):
    return mp.exp(a * mp.log(x) - x - mp.loggamma(a + 1))


def upper_tail(n, x):
    if n % 2 == 0:
        total = term = mp.mpf(1)
        for k in range(1, n // 2):
            term *= x / k
            total += term
        return mp.exp(-x) * total
    total = mp.mpf(0)
    term = 2 * mp.sqrt(x / mp.pi)
    for k in range((n - 1) // 2):
        total += term
        term *= x / (k + mp.mpf(3) / 2)
    return mp.erfc(mp.sqrt(x)) + mp.exp(-x) * total


def lower_tail(n, x):
    a = mp.mpf(n) / 2
    total = term = mp.mpf(1)
    k = 0
    while term > total * mp.mpf(10) ** -62:
        k += 1
        term *= x / (a + k)
        total += term
    return weight(a, x) * total


def rough_point(n, power, side):
    """t where the tail of that side is about 10^-power, by Wilson and Hilferty's or the leading term of the series."""
    target = -power * mp.log(10)

    def ln_tail(t):
        a, x = mp.mpf(n) / 2, mp.mpf(t) / 2
        with mp.workdps(20):
            if side == "lower" or x < a:
                total = term = mp.mpf(1)
                k = 0
                while term > total * mp.mpf(10) ** -12:
                    k += 1
                    term *= x / (a + k)
                    total += term
                ln_lower = mp.log(weight(a, x) * total)
                return ln_lower if side == "lower" else mp.log1p(-mp.exp(ln_lower))
            # Legendre's continued fraction
            tiny = mp.mpf(10) ** -300
            b = x + 1 - a
            c, d = 1 / tiny, 1 / b
            h = d
            for i in range(1, 4000):
                an = -i * (i - a)
                b += 2
                d = 1 / (an * d + b)
                c = b + an / c
                h *= d * c
                if abs(d * c - 1) < mp.mpf(10) ** -12:
                    break
            return mp.log(weight(a, x) * a * h)

    low, high = mp.mpf(10) ** -12, mp.mpf(n) + 60 * mp.sqrt(2 * n) + 2000
    if side == "lower":
        low = mp.exp(-2 * power * mp.log(10) / n) * n * mp.mpf("0.01")
    for _ in range(40):
        middle = mp.sqrt(low * high)
        if (ln_tail(middle) < target) == (side == "lower"):
            low = middle
        else:
            high = middle
    return middle


def main():
    print("# degrees,t,upper,density,ln_upper,ln_lower; written by core/tests/tools/chi_square_tail.py")
    worst = mp.mpf(0)
    for n in DEGREES:
        a = mp.mpf(n) / 2
        points = {single(rough_point(n, p, "lower")) for p in LOWER} | {single(rough_point(n, p, "upper")) for p in UPPER}
        points |= {single(r * n) for r in RATIOS}
        for t in sorted(points):
            if t < 1e-30:
                continue
            x = mp.mpf(t) / 2
            upper, lower = upper_tail(n, x), lower_tail(n, x)
            worst = max(worst, abs(upper + lower - 1))
            if n <= 10 and 0.1 < t < 50:
                worst = max(worst, abs(mp.gammainc(a, x, regularized=True) / upper - 1))
            if upper < mp.mpf(10) ** -1000 or lower < mp.mpf(10) ** -1000:
                continue
            ln_upper = mp.log(upper) if upper < 0.5 else mp.log1p(-lower)
            ln_lower = mp.log(lower) if lower < 0.5 else mp.log1p(-upper)
            density = weight(a, x) * a / (2 * x)
            row = [mp.nstr(v, 17, min_fixed=-2, max_fixed=5) for v in (upper, density, ln_upper, ln_lower)]
            print(f"{n},{t!r}," + ",".join(row))
    print(f"tails add up to 1, and match gammainc, within {mp.nstr(worst, 2)}", file=sys.stderr)
    assert worst < mp.mpf(10) ** -50


if __name__ == "__main__":
    main()
