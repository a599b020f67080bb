"""Results as frames of pandas."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ._punctual import Plan

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray
    from pandas import DataFrame as _DataFrame


def to_pandas(result: NDArray[np.void] | Plan) -> _DataFrame:
    """A result of `simulate`, or a `Plan`, as a frame of pandas: the time in s is its index, called `time`.

    A result has a column for each of its fields, in its type; a plan has `x.<state>`, `u.<input>` and
    `<barrier>.h`, as results have.

    Raises `ImportError` without pandas (`pip install pandas`); `TypeError` for anything else.
    """
    try:
        import pandas
    except ImportError as error:
        raise ImportError("punctual.to_pandas needs pandas: pip install pandas") from error
    if isinstance(result, Plan):
        columns = {f"x.{name}": result.x[:, i] for i, name in enumerate(result.states)}
        columns |= {f"u.{name}": result.u[:, i] for i, name in enumerate(result.inputs)}
        columns |= {f"{name}.h": result.h[:, i] for i, name in enumerate(result.barriers)}
        return pandas.DataFrame(columns, index=pandas.Index(result.times, name="time"))
    names = getattr(getattr(result, "dtype", None), "names", None) or ()
    if "time" not in names:
        raise TypeError(f"result: is {type(result).__name__}, must be a result of simulate, or a Plan")
    return pandas.DataFrame({name: result[name] for name in names}).set_index("time")
