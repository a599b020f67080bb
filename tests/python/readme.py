"""Runs the Python example of README.md, which runs a filter with its model and says whether the promise was kept."""

import os
import re
import tempfile
from pathlib import Path

root = Path(__file__).resolve().parents[2]
texts = [(root / name).read_text(encoding="utf-8") for name in ["README.md", "python/README.md"]]
[example], [shown] = (re.findall(r"```python\n(import punctual\n.*?)```", text, re.DOTALL) for text in texts)
assert example == shown, "the wheel's page shows another example"
lines = [line for line in example.splitlines() if line.strip()]
assert len(lines) < 10, f"{len(lines)} lines, must be under ten"
with tempfile.TemporaryDirectory() as folder:
    os.chdir(folder)
    names: dict = {}
    exec(compile(example, "README.md", "exec"), names)
    run = names["run"]
    result = run.values
    assert run.promises["goal"]["promise"] == "kept" and result["time"][-1] == 12.0
    assert result["goal.h"][0] < 0.0 <= result["goal.h"][result["time"] >= 10.0].min()
    os.chdir("/")
print(f"README.md: {len(lines)} lines, {len(result)} rows")
