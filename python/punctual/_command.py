"""The command line that this package carries, with the shared library of every FMU beside it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import warnings
from pathlib import Path
from typing import NoReturn

from ._error import Error, GuaranteeWarning

_PROGRAM = Path(__file__).with_name("_bin") / ("punctual.exe" if sys.platform == "win32" else "punctual")


def run_cli(*arguments: str | os.PathLike[str]) -> str:
    """Runs the command line, such as `run_cli("run", "system.toml", "--json")`; returns what it prints.

    Raises `Error` with its words where it ends with another exit code than 0.
    """
    return run(arguments, accepted=(0,))


def run(arguments: tuple[str | os.PathLike[str], ...], accepted: tuple[int, ...], hidden: tuple[str, ...] = ()) -> str:
    """As `run_cli`, with a choice of exit codes that are no error; what the program warns of becomes a warning, without
    what is `hidden`."""
    words = [os.fspath(argument) for argument in arguments]
    try:
        done = subprocess.run([_PROGRAM, *words], capture_output=True, encoding="utf-8")
    except FileNotFoundError:
        raise Error(f"{_PROGRAM}: there is no such file; python/wheel makes the package with it") from None
    for line in done.stderr.splitlines():
        if line.startswith("warning: "):
            text = line.removeprefix("warning: ")
            for part in hidden:
                text = text.replace(part, "")
            warn(text)
    if done.returncode in accepted:
        return done.stdout
    # What it noted before is no part of the reason.
    _, _, reason = f"\n{done.stderr}".partition("\nerror: ")
    # Without an error it has a finding, which stdout tells.
    raise Error((reason or done.stdout or done.stderr).strip() or _ending(done.returncode))


def warn(text: str) -> None:
    """Warns of a filter without a guarantee, where this package was called."""
    frame, depth = sys._getframe(1), 2
    while frame.f_back and frame.f_globals.get("__name__", "").partition(".")[0] == "punctual":
        frame, depth = frame.f_back, depth + 1
    warnings.warn(text, GuaranteeWarning, stacklevel=depth)


def _ending(code: int) -> str:
    """What an exit code says of a program that says nothing itself."""
    try:
        return f"the program was ended by {signal.Signals(-code).name}"
    except ValueError:
        return f"the program ended with exit code {code}"


def main() -> NoReturn:
    """The console command `punctual`: becomes the program."""
    words = [str(_PROGRAM), *sys.argv[1:]]
    if sys.platform == "win32":
        sys.exit(subprocess.run(words).returncode)
    os.execv(_PROGRAM, words)
