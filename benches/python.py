"""Cost of a step in Python: the filter alone, rows of a batch, and FMPy's loop against its plain methods.

    PYTHON benches/python.py     # of an environment with the wheel and FMPy
"""

import os
import tempfile
import time
from pathlib import Path

import numpy as np
import punctual
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave

GOAL = {"name": "goal", "centre": [45.0, 45.0], "radius": 2.0, "deadline": 10.0, "margin": 0.02}
FILTER = {"kind": "filter", "plant": {"model": "unicycle"}, "barrier": [GOAL]}
PLANT = {"kind": "plant", "plant": {"model": "unicycle"}}
STEP, STEPS, REPEATS = 0.001, 10_000, 5


def fastest(run, clock=time.thread_time):
    """The shortest of some times, in s: by default of this thread on its processor, whatever else runs there."""
    times = []
    for _ in range(REPEATS):
        begin = clock()
        run()
        times.append(clock() - begin)
    return min(times)


def plain_loop(filter_fmu, plant_fmu):
    """The loop of README with FMPy's methods; returns a function that runs it."""

    def load(path, folder):
        description = read_model_description(path)
        fmu = FMU2Slave(
            guid=description.guid,
            unzipDirectory=extract(path, folder),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName=description.modelName,
        )
        fmu.instantiate()
        return fmu, {v.name: v.valueReference for v in description.modelVariables}

    (safety, f), (plant, p) = load(filter_fmu, filter_fmu + ".d"), load(plant_fmu, plant_fmu + ".d")
    states, inputs = ["x.x_p", "x.y_p", "x.theta", "x.v"], ["u.a", "u.omega"]
    given, taken, wanted = [p[n] for n in states], [f[n] for n in states], [f["u_ref.a"]]
    answer, drive = [f[n] for n in inputs], [p[n] for n in inputs]

    def run():
        for fmu in (safety, plant):
            fmu.reset()
            fmu.setupExperiment(startTime=0.0)
            fmu.enterInitializationMode()
            fmu.exitInitializationMode()
        for k in range(STEPS):
            t = k * STEP
            x = plant.getReal(given)
            safety.setReal(taken, x)
            safety.setReal(wanted, [-x[3]])
            safety.doStep(t, STEP)
            plant.setReal(drive, safety.getReal(answer))
            plant.doStep(t, STEP)

    return run


def main():
    for sampling in ["measured", "pointwise"]:
        configuration = FILTER | {"sampling": sampling}
        print(f"sampling = {sampling}")
        with tempfile.TemporaryDirectory() as folder:
            paths = [str(Path(folder) / name) for name in ["filter.fmu", "plant.fmu"]]
            punctual.build(configuration, paths[0])
            punctual.build(PLANT, paths[1])
            options = dict(step_size=STEP, nominal={"a": ("v", -1.0)})

            def pair(stop, **more):
                return fastest(lambda: punctual.simulate(*paths, stop_time=stop, **options, **more))

            long, short = STEPS * STEP, STEPS * STEP / 10
            for name, more in [("everything", {}), ("u alone", {"record": ["u.a", "u.omega"]})]:
                # Loading takes its time in both.
                step = (pair(long, **more) - pair(short, **more)) / (0.9 * STEPS)
                print(f"  simulate, recording {name}: {1e6 * step:.2f} us per step of the pair")
            print(f"  FMPy's getReal, setReal, doStep, recording nothing: {1e6 * fastest(plain_loop(*paths)) / STEPS:.2f} us")

        run = np.random.default_rng(1).uniform([0.0, 0.0, -3.0, 0.0], [30.0, 30.0, 3.0, 10.0], (1000, 4))
        own, u_ref = punctual.Filter(configuration), np.zeros(2)

        def single():
            own.reset()
            for k in range(1000):
                own.step(k * STEP, run[0], u_ref).u

        print(f"  Filter.step: {1e3 * fastest(single):.2f} us")
        for n in [1, 100, 10_000]:
            x, wanted = np.resize(run, (n, 4)), np.zeros((n, 2))
            batch = punctual.FilterBatch(configuration, n)

            def rows():
                batch.reset()
                for k in range(10):
                    batch.step(k * STEP, x, wanted)

            print(f"  FilterBatch.step, {n} rows, {os.cpu_count()} cores: {1e9 * fastest(rows, time.perf_counter) / (10 * n):.0f} ns per row")


if __name__ == "__main__":
    main()
