"""Couple a filter FMU with a plant FMU in a plain FMPy loop, and see the deadline kept.

    cargo build --release
    target/release/punctual demo --out out/demo
    python examples/fmpy_loop.py out/demo

The loop is the one to copy: state to the filter, step the filter, its input to the plant, step the plant.
"""

import shutil
import sys

from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave


def load(path):
    """The FMU at `path`, ready to step, and its value references by name."""
    description = read_model_description(path)
    folder = extract(path)
    fmu = FMU2Slave(
        guid=description.guid,
        unzipDirectory=folder,
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName=description.modelName,
    )
    fmu.instantiate()
    fmu.setupExperiment(startTime=0.0)
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    return fmu, {v.name: v.valueReference for v in description.modelVariables}, folder


folder = sys.argv[1] if len(sys.argv) > 1 else "out/demo"
safety, f, safety_folder = load(f"{folder}/unicycle-reference_profile-filter.fmu")
plant, p, plant_folder = load(f"{folder}/unicycle-plant.fmu")

states = ["x.x_p", "x.y_p", "x.theta", "x.v"]
inputs = ["u.a", "u.omega"]
step, deadline, stop = 0.001, 10.0, 12.0
arrival = None

for k in range(round(stop / step)):
    t = k * step
    x = plant.getReal([p[name] for name in states])
    safety.setReal([f[name] for name in states], x)
    safety.setReal([f["u_ref.a"]], [-x[3]])  # the nominal controller: damping
    safety.doStep(t, step)
    u = safety.getReal([f[name] for name in inputs])
    h = safety.getReal([f["goal.h"]])[0]
    if h >= 0.0 and arrival is None:
        arrival = t
    assert t < deadline or h >= 0.0, f"outside at t = {t}: h = {h}"
    plant.setReal([p[name] for name in inputs], u)
    plant.doStep(t, step)

print(f"inside at t = {arrival:.3f} s (deadline {deadline} s), and still at t = {stop} s with h = {h:.3f} m")
assert arrival is not None and arrival <= deadline

for fmu, unpacked in [(safety, safety_folder), (plant, plant_folder)]:
    fmu.terminate()
    fmu.freeInstance()
    shutil.rmtree(unpacked)
