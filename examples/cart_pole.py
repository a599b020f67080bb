"""A cart with a pole upright on it, whose dynamics is a Python function: the filter has it as expressions.

    pip install out/punctual_filter-*.whl   # Punctual's wheel, which python/wheel makes
    python examples/cart_pole.py

The cart is to be within 0.2 m of 2 m by 3 s, and the pole never to lean by more than 0.5 rad. A controller pushes the other
way with 30 N all the time. The force has bounds of 40 N, so the filter finds a plan at its first step, and keeps the promise.

`dynamics` has two uses. Punctual calls it once, with symbols, and has its derivatives exactly. This program calls it with
numbers and integrates it, in four Runge-Kutta steps for each step of the filter.
"""

import numpy as np
import punctual

STEP, STOP, DEADLINE = 0.02, 6.0, 3.0
P = {"m_c": 1.0, "m_p": 0.2, "l": 0.5}  # kg, kg, m
GRAVITY, GOAL, NEAR, LEAN = 9.81, 2.0, 0.2, 0.5  # m/s2, m, m, rad


def dynamics(x, u, p):
    """The derivative of (place, lean, speed, rate of the lean) under a force on the cart; the pole's mass is at its end."""
    _, theta, v, omega = x
    pull = p["m_p"] * np.sin(theta) * (p["l"] * omega**2 - GRAVITY * np.cos(theta))
    a = (u[0] + pull) / (p["m_c"] + p["m_p"] * np.sin(theta) ** 2)
    return np.array([v, omega, a, (GRAVITY * np.sin(theta) - np.cos(theta) * a) / p["l"]])


FILTER = {
    "kind": "filter",
    "plant": {
        "states": [
            {"name": "x", "unit": "m"},
            {"name": "theta", "unit": "rad", "min": -LEAN, "max": LEAN},
            {"name": "v", "unit": "m/s"},
            {"name": "omega", "unit": "rad/s"},
        ],
        "inputs": [{"name": "force", "unit": "N", "min": -40.0, "max": 40.0}],
        "parameters": [
            {"name": "m_c", "start": P["m_c"], "min": 0.01, "unit": "kg"},
            {"name": "m_p", "start": P["m_p"], "min": 0.0, "unit": "kg"},
            {"name": "l", "start": P["l"], "min": 0.01, "unit": "m"},
        ],
        "derivatives": dynamics,
    },
    "barrier": [
        {"name": "goal", "expression": lambda x: NEAR**2 - (x[0] - GOAL) ** 2, "unit": "m2", "deadline": DEADLINE},
        {"name": "left", "expression": lambda x: x[1] + LEAN, "unit": "rad"},
        {"name": "right", "expression": lambda x: LEAN - x[1], "unit": "rad"},
    ],
    "experiment": {"step_size": STEP},
}


def integrated(x, u, duration):
    """The state after `duration` in s under a held input."""
    h = duration / 4
    for _ in range(4):
        k1 = dynamics(x, u, P)
        k2 = dynamics(x + h / 2 * k1, u, P)
        k3 = dynamics(x + h / 2 * k2, u, P)
        k4 = dynamics(x + h * k3, u, P)
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return x


# What the command line takes: punctual build cart-pole.toml -o cart-pole.fmu
print(punctual.to_toml(FILTER))

way = punctual.plan(FILTER, [0.0, 0.0, 0.0, 0.0])
print(f"a plan: at an equilibrium from {way.times[-1]:.2f} s, with {100 * way.effort:.0f} % of the force")

filter, x, rows = punctual.Filter(FILTER), np.zeros(4), []
for k in range(round(STOP / STEP)):
    step = filter.step(k * STEP, x, [-30.0])
    rows.append((k * STEP, x[0], x[1], all(barrier.guaranteed for barrier in step.barriers.values())))
    x = integrated(x, step.u, STEP)

t, place, lean, guaranteed = np.array(rows).T
late = place[t >= DEADLINE - STEP / 2]
print(f"from {DEADLINE:g} s on within {np.abs(late - GOAL).max():.4f} m of {GOAL:g} m, lean at most {np.abs(lean).max():.4f} rad")
assert np.abs(late - GOAL).max() <= NEAR and np.abs(lean).max() <= LEAN
assert guaranteed.all()
