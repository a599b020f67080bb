"""Other people's safety filters and Punctual on the same problems: prints a table in Markdown.

    python rivals.py [--starts N] [--only NAME,NAME]

Every tool first chooses among its settings on TUNING other starts, by the promises kept and the collisions
avoided, then by how little it changes. `run` makes the environment and calls this.
"""

from __future__ import annotations

import os

# As cbfpy advises on a CPU; all tools are measured on one thread.
os.environ["JAX_PLATFORMS"] = "cpu"
os.environ["JAX_ENABLE_X64"] = "True"
os.environ["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false"
for threads in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "RAYON_NUM_THREADS"):
    os.environ[threads] = "1"

import argparse
import importlib
import math
import re
import statistics
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType

from problems import COLUMNS, DEADLINE, END, PLANTS, STEP, SUBSTEPS, Failed, Input, Problem, cases

MODULES = ("with_punctual", "with_cbfpy", "with_cbfjax", "with_casadi", "with_hj")
SEED, TUNING_SEED, TUNING = 2026, 7, 5
TUNING_END = DEADLINE + 3.0  # s


@dataclass
class Outcome:
    """A run, or the runs of a cell of the table."""

    starts: int = 0
    kept: int = 0  # inside the goal at the deadline
    stayed: int = 0  # and at every instant from then until END
    collided: int = 0
    deepest: float = 0.0  # m inside a rock
    arrived: int = 0  # inside the goal at END
    steps: int = 0
    changed: int = 0  # by more than 1e-6
    noticeably: int = 0  # by more than a hundredth of the bounds
    change: float = 0.0  # the sum of |u - u_ref| / |bounds|
    failed: int = 0
    beyond: int = 0  # steps whose input was out of bounds
    times: list[float] = field(default_factory=list)  # s, without the first step of a run
    first: float = 0.0  # s, the longest first step, with the making of the filter

    def add(self, other: Outcome) -> None:
        """The runs of another one too."""
        for key, value in vars(other).items():
            mine = getattr(self, key)
            setattr(self, key, max(mine, value) if key in ("deepest", "first") else mine + value)


def run(tool: ModuleType, problem: Problem, asks: str, setting: dict, end: float = END) -> Outcome:
    """One run, from the start until the end."""
    outcome = Outcome(starts=1)
    begun = time.perf_counter()
    step = tool.make(problem, setting)
    making = time.perf_counter() - begun
    x, lowest, inside = problem.start, problem.h_rocks(problem.start), True
    size = math.hypot(*problem.bounds)
    for k in range(round(end / STEP)):
        u_ref = problem.nominal(asks, x)
        begun = time.perf_counter()
        u: Input | None
        try:
            u = step(k * STEP, x, u_ref)
            failed = not all(map(math.isfinite, u))
            u = None if failed else u
        except Failed as failure:
            failed, u = True, failure.u
        took = time.perf_counter() - begun
        if k == 0:
            outcome.first = making + took
        else:
            outcome.times.append(took)
        outcome.failed += failed
        held = problem.clip(u_ref if u is None else u)
        outcome.beyond += u is not None and max(abs(a - b) for a, b in zip(held, u)) > 1e-3
        change = math.hypot(*(a - b for a, b in zip(held, u_ref)))
        outcome.steps += 1
        outcome.changed += change > 1e-6
        outcome.noticeably += change > 0.01 * size
        outcome.change += change / size
        for part, x in enumerate(problem.advance(x, held)):
            lowest = min(lowest, problem.h_rocks(x))
            after = k * STEP + (part + 1) * STEP / SUBSTEPS
            if abs(after - DEADLINE) < STEP / SUBSTEPS / 2:
                outcome.kept = int(problem.h_goal(x) >= 0.0)
            if after >= DEADLINE - 1e-9 and problem.h_goal(x) < 0.0:
                inside = False
    outcome.stayed = int(inside)
    outcome.arrived = int(problem.h_goal(x) >= 0.0)
    outcome.collided, outcome.deepest = int(lowest < 0.0), max(0.0, -lowest)
    return outcome


def runs(tool: ModuleType, problems: list[Problem], asks: str, setting: dict) -> Outcome:
    """A cell of the table."""
    total = Outcome()
    for problem in problems:
        total.add(run(tool, problem, asks, setting))
    return total


def best(tool: ModuleType, plant: str, task: str) -> tuple[dict, float]:
    """The setting with the most promises kept on the tuning starts, and then with the least change.

    Also the longest first step of all, which compiles, or computes a grid.
    """
    choices = tool.settings[task]
    if len(choices) == 1:
        return choices[0], 0.0
    problems = cases(plant, task, TUNING_SEED, TUNING)
    asks = "drives" if task == "keep" else "hostile"  # the one that needs the filter most

    def merit(setting: dict) -> tuple[int, float, float]:
        good, change, first = 0, 0.0, 0.0
        for problem in problems:
            outcome = run(tool, problem, asks, setting, TUNING_END)
            change += outcome.change
            first = max(first, outcome.first)
            # To keep out of rocks by never arriving is worth less.
            good += (1 + (outcome.stayed if task == "deadline" else outcome.arrived)) * (1 - outcome.collided)
        return (good, -change, first)

    merits = [merit(setting) for setting in choices]
    of_them = max(range(len(choices)), key=merits.__getitem__)
    return choices[of_them], max(first for _, _, first in merits)


def lines(tool: ModuleType, plant: str, task: str, setting: dict) -> int:
    """Lines of code between the markers, of which some are for one plant, task or setting only."""
    count, counting = 0, False
    mine = {plant, task, *map(str, setting.values())}
    for line in Path(tool.__file__).read_text().splitlines():
        text = line.strip()
        if marker := re.fullmatch(r"# begin user code(?:: (.*))?", text):
            counting = marker[1] is None or not mine.isdisjoint(marker[1].split(", "))
        elif text == "# end user code":
            counting = False
        elif counting and text and not text.startswith(("#", '"""')):
            count += 1
    return count


def row(tool: ModuleType, plant: str, task: str, setting: dict, outcome: Outcome) -> str:
    """A row of the table."""
    n = outcome.starts
    part = lambda a: f"{100 * a / outcome.steps:.0f} %"
    times = sorted(outcome.times)
    hit = f"{outcome.collided}" + (f", {outcome.deepest:.2g} m" if outcome.collided else "")
    promise = f"{outcome.kept} | {outcome.stayed}"
    if task == "keep":
        promise = f"– | {outcome.arrived} at the end"
    return (
        f"| {tool.name} | {promise} | {hit} | {part(outcome.changed)} | {part(outcome.noticeably)} "
        f"| {100 * outcome.change / outcome.steps:.1f} % | {1e6 * statistics.median(times):.0f} "
        f"| {1e6 * times[int(0.99 * len(times))]:.0f} | {1e3 * outcome.first:.0f} | {part(outcome.failed)} "
        f"| {part(outcome.beyond)} | {lines(tool, plant, task, setting)} |"
    )


HEAD = """\
| tool | in time | stayed | collisions, deepest | u changed | by > 1 % | mean change | step, µs \
| 99 % | first, ms | failed | out of bounds | lines |
|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|"""


def main() -> None:
    """All tables, on stdout; what is going on, on stderr."""
    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=raw)
    parser.add_argument("--starts", type=int, default=10, help="of each table (10)")
    parser.add_argument("--only", default=",".join(MODULES), help="modules, with commas")
    arguments = parser.parse_args()
    tools = [importlib.import_module(module) for module in arguments.only.split(",")]
    filters = [tool for tool in tools if hasattr(tool, "make")]
    begun = time.perf_counter()

    def say(text: str) -> None:
        print(f"rivals: {time.perf_counter() - begun:.0f} s: {text}", file=sys.stderr, flush=True)

    print("Versions: " + ", ".join(f"{tool.name} {tool.version}" for tool in tools) + ".")
    chosen: dict[tuple[str, str, str], tuple[dict, float]] = {}
    for plant in PLANTS:
        for task, asks in COLUMNS:
            print(f"\n**{plant}, {task}, u_ref {asks}**, of {arguments.starts} starts\n\n{HEAD}", flush=True)
            for tool in filters:
                if tool.settings.get(task) is None or plant not in getattr(tool, "plants", PLANTS):
                    print(f"| {tool.name} | no such thing |" + " – |" * 11, flush=True)
                    continue
                if (key := (tool.name, plant, task)) not in chosen:
                    say(f"{tool.name}: the best setting for {plant}, {task}")
                    chosen[key] = best(tool, plant, task)
                setting, first = chosen[key]
                say(f"{tool.name}: {plant}, {task}, {asks}, {setting}")
                outcome = runs(tool, cases(plant, task, SEED, arguments.starts), asks, setting)
                outcome.first = max(outcome.first, first)
                print(row(tool, plant, task, setting, outcome), flush=True)
    print("\nThe best settings, on other starts:\n")
    for (name, plant, task), (setting, _) in chosen.items():
        values = ", ".join(f"{k} {v}" for k, v in setting.items())
        print(f"- {name}, {plant}, {task}: {values or 'the defaults'}")
    for tool in tools:
        if hasattr(tool, "show"):
            say(tool.name)
            print()
            tool.show()
    say("done")


if __name__ == "__main__":
    main()
