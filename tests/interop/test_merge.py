"""An FMU of two systems, joined by `punctual merge`, as FMPy sees it."""

import fmpy
import numpy as np
from fmpy import simulate_fmu
from fmpy.validation import validate_fmu

from conftest import for_windows, punctual


def test_fmpy_finds_both_platforms_and_runs_the_one_here(demo, tmp_path):
    here = demo[0] / "unicycle-plant.fmu"
    there, both = tmp_path / "there.fmu", tmp_path / "both.fmu"
    for_windows(here, there)
    done = punctual("merge", there, here, "-o", both)
    assert f"linux64 ({here}), win64 ({there})" in done.stdout
    assert sorted(fmpy.supported_platforms(both)) == ["linux64", "win64"]
    assert validate_fmu(str(both)) == []
    # FMPy unpacks, loads and instantiates it on its own; the numbers are the same bit for bit.
    start = {"x0.v": 2.0, "u.omega": 0.7}
    results = [simulate_fmu(str(path), start_values=start, stop_time=1.0, output_interval=0.01) for path in (here, both)]
    assert len(results[0]) == 101
    for name in results[0].dtype.names:
        assert np.array_equal(results[0][name], results[1][name]), name
