"""The runs of a campaign with the FMUs under FMPy, spread over a Dask cluster: the rows of `punctual campaign`.

    cargo build --release
    python examples/campaign_dask.py                        # a few runs of examples/campaign, two processes
    python examples/campaign_dask.py my.toml -o my.csv      # all runs, a process for each core
    python examples/campaign_dask.py my.toml -o my.csv --scheduler tcp://head:8786

The draws come from `punctual campaign --list`. A task is a batch of runs; those of a lost worker go to others.
"""

import argparse
import contextlib
import csv
import json
import math
import shutil
import subprocess
import sys
import tempfile
import threading
import time
import tomllib
import uuid
from pathlib import Path

import cloudpickle
from dask.distributed import Client, KilledWorker, LocalCluster, WorkerPlugin, as_completed, get_worker

ROOT = Path(__file__).resolve().parents[1]
sys.path.append(str(ROOT / "examples" / "campaign"))
import fmpy_runs  # noqa: E402

# Its code travels to the workers, which need FMPy and nothing else of ours.
cloudpickle.register_pickle_by_value(fmpy_runs)

Z = 1.959963984540054  # the 0.975 quantile of the normal distribution


class Campaign(WorkerPlugin):
    """Goes to every worker of the cluster, later ones too; there each thread has its instances."""

    def __init__(self, system, links, fmus):
        self.name, self.parts = f"punctual-{uuid.uuid4()}", (system, links, fmus)

    def setup(self, worker):
        self.folder, self.own = tempfile.mkdtemp(dir=worker.local_directory), threading.local()

    def teardown(self, worker):
        shutil.rmtree(self.folder, ignore_errors=True)

    def run(self, batch):
        if not hasattr(self.own, "simulation"):
            self.own.simulation = fmpy_runs.Simulation(*self.parts, tempfile.mkdtemp(dir=self.folder))
        return [self.own.simulation.run(drawn) for drawn in batch]


def run_batch(name, batch):
    return get_worker().plugins[name].run(batch)


def wilson(count, n):
    """The 95 % interval of a rate (E. B. Wilson, 1927), in per cent."""
    p, scale = count / n, 1.0 + Z * Z / n
    middle, half = p + Z * Z / (2 * n), Z * math.sqrt(p * (1 - p) / n + Z * Z / (4 * n * n))
    low, high = max((middle - half) / scale, 0.0), min((middle + half) / scale, 1.0)
    return 100.0 * (0.0 if count == 0 else low), 100.0 * (1.0 if count == n else high)


def gather(client, campaign, drawn, size):
    """The rows in order, each as soon as all before it are there."""
    client.register_plugin(campaign)
    batches = [drawn[i : i + size] for i in range(0, len(drawn), size)]
    futures = client.map(run_batch, [campaign.name] * len(batches), batches, pure=False, retries=2)
    order, waiting, due = {future.key: i for i, future in enumerate(futures)}, {}, 0
    done = as_completed(futures)
    del futures  # so that the cluster forgets what has been fetched
    try:
        for future in done:
            i = order[future.key]
            waiting[i] = future.result()
            while due in waiting:
                yield from waiting.pop(due)
                due += 1
        del future
    except KilledWorker as killed:
        first, last = batches[i][0]["run"], batches[i][-1]["run"]
        raise SystemExit(f"runs {first} to {last}: every worker that had them was lost: {killed}") from killed
    finally:
        client.unregister_worker_plugin(campaign.name)


def text(value):
    """A cell; numbers read back to the same doubles."""
    return "" if value is None else str(value).lower() if isinstance(value, bool) else value


def demonstration(folder, binary):
    """The campaign of examples/campaign with its FMUs, built into `folder`."""
    for path in (ROOT / "examples" / "campaign").glob("*.toml"):
        shutil.copy(path, folder)
    for part in ["filter", "plant"]:
        build = [binary, "build", f"unicycle-{part}.toml", "-o", f"unicycle-{part}.fmu"]
        subprocess.run(build, check=True, cwd=folder, stdout=subprocess.DEVNULL)
    return Path(folder) / "unicycle.toml"


def main():
    parser = argparse.ArgumentParser(description="Runs a campaign with FMPy on a Dask cluster.")
    parser.add_argument("campaign", nargs="?", type=Path, help="campaign file [default: that of examples/campaign]")
    parser.add_argument("-o", "--output", default="campaign.csv", help="CSV file [default: campaign.csv]")
    parser.add_argument("--runs", metavar="FIRST..LAST", help="only these [default: all; of the example 0..8]")
    parser.add_argument("--scheduler", help="address of a cluster's scheduler [default: processes on this machine]")
    parser.add_argument("--workers", type=int, help="processes on this machine [default: one for each core]")
    parser.add_argument("--batch", type=int, default=4, help="runs in a task [default: 4]")
    parser.add_argument("--punctual", default=ROOT / "target" / "release" / "punctual", help="the command line")
    options = parser.parse_args()
    if options.batch < 1:
        parser.error(f"--batch is {options.batch}, must be at least 1")
    with tempfile.TemporaryDirectory() as folder:
        path, runs, output = options.campaign, options.runs, options.output
        if path is None:
            path, runs = demonstration(folder, options.punctual), runs or "0..8"
            output = f"{folder}/campaign.csv" if output == parser.get_default("output") else output
        runs = runs or f"0..{tomllib.loads(path.read_text())['campaign']['runs']}"
        listed = subprocess.run(
            [options.punctual, "campaign", path, "--list", runs, "--json"], stdout=subprocess.PIPE, text=True
        )
        if listed.returncode != 0:
            raise SystemExit(listed.returncode)
        drawn = json.loads(listed.stdout)
        campaign = Campaign(*fmpy_runs.read(path))
        # One thread for each process: FMPy's calls go through Python.
        local = dict(n_workers=options.workers, threads_per_worker=1, dashboard_address="127.0.0.1:0")
        given = options.scheduler and contextlib.nullcontext(options.scheduler)
        with given or LocalCluster(**local) as at, Client(at) as client, open(output, "w", newline="") as file:
            client.wait_for_workers(1)
            begin, rows, lacking = time.perf_counter(), csv.writer(file, lineterminator="\n"), {}
            for row in gather(client, campaign, drawn, options.batch):
                if not lacking:
                    rows.writerow(row)
                    lacking = {name: 0 for name, value in row.items() if isinstance(value, bool)}
                rows.writerow(map(text, row.values()))
                lacking = {name: count + (not row[name]) for name, count in lacking.items()}
            seconds = time.perf_counter() - begin
    print(f"{len(drawn)} runs in {seconds:.3f} s ({len(drawn) / seconds:.3g} runs/s)\n")
    for name, count in lacking.items():
        name, count = (name, len(drawn) - count) if name == "success" else (f"not {name}", count)
        low, high = wilson(count, len(drawn))
        rate = 100.0 * count / len(drawn)
        print(f"{name:30} {count:8} {rate:9.4f} %, 95 % interval {low:.4f} to {high:.4f} %")


if __name__ == "__main__":
    main()
