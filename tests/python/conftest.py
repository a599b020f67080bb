"""Configurations and FMUs that the tests share."""

from pathlib import Path

import numpy as np
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
# Every input has bounds: plans are followed.
ASSURED = FILTER | {"bounds": {"a": [-20.0, 20.0], "omega": [-3.0, 3.0]}}


def exactly(values, shape):
    """The same numbers in every way that NumPy or a program may hold them; float64 first. All are exact in float16."""
    plain = np.array(values, float).reshape(shape)
    strided = np.repeat(plain, 2, -1)[..., ::2]
    assert not strided.flags.c_contiguous
    frozen = plain.copy()
    frozen.flags.writeable = False
    kinds = [np.float16, np.float32, np.longdouble, ">f8", np.int8, np.int64, np.uint16]
    nested = plain.tolist()
    tuples = tuple(map(tuple, nested)) if plain.ndim == 2 else tuple(nested)
    scalars = [list(row) for row in plain.astype(np.float32)] if plain.ndim == 2 else list(plain.astype(np.float32))
    return [plain, strided, frozen, np.asfortranarray(plain), nested, tuples, scalars, *map(plain.astype, kinds)]


@pytest.fixture(scope="session")
def fmus(tmp_path_factory):
    """A filter with two barriers and its plant."""
    folder = tmp_path_factory.mktemp("fmus")
    return punctual.build(FILTER, folder / "filter.fmu"), punctual.build(PLANT, folder / "plant.fmu")
