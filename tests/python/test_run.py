"""`punctual.run`: the numbers and verdicts of the command line, without FMPy."""

import json

import numpy as np
import pytest

import punctual

GOAL = {"name": "goal", "centre": [12.0, 5.0], "radius": 2.0, "deadline": 8.0}
FILTER = {
    "kind": "filter",
    "plant": {"model": "unicycle"},
    "bounds": {"a": [-4.0, 4.0], "omega": [-1.5, 1.5]},
    "experiment": {"step_size": 0.05, "stop_time": 10.0},
    "x0": {"v": 0.5},
    "barrier": [GOAL],
}


def test_a_dict_runs_as_its_file_does(tmp_path):
    file = tmp_path / "car.toml"
    file.write_text(punctual.to_toml(FILTER))
    done = json.loads(punctual.run_cli("run", file, "--out", tmp_path, "--json"))
    table = np.genfromtxt(tmp_path / "car.csv", delimiter=",", names=True, deletechars="")
    for configuration in (FILTER, file):
        found = punctual.run(configuration)
        assert found.promises["goal"] == done["promises"][0]
        assert found.values["goal.h"].tolist() == table["filter.goal.h"].tolist()
        assert found.values["plant.x.v"][0] == 0.5
        verdict = punctual.promise(found.values, "goal")
        assert verdict.kept and verdict.deadline == 8.0
        assert verdict.arrival == pytest.approx(done["promises"][0]["arrival"], abs=1e-9)


def test_a_start_and_an_end_replace_those_of_a_dict():
    found = punctual.run(FILTER, x0={"v": 1.5}, stop_time=4.0)
    assert (found.values["plant.x.v"][0], found.values["time"][-1]) == (1.5, 4.0)
    assert found.promises["goal"]["promise"] == "open"
    assert FILTER["x0"] == {"v": 0.5}


def test_what_cannot_be_run_says_why(tmp_path):
    with pytest.raises(punctual.Error, match="x0.w: unknown state"):
        punctual.run(FILTER, x0={"w": 1.0})
    with pytest.raises(TypeError, match="are for a dict"):
        punctual.run(tmp_path / "car.toml", stop_time=3.0)
