"""Drives filters for scenarios of stlpy against controllers that want something else, and lets others judge the runs.

    judge.py [--runs N] [--only PATTERN] [--drawn K] [--json FILE]
    judge.py --solvers [--only PATTERN]

Each file beside this one is a scenario of stlpy 0.3; RandomMultitarget is drawn here, as stlpy draws it. From each
start a filter takes its first step, which searches for a plan, and is then copied for controllers that want nothing,
to brake, to be far from every goal, anything, and to be somewhere else. The plant is integrated here. A run is judged
at DENSE instants of each step by

- rtamt, from the text of the mission and the h of its regions, computed here,
- the specification of stlpy with its own sharp rectangles, written down here,
- the bounds of stlpy's example on inputs and states,
- and the flag: it may not fall without a reason, and nothing may be missed while it stands.

Prints a table. Fails if something is missed while the flag stands. With --solvers it prints how long stlpy's own
solvers take for the same scenarios instead.
"""

import argparse
import copy
import fnmatch
import json
import math
import pathlib
import re
import subprocess
import sys
import time
import tomllib
import warnings

import numpy as np
import punctual
import rtamt
from stlpy import benchmarks

HERE = pathlib.Path(__file__).parent
# Instants of a step at which a run is judged, each after a step of Runge and Kutta.
DENSE = 10
# How long a run goes on after the last time of the mission in s: the bounds are kept meanwhile.
AFTER = 2.0
# How far starts are moved from stlpy's in m, but for the first.
MOVED = 0.1
# Tolerance of a bound in its unit: round-off.
ROUND_OFF = 1e-9
# The limit of a solver in s.
SOLVER_LIMIT = 60.0

# What controllers want, and how many runs there are of each from a start.
CONTROLLERS = {"nothing": 1, "brakes": 1, "hostile": 1, "random": 4, "elsewhere": 4}
RUNS = sum(CONTROLLERS.values())


# Scenarios


class Scenario:
    """A configuration, and what stlpy asks: the specification on a dense path, and the bounds of its example."""

    def __init__(self, name, stl, horizon, start, spec, configuration=None, upper=(10.0, 10.0), speed=1.0, places=()):
        self.name, self.stl, self.horizon, self.start, self.spec = name, stl, horizon, np.array(start), spec
        if configuration is None:
            configuration = tomllib.loads((HERE / f"{name}.toml").read_text(encoding="utf-8"))
        self.configuration, self.places = configuration, [np.array(place) for place in places]
        self.is_unicycle = "model" not in configuration["plant"]
        if self.is_unicycle:
            self.states, self.inputs = ["x", "y", "theta"], ["v", "omega"]
            self.low, self.high = np.array([-10.0, -10.0, -2 * np.pi]), np.array([10.0, 10.0, 2 * np.pi])
            self.u_low, self.u_high = np.array([0.0, -5.0]), np.array([10.0, 5.0])
        else:
            self.states, self.inputs = ["x_p", "y_p", "v_x", "v_y"], ["u_x", "u_y"]
            self.low, self.high = np.array([0.0, 0.0, -speed, -speed]), np.array([*upper, speed, speed])
            self.u_low, self.u_high = np.full(2, -0.5), np.full(2, 0.5)
        self.step = configuration["experiment"]["step_size"]


def depth(bounds, path):
    """How far points are inside of a sharp rectangle of stlpy; negative outside."""
    x_min, x_max, y_min, y_max = bounds
    x, y = path[:, 0], path[:, 1]
    return np.minimum(np.minimum(x - x_min, x_max - x), np.minimum(y - y_min, y_max - y))


def ever(h):
    return float(h.max())


def always(h):
    return float(h.min())


def outside(obstacles, path):
    return min(always(-depth(bounds, path)) for bounds in obstacles)


def stays(h, times, dwell, last):
    """The largest least h over `dwell` s that begin until `last`."""
    width = round(dwell / (times[1] - times[0])) + 1
    windows = np.lib.stride_tricks.sliding_window_view(h, width).min(axis=1)
    return float(windows[times[: len(windows)] <= last + ROUND_OFF].max())


def until(before, then):
    """The robustness of `before` until `then`: then at some time, before at all times up to it."""
    return float(np.minimum(then, np.minimum.accumulate(before)).max())


def middle(bounds):
    return [(bounds[0] + bounds[1]) / 2, (bounds[2] + bounds[3]) / 2]


def reach_avoid():
    stl = benchmarks.ReachAvoid((7, 8, 8, 9), (3, 5, 4, 6), 10)

    def spec(times, path):
        return min(outside([stl.obstacle_bounds], path), ever(depth(stl.goal_bounds, path)))

    return Scenario("reach_avoid", stl, 10.0, [1.0, 2.0, 0.0, 0.0], spec, places=[middle(stl.goal_bounds)])


def nonlinear_reach_avoid():
    # 15 steps of 0.1 s.
    stl = benchmarks.NonlinearReachAvoid((7.5, 8.5), 0.75, (3.5, 5), 1.5, 15)

    def spec(times, path):
        obstacle = np.hypot(*(path[:, :2] - stl.obstacle_center).T) - stl.obstacle_radius
        goal = stl.goal_radius - np.hypot(*(path[:, :2] - stl.goal_center).T)
        return min(always(obstacle), ever(goal))

    return Scenario("nonlinear_reach_avoid", stl, 1.5, [1.0, 2.0, 0.0], spec, places=[stl.goal_center])


def either_or():
    stl = benchmarks.EitherOr((7, 8, 8, 9), (1, 2, 6, 7), (7, 8, 4.5, 5.5), (3, 5, 4, 6), 20, 5)

    def spec(times, path):
        dwells = [stays(depth(bounds, path), times, 5.0, 15.0) for bounds in (stl.target_one, stl.target_two)]
        return min(max(dwells), outside([stl.obstacle], path), ever(depth(stl.goal, path)))

    places = [middle(stl.goal), middle(stl.target_one), middle(stl.target_two)]
    return Scenario("either_or", stl, 20.0, [2.0, 2.0, 0.0, 0.0], spec, places=places)


def narrow_passage():
    stl = benchmarks.NarrowPassage(25)

    def spec(times, path):
        return min(max(ever(depth(goal, path)) for goal in stl.goals), outside(stl.obstacles, path))

    places = [middle(goal) for goal in stl.goals]
    return Scenario("narrow_passage", stl, 25.0, [3.0, 3.6, 0.0, 0.0], spec, places=places)


def door_puzzle():
    stl = benchmarks.DoorPuzzle(25, 2)
    obstacles = [getattr(stl, f"obs{i}_bounds") for i in range(1, 6)]

    def spec(times, path):
        pairs = [(stl.door1_bounds, stl.key1_bounds), (stl.door2_bounds, stl.key2_bounds)]
        doors = [until(-depth(door, path), depth(key, path)) for door, key in pairs]
        return min(*doors, outside(obstacles, path), ever(depth(stl.goal_bounds, path)))

    places = [middle(bounds) for bounds in (stl.goal_bounds, stl.key1_bounds, stl.key2_bounds)]
    start = [6.0, 1.0, 0.0, 0.0]
    return Scenario("door_puzzle", stl, 25.0, start, spec, upper=(15.0, 10.0), speed=2.0, places=places)


def stepping_stones(name, seed, start):
    stl = benchmarks.SteppingStones(15, 15, seed=seed)

    def spec(times, path):
        stones = np.max([depth(stone, path) for stone in stl.stones], axis=0)
        return min(always(stones), ever(depth(stl.target, path)))

    return Scenario(name, stl, 15.0, [*start, 0.0, 0.0], spec, places=[middle(stl.target)])


def connected(stones, place):
    """The stones to which a chain of stones that touch leads from a place. Who does not leap reaches no others."""

    def touch(a, b):
        return max(a[0], b[0]) <= min(a[1], b[1]) and max(a[2], b[2]) <= min(a[3], b[3])

    found = {i for i, stone in enumerate(stones) if touch(stone, (place[0], place[0], place[1], place[1]))}
    while more := {i for i, s in enumerate(stones) if i not in found and any(touch(s, stones[j]) for j in found)}:
        found |= more
    return found


def random_multitarget(seed):
    """RandomMultitarget as in stlpy's example, with the obstacle and the targets of a seed."""
    stl = benchmarks.RandomMultitarget(1, 5, 2, 25, seed=seed)

    def spec(times, path):
        groups = [max(ever(depth(target, path)) for target in group) for group in stl.targets]
        return min(*groups, outside(stl.obstacles, path))

    names = [[f"target_{i}_{j}" for j in range(1, 3)] for i in range(1, 6)]
    groups = ["(" + " | ".join(f"F[0,25] {name}" for name in group) + ")" for group in names]
    regions = {"obstacle": stl.obstacles[0]}
    for group, targets in zip(names, stl.targets, strict=True):
        regions |= dict(zip(group, targets, strict=True))
    # What the scenarios with a point mass share but for their regions: stlpy's bounds.
    configuration = tomllib.loads((HERE / "reach_avoid.toml").read_text(encoding="utf-8"))
    configuration["name"] = "random_multitarget"
    configuration["mission"] = " & ".join([*groups, "G[0,25] !obstacle"])
    configuration["x0"] = {"x_p": 5.0, "y_p": 2.0, "v_x": 0.0, "v_y": 0.0}
    configuration["experiment"] = {"stop_time": 25.0 + AFTER, "step_size": 0.1}
    rectangles = [
        {
            "name": name,
            "shape": "rectangle",
            "centre": [float(x) for x in middle(bounds)],
            "half_sides": [float(bounds[1] - bounds[0]) / 2, float(bounds[3] - bounds[2]) / 2],
        }
        for name, bounds in regions.items()
    ]
    limits = [barrier for barrier in configuration["barrier"] if barrier["shape"] in ("at_least", "at_most")]
    configuration["barrier"] = rectangles + limits
    places = [middle(target) for group in stl.targets for target in group]
    start = [5.0, 2.0, 0.0, 0.0]
    return Scenario(f"random_multitarget_{seed}", stl, 25.0, start, spec, configuration, places=places)


def scenarios(drawn):
    """The seven, and further draws of the two that are random."""
    seven = [
        reach_avoid(),
        nonlinear_reach_avoid(),
        either_or(),
        narrow_passage(),
        door_puzzle(),
        stepping_stones("stepping_stones", 1, [2.0, 1.3]),
        random_multitarget(0),
    ]
    further = [stepping_stones("stepping_stones_348", 348, [5.63, 7.68])]
    return seven + further + [random_multitarget(seed) for seed in range(1, drawn + 1)]


# Runs


def rate(scenario, x, u):
    if scenario.is_unicycle:
        return np.array([u[0] * math.cos(x[2]), u[0] * math.sin(x[2]), u[1]])
    return np.array([x[2], x[3], u[0], u[1]])


def held(scenario, x, u):
    """The states at the dense instants of a step with `u` from `x`."""
    h, states = scenario.step / DENSE, []
    for _ in range(DENSE):
        k1 = rate(scenario, x, u)
        k2 = rate(scenario, x + 0.5 * h * k1, u)
        k3 = rate(scenario, x + 0.5 * h * k2, u)
        k4 = rate(scenario, x + h * k3, u)
        x = x + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        states.append(x)
    return states


def toward(scenario, x, place, sign):
    """An input that leads straight to a place, or away from it."""
    way = sign * (place - x[:2])
    if scenario.is_unicycle:
        turn = math.remainder(math.atan2(way[1], way[0]) - x[2], 2 * math.pi)
        return np.array([10.0 * max(math.cos(turn), 0.1), 5.0 * np.clip(2.0 * turn, -1.0, 1.0)])
    if sign < 0:
        return 0.5 * way / max(np.abs(way).max(), 1e-9)
    return np.clip(0.8 * way - 1.5 * x[2:], -2.0, 2.0)


class Controller:
    """What is wanted: one of CONTROLLERS, which draws from `generator`."""

    def __init__(self, scenario, kind, generator):
        self.scenario, self.kind, self.generator = scenario, kind, generator
        # Half of the wrong places are obstacles, where there are any.
        high = scenario.high[:2]
        obstacles = [middle(bounds) for bounds in avoided(scenario.stl)]
        if obstacles and generator.random() < 0.5:
            self.place = np.array(obstacles[generator.integers(len(obstacles))])
        else:
            self.place = generator.uniform(scenario.low[:2], high)
        self.left, self.wanted = 0, np.zeros(2)

    def __call__(self, x):
        scenario = self.scenario
        if self.kind == "nothing":
            return np.zeros(2)
        if self.kind == "brakes":
            return np.array([0.0, -x[2]]) if scenario.is_unicycle else -x[2:]
        if self.kind == "random":
            if self.left == 0:
                centre, half = (scenario.u_low + scenario.u_high) / 2, (scenario.u_high - scenario.u_low) / 2
                self.wanted = centre + half * self.generator.uniform(-1.5, 1.5, 2)
                self.left = int(self.generator.integers(1, 20))
            self.left -= 1
            return self.wanted
        if self.kind == "elsewhere":
            return toward(scenario, x, self.place, 1.0)
        nearest = min(scenario.places, key=lambda place: math.dist(place, x[:2]))
        return toward(scenario, x, nearest, -1.0)


def avoided(stl):
    """The rectangles that a scenario of stlpy avoids."""
    if hasattr(stl, "obs1_bounds"):
        return [getattr(stl, f"obs{i}_bounds") for i in range(1, 6)]
    if hasattr(stl, "obstacles"):
        return stl.obstacles
    if hasattr(stl, "obstacle_center"):
        (x, y), radius = stl.obstacle_center, stl.obstacle_radius
        return [(x - radius, x + radius, y - radius, y + radius)]
    return [getattr(stl, key) for key in ("obstacle", "obstacle_bounds") if hasattr(stl, key)]


def run(scenario, filter, first, start, controller):
    """A run from `start`, where `filter` has taken its step `first`: times, states, inputs, and the flag."""
    steps = round((scenario.horizon + AFTER) / scenario.step)
    x, found = start, first
    path, inputs, flags = [x], [], []
    for k in range(steps):
        t = k * scenario.step
        if k > 0:
            found = filter.step(t, x, controller(x))
        u = np.array(found.u)
        inputs.append(u)
        flags.append(found.assurance == punctual.Assurance.ASSURED)
        states = held(scenario, x, u)
        path += states
        x = states[-1]
    # A visit may be made at the last instant of its window, which round-off must not put after it.
    times = np.round(np.arange(len(path)) * scenario.step / DENSE, 9)
    return times, np.array(path), np.array(inputs), np.array(flags)


# The judges


def expression(text, names):
    """The value of an expression of a configuration."""
    functions = {"sqrt": np.sqrt, "abs": np.abs, "max": np.maximum, "min": np.minimum}
    return eval(text.replace("^", "**"), {"__builtins__": {}}, functions | names)  # noqa: S307: our own files


def region(barrier, path, states, is_avoided):
    """h of a region of a mission: that of a rectangle within the true one, or around it where it is avoided."""
    if barrier["shape"] != "rectangle":
        return expression(barrier["expression"], dict(zip(states, path.T, strict=True)))
    along, across = (path[:, :2] - barrier["centre"]).T
    a, b = (side * 2**0.25 if is_avoided else side for side in barrier["half_sides"])
    return (2**0.25 - ((along / a) ** 4 + (across / b) ** 4 + 1) ** 0.25) * min(a, b)


def signals(scenario, path):
    """h of every region that the mission names."""
    mission = scenario.configuration["mission"]
    names = set(re.findall(r"[a-z]\w+", mission))
    barriers = {b["name"]: {"shape": "expression"} | b for b in scenario.configuration["barrier"] if b["name"] in names}
    return {
        name: region(barrier, path, scenario.states, f"!{name}" in mission) for name, barrier in barriers.items()
    }


def robustness(text, times, h):
    """What rtamt says of the mission at the start."""
    monitor = rtamt.StlDenseTimeSpecification()
    for name in h:
        monitor.declare_var(name, "float")
    monitor.spec = text
    monitor.parse()
    columns = [[name, [[t, value] for t, value in zip(times.tolist(), h[name].tolist(), strict=True)]] for name in h]
    return monitor.evaluate(*columns)[0][1]


def not_promised(scenario, first):
    """What is kept at all times and not guaranteed at the first step: a start that violates it is not refused."""
    barriers = scenario.configuration["barrier"]
    names = [b["name"] for b in barriers if f"!{b['name']}" in scenario.configuration["mission"] or "state" in b]
    return [name for name in names if not first.barriers[name].guaranteed]


def judged(scenario, times, path, inputs, flags):
    """What the judges say of a run."""
    until = round(scenario.horizon / scenario.step) * DENSE + 1
    h = signals(scenario, path)
    within = (scenario.low - path).max(), (path - scenario.high).max()
    u_within = (scenario.u_low - inputs).max(), (inputs - scenario.u_high).max()
    rho = robustness(scenario.configuration["mission"], times, h)
    spec = scenario.spec(times[:until], path[:until])
    is_kept = rho > 0.0 and spec > 0.0 and max(*within, *u_within) <= ROUND_OFF
    # Where the flag fell, what is kept at all times has to be kept for as long as it stood.
    stood = np.repeat(flags, DENSE)
    sides = np.maximum((scenario.low - path).max(axis=1), (path - scenario.high).max(axis=1))[1:]
    is_left = bool((sides[stood] > ROUND_OFF).any())
    for name in h:
        if f"G[0,{scenario.horizon:g}] !{name}" in scenario.configuration["mission"]:
            is_left |= bool((h[name][1:until][stood[: until - 1]] > 0.0).any())
    return {
        "rtamt": rho,
        "stlpy": spec,
        "states": -float(max(within)),
        "inputs": -float(max(u_within)),
        "withdrawn": not flags.all(),
        "broken": bool(is_left or (flags.all() and not is_kept)),
        "kept": bool(is_kept),
    }


def moved(scenario, generator, number):
    """The start of a run: stlpy's, or one nearby."""
    start = scenario.start.copy()
    if number > 0:
        start[:2] += generator.uniform(-MOVED, MOVED, 2)
    return start


def of_scenario(scenario, starts):
    """All runs of a scenario: from `starts` starts each controller."""
    rows = []
    for number in range(starts):
        generator = np.random.default_rng([number, *scenario.name.encode()])
        start = moved(scenario, generator, number)
        begun = punctual.Filter(scenario.configuration)
        clock = time.perf_counter()
        first = begun.step(0.0, start, np.zeros(2))
        search = time.perf_counter() - clock
        left_out = not_promised(scenario, first)
        accepted = first.assurance == punctual.Assurance.ASSURED and not left_out
        row = {"scenario": scenario.name, "start": start.tolist(), "accepted": bool(accepted), "search": search}
        if not accepted:
            state = punctual.Assurance(first.assurance).name.lower()
            left_out = f"{state}, without a promise for {', '.join(left_out) or 'nothing'}"
            rows.append(row | {"refusal": begun.refusal or left_out})
            continue
        for kind in (kind for kind, count in CONTROLLERS.items() for _ in range(count)):
            controller = Controller(scenario, kind, generator)
            clock = time.perf_counter()
            seen = run(scenario, copy.deepcopy(begun), first, start, controller)
            rows.append(row | {"controller": kind, "seconds": time.perf_counter() - clock} | judged(scenario, *seen))
    return rows


HEAD = ["scenario", "accepted", "of", "first step s", "longest s", "runs"]
HEAD += ["rtamt > 0", "stlpy > 0", "withdrawn", "broken"]


def line(name, rows):
    starts = {(row["scenario"], *row["start"]): row for row in rows}
    own, runs = rows[0], [row for row in rows if row["accepted"]]
    searches = [row["search"] for row in starts.values()]
    return [
        name,
        "yes" if own["accepted"] else "no",
        f"{sum(row['accepted'] for row in starts.values())}/{len(starts)}",
        f"{np.median(searches):.2f}",
        f"{max(searches):.2f}",
        str(len(runs)),
        str(sum(row["rtamt"] > 0.0 for row in runs)),
        str(sum(row["stlpy"] > 0.0 for row in runs)),
        str(sum(row["withdrawn"] for row in runs)),
        str(sum(row["broken"] for row in runs)),
    ]


def show(table):
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    for row in table:
        print("  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)).rstrip(), flush=True)


# stlpy's own solvers


def solve(name, solver):
    """The time of a solver of stlpy for a scenario, in a process of its own. Prints a line."""
    import pydrake.solvers

    # Where stlpy 0.3 looks for what newer versions of Drake have in pydrake.solvers.
    sys.modules["pydrake.solvers.branch_and_bound"] = sys.modules["pydrake.solvers.all"] = pydrake.solvers
    from stlpy import solvers

    scenario = next(s for s in scenarios(0) if s.name == name)
    stl, horizon = scenario.stl, scenario.stl.T
    spec, system = stl.GetSpecification(), stl.GetSystem()
    spec.simplify()
    begin = time.perf_counter()
    if solver == "smooth":
        made = solvers.DrakeSmoothSolver(spec, system, scenario.start, horizon, k=2.0, verbose=False)
    else:
        made = solvers.GurobiMICPSolver(
            spec, system, scenario.start, horizon, robustness_cost=solver == "scip-best", verbose=False
        )
    made.AddControlBounds(scenario.u_low, scenario.u_high)
    made.AddStateBounds(scenario.low, scenario.high)
    weight = np.zeros((3, 3)) if scenario.is_unicycle else 0.1 * np.diag([0, 0, 1, 1])
    if solver in ("smooth", "scip-best"):
        made.AddQuadraticCost(weight, (1e-3 if scenario.is_unicycle else 0.1) * np.eye(2))
    setup = time.perf_counter() - begin
    begin = time.perf_counter()
    if solver in ("smooth", "gurobi"):
        _, _, rho, _ = made.Solve()
        said = f"robustness {rho:.3f} at the steps"
    else:
        said = by_scip(made, solver == "scip-first")
    print(f"{name}: {solver}: setup {setup:.2f} s, solver {time.perf_counter() - begin:.2f} s, {said}", flush=True)


def by_scip(made, is_first):
    """Solves the program of stlpy's Gurobi class by SCIP: to the first solution, or to the best."""
    import tempfile

    import gurobipy
    import pyscipopt

    made.model.setObjective(made.cost, gurobipy.GRB.MINIMIZE)
    with tempfile.TemporaryDirectory() as folder:
        file = f"{folder}/program.mps"
        made.model.write(file)
        program = pyscipopt.Model()
        program.hideOutput()
        program.readProblem(file)
    program.setParam("limits/time", SOLVER_LIMIT)
    if is_first:
        program.setParam("limits/solutions", 1)
    program.optimize()
    return f"{program.getStatus()}, {program.getNSols()} solutions, {program.getSolvingTime():.2f} s in SCIP"


def ask_solvers(only):
    for scenario in scenarios(0):
        if not fnmatch.fnmatch(scenario.name, only):
            continue
        kinds = ["smooth"] if scenario.is_unicycle else ["smooth", "gurobi", "scip-first", "scip-best"]
        for kind in kinds:
            command = [sys.executable, __file__, "--solve", scenario.name, kind]
            # The process may end badly in a library after its line.
            try:
                found = subprocess.run(command, capture_output=True, text=True, timeout=4 * SOLVER_LIMIT, check=False)
                said = [text for text in found.stdout.splitlines() if text.startswith(scenario.name)]
                error = (found.stderr.splitlines() or ["no answer"])[-1]
            except subprocess.TimeoutExpired:
                said, error = [], f"no answer within {4 * SOLVER_LIMIT:g} s"
            print(said[0] if said else f"{scenario.name}: {kind}: {error[:100]}", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=200, help="at least as many runs, if every start is accepted")
    parser.add_argument("--only", default="*", metavar="PATTERN", help="scenarios of such names")
    parser.add_argument("--drawn", type=int, default=0, help="further seeds of RandomMultitarget")
    parser.add_argument("--json", help="a file for every run")
    parser.add_argument("--solvers", action="store_true", help="only the times of stlpy's solvers")
    parser.add_argument("--solve", nargs=2, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    if arguments.solve:
        return solve(*arguments.solve)
    if arguments.solvers:
        return ask_solvers(arguments.only)
    chosen = [scenario for scenario in scenarios(arguments.drawn) if fnmatch.fnmatch(scenario.name, arguments.only)]
    # Of RandomMultitarget there are several draws rather than starts; what cannot be promised is not tried again.
    one = [s for s in chosen if re.fullmatch(r"stepping_stones|random_multitarget_\d+", s.name)]
    several = [s for s in chosen if s not in one]
    starts = math.ceil(max(arguments.runs / RUNS - len(one), 1) / max(len(several), 1))
    table, rows = [HEAD], []
    for scenario in chosen:
        found = of_scenario(scenario, starts if scenario in several else 1)
        rows += found
        table.append(line(scenario.name, found))
        print(f"... {'  '.join(table[-1])}", file=sys.stderr, flush=True)
        if arguments.json:
            pathlib.Path(arguments.json).write_text(json.dumps(rows, indent=1), encoding="utf-8")
    show([*table, line("all", rows)])
    stones = {s.name: s.stl.stones for s in chosen if isinstance(s.stl, benchmarks.SteppingStones)}
    for row in rows:
        if not row["accepted"]:
            print(f"refused: {row['scenario']} from {row['start'][:2]}: {row['refusal']}")
            of = stones.get(row["scenario"])
            if of and len(of) - 1 not in connected(of, row["start"]):
                print("  rightly: no chain of stones that touch leads from there to the last one")
        elif row["broken"] or row["withdrawn"] or not row["kept"]:
            print(f"look at: {row}")
    accepted = [row for row in rows if row["accepted"]]
    if any(row["broken"] for row in accepted):
        sys.exit("a promise was broken while the flag stood")
    return None


if __name__ == "__main__":
    main()
