"""A filter FMU and a plant FMU in FMPy, coupled as `punctual run` does it and with the same bits."""

from __future__ import annotations

import ctypes
import math
import os
import warnings
from collections.abc import Callable, Mapping, Sequence
from itertools import accumulate, chain
from typing import TYPE_CHECKING, Any, TypeAlias

from ._command import warn
from ._error import Error
from ._punctual import fit_units
from ._slave import Call, Slave, make, opened

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    _Term: TypeAlias = tuple[str, float] | tuple[str, float, float]
    _Vector: TypeAlias = NDArray[np.float64]
    _Nominal: TypeAlias = Mapping[str, _Term] | Callable[[float, _Vector], Sequence[float] | _Vector]

_WHOLE = 1e-6  # steps by which an experiment may differ from a whole number of them, as in `punctual run`


def simulate(
    filter_fmu: str | os.PathLike[str],
    plant_fmu: str | os.PathLike[str],
    *,
    stop_time: float,
    step_size: float,
    start_time: float | None = None,
    start: Mapping[str, float] | None = None,
    nominal: _Nominal | None = None,
    parameters: Mapping[str, float] | None = None,
    record: Sequence[str] | None = None,
) -> NDArray[np.void]:
    """Couples a filter FMU with a plant FMU in FMPy from `start_time` to `stop_time` in steps of `step_size` (s).

    Equal names connect: `x.v` of the plant to `x.v` of the filter, `u.a` of the filter to `u.a` of the plant. Where their
    units differ, values are converted, which a warning tells; so does one of units that cannot be compared. At every
    communication point the filter is stepped first, then the plant with what the filter gives: the calls of
    `punctual run` in Gauss-Seidel order, and the same numbers bit for bit.

    - `start_time`: default: that of the filter's default experiment (`experiment.start_time`), or 0.
    - `start`: start values of the plant by name; `v` is short for `x0.v`. Also of inputs that the filter does not give.
    - `nominal`: the wanted input. A dict of terms that are linear in what the plant gives, such as `{"a": ("v", -1.0)}`
      for u_ref.a = -1.0 x.v, or with an offset `("v", -1.0, 3.0)`; or a function of the time in s and of what the plant
      gives to the filter (an array in the order of the filter's inputs, the states first; valid during the call) that
      returns all of u_ref. In the filter's units where the plant has others. Default: the start values of u_ref, zeros.
    - `parameters`: start values of the filter by name, such as `{"goal.deadline": 8.0}`; also of inputs that the plant
      does not give. Without direct feedthrough the filter's input acts a step late: `actuation_delay` is then the step,
      unless given here or in the filter's file.
    - `record`: the names of what is returned. Default: all outputs of the plant, `u_ref.*` and all outputs of the
      filter, but texts and the Integer twins of enumerations (`status_code`). Where both have an output of one name, the plant's is called `plant.<name>`.

    Returns an array with the field `time` and one for each recorded variable, a row for each communication point: as
    FMPy's `simulate_fmu` does, so that its `plot_result` and `write_csv` take it. `promise` judges a barrier.

    Raises `ImportError` without FMPy (`pip install fmpy`); `Error` for names, units or numbers that do not fit, an
    input that nothing feeds, and a call that an FMU refuses.
    """
    if not 0.0 < step_size < math.inf:
        raise Error(f"step_size: is {step_size}, must be finite and > 0")
    with opened("filter", filter_fmu) as own, opened("plant", plant_fmu) as plant:
        for text in own.warned:
            warn(text)
        begin = own.suggested_start if start_time is None else float(start_time)
        if not math.isfinite(begin):
            raise Error(f"start_time: is {begin}, must be finite")
        if not begin < stop_time < math.inf:
            raise Error(f"stop_time: is {stop_time}, must be finite and > start_time = {begin}")
        starts = _starts(own, "parameters", parameters or {}), _starts(plant, "start", start or {})
        _account_for_delay(own, starts[0], step_size)
        pair = _Pair(own, plant, starts, record)
        pair.wish(nominal)
        pair.begin(begin, stop_time)
        return pair.run(begin, stop_time, step_size)


def _starts(slave: Slave, field: str, given: Mapping[str, float]) -> dict[str, float]:
    """Start values by the full names of parameters and inputs."""
    known = [*slave.names("parameter"), *slave.names("input")]
    starts = {}
    for name, value in given.items():
        full = next((full for full in (name, f"x0.{name}") if full in known), None)
        if full is None:
            raise Error(f"{field}: {name!r} is not a parameter or input of the {slave.name}, which has {', '.join(known)}")
        starts[full] = float(value)
    return starts


def _account_for_delay(own: Slave, starts: dict[str, float], step_size: float) -> None:
    """Tells a filter whose input acts a step late by how much, if it can account for that and nothing else was said."""
    delay = own.variables.get("actuation_delay")
    is_told = "actuation_delay" in starts or "actuation_delay" not in own.names("parameter")
    if own.direct or delay is None or is_told or float(delay.start or 0.0) > 0.0:
        return
    if step_size <= own.suggested_step * (1.0 + 1e-9):
        # No longer than the step that the filter is made for, not even by round-off.
        starts["actuation_delay"] = min(step_size, own.suggested_step)


def _check_fed(slave: Slave, field: str, fed: Sequence[str], other: Slave) -> None:
    """Refuses inputs that nothing feeds: they would be 0 without a word."""
    loose = [name for name in slave.names("input", "Real") if name not in fed]
    if loose:
        raise Error(
            f"{', '.join(loose)} of the {slave.name}: the {other.name} has no output of that name, only"
            f" {', '.join(other.names('output', 'Real'))}; the value of what stays the same belongs into `{field}`"
        )


def _scales(giver: Slave, taker: Slave, names: Sequence[str], notes: list[str]) -> dict[str, tuple[float, float]]:
    """Factor and offset of each of `names`, an output of one and an input of the other, if any of them has another unit."""
    scales = {}
    for name in names:
        given, taken = giver.unit(name), taker.unit(name)
        words = given[0] or "no unit", taken[0] or "no unit"
        try:
            scale = fit_units(given, taken)
        except ValueError as why:
            raise Error(
                f"{name} is in {words[0]} in the {giver.name}, but in {words[1]} in the {taker.name}, {why}"
            ) from None
        if scale is None:
            notes.append(f"{name} of the {giver.name} as it is, since {words[0]} and {words[1]} cannot be compared")
        elif scale != (1.0, 0.0):
            plus = f" plus {scale[1]:.6g}" if scale[1] else ""
            notes.append(f"{name} of the {giver.name} from {words[0]} to {words[1]} (times {scale[0]:.6g}{plus})")
        scales[name] = scale or (1.0, 0.0)
    return scales if any(scale != (1.0, 0.0) for scale in scales.values()) else {}


def _columns(own: Slave, plant: Slave, record: Sequence[str] | None) -> dict[str, tuple[Slave, str]]:
    """The recorded variables, by the names of the result's fields."""
    outputs = own.names("output")
    columns = {f"plant.{n}" if n in outputs else n: (plant, n) for n in plant.names("output")}
    columns |= {n: (own, n) for n in own.names("input", "Real") if n.startswith("u_ref.")}
    columns |= {n: (own, n) for n in outputs}
    unknown = [name for name in record or [] if name not in columns]
    if unknown:
        raise Error(f"record: {unknown[0]!r} is none of {', '.join(columns)}")
    twins = {f"{v.name}_code" for slave in (own, plant) for v in slave.variables.values() if v.type == "Enumeration"}
    return {name: columns[name] for name in ([n for n in columns if n not in twins] if record is None else record)}


class _Pair:
    """A filter and a plant, with the memory between them.

    All reals lie in one array, in five parts, so that every call reads or writes one stretch of it and nothing is
    copied from one FMU to the other, unless units differ:

        others | connected | u_ref | seen | driving
        ------ plant gives |       |- filter gives |
               |- filter takes ----|      |- plant takes

    Where a value that the plant gives has to be converted, all of them are among the others too, in its units; where one
    that the filter gives, all of these are among the seen.

    Integers, then Booleans, lie in a second one.
    """

    def __init__(
        self, own: Slave, plant: Slave, starts: tuple[dict[str, float], dict[str, float]], record: Sequence[str] | None
    ) -> None:
        import numpy

        self.own, self.plant, self.starts = own, plant, starts
        self.columns = _columns(own, plant, record)
        gives, takes, answers = plant.names("output", "Real"), own.names("input", "Real"), own.names("output", "Real")
        connected = [n for n in takes if n in gives]
        self.wanted = [n for n in takes if n.startswith("u_ref.") and n not in connected]
        driving = [n for n in plant.names("input", "Real") if n in answers]
        _check_fed(own, "parameters", [*connected, *self.wanted, *starts[0]], plant)
        _check_fed(plant, "start", [*driving, *starts[1]], own)

        notes: list[str] = []
        into, out = _scales(plant, own, connected, notes), _scales(own, plant, driving, notes)
        if notes:
            warnings.warn(f"units: {'; '.join(notes)}", stacklevel=3)
        seen = [n for n in answers if (n in out or n not in driving) and (n in out or (own, n) in self.columns.values())]
        others = [n for n in gives if n in into or n not in connected]
        parts = [others, connected, self.wanted, seen, driving]
        ends = list(accumulate(map(len, parts), initial=0))
        self.values = (ctypes.c_double * ends[-1])()
        self.reals = numpy.ctypeslib.as_array(self.values)
        names = list(chain(*parts))
        owners = [plant] * ends[1] + [own if into else plant] * len(connected) + [own] * (ends[4] - ends[2])
        owners += [plant if out else own] * len(driving)
        self.slots = {(owner, name): i for i, (owner, name) in enumerate(zip(owners, names))}
        self.x, self.u_ref = self.reals[ends[1] : ends[2]], slice(ends[2], ends[3])
        self.x.flags.writeable = False
        for name in self.wanted:
            self.values[self.slots[own, name]] = starts[0].get(name, float(own.variables[name].start or 0.0))

        def stretch(function: str, slave: Slave, first: int, last: int) -> list[Call]:
            moved = names[ends[first] : ends[last]]
            at = (ctypes.c_double * len(moved)).from_buffer(self.values, 8 * ends[first]) if moved else None
            return slave.moved(function, moved, at)

        self.give = [*stretch("fmi2GetReal", plant, 0, 1 if into else 2), *self._converted(plant, own, into)]
        self.take = stretch("fmi2SetReal", own, 1, 3)
        self.answer = [*stretch("fmi2GetReal", own, 3, 4 if out else 5), *self._converted(own, plant, out)]
        self.drive = stretch("fmi2SetReal", plant, 4, 5)
        self._add_numbers()

    def _converted(self, giver: Slave, taker: Slave, scales: Mapping[str, tuple[float, float]]) -> list[Call]:
        """The call that converts what one gives to what the other takes; none where nothing is to be converted."""
        moves = [(self.slots[taker, name], self.slots[giver, name], *scale) for name, scale in scales.items()]

        def convert() -> int:
            values = self.values
            for to, at, factor, offset in moves:
                value = factor * values[at]
                # Adding 0 would change the sign of -0.
                values[to] = value if offset == 0.0 else value + offset
            return 0

        return [Call(convert)] if moves else []

    def _add_numbers(self) -> None:
        """The integers and Booleans that are recorded."""
        import numpy

        kinds = [(slave, kind) for slave in (self.own, self.plant) for kind in ("Integer", "Boolean")]
        groups = [[n for o, n in self.columns.values() if o is slave and slave.kind(n) == kind] for slave, kind in kinds]
        memory = (ctypes.c_int * sum(map(len, groups)))()
        self.numbers = numpy.ctypeslib.as_array(memory)
        at = 0
        for (slave, kind), group in zip(kinds, groups):
            self.slots |= {(slave, name): at + i for i, name in enumerate(group)}
            if group:
                values = (ctypes.c_int * len(group)).from_buffer(memory, 4 * at)
                (self.answer if slave is self.own else self.give).extend(slave.moved(f"fmi2Get{kind}", group, values))
            at += len(group)

    def wish(self, nominal: _Nominal | None) -> None:
        """Makes `self.want(t)`, which writes u_ref."""
        values, x, place = self.values, self.x, self.u_ref
        if callable(nominal):

            def function(t: float) -> None:
                wanted = nominal(t, x)
                # Of an array: complex numbers would lose their imaginary part.
                kind = getattr(getattr(wanted, "dtype", None), "kind", "f")
                try:
                    if kind not in "fiu":
                        raise TypeError
                    values[place] = list(wanted)
                except (TypeError, ValueError):
                    names = ", ".join(self.wanted)
                    raise Error(f"nominal: is {wanted!r} at t = {t:g} s, must be real numbers for {names}") from None

            self.want: Callable[[float], None] = function
            return
        terms = [self._term(name, *term) for name, term in (nominal or {}).items()]

        def linear(_: float) -> None:
            for to, at, factor, offset in terms:
                value = factor * values[at]
                # Adding 0 would change the sign of -0.
                values[to] = value if offset == 0.0 else value + offset

        self.want = linear

    def _term(self, name: str, source: str, factor: float, offset: float = 0.0) -> tuple[int, int, float, float]:
        full = next((n for n in self.wanted if n in (name, f"u_ref.{name}")), None)
        if full is None:
            raise Error(f"nominal: {name!r} is none of {', '.join(self.wanted)}")
        gives = self.plant.names("output", "Real")
        output = next((n for n in (source, f"x.{source}") if n in gives), None)
        if output is None:
            raise Error(f"nominal.{name}: {source!r} is not an output of the plant, which has {', '.join(gives)}")
        # Converted, where the filter takes it in another unit.
        at = self.slots.get((self.own, output), self.slots[self.plant, output])
        return self.slots[self.own, full], at, float(factor), float(offset)

    def begin(self, begin: float, stop: float) -> None:
        """Start values, then initialization mode: values are passed on until they stay the same."""
        for slave, starts in zip((self.own, self.plant), self.starts):
            slave.begin(begin, stop, starts)
        before = None
        # Enough for two.
        for _ in range(3):
            make(self.give)
            self.want(begin)
            make(chain(self.take, self.answer, self.drive))
            now = bytes(self.reals) + bytes(self.numbers)
            if now == before:
                break
            before = now
        for slave in (self.own, self.plant):
            make([slave.prepared("fmi2ExitInitializationMode")])
        make(self.give if self.own.direct else [*self.answer, *self.give])

    def run(self, begin: float, stop: float, step: float) -> NDArray[np.void]:
        """Steps to the stop time; returns the rows."""
        import numpy

        ratio = (stop - begin) / step
        whole = round(ratio) >= 1 and abs(ratio - round(ratio)) <= _WHOLE
        steps = round(ratio) if whole else max(math.ceil(ratio), 1)
        times = numpy.append(begin + numpy.arange(steps) * step, stop)
        reals = numpy.empty((steps + 1, len(self.reals)))
        numbers = numpy.empty((steps + 1, len(self.numbers)), numpy.int32)

        now, length = ctypes.c_double(), ctypes.c_double(step)
        own, plant = (s.prepared("fmi2DoStep", now, length, ctypes.c_int(1)) for s in (self.own, self.plant))
        if self.own.direct:
            before, after = [*self.take, own, *self.answer, *self.drive], [plant, *self.give]
            last = [*self.take, *self.answer, *self.drive]
        else:
            before = last = [*self.take, *self.drive]
            after = [own, plant, *self.answer, *self.give]
        for k, t in enumerate(times[:-1].tolist()):
            now.value = t
            if k == steps - 1 and not whole:
                length.value = stop - t
            self.want(t)
            make(before, t)
            reals[k] = self.reals
            numbers[k] = self.numbers
            make(after, t)
        self.want(stop)
        make(last, stop)
        reals[steps], numbers[steps] = self.reals, self.numbers
        make(slave.prepared("fmi2Terminate") for slave in (self.own, self.plant))
        return self._rows(times, reals, numbers)

    def _barriers(self) -> dict[str, Any]:
        """Needs of `promise` on each barrier: its deadline, the units of h and its slack, whether h is not late."""
        variables, starts = self.own.variables, self.starts[0]
        barriers = {}
        for name in (n.removesuffix(".unmet_steps") for n in variables if n.endswith(".unmet_steps")):
            key = f"{name}.deadline"
            own = starts.get(key, float(variables[key].start)) if key in variables else None
            told = [variables.get(f"{name}.{field}") for field in ("h", "slack")]
            units = tuple((v and v.unit) or "1" for v in told)
            barriers[name] = own, units, f"{name}.h" in self.own.direct
        return barriers

    def _rows(self, times: NDArray[Any], reals: NDArray[Any], numbers: NDArray[Any]) -> NDArray[np.void]:
        """The recorded columns, each in its type."""
        import numpy

        types = {"Real": numpy.float64, "Integer": numpy.int32, "Boolean": numpy.bool_}
        kinds = {field: slave.kind(name) for field, (slave, name) in self.columns.items()}
        fields = [("time", numpy.float64), *((field, types[kind]) for field, kind in kinds.items())]
        rows = numpy.empty(len(times), numpy.dtype(fields, metadata={"punctual": self._barriers()}))
        rows["time"] = times
        for field, port in self.columns.items():
            source = reals if kinds[field] == "Real" else numbers
            rows[field] = source[:, self.slots[port]]
        return rows
