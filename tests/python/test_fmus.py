"""`build`, `check`, `variables` and `run_cli`: the command line by way of the package."""

import copy
import math
import pickle
import shutil
import subprocess
import sys
import warnings
import zipfile
from pathlib import Path

import numpy as np
import punctual
import pytest

from conftest import ASSURED, FILTER, PLANT, ROOT, STEP, goal


def test_a_dict_and_a_file_of_the_same_content_make_the_same_fmu(tmp_path):
    file = ROOT / "examples" / "vehicles" / "unicycle-filter.toml"
    text = {
        "kind": "filter",
        "name": "unicycle_filter",
        "plant": {"model": "unicycle"},
        "barrier": [
            # Types of numbers that programs have.
            {"name": "goal", "centre": np.array([45, 45.0]), "radius": np.float64(2.0), "deadline": 10, "margin": 0.02}
        ],
        "bounds": {},
        "experiment": {"stop_time": np.int64(20), "step_size": 0.001},
    }
    paths = punctual.build(file, tmp_path / "a.fmu"), punctual.build(text, str(tmp_path / "b.fmu"))
    assert paths == (tmp_path / "a.fmu", tmp_path / "b.fmu")
    assert paths[0].read_bytes() == paths[1].read_bytes()


def test_the_library_inside_is_the_one_of_the_package(tmp_path, fmus):
    library = Path(punctual.__file__).parent / "_bin" / "libpunctual_fmu.so"
    own = zipfile.ZipFile(fmus[0]).read("binaries/linux64/unicycle_filter.so")
    assert own == library.read_bytes()
    shutil.copy(library, tmp_path / "other.so")
    other = punctual.build(FILTER, tmp_path / "filter.fmu", library=tmp_path / "other.so")
    assert other.read_bytes() == fmus[0].read_bytes()
    with pytest.raises(punctual.Error, match="none.so"):
        punctual.build(FILTER, tmp_path / "filter.fmu", library=tmp_path / "none.so")


def test_a_refused_dict_is_told_without_a_file_name(tmp_path):
    with pytest.raises(punctual.Error, match=r"^barrier\[0\]\.radius: is -1, must be ") as refused:
        punctual.build(FILTER | {"barrier": [goal(radius=-1.0)]}, tmp_path / "filter.fmu")
    assert isinstance(refused.value, ValueError)
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "filter.toml").write_text("kind = 1\n")
    with pytest.raises(punctual.Error, match="filter.toml: kind: "):
        punctual.build(tmp_path / "filter.toml", tmp_path / "filter.fmu")
    with pytest.raises(TypeError, match=r"plant.parameters\[0\].start: is \{1\}, must be a number"):
        punctual.build({"plant": {"parameters": [{"start": {1}}]}}, tmp_path / "filter.fmu")


def test_a_plugin_of_a_dict_is_looked_for_in_the_current_folder(tmp_path, monkeypatch):
    header = ROOT / "fmu" / "include"
    source = ROOT / "examples" / "plugin" / "jerk_car.c"
    command = ["cc", "-O2", "-shared", "-fPIC", f"-I{header}", source, "-o", tmp_path / "libjerk_car.so", "-lm"]
    subprocess.run(command, check=True)
    filter_ = {"kind": "filter", "plant": {"plugin": "jerk_car"}, "barrier": [{"name": "merge", "deadline": 4.0}]}
    monkeypatch.chdir(tmp_path)
    punctual.build(filter_, "filter.fmu")
    assert punctual.Filter(filter_).states == {"p": "m", "v": "m/s", "acc": "m/s2"}
    assert sorted(p.name for p in tmp_path.iterdir()) == ["filter.fmu", "libjerk_car.so"]
    # A pickle knows where it lies, from any folder, and notices one with other bytes.
    pickled = pickle.dumps(punctual.Filter(filter_))
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    assert pickle.loads(pickled).states == {"p": "m", "v": "m/s", "acc": "m/s2"}
    subprocess.run([*command, "-DOTHER", "-O1"], check=True)
    with pytest.raises(punctual.Error, match=r"^plant\.plugin_digest: "):
        pickle.loads(pickled)
    (tmp_path / "libjerk_car.so").unlink()
    with pytest.raises(punctual.Error, match=r"^plant\.plugin: is \"jerk_car\", but .*libjerk_car\.so cannot be read"):
        pickle.loads(pickled)


def test_check_is_what_the_command_line_says():
    report = punctual.check(FILTER, x0={"v": 2.0})
    assert [barrier["relative_degree"] for barrier in report["barriers"]] == [2, 2]
    assert report["barriers"][0]["start"]["on_course"] is True
    assert punctual.check(FILTER, plant=PLANT)["barriers"] == report["barriers"]
    # A deadline that the bounds do not allow is an answer, not an error.
    lost = punctual.check(FILTER | {"barrier": [goal(deadline=0.5)]}, x0={"v": 2.0})
    assert lost["barriers"][0]["start"]["reach"]["deadline"] == "cannot_be_met"
    with pytest.raises(punctual.Error, match="x0"):
        punctual.check(FILTER, x0={"w": 2.0})


def test_the_variables_of_an_fmu(fmus):
    variables = {v.name: v for v in punctual.variables(fmus[0])}
    a = variables["u_max.a"]
    assert (a.type, a.causality, a.variability, a.unit, a.start) == ("Real", "parameter", "fixed", "m/s2", 20.0)
    assert a.minimum < -1e29 and a.maximum > 1e29 and a.description and a.items == {}
    status = variables["status"]
    assert status.type == "Enumeration" and status.items["filtered"] == 1 and status.start is None
    assert variables["rearm"].start is False
    assert sorted(v.value_reference for v in variables.values()) == list(range(len(variables)))
    with pytest.raises(punctual.Error, match="test_fmus.py: not a readable FMU archive"):
        punctual.variables(__file__)


def test_the_command_line_is_there(tmp_path):
    script = Path(sys.executable).with_name("punctual")
    done = subprocess.run([script, "--version"], check=True, capture_output=True, text=True)
    assert done.stdout == f"punctual {punctual.__version__}\n" == punctual.run_cli("--version")
    module = [sys.executable, "-m", "punctual", "--version"]
    assert subprocess.run(module, check=True, capture_output=True, text=True).stdout == done.stdout
    done = subprocess.run([script, "build", "none.toml", "-o", "none.fmu"], capture_output=True, text=True)
    assert done.returncode == 2 and "none.toml" in done.stderr
    with pytest.raises(punctual.Error, match="^unexpected argument '--none'"):
        punctual.run_cli("--none")


# Plans account for a delay of up to 250 steps.
DECLARED = {
    "actuation_delay": {"actuation_delay": 251 * STEP},
    "disturbance": {"barrier": [barrier | {"disturbance": 0.01} for barrier in ASSURED["barrier"]]},
}


@pytest.mark.parametrize("keys", [["actuation_delay"], ["disturbance"], ["actuation_delay", "disturbance"]])
def test_what_switches_plans_off_is_a_warning_once_for_each_that_is_made(keys, tmp_path):
    lost = ASSURED | {name: value for key in keys for name, value in DECLARED[key].items()}
    filter_fmu, plant_fmu = tmp_path / "filter.fmu", punctual.build(PLANT, tmp_path / "plant.fmu")
    made = {
        "Filter": lambda: punctual.Filter(lost),
        "FilterBatch": lambda: punctual.FilterBatch(lost, 3),
        "build": lambda: punctual.build(lost, filter_fmu),
        "check": lambda: punctual.check(lost),
        "simulate": lambda: punctual.simulate(filter_fmu, plant_fmu, stop_time=0.1, step_size=STEP),
    }
    for name, make in made.items():
        with warnings.catch_warnings(record=True) as seen:
            warnings.simplefilter("always")
            make()
        (one,) = seen
        assert one.category is punctual.GuaranteeWarning and issubclass(one.category, UserWarning)
        text = str(one.message)
        assert text.startswith("plans are off, and with them the guarantee of goal, post: "), (name, text)
        assert all(key in text for key in keys) and 'assurance = "on"' in text, (name, text)
        assert one.filename == __file__, "where it was made"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(punctual.GuaranteeWarning):
            punctual.Filter(lost)
        own = punctual.Filter(lost | {"assurance": "off"})
        for configuration in (FILTER, ASSURED, ASSURED | {"actuation_delay": 2 * STEP}):
            punctual.Filter(configuration)
        copy.copy(own), pickle.loads(pickle.dumps(own))
    with pytest.raises(punctual.Error, match="assurance: is .on., must be"):
        punctual.Filter(lost | {"assurance": "on"})


def test_what_is_declared_of_the_plant_is_covered():
    declared = {
        "uncertainty": {"rates": {"v": np.float64(0.05)}, "inputs": {"a": {"gain": np.array([0.95, 1.0])}}},
        "measurement_errors": {"x_p": 0.01},
    }
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        own = punctual.Filter(ASSURED | declared)
    # `check` says the same of the dict.
    covers = punctual.check(ASSURED | declared)["covers"]
    assert covers == ["rates v 0.05 m/s2", "measurement errors x_p 0.01 m", "gain of a 0.95 to 1"]
    with pytest.raises(punctual.Error, match="uncertainty.inputs.a.gain: is .1, 0.9., must be"):
        punctual.Filter(ASSURED | {"uncertainty": {"inputs": {"a": {"gain": [1.0, 0.9]}}}})
    with pytest.raises(punctual.Error, match="^uncertainty: only plans account for it"):
        punctual.Filter(ASSURED | declared | {"assurance": "off"})
    again = pickle.loads(pickle.dumps(own))
    x, u_ref = [0.0] * len(own.states), [0.0] * len(own.inputs)
    step, other = own.step(0.0, x, u_ref), again.step(0.0, x, u_ref)
    assert step.assurance == other.assurance and (step.u == other.u).all()
    if step.assurance == punctual.Assurance.ASSURED:
        assert math.isfinite(step.assured_until)
