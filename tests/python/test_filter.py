"""`punctual.Filter` against the FMU of the same configuration, and its refusals."""

import copy
import math
import pickle
import shutil
import subprocess
import sys

import numpy as np
import punctual
import pytest
from punctual import Phase, Status

from conftest import ASSURED, FILTER, PLANT, ROOT, STEP, exactly

STATES = ["x_p", "y_p", "theta", "v"]


def sampled(result):
    """The rows with the time that an FMU takes: where its last step ended."""
    return zip([0.0, *(result["time"][:-1] + STEP)], result)


def test_every_bit_is_that_of_the_fmu(fmus):
    result = punctual.simulate(*fmus, stop_time=8.0, step_size=STEP, nominal={"a": ("v", -1.0)})
    own = punctual.Filter(FILTER)
    for t, row in sampled(result):
        step = own.step(t, [row[f"x.{name}"] for name in STATES], [row["u_ref.a"], row["u_ref.omega"]])
        assert step.u.tolist() == [row["u.a"], row["u.omega"]], t
        assert step.status == row["status"]
        for name, barrier in step.barriers.items():
            for field in [n.removeprefix(f"{name}.") for n in result.dtype.names if n.startswith(f"{name}.")]:
                assert getattr(barrier, field) == row[f"{name}.{field}"], (t, name, field)
    assert {Status(s) for s in result["status"]} >= {Status.UNCHANGED, Status.FILTERED}


def test_an_integrated_input_is_that_of_the_fmu(tmp_path):
    folder = ROOT / "examples" / "vehicles"
    fmus = [punctual.build(folder / f"car-{kind}.toml", tmp_path / f"{kind}.fmu") for kind in ["filter", "plant"]]
    result = punctual.simulate(*fmus, stop_time=3.0, step_size=STEP)
    own = punctual.Filter(folder / "car-filter.toml")
    assert own.states == {"x_p": "m", "y_p": "m", "theta": "rad", "v": "m/s"}
    assert own.inputs == {"a": "m/s2", "delta": "rad"}
    # Without the last row: there the FMU is not told for how long its input is going to be held.
    for t, row in [*sampled(result)][:-1]:
        step = own.step(t, [row[f"x.{name}"] for name in STATES])
        assert step.u.tolist() == [row["u.a"], row["u.delta"]], t
    again = own.step(3.0 + STEP, [result[f"x.{name}"][-1] for name in STATES])
    own.reset()
    first = own.step(0.0, [result[f"x.{name}"][0] for name in STATES])
    assert first.u.tolist() == [result["u.a"][0], result["u.delta"][0]] != again.u.tolist()


def test_names_units_and_enumerations_are_those_of_the_fmu(fmus):
    own, variables = punctual.Filter(FILTER), {v.name: v for v in punctual.variables(fmus[0])}
    assert own.states == {name: variables[f"x.{name}"].unit for name in STATES}
    assert own.inputs == {name: variables[f"u.{name}"].unit for name in ["a", "omega"]}
    assert own.barriers == {name: variables[f"{name}.h"].unit for name in ["goal", "post"]}
    for variable, enumeration in [("status", Status), ("goal.phase", Phase)]:
        assert {item.name.lower(): item.value for item in enumeration} == variables[variable].items
    fields = {n.removeprefix("goal.") for n, v in variables.items() if v.causality == "output" and n.startswith("goal.")}
    assert fields - {"phase_code"} == {name for name in dir(punctual.BarrierReport) if not name.startswith("_")}


def test_deadlines_start_anew():
    own, x = punctual.Filter(FILTER), np.array([0.0, 0.0, 0.3, 2.0])
    first = own.step(0.0, x)
    assert first.barriers["goal"].time_left == 5.0 and first.barriers["goal"].phase is Phase.APPROACH
    assert own.step(2.0, x).barriers["goal"].time_left == 3.0
    own.rearm()
    assert own.step(3.0, x).barriers["goal"].time_left == 5.0
    own.reset()
    assert own.step(0.0, x).u.tolist() == first.u.tolist()


def test_time_does_not_run_backwards():
    own, x = punctual.Filter(FILTER), np.array([0.0, 0.0, 0.3, 2.0])
    first = own.step(1.25, x)
    assert own.step(1.25, x).u.tolist() == first.u.tolist(), "a repeat of the sample"
    wrong = r"t: is 0\.5 s, must be at least 1\.25 s, the time of the step before; .* call rearm\(\) or reset\(\)"
    with pytest.raises(ValueError, match=wrong):
        own.step(0.5, x)
    # What was refused left nothing behind.
    assert own.step(1.5, x).barriers["goal"].time_left == 4.75
    own.rearm()
    assert own.step(0.5, x).barriers["goal"].time_left == 5.0
    own.reset()
    assert own.step(0.0, x).barriers["goal"].time_left == 5.0
    batch, rows = punctual.FilterBatch(FILTER, 3), np.tile(x, (3, 1))
    batch.step([1.0, 2.0, 3.0], rows)
    with pytest.raises(ValueError, match=r"t: is 1\.5 s in row 1, must be at least 2 s"):
        batch.step([1.5, 1.5, 3.5], rows)
    batch.rearm([False, True, False])
    batch.step([1.0, 1.5, 3.5], rows)


def test_a_filter_that_is_armed_later(fmus, tmp_path):
    late = FILTER | {"arm_after": 0.5}
    fmu = punctual.build(late, tmp_path / "late.fmu")
    result = punctual.simulate(fmu, fmus[1], stop_time=6.0, step_size=STEP, nominal={"a": ("v", -1.0)})
    assert not any(name.endswith("_code") for name in result.dtype.names)
    own = punctual.Filter(late)
    for t, row in sampled(result):
        # Pickled on either side of the arming, it goes on as it would have.
        own = pickle.loads(pickle.dumps(own))
        step = own.step(t, [row[f"x.{name}"] for name in STATES], [row["u_ref.a"], row["u_ref.omega"]])
        assert step.u.tolist() == [row["u.a"], row["u.omega"]] and step.status == row["status"], t
        assert step.satisfied or step.status is Status.NOT_ARMED
        assert (step.barriers["goal"].phase is Phase.WAITING) == (step.status is Status.NOT_ARMED)
    waiting = result["status"] == Status.NOT_ARMED
    assert waiting[0] and abs(waiting.sum() - 0.5 / STEP) <= 1 and not waiting[-1]
    judged = punctual.promise(result, "goal")
    assert judged.deadline == pytest.approx(0.5 + 5.0, abs=1.5 * STEP) and judged.constraint_met


def test_real_numbers_of_any_type_and_layout_are_taken():
    states, inputs = exactly([1.0, 2.0, 0.0, 3.0], 4), exactly([2.0, 1.0], 2)
    answers = [punctual.Filter(FILTER).step(0.0, *given).u.tobytes() for given in zip(states, inputs)]
    assert answers == [answers[0]] * len(states)
    other = punctual.Filter(FILTER).step(0.0, states[0], inputs[0] + 1.0).u.tobytes()
    assert other != answers[0]


def test_what_is_no_number_is_an_outcome():
    own = punctual.Filter(FILTER)
    step = own.step(0.0, [math.nan, 0.0, 0.0, 0.0])
    assert step.status is Status.INVALID_INPUT and not step.satisfied and step.u.tolist() == [0.0, 0.0]
    assert repr(step) == "Step(u=array([0., 0.]), status=INVALID_INPUT)"
    assert own.step(0.0, [0.0, 0.0, 0.0, 2.0]).satisfied


@pytest.mark.parametrize(
    ("x", "error", "words"),
    [
        (np.zeros(3), ValueError, r"x: has shape \(3,\), must have \(4,\) \(x_p, y_p, theta, v\)"),
        (np.zeros((1, 4)), ValueError, r"x: has shape \(1, 4\), must have \(4,\)"),
        ([0.0], ValueError, r"x: has shape \(1,\), must have \(4,\)"),
        (1.0, ValueError, r"x: has shape \(\), must have \(4,\)"),
        ([[0.0], [0.0, 0.0]], ValueError, r"x: is list of no shape, must be real numbers .* of shape \(4,\)"),
        (
            np.zeros(4, complex),
            TypeError,
            r"^x: is ndarray of complex128, must be real numbers \(floats or integers\) of shape \(4,\) \(x_p, y_p, theta, v\)$",
        ),
        ([0.0, 0.0, 0.0, 1j], TypeError, "x: is list of complex128, must be real numbers"),
        (list(np.zeros(4, complex)), TypeError, "x: is list of complex128, must be real numbers"),
        (np.zeros(4, bool), TypeError, "x: is ndarray of bool, must be real numbers"),
        (np.zeros(4, object), TypeError, "x: is ndarray of object, must be real numbers"),
        (["0", "0", "0", "0"], TypeError, "x: is list of <U1, must be real numbers"),
        (np.zeros(4, "m8[s]"), TypeError, "x: is ndarray of timedelta64.s., must be real numbers"),
        ("zero", TypeError, "x: is str of <U4, must be real numbers"),
        (None, TypeError, "x: is NoneType of object, must be real numbers"),
    ],
)
def test_another_state_is_refused(x, error, words):
    with pytest.raises(error, match=words):
        punctual.Filter(FILTER).step(0.0, x)


@pytest.mark.parametrize(
    ("t", "error", "words"),
    [
        (True, TypeError, "t: is bool, must be"),
        (np.True_, TypeError, "t: is bool_?, must be"),
        ("0", TypeError, "t: is str, must be"),
        (None, TypeError, "t: is NoneType, must be"),
        (np.zeros(1), ValueError, r"t: has shape \(1,\), must be"),
    ],
)
def test_another_time_is_refused(t, error, words):
    with pytest.raises(error, match=rf"^{words} a real number \(s\)$"):
        punctual.Filter(FILTER).step(t, [0.0] * 4)


def test_a_time_may_have_any_type_of_real_numbers():
    for t in [1, np.float32(1.0), np.int64(1), np.array(1.0)]:
        a, b = (punctual.Filter(FILTER).step(at, [1.0, 2.0, 0.3, 4.0]).u for at in (t, 1.0))
        assert a.tobytes() == b.tobytes()


def test_another_u_ref_is_refused():
    with pytest.raises(ValueError, match=r"u_ref: has shape \(4,\), must have \(2,\) \(a, omega\)"):
        punctual.Filter(FILTER).step(0.0, np.zeros(4), np.zeros(4))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"barrier": [FILTER["barrier"][0] | {"radius": -1.0}]}, r"^barrier\[0\]\.radius: is -1, must be"),
        ({"plant": {"model": "boat"}}, "boat"),
        ({"bounds": {"a": [1.0, -1.0]}}, r"^bounds.a: is \[1, -1\]"),
    ],
)
def test_another_configuration_is_refused(change, words):
    with pytest.raises(punctual.Error, match=words):
        punctual.Filter(FILTER | change)
    with pytest.raises(punctual.Error, match='^kind: is "plant", must be "filter"$'):
        punctual.Filter(PLANT)


def test_a_file_is_named(tmp_path):
    (tmp_path / "filter.toml").write_text('kind = "filter"\n')
    with pytest.raises(punctual.Error, match=r"(?s)filter.toml: .*plant"):
        punctual.Filter(tmp_path / "filter.toml")
    with pytest.raises(FileNotFoundError):
        punctual.Filter(str(tmp_path / "none.toml"))
    with pytest.raises(TypeError, match=r"barrier\[0\].radius: is None, must be a number"):
        punctual.Filter(FILTER | {"barrier": [{"name": "goal", "radius": None}]})


def assured(deadline):
    """A filter that follows plans: a goal, an obstacle on the way, bounds."""
    barriers = [
        {"name": "goal", "centre": [20.0, 10.0], "radius": 2.0, "deadline": deadline},
        {"name": "tree", "shape": "obstacle", "centre": [10.0, 5.0], "radius": 2.0},
    ]
    bounds = {"a": [-4.0, 4.0], "omega": [-2.0, 2.0]}
    return FILTER | {"assurance": "on", "barrier": barriers, "bounds": bounds, "experiment": {"step_size": 0.05}}


def test_plans_are_followed_as_by_the_fmu(tmp_path):
    plant = punctual.build(PLANT | {"x0": {"theta": 1.0}}, tmp_path / "plant.fmu")
    fmu = punctual.build(assured(8.0), tmp_path / "filter.fmu")
    items = {item.name.lower(): item.value for item in punctual.Assurance}
    assert items == {v.name: v.items for v in punctual.variables(fmu)}["assurance"]
    result = punctual.simulate(fmu, plant, stop_time=10.0, step_size=0.05, nominal={"a": ("v", 2.0)})
    own = punctual.Filter(assured(8.0))
    assert own.plan is None and own.refusal is None
    backups = 0
    for t, row in zip([0.0, *(result["time"][:-1] + 0.05)], result):
        x = [row[f"x.{name}"] for name in STATES]
        step = own.step(t, x, [row["u_ref.a"], row["u_ref.omega"]])
        assert step.u.tolist() == [row["u.a"], row["u.omega"]], t
        assert step.assurance is punctual.Assurance.ASSURED and row["assurance"] == step.assurance and step.satisfied
        assert all(barrier.guaranteed for barrier in step.barriers.values())
        backups += step.status is Status.BACKUP
        plan = own.plan
        assert len(plan.times) == len(plan.x) == len(plan.u) and plan.times[0] == t and plan.x[0].tolist() == x
        assert np.abs(plan.u).max(axis=0).tolist() <= [4.0, 2.0] and plan.u[0].tolist() == step.u.tolist()
        distance = np.hypot(*(plan.x[:, :2] - [20.0, 10.0]).T)
        assert (distance[plan.times >= 8.0] <= 2.0).all() and (np.hypot(*(plan.x[:, :2] - [10.0, 5.0]).T) >= 2.0).all()
        assert np.abs(plan.x[-1, 3]) < 1e-4, "at rest"
    assert backups > 0
    # A step that the plan decides keeps the promise; it is none that fails.
    assert punctual.promise(result, "goal").unmet == 0


def test_what_is_not_promised_is_said():
    own = punctual.Filter(assured(2.0))
    step = own.step(0.0, [0.0, 0.0, 1.0, 0.0])
    assert step.assurance is punctual.Assurance.REFUSED and not step.barriers["goal"].guaranteed
    assert own.plan is None and own.refusal.startswith("in the closest attempt, goal is not met at 2 s")
    assert punctual.Filter(FILTER).step(0.0, [0.0, 0.0, 1.0, 0.0]).assurance is None
    with pytest.raises(punctual.Error, match="actuation_delay is 1, must be <= period = 0.05 for a plan, where samples come late"):
        punctual.Filter(assured(8.0) | {"actuation_delay": 1.0, "uncertainty": {"jitter": 0.1}})


def test_a_promise_with_an_end_tells_it():
    forever = punctual.Filter(assured(8.0))
    assert forever.step(0.0, [0.0, 0.0, 1.0, 1.0]).assured_until == forever.plan.until == math.inf
    moving = assured(9.0) | {"plan_horizon": 4.0}
    moving["barrier"].append({"name": "forwards", "shape": "at_least", "state": "v", "bound": 0.5})
    own, x, until = punctual.Filter(moving), np.array([0.0, 0.0, 1.0, 1.0]), 0.0
    for k in range(320):
        step = own.step(0.05 * k, x, [-4.0, 0.3])
        assert step.assurance is punctual.Assurance.ASSURED and step.assured_until == own.plan.until >= until
        until = step.assured_until
        for _ in range(50):
            x = x + 0.001 * np.array([x[3] * math.cos(x[2]), x[3] * math.sin(x[2]), step.u[1], step.u[0]])
        assert x[3] >= 0.5 - 1e-9
    assert until > 0.05 * 320 and repr(own.plan).startswith("Plan(until t=")
    assert punctual.Filter(assured(2.0)).step(0.0, [0.0, 0.0, 1.0, 0.0]).assured_until is None


CAR = ROOT / "examples" / "vehicles" / "car-filter.toml"
KINDS = pytest.mark.parametrize("configuration", [FILTER, ASSURED, CAR], ids=["rows", "plans", "integrator"])


def driven(own, steps, x, u_ref):
    """Steps in a loop with a plant that is integrated roughly; the bits of what was said, and the last state."""
    said, x = [], np.array(x)
    for k in steps:
        step = own.step(k * STEP, x, u_ref)
        told = [getattr(b, name) for b in step.barriers.values() for name in dir(b) if not name.startswith("_")]
        said.append((step.u.tobytes(), step.status, step.assurance, np.array(told, float).tobytes()))
        speed, turned = x[3], step.u[1] if own.inputs.get("omega") else 0.0
        x = x + STEP * np.array([speed * math.cos(x[2]), speed * math.sin(x[2]), turned, step.u[0]])
    return said, x


def planned(own):
    """The backup plan, as bits."""
    plan = own.plan
    return plan and [plan.times.tobytes(), plan.x.tobytes(), plan.u.tobytes(), plan.effort, plan.tightest]


@KINDS
@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, lambda own: pickle.loads(pickle.dumps(own))])
def test_a_copy_goes_on_with_the_same_bits(configuration, copied):
    own, straight = punctual.Filter(configuration), punctual.Filter(configuration)
    begun, x = driven(own, range(40), [0.0, 0.0, 0.3, 2.0], [-1.0, 0.5])
    again, third = copied(own), copied(own)
    assert own.plan is not None or configuration is not ASSURED
    assert (planned(again), again.refusal, again.step_size) == (planned(own), own.refusal, STEP)
    gone, _ = driven(again, range(40, 80), x, [-1.0, 0.5])
    # The one that was copied takes another way, which changes neither copy.
    other, _ = driven(own, range(40, 80), x, [1.0, -0.5])
    assert driven(straight, range(40), [0.0, 0.0, 0.3, 2.0], [-1.0, 0.5])[0] == begun
    uninterrupted, _ = driven(straight, range(40, 80), x, [-1.0, 0.5])
    assert uninterrupted == gone != other
    assert driven(third, range(40, 80), x, [-1.0, 0.5])[0] == gone
    # What it forgets, it forgets as a new one does.
    again.reset()
    assert driven(again, range(40), [0.0, 0.0, 0.3, 2.0], [-1.0, 0.5])[0] == begun


def test_a_pickle_needs_no_file_and_goes_to_another_process(tmp_path):
    own = punctual.Filter(shutil.copy(CAR, tmp_path / "filter.toml"))
    _, x = driven(own, range(5), [0.0, 0.0, 0.3, 2.0], None)
    (tmp_path / "filter.toml").unlink()
    (tmp_path / "pickle").write_bytes(pickle.dumps((own, 5 * STEP, x)))
    script = "import pickle; own, t, x = pickle.load(open('pickle', 'rb')); print(own.step(t, x).u.tobytes().hex())"
    done = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, check=True, capture_output=True, text=True)
    assert done.stdout.strip() == own.step(5 * STEP, x).u.tobytes().hex()


def test_another_pickle_is_refused():
    load, ((version, text, folder, memories), *rest) = punctual.Filter(ASSURED).__reduce__()
    assert load((version, text, folder, memories), *rest).step(0.0, np.zeros(4)).u.shape == (2,)
    with pytest.raises(punctual.Error, match=f"version: .* by punctual 0.0.9, must be {version}; create it again"):
        load(("0.0.9", text, folder, memories), *rest)
    with pytest.raises(punctual.Error, match="memory: cannot be read: "):
        load((version, text, folder, [memories[0][:3]]), *rest)
    _, ((*_, others), *_) = punctual.Filter(ASSURED | {"barrier": FILTER["barrier"][:1]}).__reduce__()
    with pytest.raises(punctual.Error, match="barriers: "):
        load((version, text, folder, others), *rest)
