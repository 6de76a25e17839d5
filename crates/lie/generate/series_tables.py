"""Writes src/series/tables.rs: polynomial coefficients of the functions of src/series.rs (needs mpmath).

Each function f is replaced by f(0) + x p(x), p the Chebyshev interpolant of (f(x) - f(0)) / x on [0, end]; 60 digits,
rounded once. The value at 0 is therefore exact. Run: python3 series_tables.py > ../src/series/tables.rs
"""

from mpmath import acos, bernoulli, cos, factorial, lu_solve, matrix, mp, mpf, pi, sqrt

mp.dps = 60
END = {"s": mpf(10), "u": mpf(1)}


def taylor(first, scale=1):
    """sum (-1)^k (s/scale)^k / (2k + first)!"""
    return lambda s: sum((-1) ** k * (s / scale) ** k / factorial(2 * k + first) for k in range(45))


def taylor_rate(first, scale=1):
    return lambda s: sum(
        k * (-1) ** k * (s / scale) ** (k - 1) / factorial(2 * k + first) / scale for k in range(1, 46)
    )


COTANGENT = [abs(bernoulli(2 * k + 2)) / factorial(2 * k + 2) for k in range(160)]


def cotangent(s):
    return sum(c * s**k for k, c in enumerate(COTANGENT))


def cotangent_rate(s):
    return sum(k * c * s ** (k - 1) for k, c in enumerate(COTANGENT) if k > 0)


def half_angle_per_sine(u):
    return mpf(1) if u == 0 else acos(1 - u) / sqrt(1 - (1 - u) ** 2)


def cotangent_of_cosine(u):
    return mpf(1) / 12 if u == 0 else (1 - (1 - u) * half_angle_per_sine(u)) / (2 * acos(1 - u)) ** 2


def polynomial(f, terms, end):
    start, n = f(mpf(0)), terms - 1
    nodes = [end / 2 * (1 + cos(pi * (2 * i + 1) / (2 * n))) for i in range(n)]
    powers = matrix(n, n)
    values = matrix(n, 1)
    for i, x in enumerate(nodes):
        values[i] = (f(x) - start) / x
        for j in range(n):
            powers[i, j] = x**j
    return [start, *lu_solve(powers, values)]


def table(name, doc, terms, variable, functions):
    columns = [polynomial(f, terms, END[variable]) for f in functions]
    print(f"\n/// {doc}")
    print(f"pub(super) const {name}: [[f64; {len(functions)}]; {terms}] = [")
    for row in zip(*columns):
        print("    [" + ", ".join(repr(float(c)) for c in row) + "],")
    print("];")


print("//! Coefficients, lowest power first, one column per function. Written by `generate/series_tables.py`.")
print("#![allow(clippy::excessive_precision, clippy::unreadable_literal)]")
table(
    "HALF_ANGLE",
    "`sin(t/2) / (t/2)`, `cos(t/2)` and the derivative of the first in `s = t^2`.",
    11,
    "s",
    [taylor(1, 4), taylor(0, 4), taylor_rate(1, 4)],
)
table(
    "JACOBIAN",
    "`(1 - cos t) / t^2`, `(t - sin t) / t^3`, then their derivatives in `s`.",
    11,
    "s",
    [taylor(2), taylor(3), taylor_rate(2), taylor_rate(3)],
)
table(
    "INVERSE_JACOBIAN",
    "`(1 - (t/2) cot(t/2)) / t^2` and its derivative in `s`.",
    16,
    "s",
    [cotangent, cotangent_rate],
)
table(
    "LOGARITHM",
    "`h / sin h` and `(1 - h cot h) / (2h)^2` in `u = 1 - cos h`.",
    22,
    "u",
    [half_angle_per_sine, cotangent_of_cosine],
)
