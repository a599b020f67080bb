"""Fixtures: the FMUs of the demonstration, built by the command line under test."""

import json
import os
import subprocess
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
MODELS = ["point_mass", "unicycle", "bicycle"]
METHODS = ["repeated_root", "reference_profile"]


def binary():
    """The command line: the one in PUNCTUAL, or the release build."""
    return os.environ.get("PUNCTUAL", str(ROOT / "target" / "release" / "punctual"))


def punctual(*arguments, check=True, cwd=None):
    """Runs the command line."""
    return subprocess.run(
        [binary(), *map(str, arguments)], check=check, capture_output=True, text=True, cwd=cwd
    )


def for_windows(here, there):
    """Rewrites the FMU `here`, built on this system, as if built on Windows, except for the library."""
    with zipfile.ZipFile(here) as source, zipfile.ZipFile(there, "w") as target:
        for name in source.namelist():
            content = source.read(name)
            if name.startswith("binaries/"):
                name = name.replace("linux64", "win64").replace(".so", ".dll")
                content = b"stands for what a build on Windows makes"
            target.writestr(name, content)


@pytest.fixture(scope="session")
def sundry(tmp_path_factory):
    """A folder with sundry.fmu, a foreign FMU of FMI 3.0 in C. It has a variable of every type, and arrays."""
    folder = tmp_path_factory.mktemp("sundry")
    fixtures = ROOT / "tests" / "fixtures"
    library = folder / "sundry.so"
    compiler = os.environ.get("CC", "cc")
    subprocess.run([compiler, "-shared", "-fPIC", fixtures / "sundry.c", "-o", library], check=True)
    with zipfile.ZipFile(folder / "sundry.fmu", "w") as archive:
        archive.write(fixtures / "sundry.xml", "modelDescription.xml")
        archive.write(library, "binaries/x86_64-linux/sundry.so")
    return folder


@pytest.fixture(scope="session")
def demo(tmp_path_factory):
    """The folder that `punctual demo` writes, and what it prints as JSON."""
    folder = tmp_path_factory.mktemp("demo")
    done = punctual("demo", "--out", folder, "--json")
    return folder, json.loads(done.stdout)


@pytest.fixture(scope="session")
def fmus(demo):
    """All FMUs of the demonstration."""
    folder, _ = demo
    found = sorted(folder.glob("*.fmu"))
    assert len(found) == len(MODELS) * (1 + len(METHODS))
    return found


@pytest.fixture(scope="session")
def study(tmp_path_factory):
    """The folder that `punctual reproduce --quick` writes, and what it prints as JSON."""
    folder = tmp_path_factory.mktemp("study")
    done = punctual("reproduce", "--quick", "--untimed", "--out", folder, "--json")
    assert done.stderr == ""
    return folder, json.loads(done.stdout)
