"""cbfjax: a high-order CBF quadratic program with input bounds, from its `from_config`."""

from __future__ import annotations

from functools import cache
from importlib.metadata import version as version_of
from typing import Callable

import cbfjax
import jax
import jax.numpy as jnp
import numpy as np

from problems import Input, Problem, State

name = "cbfjax"
version = version_of("cbfjax")
# The class-K rates of a rock and of the goal, in 1/s; whether rows are slacked.
settings: dict[str, list[dict[str, float | bool]]] = {
    "keep": [{"rate": r, "slacked": False} for r in (1.0, 2.0, 4.0, 8.0)],
    "deadline": [{"rate": 2.0, "pull": p, "slacked": s} for s in (False, True) for p in (0.5, 1.0)],
}
WITHIN = 1.0  # m from the goal's centre: what approaches its set exponentially needs a smaller one


@cache
def solver(plant: str, task: str, number: int, high: tuple, setting: tuple) -> Callable:
    """The compiled filter for so many rocks: (state, u_ref, rocks, goal) -> u.

    A user with one problem writes the body alone. Compiled as a whole, it serves all problems, and is faster.
    """
    options = dict(setting)
    rate, pull, slacked = options["rate"], options.get("pull"), options["slacked"]

    @jax.jit
    def compiled(x, u_ref, rocks, goal):
        # begin user code
        def clearance(rock):
            return lambda x: jnp.hypot(x[0] - rock[0], x[1] - rock[1]) - rock[2]

        barriers = {
            f"rock{i}": {"type": "func", "h": clearance(rock), "rel_deg": 2, "alphas": (rate,)}
            for i, rock in enumerate(rocks)
        }
        # end user code
        if task == "deadline":
            # begin user code: deadline
            def inside(x):
                return WITHIN - jnp.sqrt((x[0] - goal[0]) ** 2 + (x[1] - goal[1]) ** 2 + 0.01)

            barriers["goal"] = {"type": "func", "h": inside, "rel_deg": 2, "alphas": (pull,)}
            # end user code
        # begin user code
        barriers["rows"] = {"type": "multi_barrier", "barriers": list(barriers)}
        filter = cbfjax.from_config({
            "dynamics": {"point_mass": "double_integrator", "unicycle": "unicycle"}[plant],
            "barriers": barriers,
            "filter": {
                "type": "min_interv_input_const_qp",
                "barrier": "rows",
                "action_dim": 2,
                "alpha": lambda h: rate * h,
                "control_low": [-b for b in high],
                "control_high": list(high),
                "params": {"slacked": slacked, "slack_gain": 200.0, "qp_solver": "qpax"},
                "desired_control": lambda x, u_ref: (u_ref, u_ref),
                "desired_control_init_state": lambda: jnp.zeros(2),
            },
        }).filter
        # end user code
        if plant == "point_mass":
            return filter.optimal_control(x, u_ref)[0]
        # begin user code: unicycle
        order = np.array([0, 1, 3, 2])  # its states are x, y, v, theta
        return filter.optimal_control(x[order], u_ref)[0]
        # end user code

    return compiled


def make(problem: Problem, setting: dict[str, float | bool]) -> Callable[[float, State, Input], Input]:
    """The filter has no memory: problems with as many rocks share it, and its compilation."""
    rocks, goal = np.array(problem.rocks), np.array(problem.goal)
    filter = solver(problem.plant, problem.task, len(rocks), problem.bounds, tuple(sorted(setting.items())))
    return lambda t, x, u_ref: tuple(
        np.asarray(filter(np.array(x), np.array(u_ref), rocks, goal), dtype=float).tolist()
    )
