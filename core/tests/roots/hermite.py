"""Exact rational values of the two-point Hermite profile for core/tests/convergence_lemma.rs.

The polynomial of degree 2n - 1 is found from its 2n conditions by exact Gaussian elimination, not
from the closed form of core/src/convergence/hermite.rs, and evaluated with its derivatives:

    python core/tests/roots/hermite.py

Rows of hermite.csv: <T>,<tau>,<e_0> ... <e_{n-1}>,<r_0> ... <r_n>,<size_0> ... <size_n>; inputs are exact
in binary, outputs are rounded to doubles; size_k is the sum of the magnitudes of the terms
of r_k in the factored form, to which its round-off is proportional.
"""

import math
import pathlib
import random
from fractions import Fraction as F


def falling(i, k):
    value = 1
    for m in range(k):
        value *= i - m
    return value


def solve(a, b):
    n = len(b)
    rows = [row[:] + [value] for row, value in zip(a, b)]
    for c in range(n):
        pivot = next(r for r in range(c, n) if rows[r][c] != 0)
        rows[c], rows[pivot] = rows[pivot], rows[c]
        rows[c] = [v / rows[c][c] for v in rows[c]]
        for r in range(n):
            if r != c and rows[r][c] != 0:
                rows[r] = [v - rows[r][c] * w for v, w in zip(rows[r], rows[c])]
    return [row[n] for row in rows]


def sizes(e, T, s):
    n = len(e)
    y = [abs(e[j]) * T**j / math.factorial(j) for j in range(n)]
    q = [sum(y[j] * math.comb(n - 1 + k - j, k - j) for j in range(k + 1)) for k in range(n)]
    derivative = lambda m: sum(q[i] * falling(i, m) * s ** (i - m) for i in range(m, n))
    return [
        sum(math.comb(k, i) * falling(n, i) * (1 - s) ** (n - i) * derivative(k - i) for i in range(k + 1)) / T**k
        for k in range(n + 1)
    ]


def main():
    random.seed(7)
    lines = []
    for n in range(1, 9):
        for T in (F(1, 8), F(5), F(1024)):
            e = [F(random.randint(-64, 64), 8) for _ in range(n)]
            conditions = [[F(falling(i, k) * (0 if i != k else 1)) for i in range(2 * n)] for k in range(n)]
            conditions += [[F(falling(i, k)) for i in range(2 * n)] for k in range(n)]
            p = solve(conditions, [e[k] * T**k for k in range(n)] + [F(0)] * n)
            for s in (F(0), F(3, 16), F(1, 2), F(31, 32)):
                terms = [[p[i] * falling(i, k) * s ** (i - k) / T**k for i in range(k, 2 * n)] for k in range(n + 1)]
                r = " ".join(repr(float(sum(row))) for row in terms)
                size = " ".join(repr(float(v)) for v in sizes(e, T, s))
                lines.append(f"{float(T)!r},{float(s * T)!r},{' '.join(repr(float(v)) for v in e)},{r},{size}\n")
    (pathlib.Path(__file__).parent / "hermite.csv").write_text("".join(lines))


main()
