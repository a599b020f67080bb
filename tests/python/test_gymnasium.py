"""`punctual.gymnasium`: what a policy wants goes through the filter, one environment or many at a time."""

import copy
import importlib
import subprocess
import sys
import warnings

import gymnasium
import numpy as np
import punctual
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from punctual.gymnasium import SafetyFilterEnv, SafetyFilterVectorEnv

from conftest import ROOT

# A power of two, so that times and deadlines are exact wherever an episode begins.
DT = 1 / 32
STEPS = 12
LEAN = 0.2
UPRIGHT = {
    "kind": "filter",
    "plant": {
        "states": [{"name": "y", "unit": "rad", "min": -0.4, "max": 0.4}, {"name": "omega", "unit": "rad/s"}],
        "inputs": [{"name": "torque", "unit": "N.m", "min": -2.0, "max": 2.0}],
        "derivatives": {"y": "omega", "omega": "15 * sin(y) + 3 * torque"},
    },
    "barrier": [
        {"name": "left", "expression": f"y + {LEAN}", "unit": "rad", "deadline": 1.0},
        {"name": "right", "expression": f"{LEAN} - y", "unit": "rad", "deadline": 1.0},
    ],
    "experiment": {"step_size": DT},
}
START = {"x_init": 0.1, "y_init": 0.1}


class Upright(gymnasium.Wrapper):
    """Pendulum-v1 that starts upright, with steps of DT, and remembers what it was told to do."""

    def __init__(self):
        super().__init__(gymnasium.make("Pendulum-v1", max_episode_steps=STEPS))
        self.unwrapped.dt = DT
        self.done = []

    def reset(self, *, seed=None, options=None):
        return self.env.reset(seed=seed, options=START)

    def step(self, action):
        self.done.append(action)
        return self.env.step(action)


def state(observation):
    """Of one observation, or of a row each."""
    return np.stack([np.arctan2(observation[..., 1], observation[..., 0]), observation[..., 2]], axis=-1)


def wanted(seed, count, n=None):
    """Torques of the type of the action space."""
    space = gymnasium.spaces.Box(-2.0, 2.0, (1,) if n is None else (n, 1), np.float32, seed=seed)
    return [space.sample() for _ in range(count)]


def test_actions_are_those_of_the_filter_and_info_says_so():
    bare, own = Upright(), punctual.Filter(UPRIGHT)
    env = SafetyFilterEnv(bare, UPRIGHT, state=state)
    assert env.dt == DT
    changed = set()
    for episode in range(2):
        observation, _ = env.reset(seed=3)
        own.reset()
        for k, action in enumerate(wanted(5, STEPS)):
            step = own.step(k * DT, state(observation), action)
            observation, _, _, truncated, info = env.step(action)
            assert info["filter_action"].tobytes() == step.u.astype(np.float32).tobytes()
            assert bare.done[-1] is info["filter_action"] and info["filter_nominal"] is action
            assert info["filter_action"] in env.action_space
            assert info["filter_changed"] == (step.u[0] != action[0])
            assert info["filter_status"] is step.status
            assert info["filter_guaranteed"] is all(b.guaranteed for b in step.barriers.values()) is True
            assert info["filter_reason"] == (step.reason if info["filter_changed"] else None)
            reason = info["filter_reason"]
            assert reason is None or reason[0] in {"left", "right"} and reason[1] >= k * DT
            assert info["filter_refusal"] is None
            assert (info["filter_action"] is action) == (not info["filter_changed"])
            changed.add(info["filter_changed"])
        assert truncated
    assert changed == {True, False}
    # The second episode is the first once more: the filter has forgotten it.
    assert np.array(bare.done[:STEPS]).tobytes() == np.array(bare.done[STEPS:]).tobytes()


def test_a_withdrawn_guarantee_is_explained():
    # A pole that is pushed is not its model.
    env = SafetyFilterEnv(Upright(), UPRIGHT, state=state)
    env.reset(seed=3)
    *_, info = env.step(np.zeros(1, np.float32))
    assert info["filter_guaranteed"] and info["filter_refusal"] is None
    env.unwrapped.state = np.array([0.6, 3.0])
    env._x = state(env.unwrapped._get_obs())
    *_, info = env.step(np.zeros(1, np.float32))
    assert not info["filter_guaranteed"] and info["filter_refusal"]


def test_state_and_action_may_be_scaled_and_picked():
    bare = Upright()
    # From [0, cos, sin, speed], in small angles; an action of 1 is the whole torque.
    shown = gymnasium.wrappers.TransformObservation(
        bare, lambda o: np.append(0.0, o), gymnasium.spaces.Box(-9.0, 9.0, (4,))
    )
    scaled = gymnasium.wrappers.RescaleAction(shown, np.float32(-1.0), np.float32(1.0))
    env = SafetyFilterEnv(
        scaled, punctual.Filter(UPRIGHT), state=[2, 3], to_input=lambda a: 2.0 * a, to_action=lambda u: u / 2.0
    )
    own = punctual.Filter(UPRIGHT)
    observation, _ = env.reset(seed=3)
    for k, action in enumerate(wanted(5, STEPS)):
        step = own.step(k * DT, observation[[2, 3]], action)
        observation, *_, info = env.step(action / np.float32(2.0))
        assert info["filter_action"].tobytes() == (step.u / 2.0).astype(np.float32).tobytes()


def test_an_environment_is_copied_with_its_filter():
    env = SafetyFilterEnv(Upright(), UPRIGHT, state=state)
    env.reset(seed=3)
    actions = wanted(5, STEPS)
    [env.step(action) for action in actions[:5]]
    again = copy.deepcopy(env)
    [again.step(-action) for action in actions[:3]]
    straight = SafetyFilterEnv(Upright(), UPRIGHT, state=state)
    straight.reset(seed=3)
    expected = [straight.step(action)[0].tobytes() for action in actions]
    assert [env.step(action)[0].tobytes() for action in actions[5:]] == expected[5:]


KEYS = ["filter_changed", "filter_nominal", "filter_action", "filter_status", "filter_guaranteed"]


@pytest.mark.parametrize("mode", AutoresetMode)
def test_every_row_is_an_environment_of_its_own(mode):
    n, seed = 3, 11
    envs = SyncVectorEnv([Upright for _ in range(n)], autoreset_mode=mode)
    batch = SafetyFilterVectorEnv(envs, UPRIGHT, state=state)
    singles = [SafetyFilterEnv(Upright(), UPRIGHT, state=state) for _ in range(n)]
    seen, _ = batch.reset(seed=seed)
    assert seen.tolist() == [env.reset(seed=seed + i)[0].tolist() for i, env in enumerate(singles)]
    # An early end of one row, so that episodes begin at different times.
    for env in (singles[1], envs.envs[1]):
        while not isinstance(env, gymnasium.wrappers.TimeLimit):
            env = env.env
        env._max_episode_steps = STEPS - 5
    over, begun = np.zeros(n, bool), 0
    for actions in wanted(5, 3 * STEPS, n):
        if mode is AutoresetMode.DISABLED and over.any():
            seen, _ = batch.reset(options={"reset_mask": over.copy()})
            begun += over.sum()
            for i in np.flatnonzero(over):
                assert singles[i].reset()[0].tolist() == seen[i].tolist()
            over[:] = False
        seen, _, terminated, truncated, info = batch.step(actions)
        for i, env in enumerate(singles):
            if mode is AutoresetMode.NEXT_STEP and over[i]:
                assert env.reset()[0].tolist() == seen[i].tolist()
                over[i], begun = False, begun + 1
                # No action was done.
                assert not any(info[f"_{key}"][i] or np.any(info[key][i]) for key in KEYS)
                continue
            observation, _, _, ended, said = env.step(actions[i])
            over[i] = ended
            for key in KEYS:
                assert np.array_equal(info[key][i], said[key]) and info[f"_{key}"][i], key
            if mode is AutoresetMode.SAME_STEP and ended:
                observation, begun = env.reset()[0], begun + 1
            assert observation.tolist() == seen[i].tolist()
        assert truncated.tolist() == over.tolist() and not terminated.any()
    assert begun >= 2 * n
    # All at once start at time 0.
    again, _ = batch.reset(seed=seed)
    assert again.tolist() == [env.reset(seed=seed + i)[0].tolist() for i, env in enumerate(singles)]


class Crossing(gymnasium.Env):
    """A mass on a plane; across its way goes a disc that begins at the same place in every episode."""

    dt, begin = DT, 0.0
    action_space = gymnasium.spaces.Box(-9.0, 9.0, (2,), np.float64)
    observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (4,), np.float64)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.x, self.steps = np.zeros(4), 0
        return self.x.copy(), {}

    def step(self, u):
        nearest = np.inf
        for part in range(16):
            # Exact: the acceleration is constant.
            self.x[:2] += DT / 16 * self.x[2:] + (DT / 16) ** 2 / 2 * u
            self.x[2:] += DT / 16 * u
            t = self.begin + DT * (self.steps + (part + 1) / 16)
            nearest = min(nearest, np.hypot(self.x[0] - 6.0, self.x[1] - (6.0 - t)) - 2.0)
        self.steps += 1
        return self.x.copy(), 0.0, False, self.steps == 384, {"nearest": nearest}


def crossed(begin):
    """The filter for it, of a run that begins at that time."""
    goal = {"name": "goal", "centre": [12.0, 0.0], "radius": 1.0, "deadline": 9.0}
    cart = {"name": "cart", "shape": "obstacle", "centre": [6.0, 6.0], "velocity": [0.0, -1.0], "radius": 2.0}
    bounds = {"u_x": [-2.0, 2.0], "u_y": [-2.0, 2.0]}
    experiment = {"step_size": DT, "start_time": begin, "stop_time": begin + 12.0}
    return {"kind": "filter", "plant": {"model": "point_mass"}, "bounds": bounds, "barrier": [goal, cart], "experiment": experiment}


@pytest.mark.parametrize("mode", [None, *AutoresetMode])
@pytest.mark.parametrize("begin", [0.0, 1.0])
def test_what_moves_begins_anew_with_every_episode(mode, begin):
    bare = type("Begun", (Crossing,), {"begin": begin})
    if mode is None:
        env = SafetyFilterEnv(bare(), crossed(begin))
    else:
        env = SafetyFilterVectorEnv(SyncVectorEnv([bare, bare], autoreset_mode=mode), crossed(begin))
    seen, _ = env.reset()
    over, episodes = np.zeros(() if mode is None else 2, bool), 0
    for _ in range(3 * 385):
        if over.all() and mode in (None, AutoresetMode.DISABLED):
            seen, _ = env.reset(options=None if mode is None else {"reset_mask": over})
        restarts = mode is AutoresetMode.NEXT_STEP and over.all()
        # Straight on, through the disc.
        seen, _, _, over, info = env.step(np.stack([1.5 - seen[..., 2], -seen[..., 3]], axis=-1))
        over, episodes = np.asarray(over), episodes + np.all(over)
        told = info["final_info"] if mode is AutoresetMode.SAME_STEP and over.all() else info
        assert restarts or np.all(info["filter_guaranteed"]) and np.min(told["nearest"]) >= 0.0, episodes
    assert episodes == 3 or mode is AutoresetMode.NEXT_STEP and episodes >= 2


def test_the_checker_of_gymnasium_finds_nothing_new():
    def warned(env):
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            check_env(env, skip_render_check=True)
        return {str(warning.message) for warning in said}

    bare = gymnasium.make("Pendulum-v1").unwrapped
    env = SafetyFilterEnv(bare, UPRIGHT | {"experiment": {"step_size": 0.05}}, state=state)
    new = warned(env) - warned(bare)
    assert [text for text in new if "is different from the unwrapped version" not in text] == []


def test_what_does_not_fit_is_refused():
    with pytest.raises(punctual.Error, match=r"^experiment.step_size: is 0.001 s, must be .* dt, 0.03125 s$"):
        SafetyFilterEnv(Upright(), UPRIGHT | {"experiment": {}})
    with pytest.raises(punctual.Error, match="^experiment.step_size: is 0.03125 s, must be .* dt, 0.1 s$"):
        SafetyFilterEnv(Upright(), UPRIGHT, dt=0.1)
    car = gymnasium.make("MountainCarContinuous-v0")
    with pytest.raises(punctual.Error, match="^dt: is not given, and the environment has no dt or tau; must be"):
        SafetyFilterEnv(car, UPRIGHT)
    assert SafetyFilterEnv(car, UPRIGHT, dt=DT, to_action=lambda u: u / 2.0).dt == DT
    # An environment that cuts what it is given is not the plant any more.
    for wrapper, env in [(SafetyFilterEnv, car), (SafetyFilterVectorEnv, SyncVectorEnv([lambda: car]))]:
        with pytest.raises(punctual.Error, match="^bounds.torque: is -2 to 2, must be within the actions .*, -1 to 1;"):
            wrapper(env, UPRIGHT, dt=DT)
    for bounds in ({"torque": [-2.0, 2.1]}, {"torque": [-2.1, 2.0]}):
        with pytest.raises(punctual.Error, match="^bounds.torque: is .* must be within .* -2 to 2;"):
            SafetyFilterEnv(Upright(), UPRIGHT | {"bounds": bounds})
    envs = SyncVectorEnv([Upright, Upright])
    with pytest.raises(punctual.Error, match="^filter: has 3 rows, must have 2, one for each environment$"):
        SafetyFilterVectorEnv(envs, punctual.FilterBatch(UPRIGHT, 3))
    with pytest.raises(punctual.Error, match="^filter: is a Filter, must be a configuration or a FilterBatch of 2 rows$"):
        SafetyFilterVectorEnv(envs, punctual.Filter(UPRIGHT))
    with pytest.raises(punctual.Error, match="^filter: is a FilterBatch, must be a configuration or a Filter; "):
        SafetyFilterEnv(Upright(), punctual.FilterBatch(UPRIGHT, 1))
    for dt in [0.0, -DT, float("nan"), "0.1"]:
        with pytest.raises(punctual.Error, match=f"^dt: is {dt!r}, must be the time between two steps in s, > 0$"):
            SafetyFilterEnv(Upright(), UPRIGHT, dt=dt)
    for env, action in [(SafetyFilterEnv(Upright(), UPRIGHT), [0.0]), (SafetyFilterVectorEnv(envs, UPRIGHT), [[0.0]] * 2)]:
        with pytest.raises(gymnasium.error.ResetNeeded, match="call reset"):
            env.step(action)
    single = SafetyFilterEnv(Upright(), UPRIGHT, state=state)
    single.reset()
    with pytest.raises(TypeError, match="^action: is None, must be what the policy wants$"):
        single.step(None)
    # The observation as it is has three components.
    env.reset()
    with pytest.raises(ValueError, match=r"x: has shape \(2, 3\), must have \(2, 2\) \(y, omega\)"):
        env.step([[0.0]] * 2)


def test_without_gymnasium_the_message_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "gymnasium", None)
    monkeypatch.delitem(sys.modules, "punctual.gymnasium")
    with pytest.raises(ImportError, match="punctual.gymnasium needs Gymnasium 1.1 or later: pip install gymnasium"):
        importlib.import_module("punctual.gymnasium")


@pytest.mark.parametrize(
    "name, bare, filtered",
    [
        ("gymnasium_pendulum", "20 of 20 episodes fall", "at most 0.1"),
        ("gymnasium_mujoco", "falls in 10 of 10 episodes", "lean at most 0.1"),
    ],
)
def test_the_examples_keep_what_they_claim(name, bare, filtered, tmp_path):
    script = ROOT / "examples" / f"{name}.py"
    done = subprocess.run([sys.executable, script], cwd=tmp_path, check=True, capture_output=True, text=True)
    first, second, *_ = done.stdout.splitlines()
    assert bare in first and filtered in second
