"""Runs environments of Gymnasium, as they are, behind filters, and judges the promises by their states.

    episodes.py [--episodes N] [--only NAME] [--seed S] [--json FILE] [--folder FOLDER] [--learn GENERATIONS]

For each environment a file beside this one has the model, as its documentation gives it, and the promises.
Here

- random actions are recorded, of the environment as it is and behind a filter of the model alone, and
  `punctual identify` says what the file should declare,
- a filter with that meets four hostile policies in turn: random, bang-bang, one extreme for ever, and
  pumping, which pushes the way it moves,
- each promise is judged at every step of the physics that the environment makes, from its own state, by a
  function written here: none of the filter's h is used,
- the same episodes are run without a filter, and with that of the model alone, where nothing is declared,
- a policy learns, with the filter and without, and every promise broken in all of its training is counted.

Prints tables in Markdown. Code 1 if a start is refused or a promise broken where the uncertainty is declared,
or if a promise is broken while it is reported as guaranteed, by any filter or in the training.
"""

import argparse
import csv
import json
import pathlib
import statistics
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import gymnasium
import mujoco
import numpy as np
from numpy.typing import NDArray
from punctual.gymnasium import SafetyFilterEnv

HERE = pathlib.Path(__file__).parent
Array = NDArray[np.float64]
Policy = Callable[[Array, int], Array]
POLICIES = ("random", "bang-bang", "extreme", "pumping")
RECORDED, ROWS = 40, 5000  # at most so many episodes, and rows


@dataclass(frozen=True)
class Promise:
    """`h` of the environment's own positions and velocities is at least 0 from `deadline` on, in s."""

    name: str
    h: Callable[[Array], float]
    deadline: float = 0.0


@dataclass(frozen=True)
class Plant:
    """An environment and what is promised of it."""

    name: str
    title: str
    promised: str
    id: str
    dt: float
    steps: int
    state: Callable[[Any], Any]
    """The state of the filter from an observation."""
    velocities: tuple[int, ...]
    """The component of that state that each input drives."""
    promises: tuple[Promise, ...]
    options: dict[str, Any] | None = None
    tolerance: float = 1e-9

    def make(self) -> "Watched":
        """The environment, every step of whose physics is seen."""
        if self.id.startswith("PointMaze"):
            import gymnasium_robotics

            gymnasium.register_envs(gymnasium_robotics)
        return Watched(gymnasium.make(self.id, max_episode_steps=self.steps))


class Watched(gymnasium.Wrapper):
    """Keeps the states at the steps of the physics, and the time that a step takes."""

    def __init__(self, env: gymnasium.Env) -> None:
        super().__init__(env)
        self.seen: list[Array] = []
        self.seconds = 0.0
        inner = env.unwrapped
        self.physics = getattr(inner, "point_env", inner)
        if hasattr(self.physics, "_step_mujoco_simulation"):
            self.physics._step_mujoco_simulation = self._simulate

    def _simulate(self, ctrl: Array, frames: int) -> None:
        """What MujocoEnv does, one step of the physics after the other."""
        model, data = self.physics.model, self.physics.data
        data.ctrl[:] = ctrl
        for _ in range(frames):
            mujoco.mj_step(model, data)
            self.seen.append(self.now())
        mujoco.mj_rnePostConstraint(model, data)

    def now(self) -> Array:
        """The environment's state."""
        if hasattr(self.physics, "data"):
            return np.concatenate([self.physics.data.qpos, self.physics.data.qvel])
        return np.array(self.physics.state, float)

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        self.seen = []
        begin = time.perf_counter()
        result = self.env.step(action)
        self.seconds = time.perf_counter() - begin
        self.seen = self.seen or [self.now()]
        return result


def half_step(positions: list[float], velocities: list[float], dt: float) -> list[float]:
    """Semi-implicit Euler steps are exact for a constant acceleration, in positions half a step ago."""
    return [p - v * dt / 2 for p, v in zip(positions, velocities)] + velocities


def pendulum(o: Array) -> list[float]:
    """Angle and speed, from cosine, sine and speed."""
    cosine, sine, omega = o.tolist()
    return half_step([np.arctan2(sine, cosine)], [omega], 0.05)


def mountain_car(o: Array) -> list[float]:
    """In steps of 0.1 s."""
    position, velocity = o.tolist()
    return half_step([position], [10 * velocity], 0.1)


def inverted_pendulum(o: Array) -> Array:
    """The lean is counted from where the pole balances: its centre is 0.5 mm beside its axis."""
    return o + [0.0, np.arctan2(0.0005, 0.3), 0.0, 0.0]


def reacher(o: Array) -> list[float]:
    """Angles and speeds of the joints."""
    return [np.arctan2(o[2], o[0]), np.arctan2(o[3], o[1]), o[6], o[7]]


def point_maze(o: dict[str, Array]) -> list[float]:
    """Place and speed."""
    values = o["observation"].tolist()
    return half_step(values[:2], values[2:], 0.01)


def within(name: str, index: int, least: float, most: float, deadline: float = 0.0) -> Promise:
    """A component of the environment's state is between two numbers."""
    return Promise(name, lambda s: float(min(s[index] - least, most - s[index])), deadline)


def fingertip(s: Array) -> float:
    """How far the fingertip is inside of the disc of 0.06 m around (0.1, 0.1)."""
    x = 0.1 * np.cos(s[0]) + 0.11 * np.cos(s[0] + s[1])
    y = 0.1 * np.sin(s[0]) + 0.11 * np.sin(s[0] + s[1])
    return float(0.06 - np.hypot(x - 0.1, y - 0.1))


def off_the_wall(s: Array) -> float:
    """The distance of a ball of 0.1 m from the inner wall of the U."""
    dx, dy = max(s[0] - 0.5, 0.0), max(abs(s[1]) - 0.5, 0.0)
    return float(np.hypot(dx, dy) - 0.1)


PLANTS = (
    Plant(
        "pendulum", "Pendulum-v1, from up to 0.19 rad off upright", "within 0.2 rad of upright from 2 s on",
        "Pendulum-v1", 0.05, 200, pendulum, (1,),
        (Promise("upright", lambda s: 0.2 - abs(float(s[0])), 2.0),), {"x_init": 0.19, "y_init": 0.1},
    ),
    Plant(
        "mountain_car", "MountainCarContinuous-v0", "at the flag by step 200, off the left wall",
        "MountainCarContinuous-v0", 0.1, 999, mountain_car, (1,),
        (Promise("flag", lambda s: float(s[0]) - 0.45, 20.0), within("wall", 0, -1.15, 0.6)),
    ),
    Plant(
        "inverted_pendulum", "InvertedPendulum-v5", "pole within 0.18 rad, cart within 0.9 m",
        "InvertedPendulum-v5", 0.04, 200, inverted_pendulum, (2,),
        (within("pole", 1, -0.18 - 0.0016667, 0.18 - 0.0016667), within("cart", 0, -0.9, 0.9)),
    ),
    Plant(
        "reacher", "Reacher-v5",
        "fingertip within 6 cm of a place from 0.6 s on, at most 8 rad/s, joints within 2.9 and 2.7 rad",
        "Reacher-v5", 0.02, 50, reacher, (2, 3),
        (
            Promise("fingertip", fingertip, 0.6),
            within("joint0", 0, -2.9, 2.9), within("joint1", 1, -2.7, 2.7),
            within("speed0", 4, -8.0, 8.0), within("speed1", 5, -8.0, 8.0),
        ),
    ),
    Plant(
        "point_maze", "PointMaze_UMaze-v3",
        "no wall touched, at most 4 m/s in x and y, within 0.45 m of the goal's cell from 2.8 s on",
        "PointMaze_UMaze-v3", 0.01, 300, point_maze, (2, 3),
        (
            Promise("inner", off_the_wall), within("x", 0, -1.4, 1.4), within("y", 1, -1.4, 1.4),
            within("vx", 2, -4.0, 4.0), within("vy", 3, -4.0, 4.0),
            Promise("goal", lambda s: float(0.45 - np.hypot(s[0] + 1, s[1] - 1)), 2.8),
        ),
        {"goal_cell": np.array([1, 1]), "reset_cell": np.array([3, 1])},
    ),
)


def hostile(plant: Plant, kind: str, bounds: tuple[Array, Array], random: np.random.Generator) -> Policy:
    """A policy that is up to no good: an action from a state and the number of the step."""
    low, high = bounds
    held = [np.where(random.random(len(low)) < 0.5, low, high), 0]

    def act(x: Array, k: int) -> Array:
        if kind == "random":
            return random.uniform(low, high)
        if kind == "pumping":
            return np.where(x[list(plant.velocities)] >= 0, high, low)
        if kind == "bang-bang" and k >= held[1]:
            held[:] = np.where(random.random(len(low)) < 0.5, low, high), k + random.integers(1, 20)
        return held[0]

    return act


def record(plant: Plant, file: pathlib.Path, table: pathlib.Path, seed: int) -> None:
    """Writes episodes of random actions, every other one behind the filter of the model alone.

    Each is as long as the state is where the model is meant for, and as what is always to be kept is kept."""
    model = tomllib.loads(file.read_text())["plant"]
    least = np.array([s.get("min", -np.inf) for s in model["states"]])
    most = np.array([s.get("max", np.inf) for s in model["states"]])
    always = [promise for promise in plant.promises if not promise.deadline]
    watched, random = plant.make(), np.random.default_rng(seed)
    low, high = watched.action_space.low.astype(float), watched.action_space.high.astype(float)
    with table.open("w", newline="") as out:
        rows = csv.writer(out)
        rows.writerow(["episode", "time", *(v["name"] for v in model["states"] + model["inputs"])])
        written = 0
        for episode in range(RECORDED):
            if written >= ROWS:
                break
            env: Any = watched
            if episode % 2:
                env = SafetyFilterEnv(watched, str(file), state=plant.state, dt=plant.dt)
            observation, info = env.reset(seed=seed + episode, options=plant.options)
            wanted, until = np.zeros(len(low)), 0
            for k in range(plant.steps):
                x, now = np.asarray(plant.state(observation), float), watched.now()
                if (x < least).any() or (x > most).any() or any(promise.h(now) < 0.01 for promise in always):
                    break
                if k >= until:
                    wanted = random.uniform(low, high).astype(watched.action_space.dtype)
                    until = k + random.integers(1, 8)
                observation, _, terminated, truncated, info = env.step(wanted)
                action = info.get("filter_action", wanted)
                rows.writerow([episode, *map(repr, [k * plant.dt, *x.tolist(), *action.tolist()])])
                written += 1
                if terminated or truncated:
                    break


def identify(plant: Plant, folder: pathlib.Path, seed: int) -> tuple[pathlib.Path, str]:
    """The file with what `punctual identify` proposes, and the lines that it adds."""
    file = HERE / f"{plant.name}.toml"
    table, declared = folder / f"{plant.name}.csv", folder / f"{plant.name}.toml"
    record(plant, file, table, seed)
    declared.unlink(missing_ok=True)
    command = [sys.executable, "-m", "punctual", "identify", file, table]
    done = subprocess.run([*command, "--write", declared], capture_output=True, text=True)
    (folder / f"{plant.name}.identify.txt").write_text(done.stdout + done.stderr)
    if not declared.exists():
        print(f"{plant.name}: identify wrote nothing: {done.stdout}{done.stderr}", file=sys.stderr)
        return file, "nothing"
    keys = ("uncertainty.", "measurement_errors.", "actuation_delay")
    lines = [line.split(" #")[0] for line in done.stdout.splitlines() if line.startswith(keys)]
    return declared, "; ".join(lines) or "nothing"


@dataclass
class Episode:
    """What came of one episode."""

    kept: bool = True
    broken: list[str] = field(default_factory=list)
    accepted: bool = False
    refusal: str | None = None
    withdrawn: int = 0
    broken_guaranteed: int = 0
    least: dict[str, float] = field(default_factory=dict)
    changed: list[bool] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)
    reward: float = 0.0
    steps: int = 0


def run(plant: Plant, env: Watched | SafetyFilterEnv, watched: Watched, policy: Policy, seed: int) -> Episode:
    """One episode, judged at each step of the physics."""
    result = Episode()
    observation, _ = env.reset(seed=seed, options=plant.options)
    guaranteed, over = False, False
    while not over:
        action = policy(np.asarray(plant.state(observation), float), result.steps)
        action = action.astype(env.action_space.dtype)
        begin = time.perf_counter()
        observation, reward, terminated, truncated, info = env.step(action)
        result.seconds.append(time.perf_counter() - begin - watched.seconds)
        over = terminated or truncated
        if "filter_guaranteed" in info:
            result.changed.append(info["filter_changed"])
            if result.steps == 0:
                result.accepted = info["filter_guaranteed"]
                result.refusal = env.filter.refusal
            result.withdrawn += guaranteed and not info["filter_guaranteed"]
            guaranteed = info["filter_guaranteed"]
        for number, state in enumerate(watched.seen, 1):
            now = (result.steps + number / len(watched.seen)) * plant.dt
            for promise in plant.promises:
                if now < promise.deadline - 1e-9:
                    continue
                h = promise.h(state)
                result.least[promise.name] = min(h, result.least.get(promise.name, np.inf))
                if h < -plant.tolerance:
                    result.broken_guaranteed += guaranteed
                    if promise.name not in result.broken:
                        result.broken.append(promise.name)
        result.steps += 1
        result.reward += float(reward)
    result.kept = not result.broken
    return result


def episodes(
    plant: Plant, filter: pathlib.Path | None, number: int, seed: int
) -> Iterator[tuple[str, Episode]]:
    """Episodes of the hostile policies in turn."""
    watched = plant.make()
    env: Any = watched
    if filter is not None:
        env = SafetyFilterEnv(watched, str(filter), state=plant.state, dt=plant.dt)
    bounds = watched.action_space.low.astype(float), watched.action_space.high.astype(float)
    for episode in range(number):
        kind = POLICIES[episode % len(POLICIES)]
        random = np.random.default_rng([seed, episode])
        yield kind, run(plant, env, watched, hostile(plant, kind, bounds, random), seed + 1000 + episode)


@dataclass(frozen=True)
class Learned:
    """What came of a training."""

    steps: int
    episodes: int
    broken: int
    broken_guaranteed: int
    refused: int
    withdrawn: int
    changed: tuple[float, float]
    """The share of actions that the filter changed, in the first and in the last generation."""
    seconds: float
    weights: Array


def linear(weights: Array, bounds: tuple[Array, Array]) -> Policy:
    """One input, a bounded linear function of the state."""
    low, high = bounds
    return lambda x, k: np.clip(np.array([weights[0] + weights[1:] @ x]), low, high)


def learn(plant: Plant, filter: pathlib.Path | None, generations: int, seed: int) -> Learned:
    """Trains a linear policy by the cross-entropy method: the best 4 of 16 make the next generation.

    The score is the return of the environment, and half of it if all actions were changed."""
    watched = plant.make()
    env: Any = watched
    if filter is not None:
        env = SafetyFilterEnv(watched, str(filter), state=plant.state, dt=plant.dt)
    bounds = watched.action_space.low.astype(float), watched.action_space.high.astype(float)
    random = np.random.default_rng([seed, 7])
    mean, spread = np.zeros(5), np.array([0.1, 3.0, 30.0, 3.0, 8.0])
    begin, runs, changed = time.time(), [], []
    for generation in range(generations):
        candidates = mean + spread * random.standard_normal((16, 5))
        batch = [
            run(plant, env, watched, linear(weights, bounds), seed + 100 * generation + number)
            for number, weights in enumerate(candidates)
        ]
        score = [result.reward * (1.0 - 0.5 * np.mean(result.changed or [0.0])) for result in batch]
        best = candidates[np.argsort(score)[-4:]]
        mean, spread = best.mean(axis=0), best.std(axis=0) + 0.02 * np.abs(mean)
        runs += batch
        changed.append(float(np.mean([c for result in batch for c in result.changed] or [0.0])))
    return Learned(
        steps=sum(r.steps for r in runs),
        episodes=len(runs),
        broken=sum(not r.kept for r in runs),
        broken_guaranteed=sum(r.broken_guaranteed for r in runs),
        refused=sum(r.refusal is not None for r in runs),
        withdrawn=sum(r.withdrawn for r in runs),
        changed=(changed[0], changed[-1]),
        seconds=time.time() - begin,
        weights=mean,
    )


def percent(values: list[bool]) -> str:
    """The share of what is true."""
    return f"{100 * np.mean(values):.0f} %" if values else ""


def learning(plant: Plant, filter: pathlib.Path, generations: int, seed: int) -> tuple[list[str], bool]:
    """A table of a training with the filter and of one without, and whether the one with it broke nothing."""
    lines = [
        "| training | steps | episodes | episodes that broke a promise | broken while guaranteed | refused "
        "| withdrawn | actions changed, first and last generation "
        "| kept by what was learned, without a filter | time |",
        "|---|---:|---:|---:|---:|---:|---:|---|---|---:|",
    ]
    good = True
    for name, file in (("with the filter", filter), ("without", None)):
        told = learn(plant, file, generations, seed)
        watched = plant.make()
        bounds = watched.action_space.low.astype(float), watched.action_space.high.astype(float)
        policy = linear(told.weights, bounds)
        after = [run(plant, watched, watched, policy, seed + 9000 + k) for k in range(20)]
        good &= file is None or not (told.broken or told.broken_guaranteed)
        shares = " and ".join(f"{100 * share:.0f} %" for share in told.changed) if file else ""
        reported = f"{told.broken_guaranteed} | {told.refused} | {told.withdrawn}" if file else "| |"
        lines.append(
            f"| {name} | {told.steps} | {told.episodes} | {told.broken} "
            f"| {reported} | {shares} "
            f"| {sum(r.kept for r in after)} of {len(after)} episodes | {told.seconds:.0f} s |"
        )
    return lines, good


def row(plant: Plant, name: str, results: list[Episode]) -> str:
    """The row of a table about episodes with a filter."""
    accepted = [r for r in results if r.accepted]
    first = [1e3 * r.seconds[0] for r in results]
    later = [1e3 * s for r in results for s in r.seconds[1:]]
    cells = (
        plant.title,
        name,
        len(accepted),
        f"{sum(r.kept for r in results)} of {len(results)}",
        f"{sum(r.kept for r in accepted)} of {len(accepted)}",
        sum(r.withdrawn > 0 for r in results),
        sum(r.broken_guaranteed for r in results),
        percent([c for r in results for c in r.changed]),
        f"{statistics.median(later):.2f}, {np.percentile(later, 99):.2f}, {max(later):.1f}",
        f"{statistics.median(first):.0f}, {max(first):.0f}",
    )
    return "| " + " | ".join(map(str, cells)) + " |"


def main() -> int:
    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=raw)
    parser.add_argument("--episodes", type=int, default=100)
    parser.add_argument("--only", action="append", choices=[plant.name for plant in PLANTS])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--folder", type=pathlib.Path, help="of recordings; default: a temporary one")
    parser.add_argument("--json", type=pathlib.Path, help="where to write what came of every episode")
    parser.add_argument("--learn", type=int, default=12, metavar="GENERATIONS", help="0: no training")
    arguments = parser.parse_args()
    folder = arguments.folder or pathlib.Path(tempfile.mkdtemp(prefix="environments-"))
    folder.mkdir(parents=True, exist_ok=True)
    chosen = [plant for plant in PLANTS if not arguments.only or plant.name in arguments.only]
    plants = [
        "| environment | promise | `identify` proposes | episodes that break it without a filter |",
        "|---|---|---|---:|",
    ]
    table = [
        "| environment | filter | accepted starts | episodes kept | of those accepted "
        "| guarantee withdrawn in | steps of the physics broken while guaranteed | actions changed "
        "| step in ms: median, 99 %, most "
        "| first step in ms: median, most |",
        "|---|---|---:|---:|---:|---:|---:|---:|---|---|",
    ]
    good, everything, refusals, files = True, {}, [], {}
    for plant in chosen:
        begin = time.time()
        files[plant.name], lines = identify(plant, folder, arguments.seed)
        filters = {"none": None, "model alone": HERE / f"{plant.name}.toml", "declared": files[plant.name]}
        for name, file in filters.items():
            named = list(episodes(plant, file, arguments.episodes, arguments.seed))
            results = [result for _, result in named]
            everything[f"{plant.name}, {name}"] = [{"policy": kind} | vars(result) for kind, result in named]
            good &= not any(r.broken_guaranteed for r in results)
            if file is None:
                bare = sum(not r.kept for r in results)
                continue
            table.append(row(plant, name, results))
            for number, result in enumerate(results):
                if result.refusal:
                    refusals.append(f"- {plant.name}, {name}, episode {number}: {result.refusal}")
            good &= name != "declared" or all(r.kept and r.accepted for r in results)
        proposal = lines.replace("uncertainty.", "")
        plants.append(f"| {plant.title} | {plant.promised} | `{proposal}` | {bare} of {arguments.episodes} |")
        print(f"{plant.name}: {time.time() - begin:.0f} s", file=sys.stderr, flush=True)
    print(*plants, "", *table, "", *refusals, sep="\n", flush=True)
    if arguments.learn and "inverted_pendulum" in files:
        plant = next(plant for plant in chosen if plant.name == "inverted_pendulum")
        lines_learned, kept = learning(plant, files[plant.name], arguments.learn, arguments.seed)
        good &= kept
        print(f"\nA linear policy learns {plant.title}:\n", *lines_learned, sep="\n")
    if arguments.json:
        arguments.json.write_text(json.dumps(everything, default=float))
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
