"""A foreign plant, an FMU that pythonfmu builds from a Python class, coupled with our filter
in FMPy and in `punctual run`."""

import csv
import os
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

from conftest import ROOT, punctual
from coupling import couple

EXAMPLES = ROOT / "examples" / "vehicles"
STOP, STEP, DEADLINE = 20.0, 0.001, 10.0
# Both plants integrate with Runge-Kutta methods of order 4 at 1 ms, with other round-off: some 1e-16 of
# states up to 45 at each of 20,000 steps (1e-10), times the rates of the closed loop (up to 2/s on the
# speed, squared for the input).
TOLERANCE = 1e-8


def libpython():
    """The library of the running Python, which a host that is not Python must load before the FMU."""
    name, folder = sysconfig.get_config_vars("INSTSONAME", "LIBDIR")
    path = Path(folder) / name
    assert path.exists(), f"this test needs a Python with a shared library; there is no {path}"
    return path


def records(path):
    with open(path, newline="") as file:
        return [{k: float(v) for k, v in row.items()} for row in csv.DictReader(file)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The example with our plant, and with the one in Python."""
    folder = tmp_path_factory.mktemp("foreign")
    for name in ["unicycle.toml", "foreign.toml"]:
        shutil.copy(EXAMPLES / name, folder)
    for part in ["filter", "plant"]:
        punctual("build", EXAMPLES / f"unicycle-{part}.toml", "-o", folder / f"unicycle-{part}.fmu")
    build = [sys.executable, "-m", "pythonfmu", "build", "-f", EXAMPLES / "UnicycleInPython.py"]
    subprocess.run([*build, "-d", folder, "--no-external-tool"], check=True)
    punctual("run", "unicycle.toml", "--require", "nothing", "--out", "out", cwd=folder)
    return folder


def differences(rows, wanted):
    """The largest difference of each common variable."""
    assert len(rows) == len(wanted)
    names = sorted(rows[0].keys() & wanted[0].keys() - {"time"})
    assert {"plant.x.x_p", "plant.x.theta", "filter.u.a", "filter.goal.h"} <= set(names)
    return {name: max(abs(row[name] - other[name]) for row, other in zip(rows, wanted)) for name in names}


def test_in_fmpy_it_moves_like_ours(folder):
    damping = {"u_ref.a": "x.v"}
    filter_, plant = folder / "unicycle-filter.fmu", folder / "UnicycleInPython.fmu"
    rows = list(couple(filter_, plant, damping, STOP, STEP))
    found = differences([row for _, row in rows], records(folder / "out" / "unicycle.csv"))
    print("\nlargest differences", {name: f"{value:.1e}" for name, value in found.items() if value})
    assert max(found.values()) < TOLERANCE, found
    assert all(row["filter.goal.h"] >= 0.0 for t, row in rows if t >= DEADLINE - STEP / 2)


def test_what_it_takes_is_told(folder, monkeypatch):
    monkeypatch.delenv("LD_PRELOAD", raising=False)
    done = punctual("run", "foreign.toml", "--out", "out", cwd=folder, check=False)
    assert done.returncode == 1 and "undefined symbol" in done.stderr, done
    assert "start this one with LD_PRELOAD=FOLDER/libpython3.X.so" in done.stderr, done


def test_in_punctual_run_too(folder, monkeypatch):
    # The interpreter in the FMU finds its modules (pythonfmu) as this one does.
    monkeypatch.setenv("LD_PRELOAD", str(libpython()))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(p for p in sys.path if p))
    done = punctual("run", "foreign.toml", "--require", "nothing", "--out", "out", cwd=folder)
    monkeypatch.undo()
    assert "closes a loop" not in done.stderr
    rows, own = (records(folder / "out" / f"{name}.csv") for name in ["foreign", "unicycle"])
    found = differences(rows, own)
    print("\nlargest differences", {name: f"{value:.1e}" for name, value in found.items() if value})
    assert max(found.values()) < TOLERANCE, found
