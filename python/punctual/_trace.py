"""Python functions in the place of expressions: each is called once, with symbols, and becomes the text of what it does.

The texts are those that somebody would write by hand (docs/configuration.md, "Expressions"), so that everything that
takes a configuration takes them, and gives the same bits.
"""

from __future__ import annotations

import inspect
import math
import sys
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ._error import Error
from ._punctual import vehicle

LONGEST = 4096
"""Longest expression, in characters."""

_SUM, _PRODUCT, _SIGN, _POWER, _ATOM = 10, 20, 30, 40, 50


def _operator(name: str, turned: bool = False) -> Callable[[Any, Any], Any]:
    """The method of a symbol for the operator that NumPy calls `name`; `turned`: for one that stands on the right."""

    def method(self: Any, other: Any) -> Any:
        # NumPy goes through the elements of an array.
        if isinstance(other, np.ndarray):
            return NotImplemented
        return _UFUNCS[name](other, self) if turned else _UFUNCS[name](self, other)

    return method


class Symbol:
    """A value that is not known yet: the text of an expression, and how tightly its last operator binds."""

    __slots__ = ("bond", "text")

    def __init__(self, text: str, bond: int = _ATOM) -> None:
        if len(text) > LONGEST:
            raise Error(
                f"an expression has {len(text)} characters at {_line()}, must have at most {LONGEST}; a part that is used"
                " twice is written twice"
            )
        self.text, self.bond = text, bond

    def __repr__(self) -> str:
        return f"<traced {self.text}>"

    def within(self, bond: int) -> str:
        """The text, in parentheses where an operator that binds so tightly would tear it apart."""
        return self.text if self.bond >= bond else f"({self.text})"

    __hash__ = None  # type: ignore[assignment]

    def __bool__(self) -> bool:
        raise TypeError(
            f"a condition on a traced value at {_line()}: the function is called once, for all states, so it cannot branch;"
            " np.minimum(a, b), np.maximum(a, b) and np.abs(a) of single elements can be traced, and so can np.tanh(a),"
            " which is a smooth step"
        )

    def _compare(self, other: object) -> Any:
        bool(self)

    __eq__ = __ne__ = __lt__ = __le__ = __gt__ = __ge__ = _compare

    def _number(self, *_: Any) -> Any:
        raise TypeError(
            f"a number is asked of a traced value at {_line()}: it has none yet; write np.sin in place of math.sin, and"
            " np.array([a, b]) or np.zeros(n, object) for an array that is to hold it"
        )

    __float__ = __int__ = __index__ = __complex__ = __round__ = __trunc__ = __floor__ = __ceil__ = _number

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        function = _UFUNCS.get(ufunc.__name__)
        if function is None or method != "__call__" or options:
            raise TypeError(f"np.{ufunc.__name__} of a traced value at {_line()} cannot be traced; {_ADVICE}")
        arrays = [np.asarray(value, object) for value in inputs]
        return np.frompyfunc(function, len(arrays), 1)(*arrays)

    def __getattr__(self, name: str) -> Any:
        """The method by the name of a function of NumPy, which that calls for each element of an array of objects."""
        if name not in _UFUNCS:
            raise AttributeError(f"a traced value has no {name} at {_line()}")
        return lambda *others: _UFUNCS[name](self, *others)

    __add__, __radd__ = _operator("add"), _operator("add", turned=True)
    __sub__, __rsub__ = _operator("subtract"), _operator("subtract", turned=True)
    __mul__, __rmul__ = _operator("multiply"), _operator("multiply", turned=True)
    __truediv__, __rtruediv__ = _operator("divide"), _operator("divide", turned=True)
    __pow__, __rpow__ = _operator("power"), _operator("power", turned=True)

    def __neg__(self) -> Symbol:
        return Symbol(f"-{self.within(_SIGN + 1)}", _SIGN)

    def __pos__(self) -> Symbol:
        return self

    def __abs__(self) -> Symbol:
        return _call("abs", self)


def _line() -> str:
    """The line of the user's program that is being traced."""
    frame = sys._getframe(1)
    while frame.f_back and frame.f_globals.get("__name__", "").partition(".")[0] in ("numpy", "punctual"):
        frame = frame.f_back
    return f"{frame.f_code.co_filename}:{frame.f_lineno}"


def _symbol(value: Any) -> Symbol:
    """A number, which keeps its bits, or a symbol, as a symbol."""
    if isinstance(value, Symbol):
        return value
    number = value
    if not isinstance(value, float):
        try:
            if isinstance(value, (str, bytes, complex, np.complexfloating)):
                raise TypeError
            number = float(value)
        except (TypeError, ValueError, OverflowError):
            raise TypeError(f"{value!r:.60} and a traced value meet at {_line()}; must be a real number") from None
    if not math.isfinite(number):
        raise Error(f"{number} is part of an expression at {_line()}; must be finite")
    text = repr(float(number)).removesuffix(".0")
    return Symbol(text, _SIGN if text[0] == "-" else _ATOM)


def _call(name: str, *arguments: Any) -> Symbol:
    return Symbol(f"{name}({', '.join(_symbol(a).text for a in arguments)})")


def _infix(sign: str, bond: int, a: Any, b: Any) -> Symbol:
    """`a` and `b` under an operator that is done from left to right."""
    a, b = _symbol(a), _symbol(b)
    right = b.within(bond + 1)
    return Symbol(f"{a.within(bond)} {sign} {f'({right})' if right[0] == '-' else right}", bond)


def _is_zero(value: Any) -> bool:
    return _symbol(value).text in ("0", "-0")


# Zeros are left out: products with constant matrices have many.
def _add(a: Any, b: Any) -> Symbol:
    if _is_zero(a) or _is_zero(b):
        return _symbol(b if _is_zero(a) else a)
    return _infix("+", _SUM, a, b)


def _subtract(a: Any, b: Any) -> Symbol:
    if _is_zero(b):
        return _symbol(a)
    return -_symbol(b) if _is_zero(a) else _infix("-", _SUM, a, b)


def _multiply(a: Any, b: Any) -> Symbol:
    return _symbol(0.0) if _is_zero(a) or _is_zero(b) else _infix("*", _PRODUCT, a, b)


def _divide(a: Any, b: Any) -> Symbol:
    if _is_zero(b):
        raise ZeroDivisionError(f"a traced value is divided by 0 at {_line()}")
    return _infix("/", _PRODUCT, a, b)


def _power(a: Any, b: Any) -> Symbol:
    return Symbol(f"{_symbol(a).within(_ATOM)}^{_symbol(b).within(_ATOM)}", _POWER)


FUNCTIONS = {
    "sqrt": "sqrt",
    "exp": "exp",
    "log": "ln",
    "sin": "sin",
    "cos": "cos",
    "tan": "tan",
    "arctan": "atan",
    "arctan2": "atan2",
    "absolute": "abs",
    "tanh": "tanh",
    "minimum": "min",
    "maximum": "max",
}
"""The functions of NumPy that are functions of expressions."""


def _function(name: str) -> Callable[..., Symbol]:
    return lambda *arguments: _call(name, *arguments)


# By NumPy's names.
_UFUNCS: dict[str, Callable[..., Symbol]] = {ufunc: _function(name) for ufunc, name in FUNCTIONS.items()} | {
    "add": _add,
    "subtract": _subtract,
    "multiply": _multiply,
    "divide": _divide,
    "power": _power,
    "float_power": _power,
    "negative": lambda a: -_symbol(a),
    "positive": _symbol,
    "square": lambda a: _power(a, 2),
    "reciprocal": lambda a: _divide(1, a),
    "hypot": lambda a, b: _call("sqrt", _add(_power(a, 2), _power(b, 2))),
    "fabs": _function("abs"),
    "deg2rad": lambda a: _multiply(a, math.pi / 180),
    "radians": lambda a: _multiply(a, math.pi / 180),
    "rad2deg": lambda a: _multiply(a, 180 / math.pi),
    "degrees": lambda a: _multiply(a, 180 / math.pi),
}

_ADVICE = f"what can be: + - * / ** @, {', '.join(f'np.{name}' for name in [*FUNCTIONS, 'hypot', 'square'])}"


def traced(configuration: Mapping[str, Any]) -> dict[str, Any]:
    """The configuration with expressions in the place of functions."""
    plain = dict(configuration)
    model = _Model(plain.get("plant"), "plant")
    for key in ("plant", "simulated"):
        section = plain.get(key)
        if isinstance(section, Mapping) and "derivatives" in section:
            own = _Model(section, key)
            plain[key] = dict(section) | {"derivatives": own.each(section["derivatives"], f"{key}.derivatives", "states")}
    for key in ("u_ref", "policy"):
        if key in plain:
            plain[key] = model.each(plain[key], key, "inputs")
    barriers = plain.get("barrier")
    if isinstance(barriers, (list, tuple)):
        plain["barrier"] = [model.barrier(barrier, f"barrier[{i}].expression") for i, barrier in enumerate(barriers)]
    return plain


class _Model:
    """The names of a plant, which are looked for once a function needs them."""

    def __init__(self, section: Any, path: str) -> None:
        self.section, self.path = section, path

    def names(self, key: str) -> list[str]:
        """Those of its `states`, `inputs` or `parameters`, in order."""
        section = self.section if isinstance(self.section, Mapping) else {}
        if key != "parameters" and "model" in section:
            return vehicle(str(section["model"]))[key == "inputs"]
        entries = section.get(key, None if key == "states" else [])
        try:
            return [str(entry["name"]) for entry in entries]
        except (TypeError, KeyError, IndexError):
            raise Error(f"{self.path}.{key}: is {entries!r}, must be a list of dicts, each with a name") from None

    def symbols(self, key: str) -> Any:
        """An array of symbols."""
        array = np.empty(len(self.names(key)), object)
        array[:] = [Symbol(name) for name in self.names(key)]
        return array

    def call(self, function: Callable[..., Any], path: str) -> Any:
        """The function of symbols: of x and u in `derivatives`, elsewhere of x, or of the time and x; then of parameters."""
        x = self.symbols("states")
        parameters = {name: Symbol(name) for name in self.names("parameters")}
        if ".derivatives" in path:
            choices: list[tuple[str, tuple[Any, ...]]] = [
                ("(x, u)", (x, self.symbols("inputs"))),
                ("(x, u, p)", (x, self.symbols("inputs"), parameters)),
            ]
        else:
            choices = [("(x)", (x,)), ("(t, x)", (Symbol("t"), x)), ("(t, x, p)", (Symbol("t"), x, parameters))]
        wanted = " or ".join(shape for shape, _ in choices)
        try:
            given = inspect.signature(function).parameters.values()
        except (TypeError, ValueError):
            raise Error(f"{path}: the arguments of {function!r} are not known, must be {wanted}") from None
        count = sum(p.default is p.empty and p.kind in (p.POSITIONAL_ONLY, p.POSITIONAL_OR_KEYWORD) for p in given)
        for _, arguments in choices:
            if len(arguments) == count:
                try:
                    return function(*arguments)
                except Exception as error:
                    error.add_note(f"{path}: {_named(function)} was called once with symbols; {_ADVICE}")
                    raise
        raise Error(f"{path}: {_named(function)} takes {count} arguments, must take {wanted}")

    def texts(self, function: Callable[..., Any], path: str, names: list[str] | None) -> list[str]:
        """What the function returns as texts, one for each name; one alone where there are no names."""
        returned = self.call(function, path)
        shape = () if names is None else (len(names),)
        try:
            array = np.array(returned, object)
            if array.shape != shape or isinstance(returned, str):
                raise TypeError
            return [_symbol(value).text for value in array.flat]
        except (TypeError, ValueError):
            single = "a single value" if names is None else f"{len(names)} single values, for {', '.join(names)}"
            raise Error(
                f"{path}: {_named(function)} returns {returned!r}, must return {single}, finite numbers or traced ones"
            ) from None

    def each(self, given: Any, path: str, key: str) -> Any:
        """An expression for each of the names of `key`, from one function or one for each."""
        if callable(given):
            names = self.names(key)
            return dict(zip(names, self.texts(given, path, names)))
        if not isinstance(given, Mapping):
            return given
        return {name: self.one(value, f"{path}.{name}") for name, value in given.items()}

    def one(self, given: Any, path: str) -> Any:
        return self.texts(given, path, None)[0] if callable(given) else given

    def barrier(self, given: Any, path: str) -> Any:
        if not isinstance(given, Mapping) or "expression" not in given:
            return given
        return dict(given) | {"expression": self.one(given["expression"], path)}


def _named(function: Callable[..., Any]) -> str:
    """The function, with the place where it begins."""
    code = getattr(function, "__code__", None)
    name = getattr(function, "__qualname__", repr(function))
    return f"{name} ({code.co_filename}:{code.co_firstlineno})" if code else name


def with_function(reason: str, configuration: Any, path: str = "") -> str:
    """The words of a refusal, with the function that made the expression which they are about."""
    if callable(configuration):
        about = reason.startswith((f"{path}:", f"{path}."))
        return f"{reason}; {_named(configuration)} made it" if about else reason
    if isinstance(configuration, Mapping):
        for key, value in configuration.items():
            reason = with_function(reason, value, f"{path}.{key}" if path else key)
    elif isinstance(configuration, (list, tuple)):
        for i, value in enumerate(configuration):
            reason = with_function(reason, value, f"{path}[{i}]")
    return reason
