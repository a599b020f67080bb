"""FMPy finds no defect in any FMU that we build."""

import zipfile

import fmpy
from fmpy.validation import validate_fmu

from conftest import ROOT, punctual


def test_validate_fmu_finds_no_problem(fmus):
    # Schema, names, references, types, dependencies and archive, by FMPy's own rules.
    problems = {path.name: validate_fmu(str(path)) for path in fmus}
    assert problems == {path.name: [] for path in fmus}


def test_examples_build_and_validate(tmp_path):
    for configuration in sorted((ROOT / "examples" / "vehicles").glob("*-*.toml")):
        fmu = tmp_path / f"{configuration.stem}.fmu"
        punctual("build", configuration, "-o", fmu)
        assert validate_fmu(str(fmu)) == [], configuration.name


def test_guids_differ_between_fmus(fmus):
    # Importers key their caches by it.
    guids = [fmpy.read_model_description(path).guid for path in fmus]
    assert len(set(guids)) == len(guids)


def test_archives_hold_what_importers_look_for(fmus):
    for path in fmus:
        names = zipfile.ZipFile(path).namelist()
        identifier = fmpy.read_model_description(path).coSimulation.modelIdentifier
        for wanted in [
            "modelDescription.xml",
            "model.png",
            "documentation/index.html",
            "documentation/licenses/license.txt",
            "resources/configuration.toml",
            f"binaries/linux64/{identifier}.so",
        ]:
            assert wanted in names, (path.name, wanted)
        assert names[0] == "modelDescription.xml"
        assert not any("\\" in n or n.startswith("/") for n in names)
