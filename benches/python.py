"""Costs in one run: a step in Rust beside the same by hand, steps and batches in Python beside cbfpy, FMPy, campaigns.

    PYTHON benches/python.py     # of an environment with the wheel and FMPy; with cbfpy, cbfkit and Dask too, where installed

Single steps are the shortest of many rounds, or times of one thread on its processor, whatever else runs there. What runs
on all cores is the shortest of many too.
"""

import contextlib
import importlib.util
import io
import os

# What cbfpy recommends; read when JAX is loaded.
os.environ.setdefault("JAX_ENABLE_X64", "1")
os.environ.setdefault("JAX_PLATFORMS", "cpu")

import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import punctual
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave

try:
    import cbfpy
    import jax
    import jax.numpy as jnp
except ImportError:
    cbfpy = None
try:
    from cbfkit.certificates import concatenate_certificates, rectify_relative_degree
    from cbfkit.certificates.conditions.barrier_conditions import zeroing_barriers
    from cbfkit.controllers.cbf_clf import vanilla_cbf_clf_qp_controller
    from cbfkit.utils.user_types import ControllerData
except ImportError:
    vanilla_cbf_clf_qp_controller = None
try:
    import distributed
except ImportError:
    distributed = None
EXAMPLE = Path(__file__).parent.parent / "examples" / "campaign"
sys.path.append(str(EXAMPLE))
import fmpy_runs  # noqa: E402

GOAL = {"name": "goal", "centre": [45.0, 45.0], "radius": 2.0, "deadline": 10.0, "margin": 0.02}
FILTER = {"kind": "filter", "plant": {"model": "unicycle"}, "barrier": [GOAL]}
PLANT = {"kind": "plant", "plant": {"model": "unicycle"}}
STEP, STEPS, REPEATS = 0.001, 10_000, 5


def fastest(run, clock=time.thread_time):
    """The shortest of some times, in s: by default of this thread on its processor, whatever else runs there."""
    return min(once(run, clock) for _ in range(REPEATS))


def shortest(run, rounds=100):
    """The shortest of many times by the clock, in s: of something short one round at least is not disturbed."""
    return min(once(run) for _ in range(rounds))


def once(run, clock=time.perf_counter):
    begin = clock()
    run()
    return clock() - begin


def resident():
    """Memory of this process in bytes."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


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


def in_rust():
    """Steps of the library, of `cargo bench --bench table`: a name and a time in ns each."""
    command = ["cargo", "bench", "--quiet", "--bench", "table"]
    lines = subprocess.run(command, cwd=Path(__file__).parent, check=True, capture_output=True, text=True).stdout
    return dict(line.split("\t") for line in lines.splitlines() if "\t" in line)


def print_in_rust(times):
    columns = ["pointwise", "1 ms", "10 ms", "50 ms", "backup plan"]
    by_hand = float(times["by hand"])
    print(f"a step in Rust, ns and times by hand ({by_hand:.1f} ns); the default at three periods; with a backup plan at 10 ms")
    print(f"  {'':25}" + "".join(f"{column:>18}" for column in columns))
    for vehicle in ["point mass", "unicycle", "bicycle"]:
        for obstacles in [0, 10]:
            row = f"{vehicle}, {obstacles} obstacles"
            cells = [times[f"{row}, {column}"] for column in columns]
            said = [cell if cell == "refused" else f"{float(cell):.0f} ({float(cell) / by_hand:.0f})" for cell in cells]
            print(f"  {row:25}" + "".join(f"{cell:>18}" for cell in said))


def obstacles(count):
    """Discs beside the way to the goal, as benches/support has them."""
    centres = [[-20.0 + 8.0 * i, 60.0] for i in range(count)]
    return [{"name": f"rock{i}", "shape": "obstacle", "centre": c, "radius": 2.0} for i, c in enumerate(centres)]


def unicycle(x, u):
    return np.stack([x[:, 3] * np.cos(x[:, 2]), x[:, 3] * np.sin(x[:, 2]), u[:, 1], u[:, 0]], axis=1)


def recorded(configuration, n, period, steps):
    """States and reference inputs of `n` closed loops, step after step: what a batch is measured on."""
    rng = np.random.default_rng(1)
    x = rng.uniform([0.0, 0.0, -3.0, 0.0], [30.0, 30.0, 3.0, 10.0], (n, 4))
    batch, samples = punctual.FilterBatch(configuration, n), []
    for k in range(steps):
        u_ref = rng.uniform([-3.0, -1.0], [3.0, 1.0], (n, 2))
        samples.append((k * period, x, u_ref))
        u, _, _ = batch.step(k * period, x, u_ref)
        half = x + period / 2 * unicycle(x, u)
        x = x + period * unicycle(half, u)
    return samples


def cbf(count, backend):
    """cbfpy's filter of the same unicycle, goal and obstacles, with its own default gains: without a deadline."""
    discs = jnp.array([GOAL["centre"], *(disc["centre"] for disc in obstacles(count))])
    signs = jnp.array([1.0] + [-1.0] * count)

    class Discs(cbfpy.CBFConfig):
        def f(self, z):
            return jnp.array([z[3] * jnp.cos(z[2]), z[3] * jnp.sin(z[2]), 0.0, 0.0])

        def g(self, z):
            return jnp.array([[0.0, 0.0], [0.0, 0.0], [0.0, 1.0], [1.0, 0.0]])

        def h_2(self, z):
            away = discs - z[:2]
            return signs * (jnp.sqrt(8.0) - jnp.sqrt((away * away).sum(axis=1) + 4.0))

    tolerance = {"qpax": 1e-3, "elastiqp": 1e-6}[backend]
    return cbfpy.CBF.from_config(Discs(n=4, m=2, backend=backend, solver_tol=tolerance))


def vanilla(count):
    """cbfkit's vanilla controller of the same, with a linear class K function."""

    def dynamics(z):
        drift = jnp.array([z[3] * jnp.cos(z[2]), z[3] * jnp.sin(z[2]), 0.0, 0.0])
        return drift, jnp.array([[0.0, 0.0], [0.0, 0.0], [0.0, 1.0], [1.0, 0.0]])

    def disc(centre, sign):
        def h(state_and_time):
            away = state_and_time[:2] - jnp.array(centre)
            return sign * (jnp.sqrt(8.0) - jnp.sqrt(away @ away + 4.0))

        condition = zeroing_barriers.linear_class_k(1.0)
        return rectify_relative_degree(h, dynamics, 4, form="high-order", certificate_conditions=condition)

    discs = [disc(GOAL["centre"], 1.0), *(disc(rock["centre"], -1.0) for rock in obstacles(count))]
    barriers, limits = concatenate_certificates(*discs), jnp.array([1e3, 1e3])
    controller = vanilla_cbf_clf_qp_controller(control_limits=limits, dynamics_func=dynamics, barriers=barriers)
    key = jax.random.PRNGKey(0)
    return lambda x, u_ref: controller(0.0, x, u_ref, key, ControllerData(sub_data={}))[0]


def in_turn(safe):
    """The filter of many rows, one after the other within one jitted loop."""
    return jax.jit(lambda x, u_ref: jax.lax.map(lambda pair: safe(*pair), (x, u_ref)))


def rivals():
    """The filters of others by name, with how they take many rows: for each number of obstacles and each QP solver."""
    if cbfpy is None:
        print("cbfpy is not installed: pip install cbfpy elastiqp")
        return
    for count in [0, 10]:
        if vanilla_cbf_clf_qp_controller is None:
            print("cbfkit is not installed: https://github.com/bardhh/cbfkit")
            break
        # Under vmap it writes every message that it has for every row, which takes milliseconds.
        yield f"cbfkit, in a loop, {count} obstacles", vanilla(count), in_turn
    for count in [0, 10]:
        for backend in ["qpax", "elastiqp"]:
            # cbfpy itself misses a solver at the first step alone.
            if importlib.util.find_spec(backend) is None:
                print(f"cbfpy ({backend}): not installed: pip install {backend}")
                continue
            safe = cbf(count, backend).safety_filter
            yield f"cbfpy ({backend}), {count} obstacles", safe, lambda safe: jax.jit(jax.vmap(safe))


def single_steps():
    print("a step in Python, unicycle, us; cbfpy has no deadline and looks at the sample alone")
    for count in [0, 10]:
        for sampling in ["measured", "pointwise"]:
            configuration = FILTER | {"barrier": [GOAL, *obstacles(count)], "sampling": sampling}
            samples = [(t, x[0], u_ref[0]) for t, x, u_ref in recorded(configuration, 1, 0.01, 50)]
            own = punctual.Filter(configuration)

            def loop():
                own.reset()
                for t, x, u_ref in samples:
                    own.step(t, x, u_ref).u

            print(f"  Filter.step, {sampling}, {count} obstacles: {1e6 * shortest(loop) / len(samples):.2f}")
    samples = recorded(FILTER, 1, 0.01, 50)
    x, u_ref = (jnp.array([s[i][0] for s in samples]) for i in (1, 2)) if cbfpy else (None, None)
    for name, safe, _ in rivals():
        one, many = jax.jit(safe), in_turn(safe)
        pairs = [(x[k], u_ref[k]) for k in range(len(samples))]

        def calls():
            for pair in pairs:
                one(*pair).block_until_ready()

        # cbfkit tells of every row that its solver gave up.
        with contextlib.redirect_stdout(io.StringIO()):
            times = [shortest(calls), shortest(lambda: many(x, u_ref).block_until_ready())]
        called, within = (1e6 * time / len(samples) for time in times)
        print(f"  {name}: {called:.1f} a jitted call, {within:.1f} within a jitted loop")


def batches(n=4096, period=0.02, first=10, steps=60, rounds=20):
    print(
        f"a batch of {n} unicycles at {1e3 * period:.0f} ms, {os.cpu_count()} cores: ms a step, ns a row, ns of processor a row;"
        f" the first {first} samples of an episode, and the {steps - first} after them"
    )

    def told(name, step, reset=lambda: None, rounds=rounds):
        # The shortest of each sample: what disturbs one of them in one round does not in another.
        best = np.full((2, steps), np.inf)
        for k in [k for _ in range(rounds) for k in range(steps)]:
            if k == 0:
                reset()
            with contextlib.redirect_stdout(io.StringIO()):
                begin = time.perf_counter(), time.process_time()
                step(k)
                spent = time.perf_counter() - begin[0], time.process_time() - begin[1]
                best[:, k] = np.minimum(best[:, k], spent)
        parts = [best[:, part].mean(axis=1) for part in (slice(first), slice(first, None))]
        said = [f"{1e3 * wall:.2f} ms, {1e9 * wall / n:.0f} ns, {1e9 * cpu / n:.0f} ns" for wall, cpu in parts]
        print(f"  {name}: {'; '.join(said)}")

    for count in [0, 10]:
        for sampling in ["measured", "pointwise"]:
            configuration = FILTER | {"barrier": [GOAL, *obstacles(count)], "sampling": sampling}
            samples = recorded(configuration, n, period, steps)
            batch = punctual.FilterBatch(configuration, n)
            told(f"FilterBatch, {sampling}, {count} obstacles", lambda k: batch.step(*samples[k]), batch.reset)
    for name, safe, together in rivals():
        many = together(safe)
        arrays = [(jnp.array(x), jnp.array(u_ref)) for _, x, u_ref in recorded(FILTER, n, period, steps)]
        # Rows that take a tenth of a millisecond need no twenty rounds.
        told(name, lambda k: many(*arrays[k]).block_until_ready(), rounds=2 if together is in_turn else rounds)


def memory(n=100_000):
    """What a row of a batch takes: of a large one, so that memory that was free before does not count."""
    configurations = {"1 barrier": FILTER, "11 barriers": FILTER | {"barrier": [GOAL, *obstacles(10)]}}
    batches, said = [], []
    for name, configuration in configurations.items():
        before = resident()
        batches.append(punctual.FilterBatch(configuration, n))
        said.append(f"{(resident() - before) / n:.0f} ({name})")
    print(f"memory of a row of FilterBatch, bytes: {', '.join(said)}")


def in_python():
    for sampling in ["measured", "pointwise"]:
        configuration = FILTER | {"sampling": sampling}
        print(f"filter and plant as FMUs, sampling = {sampling}")
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


def campaigns():
    """Runs of the example's campaign: by the program, on two workers of Dask, and by FMPy."""
    print("a campaign, runs of 10,000 steps (examples/campaign): for each second of one processor, and of the clock")
    for sampling, runs in [("measured", 3000), ("pointwise", 5000)]:
        with tempfile.TemporaryDirectory() as work:
            file = campaign_in(Path(work), sampling, runs)
            before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
            command = [Path(punctual.__file__).parent / "_bin" / "punctual", "campaign", file]
            subprocess.run(command, cwd=work, check=True, capture_output=True)
            wall = time.perf_counter() - begin
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
            print(f"  {sampling}: {runs / spent:.0f}; {runs / wall:.0f}")
            if distributed:
                # The workers have started before.
                with distributed.Client(n_workers=2, threads_per_worker=1, dashboard_address=None) as client:
                    wall = once(lambda: punctual.campaign(str(file), str(Path(work, "dask.parquet")), client=client))
                same = file.with_suffix(".parquet").read_bytes() == Path(work, "dask.parquet").read_bytes()
                print(f"  {sampling}, two workers of Dask: {runs / wall:.0f} of the clock; the file is the same: {same}")
            else:
                print("  Dask is not installed: pip install 'punctual-filter[dask]'")
            simulation = fmpy_runs.Simulation(*fmpy_runs.read(file), work)
            text = subprocess.run([*command, "--list", "0..3", "--json"], cwd=work, check=True, capture_output=True).stdout
            drawn = json.loads(text)
            spent = min(once(lambda run=run: simulation.run(run), time.process_time) for run in drawn)
            print(f"  {sampling}, FMPy's library calls (fmpy_runs.py): {1 / spent:.1f}")


def campaign_in(folder, sampling, runs):
    """The example's campaign in a folder of its own."""
    for name in EXAMPLE.glob("*.toml"):
        text = name.read_text()
        if name.name == "unicycle-filter.toml":
            text = f'sampling = "{sampling}"\n' + text
        Path(folder, name.name).write_text(text.replace("runs = 1000", f"runs = {runs}"))
    for name in ["unicycle-filter", "unicycle-plant"]:
        punctual.build(str(Path(folder, f"{name}.toml")), str(Path(folder, f"{name}.fmu")))
    return folder / "unicycle.toml"


def main():
    print_in_rust(in_rust())
    single_steps()
    batches()
    memory()
    in_python()
    campaigns()


if __name__ == "__main__":
    main()
