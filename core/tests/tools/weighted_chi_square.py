#!/usr/bin/env python3
"""Writes the golden tails of `core/tests/data/weighted_chi_square.txt`.

    python3 -m venv /tmp/venv && /tmp/venv/bin/pip install numpy mpmath
    /tmp/venv/bin/python core/tests/tools/weighted_chi_square.py > core/tests/data/weighted_chi_square.txt
    /tmp/venv/bin/python core/tests/tools/weighted_chi_square.py pooled > core/tests/data/pooled.txt

The tail of T = sum lambda_i chi^2(N_i) is the Bromwich integral of exp(k(s) - s y) / s over a contour that crosses the
real axis at c, left of the first singularity of k, and bends to the right around the poles: s = c + i g t + b t^2. The integrand
then falls like a Gaussian and the trapezoidal rule converges faster than any power. There is no asymptotics in it. Every figure
is computed with two contours that must agree, and where all degrees are 2 with the closed form (partial fractions, 50 digits).
Eigenvalues of coupled parts are those of the whole matrix diag(a) + sqrt(c) sqrt(c)^T.

With `pooled`: probabilities of detection and of a false alarm of pooled sensors, from their signal-to-noise ratios. The
quadratic form of the likelihood-ratio test is formed as the difference of two inverse covariances, its threshold from their
determinants, and the eigenvalues are those of the form times the covariance that holds: nothing is simplified by hand.
"""

import sys

import mpmath as mp
import numpy as np

# Signed roots r at which thresholds are placed: upper tails of about 0.999 down to 1e-12.
ROOTS = [-3.0, -1.3, -0.3, 0.0, 1e-4, 0.5, 1.3, 2.33, 3.1, 4.75, 7.03]


def exponent(degrees, weights, s):
    return -0.5 * sum(n * np.log(1 - 2 * s * w) for n, w in zip(degrees, weights))


def signed_root(degrees, weights, s):
    u = 2 * s * weights / (1 - 2 * s * weights)
    return np.copysign(np.sqrt(np.sum(degrees * (u - np.log1p(u)))), s)


def saddlepoint_of_root(degrees, weights, root):
    pole = 1 / (2 * weights.max())
    low, high = -1.0, pole
    while signed_root(degrees, weights, low) > root:
        low *= 2
    for _ in range(200):
        middle = (low + high) / 2
        if signed_root(degrees, weights, middle) < root:
            low = middle
        else:
            high = middle
    return (low + high) / 2


def contour(degrees, weights, y, c, bend):
    tilted = weights / (1 - 2 * c * weights)
    g = 1 / np.sqrt(2 * np.sum(degrees * tilted**2))
    b = bend * g
    reach = 8 / np.sqrt(b * y)
    h = 0.02
    t = np.arange(-reach, reach + h, h) + 0.3 * h
    s = c + 1j * g * t + b * t * t
    start = exponent(degrees, weights, c) - c * y
    f = np.exp(exponent(degrees, weights, s) - s * y - start) * (1j * g + 2 * b * t)
    scale = np.exp(start) * h / (2j * np.pi)
    # Left of the pole at 0 the integral is that of the other tail, with a minus sign.
    return (1.0 if c < 0 else 0.0) + float((np.sum(f / s) * scale).real), float((np.sum(f) * scale).real)


def tail(degrees, weights, y, s):
    pole = 1 / (2 * weights.max())
    width = 1 / np.sqrt(2 * np.sum(degrees * weights**2))
    c = s if abs(s) > 0.5 * width else min(0.25 * pole, 0.5 * width)
    one = contour(degrees, weights, y, c, 0.01)
    two = contour(degrees, weights, y, 0.8 * c, 0.017)
    error = max(abs(a / b - 1) for a, b in zip(one, two))
    assert error < 1e-9, (degrees, weights, y, s, one, two)
    return one, error


def partial_fractions(weights, y):
    with mp.workdps(50):
        weights = [mp.mpf(w) for w in weights]
        total = mp.mpf(0)
        for i, w in enumerate(weights):
            total += mp.exp(-mp.mpf(y) / (2 * w)) * mp.fprod(w / (w - v) for j, v in enumerate(weights) if j != i)
        return float(total)


def cases():
    """Degrees, weights, couplings."""
    for total in [2, 4, 8, 20, 100, 400]:
        for count in [2, 3, 8]:
            for spread in [1, 3, 10, 100]:
                weights = np.geomspace(1, 1 / spread, count)
                kinds = ["even"] if count == 3 else ["even", "low", "high"]
                for kind in kinds:
                    if total < count or (kind != "even" and total <= count):
                        continue
                    degrees = np.full(count, total // count)
                    if kind != "even":
                        degrees = np.ones(count, int)
                        degrees[-1 if kind == "low" else 0] = total - count + 1
                    yield degrees, weights, np.zeros(count)
    for count in [2, 4, 8]:
        for each in [1, 2, 12, 50]:
            for spread in [1, 10, 100]:
                ratios = np.geomspace(1, 1 / spread, count)
                for correlation in [0.1, 0.6, 0.95]:
                    yield np.full(count, each), (1 - correlation) * ratios, correlation * ratios


def pooled_cases():
    """Samples, signal-to-noise ratios, correlation, ln gamma."""
    for ratios in [[0.5, 0.2], [1.0, 0.3, 0.1, 0.01], [5.0, 5.0, 0.2], [0.02] * 3 + [0.05] * 3]:
        for log_threshold in [-0.5, 0.0, 2.0, 8.0]:
            for samples in [[20, 50, 100], [200, 300, 40]]:
                yield [samples[i % 3] for i in range(len(ratios))], ratios, 0.0, log_threshold
            for correlation in [0.2, 0.8, 1.0]:
                for samples in [20, 100]:
                    yield [samples] * len(ratios), ratios, correlation, log_threshold


def tail_anywhere(degrees, weights, y):
    low, high = -1.0, 1 / (2 * weights.max())
    slope = lambda s: np.sum(degrees * weights / (1 - 2 * s * weights))
    while slope(low) > y:
        low *= 2
    for _ in range(200):
        middle = (low + high) / 2
        if slope(middle) < y:
            low = middle
        else:
            high = middle
    return tail(degrees, weights, y, (low + high) / 2)[0][0]


def pooled_main():
    print("# samples:ratio ..; correlation ln_gamma detection false_alarm;"
          " written by core/tests/tools/weighted_chi_square.py pooled")
    for samples, ratios, correlation, log_threshold in pooled_cases():
        samples, ratios = np.array(samples), np.array(ratios)
        root = np.sqrt(ratios)
        cross = np.full((len(ratios), len(ratios)), correlation)
        np.fill_diagonal(cross, 1.0)
        silent = np.eye(len(ratios))
        heard = silent + cross * np.outer(root, root)
        form = np.linalg.inv(silent) - np.linalg.inv(heard)
        if correlation == 0.0:
            threshold = 2 * log_threshold + np.sum(samples * np.log(np.diag(heard)))
        else:
            threshold = 2 * log_threshold + samples[0] * np.linalg.slogdet(heard)[1]
        found = []
        for covariance in [heard, silent]:
            if correlation == 0.0:
                eigenvalues, degrees = np.diag(form) * np.diag(covariance), samples
            else:
                factor = np.linalg.cholesky(covariance)
                eigenvalues = np.linalg.eigvalsh(factor.T @ form @ factor)
                eigenvalues = eigenvalues[eigenvalues > 1e-12 * eigenvalues.max()]
                degrees = np.full(len(eigenvalues), samples[0])
            found.append(tail_anywhere(degrees, eigenvalues, threshold) if threshold > 0 else 1.0)
        sensors = " ".join(f"{n}:{x}" for n, x in zip(samples, ratios))
        print(f"{sensors} ; {correlation} {log_threshold} {found[0]:.12g} {found[1]:.12g}")


def main():
    if sys.argv[1:] == ["pooled"]:
        return pooled_main()
    print("# parts degrees:weight:coupling ..; then its tails: threshold upper density;"
          " written by core/tests/tools/weighted_chi_square.py")
    worst, closed, rows, checked = 0.0, 0.0, 0, 0
    for degrees, weights, couplings in cases():
        weights = np.array([float(f"{w:.5g}") for w in weights])
        couplings = np.array([float(f"{c:.5g}") for c in couplings])
        print("parts", *[f"{n}:{w:.5g}:{c:.5g}" for n, w, c in zip(degrees, weights, couplings)])
        form = np.diag(weights) + np.sqrt(np.outer(couplings, couplings))
        eigenvalues = np.linalg.eigvalsh(form)[::-1] if couplings.any() else weights
        for root in ROOTS:
            s = saddlepoint_of_root(degrees, eigenvalues, root)
            y = float(f"{np.sum(degrees * eigenvalues / (1 - 2 * s * eigenvalues)):.9g}")
            (upper, density), error = tail(degrees, eigenvalues, y, s)
            worst = max(worst, error)
            gaps = np.min(-np.diff(np.sort(eigenvalues)[::-1])) / eigenvalues.max()
            if np.all(degrees == 2) and gaps > 1e-3 and not couplings.any():
                closed = max(closed, abs(upper / partial_fractions(eigenvalues, y) - 1))
                checked += 1
            print(f"{y:.9g} {upper:.12g} {density:.12g}")
            rows += 1
    print(f"{rows} tails; two contours agree within {worst:.1e}, {checked} closed forms within {closed:.1e}", file=sys.stderr)
    assert checked > 30 and closed < 1e-10


if __name__ == "__main__":
    main()
