"""CasADi: a predictive safety filter by hand, multiple shooting solved by fatrop at every step.

It seeks the input nearest to u_ref behind which there is a plan that ends at rest, in the goal if there is
one. If the solver finds none, the input is that of the last plan: the usual argument for such a filter.
"""

from __future__ import annotations

import shutil
from functools import cache
from typing import Callable

import casadi as ca
import numpy as np

from problems import DEADLINE, RADIUS, STEP, Failed, Input, Problem, State

name = "CasADi"
version = ca.__version__
# Intervals of the horizon, and its least length in s (to the deadline, while that is farther).
settings: dict[str, list[dict[str, float]]] = {
    "keep": [{"intervals": n, "horizon": 2.0} for n in (15, 25)],
    "deadline": [{"intervals": n, "horizon": 2.0} for n in (15, 25)],
}
MARGIN = 0.05  # m: rocks are looked at PARTS times in an interval
PARTS = 4
COMPILE = {"expand": True}
if shutil.which("cc"):
    COMPILE = {"jit": True, "compiler": "shell", "jit_options": {"flags": ["-O2"], "compiler": "cc"}}


@cache
def solver(plant: str, task: str, number: int, high: tuple, intervals: int) -> Callable:
    """(state, u_ref, length of an interval, nodes that are due, rocks, goal, guesses of x and u) -> plan."""
    # begin user code
    x, u, dt, rock = ca.SX.sym("x", 4), ca.SX.sym("u", 2), ca.SX.sym("dt"), ca.SX.sym("rock", 3, number)
    # end user code
    if plant == "point_mass":
        # begin user code: point_mass
        f = ca.Function("f", [x, u], [ca.vertcat(x[2], x[3], u[0], u[1])])
        still = [2, 3]  # the states that are zero at rest
        # end user code
    else:
        # begin user code: unicycle
        f = ca.Function("f", [x, u], [ca.vertcat(x[3] * ca.cos(x[2]), x[3] * ca.sin(x[2]), u[1], u[0])])
        still = [3]
        # end user code
    # begin user code
    at, d, places = x, dt / PARTS, []
    for _ in range(PARTS):
        k1 = f(at, u)
        k2 = f(at + d / 2 * k1, u)
        k3 = f(at + d / 2 * k2, u)
        k4 = f(at + d * k3, u)
        at = at + d / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        places.append(at[:2])
    advance = ca.Function("advance", [x, u, dt], [at])
    distances = ca.vertcat(*[
        ca.sumsqr(p - rock[:2, i]) / (rock[2, i] + MARGIN) ** 2 for p in places for i in range(number)
    ])
    clear = ca.Function("clear", [x, u, dt, rock], [distances])

    opti = ca.Opti()
    xs, us = [], []
    for k in range(intervals + 1):  # in the order of the stages, as fatrop needs them
        xs.append(opti.variable(4))
        us += [opti.variable(2)] if k < intervals else []
    start, u_ref = opti.parameter(4), opti.parameter(2)
    later, is_due = opti.parameter(), opti.parameter(intervals)
    rocks, goal = opti.parameter(3, number), opti.parameter(2)
    for k in range(intervals):
        length = STEP if k == 0 else later
        opti.subject_to(xs[k + 1] == advance(xs[k], us[k], length))
        if k == 0:
            opti.subject_to(xs[0] == start)
        opti.subject_to(opti.bounded(-ca.DM(high), us[k], ca.DM(high)))
        opti.subject_to(clear(xs[k], us[k], length, rocks) >= 1)
        # end user code
        if task == "deadline" and k > 0:
            # begin user code: deadline
            opti.subject_to(ca.sumsqr(xs[k][:2] - goal) <= (RADIUS - MARGIN) ** 2 + 1e4 * (1 - is_due[k]))
            # end user code
    # begin user code
    opti.subject_to(xs[-1][still] == 0)
    # end user code
    if task == "deadline":
        # begin user code: deadline
        opti.subject_to(ca.sumsqr(xs[-1][:2] - goal) <= (RADIUS - MARGIN) ** 2)
        # end user code
    # begin user code
    opti.minimize(ca.sumsqr(us[0] - u_ref) + 1e-4 * sum(ca.sumsqr(a) for a in us[1:]))
    opti.solver("fatrop", {
        "structure_detection": "auto", "print_time": False, **COMPILE,
        "fatrop": {"print_level": 0, "max_iter": 60, "tol": 1e-5, "mu_init": 1e-4},
    })
    arguments = [start, u_ref, later, is_due, rocks, goal, ca.horzcat(*xs), ca.horzcat(*us)]
    return opti.to_function("filter", arguments, [ca.horzcat(*xs), ca.horzcat(*us)])
    # end user code


def make(problem: Problem, setting: dict[str, float]) -> Callable[[float, State, Input], Input]:
    """A filter of its own for each run, which has the last plan in memory."""
    intervals, horizon = int(setting["intervals"]), setting["horizon"]
    high, goal, task = problem.bounds, problem.goal, problem.task
    solve = solver(problem.plant, task, len(problem.rocks), high, intervals)
    rocks = np.array(problem.rocks).T
    # begin user code
    plan: list = []  # times, states and inputs of the last one

    def guesses(x):
        """The last plan; without one, ways to the goal or a halt, straight and to either side."""
        if plan:
            times, xs, us = plan
            return [(xs, us)]
        parts = np.linspace(0.0, 1.0, intervals + 1)
        # end user code
        end = np.array(x[:2])
        if task == "deadline":
            # begin user code: deadline
            end = np.array(goal)
            # end user code
        # begin user code
        way = end - np.array(x[:2])
        ways = []
        for aside in (0.0, 0.2, -0.2, 0.5, -0.5):
            side = aside * np.array([-way[1], way[0]])[:, None] * np.sin(np.pi * parts)
            place = np.array(x[:2])[:, None] + way[:, None] * parts + side
            if problem.plant == "point_mass":
                rest = np.zeros((2, intervals + 1))
            else:
                rest = np.outer([np.arctan2(way[1], way[0]), np.hypot(*way) / DEADLINE], 0 * parts + 1)
            ways.append((np.vstack([place, rest]), np.zeros((2, intervals))))
        return ways

    def step(t, x, u_ref):
        length = horizon
        is_due = np.zeros(intervals)
        # end user code
        if task == "deadline":
            # begin user code: deadline
            length = max(DEADLINE - t, horizon)
            # end user code
        # begin user code
        later = (length - STEP) / (intervals - 1)
        times = t + np.concatenate([[0.0], STEP + later * np.arange(intervals)])
        # end user code
        if task == "deadline":
            # begin user code: deadline
            is_due[:] = times[1:] > DEADLINE + 1e-9  # a node is due if the next one is after the deadline
            # end user code
        # begin user code
        for xs, us in guesses(x):
            try:
                xs, us = solve(x, u_ref, later, is_due, rocks, goal, xs, us)
            except RuntimeError:
                continue
            plan[:] = [times, np.array(xs), np.array(us)]
            u = plan[2][:, 0]
            return tuple(u_ref) if np.abs(u - u_ref).max() < 1e-4 else tuple(u.tolist())
        if not plan:
            raise Failed(None)
        k = np.searchsorted(plan[0], t + 1e-9, side="right") - 1
        raise Failed(tuple(plan[2][:, k].tolist()) if k < intervals else (0.0, 0.0))
    # end user code

    return step
