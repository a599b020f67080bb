"""FMPy reads the SSP packages that the command line builds, and simulates them to the same numbers."""

import csv
import os
import zipfile

import fmpy.ssp.ssd
import pytest
from fmpy.ssp.simulation import simulate_ssp
from fmpy.ssp.ssd import read_ssd, read_ssv
from lxml import etree

from conftest import ROOT, punctual

STEP, STOP, DEADLINE = 1 / 128, 6.0, 5.0

FILTER = """kind = "filter"
plant = { model = "point_mass" }
actuation_delay = 0.0078125
experiment = { step_size = 0.0078125 }
[[barrier]]
name = "goal"
centre = [8, 5]
radius = 1
deadline = 5
begin = 1
"""
PLANT = 'kind = "plant"\nplant = { model = "point_mass" }\n'
CONTROLLER = 'kind = "controller"\ncontroller = "damping"\nplant = { model = "point_mass" }\n'
SYSTEM = f"""[experiment]
stop_time = {STOP}
step = {STEP}
order = "jacobi"
[[component]]
name = "controller"
fmu = "controller.fmu"
start = {{ gain = 0.5 }}
[[component]]
name = "filter"
fmu = "filter.fmu"
start = {{ "goal.radius" = 2, "goal.margin" = 0.05 }}
[[component]]
name = "plant"
fmu = "plant.fmu"
start = {{ inner_step = 0.00390625 }}
[[connect_by_name]]
components = ["plant", "controller"]
[[connect_by_name]]
components = ["controller", "filter"]
[[connect_by_name]]
components = ["filter", "plant"]
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Controller, filter and plant, coupled: the FMUs, the package and the CSV of `punctual run`."""
    folder = tmp_path_factory.mktemp("ssp")
    for name, text in [("filter", FILTER), ("plant", PLANT), ("controller", CONTROLLER)]:
        (folder / f"{name}.toml").write_text(text)
        punctual("build", f"{name}.toml", "-o", f"{name}.fmu", cwd=folder)
    (folder / "system.toml").write_text(SYSTEM)
    punctual("build", "system.toml", "-o", "system.ssp", cwd=folder)
    punctual("run", "system.toml", "--out", "out", cwd=folder)
    return folder


def valid(tree, schema):
    """Whether a file of the package keeps to its schema of SSP 1.0."""
    folder = os.path.join(os.path.dirname(fmpy.ssp.ssd.__file__), "schema")
    schema = etree.XMLSchema(file=os.path.join(folder, schema))
    assert schema.validate(tree), schema.error_log


def test_files_keep_to_the_schemas(folder):
    with zipfile.ZipFile(folder / "system.ssp") as package:
        assert package.testzip() is None
        valid(etree.parse(package.open("SystemStructure.ssd")), "SystemStructureDescription.xsd")
        valid(etree.parse(package.open("resources/start_values.ssv")), "SystemStructureParameterValues.xsd")


def test_fmpy_reads_the_structure(folder):
    ssd = read_ssd(str(folder / "system.ssp"))
    assert (ssd.version, ssd.name) == ("1.0", "system")
    assert [c.name for c in ssd.system.elements] == ["controller", "filter", "plant"]
    assert [c.source for c in ssd.system.elements] == [
        f"resources/{name}.fmu" for name in ["controller", "filter", "plant"]
    ]
    # State to controller and filter, reference to the filter, input to the plant.
    assert len(ssd.system.connections) == 4 + 4 + 2 + 2
    kinds = {c.name: c.kind for c in ssd.system.elements[1].connectors}
    assert (kinds["x.x_p"], kinds["u.u_x"], kinds["goal.deadline"]) == ("input", "output", "parameter")
    values = {p.name: (p.type, float(p.value)) for p in ssd.system.parameterBindings[0].parameterValues[0].parameters}
    assert values == {
        "controller.gain": ("Real", 0.5),
        "filter.goal.margin": ("Real", 0.05),
        "filter.goal.radius": ("Real", 2.0),
        "plant.inner_step": ("Real", 0.00390625),
    }


def test_fmpy_simulates_to_the_same_numbers(folder):
    # FMPy's master writes zero to every connected input before the first step instead of the outputs at the
    # start, reads parameter bindings only where they are passed, and knows no transformations. Here all
    # outputs are zero at the start (at rest in the origin, the barrier from 1 s on), and no factor is needed.
    package = str(folder / "system.ssp")
    values = read_ssv(package, resource="resources/start_values.ssv")
    result = simulate_ssp(package, stop_time=STOP, step_size=STEP, parameter_set=values)
    with open(folder / "out" / "system.csv", newline="") as file:
        rows = [{k: float(v) for k, v in row.items()} for row in csv.DictReader(file)]
    assert len(rows) == len(result) + 1 == round(STOP / STEP) + 1
    outputs = [n for n in result.dtype.names if n in rows[0] and n != "time"]
    assert {"filter.u.u_x", "filter.status", "filter.goal.h", "controller.u_ref.u_x", "plant.x.v_x"} <= set(outputs)
    # FMPy's row of t_k holds what was read after the step from t_k.
    worst = {
        name: max(abs(float(found[name]) - row[name]) for found, row in zip(result, rows[1:])) for name in outputs
    }
    print(f"\n{len(outputs)} signals, {len(result)} points, largest difference {max(worst.values())}")
    assert max(worst.values()) == 0.0, worst
    assert max(abs(row["plant.x.x_p"]) for row in rows) > 5.0
    assert all(row["filter.goal.h"] >= 0.0 for row in rows if row["time"] >= DEADLINE)


def test_factors_are_transformations_and_examples_are_valid(tmp_path):
    examples = ROOT / "examples" / "vehicles"
    for configuration in sorted(examples.glob("*-*.toml")):
        punctual("build", configuration, "-o", tmp_path / f"{configuration.stem}.fmu")
    ns = fmpy.ssp.ssd.ns
    for system, factors in [("unicycle", [-1.0]), ("escort", [-1.0, -1.0]), ("tour", [])]:
        (tmp_path / f"{system}.toml").write_bytes((examples / f"{system}.toml").read_bytes())
        punctual("build", f"{system}.toml", "-o", f"{system}.ssp", cwd=tmp_path)
        read_ssd(str(tmp_path / f"{system}.ssp"))
        with zipfile.ZipFile(tmp_path / f"{system}.ssp") as package:
            tree = etree.parse(package.open("SystemStructure.ssd"))
        # FMPy looks for them in another namespace than the schema has them in.
        found = tree.findall(".//ssd:Connection/ssc:LinearTransformation", namespaces=ns)
        assert [float(t.get("factor")) for t in found] == factors, system


def test_the_same_files_give_the_same_bytes(folder):
    punctual("build", "system.toml", "-o", "again.ssp", cwd=folder)
    assert (folder / "again.ssp").read_bytes() == (folder / "system.ssp").read_bytes()
