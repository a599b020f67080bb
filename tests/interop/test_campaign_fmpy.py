"""A campaign with FMPy (examples/campaign/fmpy_runs.py): the rows of `punctual campaign`."""

import json
import struct
import sys

import pyarrow.parquet
import pytest
from conftest import ROOT, punctual

sys.path.append(str(ROOT / "examples" / "campaign"))
import fmpy_runs  # noqa: E402

RUNS = 40
SYSTEM = """
[system.experiment]
stop_time = 8.0
step = 0.005

[[system.component]]
name = "filter"
fmu = "filter.fmu"
start = { "goal.margin" = 0.05 }

[[system.component]]
name = "plant"
fmu = "plant.fmu"

[[system.connect_by_name]]
components = ["filter", "plant"]

[[system.connection]]
from = "plant.x.v"
to = "filter.u_ref.a"
factor = -0.5
offset = 0.1
"""
# Bounds that make some runs fail, some be refused (u_min > u_max) and some succeed; a disturbed plant.
VARY = {
    "filter.u_min.a": 'distribution = "uniform"\nmin = -40.0\nmax = 5.0',
    "filter.u_max.a": 'distribution = "uniform"\nmin = 0.0\nmax = 40.0',
    "filter.goal.deadline": 'distribution = "uniform"\nmin = 3.0\nmax = 7.0',
    "plant.x0.v": 'distribution = "normal"\nmean = 0.0\ndeviation = 5.0',
    "plant.x0.x_p": 'distribution = "uniform"\nmin = 0.0\nmax = 20.0',
    "plant.disturbance.seed": 'distribution = "seed"',
}


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    """The campaign file, and the rows that `punctual campaign` writes for it."""
    folder = tmp_path_factory.mktemp("campaign")
    filter_ = (ROOT / "examples" / "campaign" / "unicycle-filter.toml").read_text()
    (folder / "filter.toml").write_text(filter_)
    (folder / "plant.toml").write_text(
        'kind = "plant"\nplant = { model = "unicycle" }\n'
        "disturbance = { period = 0.1, inputs = { a = 0.5 } }\n"
    )
    for part in ["filter", "plant"]:
        punctual("build", f"{part}.toml", "-o", f"{part}.fmu", cwd=folder)
    vary = "".join(f'[vary."{name}"]\n{how}\n' for name, how in VARY.items())
    text = f'{SYSTEM}\n[campaign]\nruns = {RUNS}\nseed = 3\nsuccess = "on_time_and_inside"\n{vary}'
    (folder / "c.toml").write_text(text)
    punctual("campaign", "c.toml", cwd=folder)
    return folder / "c.toml", pyarrow.parquet.read_table(folder / "c.parquet").to_pylist()


def test_every_column_has_its_unit_and_meaning_as_metadata(campaign):
    schema = pyarrow.parquet.read_schema(campaign[0].with_suffix(".parquet"))
    columns = json.loads(schema.metadata[b"punctual.columns"])
    assert [field.name for field in schema] == [column["name"] for column in columns]
    for field, column in zip(schema, columns):
        expected = {key.encode(): column[key].encode() for key in ("unit", "description") if column[key]}
        assert field.metadata == expected, field
    assert schema.field("plant.x0.v").metadata[b"unit"] == b"m/s"
    kinds = [str(schema.field(name).type) for name in ("run", "plant.x0.v", "success", "failure")]
    assert kinds == ["int64", "double", "bool", "string"]


def bits(value):
    """A representation that shows every bit of a cell."""
    return struct.pack("<d", value) if isinstance(value, float) else value


def test_the_rows_are_those_of_punctual_campaign(campaign, tmp_path):
    path, rows = campaign
    assert {(row["success"], row["failure"] is None) for row in rows} == {(True, True), (False, True), (False, False)}
    drawn = json.loads(punctual("campaign", path.name, "--list", f"0..{RUNS}", "--json", cwd=path.parent).stdout)
    simulation = fmpy_runs.Simulation(*fmpy_runs.read(path), str(tmp_path))
    assert len(rows) == RUNS
    for one, row in zip(drawn, rows):
        found = simulation.run(one)
        assert list(found) == list(row)
        for name, value in row.items():
            assert bits(found[name]) == bits(value), (row["run"], name)


def test_what_it_cannot_run_is_refused(campaign):
    path, _ = campaign
    other = path.with_name("jacobi.toml")
    other.write_text(path.read_text().replace("step = 0.005", 'step = 0.005\norder = "jacobi"'))
    with pytest.raises(SystemExit, match="experiment.order"):
        fmpy_runs.read(other)
