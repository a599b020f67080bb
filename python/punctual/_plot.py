"""Pictures of a result of `simulate`, and of a plan."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ._error import Error
from ._punctual import Plan

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

# Cells of the grid on which the edge of a set in a plane is looked for, along each side.
_CELLS = 200


def plot(result: NDArray[np.void] | Plan, *barriers: str) -> Figure:
    """Draws h of barriers over time in a result of `simulate`, or in a `Plan`, a panel each, and the inputs below.

    In a result a dashed line is the bound that was promised (of an input: the one wanted), a vertical one the deadline.
    Inputs are drawn where they are recorded. Of a plan h is drawn against 0 and the deadline, the inputs against their
    bounds. Beside them is the path, where two states are a place in a plane (lengths, such as `x` and `y`), with the sets
    h >= 0 of barriers that depend on the place alone: green to be inside, red to stay out.

    - `barriers`: their names. Default: all of the filter; of a plan, all that it keeps.

    Returns the figure of Matplotlib. Raises `ImportError` without that (`pip install matplotlib`); `Error` for a barrier
    whose h and profile are not in the result, or that the plan does not keep.
    """
    try:
        from matplotlib import pyplot
    except ImportError as error:
        raise ImportError("punctual.plot needs Matplotlib: pip install matplotlib") from error
    if isinstance(result, Plan):
        return _plan(pyplot, result, barriers)
    names = result.dtype.names or ()
    known: dict[str, Any] = dict(result.dtype.metadata or {}).get("punctual", {})
    barriers = barriers or tuple(known)
    for field in (f"{barrier}.{part}" for barrier in barriers for part in ("h", "profile")):
        if field not in names:
            raise Error(f"result: has no field {field!r}, only {', '.join(names)}")
    inputs = [name for name in names if name.startswith("u.")]
    count, time = len(barriers) + bool(inputs), result["time"]
    figure, grid = pyplot.subplots(count, sharex=True, squeeze=False, figsize=(7.0, 2.5 * count), layout="constrained")
    for axes, barrier in zip(grid[:, 0], barriers):
        deadline, (unit, _) = known.get(barrier, (None, ("1", "1")))[:2]
        axes.plot(time, result[f"{barrier}.h"], label=f"{barrier}.h")
        axes.plot(time, result[f"{barrier}.profile"], "--", label=f"{barrier}.profile")
        _marks(axes, deadline, unit)
    for name in inputs:
        [line] = grid[-1, 0].plot(time, result[name], label=name)
        wanted = name.replace("u.", "u_ref.", 1)
        if wanted in names:
            grid[-1, 0].plot(time, result[wanted], "--", color=line.get_color(), label=wanted)
    grid[-1, 0].set_xlabel("time in s")
    for axes in grid[:, 0]:
        axes.legend()
    return figure


def _marks(axes: Any, deadline: float | None, unit: str) -> None:
    """h = 0, the deadline, and the unit of h."""
    axes.axhline(0.0, color="grey", linewidth=0.8)
    if deadline is not None:
        axes.axvline(deadline, color="grey", linewidth=0.8)
    axes.set_ylabel(f"h in {unit}")


def _plan(pyplot: Any, plan: Plan, barriers: tuple[str, ...]) -> Figure:
    barriers = barriers or tuple(plan.barriers)
    for barrier in barriers:
        if barrier not in plan.barriers:
            raise Error(f"result: the plan keeps no barrier {barrier!r}, only {', '.join(plan.barriers)}")
    kept, plane = list(plan.barriers), _plane(plan)
    count = len(barriers) + len(plan.inputs)
    columns = 1 if plane is None else 2
    figure: Figure = pyplot.figure(figsize=(7.0 * columns, max(2.0 * count, 5.0 * (columns - 1))), layout="constrained")
    grid = figure.add_gridspec(count, columns)
    panels: list[Any] = []
    for row in range(count):
        panels.append(figure.add_subplot(grid[row, 0], sharex=panels[0] if panels else None))
        panels[row].tick_params(labelbottom=row == count - 1)
    for axes, barrier in zip(panels, barriers):
        axes.plot(plan.times, plan.h[:, kept.index(barrier)], label=f"{barrier}.h")
        _marks(axes, plan.deadlines.get(barrier), plan.barriers[barrier])
    for i, (axes, (name, unit)) in enumerate(zip(panels[len(barriers) :], plan.inputs.items())):
        axes.step(plan.times, plan.u[:, i], where="post", label=f"u.{name}")
        for bound in plan.bounds[name]:
            axes.axhline(bound, color="grey", linewidth=0.8)
        axes.set_ylabel(f"{name} in {unit}")
    panels[-1].set_xlabel("time in s")
    if plane is not None:
        panels.append(figure.add_subplot(grid[:, 1]))
        _path(panels[-1], plan, plane, barriers)
    for axes in panels:
        axes.legend()
    return figure


def _plane(plan: Plan) -> tuple[int, int] | None:
    """The columns of the first two states that are a place: lengths whose names differ in x and y, or in x and z."""
    states = list(plan.states)
    for name, unit in plan.states.items():
        for letter in "yz":
            other = name.replace("x", letter, 1)
            if other != name and unit == "m" and plan.states.get(other) == "m":
                return states.index(name), states.index(other)
    return None


def _path(axes: Any, plan: Plan, plane: tuple[int, int], barriers: tuple[str, ...]) -> None:
    """The path in `plane`, and the sets of `barriers` that depend on nothing else."""
    places = plan.x[:, plane]
    axes.set_aspect("equal", adjustable="datalim")
    [line] = axes.plot(*places.T, color="black", label="path")
    axes.plot(*places[0], "o", color=line.get_color(), label="start")
    axes.margins(0.2)
    axes.apply_aspect()
    x, y = (np.linspace(low, high, _CELLS) for low, high in (axes.get_xlim(), axes.get_ylim()))
    across, up = np.meshgrid(x, y)
    states = np.tile(plan.x[0], (across.size, 1))
    states[:, plane[0]], states[:, plane[1]] = across.ravel(), up.ravel()
    rest = [i for i in range(states.shape[1]) if i not in plane]
    elsewhere = states.copy()
    # Numbers that mean nothing, so that what depends on other states differs.
    elsewhere[:, rest] = elsewhere[:, rest] * 0.83 + np.linspace(0.37, 0.71, len(rest))
    h, other = plan.values(plan.times[0], states), plan.values(plan.times[-1], elsewhere)
    for i, barrier in enumerate(plan.barriers):
        field = h[:, i]
        if barrier not in barriers or not np.array_equal(field, other[:, i]) or not (field.min() < 0.0 < field.max()):
            continue
        field = field.reshape(across.shape)
        # What is safe all around is so outside of an obstacle.
        obstacle = min(field[[0, -1]].min(), field[:, [0, -1]].min()) >= 0.0
        colour, inside = ("tab:red", [-np.inf, 0.0]) if obstacle else ("tab:green", [0.0, np.inf])
        axes.contour(x, y, field, levels=[0.0], colors=[colour])
        axes.contourf(x, y, field, levels=inside, colors=[colour], alpha=0.15)
        axes.plot([], [], color=colour, label=f"{barrier}: {'out' if obstacle else 'in'}side")
    names = list(plan.states)
    axes.set_xlabel(f"{names[plane[0]]} in m")
    axes.set_ylabel(f"{names[plane[1]]} in m")
