"""A model as compiled code in FMPy's own loop: bitwise the same as with expressions."""

import os
import subprocess
import sys

import pytest
from conftest import ROOT, punctual
from fmpy.validation import validate_fmu
from test_models import load

STEP, DEADLINE, STOP = 0.01, 4.0, 8.0


def library(name):
    """The file of the plug-in `name` on this platform."""
    return {"win32": f"{name}.dll", "darwin": f"lib{name}.dylib"}.get(sys.platform, f"lib{name}.so")


@pytest.fixture(scope="module")
def cars(tmp_path_factory):
    """Folders with the FMUs of the jerk car, once with expressions and once with a plug-in in C."""
    folders = {}
    for kind in ["models", "plugin"]:
        folder = folders[kind] = tmp_path_factory.mktemp(kind)
        if kind == "plugin":
            source, header = ROOT / "examples" / "plugin" / "jerk_car.c", ROOT / "fmu" / "include"
            compiler = [os.environ.get("CC", "cc"), "-std=c99", "-O2", "-shared", "-fPIC", f"-I{header}"]
            subprocess.run([*compiler, "-o", str(folder / library("jerk_car")), str(source)], check=True)
        for part in ["filter", "plant"]:
            text = (ROOT / "examples" / kind / f"jerk-car-{part}.toml").read_text()
            if kind == "models":
                # A plug-in has no margin by default, since its expressions are not known.
                text = text.replace('expression = "v_max - v"', 'expression = "v_max - v"\nmargin = 0.0')
            (folder / f"jerk-car-{part}.toml").write_text(text)
            punctual("build", f"jerk-car-{part}.toml", "-o", f"{part}.fmu", cwd=folder)
    return folders


def drive(folder, merge):
    """Inputs and states of a run of filter and plant from the FMUs' own start."""
    (safety, f), (plant, p) = load(str(folder / "filter.fmu")), load(str(folder / "plant.fmu"))
    safety.setReal([f["d"]], [merge])
    for fmu in [safety, plant]:
        fmu.enterInitializationMode()
        fmu.exitInitializationMode()
    rows = []
    for k in range(round(STOP / STEP)):
        x = plant.getReal([p[name] for name in ["x.p", "x.v", "x.acc"]])
        safety.setReal([f[name] for name in ["x.p", "x.v", "x.acc"]], x)
        safety.doStep(k * STEP, STEP)
        assert safety.getInteger([f["status"]])[0] <= 1
        u = safety.getReal([f["u.jerk"]])
        plant.setReal([p["u.jerk"]], u)
        plant.doStep(k * STEP, STEP)
        rows.append([*x, *u])
    for fmu in [safety, plant]:
        fmu.terminate()
        fmu.freeInstance()
    return rows


# The second merge point is another value of the plug-in's parameter.
@pytest.mark.parametrize("merge", [60.0, 70.0])
def test_the_plug_in_is_its_expressions(cars, merge):
    rows = drive(cars["plugin"], merge)
    assert rows == drive(cars["models"], merge)
    assert all(x[0] >= merge for x in rows[round(DEADLINE / STEP) :])


@pytest.mark.parametrize("part", ["filter", "plant"])
def test_the_fmus_are_valid(cars, part):
    assert validate_fmu(str(cars["plugin"] / f"{part}.fmu")) == []


def test_two_instances_share_a_plug_in(cars):
    """The library stays loaded as long as one of them needs it."""
    path = str(cars["plugin"] / "plant.fmu")
    (first, p), (second, _) = load(path), load(path)
    for fmu in [first, second]:
        fmu.enterInitializationMode()
        fmu.exitInitializationMode()
        fmu.doStep(0.0, STEP)
    first.terminate()
    first.freeInstance()
    second.doStep(STEP, STEP)
    assert second.getReal([p["x.p"]])[0] == pytest.approx(0.2, rel=1e-12)
    second.terminate()
    second.freeInstance()
