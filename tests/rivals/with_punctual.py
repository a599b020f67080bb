"""Punctual, through its Python package. No setting is searched: its documented defaults."""

from __future__ import annotations

from importlib.metadata import version as version_of
from typing import Callable

import punctual

from problems import DEADLINE, RADIUS, STEP, Input, Problem, State

name = "Punctual"
version = version_of("punctual-filter")
settings: dict[str, list[dict[str, float]]] = {"keep": [{}], "deadline": [{}]}


def make(problem: Problem, setting: dict[str, float]) -> Callable[[float, State, Input], Input]:
    """A filter of its own for each run: it has a memory."""
    goal, rocks, high = problem.goal, problem.rocks, problem.bounds
    # begin user code
    names = {"point_mass": ("u_x", "u_y"), "unicycle": ("a", "omega")}[problem.plant]
    barriers = [
        {"name": f"rock{i}", "shape": "obstacle", "centre": [x, y], "radius": r}
        for i, (x, y, r) in enumerate(rocks)
    ]
    # end user code
    if problem.task == "deadline":
        # begin user code: deadline
        barriers.append({"name": "goal", "centre": list(goal), "radius": RADIUS, "deadline": DEADLINE})
        # end user code
    # begin user code
    filter = punctual.Filter({
        "kind": "filter",
        "plant": {"model": problem.plant},
        "bounds": {name: [-b, b] for name, b in zip(names, high)},
        "experiment": {"step_size": STEP},
        "barrier": barriers,
    })
    return lambda t, x, u_ref: tuple(filter.step(t, x, u_ref).u)
    # end user code
