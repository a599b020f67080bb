"""Runs of a campaign with its FMUs under FMPy: the calls of `punctual run` and the rows of `punctual campaign`.

For any pool of processes, with any importer in the place of FMPy. `punctual.campaign` is faster by far.
"""

import ctypes
import math
import tomllib
from pathlib import Path

from fmpy import extract, fmi2, read_model_description

KINDS = {"Real": "Real", "Integer": "Integer", "Enumeration": "Integer", "Boolean": "Boolean"}
BARRIER = ["h", "phase", "unmet_steps", "slack", "deadline_unreachable"]
ABSTENTIONS = ["invalid_input", "singular", "wrong_relative_degree", "solver_failed"]  # nothing was enforced
SAME_TIME = 1e-9  # round-off of a time, as a part of it where that is more than 1 s
TOLERANCE, LEAST_TOLERANCE = 1e-9, 1e-12  # round-off of h, as a part of the largest |h| seen, and at least
WHOLE = 1e-6  # steps by which an experiment may differ from a whole number of them


class Refused(Exception):
    """A call that returned neither OK nor Warning."""


class Group:
    """Variables of a block that are read or written by one call for each type, through arrays made once."""

    def __init__(self, block, names):
        self.block, self.parts, self.slots = block, [], {}
        for kind in dict.fromkeys(KINDS.values()):
            chosen = [n for n in block.variables if n in names and KINDS.get(block.variables[n].type) == kind]
            values = ((ctypes.c_double if kind == "Real" else ctypes.c_int) * len(chosen))()
            references = (ctypes.c_uint * len(chosen))(*(block.variables[n].valueReference for n in chosen))
            if chosen:
                self.parts.append((f"fmi2Get{kind}", f"fmi2Set{kind}", references, len(chosen), values))
            self.slots |= {name: (values, i) for i, name in enumerate(chosen)}

    def read(self):
        for get, _, references, n, values in self.parts:
            self.block.call(get, references, n, values)

    def write(self):
        for _, set_, references, n, values in self.parts:
            self.block.call(set_, references, n, values)


class Block:
    """An instance of the FMU at `path` with the links of the system."""

    def __init__(self, component, path, links):
        self.name, self.start, self.said, self.time = component["name"], component.get("start", {}), "", 0.0
        description = read_model_description(path)
        self.variables = {v.name: v for v in description.modelVariables}
        self.fmu = fmi2.FMU2Slave(
            guid=description.guid,
            unzipDirectory=extract(path, f"{path}.folder"),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName=self.name,
        )
        callbacks = fmi2.fmi2CallbackFunctions()
        callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(self.log)
        self.fmu.instantiate(callbacks=callbacks, loggingOn=True)
        self.barriers = [n.removesuffix(".unmet_steps") for n in self.variables if n.endswith(".unmet_steps")]
        self.efforts = [n for n in self.variables if n.startswith("u.") and self.barriers]
        read = {f"{b}.{field}" for b in self.barriers for field in BARRIER} | set(self.efforts) | {"status", "assurance"}
        read |= {link["from"][1] for link in links if link["from"][0] == self.name}
        outputs = {n for n in read if n in self.variables and self.variables[n].causality == "output"}
        direct = feedthrough(description)
        self.states, self.direct = Group(self, outputs - direct), Group(self, outputs & direct)
        self.inputs = Group(self, {link["to"][1] for link in links if link["to"][0] == self.name})
        self.outputs = self.states.slots | self.direct.slots
        self.is_direct = bool(direct)

    def log(self, _, name, status, category, message):
        if status > 1:
            self.said = message.decode()

    def call(self, name, *arguments):
        # The library's function itself, since FMPy's methods make lists.
        if getattr(self.fmu.dll, name)(self.fmu.component, *arguments) > 1:
            reason = self.said.removeprefix(f"{name}: ")
            raise Refused(f"{name} of {self.name} at t = {round(self.time, 9):g} s was refused: {reason}")

    def connect(self, blocks, links):
        self.sources = [
            (*self.inputs.slots[to], *blocks[giver].outputs[output], link.get("factor", 1.0), link.get("offset", 0.0))
            for link in links
            for (giver, output), (reader, to) in [(link["from"], link["to"])]
            if reader == self.name
        ]

    def take_inputs(self):
        for to, i, values, j, factor, offset in self.sources:
            value = values[j] if factor == 1.0 else factor * values[j]
            to[i] = value if offset == 0.0 else value + offset
        self.inputs.write()

    def step(self, time, step):
        self.time = time
        self.call("fmi2DoStep", time, step, 1)

    def begin(self, start, stop, values):
        self.time = start
        self.call("fmi2Reset")
        self.call("fmi2SetupExperiment", 0, 0.0, start, 1, stop)
        for name, value in (self.start | values).items():
            group = Group(self, {name})
            group.slots[name][0][0] = value
            group.write()
        self.call("fmi2EnterInitializationMode")


def powers(unit):
    """The exponents of a unit such as kg.m/s2."""
    exponents = {}
    for part, sign in zip((unit or "1").split("/"), [1, -1]):
        for factor in part.split("."):
            symbol = factor.rstrip("0123456789")
            if symbol:
                exponents[symbol] = exponents.get(symbol, 0) + sign * int(factor[len(symbol) :] or 1)
    return {symbol: exponent for symbol, exponent in exponents.items() if exponent}


class Judge:
    """The verdict on a promise, by h itself: the Judge of the library, line by line (docs/configuration.md)."""

    def __init__(self, deadline, straight):
        self.after, self.points = deadline if math.isfinite(deadline) else None, 1 if straight else 3
        self.before, self.size, self.left_before, self.certain = [], 0.0, None, None
        self.due = self.released = self.began_inside = self.reached = self.outside = False
        self.began = self.deadline = self.arrival = self.late = self.left = self.least = None

    def inside(self, h):
        return h >= -max(TOLERANCE * self.size, LEAST_TOLERANCE)

    def see(self, t, h, promise_state, lost):
        if self.released or not self.before and not math.isfinite(h):
            return
        if not self.before:
            self.deadline = None if self.after is None else t + self.after
        if math.isfinite(h):
            self.size = max(self.size, abs(h))
        if lost and self.certain is None:
            self.certain = t
        if promise_state != "waiting" and self.began is None:
            self.began, self.began_inside = t, self.inside(h)
        self.follow(t, h)
        self.judge(t, h)
        always = self.began_inside and promise_state != "waiting"
        if promise_state != "released" and (always or self.due):
            self.weigh(h)
            if not self.inside(h) and self.arrival is not None and self.left is None:
                at = self.left_before
                self.left = at if at is not None and (always or at >= self.deadline) else t
        self.released = promise_state == "released"
        self.reached |= self.released and self.arrival is not None
        self.before = [(t, h), *self.before[:2]]

    def follow(self, t, h):
        inside, was_inside = self.inside(h), self.inside(self.before[0][1]) if self.before else None
        if inside and self.began is not None and self.arrival is None:
            self.arrival = max(self.crossing(t, h) if was_inside is False else t, self.began)
        if not inside and was_inside and self.arrival is not None:
            self.left_before = self.crossing(t, h)

    def judge(self, t, h):
        if self.due or self.deadline is None:
            return
        same = SAME_TIME * max(abs(self.deadline), 1.0)
        if t < self.deadline - same:
            return
        self.due, now = True, h
        if self.before and t > self.deadline + same:
            last = self.before[0][1]
            both = self.inside(last) and self.inside(h)
            now = min(last, h) if both else self.between(self.deadline, t, h)
        self.weigh(now)
        if not self.inside(now) and not self.began_inside:
            if self.arrival is not None and self.arrival < self.deadline:
                self.left = self.deadline if self.left_before is None else self.left_before
            else:
                self.late = self.deadline if self.certain is None else self.certain

    def weigh(self, h):
        self.reached = True
        self.outside |= not self.inside(h)
        if self.least is None or h < self.least or self.least != self.least:
            self.least = h

    def crossing(self, t, h):
        if not self.before:
            return t
        start, first = self.before[0]
        if not (math.isfinite(first) and math.isfinite(h)) or (first < 0.0) == (h < 0.0):
            return t
        end, rising = t, h > first
        for _ in range(64):
            middle = 0.5 * (start + end)
            if (self.between(middle, t, h) < 0.0) == rising:
                start = middle
            else:
                end = middle
        return end

    def between(self, at, t, h):
        points = [(t, h), *self.before[: self.points]]
        values = [h for _, h in points]
        for width in range(1, len(points)):
            for i in range(len(points) - width):
                a, b = points[i][0], points[i + width][0]
                values[i] += (values[i + 1] - values[i]) * (at - a) / (b - a)
        return values[0]

    def missed(self):
        """The time at which it became certain that the deadline is missed."""
        return self.late if self.due or self.began_inside or self.late is not None else self.certain

    def on_time(self):
        limit = self.began if self.began_inside else self.deadline
        known = limit is not None and self.arrival is not None
        return known and self.arrival <= limit + SAME_TIME * max(abs(limit), 1.0)

    def kept(self):
        return self.on_time() and self.reached and not self.outside and self.missed() is None


class Filter:
    """The row of a filter in a run, as docs/campaign.md says under "The rows"."""

    def __init__(self, block, values):
        self.block = block
        self.statuses = items(block, "status")
        self.assurances = items(block, "assurance") if "assurance" in block.outputs else {}
        self.abstentions = {self.statuses[name] for name in ABSTENTIONS}
        self.waiting = self.statuses["not_armed"]
        self.counts = dict.fromkeys(self.statuses.values(), 0)
        self.counted = dict.fromkeys(self.assurances.values(), 0)
        self.peaks = dict.fromkeys(block.efforts, 0.0)
        self.barriers = {}
        for name in block.barriers:
            key = f"{name}.deadline"
            own = block.variables[key].start if key in block.variables else math.inf
            units = [block.variables[f"{name}.{field}"].unit for field in ("h", "slack")]
            straight = {k: v for k, v in (powers(units[0]) | {"s": powers(units[0]).get("s", 0) - 1}).items() if v}
            judge = Judge(float((block.start | values).get(key, own)), straight == powers(units[1]))
            kept = dict(judge=judge, started=False, unmet=0, longest=0, violation=0.0, row=0)
            slots = [block.outputs[f"{name}.{field}"] for field in BARRIER]
            self.barriers[name] = (kept, slots, items(block, f"{name}.phase"))

    def see(self, time):
        outputs = self.block.outputs
        array, i = outputs["status"]
        status = array[i]
        self.counts[status] += 1
        if self.counted:
            array, i = outputs["assurance"]
            self.counted[array[i]] += 1
        for name, peak in self.peaks.items():
            array, i = outputs[name]
            if abs(array[i]) > peak:
                self.peaks[name] = abs(array[i])
        for kept, slots, phases in self.barriers.values():
            h, phase, unmet, slack, late = [array[i] for array, i in slots]
            kept["started"] |= status not in self.abstentions and status != self.waiting
            if kept["started"]:
                promise_state = {phases["released"]: "released", phases["waiting"]: "waiting"}.get(phase, "in force")
                kept["judge"].see(time, h, promise_state, bool(late) or phase == phases["late"])
            if unmet > 0 or status in self.abstentions:
                kept["unmet"] += 1
                kept["row"] += 1
                kept["longest"] = max(kept["longest"], kept["row"])
                kept["violation"] = max(kept["violation"], -slack)
            else:
                kept["row"] = 0

    def cells(self, begun, failure):
        """The filter's part of the row, and by barrier what `campaign.success` may ask for."""
        block = self.block.name
        cells = {f"{block}.status.{name}": self.counts[number] for name, number in self.statuses.items()}
        cells |= {f"{block}.assurance.{name}": self.counted[number] for name, number in self.assurances.items()}
        cells |= {f"{block}.peak.{name.removeprefix('u.')}": peak for name, peak in self.peaks.items()}
        verdicts = []
        for name, (kept, _, _) in self.barriers.items():
            judge = kept["judge"]
            own = dict(arrival=judge.arrival, on_time=judge.on_time(), least_h=judge.least)
            own |= dict(inside=judge.reached and not judge.outside, late=judge.missed(), left=judge.left)
            own |= {field: kept[field] for field in ["unmet", "longest"]}
            promise, met = judge.kept(), kept["unmet"] == 0
            own |= dict(violation=kept["violation"] if begun else None, kept=promise and met and failure is None)
            cells |= {f"{block}.{name}.{field}": value for field, value in own.items()}
            verdicts.append({"kept": own["kept"], "on_time_and_inside": promise})
        return cells, verdicts


class Simulation:
    """The coupled system in one process: `punctual run` in Gauss-Seidel order, call by call."""

    def __init__(self, system, links, fmus, folder):
        self.experiment, self.success = system["experiment"], system["success"]
        self.blocks = {}
        for component, fmu in zip(system["component"], fmus):
            path = Path(folder) / f"{component['name']}.fmu"
            path.write_bytes(fmu)
            self.blocks[component["name"]] = Block(component, str(path), links)
        for block in self.blocks.values():
            block.connect(self.blocks, links)

    def run(self, drawn):
        """The row of a run, by column."""
        start, stop, step = (self.experiment.get(key, 0.0) for key in ["start_time", "stop_time", "step"])
        values = {name: {} for name in self.blocks}
        for name, value in drawn["values"].items():
            component, variable = name.split(".", 1)
            values[component][variable] = value
        filters = [Filter(b, values[b.name]) for b in self.blocks.values() if b.barriers]
        begun, failure = False, None
        try:
            self.begin(start, stop, values)
            begun = True
            self.steps(start, stop, step, filters)
        except Refused as refused:
            failure = str(refused)
        row, success = {}, failure is None
        for kept in filters:
            cells, verdicts = kept.cells(begun, failure)
            row |= cells
            success = success and all(verdict[self.success] for verdict in verdicts)
        front = {"run": drawn["run"], "seed": drawn["seed"]} | drawn["values"]
        return front | {"success": success, "failure": failure} | row

    def begin(self, start, stop, values):
        blocks, before = self.blocks.values(), None
        for block in blocks:
            block.begin(start, stop, values[block.name])
        for _ in range(len(blocks) + 1):
            self.exchange(states=True)
            now = [bytes(part[-1]) for b in blocks for g in [b.states, b.direct, b.inputs] for part in g.parts]
            if now == before:
                break
            before = now
        for block in blocks:
            block.call("fmi2ExitInitializationMode")
        for block in blocks:
            block.states.read()

    def exchange(self, states=False):
        """All outputs and inputs, without a step."""
        for block in self.blocks.values() if states else []:
            block.states.read()
        for block in self.blocks.values():
            if block.is_direct:
                block.take_inputs()
                block.direct.read()
        for block in self.blocks.values():
            if not block.is_direct:
                block.take_inputs()

    def steps(self, start, stop, step, filters):
        blocks = list(self.blocks.values())
        direct, delayed = [b for b in blocks if b.is_direct], [b for b in blocks if not b.is_direct]
        ratio = (stop - start) / step
        whole = round(ratio) >= 1 and abs(ratio - round(ratio)) <= WHOLE
        n = round(ratio) if whole else max(math.ceil(ratio), 1)
        for k in range(n):
            t = start + k * step
            h = step if whole or k < n - 1 else stop - t
            for block in direct:
                block.take_inputs()
                block.step(t, h)
                block.direct.read()
            for block in delayed:
                block.take_inputs()
            for kept in filters:
                kept.see(t)
            for block in delayed:
                block.step(t, h)
            for block in blocks:
                block.states.read()
        self.exchange()
        for kept in filters:
            kept.see(stop)
        for block in blocks:
            block.call("fmi2Terminate")


def items(block, variable):
    """The items of an enumeration, by name."""
    return {item.name: int(item.value) for item in block.variables[variable].declaredType.items}


def feedthrough(description):
    """The outputs that depend on an input at the same instant; one that declares nothing depends on all."""
    depends = {o.variable.name: o.dependencies for o in description.outputs}
    return {n for n, on in depends.items() if on is None or any(v.causality == "input" for v in on)}


def read(path):
    """System, links and FMUs of the campaign file, which `punctual campaign --list` has checked."""
    campaign = tomllib.loads(path.read_text())
    system, section = campaign["system"], campaign["campaign"]
    folder = path.parent if isinstance(system, dict) else (path.parent / system).parent
    if isinstance(system, str):
        system = tomllib.loads((path.parent / system).read_text())
    system["success"] = section.get("success", "kept")
    system["experiment"] |= {key: section[key] for key in ["stop_time", "step"] if key in section}
    if system["experiment"].get("order", "gauss-seidel") != "gauss-seidel":
        raise SystemExit(f"{path}: experiment.order: only gauss-seidel is made here")
    paths = {c["name"]: folder / c["fmu"] for c in system["component"]}
    for name, fmu in paths.items():
        if fmu.suffix != ".fmu":
            raise SystemExit(f"{path}: {name}: {fmu} is not an FMU; `punctual build` makes one of it")
    described = {name: read_model_description(str(fmu)) for name, fmu in paths.items()}
    links = [link | {end: link[end].split(".", 1) for end in ["from", "to"]} for link in system.get("connection", [])]
    for a, b in (pair["components"] for pair in system.get("connect_by_name", [])):
        for giver, reader in [(a, b), (b, a)]:
            inputs = {v.name for v in described[reader].modelVariables if v.causality == "input"}
            free = inputs - {link["to"][1] for link in links if link["to"][0] == reader}
            outputs = [o.variable.name for o in described[giver].outputs]
            links += [{"from": [giver, n], "to": [reader, n]} for n in outputs if n in free]
    direct = {name: feedthrough(description) for name, description in described.items()}
    places = [name for name in paths if direct[name]]
    for (giver, output), (reader, _) in ((link["from"], link["to"]) for link in links):
        if output in direct[giver] and reader in places and places.index(reader) <= places.index(giver):
            raise SystemExit(f"{path}: {giver}.{output} feeds through to {reader}: it must come before {reader}")
    return system, links, [fmu.read_bytes() for fmu in paths.values()]
