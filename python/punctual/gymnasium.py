"""Environments of Gymnasium whose actions go through a filter, so that a policy may try anything.

    from punctual.gymnasium import SafetyFilterEnv
    env = SafetyFilterEnv(gymnasium.make("Pendulum-v1"), "filter.toml", state=lambda o: ...)

This module needs Gymnasium; the rest of the package does not.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from copy import copy
from typing import Any, TypeAlias

import numpy as np

from ._configuration import Configuration
from ._error import Error
from ._punctual import Filter, FilterBatch

try:
    import gymnasium
    from gymnasium.vector import AutoresetMode
except ImportError as _error:
    raise ImportError("punctual.gymnasium needs Gymnasium 1.1 or later: pip install gymnasium") from _error

__all__ = ["SafetyFilterEnv", "SafetyFilterVectorEnv"]

State: TypeAlias = Callable[[Any], Any] | Sequence[int] | None
Map: TypeAlias = Callable[[Any], Any] | None


def _same(value: Any) -> Any:
    return value


def _state(state: State) -> Callable[[Any], Any]:
    """The function that takes the state from an observation."""
    if state is None or callable(state):
        function = state or _same
    else:
        indices = list(state)

        def function(observation: Any) -> Any:
            return observation[..., indices]

    # A copy: environments may write the next observation into the same array.
    return lambda observation: np.array(function(observation))


def _in_space(space: gymnasium.Space, to_action: Map) -> Callable[[Any], Any]:
    """`to_action`, with the type and shape of a box."""
    function = to_action or _same
    if not isinstance(space, gymnasium.spaces.Box):
        return function
    return lambda u: np.array(function(u), space.dtype).reshape(space.shape)


def _check_bounds(filter: Filter | FilterBatch, space: gymnasium.Space, to_action: Map) -> None:
    """Refuses bounds beyond the actions that an environment takes, where these are the inputs: it may cut them."""
    if to_action is not None or not isinstance(space, gymnasium.spaces.Box) or space.shape != (len(filter.inputs),):
        return
    for name, least, most in zip(filter.inputs, space.low, space.high):
        low, high = np.array(filter.bounds.get(name, (-np.inf, np.inf)), space.dtype)
        if low < least or high > most:
            raise Error(
                f"bounds.{name}: is {low:g} to {high:g}, must be within the actions of the environment, {least:g} to {most:g};"
                " where an action is something else, give to_input and to_action"
            )


def _period(env: Any, filter: Filter | FilterBatch, dt: float | None) -> float:
    """The time between two steps of `env`, which must be the one of the filter."""
    if dt is None:
        dt = getattr(env, "dt", getattr(env, "tau", None))
    if dt is None:
        raise Error("dt: is not given, and the environment has no dt or tau; must be the time between two steps in s, > 0")
    if not (isinstance(dt, (int, float, np.number)) and 0.0 < dt < math.inf):
        raise Error(f"dt: is {dt!r}, must be the time between two steps in s, > 0")
    if not math.isclose(dt, filter.step_size, rel_tol=1e-9):
        raise Error(f"experiment.step_size: is {filter.step_size:g} s, must be the time between two steps, dt, {dt:g} s")
    return float(dt)


class SafetyFilterEnv(gymnasium.Wrapper, gymnasium.utils.RecordConstructorArgs):
    """An environment whose actions go through a filter.

    - `filter`: its configuration, or a `Filter`, which is copied. Its `experiment.step_size` must be `dt`.
    - `state`: the state, in the order of `Filter.states`, from an observation: a function, or the indices of its
      components. Default: the observation.
    - `to_input`: the input u, in the order of `Filter.inputs`, that an action comes to. Default: the action.
    - `to_action`: the action that an input comes to, as a function. Default: the input. It is rounded to the type of
      the action space.
    - `dt`: the time between two steps in s, > 0. Default: `dt` or `tau` of the environment.

    `reset` lets the filter forget everything: deadlines count from the first step of the episode, and so does the time of what
    moves, from `experiment.start_time` on: step k is at `start_time + k * dt`. `step` adds to `info`:

    - `filter_changed`: whether the filter changed the action; if not, it is passed on as it is.
    - `filter_nominal`: the action wanted; `filter_action`: the one that was done.
    - `filter_status`: the status of the step, a `punctual.Status`.
    - `filter_guaranteed`: whether a plan keeps the promises of all barriers, whatever actions come.
    - `filter_reason`: where plans decided on a changed action, the barrier for which, and the time in s at which it would
      not be kept otherwise, as `Step.reason` has them; else `None`.
    - `filter_refusal`: why there is no plan, in words; `None` where there is one, or none is asked for.

    The promise is one about the model of the filter: what the environment does differently, its margins have to cover.

    Raises `punctual.Error` for a configuration that cannot be used, for a `dt` that is not known or another one than the
    filter's, and for bounds beyond the box of actions, which the environment may cut.
    """

    def __init__(
        self,
        env: gymnasium.Env,
        filter: Configuration | Filter,
        *,
        state: State = None,
        to_input: Map = None,
        to_action: Map = None,
        dt: float | None = None,
    ) -> None:
        gymnasium.utils.RecordConstructorArgs.__init__(
            self, filter=filter, state=state, to_input=to_input, to_action=to_action, dt=dt
        )
        gymnasium.Wrapper.__init__(self, env)
        if isinstance(filter, FilterBatch):
            raise Error("filter: is a FilterBatch, must be a configuration or a Filter; SafetyFilterVectorEnv takes a batch")
        self.filter = copy(filter) if isinstance(filter, Filter) else Filter(filter)
        self.dt = _period(env.unwrapped, self.filter, dt)
        self._state, self._to_input = _state(state), to_input or _same
        _check_bounds(self.filter, env.action_space, to_action)
        self._to_action = _in_space(env.action_space, to_action)
        self._steps, self._x = 0, None

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begins an episode; the filter forgets the one before."""
        observation, info = self.env.reset(seed=seed, options=options)
        self.filter.reset()
        self._steps, self._x = 0, self._state(observation)
        return observation, info

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Does the safe action nearest to `action`."""
        if self._x is None:
            raise gymnasium.error.ResetNeeded("step before the first reset: call reset")
        u_ref = self._to_input(action)
        if u_ref is None:
            raise TypeError("action: is None, must be what the policy wants")
        step = self.filter.step(self.filter.start_time + self._steps * self.dt, self._x, u_ref)
        changed = step.u.tolist() != np.asarray(u_ref).tolist()
        applied = self._to_action(step.u) if changed else action
        observation, reward, terminated, truncated, info = self.env.step(applied)
        self._steps, self._x = self._steps + 1, self._state(observation)
        info = info | {
            "filter_changed": changed,
            "filter_nominal": action,
            "filter_action": applied,
            "filter_status": step.status,
            "filter_guaranteed": all(barrier.guaranteed for barrier in step.barriers.values()),
            "filter_reason": step.reason if changed else None,
            "filter_refusal": self.filter.refusal,
        }
        return observation, reward, terminated, truncated, info


class SafetyFilterVectorEnv(gymnasium.vector.VectorWrapper):
    """A vector environment whose actions go through a `FilterBatch`, a row for each environment.

    The arguments are those of `SafetyFilterEnv`, with functions of all rows at once; `filter` is a configuration or a
    `FilterBatch` of `env.num_envs` rows, which is copied. The keys of `info` hold an array each, a row for each environment;
    `filter_status` has the numbers of the statuses. A row whose episode is over restarts with the next one, its time too,
    whichever mode of automatic resets the environment has. A row that a step has only restarted did no action: its keys are
    masked (`_filter_action` and so on).
    """

    def __init__(
        self,
        env: gymnasium.vector.VectorEnv,
        filter: Configuration | FilterBatch,
        *,
        state: State = None,
        to_input: Map = None,
        to_action: Map = None,
        dt: float | None = None,
    ) -> None:
        super().__init__(env)
        if isinstance(filter, Filter):
            raise Error(f"filter: is a Filter, must be a configuration or a FilterBatch of {env.num_envs} rows")
        self.filter = copy(filter) if isinstance(filter, FilterBatch) else FilterBatch(filter, env.num_envs)
        if len(self.filter) != env.num_envs:
            raise Error(f"filter: has {len(self.filter)} rows, must have {env.num_envs}, one for each environment")
        first = getattr(env.unwrapped, "envs", [env])[0].unwrapped
        self.dt = _period(first, self.filter, dt)
        self._state, self._to_input = _state(state), to_input or _same
        _check_bounds(self.filter, getattr(env, "single_action_space", env.action_space), to_action)
        self._to_action = _in_space(env.action_space, to_action)
        self._steps, self._x = np.zeros(env.num_envs), None
        self._over = np.zeros(env.num_envs, bool)

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begins an episode in every environment, or in those of `options["reset_mask"]`."""
        # Before the environment takes it out of the options.
        rows = (options or {}).get("reset_mask")
        observation, info = self.env.reset(seed=seed, options=options)  # type: ignore[arg-type]
        self.filter.reset(rows)
        rows = slice(None) if rows is None else rows
        self._steps[rows], self._over[rows] = 0, False
        self._x = self._state(observation)
        return observation, info

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Does the safe actions nearest to `actions`."""
        if self._x is None:
            raise gymnasium.error.ResetNeeded("step before the first reset: call reset")
        u_ref = np.asarray(self._to_input(actions))
        u, status, _ = self.filter.step(self.filter.start_time + self._steps * self.dt, self._x, u_ref)
        # Before a reset below ends it.
        guaranteed = self.filter.guaranteed.all(axis=1)
        changed = (u != u_ref).any(axis=1)
        applied = self._to_action(u)
        applied[~changed] = np.asarray(actions)[~changed]
        observation, reward, terminated, truncated, info = self.env.step(applied)
        over = terminated | truncated
        mode = self.env.metadata.get("autoreset_mode", AutoresetMode.NEXT_STEP)
        begun = {AutoresetMode.NEXT_STEP: self._over, AutoresetMode.SAME_STEP: over}.get(mode)
        # Rows that this step has restarted instead of an action.
        done = ~self._over if mode == AutoresetMode.NEXT_STEP else np.ones(len(over), bool)
        self._steps += 1
        if begun is not None and begun.any():
            self.filter.reset(begun)
            self._steps[begun] = 0
        self._over, self._x = over, self._state(observation)
        told = {
            "filter_changed": changed,
            "filter_nominal": actions,
            "filter_action": applied,
            "filter_status": status,
            "filter_guaranteed": guaranteed,
        }
        # Gymnasium's convention: which rows have the key; the others are zero.
        for key, values in list(told.items()):
            told[key], told[f"_{key}"] = np.array(values), done.copy()
            told[key][~done] = 0
        return observation, reward, terminated, truncated, info | told
