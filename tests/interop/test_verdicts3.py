"""`punctual validate` and FMPy reach the same verdict on descriptions of FMI 3.0 with one defect each."""

import json
import os
import re
import subprocess
import sys
import sysconfig
from pathlib import Path

import fmpy
import pytest
from fmpy.validation import validate_fmu
from lxml import etree

from conftest import punctual
from test_verdicts import FIXTURES, judged

pytestmark = pytest.mark.skipif(
    "linux-x86_64" != sysconfig.get_platform(), reason="the library is made for x86_64-linux"
)
ENTRY = "binaries/x86_64-linux/everything.so"

OUTPUT = '<Output valueReference="4" dependencies=""/>'
MODE = 'dependencies="2 8" dependenciesKind="dependent dependent"'
TIME = '<Float64 name="time" valueReference="0" causality="independent"/>'
X = 'declaredType="Length" initial="exact" start="0.5" displayUnit="mm"'
# Texts and their replacements, to which both must object.
BROKEN = {
    "no model name": (' modelName="everything"', ""),
    "no token": (' instantiationToken="{everything}"', ""),
    "the token of FMI 2.0": ("instantiationToken", "guid"),
    "a version that is none": ('fmiVersion="3.0"', 'fmiVersion="3"'),
    "a version with a leading zero": ('fmiVersion="3.0"', 'fmiVersion="3.00"'),
    "no identifier": ('CoSimulation modelIdentifier="everything"', "CoSimulation"),
    "an unknown element": ("<ModelVariables>", "<Odd/><ModelVariables>"),
    "the order of FMI 2.0": ("  <DefaultExperiment", "  <TypeDefinitions><BooleanType name='b'/></TypeDefinitions><DefaultExperiment"),
    "two interfaces of a kind": ("  <CoSimulation", '  <CoSimulation modelIdentifier="b"/>\n  <CoSimulation'),
    "interfaces in another order": ("  <UnitDefinitions>", '  <ModelExchange modelIdentifier="b"/><UnitDefinitions>'),
    "an empty list": ('<Category name="logAll"/>', ""),
    "an empty annotation": ("</ModelStructure>", "</ModelStructure><Annotations/>"),
    "a flag that is none": ('StepSize="true"', 'StepSize="yes"'),
    "a number that is none": ('max="1000"', 'max="lots"'),
    "infinity in Rust's spelling": ('max="1000"', 'max="inf"'),
    "a negative reference": ('valueReference="9"', 'valueReference="-9"'),
    "a reference too large": ('valueReference="9"', 'valueReference="4294967296"'),
    "an unknown causality": ('causality="input"', 'causality="inputs"'),
    "an unknown type": ("<Float32 name", "<Float16 name"),
    "a type of FMI 2.0": ("<Int32 name", "<Integer name"),
    "an integer out of range": ('start="-3"', 'start="-2147483649"'),
    "a size out of range": ('start="3" min', 'start="-3" min'),
    "a size of no integer": ('<Dimension start="2"/>', '<Dimension start="2.0"/>'),
    "one bad start of three": ('start="1 2 3"', 'start="1 2 x"'),
    "starts with commas": ('start="1 2 3"', 'start="1,2,3"'),
    "a text with a start attribute": ('name="label"', 'name="label" start="a"'),
    "bytes that are none": ('value="0fA0"', 'value="0fA"'),
    "an enumeration without type": ('causality="output" declaredType="Mode"', 'causality="output"'),
    "an unknown attribute of a variable": ('name="count"', 'name="count" size="3"'),
    "a unit of an integer": ('name="count"', 'name="count" unit="m"'),
    "a date that is none": ("2026-01-31T", "2026-02-31T"),
    "a dimension after an alias": (
        '<Dimension valueReference="1"/>\n      <Alias name="force" displayUnit="mm"/>',
        '<Alias name="force"/><Dimension valueReference="1"/>',
    ),
    "a display unit of an alias of an integer": ('start="-3" min="-9" max="9"/>', 'start="-3"><Alias name="n" displayUnit="mm"/></Int32>'),
    "an alias without name": ('<Alias name="force"', "<Alias"),
    "a name twice": ('name="rearm"', 'name="x"'),
    "an alias with the name of a variable": ('<Alias name="force"', '<Alias name="x"'),
    "a name that is not structured": ('name="u"', 'name="u["'),
    "an alias that is not structured": ('name="force"', 'name="for ce"'),
    "a reference twice": ('valueReference="9"', 'valueReference="8"'),
    "an undefined unit": ('unit="m" start', 'unit="ft" start'),
    "an undefined unit of a type": ('name="Length" unit="m"', 'name="Length" unit="ft"'),
    "an undefined display unit": ('start="0.5" displayUnit="mm"', 'start="0.5" displayUnit="km"'),
    "an undefined display unit of an alias": ('name="force" displayUnit="mm"', 'name="force" displayUnit="km"'),
    "an undefined type": (X, X.replace("Length", "Width")),
    "no independent variable": (TIME, ""),
    "two independent variables": (TIME, TIME + TIME.replace("time", "t").replace('"0"', '"99"')),
    "an independent variable with start": ('causality="independent"', 'causality="independent" start="1"'),
    "an input without start": ('start="false"', ""),
    "a parameter without start": (' start="-3"', ""),
    "a structural parameter that is constant": ('causality="structuralParameter"', 'causality="structuralParameter" variability="constant"'),
    "a text without start": ('<Start value="a b"/>', ""),
    "a start without value": ('<Start value="a b"/>', "<Start/>"),
    "an empty list of clocks": ('name="rearm"', 'name="rearm" clocks=""'),
    "a clock that is none": ('name="rearm"', 'name="rearm" clocks="77"'),
    "a calculated variable with start": ('derivative="4"', 'derivative="4" start="1"'),
    "an illegal combination": ('causality="input" unit', 'causality="input" variability="fixed" unit'),
    "an illegal initial": ('variability="tunable"', 'variability="tunable" initial="calculated"'),
    "an input that is not exact": ('causality="input" unit', 'causality="input" initial="approx" unit'),
    "a continuous truth value": ('name="rearm"', 'name="rearm" variability="continuous"'),
    "a size that is no variable": ('<Dimension valueReference="1"/>', '<Dimension valueReference="77"/>'),
    "a derivative of nothing": ('derivative="4"', 'derivative="44"'),
    "an output that is not listed": (OUTPUT, ""),
    "an output that is none": (OUTPUT, OUTPUT + '<Output valueReference="12"/>'),
    "an output that is no variable": (OUTPUT, OUTPUT + '<Output valueReference="77"/>'),
    "a dependency that is no variable": (MODE, 'dependencies="2 77"'),
    "too few kinds": (MODE, 'dependencies="2 8" dependenciesKind="dependent"'),
    "kinds without dependencies": (MODE, 'dependenciesKind="dependent dependent"'),
    "an unknown kind": ('"constant dependent"', '"constant free"'),
    "a derivative that is none": ("<InitialUnknown", '<ContinuousStateDerivative valueReference="6"/><InitialUnknown'),
    "outputs after derivatives": ("    <InitialUnknown", '    <Output valueReference="4"/><InitialUnknown'),
    "an initial unknown that is not listed": ('<InitialUnknown valueReference="6"/>', ""),
    "an initial unknown that is none": ('<InitialUnknown valueReference="6"/>', '<InitialUnknown valueReference="6"/><InitialUnknown valueReference="4"/>'),
    "not well-formed": ("</ModelVariables>", ""),
}
# Texts and their replacements to which we object, by this rule, and FMPy does not. Each is a sentence of FMI 3.0.2
# beyond the schema that FMPy does not check.
OURS_ALONE = {
    # 2.4.1: an interface type must be there, and its modelIdentifier follows the syntax of C.
    "interface.kind": (re.compile("<ModelExchange.*/>\n  <CoSimulation.*/>"), ""),
    "interface.identifier": ('<ModelExchange modelIdentifier="everything"', '<ModelExchange modelIdentifier="ever-y"'),
    # 2.4.3: canSerializeFMUState needs canGetAndSetFMUState.
    "interface.flags": (' canGetAndSetFMUState="true"', ""),
    # 2.4.4: the factors of units; an inverse display unit has no offset.
    "unit.factor": ('factor="1000"/>', 'factor="1000" inverse="true" offset="1"/>'),
    "unit.unique": ('<Unit name="s"/>', '<Unit name="s"/><Unit name="s"/>'),
    # 2.4.5: names and values of items differ; declaredType has the type of the variable.
    "type.items": ('value="1"/>', 'value="0"/>'),
    "type.defined": ('name="count"', 'name="count" declaredType="Length"'),
    "log.unique": ('<Category name="logAll"/>', '<Category name="logAll"/><Category name="logAll"/>'),
    # Impossible times.
    "experiment.times": ('stopTime="1"', 'stopTime="-1"'),
    # 2.4.7.2: a dimension has one of both sizes, by a structural parameter or constant of type UInt64, from 1.
    "variable.dimension": ('<Dimension start="2"/>', '<Dimension start="2" valueReference="1"/>'),
    # 2.4.7.5: one start value, or as many as elements.
    "variable.length": ('start="1 2 3"', 'start="1 2"'),
    "variable.range": ('start="-3" min="-9"', 'start="-3" min="-2"'),
    "interface.event-mode": (
        "</ModelVariables>",
        '<Clock name="c" valueReference="50" causality="input" intervalVariability="triggered"/></ModelVariables>',
    ),
    "variable.enumeration": (
        "</ModelVariables>",
        '<Enumeration name="e" valueReference="70" causality="parameter" declaredType="Mode" start="7"/></ModelVariables>',
    ),
    "variable.clock": ('name="rearm"', 'name="rearm" intermediateUpdate="true"'),
    "variable.derivative": (
        "</ModelVariables>",
        '<Float64 name="v" valueReference="70" causality="input" start="0" derivative="9"/></ModelVariables>',
    ),
    # 2.4.8: lists without duplicates; dependency kinds of variables that are not numbers; event indicators.
    "structure.outputs": (OUTPUT, OUTPUT + OUTPUT),
    "structure.dependencies": ('valueReference="5" dependencies="2"/>', 'valueReference="5" dependencies="2" dependenciesKind="fixed"/>'),
    # A warning, since the Reference FMU Feedthrough has them: linear kinds for variables that are not floating-point.
    "structure.kinds": (MODE, MODE.replace("dependent dependent", "dependent fixed")),
    "structure.event-indicators": ("</ModelStructure>", '<EventIndicator valueReference="12"/></ModelStructure>'),
    "structure.clocked-states": ("    <InitialUnknown", '    <ClockedState valueReference="12"/><InitialUnknown'),
    # A warning: importers see algebraic loops.
    "structure.unsaid": (OUTPUT, '<Output valueReference="4"/>'),
}
# Texts and their replacements to which FMPy 0.3.32 objects, and the standard does not.
THEIRS_ALONE = {
    # It does not know the element ClockType.
    "a declared type of a clock": (
        "<CoSimulation ",
        '<CoSimulation hasEventMode="true" ',
        "  </TypeDefinitions>",
        '  <ClockType name="Tick" intervalVariability="triggered"/></TypeDefinitions>',
        "</ModelVariables>",
        '<Clock name="c" valueReference="50" causality="input" declaredType="Tick" intervalVariability="triggered"/></ModelVariables>',
    ),
    # It splits a list at each blank.
    "two blanks in a list": (MODE, MODE.replace("2 8", "2  8")),
}
# No defect for either.
SOUND = {
    "nothing": ("", ""),
    "a patch version": ('fmiVersion="3.0"', 'fmiVersion="3.0.2"'),
    "flags as numbers": ('StepSize="true"', 'StepSize="1"'),
    "infinity": ('max="1000"', 'max="INF"'),
    "a flag that nobody knows": ("<CoSimulation ", '<CoSimulation canDoMore="true" '),
    "a flag of another standard": ("<CoSimulation ", '<CoSimulation xmlns:a="urn:a" a:canDoMore="true" '),
    "one start for all": ('start="1 2 3"', 'start="1"'),
    "annotations": ("</ModelStructure>", '</ModelStructure><Annotations><Annotation type="a">x<b/></Annotation></Annotations>'),
    "co-simulation alone": (re.compile("<ModelExchange.*/>"), ""),
    "scheduled execution too": ("  <UnitDefinitions>", '  <ScheduledExecution modelIdentifier="everything"/><UnitDefinitions>'),
    "a clock": (
        "<CoSimulation ",
        '<CoSimulation hasEventMode="true" ',
        "</ModelVariables>",
        '<Clock name="c" valueReference="50" causality="input" intervalVariability="fixed" intervalDecimal="0.1"/></ModelVariables>',
    ),
    "a type with the name of a variable": ('name="total"', 'name="Mode"'),
    "an event indicator": ("</ModelStructure>", '<EventIndicator valueReference="5"/></ModelStructure>'),
    "a size by a constant": (
        '<Dimension valueReference="1"/>',
        '<Dimension valueReference="60"/>',
        "</ModelVariables>",
        '<UInt64 name="three" valueReference="60" variability="constant" start="3"/></ModelVariables>',
    ),
}


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    """A library with every function that the header of the standard declares; none of them is called."""
    header = next(Path(fmpy.__file__).parent.rglob("fmi3Functions.h")).read_text()
    names = sorted(set(re.findall(r"FMI3_Export\s+(fmi3\w+?)TYPE\s", header)))
    assert len(names) == 75
    folder = tmp_path_factory.mktemp("library3")
    source, product = folder / "all.c", folder / "everything.so"
    source.write_text("".join(f"int {name}(void) {{ return 3; }}\n" for name in names))
    subprocess.run([os.environ.get("CC", "cc"), "-shared", "-fPIC", source, "-o", product], check=True)
    return product


def replaced(*edits):
    """The text to replace and its replacement, for edits by pattern or in several places."""
    if len(edits) == 2 and isinstance(edits[0], str):
        return edits
    xml = text = (FIXTURES / "description3.xml").read_text()
    for old, new in zip(edits[::2], edits[1::2]):
        changed = old.sub(new, text, 1) if isinstance(old, re.Pattern) else text.replace(old, new, 1)
        assert changed != text, old
        text = changed
    return xml, text


def verdicts(folder, library, *edits):
    return judged(folder, "description3.xml", library, ENTRY, *replaced(*edits))


@pytest.mark.parametrize("defect", BROKEN)
def test_both_object(tmp_path, library, defect):
    ours, theirs = verdicts(tmp_path, library, *BROKEN[defect])
    assert ours["errors"] > 0 and theirs, (ours, theirs)


@pytest.mark.parametrize("edit", SOUND)
def test_both_accept(tmp_path, library, edit):
    ours, theirs = verdicts(tmp_path, library, *SOUND[edit])
    assert ours["errors"] == 0 and theirs == [], (ours, theirs)


@pytest.mark.parametrize("edit", THEIRS_ALONE)
def test_theirs_alone_objects(tmp_path, library, edit):
    ours, theirs = verdicts(tmp_path, library, *THEIRS_ALONE[edit])
    assert ours["errors"] == 0 and theirs, (ours, theirs)


@pytest.mark.parametrize("rule", OURS_ALONE)
def test_ours_alone_objects(tmp_path, library, rule):
    ours, theirs = verdicts(tmp_path, library, *OURS_ALONE[rule])
    assert [finding["rule"] for finding in ours["findings"]] == [rule] and theirs == []


MEMBER = '<TerminalMemberVariable variableName="u" memberName="u" variableKind="signal"/>'
# Texts of the terminals and their replacements, to which the schema and we must object.
TERMINALS_BROKEN = {
    "another version": ('fmiVersion="3.0"', 'fmiVersion="2.0"'),
    "another root": ("fmiTerminalsAndIcons", "fmiTerminals"),
    "no name": ('name="vehicle" ', ""),
    "no matching rule": (' matchingRule="bus"', ""),
    "no kind": (' variableKind="signal"', ""),
    "an unknown element": (MEMBER, MEMBER + "<Odd/>"),
    "no terminal": (re.compile("<Terminal name.*</Terminal>", re.S), ""),
    "another order": (MEMBER, '<Terminal name="a" matchingRule="none"/>' + MEMBER),
    "a picture without place": ("<Terminals>", '<GraphicalRepresentation><Icon x1="0" y1="0" x2="1"/></GraphicalRepresentation><Terminals>'),
}
# Texts to which we object beyond the schema, by this rule.
TERMINALS_OURS_ALONE = {
    "terminal.member": ('variableName="u"', 'variableName="v"'),
    "terminal.unique": ('memberName="x"', 'memberName="u"'),
    "terminal.name": (' memberName="x"', ""),
}


def terminals(folder, library, old, new):
    """Our findings on an FMU with these terminals, and what the schema objects to."""
    text = (FIXTURES / "terminals3.xml").read_text()
    changed = old.sub(new, text) if isinstance(old, re.Pattern) else text.replace(old, new)
    assert changed != text or old == new
    file = folder / "terminalsAndIcons.xml"
    file.write_text(changed)
    schemas = next(Path(fmpy.__file__).parent.rglob("fmi3TerminalsAndIcons.xsd"))
    schema = etree.XMLSchema(file=str(schemas))
    ours, theirs = judged(
        folder, "description3.xml", library, ENTRY, "", "", more={"terminalsAndIcons/terminalsAndIcons.xml": file}
    )
    assert theirs == []
    return ours, schema.validate(etree.parse(file))


@pytest.mark.parametrize("defect", TERMINALS_BROKEN)
def test_terminals_that_the_schema_refuses(tmp_path, library, defect):
    ours, valid = terminals(tmp_path, library, *TERMINALS_BROKEN[defect])
    files = {finding["place"]["file"] for finding in ours["findings"]}
    assert ours["errors"] > 0 and not valid and files == {"terminalsAndIcons/terminalsAndIcons.xml"}, ours


@pytest.mark.parametrize("rule", [None, *TERMINALS_OURS_ALONE])
def test_terminals_that_the_schema_takes(tmp_path, library, rule):
    ours, valid = terminals(tmp_path, library, *TERMINALS_OURS_ALONE.get(rule, ("", "")))
    assert [finding["rule"] for finding in ours["findings"]] == ([rule] if rule else []) and valid


def test_a_library_that_lacks_functions(tmp_path, library):
    ours, theirs = judged(tmp_path, "description3.xml", library, ENTRY, "", "")
    assert ours["findings"] == [] and theirs == []
    ours, _ = judged(tmp_path, "description3.xml", library, ENTRY.replace("x86_64-linux", "linux64"), "", "")
    assert [finding["rule"] for finding in ours["findings"]] == ["archive.binary"]
    poor = tmp_path / "poor.so"
    source = tmp_path / "poor.c"
    source.write_text("int fmi3GetVersion(void) { return 0; }\n")
    subprocess.run([os.environ.get("CC", "cc"), "-shared", "-fPIC", source, "-o", poor], check=True)
    ours, _ = judged(tmp_path, "description3.xml", poor, ENTRY, "", "")
    [finding] = ours["findings"]
    assert finding["rule"] == "symbols.missing"
    assert finding["message"].startswith("does not export 74 of the 75 functions of FMI 3.0: fmi3")


@pytest.mark.parametrize(
    "entry, rule",
    [
        ("documentation/page.html", "archive.index"),
        ("documentation/licenses/a.txt", "archive.companion"),
        ("terminalsAndIcons/icon.svg", "archive.companion"),
        ("sources/all.c", "archive.index"),
        ("model.png", "archive.top-folder"),
        ("extra/org.example/data.txt", None),
        ("resources/table.csv", None),
    ],
)
def test_files_of_the_archive(tmp_path, library, entry, rule):
    file = tmp_path / "file"
    file.write_text("text")
    more = {entry: file}
    if entry.endswith("licenses/a.txt"):
        more["documentation/index.html"] = file
    ours, theirs = judged(tmp_path, "description3.xml", library, ENTRY, "", "", more=more)
    assert [finding["rule"] for finding in ours["findings"]] == ([rule] if rule else []) and theirs == []


@pytest.mark.parametrize(
    "old, new, both",
    [
        ("", "", None),
        ('name="all.c"', 'name="none.c"', False),
        ('modelIdentifier="everything"', 'modelIdentifier="other"', False),
        (' modelIdentifier="everything"', "", True),
        ("<SourceFile ", "<File ", True),
    ],
)
def test_build_descriptions(tmp_path, library, old, new, both):
    text = (
        '<?xml version="1.0" encoding="UTF-8"?><fmiBuildDescription fmiVersion="3.0">'
        '<BuildConfiguration modelIdentifier="everything"><SourceFileSet language="C99"><SourceFile name="all.c"/>'
        "</SourceFileSet></BuildConfiguration></fmiBuildDescription>"
    )
    file = tmp_path / "file"
    file.write_text(text.replace(old, new) if old else text)
    more = {"sources/buildDescription.xml": file, "sources/all.c": file}
    ours, theirs = judged(tmp_path, "description3.xml", library, ENTRY, "", "", more=more)
    assert (ours["errors"] > 0, theirs != []) == (both is not None, both is True), (ours, theirs)


SLAVE = """
from pythonfmu3 import Boolean, Float64, Fmi3Causality, Fmi3Slave, Fmi3Variability, Int32


class Foreign(Fmi3Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.time, self.u, self.y, self.k, self.on = 0.0, 1.0, 0.0, 2, True
        given = {"causality": Fmi3Causality.parameter, "variability": Fmi3Variability.fixed}
        self.register_variable(Float64("time", causality=Fmi3Causality.independent, variability=Fmi3Variability.continuous))
        self.register_variable(Float64("u", causality=Fmi3Causality.input, variability=Fmi3Variability.continuous, start=1.0))
        self.register_variable(Float64("y", causality=Fmi3Causality.output, variability=Fmi3Variability.continuous))
        self.register_variable(Int32("k", start=2, **given))
        self.register_variable(Boolean("on", start=True, **given))

    def do_step(self, time, step):
        self.y = self.k * self.u if self.on else 0.0
        return True
"""


def test_an_fmu_of_another_tool(tmp_path):
    """PythonFMU3's FMU has no errors according to us and FMPy; our warnings are true."""
    pytest.importorskip("pythonfmu3")
    (tmp_path / "foreign.py").write_text(SLAVE)
    build = [sys.executable, "-m", "pythonfmu3", "build", "-f", "foreign.py", "--no-external-tool"]
    subprocess.run(build, cwd=tmp_path, check=True, capture_output=True)
    fmu = tmp_path / "Foreign.fmu"
    ours = json.loads(punctual("validate", fmu, "--json", "--no-trial", check=False).stdout)
    assert validate_fmu(str(fmu)) == [] and ours["errors"] == 0, ours
    # Sources without a build description, and an output with undeclared dependencies.
    assert {finding["rule"] for finding in ours["findings"]} == {"archive.index", "structure.unsaid"}
    shown = json.loads(punctual("inspect", fmu, "--json").stdout)
    assert [variable["name"] for variable in shown["variables"]] == ["time", "u", "y", "k", "on"]
    assert [interface["kind"] for interface in shown["interfaces"]] == ["CoSimulation"]
