"""Directional derivatives through FMPy, compared with central differences of the values that FMPy reads."""

import fmpy
import pytest
from fmpy.fmi2 import FMU2Slave

from conftest import METHODS, MODELS

# Inputs are of order 1 to 10 here; outputs are known to 1e-9 of numbers up to some 100, which STEP divides.
STEP = 1e-4
TOLERANCE = 1e-3


def instance(path, folder):
    description = fmpy.read_model_description(path)
    slave = FMU2Slave(
        guid=description.guid,
        unzipDirectory=fmpy.extract(str(path), folder),
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="slave",
    )
    slave.instantiate()
    slave.setupExperiment(startTime=0.0)
    slave.enterInitializationMode()
    return description, slave


def reals(description, causality):
    return [
        v.valueReference for v in description.modelVariables if v.causality == causality and v.type == "Real"
    ]


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("method", METHODS)
def test_derivatives_are_those_of_the_outputs(demo, tmp_path, model, method):
    folder, _ = demo
    path = folder / f"{model}-{method}-filter.fmu"
    description, slave = instance(path, tmp_path)
    assert description.coSimulation.providesDirectionalDerivative
    inputs, outputs = reals(description, "input"), reals(description, "output")
    values = [20.0, 30.0, 0.4, 3.0, 0.5, -0.5]
    slave.setReal(inputs, values)
    slave.exitInitializationMode()
    for step in range(2):
        for i, reference in enumerate(inputs):
            ends = []
            for sign in (1, -1):
                slave.setReal([reference], [values[i] + sign * STEP])
                ends.append(slave.getReal(outputs))
            slave.setReal([reference], [values[i]])
            found = slave.getDirectionalDerivative(outputs, [reference], [1.0])
            for k, output in enumerate(outputs):
                wanted = (ends[0][k] - ends[1][k]) / (2 * STEP)
                assert abs(found[k] - wanted) <= TOLERANCE * (1 + abs(wanted)), (step, i, output)
        slave.doStep(0.01 * step, 0.01)
    slave.terminate()
    slave.freeInstance()


@pytest.mark.parametrize("model", MODELS)
def test_outputs_of_a_plant_do_not_depend_on_its_inputs(demo, tmp_path, model):
    folder, _ = demo
    description, slave = instance(folder / f"{model}-plant.fmu", tmp_path)
    slave.exitInitializationMode()
    inputs, outputs = reals(description, "input"), reals(description, "output")
    found = slave.getDirectionalDerivative(outputs, inputs, [1.0] * len(inputs))
    assert list(found) == [0.0] * len(outputs)
    slave.terminate()
    slave.freeInstance()


def test_a_parameter_is_refused(demo, tmp_path):
    folder, _ = demo
    description, slave = instance(folder / "unicycle-reference_profile-filter.fmu", tmp_path)
    slave.exitInitializationMode()
    outputs, parameters = reals(description, "output"), reals(description, "parameter")
    with pytest.raises(Exception, match="fmi2GetDirectionalDerivative"):
        slave.getDirectionalDerivative(outputs, parameters[:1], [1.0])
    slave.terminate()
    slave.freeInstance()
