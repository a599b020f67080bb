"""cbfpy: a CBF quadratic program, or a CLF-CBF one, after the package's own demonstrations."""

from __future__ import annotations

from functools import cache
from importlib.metadata import version as version_of
from typing import Callable

import jax.numpy as jnp
import numpy as np
from cbfpy import CBF, CLFCBF, CBFConfig, CLFCBFConfig

from problems import Input, Problem, State

name = "cbfpy"
version = version_of("cbfpy")
# The class-K rates of a rock, in 1/s; for a deadline also what leads to the goal: its distance as a barrier,
# which is relaxed (it begins outside), or the square of it as a Lyapunov function, and the rate of that.
settings: dict[str, list[dict[str, float | str]]] = {
    "keep": [{"rate": r} for r in (0.5, 1.0, 2.0, 4.0, 8.0)],
    "deadline": [
        {"rate": 2.0, "goal": g, "pull": p} for g in ("barrier", "lyapunov") for p in (0.5, 1.0, 2.0, 4.0)
    ],
}
WITHIN = 1.0  # m from the goal's centre: what approaches its set exponentially needs a smaller one


@cache
def solver(plant: str, task: str, number: int, high: tuple, setting: tuple) -> Callable:
    """The compiled filter for so many rocks: (state, u_ref, rocks, goal) -> u."""
    options = dict(setting)
    rate, pull = options["rate"], options.get("pull")
    # begin user code: keep, barrier
    base = CBFConfig
    # end user code
    if options.get("goal") == "lyapunov":
        # begin user code: lyapunov
        base = CLFCBFConfig
        # end user code

    # begin user code
    class Config(base):
        def __init__(self):
            # elastiqp relaxes every row with an l1 penalty, as the package advises on a CPU
            super().__init__(
                n=4, m=2, u_min=[-b for b in high], u_max=high, backend="elastiqp", solver_tol=1e-6,
                init_args=(np.ones((number, 3)), np.zeros(2), np.zeros(2)),
            )
    # end user code

        if plant == "point_mass":
            # begin user code: point_mass
            def f(self, z, *args):
                return jnp.array([z[2], z[3], 0.0, 0.0])

            def g(self, z, *args):
                return jnp.array([[0.0, 0.0], [0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
            # end user code
        else:
            # begin user code: unicycle
            def f(self, z, *args):
                return jnp.array([z[3] * jnp.cos(z[2]), z[3] * jnp.sin(z[2]), 0.0, 0.0])

            def g(self, z, *args):
                return jnp.array([[0.0, 0.0], [0.0, 0.0], [0.0, 1.0], [1.0, 0.0]])
            # end user code

        # begin user code
        def h_2(self, z, rocks, goal, u_ref):
            rows = [jnp.hypot(z[0] - x, z[1] - y) - r for x, y, r in rocks]
            # end user code
            # begin user code: barrier
            if options.get("goal") == "barrier":
                rows.append(WITHIN - jnp.sqrt((z[0] - goal[0]) ** 2 + (z[1] - goal[1]) ** 2 + 0.01))
            # end user code
            # begin user code
            return jnp.array(rows)

        def alpha(self, h, *args):
            return self._rates(h)

        def alpha_2(self, h_2, *args):
            return self._rates(h_2)

        def _rates(self, h):
            return h * jnp.array([rate] * number + [pull] * (h.shape[0] - number))

        # end user code
        # begin user code: lyapunov
        def V_2(self, z, z_des, *args):
            return jnp.array([(z[0] - z_des[0]) ** 2 + (z[1] - z_des[1]) ** 2])

        def gamma(self, v, *args):
            return pull * v

        def gamma_2(self, v, *args):
            return pull * v

        def F(self, z, rocks, goal, u_ref):
            return -u_ref
        # end user code

    if base is CLFCBFConfig:
        # begin user code: lyapunov
        clf = CLFCBF.from_config(Config())
        still = np.zeros(2)
        return lambda z, u_ref, rocks, goal: clf.controller(z, np.append(goal, still), rocks, goal, u_ref)
        # end user code
    # begin user code: keep, barrier
    cbf = CBF.from_config(Config())
    return lambda z, u_ref, rocks, goal: cbf.safety_filter(z, u_ref, rocks, goal, u_ref)
    # end user code


def make(problem: Problem, setting: dict[str, float | str]) -> Callable[[float, State, Input], Input]:
    """The filter has no memory: problems with as many rocks share it, and its compilation."""
    rocks, goal = np.array(problem.rocks), np.array(problem.goal)
    filter = solver(problem.plant, problem.task, len(rocks), problem.bounds, tuple(sorted(setting.items())))
    return lambda t, x, u_ref: tuple(
        np.asarray(filter(np.array(x), np.array(u_ref), rocks, goal), dtype=float).tolist()
    )
