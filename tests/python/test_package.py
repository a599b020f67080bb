"""The package itself: version, documentation, what its binaries need, and the notebook."""

import inspect
import subprocess
import tomllib
from importlib import metadata
from pathlib import Path

import nbclient
import nbformat
import punctual

from conftest import ROOT

FOLDER = Path(punctual.__file__).parent


def test_it_is_the_installed_one_with_the_version_of_the_workspace():
    assert ROOT not in FOLDER.parents
    manifest = tomllib.loads((ROOT / "Cargo.toml").read_text())
    version = manifest["workspace"]["package"]["version"]
    assert punctual.__version__ == version == metadata.version("punctual-filter")
    assert metadata.metadata("punctual-filter")["License-Expression"] == "MIT OR Apache-2.0"
    summary = metadata.metadata("punctual-filter")["Summary"]
    assert "FMI 2.0 and 3.0" in summary
    licences = {Path(file).name for file in metadata.files("punctual-filter") if "licenses" in str(file)}
    assert licences == {"LICENSE-MIT", "LICENSE-APACHE"}


def test_everything_public_is_documented():
    for name in punctual.__all__:
        thing = getattr(punctual, name)
        if not (inspect.isclass(thing) or callable(thing)) or name == "Configuration":
            continue
        assert inspect.getdoc(thing), name
        members = vars(thing).items() if inspect.isclass(thing) and "punctual" in thing.__module__ else []
        for member, value in members:
            if not member.startswith("_") and (callable(value) or inspect.isdatadescriptor(value)):
                assert inspect.getdoc(value), f"{name}.{member}"


def test_the_extension_exports_nothing_but_itself():
    [extension] = FOLDER.glob("_punctual*.so")
    done = subprocess.run(["nm", "-D", "--defined-only", extension], check=True, capture_output=True, text=True)
    assert [line.split()[-1] for line in done.stdout.splitlines()] == ["PyInit__punctual"]


def test_the_shared_library_needs_an_old_glibc():
    library = FOLDER / "_bin" / "libpunctual_fmu.so"
    subprocess.run([ROOT / "release" / "needed-glibc", "2.17", library], check=True)


def test_the_notebook_runs(tmp_path):
    notebook = nbformat.read(ROOT / "examples" / "quickstart.ipynb", as_version=4)
    cells = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert all(not cell.outputs for cell in cells), "its outputs are not kept in the repository"
    nbclient.NotebookClient(notebook, timeout=120, resources={"metadata": {"path": tmp_path}}).execute()
    pictures = [o for cell in cells for o in cell.outputs if "image/png" in o.get("data", {})]
    assert len(pictures) == 3
