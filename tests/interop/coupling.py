"""A co-simulation loop as users of FMPy write it: get the state, set the inputs, step."""

import shutil

import fmpy
from fmpy.fmi2 import FMU2Slave, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE


def declared_categories(path):
    """The log categories that the model description names."""
    return [category.name for category in fmpy.read_model_description(path).logCategories]


class Slave:
    """One FMU, instantiated and initialised, with its variables by name.

    `logger` receives instance name, status, category and text of every message, in all categories.
    """

    def __init__(self, path, start=None, logger=None):
        description = fmpy.read_model_description(path)
        self.variables = {v.name: v for v in description.modelVariables}
        self.folder = fmpy.extract(path)
        self.fmu = FMU2Slave(
            guid=description.guid,
            unzipDirectory=self.folder,
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName=description.modelName,
        )
        callbacks = None
        if logger is not None:
            # Without FMPy's proxy, which would format the text with its arguments: our texts have none.
            callbacks = fmi2CallbackFunctions()
            callbacks.logger = fmi2CallbackLoggerTYPE(
                lambda _, name, status, category, message: logger(
                    name.decode(), status, category.decode(), message.decode()
                )
            )
        self.fmu.instantiate(callbacks=callbacks, loggingOn=logger is not None)
        if logger is not None:
            self.fmu.setDebugLogging(True, declared_categories(path))
        self.set(start or {})
        self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()

    def names(self, causality):
        return [v.name for v in self.variables.values() if v.causality == causality]

    def get(self, names):
        """Values in the order of the names; every number as float."""
        values = {}
        for kind, read in [
            ("Real", self.fmu.getReal),
            ("Integer", self.fmu.getInteger),
            ("Enumeration", self.fmu.getInteger),
            ("Boolean", self.fmu.getBoolean),
        ]:
            of_kind = [n for n in names if self.variables[n].type == kind]
            if of_kind:
                references = [self.variables[n].valueReference for n in of_kind]
                values.update(zip(of_kind, map(float, read(references))))
        return [values[n] for n in names]

    def set(self, values):
        if values:
            self.fmu.setReal([self.variables[n].valueReference for n in values], list(values.values()))

    def step(self, t, h):
        self.fmu.doStep(currentCommunicationPoint=t, communicationStepSize=h)

    def close(self):
        self.fmu.terminate()
        self.fmu.freeInstance()
        shutil.rmtree(self.folder)


def couple(filter_fmu, plant_fmu, damping, stop, h, start=None):
    """Yields (time, {variable: value}) at every communication point from 0 to `stop`.

    `damping` maps a reference input of the filter to the state it opposes: u_ref = -x; `start` holds start
    values of the plant.
    """
    filter_, plant = Slave(filter_fmu), Slave(plant_fmu, start)
    states = plant.names("output")
    inputs = plant.names("input")
    outputs = filter_.names("output")
    steps = round(stop / h)
    for k in range(steps + 1):
        t = k * h
        x = dict(zip(states, plant.get(states)))
        u_ref = {reference: -x[state] for reference, state in damping.items()}
        filter_.set(x | u_ref)
        if k < steps:
            filter_.step(t, h)
        y = dict(zip(outputs, filter_.get(outputs)))
        yield t, {f"plant.{n}": v for n, v in x.items()} | {f"filter.{n}": v for n, v in (u_ref | y).items()}
        if k < steps:
            plant.set({n: y[n] for n in inputs})
            plant.step(t, h)
    filter_.close()
    plant.close()
