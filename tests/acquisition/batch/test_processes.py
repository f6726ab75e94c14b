"""Processes of a batch: one that ends costs only time, and none outlives the batch."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from acquisition.batch.lost import Lost
from acquisition.batch.processes import on_processes
from tests.support.batch.work import Item, attempts, squared
from tests.support.paths import ROOT
from tests.support.timing.deadline import wait_for


def test_a_killed_process_costs_nothing_but_time(tmp_path: Path) -> None:
    numbers = range(6)
    killed = random.Random(11).choice(numbers)
    items = [Item(n, tmp_path, deaths=n == killed) for n in numbers]
    found = dict(on_processes(squared, items, 2))
    assert found == {item: item.number**2 for item in items}
    assert len(attempts(tmp_path, killed)) == 2


def test_an_item_that_always_ends_its_process_takes_no_other_with_it(tmp_path: Path) -> None:
    items = [Item(n, tmp_path, deaths=9 * (n == 1)) for n in range(4)]
    found = dict(on_processes(squared, items, 2))
    lost = found.pop(items[1])
    assert isinstance(lost, Lost)
    assert "twice" in lost.reason
    assert found == {item: item.number**2 for item in items if item.number != 1}


def _ended(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return True
    return False


def test_closing_the_results_ends_work_under_way(tmp_path: Path) -> None:
    items = [Item(1, tmp_path), Item(2, tmp_path, hangs=True)]
    results = on_processes(squared, items, 2)
    assert next(results) == (items[0], 1)
    wait_for(lambda: attempts(tmp_path, 2), "the second item is under way")
    results.close()
    assert all(map(_ended, attempts(tmp_path, 2)))


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_no_process_outlives_the_one_that_started_it(tmp_path: Path, number: int) -> None:
    code = (
        "from pathlib import Path; from acquisition.batch.processes import on_processes\n"
        "from tests.support.batch.work import Item, squared\n"
        f"if __name__ == '__main__': list(on_processes(squared, [Item(1, Path({str(tmp_path)!r}), "
        "hangs=True)], 1))"
    )
    with subprocess.Popen([sys.executable, "-c", code], cwd=ROOT) as main:
        wait_for(lambda: attempts(tmp_path, 1), "the item is under way")
        main.send_signal(number)
    wait_for(lambda: _ended(attempts(tmp_path, 1)[0]), "the process of the item ends")
