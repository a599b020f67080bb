"""Pictures of a result of `simulate`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ._error import Error

if TYPE_CHECKING:
    import numpy as np
    from matplotlib.figure import Figure
    from numpy.typing import NDArray


def plot(result: NDArray[np.void], *barriers: str) -> Figure:
    """Draws h of barriers over time in a result of `simulate`, a panel each, and the inputs below, where they are recorded.

    A dashed line is the bound that was promised (of an input: the one wanted), a vertical one the deadline.

    - `barriers`: their names. Default: all of the filter.

    Returns the figure of Matplotlib. Raises `ImportError` without that (`pip install matplotlib`); `Error` for a barrier
    whose h and profile are not in the result.
    """
    try:
        from matplotlib import pyplot
    except ImportError as error:
        raise ImportError("punctual.plot needs Matplotlib: pip install matplotlib") from error
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
        axes.axhline(0.0, color="grey", linewidth=0.8)
        if deadline is not None:
            axes.axvline(deadline, color="grey", linewidth=0.8)
        axes.set_ylabel(f"h in {unit}")
    for name in inputs:
        [line] = grid[-1, 0].plot(time, result[name], label=name)
        wanted = name.replace("u.", "u_ref.", 1)
        if wanted in names:
            grid[-1, 0].plot(time, result[wanted], "--", color=line.get_color(), label=wanted)
    grid[-1, 0].set_xlabel("time in s")
    for axes in grid[:, 0]:
        axes.legend()
    return figure
