"""Missions are formulas of rtamt: it takes each text, and has the same robustness for the text of the normal form."""

import math
import random
import re

import pytest

from conftest import ROOT

rtamt = pytest.importorskip("rtamt", reason="rtamt 0.4.10 needs a Python before 3.13")

LINES = (ROOT / "tests" / "data" / "missions.txt").read_text().splitlines()
MISSIONS = [line.split(" => ") for line in LINES if line and not line.startswith("#")]
# All times in the file are multiples of it.
STEP_MS = 100
# No time of a formula there lies beyond the last.
SAMPLES = 250
TRACES = 8


def robustness(text, trace):
    """What rtamt says of the formula at the first sample."""
    monitor = rtamt.StlDiscreteTimeSpecification()
    for name in trace:
        if name != "time":
            monitor.declare_var(name, "float")
    monitor.spec = text
    monitor.unit = "s"
    monitor.set_sampling_period(STEP_MS, "ms", 0.1)
    monitor.parse()
    return monitor.evaluate(trace)[0][1]


def walk(generator):
    """Samples of h of a region, which go up and down."""
    h, samples = generator.uniform(-1, 2), []
    for _ in range(SAMPLES):
        samples.append(h)
        h += generator.uniform(-0.3, 0.3)
    return samples


@pytest.mark.parametrize("text, normal", MISSIONS)
def test_the_normal_form_is_as_robust_as_the_mission(text, normal):
    generator = random.Random(1)
    names = sorted(set(re.findall(r"\b[A-D]\b", text)))
    for _ in range(TRACES):
        trace = {"time": list(range(SAMPLES)), **{name: walk(generator) for name in names}}
        found = robustness(text, trace)
        assert math.isfinite(found) and found == robustness(normal, trace)
