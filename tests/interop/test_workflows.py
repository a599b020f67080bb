"""Checks the workflows and shell scripts, which also run on other machines, with linters."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from conftest import ROOT

WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))


def tool(name, *arguments):
    """Runs a tool of this Python environment; its output is the test's message."""
    words = [str(Path(sys.executable).parent / name), *map(str, arguments)]
    done = subprocess.run(words, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    assert done.returncode == 0, done.stdout


def scripts():
    """Every file of the repository that bash runs."""
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, check=True, capture_output=True, text=True)
    paths = [path for path in map(ROOT.joinpath, listed.stdout.splitlines()) if path.is_file()]
    return [path for path in paths if path.read_bytes().startswith(b"#!/usr/bin/env bash\n")]


def test_workflows_have_the_form_of_workflows():
    assert len(WORKFLOWS) >= 2
    tool("check-jsonschema", "--builtin-schema", "vendor.github-workflows", *WORKFLOWS)


def test_workflows_give_nothing_away():
    # Actions are pinned to commits, permissions are minimal, and no foreign text enters a command.
    tool("zizmor", "--offline", "--quiet", "--no-progress", "--persona=auditor", *WORKFLOWS)


@pytest.mark.parametrize("workflow", WORKFLOWS, ids=lambda path: path.stem)
def test_workflows_call_scripts_that_exist(workflow):
    commands = [line.partition("run: ")[2] for line in workflow.read_text().splitlines() if "run: " in line]
    called = {command.split()[0] for command in commands}
    assert called <= {"cargo", *(str(path.relative_to(ROOT)) for path in scripts())}, called
    assert ".ci/toolchain" in called


@pytest.mark.parametrize("workflow", WORKFLOWS, ids=lambda path: path.stem)
def test_every_job_says_why_it_exists(workflow):
    lines = workflow.read_text().partition("\njobs:\n")[2].splitlines()
    jobs = [k for k, line in enumerate(lines) if re.fullmatch(r"  [A-Za-z_][\w-]*:", line)]
    assert jobs and all(k > 0 and lines[k - 1].startswith("  # ") for k in jobs)


def test_scripts_are_sound():
    found = scripts()
    assert ROOT / "tests" / "run" in found
    tool("shellcheck", *found)
