"""The schema for editors: valid configurations are valid under it, typical mistakes are not."""

import json
import tomllib
import zipfile

import jsonschema
import pytest

from conftest import ROOT

SCHEMA = json.loads((ROOT / "docs" / "punctual.schema.json").read_text())
EXAMPLES = sorted((ROOT / "examples").rglob("*.toml"))

FILTER = """
kind = "filter"
plant = { model = "unicycle" }
bounds = { a = [-inf, 8] }
[[barrier]]
name = "goal"
centre = [45.0, 44]
radius = 2.0
deadline = 10.0
"""

PLANT = """
kind = "plant"
plant = { model = "bicycle", l_r = 3.0 }
[integration]
inner_step = 0.01
"""

CONTROLLER = """
kind = "controller"
controller = "heading"
goal = [4.0, 3.0]
plant = { model = "unicycle" }
"""


def validator():
    """The schema, after checking it."""
    kind = jsonschema.validators.validator_for(SCHEMA)
    kind.check_schema(SCHEMA)
    return kind(SCHEMA)


def mistakes(text):
    """The defects of a configuration, each with its path."""
    errors = validator().iter_errors(tomllib.loads(text))
    return [f"{'.'.join(map(str, error.absolute_path))}: {error.message}" for error in errors]


def test_there_are_examples():
    """The examples include files that the schema checks; systems and campaigns have no kind, and pass."""
    assert sum("kind" in tomllib.loads(path.read_text()) for path in EXAMPLES) > 20


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_is_valid(path):
    assert mistakes(path.read_text()) == []


@pytest.mark.parametrize("text", [FILTER, PLANT, CONTROLLER], ids=["filter", "plant", "controller"])
def test_what_is_edited_below_is_valid(text):
    assert mistakes(text) == []


def test_what_the_program_completes_is_valid(fmus):
    for fmu in fmus:
        with zipfile.ZipFile(fmu) as archive:
            text = archive.read("resources/configuration.toml").decode()
        assert mistakes(text) == [], fmu


@pytest.mark.parametrize(
    ("text", "old", "new", "wanted"),
    [
        (FILTER, "radius", "radus", "'radus' was unexpected"),
        (FILTER, "radius = 2.0", "radius = 0.0", "barrier.0.radius: 0.0 is less than the minimum"),
        (FILTER, "radius = 2.0", 'radius = "2.0"', "barrier.0.radius: '2.0' is not of type 'number'"),
        (FILTER, "radius = 2.0", "", "barrier.0: 'radius' is a required property"),
        (FILTER, "[45.0, 44]", "[45.0]", "barrier.0.centre: [45.0] is too short"),
        (FILTER, "[45.0, 44]", "[1, 2, 3, 4]", "barrier.0.centre: [1, 2, 3, 4] is too long"),
        (FILTER, "deadline = 10.0", "deadline = -1", "barrier.0.deadline: -1 is less than the minimum"),
        (FILTER, "deadline", 'method = "repeated"\ndeadline', "'repeated' is not one of"),
        (FILTER, "deadline", 'shape = "cube"\ndeadline', "barrier.0.shape: 'cube' is not one of"),
        (FILTER, "deadline", 'shape = "ellipse"\ndeadline', "'half_axes' is a required property"),
        (FILTER, "deadline", 'shape = "half_plane"\nnormal = [1, 0]\ndeadline', "does not allow 2.0"),
        (FILTER, "deadline", "priority = -1\ndeadline", "barrier.0.priority: -1 is less than"),
        (FILTER, "deadline", "until_arrival = 1\ndeadline", "1 is not of type 'boolean'"),
        (FILTER, 'name = "goal"', 'name = "the goal"', "barrier.0.name: 'the goal' does not match"),
        (FILTER, 'name = "goal"', "", "barrier.0: 'name' is a required property"),
        (FILTER, '"unicycle"', '"bike"', "plant.model: 'bike' is not one of"),
        (FILTER, "[-inf, 8]", "8", "bounds.a: 8 is not of type 'array'"),
        (FILTER, "bounds", "bound", "'bound' was unexpected"),
        (FILTER, '"filter"', '"filters"', "kind: 'filters' is not one of"),
        (FILTER, 'kind = "filter"', "", "'kind' is a required property"),
        (PLANT, "inner_step = 0.01", "inner_step = 0", "integration.inner_step: 0 is less than"),
        (PLANT, "inner_step", "step", "'step' was unexpected"),
        (PLANT, "l_r = 3.0", "l_r = true", "plant.l_r: True is not of type 'number'"),
        (CONTROLLER, '"heading"', '"pursuit"', "controller: 'pursuit' is not one of"),
        (CONTROLLER, "goal = [4.0, 3.0]", "goal = [4.0, 3.0]\nspeed_gain = 0", "speed_gain: 0 is less"),
    ],
)
def test_a_mistake_is_found(text, old, new, wanted):
    assert old in text
    found = mistakes(text.replace(old, new, 1))
    assert any(wanted in mistake for mistake in found), found
