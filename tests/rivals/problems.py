"""The problems that every tool gets, and the plant and judge that belong to none of them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Callable, Iterator

STEP = 0.02  # s, of every tool
SUBSTEPS = 10  # of the plant in a step; h is judged after each
DEADLINE = 8.0  # s
RADIUS = 2.0  # m, of the goal
END = 2 * DEADLINE  # s, of a run

State = tuple[float, float, float, float]
Input = tuple[float, float]

PLANTS = ("point_mass", "unicycle")
# What is asked of the filter, and what the controller in front of it does.
COLUMNS = (("keep", "drives"), ("deadline", "drives"), ("deadline", "zero"), ("deadline", "hostile"))


class Failed(Exception):
    """A tool has found no input; `u` is its own way out, if it has one."""

    def __init__(self, u: Input | None) -> None:
        super().__init__("no input found")
        self.u = u


@dataclass(frozen=True)
class Problem:
    """A start, a goal 10 to 25 m away, and one or two round rocks on the way."""

    plant: str  # point_mass: x, y, v_x, v_y with inputs a_x, a_y; unicycle: x, y, theta, v with a, omega
    task: str  # keep: stay out of the rocks; deadline: also within RADIUS of the goal by DEADLINE, and stay
    start: State
    goal: tuple[float, float]
    rocks: tuple[tuple[float, float, float], ...]  # x, y, radius

    @property
    def bounds(self) -> Input:
        """The largest size of each input."""
        return (4.0, 4.0) if self.plant == "point_mass" else (4.0, 1.5)

    def clip(self, u: Input) -> Input:
        """The nearest input within the bounds."""
        return tuple(max(-b, min(b, a)) for a, b in zip(u, self.bounds))

    def h_goal(self, x: State) -> float:
        """How far inside the goal, in m."""
        return RADIUS - math.hypot(x[0] - self.goal[0], x[1] - self.goal[1])

    def h_rocks(self, x: State) -> float:
        """How far outside the nearest rock, in m."""
        return min(math.hypot(x[0] - a, x[1] - b) - r for a, b, r in self.rocks)

    def derivative(self, x: State, u: Input) -> State:
        """The plant."""
        if self.plant == "point_mass":
            return (x[2], x[3], u[0], u[1])
        return (x[3] * math.cos(x[2]), x[3] * math.sin(x[2]), u[1], u[0])

    def advance(self, x: State, u: Input) -> Iterator[State]:
        """The states in a step with u held, by Runge-Kutta of order 4."""
        d, f = STEP / SUBSTEPS, self.derivative
        for _ in range(SUBSTEPS):
            k1 = f(x, u)
            k2 = f(tuple(a + d / 2 * k for a, k in zip(x, k1)), u)
            k3 = f(tuple(a + d / 2 * k for a, k in zip(x, k2)), u)
            k4 = f(tuple(a + d * k for a, k in zip(x, k3)), u)
            x = tuple(a + d / 6 * (p + 2 * q + 2 * r + s) for a, p, q, r, s in zip(x, k1, k2, k3, k4))
            yield x

    def nominal(self, asks: str, x: State) -> Input:
        """What the controller in front of the filter wants; it knows of no rock."""
        if asks == "zero":
            return (0.0, 0.0)
        dx, dy = self.goal[0] - x[0], self.goal[1] - x[1]
        if self.plant == "point_mass":
            if asks == "hostile":
                return self.clip((math.copysign(9.0, -dx), math.copysign(9.0, -dy)))
            return self.clip((0.6 * dx - 1.4 * x[2], 0.6 * dy - 1.4 * x[3]))
        error = math.remainder(math.atan2(dy, dx) - x[2], math.tau)
        if asks == "hostile":
            return self.clip((math.copysign(9.0, -math.cos(error)), math.copysign(9.0, -error)))
        speed = min(6.0, 0.8 * math.hypot(dx, dy)) * max(math.cos(error), 0.0)
        return self.clip((2.0 * (speed - x[3]), 2.0 * error))


class Draws:
    """The generator of core/tests/uncertain/mod.rs."""

    def __init__(self, seed: int) -> None:
        self.state = seed

    def within(self, low: float, high: float) -> float:
        """A number between two."""
        self.state = (self.state * 6364136223846793005 + 1442695040888963407) % 2**64
        return low + (high - low) * ((self.state >> 11) / 2**53)


def draw(plant: str, draws: Draws) -> Callable[[str], Problem]:
    """A problem for each task, drawn as `Case::draw` of core/tests/uncertain/mod.rs, with a rock or two."""
    rocks: list[tuple[float, float, float]] = []
    while not rocks:
        distance, angle = draws.within(10.0, 25.0), draws.within(-0.8, 0.8)
        goal = (distance * math.cos(angle), distance * math.sin(angle))
        for _ in range(2):
            part, aside, radius = draws.within(0.3, 0.75), draws.within(-3.0, 3.0), draws.within(0.8, 1.8)
            x = part * goal[0] - aside * math.sin(angle)
            y = part * goal[1] + aside * math.cos(angle)
            if math.hypot(x, y) > radius + 2.5 and math.hypot(x - goal[0], y - goal[1]) > radius + 3.0:
                rocks.append((x, y, radius))
        speed, aside = draws.within(0.0, 2.0), draws.within(-0.5, 0.5)
    start = (0.0, 0.0, speed, 2.0 * aside) if plant == "point_mass" else (0.0, 0.0, aside, speed)
    return lambda task: Problem(plant, task, start, goal, tuple(rocks))


def cases(plant: str, task: str, seed: int, number: int) -> list[Problem]:
    """The same starts for every task."""
    draws = Draws(seed)
    return [draw(plant, draws)(task) for _ in range(number)]
