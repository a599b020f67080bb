"""A filter's file run alone, with its own model, without FMI."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ._configuration import Configuration, configuration_file
from ._fmu import run_for

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


@dataclass(frozen=True)
class Run:
    """What a run was, and what became of each promise."""

    values: NDArray[np.void]
    """An array with the field `time` and one for each variable, a row for each communication point, as `simulate` returns
    it: `plot`, `promise` and `to_pandas` take it. Variables of the plant begin with `plant.`; truth values are 0 and 1."""
    report: dict[str, Any]
    """What `punctual run --json` says: `promises`, one dict for each barrier, `interference`, times, and more."""

    @property
    def promises(self) -> dict[str, dict[str, Any]]:
        """What became of the promise of each barrier, by its name; `["promise"]` is `"kept"`, `"broken"` or `"open"`."""
        return {row["barrier"].removeprefix("filter."): row for row in self.report["promises"]}


def run(
    configuration: Configuration,
    *,
    x0: Mapping[str, float] | None = None,
    stop_time: float | None = None,
    uncertainty: int | None = None,
) -> Run:
    """Runs a filter with its own model, as `punctual run FILE` does, with the same numbers; needs neither FMPy nor an FMU.

    - `configuration`: the path of a filter's TOML file, or a dict with the same content, which may have `x0`, `u_ref` and
      `simulated`.
    - `x0`: starts by state, in place of those of a dict. For a file, change the file.
    - `stop_time`: the end in s, in place of that of a dict.
    - `uncertainty`: a seed with which the plant deviates from the model, at the ends of what the filter declares.

    A broken promise is no error: it is in the result. Raises `Error` for a configuration that cannot be run.
    """
    import numpy

    if x0 is not None or stop_time is not None:
        if not isinstance(configuration, Mapping):
            raise TypeError("x0 and stop_time: are for a dict; a file has its own")
        configuration = dict(configuration)
        if x0 is not None:
            configuration["x0"] = {**configuration.get("x0", {}), **x0}
        if stop_time is not None:
            configuration["experiment"] = {**configuration.get("experiment", {}), "stop_time": stop_time}
    more = [] if uncertainty is None else ["--uncertainty", str(uncertainty)]
    with configuration_file(configuration) as file, tempfile.TemporaryDirectory() as folder:
        shown = ("--json", "--signals", "--require", "nothing", *more)
        report = json.loads(run_for([(configuration, file)], "run", file, "--out", folder, *shown))
        table = (Path(folder) / file.stem).with_suffix(".csv")
        head, *rows = table.read_text(encoding="utf-8").splitlines()
    units = {row["name"].removeprefix("filter."): row["unit"] for row in report["signals"]}
    # What has no unit is a number of something, or a truth value.
    names = [name.removeprefix("filter.") for name in head.split(",")]
    fields = [(name, "i4" if units.get(name, "s") is None else "f8") for name in names]
    known: dict[str, Any] = {}
    for row in report["promises"]:
        name = row["barrier"].removeprefix("filter.")
        known[name] = row["deadline"], tuple(units[f"{name}.{field}"] or "1" for field in ("h", "slack")), True
    values = numpy.array(
        [tuple(map(float, row.split(","))) for row in rows], numpy.dtype(fields, metadata={"punctual": known})
    )
    return Run(values, report)
