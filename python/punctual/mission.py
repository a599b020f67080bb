"""Missions of Python: the text of the key `mission`, put together from its parts (docs/configuration.md, "Missions").

>>> from punctual.mission import F, G, at
>>> str(F(0, 5, "A") & F(5, 12, G("B", 0, 2)) & F(0, 30, G("home")) & G(~at("C")))
'F[0,5] A & F[5,12] G[0,2] B & F[0,30] G home & G !C'
"""

from __future__ import annotations

import math

from ._error import Error

__all__ = ["F", "G", "Mission", "U", "at"]

_OR, _AND, _ATOM = 0, 1, 2


class Mission(str):
    """A mission, or a part of one; `&` joins tasks that are all done, `|` those of which one is, `~` is the outside of a set."""

    _bond: int

    def __new__(cls, text: str, _bond: int = _ATOM) -> Mission:
        mission = super().__new__(cls, text)
        mission._bond = _bond
        return mission

    def _within(self, bond: int) -> str:
        return str(self) if self._bond >= bond else f"({self})"

    def __and__(self, other: str) -> Mission:
        return Mission(f"{self._within(_AND)} & {at(other)._within(_AND)}", _AND)

    def __or__(self, other: str) -> Mission:
        return Mission(f"{self._within(_OR)} | {at(other)._within(_OR)}", _OR)

    def __rand__(self, other: str) -> Mission:
        return at(other) & self

    def __ror__(self, other: str) -> Mission:
        return at(other) | self

    def __invert__(self) -> Mission:
        return Mission(f"!{self._within(_ATOM)}")

    def __str__(self) -> str:
        return str.__str__(self)


def at(barrier: str) -> Mission:
    """Inside the set of the barrier of this name."""
    return barrier if isinstance(barrier, Mission) else Mission(barrier)


def _window(first: float | None, last: float | None) -> str:
    if first is None and last is None:
        return ""
    ends = [first, last]
    for end in ends:
        if end is None or not math.isfinite(end) or end < 0:
            raise Error(f"the window of a task is [{first}, {last}], must be two times in s from 0 on, or none for all times")
    if last < first:  # type: ignore[operator]
        raise Error(f"the window of a task is [{first}, {last}], must not end before it begins")
    return "[" + ",".join(f"{end:.15g}" for end in ends) + "]"


def F(first: float, last: float, what: str) -> Mission:
    """Eventually: `what` holds at some time from `first` to `last`, in s."""
    return Mission(f"F{_window(first, last)} {at(what)._within(_ATOM)}")


def G(what: str, first: float | None = None, last: float | None = None) -> Mission:
    """Always: `what` holds at all times, or at all from `first` to `last`, in s."""
    return Mission(f"G{_window(first, last)} {at(what)._within(_ATOM)}")


def U(what: str, first: float, last: float, until: str) -> Mission:
    """`what` holds until `until` does, which is at some time from `first` to `last`, in s."""
    return Mission(f"{at(what)._within(_ATOM)} U{_window(first, last)} {at(until)._within(_ATOM)}", _AND)
