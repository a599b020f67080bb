"""Configurations and FMUs that the tests share."""

from pathlib import Path

import punctual
import pytest

ROOT = Path(__file__).resolve().parents[2]
STEP = 0.01


def goal(**settings):
    """A disc that is reached within 5 s."""
    return {"name": "goal", "centre": [20.0, 10.0], "radius": 2.0, "deadline": 5.0, "margin": 0.02} | settings


FILTER = {
    "kind": "filter",
    "name": "unicycle_filter",
    "plant": {"model": "unicycle"},
    "barrier": [goal(), {"name": "post", "shape": "obstacle", "centre": [8.0, 5.0], "radius": 1.0}],
    "bounds": {"a": [-20.0, 20.0]},
    "experiment": {"step_size": STEP},
}
PLANT = {"kind": "plant", "plant": {"model": "unicycle"}, "x0": {"v": 2.0}}


@pytest.fixture(scope="session")
def fmus(tmp_path_factory):
    """A filter with two barriers and its plant."""
    folder = tmp_path_factory.mktemp("fmus")
    return punctual.build(FILTER, folder / "filter.fmu"), punctual.build(PLANT, folder / "plant.fmu")
