"""A campaign with FMPy on a Dask cluster: the rows of `punctual campaign`, also when a worker is lost."""

import csv
import json
import os
import signal
import subprocess
import sys
import time

import pyarrow.parquet
import pytest
from conftest import ROOT, punctual
from dask.distributed import Client, LocalCluster

RUNS, BATCH = 40, 2
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
    folder = tmp_path_factory.mktemp("dask")
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
        told = {key.encode(): column[key].encode() for key in ("unit", "description") if column[key]}
        assert field.metadata == told, field
    assert schema.field("plant.x0.v").metadata[b"unit"] == b"m/s"
    kinds = [str(schema.field(name).type) for name in ("run", "plant.x0.v", "success", "failure")]
    assert kinds == ["int64", "double", "bool", "string"]


def script(path, output, *more):
    """The command that runs the campaign at `path`."""
    binary = os.environ.get("PUNCTUAL", ROOT / "target" / "release" / "punctual")
    example = ROOT / "examples" / "campaign_dask.py"
    return [sys.executable, example, path, "-o", output, "--batch", str(BATCH), "--punctual", binary, *more]


def same(output, rows):
    """Whether the CSV file holds `rows`, every bit of every number."""
    with open(output, newline="") as file:
        found = list(csv.DictReader(file))
    assert [int(row["run"]) for row in found] == [row["run"] for row in rows]
    for mine, row in zip(found, rows):
        assert list(mine) == list(row)
        for name, value in row.items():
            expected = "" if value is None else str(value).lower() if isinstance(value, bool) else str(value)
            assert mine[name] == expected, (row["run"], name)


def test_the_rows_are_those_of_punctual_campaign(campaign, tmp_path):
    path, rows = campaign
    assert {(row["success"], row["failure"] is None) for row in rows} == {(True, True), (False, True), (False, False)}
    command = script(path, tmp_path / "all.csv", "--workers", "2")
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    same(tmp_path / "all.csv", rows)
    # As Rate in src/campaign/summary.rs, whose figures `punctual campaign` prints.
    summary = json.loads(punctual("campaign", path.name, "--json", cwd=path.parent).stdout)
    low, high = (100.0 * end for end in summary["success"]["interval"])
    told = next(line for line in done.stdout.splitlines() if line.startswith("success"))
    count = summary["success"]["count"]
    assert told.split()[1] == str(count) and told.endswith(f"interval {low:.4f} to {high:.4f} %"), told


def test_a_lost_worker_loses_nothing(campaign, tmp_path):
    path, rows = campaign
    first, last = 3, 39
    local = dict(n_workers=2, threads_per_worker=1, dashboard_address="127.0.0.1:0")
    with LocalCluster(**local) as cluster, Client(cluster) as client:
        pids = client.run(os.getpid)
        more = ["--scheduler", cluster.scheduler_address, "--runs", f"{first}..{last}"]
        running = subprocess.Popen(script(path, tmp_path / "some.csv", *more), stdout=subprocess.PIPE)
        # In the middle: the cluster has forgotten a batch that is done, and others are with the worker that is killed.
        batches, end, lost = (last - first) // BATCH, time.monotonic() + 60.0, None
        while lost is None:
            assert running.poll() is None and time.monotonic() < end, "never in the middle"
            time.sleep(0.002)
            busy = [address for address, keys in client.processing().items() if keys]
            if busy and len(list(cluster.scheduler.tasks)) < batches:
                lost = busy[0]
        os.kill(pids[lost], signal.SIGKILL)
        assert running.wait(timeout=60) == 0
        running.stdout.close()
        client.wait_for_workers(2, timeout=60)
        assert pids[lost] not in client.run(os.getpid).values()
    same(tmp_path / "some.csv", rows[first:last])


def test_what_it_cannot_run_is_refused(campaign, tmp_path):
    path, _ = campaign
    other = path.with_name("jacobi.toml")
    other.write_text(path.read_text().replace("step = 0.005", 'step = 0.005\norder = "jacobi"'))
    done = subprocess.run(script(other, tmp_path / "none.csv"), capture_output=True, text=True)
    assert done.returncode != 0 and "experiment.order" in done.stderr, done.stderr
    done = subprocess.run(script(path, tmp_path / "none.csv", "--runs", "0..99"), capture_output=True, text=True)
    assert done.returncode != 0 and "--list: ends at 99, must be at most 40" in done.stderr, done.stderr
    assert not (tmp_path / "none.csv").exists()
