"""`punctual identify` with the plant of another tool: what differs is named, declared, and a promise holds that is broken
without."""

import json
import os
import subprocess
import sys

import pytest

from conftest import ROOT, punctual
from HeavyCart import FRICTION, MASS
from test_foreign_plant import libpython

FILTER = """kind = "filter"
experiment = { step_size = 0.02, stop_time = 10.0 }
[plant]
states = [{ name = "p", unit = "m" }, { name = "v", unit = "m/s" }]
inputs = [{ name = "F", unit = "N", min = -8.0, max = 8.0 }]
parameters = [{ name = "m", start = 2.0, unit = "kg" }, { name = "c", start = 0.5, unit = "kg/s" }]
derivatives = { p = "v", v = "(F - c * v) / m" }
[[barrier]]
name = "wall"
expression = "12 - p"
unit = "m"
[[barrier]]
name = "there"
expression = "p - 8"
unit = "m"
deadline = 6.0
"""
# The controller pushes with all its force at the wall.
SYSTEM = """[experiment]
stop_time = 10.0
step = 0.02
[[component]]
name = "filter"
fmu = "FILTER"
start = { "u_ref.F" = 8.0 }
[[component]]
name = "plant"
fmu = "HeavyCart.fmu"
feedthrough = false
connection = [{ from = "filter.u.F", to = "plant.force" }, { from = "plant.position", to = "filter.x.p" },
              { from = "plant.speed", to = "filter.x.v" }]
"""
COLUMNS = ["--column", "p=position", "--column", "v=speed", "--column", "F=force"]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    build = [sys.executable, "-m", "pythonfmu", "build", "-f", ROOT / "tests" / "interop" / "HeavyCart.py"]
    subprocess.run([*build, "-d", tmp_path, "--no-external-tool"], check=True)
    (tmp_path / "cart.toml").write_text(FILTER)
    connected = SYSTEM.split("connection = ")
    for name in ["cart", "declared"]:
        # The keys of the file come before its tables.
        text = "connection = " + connected[1] + connected[0].replace("FILTER", f"{name}.toml")
        (tmp_path / f"{name}-system.toml").write_text(text)
    monkeypatch.setenv("LD_PRELOAD", str(libpython()))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(p for p in sys.path if p))
    return tmp_path


def test_a_heavier_cart_is_named_and_declared(folder):
    done = punctual(
        "identify", "cart.toml", "HeavyCart.fmu", *COLUMNS, "--write", "declared.toml", "--json", cwd=folder
    )
    report = json.loads(done.stdout)
    assert report["explained"] == report["holds"] == 1000
    named = {e["parameter"]: e["value"] for e in report["difference"]["explanations"] if e["cause"] == "parameter"}
    # Each by itself, beside the other.
    assert abs(named["m"] - MASS) < 0.01 * MASS and abs(named["c"] - FRICTION) < 0.05 * FRICTION, named
    kinds = [(f["kind"], f["name"]) for f in report["findings"]]
    assert kinds == [("gain", "F"), ("rate", "v")], kinds
    # Without it the wall is run through, and the run says why.
    lost = punctual("run", "cart-system.toml", "--out", "lost", cwd=folder, check=False)
    assert lost.returncode == 1 and "the plant is not the model: c = 0.3" in lost.stderr, lost
    # With it the wall is kept, though the cart is faster than it was recorded to be.
    punctual("run", "declared-system.toml", "--require", "kept", cwd=folder)
