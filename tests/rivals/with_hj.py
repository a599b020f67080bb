"""hj-reachability: value functions on a grid, computed beforehand; u_ref passes where the value allows it.

For a rock the value is the least distance from its centre that the best inputs can keep from now on, so one
grid serves rocks of every radius. Two rocks are looked at one by one. A deadline among rocks needs a grid of
its own for every problem, over the whole field: `show` says what that takes.
"""

from __future__ import annotations

import math
import time
from functools import cache
from importlib.metadata import version as version_of
from typing import Callable

import hj_reachability as hj
import jax
import jax.numpy as jnp
import numpy as np

from problems import DEADLINE, RADIUS, STEP, Input, Problem, State

name = "hj-reachability"
version = version_of("hj-reachability")
settings: dict[str, list[dict[str, float]] | None] = {
    "keep": [{"margin": m} for m in (0.1, 0.2, 0.4)],  # m: the grid's error is part of it
    "deadline": None,
}
SHAPE = (29, 29, 25, 25)  # nodes: 16 m by 16 m around a rock, and the two other states
HORIZON = 2.0  # s: more than it takes to stop


class Plant(hj.ControlAndDisturbanceAffineDynamics):
    """Either plant, with nothing to disturb it."""

    def __init__(self, plant: str, high: tuple) -> None:
        self.plant = plant
        nothing = hj.sets.Box(jnp.zeros(1), jnp.zeros(1))
        super().__init__("max", "min", hj.sets.Box(-jnp.array(high), jnp.array(high)), nothing)

    # begin user code: point_mass
    def open_loop_dynamics(self, x, t):
        if self.plant == "point_mass":
            return jnp.array([x[2], x[3], 0.0, 0.0])
        # end user code
        # begin user code: unicycle
        return jnp.array([x[3] * jnp.cos(x[2]), x[3] * jnp.sin(x[2]), 0.0, 0.0])
        # end user code

    # begin user code
    def control_jacobian(self, x, t):
        rows = [[1.0, 0.0], [0.0, 1.0]] if self.plant == "point_mass" else [[0.0, 1.0], [1.0, 0.0]]
        return jnp.array([[0.0, 0.0], [0.0, 0.0], *rows])

    def disturbance_jacobian(self, x, t):
        return jnp.zeros((4, 1))
    # end user code


@cache
def solver(plant: str, high: tuple) -> tuple[Callable, float]:
    """The compiled filter of a plant, (state, u_ref, rock) -> (slack, u), and the s that its values took."""
    begun = time.perf_counter()
    # begin user code
    dynamics = Plant(plant, high)
    others = ([-9.0, -9.0], [9.0, 9.0]) if plant == "point_mass" else ([-math.pi, -2.0], [math.pi, 7.0])
    domain = hj.sets.Box(np.array([-8.0, -8.0, *others[0]]), np.array([8.0, 8.0, *others[1]]))
    grid = hj.Grid.from_lattice_parameters_and_boundary_conditions(
        domain, SHAPE, periodic_dims=2 if plant == "unicycle" else None
    )
    distance = jnp.hypot(grid.states[..., 0], grid.states[..., 1])
    tube = hj.SolverSettings.with_accuracy(
        "medium", hamiltonian_postprocessor=hj.solver.backwards_reachable_tube
    )
    values = hj.step(tube, dynamics, grid, 0.0, distance, -HORIZON, progress_bar=False)
    slopes = grid.grad_values(values)

    @jax.jit
    def filter(x, u_ref, rock):
        relative = x - jnp.array([rock[0], rock[1], 0.0, 0.0])
        soon = relative + STEP * dynamics(relative, u_ref, jnp.zeros(1), 0.0)
        limits = jnp.array(domain.lo) + 1e-6, jnp.array(domain.hi) - 1e-6
        hold = lambda z: z.at[3].set(jnp.clip(z[3], limits[0][3], limits[1][3])).at[2].set(
            jnp.clip(z[2], limits[0][2], limits[1][2]) if plant == "point_mass" else z[2]
        )
        value = jnp.nan_to_num(grid.interpolate(values, hold(soon)), nan=8.0)  # off the grid: far away
        slope = jnp.nan_to_num(grid.interpolate(slopes, hold(relative)))
        return value - rock[2], dynamics.optimal_control(relative, 0.0, slope)
    # end user code

    filter(np.zeros(4), np.zeros(2), np.ones(3))
    return filter, time.perf_counter() - begun


def make(problem: Problem, setting: dict[str, float]) -> Callable[[float, State, Input], Input]:
    """The filter has no memory, and serves every problem of its plant."""
    filter, _ = solver(problem.plant, problem.bounds)
    rocks = [np.array(rock) for rock in problem.rocks]

    # begin user code
    def step(t, x, u_ref):
        answers = [filter(np.array(x), np.array(u_ref), rock) for rock in rocks]
        slack, u = min(answers, key=lambda a: float(a[0]))
        return u_ref if slack >= setting["margin"] else tuple(np.asarray(u, dtype=float).tolist())
    # end user code

    return step


class Line(hj.ControlAndDisturbanceAffineDynamics):
    """A point mass on a line, |a| <= 4."""

    def __init__(self) -> None:
        nothing = hj.sets.Box(jnp.zeros(1), jnp.zeros(1))
        super().__init__("max", "min", hj.sets.Box(-4.0 * jnp.ones(1), 4.0 * jnp.ones(1)), nothing)

    def open_loop_dynamics(self, x, t):
        return jnp.array([x[1], 0.0])

    def control_jacobian(self, x, t):
        return jnp.array([[0.0], [1.0]])

    def disturbance_jacobian(self, x, t):
        return jnp.zeros((2, 1))


def earliest(distance: float) -> float:
    """By a formula: when a start at rest can be in the goal for good. It accelerates, then brakes."""
    way, entry = distance - RADIUS, math.sqrt(2 * 4.0 * 2 * RADIUS)  # m/s: what still stops within the goal
    peak = math.sqrt((2 * 4.0 * way + entry**2) / 2)
    return math.sqrt(2 * way / 4.0) if peak < entry else (2 * peak - entry) / 4.0


def show() -> None:
    """What is possible at all, on a line, and what the grids cost."""
    starts = (5.0, 10.0, 15.0, 20.0, 25.0)
    print(
        "**A line (2 states): the earliest time at which a start at rest can be in the goal for good**\n\n"
        "| grid | values, MB | computed in, s | " + " | ".join(f"{d:.0f} m" for d in starts) + " |\n"
        "|---|---:|---:|" + "---:|" * len(starts)
    )
    for shape in ((81, 61), (161, 121)):
        begun = time.perf_counter()
        grid = hj.Grid.from_lattice_parameters_and_boundary_conditions(
            hj.sets.Box(np.array([-30.0, -15.0]), np.array([10.0, 15.0])), shape
        )
        tube = hj.SolverSettings.with_accuracy(
            "very_high", hamiltonian_postprocessor=hj.solver.backwards_reachable_tube
        )
        inside = RADIUS - jnp.abs(grid.states[..., 0])
        # >= 0: can stay inside for good
        stays = hj.step(tube, Line(), grid, 0.0, inside, -3.0, progress_bar=False)
        times = np.arange(0.0, -DEADLINE - 0.01, -0.05)
        reach = hj.SolverSettings.with_accuracy(
            "very_high", hamiltonian_postprocessor=lambda a: jnp.maximum(a, 0.0)
        )
        values = np.asarray(hj.solve(reach, Line(), grid, times, stays, progress_bar=False))
        took = time.perf_counter() - begun
        found = []
        for d in starts:
            at = np.array([float(grid.interpolate(v, np.array([-d, 0.0]))) for v in jnp.asarray(values)])
            found.append(f"{-times[np.argmax(at >= 0.0)]:.2f} s" if (at >= 0.0).any() else "not by 8 s")
        size = f"{shape[0]} × {shape[1]} | {values.nbytes / 1e6:.1f} | {took:.1f}"
        print(f"| {size} | " + " | ".join(found) + " |")
    print("| by a formula | – | – | " + " | ".join(f"{earliest(d):.2f} s" for d in starts) + " |")
    print("\n**4 states**\n")
    for plant, high in (("point_mass", (4.0, 4.0)), ("unicycle", (4.0, 1.5))):
        _, took = solver(plant, high)
        nodes = math.prod(SHAPE)
        print(
            f"- {plant}, around one rock, {' × '.join(map(str, SHAPE))} nodes, {HORIZON:g} s: "
            f"computed in {took:.0f} s, {5 * nodes * 8 / 1e6:.0f} MB with its slopes."
        )
    field, nodes = (97, 97, 25, 25), 97 * 97 * 25 * 25
    factor = nodes / math.prod(SHAPE) * DEADLINE / HORIZON
    print(
        f"- A deadline among rocks needs the whole field, {' × '.join(map(str, field))} nodes at the same "
        f"spacing, for each problem and each of its times: about {factor * took / 60:.0f} min by the size, "
        f"not run; {nodes * 8 / 1e6:.0f} MB for each time kept."
    )
