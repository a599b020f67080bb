"""A campaign on the workers of Dask, with the file of `punctual campaign`, byte for byte.

    pip install "punctual-filter[dask]"
    python examples/campaign_dask.py my.toml -o my.parquet       # a process for each core of this machine
    python examples/campaign_dask.py my.toml -o my.parquet --scheduler tcp://head:8786

What workers have finished is kept. After a loss the same command goes on from there.
"""

import argparse
from contextlib import nullcontext

import punctual
from distributed import LocalCluster


def main():
    parser = argparse.ArgumentParser(description="Runs a campaign on a Dask cluster.")
    parser.add_argument("campaign", help="campaign file, or what `punctual campaign --pack` wrote")
    parser.add_argument("-o", "--output", help="Parquet file [default: the campaign file with the ending .parquet]")
    parser.add_argument("--scheduler", help="address of a cluster's scheduler [default: processes on this machine]")
    parser.add_argument("--workers", type=int, help="processes on this machine [default: one for each core]")
    options = parser.parse_args()
    local = dict(n_workers=options.workers, threads_per_worker=1, dashboard_address=None)
    with nullcontext(options.scheduler) if options.scheduler else LocalCluster(**local) as cluster:
        address = options.scheduler or cluster.scheduler_address
        report = punctual.campaign(options.campaign, options.output, client=address)
    rate, (low, high) = report["success"]["rate"], report["success"]["interval"]
    print(f"{report['runs']} runs, {report['runs_per_second']:.3g} a second, in {report['file']}")
    print(f"success {100 * rate:.4f} %, 95 % interval {100 * low:.4f} to {100 * high:.4f} %")


if __name__ == "__main__":
    main()
