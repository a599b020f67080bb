"""The plan of a filter from a start."""

from __future__ import annotations

from collections.abc import Mapping

from numpy.typing import ArrayLike

from ._configuration import Configuration
from ._error import Error
from ._punctual import Filter, Plan


def plan(configuration: Configuration, x0: ArrayLike | Mapping[str, float]) -> Plan:
    """The plan of a filter from a start: inputs within the bounds that keep every promise, and the way that they lead.

    It begins at `experiment.start_time`, as `check` does.

    - `x0`: the start, in the units of the states: by state, those not named are 0; or all in the order of `Filter.states`.

    Raises `Error` where there is none, with the barrier that fails and when; for a configuration that cannot be used; for
    a filter that follows no plans; for a state that is unknown. Raises `TypeError` or `ValueError` for an array of another
    type or shape.
    """
    filter = Filter(configuration)
    if isinstance(x0, Mapping):
        for name in x0:
            if name not in filter.states:
                raise Error(f"x0.{name}: unknown state, must be one of {', '.join(filter.states)}")
        x0 = [x0.get(name, 0.0) for name in filter.states]
    step = filter.step(filter.start_time, x0)
    found = filter.plan
    if found is None:
        if step.assurance is None:
            raise Error("assurance: this filter follows no plans; every input needs bounds, and `check` says what else")
        raise Error(f"x0: there is no plan from here: {filter.refusal or step.status.name}")
    return found
