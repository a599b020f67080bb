"""`punctual validate` and FMPy reach the same verdict on our FMUs, and on descriptions with one defect each."""

import json
import os
import subprocess
import sysconfig
import zipfile

import pytest
from fmpy.validation import validate_fmu

from conftest import ROOT, punctual

FIXTURES = ROOT / "tests" / "fixtures"

FIRST = '<Unknown index="1" dependencies="2" dependenciesKind="dependent"/>'
# Texts and their replacements, to which both must object.
BROKEN = {
    "no model name": (' modelName="misbehaving"', ""),
    "an unknown attribute": ("canHandleVariable", "canHandelVariable"),
    "an unknown element": ("<ModelVariables>", "<Odd/><ModelVariables>"),
    "an empty list": ('<Category name="logAll"/>', ""),
    "the wrong order": ("  <DefaultExperiment", "  <UnitDefinitions><Unit name='s'/></UnitDefinitions><DefaultExperiment"),
    "a flag that is none": ('StepSize="true"', 'StepSize="yes"'),
    "a number that is none": ('max="1000"', 'max="lots"'),
    "infinity in Rust's spelling": ('max="1000"', 'max="inf"'),
    "a negative reference": ('valueReference="1"', 'valueReference="-1"'),
    "an unknown causality": ('causality="input"', 'causality="inputs"'),
    "a date that is none": ("2026-01-31T", "2026-02-31T"),
    "no type": ("<String/>", ""),
    "two types": ("<String/>", "<String/><Integer/>"),
    "another version": ('fmiVersion="2.0"', 'fmiVersion="2.1"'),
    "a name twice": ('name="u"', 'name="y"'),
    "a name that is not structured": ('name="u"', 'name="u["'),
    "an undefined unit": ('<Real unit="m" max="1000"/>', '<Real unit="s"/>'),
    "an undefined display unit": ('displayUnit="mm"', 'displayUnit="km"'),
    "an undefined type": ("<String/>", '<String declaredType="T"/>'),
    "an input without start": ('<Real start="0" unit', "<Real unit"),
    "a start too many": ("<String/>", '<String start="x"/>'),
    "an illegal combination": ('causality="input"', 'causality="input" variability="fixed"'),
    "an illegal initial": ('variability="fixed"', 'variability="fixed" initial="calculated"'),
    "a continuous text": (' variability="discrete"', ""),
    "an output that is not listed": (FIRST, ""),
    "an output that is none": (FIRST, FIRST + '<Unknown index="3" dependencies=""/>'),
    "too few kinds": ('dependencies="2"', 'dependencies="2 3"'),
    "kinds without dependencies": ('dependencies="2" ', ""),
    "an initial unknown that is not listed": ("<InitialUnknowns>\n      " + FIRST, "<InitialUnknowns>"),
    "a derivative that is none": ("</Outputs>", '</Outputs><Derivatives><Unknown index="2"/></Derivatives>'),
    "not well-formed": ("</Outputs>", ""),
}
# Texts and their replacements to which we object, by this rule, and FMPy does not.
OURS_ALONE = {
    "unit.factor": ('<BaseUnit m="1"/>', '<BaseUnit m="1" factor="0"/>'),
    "log.unique": ('<Category name="logAll"/>', '<Category name="logAll"/><Category name="logAll"/>'),
    "schema.exchange": ('<Real unit="m" max="1000"/>', '<Real unit="m" max="1000" reinit="false"/>'),
    "experiment.step": ('stepSize="0.1"', 'stepSize="2"'),
    "xml.encoding": ('encoding="UTF-8"', 'encoding="ISO-8859-1"'),
}
# No defect for either.
SOUND = {
    "nothing": ("", ""),
    "flags as numbers": ('StepSize="true"', 'StepSize="1"'),
    "infinity": ('max="1000"', 'max="INF"'),
    "no version of the tool": ("<LogCategories>", "<!-- a comment --><LogCategories>"),
    "a variable of its own kind": ("<String/>", '<String/><Annotations><Tool name="t"/></Annotations>'),
    "a derivative that is not listed": (
        "</ModelVariables>",
        '<ScalarVariable name="r" valueReference="9"><Real derivative="1"/></ScalarVariable></ModelVariables>',
    ),
    "model exchange too": ("<CoSimulation", '<ModelExchange modelIdentifier="misbehaving"/><CoSimulation'),
}


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    product = tmp_path_factory.mktemp("library") / "misbehaving"
    compiler = os.environ.get("CC", "cc")
    flags = ["-shared", "-fPIC", "-fvisibility=hidden"]
    subprocess.run([compiler, *flags, FIXTURES / "misbehaving.c", "-o", product, "-lm"], check=True)
    return product


def judged(folder, fixture, library, entry, old, new, method=zipfile.ZIP_STORED, more=None):
    """Both verdicts on an FMU with the description of the fixture, in which one text is replaced, and with more files."""
    xml = (FIXTURES / fixture).read_text()
    assert old in xml
    fmu = folder / "x.fmu"
    with zipfile.ZipFile(fmu, "w", method) as archive:
        archive.writestr("modelDescription.xml", xml.replace(old, new, 1))
        archive.write(library, entry)
        for name, file in (more or {}).items():
            archive.write(file, name)
    done = punctual("validate", fmu, "--json", "--no-trial", check=False)
    return json.loads(done.stdout), validate_fmu(str(fmu))


def verdicts(folder, library, old, new, method=zipfile.ZIP_STORED):
    entry = "binaries/linux64/misbehaving.so"
    return judged(folder, "misbehaving.xml", library, entry, old, new, method)


@pytest.mark.skipif("linux-x86_64" != sysconfig.get_platform(), reason="the library is made for linux64")
@pytest.mark.parametrize("defect", BROKEN)
def test_both_object(tmp_path, library, defect):
    ours, theirs = verdicts(tmp_path, library, *BROKEN[defect])
    assert ours["errors"] > 0 and theirs, (ours, theirs)


@pytest.mark.skipif("linux-x86_64" != sysconfig.get_platform(), reason="the library is made for linux64")
@pytest.mark.parametrize("edit", SOUND)
def test_both_accept(tmp_path, library, edit):
    ours, theirs = verdicts(tmp_path, library, *SOUND[edit])
    assert ours["errors"] == 0 and theirs == [], (ours, theirs)


@pytest.mark.skipif("linux-x86_64" != sysconfig.get_platform(), reason="the library is made for linux64")
@pytest.mark.parametrize("rule", OURS_ALONE)
def test_ours_alone_objects(tmp_path, library, rule):
    ours, theirs = verdicts(tmp_path, library, *OURS_ALONE[rule])
    assert [finding["rule"] for finding in ours["findings"]] == [rule] and theirs == []


@pytest.mark.skipif("linux-x86_64" != sysconfig.get_platform(), reason="the library is made for linux64")
@pytest.mark.parametrize("method", [zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_compression(tmp_path, library, method):
    """Python's zipfile reads more compression methods than other importers, and FMPy does not object."""
    ours, theirs = verdicts(tmp_path, library, "", "", method)
    expected = [] if method == zipfile.ZIP_DEFLATED else ["archive.compression"]
    assert [finding["rule"] for finding in ours["findings"]] == expected and theirs == []


def test_ours_have_no_errors_and_no_warnings(fmus):
    for path in fmus:
        report = json.loads(punctual("validate", path, "--json").stdout)
        assert (report["findings"], report["not_examined"]) == ([], []), path.name
