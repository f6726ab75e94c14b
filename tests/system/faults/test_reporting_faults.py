"""Result files on a failing disk, and a scan with a fault planned in `GONIO_FAULTS`."""

from __future__ import annotations

import json
import resource
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from acquisition.results.finish import finish
from instrument.errors import StorageError
from instrument.record.record import Record
from sim.faults.faults import VARIABLE
from tests.support.command import gonio_here as gonio
from tests.support.scans import small_demo

RESULTS = ("measurements.csv", "fit.json", "report.html")


@pytest.fixture(scope="module")
def complete(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a complete run with few points and one model to fit."""
    folder = tmp_path_factory.mktemp("complete")
    path = small_demo(folder, "oren_nayar+torrance_sparrow")
    path.write_text(path.read_text().replace("num: 9", "num: 5"))
    done = gonio("run", path, "--out", folder / "run")
    assert done.returncode == 0, done.stderr
    return folder / "run"


@contextmanager
def full_disk(largest_byte: int) -> Iterator[None]:
    """Limit the size of every file, so that writing fails as on a full disk."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (largest_byte, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def result_files(folder: Path) -> dict[str, bytes]:
    return {name: (folder / name).read_bytes() for name in RESULTS if (folder / name).exists()}


@pytest.mark.parametrize("too_large", RESULTS)
def test_a_result_too_large_for_the_disk_is_reported_and_later_written(
    complete: Path, too_large: str
) -> None:
    """Smaller results before it are complete; the first that does not fit is named."""
    from acquisition.results.run_folder import load_run_inputs

    before = result_files(complete)
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
        assert result_files(complete) == {n: before[n] for n in RESULTS[: RESULTS.index(first)]}
        assert not list(complete.glob(".*.part"))
        finish(record, loaded)
    assert result_files(complete) == before


def test_a_folder_in_place_of_fit_json_is_reported(complete: Path) -> None:
    (complete / "fit.json").unlink()
    (complete / "fit.json").mkdir()
    done = gonio("report", complete)
    assert done.returncode == 3
    assert f"gonio report {complete}" in done.stderr
    assert "Traceback" not in done.stderr
    (complete / "fit.json").rmdir()
    assert gonio("report", complete).returncode == 0
    assert json.loads((complete / "fit.json").read_text())["verdict"]


def test_a_fault_from_the_environment_stops_the_scan_and_resume_completes_it(
    complete: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    protocol, folder = complete.parent / "small.yaml", tmp_path / "run"
    monkeypatch.setenv(VARIABLE, "theta_r stalls at theta_r.wait 5")
    done = gonio("run", protocol, "--out", folder)
    assert done.returncode == 3
    assert "theta_r: stalled at" in done.stderr
    assert f"gonio resume {folder}" in done.stderr
    monkeypatch.delenv(VARIABLE)
    assert gonio("resume", folder, "--yes").returncode == 0
    old, new = ((f / "measurements.csv").read_text() for f in (complete, folder))
    assert without_dates(new) == without_dates(old)


def without_dates(table: str) -> list[list[str]]:
    rows = [line.split(",") for line in table.splitlines()]
    date = rows[0].index("time_utc")
    return [row[:date] + row[date + 1 :] for row in rows]
