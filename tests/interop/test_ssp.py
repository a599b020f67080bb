"""FMPy reads the SSP packages that the command line builds, and simulates them to the same numbers. The schemas of
SSP 2.0 come with pyssp_standard, which reads the packages too."""

import csv
import os
import zipfile

import fmpy.ssp.ssd
import pytest
from fmpy import read_model_description
from fmpy.ssp.simulation import simulate_ssp
from fmpy.ssp.ssd import read_ssd, read_ssv
from lxml import etree
from pyssp_standard.ssp import SSP
from pyssp_standard.standard import ModelicaStandard

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
    punctual("run", "system.toml", "--require", "nothing", "--out", "out", cwd=folder)
    return folder


def valid(tree, schema):
    """Whether a file of the package is valid under its schema of SSP 1.0."""
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
        # FMPy looks for them in a namespace other than the schema's.
        found = tree.findall(".//ssd:Connection/ssc:LinearTransformation", namespaces=ns)
        assert [float(t.get("factor")) for t in found] == factors, system


def test_the_same_files_give_the_same_bytes(folder):
    punctual("build", "system.toml", "-o", "again.ssp", cwd=folder)
    assert (folder / "again.ssp").read_bytes() == (folder / "system.ssp").read_bytes()


STRUCTURE, VALUES = "SystemStructure.ssd", "resources/start_values.ssv"
SSD, SSC, SSV = (ModelicaStandard.namespaces[name] for name in ("ssd", "ssc", "ssv"))
# Inputs of a foreign FMU: numbers of every type, and arrays of one and of two dimensions.
GIVEN = (
    "u = [1.5, -2], m = [1, 2, 3, 4, 5, 10], in_float32 = 0.5, in_int8 = -128, in_uint8 = 255, in_int16 = -32768, "
    "in_uint16 = 65535, in_int32 = -7, in_uint32 = 4294967295, in_int64 = -9007199254740992, "
    "in_uint64 = 9007199254740992, in_boolean = true, in_enumeration = 5000000000"
)


def schema2(name):
    """A schema of SSP 2.0, of the structure (`ssd2`) or of the values (`ssv2`)."""
    return etree.XMLSchema(file=str(ModelicaStandard.schemas[name]))


def parts(package):
    """The SSP files of a package, by name. We only write a structure and values."""
    with zipfile.ZipFile(package) as archive:
        own = [name for name in archive.namelist() if not name.endswith(".fmu")]
        assert set(own) <= {STRUCTURE, VALUES}
        return {name: etree.fromstring(archive.read(name)) for name in own}


@pytest.fixture(scope="module")
def packages2(folder, sundry, tmp_path_factory):
    """Packages of SSP 2.0 by content: arrays, scalars, every type of FMI 3.0, a factor."""
    made = tmp_path_factory.mktemp("ssp2")
    for name in ["controller", "filter", "plant"]:
        punctual("build", folder / f"{name}.toml", "--fmi", "3", "-o", made / f"{name}.fmu")
    (made / "sundry.fmu").write_bytes((sundry / "sundry.fmu").read_bytes())
    (made / "arrays.toml").write_text(SYSTEM.replace("inner_step", "x0 = [0, 0.5, 0.25, 0], inner_step"))
    (made / "types.toml").write_text(
        "[experiment]\nstop_time = 1\nstep = 0.1\n"
        f'[[component]]\nname = "c"\nfmu = "sundry.fmu"\nstart = {{ {GIVEN} }}\n'
    )
    examples = ROOT / "examples" / "vehicles"
    for part in ["filter", "plant"]:
        punctual("build", examples / f"unicycle-{part}.toml", "-o", made / f"unicycle-{part}.fmu")
    (made / "factor.toml").write_bytes((examples / "unicycle.toml").read_bytes())
    for name in ["arrays", "types", "factor"]:
        punctual("build", f"{name}.toml", "--ssp", "2", "-o", f"{name}.ssp", cwd=made)
    punctual("build", "system.toml", "--ssp", "2", "-o", made / "scalars.ssp", cwd=folder)
    return {name: made / f"{name}.ssp" for name in ["arrays", "scalars", "types", "factor"]}


def test_files_keep_to_the_schemas_of_ssp_2(packages2):
    judges = {".ssd": schema2("ssd2"), ".ssv": schema2("ssv2")}
    for package in packages2.values():
        found = parts(package)
        assert set(found) == ({STRUCTURE} if package.stem == "factor" else {STRUCTURE, VALUES}), package
        for name, root in found.items():
            assert root.get("version") == "2.0"
            judge = judges[name[-4:]]
            assert judge.validate(root), (package, judge.error_log)
    # The packages have the content that they should test.
    structures = {name: parts(package)[STRUCTURE] for name, package in packages2.items()}
    dimensions = {name: root.findall(f".//{{{SSC}}}Dimension") for name, root in structures.items()}
    sizes = {name: [int(d.get("size")) for d in found] for name, found in dimensions.items()}
    assert set(sizes["arrays"]) == {2, 4} and not sizes["scalars"] and not sizes["factor"]
    assert sizes["types"] == [2, 2, 2, 3]
    assert len(structures["factor"].findall(f".//{{{SSC}}}LinearTransformation")) == 1
    # These are not the schemas of SSP 1.0. There a connector has no dimensions.
    one = etree.XMLSchema(file=str(ModelicaStandard.schemas["ssd"]))
    structure = structures["arrays"]
    structure.set("version", "1.0")
    assert not one.validate(structure) and "Dimension" in str(one.error_log)


def test_ssp_2_has_the_types_of_fmi_3(packages2, sundry):
    found = parts(packages2["types"])
    description = read_model_description(str(sundry / "sundry.fmu"))
    # Float64 and Int32 are Real and Integer. The enumeration has an item beyond 32 bits, for which SSP has no place.
    plain = {"Float64": "Real", "Int32": "Integer", "Enumeration": "Int64"}
    wanted = {v.name: plain.get(v.type, v.type) for v in description.modelVariables}
    connectors = {c.get("name"): c[0].tag.split("}")[1] for c in found[STRUCTURE].iter(f"{{{SSD}}}Connector")}
    assert connectors == {name: wanted[name] for name in connectors}
    assert len(set(connectors.values())) == 12
    values = {}
    for parameter in found[VALUES].iter(f"{{{SSV}}}Parameter"):
        value, *dimensions = parameter
        name = parameter.get("name").removeprefix("c.")
        assert value.tag.split("}")[1] == wanted[name]
        assert {dimension.tag for dimension in dimensions} <= {f"{{{SSC}}}Dimension"}
        values[name] = (value.get("value"), [int(dimension.get("size")) for dimension in dimensions])
    assert values == {
        "u": ("1.5 -2.0", [2]),
        "m": ("1.0 2.0 3.0 4.0 5.0 10.0", [2, 3]),
        "in_float32": ("0.5", []),
        "in_int8": ("-128", []),
        "in_uint8": ("255", []),
        "in_int16": ("-32768", []),
        "in_uint16": ("65535", []),
        "in_int32": ("-7", []),
        "in_uint32": ("4294967295", []),
        "in_int64": ("-9007199254740992", []),
        "in_uint64": ("9007199254740992", []),
        "in_boolean": ("true", []),
        "in_enumeration": ("5000000000", []),
    }


def test_ssp_1_refuses_numbers_beyond_32_bits(sundry, tmp_path):
    (tmp_path / "sundry.fmu").write_bytes((sundry / "sundry.fmu").read_bytes())
    system = '[experiment]\nstop_time = 1\nstep = 0.1\n[[component]]\nname = "c"\nfmu = "sundry.fmu"\n'
    for value, is_packed in [(2147483647, True), (2147483648, False)]:
        (tmp_path / "system.toml").write_text(f"{system}start = {{ in_int64 = {value} }}\n")
        done = punctual("build", "system.toml", "-o", "system.ssp", cwd=tmp_path, check=False)
        assert (done.returncode == 0) == is_packed, done
    assert done.stderr == (
        'error: system.toml: component[0].start."in_int64": is a whole number beyond 32 bits, for which SSP 1.0 has no '
        "place; `--ssp 2` has\n"
    )


@pytest.mark.parametrize(
    ("part", "path", "change", "wanted"),
    [
        (STRUCTURE, ".", lambda e: e.set("version", "3.0"), "'3.0' is not accepted"),
        (STRUCTURE, f".//{{{SSC}}}Dimension", lambda e: e.set("size", "four"), "'four' is not a valid value"),
        (STRUCTURE, f".//{{{SSC}}}Dimension", lambda e: e.getparent().insert(0, e), "Dimension"),
        (STRUCTURE, f".//{{{SSD}}}Connector", lambda e: e.set("kind", "in"), "'in' is not an element"),
        (STRUCTURE, f".//{{{SSD}}}Connection", lambda e: e.attrib.pop("endConnector"), "'endConnector' is required"),
        (STRUCTURE, f".//{{{SSD}}}Component", lambda e: e.set("implementation", "CS"), "'CS' is not an element"),
        (VALUES, f".//{{{SSV}}}Real", lambda e: e.set("value", "0,5"), "'0,5' is not a valid"),
        (VALUES, f".//{{{SSV}}}Parameter", lambda e: e.attrib.pop("name"), "'name' is required"),
    ],
)
def test_a_mistake_breaks_a_schema_of_ssp_2(packages2, part, path, change, wanted):
    root = parts(packages2["arrays"])[part]
    change(root if path == "." else root.find(path))
    judge = schema2("ssd2" if part == STRUCTURE else "ssv2")
    assert not judge.validate(root) and wanted in str(judge.error_log), judge.error_log


def test_pyssp_standard_reads_a_package_of_ssp_2(packages2):
    with SSP(packages2["arrays"], mode="r") as package:
        structure = package.system_structure
        assert (structure.name, structure.version, structure.system.name) == ("arrays", "2.0", "arrays")
        assert (structure.default_experiment.start_time, structure.default_experiment.stop_time) == (0.0, STOP)
        names = ["controller", "filter", "plant"]
        assert [(c.name, c.source) for c in structure.system.elements] == [(n, f"resources/{n}.fmu") for n in names]
        # Arrays as a whole: state to controller and filter, reference to the filter, input to the plant.
        found = {tuple(connection.as_dict().values()) for connection in structure.connections()}
        assert found == {
            ("plant", "x", "controller", "x"),
            ("plant", "x", "filter", "x"),
            ("controller", "u_ref", "filter", "u_ref"),
            ("filter", "u", "plant", "u"),
        }
        assert structure.check_connections(connector_not_in_system=True) == []
        kinds = {c.name: c.kind for c in structure.system.elements[1].connectors}
        assert (kinds["x"], kinds["u"], kinds["goal.deadline"]) == ("input", "output", "parameter")
        # Its own validator uses the schema in XML Schema 1.1, which includes that of the start values.
        structure.__check_compliance__()
        [values] = package.ssv
        values.__check_compliance__()
        assert {p["name"]: (p["type_name"], p["type_value"].parameter["value"]) for p in values.parameters} == {
            "controller.gain": ("Real", "0.5"),
            "filter.goal.margin": ("Real", "0.05"),
            "filter.goal.radius": ("Real", "2.0"),
            "plant.inner_step": ("Real", "0.00390625"),
            "plant.x0": ("Real", "0.0 0.5 0.25 0.0"),
        }
        assert {"controller.fmu", "filter.fmu", "plant.fmu", "start_values.ssv"} == set(package.resources)
