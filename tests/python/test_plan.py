"""Plans from a start, and results as frames of pandas."""

import sys

import numpy as np
import punctual
import pytest

from conftest import ASSURED, STEP


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
    assert way.states == {"p": "m", "v": "m/s"} and way.inputs == {"a": "m/s2"} and way.barriers == {"wall": "m"}
    assert way.bounds == {"a": (-4.0, 4.0)} and way.deadlines == {}
    assert way.h[:, 0].tolist() == (3.0 - way.x[:, 0]).tolist()
    assert way.values(0.0, way.x).tobytes() == way.h.tobytes()
    with pytest.raises(ValueError, match=r"^x: has shape \(2, 3\), must have \(2, 2\) \(p, v\)$"):
        way.values(0.0, np.zeros((2, 3)))
    # Numbers of every kind; one state is a row too.
    assert way.values(0.0, [[1, 0], [2, 5]]).tolist() == [[2.0], [1.0]] == way.values(0.0, np.array([[1, 0], [2, 5]])).tolist()
    with pytest.raises(ValueError, match=r"^x: has shape \(2,\), must have \(m, 2\) \(p, v\)$"):
        way.values(0.0, [1.0, 2.0])
    assert way.x[0].tolist() == [0.0, 1.0] and (3.0 - way.x[:, 0]).min() >= 0.0 and np.abs(way.u).max() <= 4.0
    same = punctual.plan(wall(), [0.0, 1.0])
    assert same.x.tobytes() == way.x.tobytes()
    frame = punctual.to_pandas(way)
    assert list(frame) == ["x.p", "x.v", "u.a", "wall.h"] and frame.index.name == "time"
    assert frame["x.v"].tolist() == way.x[:, 1].tolist() and frame.index.tolist() == way.times.tolist()


def test_a_plan_begins_when_its_run_does():
    wall_moves = [{"name": "wall", "expression": "3 - p + 0.1 * min(t, 9)", "unit": "m"}]
    found = punctual.plan(wall(barrier=wall_moves, plan_horizon=5.0, experiment={"step_size": STEP, "start_time": 4.0, "stop_time": 5.0}), {"v": 1.0})
    assert found.times[0] == 4.0 and found.h[0, 0] == 3.0 + 0.1 * 4.0


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


def test_of_an_integrated_input_the_plan_has_the_state_and_the_rate():
    plant = {
        "states": [{"name": "p", "unit": "m"}, {"name": "v", "unit": "m/s"}, {"name": "acc", "unit": "m/s2"}],
        "inputs": [{"name": "jerk", "unit": "m/s3", "min": -8.0, "max": 8.0}],
        "derivatives": {"p": "v", "v": "acc", "acc": "jerk"},
    }
    wanted = wall(plant=plant, integrator={"state": "acc", "min": -4.0, "max": 4.0})
    filter = punctual.Filter(wanted)
    filter.step(0.0, [0.0, 1.0])
    way = filter.plan
    assert list(way.states) == ["p", "v", "acc"] and list(way.inputs) == ["jerk"] and way.bounds == {"jerk": (-8.0, 8.0)}
    # The rate is what the state changes by.
    assert np.allclose(np.diff(way.x[:, 2]), way.u[:-1, 0] * np.diff(way.times), rtol=0.0, atol=1e-9)


def test_the_picture_of_a_plan_has_its_bounds_deadlines_path_and_sets():
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    way = punctual.plan(ASSURED, {"v": 2.0})
    assert way.deadlines == {"goal": 5.0} and list(way.barriers) == ["goal", "post"]
    figure = punctual.plot(way)
    goal, post, a, omega, path = figure.axes
    for axes, barrier in [(goal, 0), (post, 1)]:
        assert axes.get_lines()[0].get_ydata().tolist() == way.h[:, barrier].tolist()
        assert [0.0, 0.0] in [list(line.get_ydata()) for line in axes.get_lines()]
    assert [5.0, 5.0] in [list(line.get_xdata()) for line in goal.get_lines()]
    assert [list(line.get_ydata()) for line in omega.get_lines()[1:]] == [[-3.0, -3.0], [3.0, 3.0]]
    assert a.get_ylabel() == "a in m/s2" and goal.get_ylabel() == "h in m"
    assert path.get_lines()[0].get_xydata().tolist() == way.x[:, :2].tolist()
    # Their edges are where the discs' are, to the cells of the grid.
    cell = np.ptp(path.get_xlim()) / 199
    edges = [lines.get_paths()[0].vertices for lines in path.collections[::2]]
    assert len(edges) == 2
    for edge, centre, radius in [(edges[0], (20.0, 10.0), 2.0), (edges[1], (8.0, 5.0), 1.0)]:
        assert np.abs(np.hypot(*(edge - centre).T) - radius).max() < cell
    assert [text.get_text() for text in path.get_legend().get_texts()][2:] == ["goal: inside", "post: outside"]
    assert len(punctual.plot(way, "post").axes) == 4
    # A place on a line is no plane.
    assert len(punctual.plot(punctual.plan(wall(), {"v": 1.0})).axes) == 2
    with pytest.raises(punctual.Error, match="^result: the plan keeps no barrier 'gate', only goal, post$"):
        punctual.plot(way, "gate")
    matplotlib.pyplot.close("all")


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
