"""Derivatives as inputs: valid for FMPy, and the same numbers as the filter with the model."""

import pytest
from conftest import punctual
from fmpy import read_model_description
from fmpy.validation import validate_fmu
from test_models import load

STEP, DEADLINE = 0.01, 2.0

BARRIER = """
[[barrier]]
name = "wall"
deadline = 2.0
unit = "m"
margin = 0.1
"""
OWN = """kind = "filter"
sampling = "pointwise"
[plant]
states = [{ name = "p", unit = "m" }, { name = "v", unit = "m/s" }]
inputs = [{ name = "a", unit = "m/s2" }]
parameters = [{ name = "c", start = 1.0, unit = "s/m2" }]
derivatives = { p = "v", v = "a - c * v^3" }
"""
GIVEN = """kind = "filter"
[plant]
inputs = [{ name = "a", unit = "m/s2" }]
"""


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """The same filter twice: with expressions, and with the derivatives as inputs."""
    folder = tmp_path_factory.mktemp("external")
    texts = {
        "own": OWN + BARRIER + 'expression = "3 - p"\n',
        "given": GIVEN + BARRIER + "relative_degree = 2\n",
    }
    for name, text in texts.items():
        (folder / f"{name}.toml").write_text(text)
        punctual("build", f"{name}.toml", "-o", f"{name}.fmu", cwd=folder)
    return folder


def test_it_is_valid(built):
    path = str(built / "given.fmu")
    assert validate_fmu(path) == []
    variables = {v.name: v for v in read_model_description(path).modelVariables}
    units = {"wall.lf0": "m", "wall.lf1": "m/s", "wall.lf2": "m/s2", "wall.lg.a": "1"}
    assert {name: variables[name].unit for name in units} == units
    assert all(variables[name].causality == "input" for name in units)


def test_the_numbers_of_the_filter_that_has_the_model(built):
    own, o = load(str(built / "own.fmu"))
    given, g = load(str(built / "given.fmu"))
    for fmu in [own, given]:
        fmu.enterInitializationMode()
        fmu.exitInitializationMode()
    p, v, statuses = 5.0, 1.0, set()
    for k in range(round(2 * DEADLINE / STEP)):
        own.setReal([o["x.p"], o["x.v"]], [p, v])
        # h = 3 - p, h' = -v, h'' = v^3 - a.
        names = ["wall.lf0", "wall.lf1", "wall.lf2", "wall.lg.a"]
        given.setReal([g[name] for name in names], [3.0 - p, -v, v**3, -1.0])
        for fmu in [own, given]:
            fmu.doStep(k * STEP, STEP)
        a = given.getReal([g["u.a"]])[0]
        # They compute h and its derivatives from p and v with different operations, so round-off differs.
        assert abs(a - own.getReal([o["u.a"]])[0]) <= 1e-9 * (1.0 + abs(a)), f"t = {k * STEP}"
        status = given.getInteger([g["status"]])
        assert status == own.getInteger([o["status"]])
        statuses.update(status)
        assert k * STEP < DEADLINE or p <= 3.0, f"outside at t = {k * STEP}"
        p, v = p + STEP * v + STEP**2 / 2 * (a - v**3), v + STEP * (a - v**3)
    assert statuses <= {0, 1} and 1 in statuses
    for fmu in [own, given]:
        fmu.terminate()
        fmu.freeInstance()
