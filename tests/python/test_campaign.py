"""Campaigns on a Dask cluster: the file of one machine, whatever is lost on the way."""

import errno
import json
import os
import signal
import shutil
import subprocess
import sys
import threading
import time

import distributed
import punctual
import pytest
from conftest import ROOT
from distributed import Client, LocalCluster, default_client, wait

RUNS, BATCH = 40, 2
VARY = {
    "filter.u_min.a": 'distribution = "uniform"\nmin = -40.0\nmax = 5.0',
    "filter.u_max.a": 'distribution = "uniform"\nmin = 0.0\nmax = 40.0',
    "plant.x0.v": 'distribution = "normal"\nmean = 0.0\ndeviation = 5.0',
    "plant.x0.x_p": 'distribution = "uniform"\nmin = 0.0\nmax = 20.0',
    "plant.disturbance.seed": 'distribution = "seed"',
}
FILES = {
    "filter.toml": 'kind = "filter"\nplant = { model = "unicycle" }\n[[barrier]]\nname = "goal"\n'
    "centre = [45.0, 45.0]\nradius = 2.0\nsmoothing = 2.0\ndeadline = 5.0\n",
    "plant.toml": 'kind = "plant"\nplant = { model = "unicycle" }\n'
    "disturbance = { period = 0.1, inputs = { a = 0.5 } }\n",
    "c.toml": '[system.experiment]\nstop_time = 8.0\nstep = 0.02\n[[system.component]]\nname = "filter"\n'
    'fmu = "filter.toml"\n[[system.component]]\nname = "plant"\nfmu = "plant.toml"\n[[system.connect_by_name]]\n'
    f'components = ["filter", "plant"]\n[campaign]\nruns = {RUNS}\nseed = 3\nsuccess = "on_time_and_inside"\n'
    + "".join(f'[vary."{name}"]\n{how}\n' for name, how in VARY.items()),
}


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A campaign, and the bytes of its file on one machine."""
    folder = tmp_path_factory.mktemp("campaign")
    for name, text in FILES.items():
        (folder / name).write_text(text)
    report = punctual.campaign(folder / "c.toml")
    assert 0 < report["success"]["count"] < report["runs"] == RUNS
    return folder / "c.toml", (folder / "c.parquet").read_bytes()


@pytest.fixture
def client():
    """Two processes, each with one thread."""
    local = dict(n_workers=2, threads_per_worker=1, dashboard_address=None)
    with LocalCluster(**local) as cluster, Client(cluster) as client:
        yield client


def parts(output):
    return sorted(output.with_name(output.name + ".shards").glob("*.parquet"))


def broken():
    """Takes the engine away from a worker."""
    import punctual._command

    punctual._command._PROGRAM = "/none/punctual"


def once(condition, act):
    """Calls `act` as soon as `condition` holds, in a thread of its own."""

    def watch():
        end = time.monotonic() + 60.0
        while not condition():
            assert time.monotonic() < end, "never"
            time.sleep(0.005)
        act()

    thread = threading.Thread(target=watch, daemon=True)
    thread.start()
    return thread


def test_the_file_is_that_of_one_machine(whole, client, tmp_path):
    path, expected = whole
    output = tmp_path / "far.parquet"
    report = punctual.campaign(path, output, client=client)
    assert output.read_bytes() == expected
    assert not parts(output) and [file.name for file in tmp_path.iterdir()] == ["far.parquet"]
    local = punctual.campaign(path)
    assert local["wall_time"] == 0.0, "complete, so only summed up"
    assert {key: report[key] for key in ("success", "worst", "runs", "campaign")} == {
        key: local[key] for key in ("success", "worst", "runs", "campaign")
    }
    # Again: nothing is made, and no cluster is asked.
    assert punctual.campaign(path, output, client="tcp://127.0.0.1:1")["success"] == local["success"]


def test_a_killed_worker_loses_nothing(whole, client, tmp_path):
    path, expected = whole
    output, pids = tmp_path / "far.parquet", client.run(os.getpid)
    killed = []

    def kill():
        busy = next(address for address, keys in client.processing().items() if keys)
        os.kill(pids[busy], signal.SIGKILL)
        killed.append((busy, len(parts(output))))

    thread = once(lambda: len(parts(output)) >= 3, kill)
    punctual.campaign(path, output, client=client, batch=BATCH)
    thread.join()
    assert len(killed) == 1 and 3 <= killed[0][1] < RUNS // BATCH, killed
    client.wait_for_workers(2, timeout=60)
    assert pids[killed[0][0]] not in client.run(os.getpid).values()
    assert output.read_bytes() == expected


def test_a_lost_scheduler_loses_nothing_that_was_done(whole, client, tmp_path):
    path, expected = whole
    output, address = tmp_path / "far.parquet", tmp_path / "scheduler.json"
    command = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--port", "0", "--no-dashboard"]
    scheduler = subprocess.Popen([*command, "--scheduler-file", address], stderr=subprocess.DEVNULL)
    command = [sys.executable, "-m", "distributed.cli.dask_worker", "--scheduler-file", address, "--no-dashboard"]
    worker = subprocess.Popen([*command, "--nthreads", "1", "--no-nanny"], stderr=subprocess.DEVNULL)
    try:
        end = time.monotonic() + 60.0
        while not address.exists():
            assert time.monotonic() < end
            time.sleep(0.05)
        once(lambda: len(parts(output)) >= 4, scheduler.kill)
        at = json.loads(address.read_text())["address"]
        with pytest.raises(punctual.Error, match=r"^client: the scheduler was lost, or the client closed: .* of 40 runs are kept in "):
            punctual.campaign(path, output, client=at, batch=BATCH)
    finally:
        worker.kill()
        scheduler.kill()
        worker.wait()
        scheduler.wait()
    kept = {file.name: file.stat().st_mtime_ns for file in parts(output)}
    assert 4 <= len(kept) < RUNS // BATCH and not output.exists()
    # Another cluster goes on: what is there is not made again.
    seen = {}

    def see():
        seen.update({file.name: file.stat().st_mtime_ns for file in parts(output)})

    thread = once(lambda: len(parts(output)) > len(kept), see)
    punctual.campaign(path, output, client=client, batch=BATCH)
    thread.join()
    assert kept.items() <= seen.items()
    assert output.read_bytes() == expected


def test_another_client_is_left_alone(whole, client, tmp_path, monkeypatch):
    path, expected = whole
    output, waiting = tmp_path / "far.parquet", []

    def see(*arguments, **options):
        waiting.append(default_client())
        return wait(*arguments, **options)

    monkeypatch.setattr(distributed, "wait", see)
    # It is the default of the process from now on, and might be one that never got to its scheduler.
    with Client(client.cluster) as other:
        assert default_client() is other
        punctual.campaign(path, output, client=client, batch=BATCH)
        assert default_client() is other
    assert waiting and all(waits is client for waits in waiting)
    assert output.read_bytes() == expected


def test_a_closed_client_loses_nothing_that_was_done(whole, tmp_path):
    path, expected = whole
    output = tmp_path / "far.parquet"
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        # The only one of this process.
        client = Client(cluster)
        thread = once(lambda: len(parts(output)) >= 4, client.close)
        with pytest.raises(punctual.Error, match="^client: the scheduler was lost, or the client closed: .* of 40 runs are kept in "):
            punctual.campaign(path, output, client=client, batch=BATCH)
        thread.join()
        assert 4 <= len(parts(output)) < RUNS // BATCH
        with Client(cluster) as client:
            punctual.campaign(path, output, client=client, batch=BATCH)
    assert output.read_bytes() == expected


def test_an_engine_that_is_ended_says_how(tmp_path, monkeypatch):
    program = tmp_path / "punctual"
    program.write_text("#!/bin/sh\nkill -9 $$\n")
    program.chmod(0o700)
    monkeypatch.setattr("punctual._command._PROGRAM", program)
    with pytest.raises(punctual.Error, match="^the program was ended by SIGKILL$"):
        punctual.run_cli("--version")


def test_a_full_disk_loses_nothing_that_was_done(whole, client, tmp_path, monkeypatch):
    path, expected = whole
    output, sync, left = tmp_path / "far.parquet", os.fsync, iter(range(3))

    def full(descriptor):
        if next(left, None) is None:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        sync(descriptor)

    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", full)
        with pytest.raises(punctual.Error, match=r"^cannot write .*: No space left on device; 6 of 40 runs are kept in "):
            punctual.campaign(path, output, client=client, batch=BATCH)
    assert len(parts(output)) == 3 and not list(parts(output)[0].parent.glob("*.draft"))
    punctual.campaign(path, output, client=client, batch=BATCH)
    assert output.read_bytes() == expected


def test_the_example_makes_it_too(whole, tmp_path):
    path, expected = whole
    output = tmp_path / "far.parquet"
    example = [sys.executable, ROOT / "examples" / "campaign_dask.py", path, "-o", output, "--workers", "2"]
    done = subprocess.run(example, check=True, capture_output=True, text=True)
    assert done.stdout.startswith(f"{RUNS} runs, ") and "\nsuccess " in done.stdout, done.stdout
    assert output.read_bytes() == expected


def test_what_cannot_be_made_is_refused(whole, client, tmp_path, monkeypatch):
    path, expected = whole
    output, folder = tmp_path / "far.parquet", tmp_path / "far.parquet.shards"
    for batch in (0, 1 << 20, "5", 2.5, True):
        with pytest.raises(punctual.Error, match=f"^batch: is {batch!r}, must be a whole number from 1 to 16384$"):
            punctual.campaign(path, output, client=client, batch=batch)
    with pytest.raises(punctual.Error, match="^client: no scheduler answers at head: "):
        punctual.campaign(path, output, client="head")
    with pytest.raises(punctual.Error, match=r"^client: is 7, must be a distributed.Client, or the address of a scheduler$"):
        punctual.campaign(path, output, client=7)
    shutil.rmtree(folder)
    folder.write_text("")
    with pytest.raises(punctual.Error, match="^output: cannot write the folder .*far.parquet.shards: File exists$"):
        punctual.campaign(path, output, client=client)
    folder.unlink()
    folder.mkdir()
    (folder / "campaign.json").write_text("another")
    with pytest.raises(punctual.Error, match="^output: .* is of another campaign; remove it, or give another output$"):
        punctual.campaign(path, output, client=client)
    (folder / "campaign.json").unlink()
    other = path.with_name("other.toml")
    other.write_text(path.read_text().replace("seed = 3", "seed = 4"))
    output.write_bytes(expected)
    with pytest.raises(punctual.Error, match="^--output: .* is of another campaign"):
        punctual.campaign(other, output, client=client)
    with pytest.raises(punctual.Error, match="campaign.runs: is 0, must be from 1"):
        other.write_text(path.read_text().replace(f"runs = {RUNS}", "runs = 0"))
        punctual.campaign(other, client=client)
    # A worker whose engine is no good, which it says itself.
    output.unlink()
    client.run(broken)
    # One batch: of several it is not known which ends first.
    lost = rf"^the runs 0\.\.{RUNS} were lost: Error: .*none/punctual: there is no such file"
    with pytest.raises(punctual.Error, match=lost):
        punctual.campaign(path, output, client=client, batch=RUNS)
    # Without Dask.
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(ImportError, match=r'client: needs Dask; pip install "punctual-filter\[dask\]"'):
        punctual.campaign(path, output, client="tcp://127.0.0.1:1")
