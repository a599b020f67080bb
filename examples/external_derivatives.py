"""A simulator that computes the derivatives of its barriers itself, and has them filtered.

    cargo build --release
    python examples/external_derivatives.py

The plant and its barriers are known to this script only; the filter gets numbers.
"""

import math
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave

ROOT = Path(__file__).resolve().parents[1]
GOAL, RADIUS, FASTEST = (12.0, 5.0), 2.0, 8.0
STEP, DEADLINE, STOP = 0.01, 5.0, 8.0


def goal(p, v):
    """h = sqrt(2) R - sqrt(d^2 + R^2), >= 0 in the disc: lf0, lf1, lf2 and the row lg."""
    r = [p[0] - GOAL[0], p[1] - GOAL[1]]
    s = math.hypot(*r, RADIUS)
    radial = (r[0] * v[0] + r[1] * v[1]) / s
    drift = (radial**2 - v[0] ** 2 - v[1] ** 2) / s
    return [math.sqrt(2) * RADIUS - s, -radial, drift, -r[0] / s, -r[1] / s]


def speed(v):
    """h = V - sqrt(|v|^2 + 1) >= 0, which an acceleration enters at once: lf0, lf1 and the row lg."""
    s = math.hypot(*v, 1.0)
    return [FASTEST - s, 0.0, -v[0] / s, -v[1] / s]


def names(barrier, n):
    return [f"{barrier}.lf{k}" for k in range(n + 1)] + [f"{barrier}.lg.u_x", f"{barrier}.lg.u_y"]


def main():
    with tempfile.TemporaryDirectory() as folder:
        path = f"{folder}/filter.fmu"
        binary = sys.argv[1] if len(sys.argv) > 1 else ROOT / "target" / "release" / "punctual"
        example = ROOT / "examples" / "models" / "external-filter.toml"
        subprocess.run([binary, "build", example, "-o", path], check=True, stdout=subprocess.DEVNULL)
        description = read_model_description(path)
        unpacked = extract(path)
    fmu = FMU2Slave(
        guid=description.guid,
        unzipDirectory=unpacked,
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="safety",
    )
    reference = {v.name: v.valueReference for v in description.modelVariables}
    wanted = ["u_ref.u_x", "u_ref.u_y"]
    inputs = [reference[name] for name in names("goal", 2) + names("speed", 1) + wanted]
    fmu.instantiate()
    fmu.setupExperiment(startTime=0.0)
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    p, v = [0.0, 0.0], [0.0, 2.0]
    for k in range(round(STOP / STEP)):
        damping = [-v[0], -v[1]]
        fmu.setReal(inputs, goal(p, v) + speed(v) + damping)
        fmu.doStep(k * STEP, STEP)
        u = fmu.getReal([reference["u.u_x"], reference["u.u_y"]])
        assert fmu.getInteger([reference["status"]])[0] <= 1, "unchanged or filtered"
        assert k * STEP < DEADLINE or goal(p, v)[0] >= 0.0, f"outside at t = {k * STEP}"
        assert speed(v)[0] >= 0.0, f"too fast at t = {k * STEP}"
        p = [a + STEP * b + STEP**2 / 2 * c for a, b, c in zip(p, v, u)]
        v = [b + STEP * c for b, c in zip(v, u)]
    print(f"inside by {DEADLINE} s and never faster than {FASTEST} m/s; at t = {STOP} s h = {goal(p, v)[0]:.3f} m")
    fmu.terminate()
    fmu.freeInstance()
    shutil.rmtree(unpacked)


main()
