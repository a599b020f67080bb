"""FMUs, and findings on a configuration, by the command line."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ._command import run
from ._configuration import Configuration, configuration_file
from ._error import Error
from ._trace import with_function

Value = float | int | bool | str


@dataclass(frozen=True)
class Variable:
    """A variable of an FMU, as its model description declares it."""

    name: str
    value_reference: int
    type: str
    """`Real`, `Integer`, `Boolean`, `String` or `Enumeration`."""
    causality: str
    variability: str
    unit: str | None
    start: Value | None
    minimum: float | None
    maximum: float | None
    description: str | None
    items: dict[str, int]
    """The names and numbers of an enumeration."""


def build(
    configuration: Configuration,
    output: str | os.PathLike[str],
    *,
    library: str | os.PathLike[str] | None = None,
) -> Path:
    """Makes the FMU of a filter, plant or controller at `output`, and tries it; returns its path.

    - `configuration`: the path of a TOML file, or a dict with the same content. A plug-in is looked for beside the
      file; for a dict in the current folder.
    - `library`: the shared library to put inside. Default: the one of this package.

    Raises `Error` for a configuration that cannot be used, with the field, the value and what is allowed; for a file
    that cannot be written; for a product that does not work.
    """
    more = [] if library is None else ["--library", library]
    with configuration_file(configuration) as file:
        run_for([(configuration, file)], "build", file, "-o", output, *more)
    return Path(output)


def check(
    configuration: Configuration,
    *,
    plant: Configuration | None = None,
    x0: Mapping[str, float] | None = None,
    u_ref: str | Mapping[str, float] = "none",
    effort: bool = False,
) -> dict[str, Any]:
    """Findings of `punctual check --json` on a configuration: relative degrees, rates, warnings. From a start also
    whether the promise holds, in a simulated closed loop too, and whether the bounds allow it.

    - `plant`: a plant configuration, whose start it is; or
    - `x0`: the start by state; those not named are 0.
    - `u_ref`: of the closed loop that is simulated from there: `"none"`, `"damping"`, or values by input.
    - `effort`: also finds the least bound on the inputs that meets the deadline from there.

    Raises `Error` for a configuration that cannot be used.
    """
    with ExitStack() as stack:
        file = stack.enter_context(configuration_file(configuration))
        given = [(configuration, file)]
        more: list[str | os.PathLike[str]] = ["--effort"] if effort else []
        if plant is not None:
            given.append((plant, stack.enter_context(configuration_file(plant))))
            more += ["--plant", given[-1][1]]
        if x0 is not None:
            more += ["--x0", ",".join(f"{name}={float(value)!r}" for name, value in x0.items())]
        wanted = u_ref if isinstance(u_ref, str) else ",".join(f"{n}={float(v)!r}" for n, v in u_ref.items())
        more += ["--u-ref", wanted]
        # 1: it cannot be kept from there, which the report says.
        text = run_for(given, "check", file, "--json", *more, accepted=(0, 1))
    report: dict[str, Any] = json.loads(text)
    return report


def run_for(
    given: list[tuple[Configuration, Path]],
    *arguments: str | os.PathLike[str],
    accepted: tuple[int, ...] = (0,),
) -> str:
    """Runs the command line for configurations and their files; the names of temporary ones are left out of errors."""
    temporary = [(configuration, f"{file}: ") for configuration, file in given if isinstance(configuration, Mapping)]
    try:
        return run(arguments, accepted, tuple(head for _, head in temporary))
    except Error as error:
        reason = str(error)
        for configuration, head in temporary:
            reason = with_function(reason.replace(head, ""), configuration)
        raise Error(reason) from None


def variables(fmu: str | os.PathLike[str]) -> list[Variable]:
    """The variables of any FMI 2.0 co-simulation FMU, in the order of its model description.

    Raises `Error` for a file that is none.
    """
    report = json.loads(run(("inspect", "--json", fmu), accepted=(0,)))
    return [_variable(row) for row in report["variables"]]


def _variable(row: dict[str, Any]) -> Variable:
    start: Value | None = row["start"]
    if isinstance(start, str):
        match row["type"]:
            case "Real":
                start = float(start)
            case "Integer" | "Enumeration":
                start = int(start)
            case "Boolean":
                start = start in ("true", "1")
    return Variable(
        name=row["name"],
        value_reference=row["value_reference"],
        type=row["type"],
        causality=row["causality"],
        variability=row["variability"],
        unit=row["unit"],
        start=start,
        minimum=row["min"],
        maximum=row["max"],
        description=row["description"],
        items=dict(row.get("items", [])),
    )
