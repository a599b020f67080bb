"""Plans from a start, and results as frames of pandas."""

import sys

import numpy as np
import punctual
import pytest

from conftest import STEP


def wall(**more):
    """A filter that stops a mass before a wall."""
    plant = {
        "states": [{"name": "p", "unit": "m", "min": -9.0, "max": 9.0}, {"name": "v", "unit": "m/s"}],
        "inputs": [{"name": "a", "unit": "m/s2", "min": -4.0, "max": 4.0}],
        "derivatives": {"p": "v", "v": "a"},
    }
    barriers = [{"name": "wall", "expression": "3 - p", "unit": "m"}]
    return {"kind": "filter", "plant": plant, "barrier": barriers, "experiment": {"step_size": STEP}} | more


def test_a_plan_from_a_start_and_its_frame():
    way = punctual.plan(wall(), {"v": 1.0})
    assert way.states == ["p", "v"] and way.inputs == ["a"]
    assert way.x[0].tolist() == [0.0, 1.0] and (3.0 - way.x[:, 0]).min() >= 0.0 and np.abs(way.u).max() <= 4.0
    same = punctual.plan(wall(), [0.0, 1.0])
    assert same.x.tobytes() == way.x.tobytes()
    frame = punctual.to_pandas(way)
    assert list(frame) == ["x.p", "x.v", "u.a"] and frame.index.name == "time"
    assert frame["x.v"].tolist() == way.x[:, 1].tolist() and frame.index.tolist() == way.times.tolist()


@pytest.mark.parametrize(
    ("configuration", "x0", "words"),
    [
        (wall(), {"w": 1.0}, "^x0.w: unknown state, must be one of p, v$"),
        (wall(), [0.0, 40.0], "^x0: there is no plan from here: .*wall"),
        (wall(assurance="off"), [0.0, 0.0], "^assurance: this filter follows no plans"),
    ],
)
def test_no_plan_says_why(configuration, x0, words):
    with pytest.raises(punctual.Error, match=words):
        punctual.plan(configuration, x0)


def test_a_result_is_a_frame(fmus):
    result = punctual.simulate(*fmus, stop_time=0.1, step_size=STEP)
    frame = punctual.to_pandas(result)
    assert (frame.index.name, *frame) == ("time", *result.dtype.names[1:])
    for name in frame:
        assert frame[name].dtype == result.dtype[name] and frame[name].tolist() == result[name].tolist()
    assert frame.index.tolist() == result["time"].tolist()
    for other in [np.zeros(3), {"time": [0.0]}]:
        with pytest.raises(TypeError, match="^result: is .*, must be a result of simulate, or a Plan$"):
            punctual.to_pandas(other)


def test_without_pandas_the_message_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ImportError, match="^punctual.to_pandas needs pandas: pip install pandas$"):
        punctual.to_pandas(np.zeros(1, [("time", float)]))
