"""Models given by expressions, from their configurations to FMPy's own loop."""

import shutil

import pytest
from conftest import ROOT, punctual
from fmpy import extract, read_model_description, simulate_fmu
from fmpy.fmi2 import FMU2Slave
from fmpy.validation import validate_fmu

STEP, DEADLINE, STOP = 0.01, 4.0, 8.0


@pytest.fixture(scope="module")
def car(tmp_path_factory):
    """A folder with the two configurations of the jerk car, and their FMUs."""
    folder = tmp_path_factory.mktemp("car")
    for name in ["jerk-car-filter", "jerk-car-plant", "jerk-car"]:
        shutil.copy(ROOT / "examples" / "models" / f"{name}.toml", folder)
    printed = punctual("check", "jerk-car-filter.toml", "--plant", "jerk-car-plant.toml", cwd=folder).stdout
    assert "relative degree  3" in printed and "on course" in printed
    for name in ["jerk-car-filter", "jerk-car-plant"]:
        punctual("build", f"{name}.toml", "-o", f"{name}.fmu", cwd=folder)
    return folder


def load(path):
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
    return fmu, {v.name: v.valueReference for v in description.modelVariables}


@pytest.mark.parametrize("name", ["filter", "plant"])
def test_the_fmus_are_valid(car, name):
    path = str(car / f"jerk-car-{name}.fmu")
    assert validate_fmu(path) == []
    description = read_model_description(path)
    units = {v.name: v.unit for v in description.modelVariables}
    if name == "filter":
        assert (units["u.jerk"], units["d"], units["merge.slack"]) == ("m/s3", "m", "m/s3")
    else:
        assert (units["u.jerk"], units["x.acc"], units["x0.v"]) == ("m/s3", "m/s2", "m/s")


# The second merge point is another value of the model's parameter.
@pytest.mark.parametrize("merge", [60.0, 70.0])
def test_the_deadline_is_kept(car, merge):
    safety, f = load(str(car / "jerk-car-filter.fmu"))
    plant, p = load(str(car / "jerk-car-plant.fmu"))
    safety.setReal([f["d"]], [merge])
    for fmu in [safety, plant]:
        fmu.enterInitializationMode()
        fmu.exitInitializationMode()
    for k in range(round(STOP / STEP)):
        x = plant.getReal([p[name] for name in ["x.p", "x.v", "x.acc"]])
        safety.setReal([f[name] for name in ["x.p", "x.v", "x.acc"]], x)
        safety.doStep(k * STEP, STEP)
        assert safety.getInteger([f["status"]])[0] <= 1
        assert k * STEP < DEADLINE or x[0] >= merge, f"t = {k * STEP}: {x}"
        assert x[1] <= 40.0
        plant.setReal([p["u.jerk"]], safety.getReal([f["u.jerk"]]))
        plant.doStep(k * STEP, STEP)
    for fmu in [safety, plant]:
        fmu.terminate()
        fmu.freeInstance()


def test_the_plant_alone_is_a_polynomial(car):
    start = {"x0.v": 3.0, "x0.acc": -1.0, "u.jerk": 0.5}
    result = simulate_fmu(str(car / "jerk-car-plant.fmu"), start_values=start, stop_time=2.0, output_interval=0.01)
    t = result["time"]
    # The classical Runge-Kutta method is exact here, which leaves round-off of 2000 steps.
    assert abs(result["x.p"] - (3 * t - t**2 / 2 + 0.5 * t**3 / 6)).max() < 1e-11


def test_a_state_outside_the_domain_is_a_status(tmp_path):
    text = (
        'kind = "filter"\n[plant]\nstates = [{ name = "x" }]\ninputs = [{ name = "w" }]\n'
        'derivatives = { x = "w" }\n[[barrier]]\nname = "low"\nexpression = "2 - sqrt(x)"\ndeadline = 1.0\n'
    )
    (tmp_path / "f.toml").write_text(text)
    punctual("build", "f.toml", "-o", "f.fmu", cwd=tmp_path)
    fmu, v = load(str(tmp_path / "f.fmu"))
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    statuses = []
    for k, x in enumerate([9.0, -1.0, 1.0]):
        fmu.setReal([v["x.x"]], [x])
        fmu.doStep(0.01 * k, 0.01)
        statuses.append(fmu.getInteger([v["status"]])[0])
        assert abs(fmu.getReal([v["u.w"]])[0]) < 1e6
    # 1: filtered, 5: singular, 0: unchanged.
    assert statuses == [1, 5, 0]
    fmu.terminate()
    fmu.freeInstance()
