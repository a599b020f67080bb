"""Foreign FMUs of FMI 3.0: one in C with a variable of every type and with arrays, and one that
PythonFMU3 builds from a Python class. `punctual run` and FMPy must give the same numbers."""

import csv
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
from fmpy import simulate_fmu
from fmpy.validation import validate_fmu

from conftest import punctual
from test_foreign_plant import libpython

STOP, STEP = 1.0, 0.1
# FMPy computes the times of steps differently, so that the last digit of t and h may differ.
TOLERANCE = 1e-14


def rows(path):
    with open(path, newline="") as file:
        header, *rows = csv.reader(file)
    return {name: np.array([float(row[c]) for row in rows]) for c, name in enumerate(header)}


def system(folder, name, start, more=""):
    (folder / f"{name}.toml").write_text(
        f"[experiment]\nstop_time = {STOP}\nstep = {STEP}\n"
        f'[[component]]\nname = "c"\nfmu = "{name}.fmu"\n{more}start = {{ {start} }}\n'
    )


def compared(folder, name, start_values, output):
    """The largest difference between the results of `punctual run` and of FMPy, by output."""
    found = rows(folder / "out" / f"{name}.csv")
    wanted = simulate_fmu(
        str(folder / f"{name}.fmu"),
        stop_time=STOP,
        step_size=STEP,
        output_interval=STEP,
        start_values=start_values,
        output=output,
    )
    differences = {}
    for variable in output:
        column = np.asarray(wanted[variable], dtype=float)
        for i, values in enumerate(column.reshape(len(column), -1).T):
            own = f"c.{variable}" if column.ndim == 1 else f"c.{variable}[{i + 1}]"
            differences[own] = np.abs(found[own] - values).max()
    return differences


def test_both_find_nothing_wrong_with_it(sundry):
    assert validate_fmu(str(sundry / "sundry.fmu")) == []
    done = punctual("validate", "sundry.fmu", cwd=sundry)
    assert done.stdout == "sundry.fmu: no errors, no warnings\n", done


def test_every_type_and_arrays(sundry):
    system(
        sundry,
        "sundry",
        'u = [1.5, -2], "m[2,3]" = 10, in_float32 = 0.1, in_int8 = -128, in_uint8 = 255, in_int16 = -32768, '
        "in_uint16 = 65535, in_int32 = -7, in_uint32 = 4294967295, in_int64 = -9007199254740992, "
        "in_uint64 = 9007199254740992, in_boolean = true, in_enumeration = 5000000000",
    )
    punctual("run", "sundry.toml", "--require", "nothing", "--out", "out", cwd=sundry)
    start = {
        "u": [1.5, -2.0],
        "m": [1.0, 2.0, 3.0, 4.0, 5.0, 10.0],
        "in_float32": 0.1,
        "in_int8": -128,
        "in_uint8": 255,
        "in_int16": -32768,
        "in_uint16": 65535,
        "in_int32": -7,
        "in_uint32": 4294967295,
        "in_int64": -9007199254740992,
        "in_uint64": 9007199254740992,
        "in_boolean": True,
        "in_enumeration": 5000000000,
    }
    output = ["y", "z", "s", *(name.replace("in_", "out_") for name in start if name.startswith("in_"))]
    found = compared(sundry, "sundry", start, output)
    assert len(found) == 15 and max(found.values()) <= TOLERANCE, found


PLANT = '''
from pythonfmu3 import Boolean, Fmi3Causality, Fmi3Slave, Fmi3Variability, Float64, Int32

class Lag(Fmi3Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.time, self.rate, self.u, self.y, self.steps = 0.0, 0.5, 0.0, 1.0, 0
        continuous = Fmi3Variability.continuous
        self.register_variable(Float64("time", causality=Fmi3Causality.independent, variability=continuous))
        self.register_variable(
            Float64("rate", causality=Fmi3Causality.parameter, variability=Fmi3Variability.tunable, start=0.5)
        )
        self.register_variable(Float64("u", causality=Fmi3Causality.input, variability=continuous, start=0.0))
        self.register_variable(Float64("y", causality=Fmi3Causality.output, variability=continuous))
        self.register_variable(
            Int32("steps", causality=Fmi3Causality.output, variability=Fmi3Variability.discrete)
        )

    def do_step(self, time, step):
        self.y += step * self.rate * (self.u - self.y)
        self.steps += 1
        return True
'''


def test_a_plant_of_pythonfmu3(tmp_path, monkeypatch):
    (tmp_path / "lag.py").write_text(PLANT)
    build = [sys.executable, "-m", "pythonfmu3", "build", "-f", "lag.py"]
    subprocess.run(build, check=True, cwd=tmp_path, capture_output=True)
    shutil.move(tmp_path / "Lag.fmu", tmp_path / "lag.fmu")
    system(tmp_path, "lag", "u = 3, rate = 0.25", "feedthrough = false\n")
    monkeypatch.setenv("LD_PRELOAD", str(libpython()))
    monkeypatch.setenv("PYTHONHOME", sys.base_prefix)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(p for p in sys.path if p))
    # When its process ends, the library of PythonFMU3 0.3.4 reads freed memory, which may cause an abort.
    # The results are written by then.
    done = punctual("run", "lag.toml", "--out", "out", cwd=tmp_path, check=False)
    monkeypatch.undo()
    assert done.returncode in (0, -6, -11) and "written: " in done.stdout, done
    found = compared(tmp_path, "lag", {"u": 3.0, "rate": 0.25}, ["y", "steps"])
    assert max(found.values()) <= TOLERANCE, found
    assert rows(Path(tmp_path) / "out" / "lag.csv")["c.steps"][-1] == 10
