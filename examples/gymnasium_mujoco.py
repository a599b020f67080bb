"""A random policy pushes MuJoCo's InvertedPendulum-v5, and a filter lets neither the pole fall nor the cart meet its stops.

    pip install "gymnasium[mujoco]"       # beside Punctual's wheel, which python/wheel makes; needs no display
    python examples/gymnasium_mujoco.py

The cart runs on a rail of 1 m to either side. The pole starts upright within 0.01 rad, and the environment ends an episode
where it leans by more than 0.2 rad. With the filter it leans by at most 0.19 rad and the cart stays within 0.9 m, at all
times; from 3 s on the cart is within 0.3 m of 0.5 m. The policy does not matter. Without the filter every episode ends within
a second.

The model of the filter is the textbook's cart with a pole, as a Python function. Its numbers are those of the environment's
file, inverted_pendulum.xml. The file has no masses: MuJoCo makes them of the capsules, 1000 kg/m3, and this program reads what
it made. The motor has a gear of 100, so an action of 3 is a force of 300 N. Each joint has a damping of 1. The centre of the
pole is 0.5 mm beside its axis, so the lean is counted from where it balances: without that, plans come to nothing at 3 s.

The environment does not quite do what the model says. MuJoCo makes two Runge-Kutta steps of 0.02 s in each step, and an
action is a float32. This program prints the difference of every step. `filter_guaranteed` says that a plan keeps the
promise in the model, whatever actions come. No theorem says so of MuJoCo. For that the sets of the filter are smaller than
those that are claimed, by ROOM, which has the 0.0017 rad of that lean in it too. This program asserts what happened.
"""

import gymnasium
import numpy as np
import punctual
from punctual.gymnasium import SafetyFilterEnv

EPISODES, STEPS = 10, 200
LEAN, RAIL, PLACE, NEAR, DEADLINE, ROOM = 0.19, 0.9, 0.5, 0.3, 3.0, 0.002  # rad, m, m, m, s, rad or m

cart = gymnasium.make("InvertedPendulum-v5", max_episode_steps=STEPS)
file, DT = cart.unwrapped.model, cart.unwrapped.dt
_, M_C, M_P = file.body_mass.tolist()
ASIDE, _, L = file.body_ipos[2].tolist()  # of the centre of the pole, from the joint
J = float(file.body_inertia[2, 1]) + M_P * (L**2 + ASIDE**2)  # about the joint
GEAR, (D_C, D_P), G = float(file.actuator_gear[0, 0]), file.dof_damping.tolist(), -float(file.opt.gravity[2])


def state(observation):
    """Place, lean of the centre of the pole, speed, rate of the lean."""
    return observation + [0.0, np.arctan2(ASIDE, L), 0.0, 0.0]


def dynamics(x, u):
    """The derivative of (place, lean, speed, rate of the lean) under an action."""
    _, theta, v, omega = x
    sine, cosine = np.sin(theta), np.cos(theta)
    push = GEAR * u[0] - D_C * v + M_P * L * omega**2 * sine
    turn = M_P * G * L * sine - D_P * omega
    determinant = (M_C + M_P) * J - (M_P * L * cosine) ** 2
    a = (J * push - M_P * L * cosine * turn) / determinant
    return np.array([v, omega, a, ((M_C + M_P) * turn - M_P * L * cosine * push) / determinant])


FILTER = {
    "kind": "filter",
    "plant": {
        "states": [
            {"name": "x", "unit": "m", "min": -RAIL, "max": RAIL},
            {"name": "theta", "unit": "rad", "min": -LEAN, "max": LEAN},
            {"name": "v", "unit": "m/s"},
            {"name": "omega", "unit": "rad/s"},
        ],
        "inputs": [{"name": "motor", "min": -3.0, "max": 3.0}],
        "derivatives": dynamics,
    },
    "barrier": [
        {"name": "left", "expression": f"theta + {LEAN - ROOM}", "unit": "rad"},
        {"name": "right", "expression": f"{LEAN - ROOM} - theta", "unit": "rad"},
        {"name": "begin", "expression": f"x + {RAIL - ROOM}", "unit": "m"},
        {"name": "end", "expression": f"{RAIL - ROOM} - x", "unit": "m"},
        {"name": "goal", "expression": f"{(NEAR - ROOM) ** 2} - (x - {PLACE})^2", "unit": "m2", "deadline": DEADLINE},
    ],
    "experiment": {"step_size": DT},
}


def ahead(x, action):
    """The state of the model one step later."""
    h = DT / 4
    for _ in range(4):
        k1 = dynamics(x, action)
        k2 = dynamics(x + h / 2 * k1, action)
        k3 = dynamics(x + h / 2 * k2, action)
        k4 = dynamics(x + h * k3, action)
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return x


def explore(env):
    """For every episode the states, a row each, and what the filter said."""
    env.action_space.seed(1)
    for episode in range(EPISODES):
        x, _ = env.reset(seed=episode)
        states, told, over = [x], [], False
        while not over:
            x, _, terminated, truncated, info = env.step(env.action_space.sample())
            states.append(x)
            told.append(info)
            over = terminated or truncated
        yield np.array(states), told


fallen = [len(told) * DT for states, told in explore(cart) if abs(states[-1, 1]) > 0.2]
print(f"bare:     the pole falls in {len(fallen)} of {EPISODES} episodes, within {max(fallen):.2f} s")
assert len(fallen) == EPISODES

episodes = list(explore(SafetyFilterEnv(cart, FILTER, state=state)))
place, lean = (np.concatenate([states[:, i] for states, _ in episodes]) for i in (0, 1))
late = np.concatenate([states[round(DEADLINE / DT) :, 0] for states, _ in episodes])
told = [info for _, infos in episodes for info in infos]
changed = np.mean([info["filter_changed"] for info in told])
print(f"filtered: lean at most {np.abs(lean).max():.4f} rad, cart at most {np.abs(place).max():.4f} m from the middle")
print(f"          from {DEADLINE:g} s on within {np.abs(late - PLACE).max():.4f} m of {PLACE:g} m")
print(f"          {100 * changed:.0f} % of the actions changed")

# What the environment does differently, step by step.
off = [
    np.abs(state(after) - ahead(state(before), info["filter_action"].astype(float)))
    for states, infos in episodes
    for before, after, info in zip(states, states[1:], infos)
]
for name, unit, most in zip(("x", "theta", "v", "omega"), ("m", "rad", "m/s", "rad/s"), np.max(off, axis=0)):
    print(f"model:    {name} off by at most {most:.0e} {unit} in a step")

assert all(len(states) == STEPS + 1 for states, _ in episodes)
assert np.abs(lean).max() <= LEAN and np.abs(place).max() <= RAIL and np.abs(late - PLACE).max() <= NEAR
assert all(info["filter_guaranteed"] for info in told)
