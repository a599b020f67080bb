"""Plants alone, in FMPy's own simulation loop, against closed solutions."""

import json
import math

import fmpy
import numpy as np
import pytest
from fmpy import simulate_fmu
from fmpy.validation import validate_fmu

from conftest import punctual

# The classical Runge-Kutta method is exact on polynomials of degree 4, so only round-off is left:
# 2,000 steps of numbers of order 100.
ROUND_OFF = 1e-10


def fmu(demo, model):
    return str(demo[0] / f"{model}-plant.fmu")


def simulate(path, start, stop=2.0, **options):
    return simulate_fmu(path, start_values=start, stop_time=stop, output_interval=0.01, **options)


def test_point_mass_under_constant_acceleration(demo):
    start = {"x0.x_p": 1.0, "x0.v_x": 3.0, "x0.v_y": -2.0, "u.u_x": 0.5, "u.u_y": 4.0}
    result = simulate(fmu(demo, "point_mass"), start)
    t = result["time"]
    assert np.abs(result["x.x_p"] - (1 + 3 * t + 0.25 * t**2)).max() < ROUND_OFF
    assert np.abs(result["x.y_p"] - (-2 * t + 2 * t**2)).max() < ROUND_OFF
    assert np.abs(result["x.v_y"] - (-2 + 4 * t)).max() < ROUND_OFF


def test_unicycle_on_a_circle(demo):
    v, omega = 2.0, 0.7
    result = simulate(fmu(demo, "unicycle"), {"x0.v": v, "u.omega": omega})
    t = result["time"]
    # Global error of the method: t h^4 times the fifth derivative / 120, with h = 1 ms: below 1e-14.
    assert np.abs(result["x.x_p"] - v / omega * np.sin(omega * t)).max() < ROUND_OFF
    assert np.abs(result["x.y_p"] - v / omega * (1 - np.cos(omega * t))).max() < ROUND_OFF


def test_bicycle_turns_with_speed_and_slip(demo):
    v, beta, l_r = 3.0, 0.2, 4.0
    result = simulate(fmu(demo, "bicycle"), {"x0.v": v, "u.beta": beta, "l_r": l_r})
    assert np.abs(result["x.theta"] - v * beta / l_r * result["time"]).max() < ROUND_OFF


def test_inner_steps_do_not_depend_on_the_communication_step(demo):
    # 0.25 s is a whole number of inner steps of 1 ms either way.
    start = {"x0.v": 2.0, "u.a": 1.0, "u.omega": 0.5}
    path = fmu(demo, "unicycle")
    coarse = simulate_fmu(path, start_values=start, stop_time=1.0, output_interval=0.25, step_size=0.25)
    fine = simulate_fmu(path, start_values=start, stop_time=1.0, output_interval=0.25, step_size=0.05)
    for name in ["x.x_p", "x.y_p", "x.theta", "x.v"]:
        # The same inner steps but for round-off in how each communication step is divided.
        assert abs(coarse[name][-1] - fine[name][-1]) < 1e-12


def test_default_experiment_is_used(demo):
    description = fmpy.read_model_description(fmu(demo, "unicycle"))
    assert float(description.defaultExperiment.stopTime) == 20.0
    assert float(description.defaultExperiment.stepSize) == 0.001


# The car by a formula, with an output that depends on states and time.
CAR = """
kind = "plant"
x0 = { s = 1.0, v = 2.0 }
output = [{ name = "ahead", expression = "s + 0.1*v*t", unit = "1" }]
[plant]
states = [{ name = "s", unit = "1" }, { name = "v", unit = "1" }]
inputs = [{ name = "f", unit = "1" }]
derivatives = { s = "v", v = "f - 0.3*v*abs(v)" }
"""
EXCHANGED = {
    "point_mass": {"x0.v_x": 3.0, "u.u_x": 0.5, "u.u_y": 4.0},
    "unicycle": {"x0.v": 2.0, "u.a": 0.5, "u.omega": 1.0},
    "bicycle": {"x0.v": 3.0, "u.a": 0.2, "u.beta": 0.2},
    "car": {"x0.v": 2.0, "u.f": 0.5},
}
# CVode at a relative tolerance of 1e-8, our plant with steps of 1 ms: both are within this of the motion.
SOLVED = 1e-5
# FMPy's Euler method has a step for each output. After t = 2 s it is off by about t/2 times the step times a second derivative
# of up to 5.
EULER_STEP = 1e-3
EULER = 2 * 5 * EULER_STEP


def difference(one, other):
    names = [name for name in one.dtype.names if name.startswith(("x.", "y."))]
    assert names and np.array_equal(one["time"], other["time"])
    return max(np.abs(one[name] - other[name]).max() for name in names)


@pytest.mark.parametrize("model", EXCHANGED)
def test_a_plant_is_integrated_by_the_solver_of_the_tool(tmp_path, model):
    configuration = tmp_path / "plant.toml"
    configuration.write_text(CAR if model == "car" else f'kind = "plant"\nplant.model = "{model}"\n')
    path = str(tmp_path / "plant.fmu")
    punctual("build", configuration, "-o", path, "--model-exchange")
    assert validate_fmu(path) == []
    report = json.loads(punctual("validate", path, "--json").stdout)
    assert (report["findings"], report["not_examined"]) == ([], [])
    description = fmpy.read_model_description(path)
    states = [derivative.variable.derivative.name for derivative in description.derivatives]
    assert states == [v.name for v in description.modelVariables if v.name.startswith("x.")]
    assert description.numberOfEventIndicators == 0
    run = {"start_values": EXCHANGED[model], "stop_time": 2.0, "output_interval": 0.125}
    stepped = simulate_fmu(path, fmi_type="CoSimulation", **run)
    solved = simulate_fmu(path, fmi_type="ModelExchange", solver="CVode", relative_tolerance=1e-8, **run)
    assert difference(solved, stepped) < SOLVED
    run["output_interval"] = EULER_STEP
    stepped = simulate_fmu(path, fmi_type="CoSimulation", **run)
    coarse = simulate_fmu(path, fmi_type="ModelExchange", solver="Euler", **run)
    assert difference(coarse, stepped) < EULER


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_start_value_that_is_not_finite_is_refused(demo, value):
    with pytest.raises(Exception, match="fmi2SetReal"):
        simulate(fmu(demo, "unicycle"), {"x0.v": value})
