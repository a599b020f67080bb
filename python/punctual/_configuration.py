"""Configurations: the path of a TOML file, or a dict with the same content, and functions in the place of expressions."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeAlias

import tomli_w

from ._trace import traced

Configuration: TypeAlias = str | os.PathLike[str] | Mapping[str, Any]


def to_toml(configuration: Mapping[str, Any]) -> str:
    """The dict as TOML, for a file that the command line takes; functions become expressions.

    Arrays and scalars of NumPy become lists and numbers, paths become text.

    Raises `TypeError` for a value that a configuration cannot have, with its path, and for what cannot be traced, with
    the line; `Error` for a function whose arguments or result do not fit.
    """
    return tomli_w.dumps(_plain(traced(configuration), ""))


def _plain(value: Any, path: str) -> Any:
    if isinstance(value, Mapping):
        head = f"{path}." if path else ""
        return {str(key): _plain(item, f"{head}{key}") for key, item in value.items()}
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, (list, tuple)):
        return [_plain(item, f"{path}[{i}]") for i, item in enumerate(value)]
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if callable(value):
        raise TypeError(f"{path}: is {value!r}; a function may replace only an expression")
    if not isinstance(value, (str, bool, int, float)):
        raise TypeError(f"{path}: is {value!r}, must be a number, text, truth value, list or dict")
    return value


def text_folder_file(configuration: Configuration) -> tuple[str, str, str]:
    """The TOML text; where its plug-in is looked for; the name of its file, for a dict none."""
    if isinstance(configuration, Mapping):
        return to_toml(configuration), os.getcwd(), ""
    path = Path(configuration)
    return path.read_text(encoding="utf-8"), str(path.absolute().parent), str(path)


@contextmanager
def configuration_file(configuration: Configuration) -> Iterator[Path]:
    """The configuration as a file, which for a dict lasts as long as the context.

    That is a temporary one; where the dict names a plug-in, it lies in the current folder, as that does.
    """
    if not isinstance(configuration, Mapping):
        yield Path(configuration)
        return
    text = to_toml(configuration)
    plant = configuration.get("plant")
    beside = os.getcwd() if isinstance(plant, Mapping) and "plugin" in plant else None
    handle, name = tempfile.mkstemp(suffix=".toml", prefix="punctual-", dir=beside)
    try:
        with open(handle, "w", encoding="utf-8") as file:
            file.write(text)
        yield Path(name)
    finally:
        os.unlink(name)
