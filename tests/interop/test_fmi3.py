"""FMPy validates, simulates and couples our FMUs of FMI 3.0, with the same numbers as those of 2.0."""

import shutil
import zipfile

import fmpy
import numpy as np
import pytest
from fmpy.fmi3 import FMU3Slave
from fmpy.validation import validate_fmu

from conftest import ROOT, punctual
from coupling import Slave as OldSlave

VEHICLES = ROOT / "examples" / "vehicles"
MODELS = ROOT / "examples" / "models"
KINDS = ["filter", "plant", "controller"]
CONFIGURATIONS = sorted(
    path for folder in (VEHICLES, MODELS) for kind in KINDS for path in folder.glob(f"*-{kind}.toml")
)
STEP = 0.01


def both(configuration, folder, *options):
    """The FMUs of one configuration for 2.0 and for 3.0."""
    fmu = folder / f"{configuration.stem}.fmu"
    punctual("build", configuration, "-o", fmu, "--fmi", "both", *options)
    return fmu, fmu.with_name(f"{configuration.stem}-fmi3.fmu")


@pytest.mark.parametrize("options", [[], ["--scalars"]], ids=["arrays", "scalars"])
def test_validate_fmu_finds_no_problem(tmp_path, options):
    for configuration in CONFIGURATIONS:
        new = tmp_path / f"{configuration.stem}.fmu"
        punctual("build", configuration, "-o", new, "--fmi", "3", *options)
        assert validate_fmu(str(new)) == [], configuration.name
        description = fmpy.read_model_description(new)
        assert description.fmiVersion == "3.0"
        arrays = [v.name for v in description.modelVariables if v.dimensions]
        assert bool(arrays) == (not options), arrays


def test_archives_hold_what_the_standard_names(tmp_path):
    _, new = both(VEHICLES / "car-plant.toml", tmp_path)
    names = zipfile.ZipFile(new).namelist()
    identifier = fmpy.read_model_description(new).coSimulation.modelIdentifier
    for wanted in [
        "modelDescription.xml",
        "terminalsAndIcons/terminalsAndIcons.xml",
        "terminalsAndIcons/icon.png",
        "documentation/index.html",
        "documentation/licenses/license.txt",
        "resources/configuration.toml",
        f"binaries/x86_64-linux/{identifier}.so",
    ]:
        assert wanted in names, wanted
    assert "model.png" not in names


def test_simulate_fmu_has_the_numbers_of_the_old_version(tmp_path):
    filters = {"unicycle-filter.toml": {"u_ref": [0.5, 0.1]}, "car-plant.toml": {"u": [0.5, 0.01]}}
    for name, starts in {**filters, "tour-controller.toml": {}}.items():
        old, new = both(VEHICLES / name, tmp_path)
        known = fmpy.read_model_description(old).modelVariables
        scalars = [v.name for v in known if v.causality == "output" and v.type == "Real"]
        # An array becomes its scalars, in order.
        start = {}
        for prefix, values in starts.items():
            members = [v.name for v in known if v.name.startswith(f"{prefix}.")]
            start |= dict(zip(members, values, strict=True))
        run = {"stop_time": 1.0, "output_interval": STEP}
        before = fmpy.simulate_fmu(old, output=scalars, start_values=start, **run)
        description = fmpy.read_model_description(new)
        outputs = [v for v in description.modelVariables if v.causality == "output"]
        outputs = [v.name for v in outputs if v.type == "Float64"]
        after = fmpy.simulate_fmu(
            new, fmi_type="CoSimulation", output=outputs, start_values=starts, **run
        )
        columns = [after[n].reshape(len(after), -1) for n in outputs]
        flat = np.concatenate(columns, axis=1)
        assert flat.shape == (len(before), len(scalars))
        for k, scalar in enumerate(scalars):
            np.testing.assert_array_equal(flat[:, k], before[scalar], err_msg=f"{name}: {scalar}")


class Slave:
    """One FMU of FMI 3.0, instantiated and initialised."""

    def __init__(self, path, start=None):
        description = fmpy.read_model_description(path)
        self.variables = {v.name: v for v in description.modelVariables}
        self.folder = fmpy.extract(path)
        self.fmu = FMU3Slave(
            guid=description.guid,
            unzipDirectory=self.folder,
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName=description.modelName,
        )
        self.fmu.instantiate()
        for name, values in (start or {}).items():
            self.set(name, values)
        self.fmu.enterInitializationMode(startTime=0.0)
        self.fmu.exitInitializationMode()

    def set(self, name, values):
        self.fmu.setFloat64([self.variables[name].valueReference], values)

    def get(self, name):
        dimensions = self.variables[name].dimensions
        count = int(dimensions[0].start) if dimensions else 1
        return self.fmu.getFloat64([self.variables[name].valueReference], nValues=count)

    def step(self, time, step):
        self.fmu.doStep(currentCommunicationPoint=time, communicationStepSize=step)

    def close(self):
        self.fmu.terminate()
        self.fmu.freeInstance()
        shutil.rmtree(self.folder, ignore_errors=True)


def test_a_coupled_run_is_that_of_punctual_run(tmp_path):
    # The filter and its plant only exchange two arrays. The FMUs of 2.0 are run by our own master.
    step, stop = 0.01, 2.0
    plant_file, filter_file = tmp_path / "plant.toml", tmp_path / "filter.toml"
    plant_file.write_text('kind = "plant"\nplant.model = "point_mass"\nx0 = { x_p = -20.0, v_x = 1.0 }\n')
    filter_file.write_text(
        'kind = "filter"\nplant.model = "point_mass"\nbounds = { u_x = [-20.0, 20.0], u_y = [-20.0, 20.0] }\n'
        f"experiment = {{ step_size = {step}, stop_time = {stop} }}\n"
        '[[barrier]]\nname = "goal"\ncentre = [0.0, 0.0]\nradius = 2.0\ndeadline = 10.0\n'
    )
    (old_plant, new_plant), (old_filter, new_filter) = (
        both(plant_file, tmp_path),
        both(filter_file, tmp_path),
    )
    plant, safety = Slave(new_plant), Slave(new_filter)
    seen = []
    for k in range(round(stop / step)):
        safety.set("x", plant.get("x"))
        plant.set("u", safety.get("u"))
        safety.step(k * step, step)
        plant.step(k * step, step)
        seen.append(plant.get("x"))
    plant.close()
    safety.close()
    plant, safety = OldSlave(old_plant), OldSlave(old_filter)
    states = [f"x.{name}" for name in ["x_p", "y_p", "v_x", "v_y"]]
    inputs = ["u.u_x", "u.u_y"]
    for k in range(round(stop / step)):
        safety.set(dict(zip(states, plant.get(states))))
        plant.set(dict(zip(inputs, safety.get(inputs))))
        safety.step(k * step, step)
        plant.step(k * step, step)
        assert seen[k] == plant.get(states), k
    plant.close()
    safety.close()
