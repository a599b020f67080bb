"""Campaigns by the command line: on this machine, or on the workers of a Dask cluster."""

from __future__ import annotations

import json
import math
import os
import re
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ._command import run
from ._error import Error

if TYPE_CHECKING:
    from distributed import Client as _Client, Future as _Future

_SECONDS = 5.0  # that the runs of a batch take together: the most that a lost worker loses
_GROWTH = 4  # largest growth of a batch from one to the next, as a factor
_MOST = 1 << 14  # runs of a batch


def campaign(
    file: str | os.PathLike[str],
    output: str | os.PathLike[str] | None = None,
    *,
    client: _Client | str | None = None,
    batch: int | None = None,
) -> dict[str, Any]:
    """Makes the runs of a campaign file; returns the report of `punctual campaign --json`.

    - `output`: the Parquet file. Default: the campaign file with the ending `.parquet`.
    - `client`: a `distributed.Client`, or the address of a scheduler such as `"tcp://head:8786"`. The runs are made by
      this package on the workers, which need no file of the campaign; every thread of theirs makes one at a time. The
      file is that of one machine, byte for byte. Default: all cores of this machine.
    - `batch`: runs that a worker makes at once. Default: as many as take five seconds.

    What workers have finished is kept in the folder `<output>.shards`. Where a call ends early, the same call goes on
    from there, with any cluster.

    Raises `ImportError` for a `client` without Dask (`pip install "punctual-filter[dask]"`); `Error` for a campaign that
    cannot be used, a file that is in the way or cannot be written, a lost cluster, and runs that ended every worker that
    had them.
    """
    path = Path(file)
    result = path.with_suffix(".parquet") if output is None else Path(output)
    if batch is not None and (isinstance(batch, bool) or not isinstance(batch, int) or not 1 <= batch <= _MOST):
        raise Error(f"batch: is {batch!r}, must be a whole number from 1 to {_MOST}")
    folder = Path(f"{result}.shards")
    # One that is complete is only summed up; one of another campaign is refused.
    if client is None or result.exists():
        local = run(("campaign", path, "-o", result, "--json"), accepted=(0,))
        shutil.rmtree(folder, ignore_errors=True)
        found: dict[str, Any] = json.loads(local)
        return found
    try:
        from distributed import Client
    except ImportError:
        raise ImportError('client: needs Dask; pip install "punctual-filter[dask]"') from None
    begin = time.perf_counter()
    with _Kept(path, folder) as kept:
        before = kept.done
        try:
            with nullcontext(client) if isinstance(client, Client) else _connected(client) as cluster:
                # What waits for futures takes the current client, which without this may be another one.
                with cluster.as_current():
                    _spread(cluster, kept, batch)
        except (CancelledError, OSError) as error:
            raise Error(f"client: the scheduler was lost, or the client closed: {type(error).__name__}; {kept.told()}") from error
        try:
            joined = run(("campaign", kept.packed, "--join", folder, "-o", result, "--json"), accepted=(0,))
        except Error as error:
            raise Error(f"{error}; {kept.told()}") from None
    shutil.rmtree(folder, ignore_errors=True)
    seconds = time.perf_counter() - begin
    report: dict[str, Any] = json.loads(joined)
    rate = (kept.runs - before) / seconds
    return report | {"campaign": str(path), "wall_time": seconds, "runs_per_second": rate}


def _connected(address: str) -> _Client:
    from distributed import Client

    if not isinstance(address, str):
        raise Error(f"client: is {address!r}, must be a distributed.Client, or the address of a scheduler")
    try:
        # The default of a process stays what it is, even where none answers.
        return Client(address, set_as_default=False)
    except (OSError, ValueError) as error:
        example = "an address is such as tcp://head:8786"
        raise Error(f"client: no scheduler answers at {address}: {error}; {example}") from error


class _Kept:
    """The parts that are there, in a folder that no other call uses."""

    def __init__(self, path: Path, folder: Path) -> None:
        self.folder, self.packed = folder, folder / "campaign.json"
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self.lock = open(folder / "lock", "w")
        except OSError as error:
            raise Error(f"output: cannot write the folder {folder}: {error.strerror}") from None
        try:
            self._open(path)
        except BaseException:
            self.lock.close()
            raise

    def _open(self, path: Path) -> None:
        if sys.platform != "win32":
            import fcntl

            try:
                fcntl.flock(self.lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise Error(f"output: {self.folder} is in use by another call that is running") from None
        draft = self.folder / "campaign.draft"
        run(("campaign", path, "--pack", draft), accepted=(0,))
        text = draft.read_bytes()
        if self.packed.exists() and self.packed.read_bytes() != text:
            raise Error(f"output: {self.folder} is of another campaign; remove it, or give another output")
        draft.replace(self.packed)
        self.text, self.runs = text.decode(), int(json.loads(text)["runs"])
        names = (re.fullmatch(r"(\d+)-(\d+)\.parquet", file.name) for file in self.folder.iterdir())
        self.parts = sorted((int(name[1]), int(name[2])) for name in names if name)

    def __enter__(self) -> _Kept:
        return self

    def __exit__(self, *_: object) -> None:
        self.lock.close()

    @property
    def done(self) -> int:
        return sum(end - first for first, end in self.parts)

    def missing(self) -> list[tuple[int, int]]:
        """The stretches of runs that are not there."""
        ends = [0, *(end for _, end in self.parts)]
        starts = [*(first for first, _ in self.parts), self.runs]
        return [(end, start) for end, start in zip(ends, starts) if end < start]

    def keep(self, first: int, end: int, rows: bytes) -> None:
        """Writes a part, so that it is there as a whole or not at all."""
        path = self.folder / f"{first:016}-{end:016}.parquet"
        draft = path.with_suffix(".draft")
        try:
            with open(draft, "wb") as file:
                file.write(rows)
                file.flush()
                os.fsync(file.fileno())
            draft.replace(path)
        except OSError as error:
            draft.unlink(missing_ok=True)
            raise Error(f"cannot write {path}: {error.strerror}; {self.told()}") from None
        self.parts = sorted([*self.parts, (first, end)])

    def told(self) -> str:
        return f"{self.done} of {self.runs} runs are kept in {self.folder}, and the same call goes on from there"


def _segment(text: str, first: int, end: int) -> tuple[bytes, float]:
    """On a worker: the part of these runs, and the seconds that they took."""
    with tempfile.TemporaryDirectory(prefix="punctual-") as name:
        file, part = Path(name, "campaign.json"), Path(name, "part.parquet")
        file.write_text(text, encoding="utf-8")
        arguments = ("campaign", file, "--shard", f"{first}..{end}", "-o", part, "--threads", "1", "--json")
        report = json.loads(run(arguments, accepted=(0,)))
        return part.read_bytes(), float(report["wall_time"])


@contextmanager
def _batches(client: _Client) -> Iterator[dict[_Future, tuple[int, int]]]:
    """Batches on their way; what is left of them at the end is given up."""
    flying: dict[_Future, tuple[int, int]] = {}
    try:
        yield flying
    finally:
        if flying and client.status == "running":
            client.cancel(list(flying))


def _spread(client: _Client, kept: _Kept, batch: int | None) -> None:
    """Has the workers make the runs that are missing."""
    from distributed import wait

    missing, size, lost = kept.missing(), batch or 1, ""
    left = kept.runs - kept.done
    with _batches(client) as flying:
        while missing or flying:
            if client.status != "running":
                raise CancelledError
            threads = max(sum(client.nthreads().values()), 1)
            # Two for each thread, so that none waits for the next; smaller ones at the end, of a second or so.
            while missing and not lost and len(flying) < 2 * threads:
                first, end = missing[0]
                count = batch or max(min(size, math.ceil(left / (2 * threads))), size // 5, 1)
                cut = min(first + count, end)
                missing[:1] = [(cut, end)] if cut < end else []
                left -= cut - first
                flying[client.submit(_segment, kept.text, first, cut, pure=False, retries=2)] = (first, cut)
            if not flying:
                break
            finished = wait(list(flying), return_when="FIRST_COMPLETED").done
            for future in finished:
                first, end = flying.pop(future)
                try:
                    rows, seconds = future.result()
                except CancelledError:
                    raise
                except Exception as error:
                    # What others have begun is kept first.
                    lost = lost or f"the runs {first}..{end} were lost: {type(error).__name__}: {error}"
                    continue
                kept.keep(first, end, rows)
                wanted = int((end - first) * _SECONDS / max(seconds, 1e-3))
                size = min(max(wanted, 1), _GROWTH * (end - first), _MOST)
    if lost:
        raise Error(f"{lost}; {kept.told()}")
