"""Plants alone, in FMPy's own simulation loop, compared with closed-form solutions."""

import math

import fmpy
import numpy as np
import pytest
from fmpy import simulate_fmu

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
        # The same inner steps, up to round-off in how each communication step is divided.
        assert abs(coarse[name][-1] - fine[name][-1]) < 1e-12


def test_default_experiment_is_used(demo):
    description = fmpy.read_model_description(fmu(demo, "unicycle"))
    assert float(description.defaultExperiment.stopTime) == 20.0
    assert float(description.defaultExperiment.stepSize) == 0.001


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_start_value_that_is_not_finite_is_refused(demo, value):
    with pytest.raises(Exception, match="fmi2SetReal"):
        simulate(fmu(demo, "unicycle"), {"x0.v": value})
