"""What is made of a complete record: a disk that fails then, and how a person tries faults."""

from __future__ import annotations

import json
import resource
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from acquisition.results.finish import finish
from instrument.config.load import Loaded
from instrument.errors import StorageError
from instrument.record.record import Record
from sim.faults.faults import VARIABLE
from tests.support.command import gonio
from tests.support.scans import small_scan

RESULTS = ("measurements.csv", "fit.json", "report.html")


@pytest.fixture(scope="module")
def small() -> Loaded:
    return small_scan()


@pytest.fixture(scope="module")
def complete(small: Loaded, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run of the command, with few points and one model to fit."""
    folder = tmp_path_factory.mktemp("complete")
    text = (Path(small.protocol_path).read_text()).replace("num: 33", "num: 5")
    text = text.replace("../rigs/", f"{small.protocol_path.parent.parent / 'rigs'}/")
    (folder / "foam.yaml").write_text(text + "\nfit: {models: [oren_nayar]}\n")
    done = gonio("run", folder / "foam.yaml", "--out", folder / "run")
    assert done.returncode == 0, done.stderr
    return folder / "run"


@contextmanager
def full_disk(largest_byte: int) -> Iterator[None]:
    """No file grows beyond so many bytes: what a full disk is to whoever writes one."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (largest_byte, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def as_it_was(folder: Path) -> dict[str, bytes]:
    return {name: (folder / name).read_bytes() for name in RESULTS if (folder / name).exists()}


@pytest.mark.parametrize("too_large", RESULTS)
def test_a_result_that_the_disk_does_not_take(complete: Path, too_large: str) -> None:
    """There is room for all that is smaller: those are whole, the first that is not is named."""
    from acquisition.results.run_folder import load_run_inputs

    before = as_it_was(complete)
    room = len(before[too_large]) - 1
    first = next(name for name in RESULTS if len(before[name]) > room)
    for name in RESULTS:
        (complete / name).unlink()
    with Record.open(complete) as record:
        loaded = load_run_inputs(record)
        with full_disk(room), pytest.raises(StorageError, match="look at the disk") as failed:
            finish(record, loaded)
        assert f"{complete / first}: cannot be written" in str(failed.value)
        assert f"gonio report {complete}" in str(failed.value)
        assert as_it_was(complete) == {n: before[n] for n in RESULTS[: RESULTS.index(first)]}
        assert not list(complete.glob(".*.part"))
        finish(record, loaded)
    assert as_it_was(complete) == before


def test_a_result_whose_name_is_taken(complete: Path) -> None:
    """A folder stands where fit.json should be: exit 3, named, and nothing half-written."""
    (complete / "fit.json").unlink()
    (complete / "fit.json").mkdir()
    done = gonio("report", complete)
    assert done.returncode == 3
    assert f"gonio report {complete}" in done.stderr
    assert "Traceback" not in done.stderr
    (complete / "fit.json").rmdir()
    assert gonio("report", complete).returncode == 0
    assert json.loads((complete / "fit.json").read_text())["verdict"]


# How a person tries it.


def test_a_person_plans_a_fault_in_words(
    complete: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    protocol, folder = complete.parent / "foam.yaml", tmp_path / "run"
    monkeypatch.setenv(VARIABLE, "theta_r stalls at theta_r.wait 5")
    done = gonio("run", protocol, "--out", folder)
    assert done.returncode == 3
    assert "theta_r: stalled at" in done.stderr
    assert f"gonio resume {folder}" in done.stderr
    monkeypatch.delenv(VARIABLE)
    assert gonio("resume", folder, "--yes").returncode == 0
    old, new = ((f / "measurements.csv").read_text() for f in (complete, folder))
    assert without_date(new) == without_date(old)


def without_date(table: str) -> list[list[str]]:
    rows = [line.split(",") for line in table.splitlines()]
    date = rows[0].index("time_utc")
    return [row[:date] + row[date + 1 :] for row in rows]
