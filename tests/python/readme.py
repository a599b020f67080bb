"""Runs the Python example of README.md, which couples a filter with a plant and says whether the promise was kept."""

import os
import re
import tempfile
from pathlib import Path

readme = Path(__file__).resolve().parents[2].joinpath("README.md").read_text(encoding="utf-8")
[example] = re.findall(r"```python\n(import punctual\n.*?)```", readme, re.DOTALL)
lines = [line for line in example.splitlines() if line.strip()]
assert len(lines) < 10, f"{len(lines)} lines, must be under ten"
with tempfile.TemporaryDirectory() as folder:
    os.chdir(folder)
    names: dict = {}
    exec(compile(example, "README.md", "exec"), names)
    result = names["result"]
    assert result["time"][-1] == 12.0
    assert result["goal.h"][0] < 0.0 <= result["goal.h"][result["time"] >= 10.0].min()
    os.chdir("/")
print(f"README.md: {len(lines)} lines, {len(result)} rows")
