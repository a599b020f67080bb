"""Reference values for core/tests/convergence_roots.rs, with 60 digits.

Draws anchors for n = 2 .. 8, finds all roots of the polynomial (R) of
core/src/convergence/repeated_root.rs with mpmath, and writes values.csv beside this file. Run it
again only when a case is added:

    python -m pip install mpmath==1.3.0
    python core/tests/roots/generate.py

Every number that goes in is a double, written exactly; every number that comes out has 25 digits.
Rows of values.csv:

    <family>,<T>,<e_0> ... <e_{n-1}>,<real roots a in 1/s, rising>

separated by commas, the lists by blanks. Families: `unit` (y_j uniform in [-1, 1]), `wild`
(e_j of size 1e-6 .. 1e9, T of 1e-3 .. 1e4, both log-uniform), `rest` (from rest), `near` (odd n, T within
a few parts in 1e3 of the shortest deadline that has a root, e_0 < 0, so two roots nearly meet).
"""

import pathlib
import random

import mpmath as mp

mp.mp.dps = 60


def scaled(e, T):
    return [mp.mpf(ej) * mp.mpf(T) ** j / mp.factorial(j) for j, ej in enumerate(e)]


def real_roots(coefficients):
    """Real roots of sum c_i s^i, c_0 first, rising."""
    c = list(coefficients)
    while c and c[-1] == 0:
        c.pop()
    if len(c) < 2:
        return []
    if len(c) == 2:
        return [-c[0] / c[1]]
    # Roots of very different size: more digits than their ratio needs.
    with mp.workdps(200):
        roots = mp.polyroots(c[::-1], maxsteps=5000, extraprec=2000)
    return sorted(mp.re(r) for r in roots if abs(mp.im(r)) <= mp.mpf(10) ** -40 * abs(r))


def rates(e, T):
    n, y = len(e), scaled(e, T)
    c = [sum(y[: n - i]) / mp.factorial(i) for i in range(n)]
    return [s / mp.mpf(T) for s in real_roots(c)]


def shortest_deadline(e):
    """T_min for odd n and e_0 < 0, found from (R) alone by bisection: the existence of a root is monotone."""
    low, high = mp.mpf("1e-3"), mp.mpf("1e3")
    if not rates(e, high) or rates(e, low):
        return None
    for _ in range(40):
        middle = mp.sqrt(low * high)
        if rates(e, middle):
            high = middle
        else:
            low = middle
    return high


def main():
    random.seed(20250713)
    sign = lambda: random.choice([-1.0, 1.0])
    rows = []
    for n in range(2, 9):
        for _ in range(12):
            rows.append(("unit", 1.0, [random.uniform(-1, 1) for _ in range(n)]))
        for _ in range(16):
            T = 10 ** random.uniform(-3, 4)
            rows.append(("wild", T, [sign() * 10 ** random.uniform(-6, 9) for _ in range(n)]))
        rows.append(("rest", 5.0, [-3.0] + [0.0] * (n - 1)))
    for n in (3, 5, 7):
        found = 0
        while found < 4:
            e = [-random.uniform(0.1, 1)] + [random.uniform(-1, 1) for _ in range(n - 1)]
            T = shortest_deadline(e)
            if T is not None:
                found += 1
                for factor in (0.9, 0.999, 1.001, 1.1):
                    rows.append(("near", float(T) * factor, e))
    lines = []
    for family, T, e in rows:
        roots = " ".join(mp.nstr(a, 25) for a in rates(e, T))
        lines.append(f"{family},{T!r},{' '.join(map(repr, e))},{roots}\n")
    (pathlib.Path(__file__).parent / "values.csv").write_text("".join(lines))


main()
