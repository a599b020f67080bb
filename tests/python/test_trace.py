"""Python functions in the place of expressions: the same bits, the same files, and what cannot be traced."""

import math
import random
import subprocess
import sys
import tomllib

import numpy as np
import punctual
import pytest
from punctual._trace import FUNCTIONS, LONGEST, Symbol, traced

from conftest import ROOT, STEP

MODELS = ROOT / "examples" / "models"
TEXTS = {"p": "v", "v": "F / m - 0.25 * v"}


def mass(x, u, p):
    return [x[1], u[0] / p["m"] - 0.25 * x[1]]


def model(derivatives=mass, barrier="3 - p", **more):
    """A filter for a mass on a line."""
    plant = {
        "states": [{"name": "p", "unit": "m", "min": -9.0, "max": 9.0}, {"name": "v", "unit": "m/s"}],
        "inputs": [{"name": "F", "unit": "N", "min": -8.0, "max": 8.0}],
        "parameters": [{"name": "m", "start": 2.0, "unit": "kg", "min": 0.1}],
        "derivatives": derivatives,
    }
    barriers = [{"name": "wall", "expression": barrier}]
    return {"kind": "filter", "plant": plant, "barrier": barriers, "experiment": {"step_size": STEP}} | more


def steps(configuration):
    """The bits of what a filter does along states and wanted inputs that swing."""
    filter, told = punctual.Filter(configuration), []
    for k in range(60):
        x = [math.sin(0.1 * k + i) for i in range(len(filter.states))]
        step = filter.step(k * filter.step_size, x, [9.0 * math.cos(0.3 * k + i) for i in range(len(filter.inputs))])
        told.append((step.u.tobytes(), step.status, [(b.h, b.profile, b.slack) for b in step.barriers.values()]))
    return told


def cart_pole(x, u, p):
    _, theta, v, omega = x
    push = u[0] + p["m_p"] * np.sin(theta) * (p["l"] * omega**2 - p["grav"] * np.cos(theta))
    inertia = p["m_c"] + p["m_p"] * np.sin(theta) ** 2
    return [v, omega, push / inertia, (p["grav"] * np.sin(theta) - np.cos(theta) * push / inertia) / p["l"]]


def arm(x, u, p):
    _, q_2, w_1, w_2 = x
    p_1, p_2, p_3 = p["p_1"], p["p_2"], p["p_3"]
    left = u[0] + p_3 * np.sin(q_2) * (2 * w_1 * w_2 + w_2**2)
    right = u[1] - p_3 * np.sin(q_2) * w_1**2
    off = p_2 + p_3 * np.cos(q_2)
    determinant = p_1 * p_2 - (p_3 * np.cos(q_2)) ** 2
    full = p_1 + p_2 + 2 * p_3 * np.cos(q_2)
    return np.array([w_1, w_2, (p_2 * left - off * right) / determinant, (full * right - off * left) / determinant])


def quadrotor(x, u, p):
    pitch, thrust = x[2], x[6:]
    lift = thrust[0] * np.array([np.sin(pitch), np.cos(pitch)]) - [0.0, p["grav"]]
    return np.concatenate([x[3:5], x[5:6], lift, u[1:], thrust[1:], u[:1]])


EXAMPLES = {
    "cart-pole-filter": (cart_pole, {"left": lambda t, x, p: x[1] + p["lean"], "right": lambda t, x, p: p["lean"] - x[1]}),
    "integrators-filter": (lambda x, u: np.eye(5, k=1) @ x + np.eye(5, 1, -4) @ u, {"goal": lambda t, x, p: x[0] - p["target"]}),
    "arm-filter": (arm, {}),
    "quadrotor-filter": (quadrotor, {"ceiling": lambda t, x, p: p["z_ceiling"] - x[1]}),
}


@pytest.mark.parametrize("name", EXAMPLES)
def test_functions_have_the_bits_of_the_expressions_of_the_examples(name):
    written = tomllib.loads((MODELS / f"{name}.toml").read_text())
    dynamics, barriers = EXAMPLES[name]
    assert barriers.keys() <= {barrier["name"] for barrier in written["barrier"]}
    own = [b | {"expression": barriers.get(b["name"], b.get("expression"))} for b in written["barrier"]]
    found = written | {"plant": written["plant"] | {"derivatives": dynamics}, "barrier": own}
    assert steps(found) == steps(MODELS / f"{name}.toml")


def test_a_function_is_called_once_with_arrays_and_the_parameters_by_name():
    calls = []

    def dynamics(x, u, p):
        calls.append((x, u, p))
        return mass(x, u, p)

    configuration = model(dynamics, lambda x: 3.0 - x[0])
    filter = punctual.Filter(configuration)
    [(x, u, p)] = calls
    assert isinstance(x, np.ndarray) and x.shape == (2,) and u.shape == (1,) and list(p) == ["m"]
    assert configuration["plant"]["derivatives"] is dynamics, "the dict stays as it was"
    assert steps(configuration) == steps(model(TEXTS))
    rows = punctual.FilterBatch(configuration, 3).step(0.0, np.zeros((3, 2)))[0]
    assert rows.tolist() == [filter.step(0.0, [0.0, 0.0]).u.tolist()] * 3


@pytest.mark.parametrize(
    ("function", "text"),
    [
        (lambda x: 3 - x[0], "3 - p"),
        (lambda t, x: 3 + 0.1 * t - x[0], "3 + 0.1 * t - p"),
        (lambda t, x, p: p["m"] - x[0], "m - p"),
        (lambda x, far=3.0: far - x[0], "3 - p"),
        (lambda x: 9 - x @ x, "9 - (p * p + v * v)"),
        (lambda x: 9 - x @ np.diag([2.0, 0.5]) @ x, "9 - (p * 2 * p + v * 0.5 * v)"),
        (lambda x: 9 - np.dot([1, -3], x), "9 - (1 * p + (-3 * v))"),
        (lambda x: 9 - np.linalg.norm(x), "9 - sqrt(p * p + v * v)"),
        (lambda x: 9 - sum(x) - np.sum(x), "9 - (p + v) - (p + v)"),
        (lambda x: np.exp(-(x**2)).sum() - np.hypot(*x), "exp(-p^2) + exp(-v^2) - sqrt(p^2 + v^2)"),
        (lambda x: np.float32(0.1) - x[0] * np.int8(-2), "0.10000000149011612 - p * (-2)"),
        (lambda x: np.array(2.5) - np.array([1.0, -1e-7]) @ x, "2.5 - (1 * p + (-1e-07 * v))"),
        (lambda x: 1 / x[0] ** -1 - 2 ** -x[0] - (-x[0]) ** 2, "1 / p^(-1) - 2^(-p) - (-p)^2"),
        (lambda x: np.square(x[0]) - np.reciprocal(x[1]) - abs(-x[0]), "p^2 - 1 / v - abs(-p)"),
        (lambda x: np.deg2rad(x[0]) - +x[1] * 0 - np.negative(x[0]), f"p * {math.pi / 180!r} - (-p)"),
        (lambda x: np.asarray(4 - x[0]), "4 - p"),
        (lambda x: 3, "3"),
    ],
)
def test_what_a_function_does_is_written_as_by_hand(function, text):
    assert traced(model(barrier=function))["barrier"][0]["expression"] == text


def test_texts_mean_what_python_does():
    """Texts of random functions, read again by Python, whose order of operators is that of expressions."""
    numbers = random.Random(1)
    values = {name: numbers.uniform(-2.0, 2.0) for name in "abc"}

    def grown(depth):
        if depth == 0:
            name = numbers.choice("abc")
            number = numbers.choice([numbers.uniform(-2.0, 2.0), numbers.randint(1, 3), 1e-9, -1e20])
            return (Symbol(name), values[name]) if numbers.random() < 0.7 else (number, number)
        (a, at_a), (b, at_b) = grown(numbers.randint(0, depth - 1)), grown(depth - 1)
        match numbers.choice("+-*/n2"):
            case "+":
                return a + b, at_a + at_b
            case "-":
                return a - b, at_a - at_b
            case "*":
                return a * b, at_a * at_b
            case "/":
                return a / b, at_a / at_b
            case "n":
                return -b, -at_b
            case _:
                return b**2, at_b**2

    seen = 0
    for _ in range(3000):
        try:
            symbol, wanted = grown(6)
        except (OverflowError, ZeroDivisionError):
            continue
        if isinstance(symbol, Symbol):
            seen += 1
            found = float(eval(symbol.text.replace("^", "**"), {}, values))
            # Where a summand 0 is left out, the sign of a 0 may change.
            assert found.hex() == float(wanted).hex() or found == wanted == 0.0, symbol.text
    assert seen > 2000


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_function_of_numpy_is_that_of_expressions(name):
    ufunc = getattr(np, name)

    def h(x):
        return 5 * x[0] + ufunc(*[x[0], 0.4][: ufunc.nin])

    plant = {
        "states": [{"name": "p", "min": 0.1, "max": 0.9}],
        "inputs": [{"name": "r"}],
        "derivatives": lambda x, u: u,
    }
    filter = punctual.Filter({"kind": "filter", "plant": plant, "barrier": [{"name": "b", "expression": h}]})
    for k, x in enumerate([0.2, 0.3, 0.7]):
        assert filter.step(0.001 * k, [x]).barriers["b"].h == pytest.approx(h([x]), rel=1e-15)
    # In an array, NumPy asks each element.
    if name not in ("minimum", "maximum"):
        policy = traced({"plant": plant, "policy": lambda x: ufunc(*[x, x][: ufunc.nin])})["policy"]
        assert policy == {"r": f"{FUNCTIONS[name]}({', '.join(['p', 'p'][: ufunc.nin])})"}


def test_the_functions_and_the_longest_expression_are_those_of_the_language():
    with pytest.raises(punctual.Error) as refused:
        punctual.Filter(model(barrier="foo(p)"))
    listed = str(refused.value).partition("the functions are ")[2]
    assert sorted(listed.split(", ")) == sorted(FUNCTIONS.values())
    punctual.Filter(model(barrier=f"{'3 - p':{LONGEST}}"))
    with pytest.raises(punctual.Error, match=f"must have at most {LONGEST}$"):
        punctual.Filter(model(barrier=f"{'3 - p':{LONGEST + 1}}"))


def branches(x):
    return x[0] if x[0] > 0.0 else -x[0]


def grows(x):
    y = x[0]
    for _ in range(20):
        y = y * y + 1
    return y


def leans_on_math(x):
    return math.sin(x[0])


def keeps_in_floats(x):
    a = np.zeros(2)
    a[0] = x[0]
    return a[0]


@pytest.mark.parametrize(
    ("function", "line", "kind", "words"),
    [
        (branches, 1, TypeError, "a condition on a traced value at {}: the function is called once, .*np.minimum"),
        (lambda x: max(x[0], 0.0), 0, TypeError, "a condition on a traced value at {}"),
        (lambda x: np.where(x > 0, x, 0), 0, TypeError, "a condition on a traced value at {}"),
        (lambda x: np.max(x), 0, TypeError, "a condition on a traced value at {}"),
        (lambda x: x[0] == 1, 0, TypeError, "a condition on a traced value at {}"),
        (lambda x: not x[0], 0, TypeError, "a condition on a traced value at {}"),
        (leans_on_math, 1, TypeError, "a number is asked of a traced value at {}: .*write np.sin in place of math.sin"),
        (keeps_in_floats, 2, TypeError, r"a number is asked of a traced value at {}: .*np.zeros\(n, object\)"),
        (lambda x: range(x[0]), 0, TypeError, "a number is asked of a traced value at {}"),
        (lambda x: round(x[0], 2), 0, TypeError, "a number is asked of a traced value at {}"),
        (lambda x: np.arcsin(x[0]), 0, TypeError, "np.arcsin of a traced value at {} cannot be traced; what can be: .*np.sqrt"),
        (lambda x: np.add(x[0], 1, where=True), 0, TypeError, "np.add of a traced value at {} cannot be traced"),
        (lambda x: x[0] * "2", 0, TypeError, "'2' and a traced value meet at {}; must be a real number"),
        (lambda x: x[0] * 2j, 0, TypeError, "2j and a traced value meet at {}; must be a real number"),
        (lambda x: x[0] * math.nan, 0, punctual.Error, "nan is part of an expression at {}; must be finite"),
        (lambda x: x[0] / 0, 0, ZeroDivisionError, "a traced value is divided by 0 at {}"),
        (grows, 3, punctual.Error, "an expression has [0-9]+ characters at {}, must have at most 4096; a part"),
    ],
)
def test_what_cannot_be_traced_says_where(function, line, kind, words):
    code = function.__code__
    with pytest.raises(kind, match=words.format(f"{code.co_filename}:{code.co_firstlineno + line}")) as refused:
        punctual.Filter(model(barrier=function))
    [note] = refused.value.__notes__
    assert note.startswith(f"barrier[0].expression: {function.__qualname__} ({code.co_filename}:") and "np.sqrt" in note


def test_an_error_of_the_function_itself_is_passed_on():
    with pytest.raises(KeyError, match="mass") as refused:
        punctual.Filter(model(lambda x, u, p: p["mass"]))
    assert refused.value.__notes__[0].startswith("plant.derivatives: ")
    # An element that is a number has no method for NumPy to call.
    with pytest.raises(TypeError, match="no callable arcsin method"):
        punctual.Filter(model(barrier=lambda x: np.arcsin(x)[0]))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (dict(derivatives=lambda x: x), r"^plant.derivatives: .* takes 1 arguments, must take \(x, u\) or \(x, u, p\)$"),
        (dict(derivatives=lambda x, u: x[:1]), r"^plant.derivatives: .* returns array\(\[<traced p>\], .*\), must return 2 single "),
        (dict(derivatives=lambda x, u: [x, x]), "returns .*, must return 2 single values, for p, v"),
        (dict(derivatives=lambda x, u: [x[0], x]), "must return 2 single values, for p, v, finite numbers or traced"),
        (dict(derivatives=lambda x, u: {"p": x[0], "v": u[0]}), "returns .*, must return 2 single values, for p, v"),
        (dict(derivatives=lambda x, u: None), "returns None, must return 2 single values, for p, v"),
        (dict(derivatives=lambda x, u: [x[1], None]), "must return 2 single values, for p, v, finite numbers or traced ones"),
        (dict(derivatives=lambda x, u: [x[1], math.inf]), "must return 2 single values, for p, v, finite numbers or traced ones"),
        (dict(derivatives=dict), "^plant.derivatives: the arguments of <class 'dict'> are not known, must be"),
        (dict(derivatives=lambda x, u: [x[1], u[0] ** 2]), r'^plant.derivatives.v: .* "F\^2" is not affine in the input F'),
        (dict(barrier=lambda: 0.0), r"^barrier\[0\].expression: .* takes 0 arguments, must take \(x\) or \(t, x\) or \(t, x, p\)$"),
        (dict(barrier=lambda x: x), "^barrier.0..expression: .* must return a single value"),
        (dict(barrier=lambda x: "p"), "must return a single value"),
        (dict(barrier=lambda x: x[0] + x[1]), r'barrier\[0\].expression: is "p \+ v", in which "p" is in m and "v" in m/s'),
        (dict(policy=lambda x: [1.0, 2.0]), "^policy: .* must return 1 single values, for F"),
        (dict(policy={"F": lambda x: [1.0]}), "^policy.F: .* must return a single value"),
        (dict(plant={"model": "tank"}, barrier=lambda x: 0), "tank"),
        (dict(plant={}, barrier=lambda x: 0), "^plant.states: is None, must be a list of dicts, each with a name"),
        (dict(plant={"states": ["p"]}, barrier=lambda x: 0), "^plant.states: is .'p'., must be a list of dicts"),
    ],
)
def test_what_does_not_fit_is_refused(change, words):
    with pytest.raises(punctual.Error, match=words):
        punctual.Filter(model(**change))


def test_what_the_filter_refuses_names_the_function():
    def squared(x, u):
        return [x[1], u[0] ** 2]

    place = f"squared ({__file__}:{squared.__code__.co_firstlineno}) made it"
    for use in [punctual.Filter, punctual.check]:
        with pytest.raises(punctual.Error, match="^plant.derivatives.v: ") as refused:
            use(model(squared, lambda x: 3 - x[0]))
        assert str(refused.value).endswith(f"; test_what_the_filter_refuses_names_the_function.<locals>.{place}")
    with pytest.raises(punctual.Error) as refused:
        punctual.Filter(model(barrier=lambda x: x[0] + x[1]))
    assert str(refused.value).startswith("barrier[0].expression: ") and " made it" in str(refused.value)
    with pytest.raises(punctual.Error) as refused:
        punctual.Filter(model({"p": "v", "v": "F^2"}, lambda x: 3 - x[0]))
    assert "made it" not in str(refused.value)


def test_a_function_where_no_expression_stands_is_refused():
    words = r"^plant.inputs\[0\].max: is <function .*; a function may replace only an expression$"
    with pytest.raises(TypeError, match=words):
        punctual.Filter(model() | {"plant": {"inputs": [{"name": "F", "max": lambda x: 1}]}})


def test_every_expression_of_a_configuration_may_be_a_function():
    found = traced(
        model(
            {"p": lambda x, u: x[1], "v": "F / m"},
            policy=lambda t, x, p: [-p["m"] * x[1]],
            u_ref={"F": lambda x: -x[1]},
            simulated={"states": [{"name": "q"}], "inputs": [{"name": "F"}], "derivatives": lambda x, u: u - x},
        )
    )
    assert found["plant"]["derivatives"] == {"p": "v", "v": "F / m"}
    assert (found["policy"], found["u_ref"]) == ({"F": "-m * v"}, {"F": "-v"})
    assert found["simulated"]["derivatives"] == {"q": "F - q"}


def test_a_barrier_of_a_vehicle_by_name_may_be_a_function():
    vehicle = {"kind": "filter", "plant": {"model": "unicycle"}}
    functions = [{"name": "slow", "expression": lambda x: 3 - x[3], "unit": "m/s"}]
    texts = [{"name": "slow", "expression": "3 - v", "unit": "m/s"}]
    bounds = {"bounds": {"a": [-4.0, 4.0], "omega": [-1.0, 1.0]}, "policy": lambda x: -x[[3, 2]]}
    assert steps(vehicle | bounds | {"barrier": functions}) == steps(
        vehicle | bounds | {"barrier": texts, "policy": {"a": "-v", "omega": "-theta"}}
    )


def test_a_file_of_it_is_the_same_for_the_command_line(tmp_path):
    configuration = model(mass, lambda x: 3 - x[0], u_ref=lambda x: [4.0 - x[1]])
    plant = {"kind": "plant", "plant": configuration["plant"], "x0": {"v": 0.5}}
    files = {}
    for kind, own in [("filter", configuration), ("plant", plant)]:
        files[kind] = tmp_path / f"{kind}.toml"
        files[kind].write_text(punctual.to_toml(own))
        assert tomllib.loads(files[kind].read_text()) == traced(own)
        ours, theirs = punctual.build(own, tmp_path / "a.fmu"), tmp_path / "b.fmu"
        punctual.run_cli("build", files[kind], "-o", theirs)
        assert ours.read_bytes() == theirs.read_bytes()
    assert steps(files["filter"]) == steps(configuration)
    options = dict(plant=plant, u_ref={"F": 1.0})
    report = punctual.check(configuration, **options)
    assert report == punctual.check(files["filter"], **options | {"plant": files["plant"]})
    assert report["barriers"][0]["relative_degree"] == 2
    punctual.run_cli("run", files["filter"], "--out", tmp_path)


def test_the_documentation_says_what_is_printed(capsys):
    text = (ROOT / "docs" / "python.md").read_text()
    [block] = [part.partition("```")[0] for part in text.split("```python\n") if "def pendulum" in part]
    exec(block, {})
    effort, file = capsys.readouterr().out.split("\n", 1)
    assert 0.0 < float(effort) <= 1.0
    derivatives = tomllib.loads(file)["plant"]["derivatives"]
    assert f'omega = "{derivatives["omega"]}"' in block


def test_the_example_keeps_what_it_claims(tmp_path):
    script = ROOT / "examples" / "cart_pole.py"
    done = subprocess.run([sys.executable, script], cwd=tmp_path, check=True, capture_output=True, text=True)
    text, plan, found = done.stdout.rpartition("a plan: ")
    assert tomllib.loads(text)["plant"]["derivatives"]["theta"] == "omega"
    assert "from 3 s on within 0.1" in found and plan
