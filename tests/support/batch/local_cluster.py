"""Dask cluster of a few worker processes, in a process of its own: its loop belongs to no test.

`python -m tests.support.batch.local_cluster WORKERS` prints the address of its scheduler and
runs until its standard input ends. Workers are forks of a process that has imported Dask, and an
item is lost with its second worker: the tests end many of them.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from tests.support.paths import ROOT

_QUICK = {
    "distributed.worker.multiprocessing-method": "forkserver",
    "distributed.scheduler.allowed-failures": 1,
}


@contextmanager
def local_cluster(workers: int = 2) -> Iterator[str]:
    """Run a cluster and yield the address of its scheduler; leaving the block ends it."""
    with subprocess.Popen(
        [sys.executable, "-m", "tests.support.batch.local_cluster", str(workers)],
        cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
        text=True,
    ) as process:  # fmt: skip
        assert process.stdout is not None
        address = process.stdout.readline().strip()
        assert address.startswith("tcp://"), address
        yield address


def main() -> None:
    """Run the cluster."""
    import dask
    from distributed import LocalCluster

    dask.config.set(_QUICK)
    with LocalCluster(
        n_workers=int(sys.argv[1]), threads_per_worker=1, processes=True, dashboard_address=None
    ) as cluster:
        sys.stdout.write(f"{cluster.scheduler_address}\n")
        sys.stdout.flush()
        sys.stdin.read()


if __name__ == "__main__":
    main()
