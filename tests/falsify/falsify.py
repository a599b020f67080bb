"""Searches for a plant within what a filter declares that breaks its promise, with tools of others.

    falsify.py [EVALUATIONS]

PSY-TaLiRo chooses disturbances, errors of measurement, gains and u_ref, each constant in pieces and within what
examples/vehicles/windy.toml declares. The plant is integrated here. RTAMT says how robustly a run satisfies "always inside the
goal from the deadline on, and always outside the rock". Where the filter does not guarantee a barrier, its h does not count.

The falsifier has to find a planted fault too: a filter whose file declares a tenth of the errors of measurement that there are.
Prints a line for each search. Fails if a promise is broken, or the planted fault is not found.
"""

import copy
import math
import pathlib
import sys
import tomllib
import warnings

import numpy as np
import punctual
from staliro import SignalInput, TestOptions, model, staliro
from staliro.models import Result
from staliro.optimizers import DualAnnealing, UniformRandom
from staliro.signals import piecewise_constant
from staliro.specifications.rtamt import parse_dense

FILE = pathlib.Path(__file__).parents[2] / "examples" / "vehicles" / "windy.toml"
# Evaluations of each search.
EVALUATIONS = 30
# Pieces of every signal; those of the planted fault are constant, so that the filter cannot tell.
PIECES = 6
# How long a run takes in s: two seconds past the deadline.
TIME = 10.0
# Steps of Runge and Kutta in a hold; h is judged after each.
STEPS = 2
# What counts as robust where nothing is guaranteed, in m.
FAR = 10.0
# The part of the errors that the planted fault declares.
DECLARED = 0.1
SEED = 7

STATES, INPUTS = ["x_p", "y_p", "theta", "v"], ["a", "omega"]


def configuration():
    """The filter of the file, without the run that it describes."""
    declared = tomllib.loads(FILE.read_text(encoding="utf-8"))
    for run in ("simulated", "disturbance", "u_ref"):
        del declared[run]
    return declared


def limits(declared):
    """Half of what every signal may do: rates, errors, and gains around 1; and u_ref."""
    uncertainty, bounds = declared["uncertainty"], declared["bounds"]
    signals = {f"rate {state}": size for state, size in uncertainty["rates"].items()}
    signals |= {f"error {state}": size for state, size in declared["measurement_errors"].items()}
    signals |= {f"gain {name}": of["gain"][1] - 1.0 for name, of in uncertainty["inputs"].items()}
    return signals | {f"u_ref {name}": bounds[name][1] for name in INPUTS}


def rate(x, arrives, added):
    """Of a unicycle, with what is added to it."""
    return np.array([x[3] * math.cos(x[2]), x[3] * math.sin(x[2]), arrives[1], arrives[0]]) + added


def system(promised, plant):
    """The model for PSY-TaLiRo: the filter of `promised` before a plant within `plant`."""
    step = promised["experiment"]["step_size"]
    goal, rock = promised["barrier"]
    begin = np.array([promised["x0"].get(state, 0.0) for state in STATES])

    @model
    def run(inputs):
        size = limits(plant)

        def drawn(kind, names, t):
            found = (f"{kind} {name}" for name in names)
            return np.array([size[key] * inputs.signals[key].at_time(t) if key in size else 0.0 for key in found])

        filter, x = punctual.Filter(promised), begin.copy()
        times, states, withdrawn = [], [], 0
        for k in range(round(TIME / step)):
            t = k * step
            found = filter.step(t, x + drawn("error", STATES, t), drawn("u_ref", INPUTS, t))
            promises = {name: barrier.guaranteed for name, barrier in found.barriers.items()}
            withdrawn += not all(promises.values())
            arrives, added = found.u * (1.0 + drawn("gain", INPUTS, t)), drawn("rate", STATES, t)
            for part in range(STEPS):
                h = step / STEPS
                k1 = rate(x, arrives, added)
                k2 = rate(x + 0.5 * h * k1, arrives, added)
                k3 = rate(x + 0.5 * h * k2, arrives, added)
                k4 = rate(x + h * k3, arrives, added)
                x = x + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
                inside = goal["radius"] - math.dist(x[:2], goal["centre"])
                outside = math.dist(x[:2], rock["centre"]) - rock["radius"]
                times.append(t + (part + 1) * h)
                states.append(
                    {
                        "goal": inside if promises["goal"] else FAR,
                        "rock": outside if promises["rock"] else FAR,
                    }
                )
        return Result(times=times, states=states, extra=withdrawn)

    return run


def search(promised, plant, optimizer, evaluations, pieces=PIECES):
    """The least robustness that is found, in how many evaluations, and in how many of them a promise was withdrawn."""
    deadline = promised["barrier"][0]["deadline"]
    promise = f"(always[{deadline:g},{TIME:g}] (goal >= 0.0)) and (always (rock >= 0.0))"
    signal = SignalInput(control_points=[(-1.0, 1.0)] * pieces, factory=piecewise_constant)
    options = TestOptions(
        tspan=(0.0, TIME), signals=dict.fromkeys(limits(plant), signal), iterations=evaluations, seed=SEED
    )
    (found,) = staliro(system(promised, plant), parse_dense(promise), optimizer, options)
    costs = [evaluation.cost for evaluation in found.evaluations]
    withdrawn = sum(evaluation.extra.model > 0 for evaluation in found.evaluations)
    return min(costs), len(costs), withdrawn


def main():
    warnings.simplefilter("ignore")
    evaluations = int(sys.argv[1]) if len(sys.argv) > 1 else EVALUATIONS
    declared, broken = configuration(), False
    for optimizer in (UniformRandom(min_cost=0.0), DualAnnealing(min_cost=0.0)):
        least, count, withdrawn = search(declared, declared, optimizer, evaluations)
        broken |= least < 0.0
        name = type(optimizer).__name__
        print(f"{name}: {count} evaluations, least robustness {least:.4f} m, {withdrawn} withdrawn", flush=True)
    faulty = copy.deepcopy(declared)
    faulty["measurement_errors"] = {name: DECLARED * size for name, size in declared["measurement_errors"].items()}
    least, count, _ = search(faulty, declared, DualAnnealing(min_cost=0.0), evaluations, pieces=1)
    print(f"planted fault: {count} evaluations, least robustness {least:.4f} m", flush=True)
    if broken:
        sys.exit("a promise was broken by a plant within what was declared")
    if least >= 0.0:
        sys.exit("the planted fault was not found")


if __name__ == "__main__":
    main()
