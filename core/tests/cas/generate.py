"""Reference values for core/tests/lie.rs, from a computer-algebra system.

Differentiates every barrier along its plant symbolically, evaluates the result with 60 digits and
writes 40 of them to values.csv beside this file. Run it again only when a case is added:

    python -m pip install sympy==1.14.0
    python core/tests/cas/generate.py

Rows of values.csv:

    state,<case>,<sample>,t,x_1,x_2,...           where the derivatives are taken (exact in binary)
    drift,<case>,<sample>,<k>,<value>,<size>      (d/dt + L_f)^k h, k = 0 .. n
    input,<case>,<sample>,<i>,<value>,<size>      the derivative of h^(n) along input i, i = 0 .. m-1

`size` is the value of the same formula with every term taken positive: round-off of a floating-point
evaluation is proportional to it, not to `value`, where terms cancel.
"""

import pathlib

import mpmath
import sympy as sp
from sympy import Rational as Q

mpmath.mp.dps = 60
DIGITS = 40

t = sp.Symbol("t", real=True)


def states(n):
    return sp.symbols(f"x1:{n + 1}", real=True)


def lie_derivatives(f, g, h, x, n):
    """[h, ..., (d/dt + L_f)^n h] and the row of L_g (d/dt + L_f)^(n-1) h."""
    chain = [h]
    for _ in range(n):
        last = chain[-1]
        step = sp.diff(last, t) + sum(sp.diff(last, xi) * fi for xi, fi in zip(x, f))
        chain.append(sp.expand(step, deep=False) if n > 4 else step)
    row = [sum(sp.diff(chain[n - 1], xi) * gi for xi, gi in zip(x, column)) for column in zip(*g)]
    for k in range(n - 1):
        lower = [sum(sp.diff(chain[k], xi) * gi for xi, gi in zip(x, column)) for column in zip(*g)]
        assert all(sp.simplify(entry) == 0 for entry in lower), f"an input enters derivative {k + 1}"
    return chain, row


def evaluate(expression, point):
    """Value and size of `expression`, both to working precision."""
    if expression.is_Number or expression.is_NumberSymbol:
        value = mpmath.mpf(expression.p) / expression.q if expression.is_Rational else mpmath.mpf(str(expression.evalf(60)))
        return value, abs(value)
    if expression.is_Symbol:
        value = point[expression]
        return value, abs(value)
    parts = [evaluate(a, point) for a in expression.args]
    if expression.is_Add:
        return mpmath.fsum(v for v, _ in parts), mpmath.fsum(s for _, s in parts)
    if expression.is_Mul:
        return mpmath.fprod(v for v, _ in parts), mpmath.fprod(s for _, s in parts)
    if expression.is_Pow:
        (base, size), (power, _) = parts
        value = base**power
        growth = size / abs(base) if base != 0 else mpmath.mpf(1)
        return value, abs(value) * growth ** abs(power)
    (argument, size), = parts
    function = getattr(mpmath, {"log": "log", "Abs": "fabs"}.get(expression.func.__name__, expression.func.__name__))
    value = function(argument)
    slope = mpmath.diff(function, argument)
    return value, abs(value) + abs(slope) * size


def quadratic_disc(x, centre, radius):
    return radius**2 - (x[0] - centre[0]) ** 2 - (x[1] - centre[1]) ** 2


def distance_disc(x, centre, radius, smoothing):
    d2 = (x[0] - centre[0]) ** 2 + (x[1] - centre[1]) ** 2
    return sp.sqrt(radius**2 + smoothing**2) - sp.sqrt(d2 + smoothing**2)


def cases():
    """(name, f, g, h, x, n, samples); a sample is (t, x_1, ...), numbers that binary holds exactly."""
    x = states(4)
    v, theta = x[3], x[2]
    unicycle = [v * sp.cos(theta), v * sp.sin(theta), 0, 0]
    plants = {
        "point_mass": ([x[2], x[3], 0, 0], [[0, 0], [0, 0], [1, 0], [0, 1]]),
        "unicycle": (unicycle, [[0, 0], [0, 0], [0, 1], [1, 0]]),
        "bicycle": (unicycle, [[0, 0], [0, 0], [0, v / 10], [1, 0]]),
    }
    barriers = {
        "quadratic": quadratic_disc(x, (45, 45), 2),
        "distance": distance_disc(x, (Q(81, 2), Q(-13, 4)), Q(5, 2), Q(3, 4)),
    }
    plane = [
        (0, 0, 0, 0, 0),
        (0, Q(43, 16), Q(271, 16), Q(169, 32), Q(-157, 32)),
        (1, Q(719, 16), Q(45), Q(-7, 8), Q(1, 64)),
        (2, Q(163, 4), Q(-29, 8), Q(25, 8), Q(61, 4)),
        (3, -4096, 8192, Q(-75, 8), 300),
    ]
    for plant, (f, g) in plants.items():
        for barrier, h in barriers.items():
            yield f"{plant}/{barrier}", f, g, h, x, 2, plane

    # A disc that moves and breathes: d/dt of h itself.
    centre = (8 + 3 * sp.sin(t / 2), t**2 / 4 - 1)
    moving = 2 + sp.cos(t) / 4 - sp.sqrt((x[0] - centre[0]) ** 2 + (x[1] - centre[1]) ** 2 + 1)
    yield "unicycle/moving", *plants["unicycle"], moving, x, 2, [
        (Q(3, 4), 1, Q(-5, 2), Q(1, 2), 3),
        (Q(19, 2), Q(31, 4), 20, Q(-21, 8), Q(-9, 4)),
    ]

    yield "bicycle/speed", *plants["bicycle"], 30 - v**2 / 4, x, 1, plane[:4]

    # A cart with quadratic drag in a potential well; integer and real powers of both signs.
    y = states(2)
    cart = [y[1], -y[1] ** 2 / 8 - y[0] ** 3]
    powers = (1 + y[0] ** 2) ** Q(-7, 4) - y[0] ** 5 / 16 + 1 / (3 + y[0]) ** 3
    yield "cart/powers", cart, [[0], [sp.exp(-y[0] / 4)]], powers, y, 2, [
        (0, Q(1, 2), -2),
        (0, Q(-5, 4), Q(11, 8)),
        (0, 0, 1),
    ]

    # Four equations, a different function in each, u in the last.
    f4 = [
        sp.sin(x[1]),
        x[2] / (1 + x[0] ** 2),
        sp.exp(-x[0]) + x[3],
        sp.sqrt(2 + sp.sin(x[0])) * (Q(3, 2) + x[1] ** 2) ** Q(5, 8),
    ]
    h4 = sp.log(2 + x[0]) + sp.atan(x[0]) - sp.tan(x[0] / 2) / 2
    yield "chain4", f4, [[0], [0], [0], [2 + sp.cos(x[0])]], h4, x, 4, [
        (0, Q(1, 4), Q(1, 2), -1, Q(3, 2)),
        (0, Q(-3, 4), Q(-5, 2), 2, Q(-7, 8)),
        (0, 0, 0, 0, 0),
    ]

    # The largest order supported.
    z = states(8)
    f8 = [
        z[1],
        z[2],
        z[3] + sp.sin(z[0]) / 2,
        z[4],
        z[5] - z[1] * z[2] / 4,
        z[6],
        z[7] + sp.cos(z[3]),
        -z[0],
    ]
    yield "chain8", f8, [[0]] * 7 + [[2 + sp.cos(z[0])]], sp.exp(-z[0] / 2) - 1, z, 8, [
        (0, Q(1, 2), Q(-1, 4), Q(3, 4), 1, Q(-1, 2), Q(1, 8), Q(-5, 4), 2),
        (0, Q(-7, 8), 1, Q(-3, 2), Q(1, 4), 1, -1, Q(1, 2), Q(-3, 4)),
    ]


def digits(value):
    return mpmath.nstr(value, DIGITS, min_fixed=0, max_fixed=0)


def main():
    lines = ["# Written by generate.py; see there for the meaning of the rows."]
    for name, f, g, h, x, n, samples in cases():
        chain, row = lie_derivatives(f, g, h, x, n)
        for number, sample in enumerate(samples):
            point = {s: mpmath.mpf(Q(value).p) / Q(value).q for s, value in zip((t, *x), sample)}
            lines.append(",".join(["state", name, str(number)] + [repr(float(Q(value))) for value in sample]))
            assert all(Q(float(Q(value))) == Q(value) for value in sample), "not exact in binary"
            for kind, expressions in (("drift", chain), ("input", row)):
                for index, expression in enumerate(expressions):
                    value, size = evaluate(sp.sympify(expression), point)
                    lines.append(f"{kind},{name},{number},{index},{digits(value)},{mpmath.nstr(size, 6)}")
    path = pathlib.Path(__file__).with_name("values.csv")
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
