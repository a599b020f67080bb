"""Verdict on a promise in a result of `simulate`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ._enumerations import Status
from ._error import Error
from ._punctual import judge

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


@dataclass(frozen=True)
class Promise:
    """Findings on one barrier: its promise, which is about h, and its constraint, which is about steps."""

    promise: str
    """`kept`, `broken`, `open` (the run ends before it is decided), `nothing_promised`, or `let_go` (another alternative was taken)."""
    deadline: float | None
    """The instant of the deadline in s; `None` without one."""
    began_inside: bool
    on_time: bool
    """Whether h >= 0 held by the deadline; without one, at the start."""
    inside: bool
    """Whether h >= 0 held from the deadline on; from the start on where it began inside."""
    arrival: float | None
    """First time in s with h >= 0."""
    late: float | None
    """Time in s at which it became certain that the deadline is missed."""
    late_by: float | None
    """By how many seconds it arrived later than its deadline: `inf` where it was late and never arrived, `None` if on time."""
    left: float | None
    """Time in s at which it was left, after it had been inside and was to stay so."""
    least_h: float | None
    """Least h while it was to be inside."""
    unmet: int
    """Samples that did not meet its constraint."""

    @property
    def constraint_met(self) -> bool:
        """Whether every sample met the constraint."""
        return self.unmet == 0

    @property
    def kept(self) -> bool:
        """Whether nothing was missed: the promise is kept and every sample met the constraint."""
        return self.promise == "kept" and self.constraint_met


def promise(result: NDArray[np.void], barrier: str, *, deadline: float | None = None) -> Promise:
    """Judges `barrier` in a result of `simulate` as `punctual run` does it: by h itself, at the deadline too where that
    lies between two communication points.

    - `deadline`: in s after the first step. Default: the filter's own in that run.

    The result must have the fields `status` and `h`, `phase`, `deadline_unreachable` and `unmet_steps` of the barrier, as it has
    unless `record` says otherwise. Raises `Error` where one is missing.
    """
    fields = ["time", "status", *(f"{barrier}.{field}" for field in ("h", "phase", "deadline_unreachable", "unmet_steps"))]
    names = result.dtype.names or ()
    missing = [field for field in fields if field not in names]
    if missing:
        raise Error(f"result: has no field {missing[0]!r}, only {', '.join(names)}")
    known: dict[str, Any] = dict(result.dtype.metadata or {}).get("punctual", {})
    own, units, prompt = known.get(barrier, (None, ("1", "1"), True))
    time, status, h, phase, late, unmet = (result[field].tolist() for field in fields)
    if not prompt:
        # Outputs read at a point are those of the point before.
        time, status, h, phase, late, unmet = time[:-1], status[1:], h[1:], phase[1:], late[1:], unmet[1:]
    rows = list(zip(time, h, phase, map(bool, late), status))
    said = judge(rows, own if deadline is None else deadline, units)
    abstained = range(Status.INVALID_INPUT, Status.BACKUP)
    failed = sum(n > 0 or s in abstained for n, s in zip(unmet, status))
    return Promise(**said, unmet=failed)
