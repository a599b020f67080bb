"""An instance of an FMU in FMPy, called past its methods, which make lists and arrays at every call."""

from __future__ import annotations

import ctypes
import math
import os
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any

from ._error import Error

KINDS = {"Real": "Real", "Integer": "Integer", "Enumeration": "Integer", "Boolean": "Boolean"}
"""The types that are moved, and the part of the functions' names that moves them."""

_WARNING = 1  # fmi2Warning: the last status with which a run goes on


class Call(partial[int]):
    """A call of an FMI function with its arguments, to be made again and again; returns the status."""

    slave: Slave


def make(calls: Iterable[Call], time: float | None = None) -> None:
    """Makes the calls; raises `Error` at the first that returns more than a warning."""
    for call in calls:
        status = call()
        if status > _WARNING:
            raise call.slave.refused(call.func.__name__, status, time)


class Slave:
    """An instantiated FMU: its variables by name, and calls that are ready to be made again and again."""

    def __init__(self, name: str, fmu: Any, description: Any) -> None:
        self.name = name
        self._fmu, self._said = fmu, ""
        self.warned: list[str] = []
        """What it warned of."""
        self.variables: dict[str, Any] = {v.name: v for v in description.modelVariables}
        experiment = description.defaultExperiment
        self.suggested_start = float((experiment and experiment.startTime) or 0.0)
        self.suggested_step = float((experiment and experiment.stepSize) or math.inf)
        self._bases = {unit.name: unit.baseUnit for unit in description.unitDefinitions}
        depends = {o.variable.name: o.dependencies for o in description.outputs}
        self.direct = {
            output
            for output, on in depends.items()
            if on is None or any(variable.causality == "input" for variable in on)
        }
        """The outputs that depend on an input at the same instant; one that declares nothing depends on all."""

    def instantiate(self) -> None:
        from fmpy import fmi2

        callbacks = fmi2.fmi2CallbackFunctions()
        callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(self._log)
        callbacks.allocateMemory = fmi2.defaultCallbacks.allocateMemory
        callbacks.freeMemory = fmi2.defaultCallbacks.freeMemory
        try:
            self._fmu.instantiate(callbacks=callbacks, loggingOn=True)
        except Exception as error:
            raise Error(f"fmi2Instantiate of the {self.name} was refused: {self._said or error}") from None

    def _log(self, _: Any, _name: Any, status: int, _category: Any, message: bytes | None) -> None:
        if status > _WARNING and message:
            self._said = message.decode(errors="replace")
        elif status == _WARNING and message:
            self.warned.append(message.decode(errors="replace"))

    def names(self, causality: str, kind: str | None = None) -> list[str]:
        """The variables of a causality that are moved, of one kind or of all, in the order of the file."""
        kinds = {v.name: KINDS.get(v.type) for v in self.variables.values() if v.causality == causality}
        return [name for name, own in kinds.items() if own and kind in (None, own)]

    def kind(self, name: str) -> str:
        return KINDS[self.variables[name].type]

    def unit(self, name: str) -> tuple[str | None, tuple[list[int], float, float] | None, bool]:
        """What is said of the unit of a variable, as `fit_units` takes it."""
        variable = self.variables[name]
        told = [variable, *([variable.declaredType] if variable.declaredType else [])]
        unit = next((of.unit for of in told if of.unit), None)
        base = self._bases.get(unit)
        exponents = [int(getattr(base, of)) for of in ("kg", "m", "s", "A", "K", "mol", "cd", "rad")] if base else []
        return (
            unit,
            (exponents, float(base.factor), float(base.offset)) if base else None,
            any(of.relativeQuantity in (True, "true", "1") for of in told),
        )

    def prepared(self, function: str, *arguments: Any) -> Call:
        """The call of `function` on this instance; `arguments` are objects of ctypes."""
        # A new object has no argument types, so that ctypes converts nothing.
        call = Call(self._fmu.dll[function], ctypes.c_void_p(self._fmu.component), *arguments)
        call.slave = self
        return call

    def moved(self, function: str, names: Sequence[str], values: Any) -> list[Call]:
        """The call that moves the variables `names` from or to `values`; none for no variables."""
        if not names:
            return []
        references = (ctypes.c_uint * len(names))(*(self.variables[n].valueReference for n in names))
        return [self.prepared(function, references, ctypes.c_size_t(len(names)), values)]

    def refused(self, function: str, status: int, time: float | None) -> Error:
        """The error for a call that returned `status`."""
        when = "" if time is None else f" at t = {round(time, 9):g} s"
        reason = self._said.removeprefix(f"{function}: ") or f"status {status}"
        return Error(f"{function} of the {self.name}{when} was refused: {reason}")

    def begin(self, begin: float, stop: float, start: Mapping[str, float]) -> None:
        """Sets start values, and enters initialization mode."""
        no, yes = ctypes.c_int(0), ctypes.c_int(1)
        setup = (no, ctypes.c_double(0.0), ctypes.c_double(begin), yes, ctypes.c_double(stop))
        make([self.prepared("fmi2SetupExperiment", *setup)])
        for name, value in start.items():
            kind = self.kind(name)
            values = (ctypes.c_double * 1)(value) if kind == "Real" else (ctypes.c_int * 1)(int(value))
            make(self.moved(f"fmi2Set{kind}", [name], values))
        make([self.prepared("fmi2EnterInitializationMode")])


@contextmanager
def opened(name: str, path: str | os.PathLike[str]) -> Iterator[Slave]:
    """An instance of the FMU at `path`, called `name` in errors, which is freed in the end.

    Raises `ImportError` without FMPy; `Error` for a file that is no FMI 2.0 co-simulation FMU that can be loaded.
    """
    try:
        import fmpy
        from fmpy import fmi2
    except ImportError as error:
        raise ImportError("punctual.simulate needs FMPy: pip install fmpy") from error
    with tempfile.TemporaryDirectory(prefix="punctual-") as folder:
        try:
            description = fmpy.read_model_description(os.fspath(path))
            if description.fmiVersion != "2.0" or description.coSimulation is None:
                raise Error("is no FMI 2.0 co-simulation FMU")
            fmu = fmi2.FMU2Slave(
                guid=description.guid,
                unzipDirectory=fmpy.extract(os.fspath(path), folder),
                modelIdentifier=description.coSimulation.modelIdentifier,
                instanceName=name,
            )
        except OSError:
            raise
        except Exception as error:  # FMPy has no types of its own.
            raise Error(f"{os.fspath(path)}: {error}") from error
        slave = Slave(name, fmu, description)
        slave.instantiate()
        try:
            yield slave
        finally:
            fmu.freeInstance()
