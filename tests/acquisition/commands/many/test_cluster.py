"""`gonio fit --all --scheduler`, and `map`: a Dask cluster gives what local processes give."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing
from functools import partial
from pathlib import Path

import pytest

from acquisition.batch import cluster
from acquisition.batch.cluster import connected, on_cluster
from acquisition.batch.lost import Lost
from instrument.errors import InputError
from tests.support.batch.local_cluster import local_cluster
from tests.support.batch.runs import Mapped, mapped_together
from tests.support.batch.tables import MODELS, write_tables
from tests.support.batch.work import Item, attempts, squared
from tests.support.command import gonio_here
from tests.support.paths import ROOT
from tests.support.timing.deadline import wait_for

pytest.importorskip("distributed", reason="a cluster needs pip install 'gonio[cluster]'")


@pytest.fixture(scope="module")
def scheduler() -> Iterator[str]:
    with local_cluster() as address:
        yield address


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_tables(tmp_path_factory.mktemp("cluster") / "in", seed=8, rough=2)


def test_results_are_those_of_each_source_alone_bit_for_bit(folder: Path, scheduler: str) -> None:
    """One bad file, and one that determines nothing, among them."""
    models = ("--models", MODELS, "--json")
    done = gonio_here("fit", "--all", folder, *models, "--scheduler", scheduler)
    assert done.returncode == 2, done.stderr
    found = json.loads(done.stdout)
    assert found["complete"]
    assert len(found["results"]) == 5
    for result in found["results"]:
        alone = gonio_here("fit", folder / result["source"], *models)
        assert result["exit_code"] == alone.returncode
        assert json.dumps(result["fit"]) == (alone.stdout.strip() or "null")


def test_maps_are_those_of_each_run_alone_bit_for_bit(
    measured: Path, alone: dict[str, Mapped], tmp_path: Path, scheduler: str
) -> None:
    assert mapped_together(measured, tmp_path, "--scheduler", scheduler) == alone


def test_killed_workers_cost_nothing_but_time(tmp_path: Path, scheduler: str) -> None:
    items = [Item(n, tmp_path, deaths=n == 2) for n in range(5)]
    with connected(scheduler) as client:
        found = dict(on_cluster(squared, items, client))
    assert found == {item: item.number**2 for item in items}
    assert len(attempts(tmp_path, 2)) == 2


def test_an_item_that_always_ends_its_worker_is_lost_alone(tmp_path: Path, scheduler: str) -> None:
    items = [Item(0, tmp_path, deaths=99), Item(1, tmp_path)]
    with connected(scheduler) as client:
        found = dict(on_cluster(squared, items, client))
    lost = found[items[0]]
    assert isinstance(lost, Lost)
    assert "workers ended" in lost.reason
    assert found[items[1]] == 1


def test_a_result_that_is_lost_with_its_worker_is_computed_again(
    tmp_path: Path, scheduler: str
) -> None:
    """It was done, and not fetched yet; no worker is there for a moment."""
    items = [Item(n, tmp_path) for n in range(2)]
    with connected(scheduler) as client, closing(on_cluster(squared, items, client)) as results:
        found = [next(results)]
        (other,) = set(items) - {found[0][0]}
        wait_for(lambda: len(client.futures) == 1, "the release of the first result")
        (future,) = client.futures.values()
        wait_for(lambda: future.status == "finished", "the other result")
        for worker in client.run(os.getpid).values():
            os.kill(worker, signal.SIGKILL)
        again = partial(attempts, tmp_path, other.number)
        wait_for(lambda: future.status == "lost" or len(again()) == 2, "the loss")
        found += results
    assert sorted(found) == [(item, item.number**2) for item in items]
    assert len(again()) == 2


def test_a_stop_takes_back_what_waits(folder: Path, tmp_path: Path, scheduler: str) -> None:
    """A table that is a pipe without a writer is read for ever."""
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "a.csv").write_bytes((folder / "rough1.csv").read_bytes())
    pipe = tmp_path / "in" / "b.csv"
    os.mkfifo(pipe)
    command = ["fit", "--all", tmp_path / "in", "--models", "lambert", "--scheduler", scheduler]
    with subprocess.Popen(
        [sys.executable, "-m", "acquisition", *map(str, command)],
        cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        start_new_session=True,
    ) as main:  # fmt: skip
        assert main.stderr is not None
        assert main.stderr.readline().startswith("1/2 a.csv")
        os.killpg(main.pid, signal.SIGINT)
        printed, errors = main.communicate(timeout=60)
    assert main.returncode == 4, errors
    assert errors.endswith("stopped by the operator: 1 of 2 done\n")
    assert "Traceback" not in errors
    assert "a.csv" in printed
    wait_for(lambda: _opened(pipe), "the worker is released")


def test_a_lost_scheduler_ends_the_command_in_one_line(folder: Path) -> None:
    with local_cluster(workers=0) as address:
        main = subprocess.Popen(
            [sys.executable, "-m", "acquisition", "fit", "--all", folder, "--scheduler", address],
            cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        assert main.stderr is not None
        assert main.stderr.readline().startswith(f"{address} has no worker yet: dask worker")
    printed, errors = main.communicate(timeout=60)
    assert (main.returncode, printed) == (3, "")
    assert errors == "the Dask scheduler is gone: look at it, and run the command again\n"


def _opened(pipe: Path) -> bool:
    """Open the pipe for the reader that waits for it, who finds it empty."""
    try:
        os.close(os.open(pipe, os.O_WRONLY | os.O_NONBLOCK))
    except OSError:  # nobody reads yet
        return False
    return True


def test_an_address_that_is_none_is_refused(folder: Path) -> None:
    done = gonio_here("fit", "--all", folder, "--scheduler", "tcp://127.0.0.1:word")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("--scheduler tcp://127.0.0.1:word: no Dask scheduler answers")
    assert len(done.stderr.splitlines()) == 1


def test_an_address_without_a_scheduler_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "ANSWER_S", 0.5)
    with closing(socket.create_server(("127.0.0.1", 0))) as taken:
        address = f"tcp://127.0.0.1:{taken.getsockname()[1]}"
    with pytest.raises(InputError, match=f"--scheduler {address}: no Dask scheduler answers"):
        cluster.connected(address)
