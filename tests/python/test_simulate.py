"""`punctual.simulate` against `punctual run`: the same calls, the same bits."""

import csv
import json
import math
import warnings

import fmpy
import fmpy.util
import numpy as np
import punctual
import pytest

from conftest import FILTER, PLANT, ROOT, STEP, goal

STOP = 8.0
DAMPING = {"a": ("v", -1.0)}


def recorded(folder, filter_fmu, plant_fmu, experiment, connections="", start=""):
    """The columns of the CSV file that `punctual run` writes for the same system."""
    (folder / "system.toml").write_text(
        f"""[experiment]
{experiment}
[[component]]
name = "filter"
fmu = "{filter_fmu}"
[[component]]
name = "plant"
fmu = "{plant_fmu}"
{start}
[[connect_by_name]]
components = ["filter", "plant"]
{connections}
"""
    )
    punctual.run_cli("run", folder / "system.toml", "--out", folder, "--require", "nothing")
    with open(folder / "system.csv", newline="") as file:
        rows = list(csv.reader(file))
    return dict(zip(rows[0], np.array(rows[1:], float).T))


def assert_same(result, columns):
    """Every field of `result` has the bits of its column, and no column is missing."""
    fields = {"time": "time"}
    for column in columns:
        component, _, variable = column.partition(".")
        is_input = component == "filter" and variable.startswith("x.") or component == "plant" and variable[:2] == "u."
        if component and variable and not is_input:
            fields[variable] = column
    # u_ref.* that nothing is connected to is no column.
    assert set(fields) <= set(result.dtype.names)
    assert {name for name in result.dtype.names if not name.startswith("u_ref.")} <= set(fields)
    for field, column in fields.items():
        values = result[field].astype(float)
        assert values.tobytes() == columns[column].tobytes(), (field, np.abs(values - columns[column]).max())


DAMPED = '[[connection]]\nfrom = "plant.x.v"\nto = "filter.u_ref.a"\nfactor = -1.0\n'


@pytest.mark.parametrize("step", [0.01, 0.03], ids=["whole", "the last step is shorter"])
def test_every_number_is_that_of_punctual_run(fmus, tmp_path, step):
    columns = recorded(tmp_path, *fmus, f"stop_time = {STOP}\nstep = {step}", DAMPED)
    result = punctual.simulate(*fmus, stop_time=STOP, step_size=step, nominal=DAMPING)
    assert len(result) == math.ceil(STOP / step - 1e-6) + 1
    assert_same(result, columns)
    # The promise itself, so that it is not two times the same nonsense.
    assert result["goal.h"][0] < 0.0 <= result["goal.h"][result["time"] >= 5.0].min()
    assert result["post.h"].min() >= 0.0


def test_start_offset_and_parameters_are_those_of_a_system_file(fmus, tmp_path):
    offset = DAMPED + "offset = 3.0\n"
    start = 'start = { "x0.v" = -1.5, "x0.theta" = 0.5 }\n'
    system = "stop_time = 2.0\nstep = 0.01"
    columns = recorded(tmp_path, *fmus, system, offset, start)
    nominal = {"u_ref.a": ("x.v", -1.0, 3.0)}
    options = dict(stop_time=2.0, step_size=0.01, nominal=nominal)
    result = punctual.simulate(*fmus, start={"v": -1.5, "x0.theta": 0.5}, **options)
    assert_same(result, columns)
    later = punctual.simulate(*fmus, parameters={"goal.deadline": 7.0}, **options)
    assert later["goal.time_left"][0] == 7.0 and result["goal.time_left"][0] == 5.0


@pytest.mark.parametrize("kind", ["car", "delayed"])
def test_other_filters_too(kind, tmp_path):
    # One that hands out an integrated angle; one whose outputs change in steps only, so that masters delay it.
    folder = ROOT / "examples" / "vehicles"
    if kind == "car":
        configurations = folder / "car-filter.toml", folder / "car-plant.toml"
    else:
        configurations = FILTER | {"direct_feedthrough": False, "actuation_delay": STEP}, PLANT
    fmus = [punctual.build(c, tmp_path / f"{i}.fmu") for i, c in enumerate(configurations)]
    columns = recorded(tmp_path, *fmus, "stop_time = 3.0\nstep = 0.01", DAMPED)
    assert_same(punctual.simulate(*fmus, stop_time=3.0, step_size=STEP, nominal=DAMPING), columns)


def test_it_begins_when_the_filter_says_or_is_told(tmp_path):
    cart = {"name": "cart", "shape": "obstacle", "centre": [12.0, 10.0], "velocity": [0.0, -1.0], "radius": 1.0}
    experiment = {"step_size": STEP, "start_time": 4.0, "stop_time": 12.0}
    moving = FILTER | {"barrier": [goal(), cart], "experiment": experiment}
    pair = punctual.build(moving, tmp_path / "filter.fmu"), punctual.build(PLANT, tmp_path / "plant.fmu")
    columns = recorded(tmp_path, *pair, f"start_time = 4.0\nstop_time = 8.0\nstep = {STEP}", DAMPED)
    result = punctual.simulate(*pair, stop_time=8.0, step_size=STEP, nominal=DAMPING)
    assert result["time"][0] == 4.0
    assert_same(result, columns)
    sooner = punctual.simulate(*pair, start_time=0.0, stop_time=8.0, step_size=STEP, nominal=DAMPING)
    assert sooner["time"][0] == 0.0 and sooner["cart.h"][0] != result["cart.h"][0]


def test_a_function_as_nominal_controller(fmus):
    seen = []

    def damping(t, x):
        seen.append((t, x.copy()))
        with pytest.raises(ValueError, match="read-only"):
            x[0] = 1.0
        return [-x[3], 0.0]

    options = dict(stop_time=1.0, step_size=STEP)
    result = punctual.simulate(*fmus, nominal=damping, **options)
    assert result.tobytes() == punctual.simulate(*fmus, nominal=DAMPING, **options).tobytes()
    t, x = seen[-1]
    assert t == 1.0 and x.tolist() == [result[f"x.{name}"][-1] for name in ["x_p", "y_p", "theta", "v"]]
    array = punctual.simulate(*fmus, nominal=lambda t, x: np.array([-x[3], 0.0]), **options)
    assert array.tobytes() == result.tobytes()
    single, plain = (
        punctual.simulate(*fmus, nominal=lambda t, x: np.array([1, 2], kind), **options) for kind in [np.float32, float]
    )
    assert single.tobytes() == plain.tobytes() != array.tobytes()


def test_the_result_is_one_of_fmpy(fmus, tmp_path):
    result = punctual.simulate(*fmus, stop_time=0.1, step_size=STEP, record=["x.v", "status", "goal.arrived", "u_ref.a"])
    assert result.dtype.names == ("time", "x.v", "status", "goal.arrived", "u_ref.a")
    assert [result.dtype[i].kind for i in range(5)] == ["f", "f", "i", "b", "f"]
    # It cannot read Booleans.
    numbers = result[["time", "x.v", "status"]]
    fmpy.util.write_csv(tmp_path / "result.csv", numbers)
    assert fmpy.util.read_csv(tmp_path / "result.csv")["x.v"].tolist() == result["x.v"].tolist()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (dict(stop_time=0.0), "stop_time: is 0.0, must be finite and > start_time = 0.0"),
        (dict(start_time=0.2), "stop_time: is 0.1, must be finite and > start_time = 0.2"),
        (dict(start_time=math.inf), "start_time: is inf, must be finite"),
        (dict(step_size=math.nan), "step_size: is nan, must be finite and > 0"),
        (dict(start={"w": 1.0}), "start: 'w' is not a parameter or input of the plant, which has x0.x_p"),
        (dict(parameters={"goal.T": 1.0}), "parameters: 'goal.T' is not a parameter or input of the filter"),
        (dict(parameters={"goal.deadline": -1.0}), "fmi2.* of the filter was refused: .*goal.deadline"),
        (dict(record=["goal.hh"]), "record: 'goal.hh' is none of x.x_p"),
        (dict(nominal={"b": ("v", 1.0)}), "nominal: 'b' is none of u_ref.a, u_ref.omega"),
        (dict(nominal={"a": ("w", 1.0)}), "nominal.a: 'w' is not an output of the plant, which has x.x_p"),
        (dict(nominal=lambda t, x: [0.0]), r"nominal: is \[0.0\] at t = 0 s, must be real numbers for u_ref.a, u_ref.omega"),
        (dict(nominal=lambda t, x: np.zeros(2, complex)), r"nominal: is array\(\[0.\+0.j, .* must be real numbers for"),
        (dict(nominal=lambda t, x: np.array(["0", "0"])), "nominal: is array.* must be real numbers for"),
        (dict(nominal=lambda t, x: "00"), "nominal: is '00' at t = 0 s, must be real numbers for"),
    ],
)
def test_what_does_not_fit_is_refused(fmus, change, words):
    options = dict(stop_time=0.1, step_size=STEP) | change
    with pytest.raises(punctual.Error, match=words):
        punctual.simulate(*fmus, **options)


def test_an_input_that_nothing_feeds_is_refused(fmus, tmp_path):
    other = punctual.build({"kind": "plant", "plant": {"model": "point_mass"}}, tmp_path / "plant.fmu")
    with pytest.raises(punctual.Error, match="x.theta, x.v of the filter: the plant has no output of that name"):
        punctual.simulate(fmus[0], other, stop_time=0.1, step_size=STEP)
    with pytest.raises(punctual.Error, match="u.u_x, u.u_y of the plant: the filter has no output of that name"):
        punctual.simulate(fmus[0], other, stop_time=0.1, step_size=STEP, parameters={"x.theta": 0.0, "x.v": 0.0})
    moving = FILTER | {"barrier": [goal(centre_input=True) | {"centre": [0.0, 0.0]}]}
    centre = punctual.build(moving, tmp_path / "filter.fmu")
    with pytest.raises(punctual.Error, match=r"goal\.centre"):
        punctual.simulate(centre, fmus[1], stop_time=0.1, step_size=STEP)
    inputs = [v.name for v in punctual.variables(centre) if v.causality == "input" and v.name.startswith("goal.")]
    values = dict(zip(inputs, [20.0, 10.0, 0.0, 0.0]))
    result = punctual.simulate(centre, fmus[1], stop_time=0.1, step_size=STEP, parameters=values)
    assert result["goal.h"][0] == punctual.simulate(*fmus, stop_time=0.1, step_size=STEP)["goal.h"][0]


@pytest.mark.parametrize("deadline", [5.0, 4.99, 1.5, 20.0])
def test_a_promise_is_judged_as_by_a_run(fmus, tmp_path, deadline):
    parameters = {"goal.deadline": deadline, "u_max.a": 9.0, "u_min.a": -9.0}
    result = punctual.simulate(*fmus, stop_time=STOP, step_size=0.03, nominal=DAMPING, parameters=parameters)
    starts = ", ".join(f'"{name}" = {value}' for name, value in parameters.items())
    (tmp_path / "system.toml").write_text(
        f"""[experiment]
stop_time = {STOP}
step = 0.03
[[component]]
name = "filter"
fmu = "{fmus[0]}"
start = {{ {starts} }}
[[component]]
name = "plant"
fmu = "{fmus[1]}"
[[connect_by_name]]
components = ["filter", "plant"]
{DAMPED}
"""
    )
    told = json.loads(punctual.run_cli("run", tmp_path / "system.toml", "--json", "--require", "nothing"))["promises"]
    for said in told:
        found = punctual.promise(result, said["barrier"].removeprefix("filter."))
        # JSON has no infinity.
        finite = {field: None if value == math.inf else value for field, value in vars(found).items()}
        assert {field: said[field] for field in vars(found)} == finite
        assert (found.constraint_met, found.kept) == (
            said["constraint_met"],
            said["promise"] == "kept" and said["constraint_met"],
        )
    assert punctual.promise(result, "goal").promise == {1.5: "broken", 20.0: "open"}.get(deadline, "kept")
    sooner = punctual.promise(result, "goal", deadline=0.5)
    assert sooner.late is not None
    assert sooner.late_by == (math.inf if sooner.arrival is None else sooner.arrival - 0.5)
    with pytest.raises(punctual.Error, match="result: has no field 'goal.phase'"):
        punctual.promise(result[["time", "status", "goal.h"]], "goal")


def test_a_result_is_drawn(fmus, tmp_path):
    result = punctual.simulate(*fmus, stop_time=1.0, step_size=STEP, nominal=DAMPING)
    figure = punctual.plot(result)
    labels = [[line.get_label() for line in axes.lines if line.get_label()[0] != "_"] for axes in figure.axes]
    inputs = ["u.a", "u_ref.a", "u.omega", "u_ref.omega"]
    assert labels == [["goal.h", "goal.profile"], ["post.h", "post.profile"], inputs]
    for line in (line for axes in figure.axes for line in axes.lines if line.get_label()[0] != "_"):
        assert line.get_ydata().tolist() == result[line.get_label()].tolist()
    # The deadline of the one, and none of the other.
    assert [[line.get_xdata()[0] for line in axes.lines[3:]] for axes in figure.axes[:2]] == [[5.0], []]
    assert [axes.get_ylabel() for axes in figure.axes] == ["h in m", "h in m", ""]
    only = punctual.plot(result[["time", "post.h", "post.profile"]], "post")
    assert len(only.axes) == 1
    only.savefig(tmp_path / "post.png")
    with pytest.raises(punctual.Error, match="^result: has no field 'gate.h', only time, "):
        punctual.plot(result, "gate")


def test_a_refused_step_names_fmu_time_and_reason(fmus):
    # A state that is no number is an outcome of the filter; a plant cannot go on from one.
    with pytest.raises(punctual.Error, match="fmi2.* of the plant.* was refused: ") as refused:
        punctual.simulate(*fmus, stop_time=0.1, step_size=STEP, start={"v": math.nan})
    assert "nan" in str(refused.value).lower()


def test_a_file_that_is_no_fmu_is_named(fmus, tmp_path):
    (tmp_path / "no.fmu").write_text("no")
    with pytest.raises(punctual.Error, match="no.fmu: "):
        punctual.simulate(tmp_path / "no.fmu", fmus[1], stop_time=0.1, step_size=STEP)
    with pytest.raises(FileNotFoundError, match="none.fmu"):
        punctual.simulate(fmus[0], tmp_path / "none.fmu", stop_time=0.1, step_size=STEP)


def test_without_a_package_the_message_says_what_to_install(fmus, monkeypatch):
    result = punctual.simulate(*fmus, stop_time=0.1, step_size=STEP)
    monkeypatch.setitem(__import__("sys").modules, "matplotlib", None)
    with pytest.raises(ImportError, match="punctual.plot needs Matplotlib: pip install matplotlib"):
        punctual.plot(result)
    monkeypatch.setitem(__import__("sys").modules, "fmpy", None)
    with pytest.raises(ImportError, match=r"pip install fmpy"):
        punctual.simulate(*fmus, stop_time=0.1, step_size=STEP)


CENTI = {"x_p": "cm", "y_p": "cm", "theta": "deg", "v": "cm/s", "a": "cm/s2", "omega": "deg/s"}


def centi(folder, **units):
    """The unicycle in centimetres and degrees, as an FMU."""
    units = CENTI | units
    plant = {
        "kind": "plant",
        "name": "centi",
        "plant": {
            "states": [{"name": n, "unit": units[n]} for n in ("x_p", "y_p", "theta", "v")],
            "inputs": [{"name": n, "unit": units[n]} for n in ("a", "omega")],
            "derivatives": {
                "x_p": "v * cos(theta * d)" if units["x_p"] == "cm" else "0",
                "y_p": "v * sin(theta * d)",
                "theta": "omega",
                "v": "a",
            },
            "parameters": [{"name": "d", "start": math.pi / 180, "unit": "rad/deg"}],
        },
    }
    return punctual.build(plant, folder / "centi.fmu")


@pytest.mark.parametrize("direct", [True, False])
def test_a_plant_in_other_units_is_converted_as_by_punctual_run(fmus, tmp_path, direct):
    start = {"v": 20.0, "theta": 30.0}
    parameters = {"u_ref.a": 0.5}
    own, plant = fmus[0], centi(tmp_path)
    if not direct:
        own = punctual.build(FILTER | {"direct_feedthrough": False}, tmp_path / "late.fmu")
    with pytest.warns(UserWarning, match=r"x\.x_p of the plant from cm to m \(times 0\.01\).*u\.omega of the filter from rad/s to"):
        result = punctual.simulate(own, plant, stop_time=3.0, step_size=STEP, start=start, parameters=parameters)
    columns = recorded(
        tmp_path,
        own,
        plant,
        f"stop_time = 3.0\nstep = {STEP}",
        start='start = { "x0.v" = 20.0, "x0.theta" = 30.0 }\nfeedthrough = false',
        connections="",
    )
    with pytest.warns(UserWarning):
        plain = punctual.simulate(own, plant, stop_time=3.0, step_size=STEP, start=start)
    assert_same(plain, columns)
    assert result["u.a"].tolist() != plain["u.a"].tolist()
    assert plain["x.theta"][0] == 30.0
    # The wish is in the filter's units.
    with pytest.warns(UserWarning):
        wished = punctual.simulate(own, plant, stop_time=0.5, step_size=STEP, start=start, nominal=DAMPING)
    assert wished["u_ref.a"][0] == -0.01 * 20.0
    with pytest.warns(UserWarning):
        called = punctual.simulate(
            own, plant, stop_time=0.5, step_size=STEP, start=start, nominal=lambda t, x: [-1.0 * x[3], 0.0]
        )
    assert called["u_ref.a"].tolist() == wished["u_ref.a"].tolist()


def test_units_that_do_not_fit_are_refused_and_equal_ones_say_nothing(fmus, tmp_path):
    words = "^x.x_p is in kg in the plant, but in m in the filter, which measures another quantity$"
    with pytest.raises(punctual.Error, match=words):
        punctual.simulate(fmus[0], centi(tmp_path, x_p="kg"), stop_time=0.1, step_size=STEP)
    with pytest.warns(UserWarning, match="x.x_p of the plant as it is, since 1 and m cannot be compared"):
        punctual.simulate(fmus[0], centi(tmp_path, x_p="1"), stop_time=0.1, step_size=STEP)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        punctual.simulate(*fmus, stop_time=0.1, step_size=STEP)
