"""The builder of missions: its text is what somebody would write, and what the filter reads."""

import doctest

import pytest

import punctual
from punctual import mission
from punctual.mission import F, G, U, at


def test_the_text_is_as_somebody_would_write_it():
    assert doctest.testmod(mission).attempted == 2 and doctest.testmod(mission).failed == 0
    for built, wanted in [
        (F(0, 12.5, "A") | F(0, 3, "B"), "F[0,12.5] A | F[0,3] B"),
        ((F(0, 1, "A") | F(0, 2, "B")) & G("C", 3, 4), "(F[0,1] A | F[0,2] B) & G[3,4] C"),
        (F(0, 1, at("A") & F(0, 2, "B")), "F[0,1] (A & F[0,2] B)"),
        (U(~at("B"), 0, 12, "A") & F(0, 20, G("B")), "!B U[0,12] A & F[0,20] G B"),
        (G(~(at("A") | "B")), "G !(A | B)"),
        ("A" & G("B"), "A & G B"),
    ]:
        assert built == wanted and isinstance(built, str)


def test_a_window_that_is_none_is_refused():
    for first, last in [(3, 2), (-1, 2), (0, float("inf")), (None, 2)]:
        with pytest.raises(punctual.Error, match="window"):
            F(first, last, "A")


def test_a_filter_reads_it():
    configuration = {
        "kind": "filter",
        "mission": F(0, 9, "A") & G(~at("rock")),
        "plant": {"model": "point_mass"},
        "bounds": {"u_x": [-2.0, 2.0], "u_y": [-2.0, 2.0]},
        "experiment": {"step_size": 0.05},
        "barrier": [
            {"name": "A", "centre": [6.0, 0.0], "radius": 1.0},
            {"name": "rock", "centre": [3.0, 0.5], "radius": 0.8},
        ],
    }
    assert 'mission = "F[0,9] A & G !rock"' in punctual.to_toml(configuration)
    step = punctual.Filter(configuration).step(0.0, [0.0, 0.0, 0.0, 0.0], [0.0, 0.0])
    assert [step.barriers[name].guaranteed for name in ("A", "rock")] == [True, True]
