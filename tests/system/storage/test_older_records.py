"""Runs of earlier versions of the program resume and report with unchanged values."""

from __future__ import annotations

import csv
import json
import shutil
from pathlib import Path

import pytest

from instrument.record.record import Record
from tests.support.command import gonio_here as gonio
from tests.support.storage.older_records import as_version
from tests.support.strangers.run_folders import Sent, run_few_points


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return run_few_points(tmp_path_factory.mktemp("run"))


def results(run: Path) -> tuple[list[list[str]], object]:
    """measurements.csv without dates, and fit.json."""
    with (run / "measurements.csv").open(newline="") as file:
        rows = list(csv.reader(file))
    dated = rows[0].index("time_utc")
    return [row[:dated] + row[dated + 1 :] for row in rows], json.loads(
        (run / "fit.json").read_text()
    )


@pytest.mark.parametrize(
    ("command", "version"),
    [(("report",), 3), (("resume", "--yes"), 3), (("resume", "--yes"), 5), (("report",), 6)],
)
def test_a_run_of_an_older_version_gives_the_same_results(
    run: Path, tmp_path: Path, command: tuple[str, ...], version: int
) -> None:
    old = tmp_path / "old"
    shutil.copytree(run, old)
    as_version(old, version)
    if command[0] == "resume":
        tables = ("reading", "preview", "frame")
        Sent(old, old).sql(*(f"DELETE FROM {table} WHERE step >= 7" for table in tables))
    for name in ("measurements.csv", "fit.json", "report.html"):
        (old / name).unlink()
    done = gonio(command[0], old, *command[1:])
    assert done.returncode == 0, done.stderr
    assert results(old) == results(run)
    with Record.open(old) as record, Record.open(run) as whole:
        assert record.meta("schema_version") == str(version)
        assert whole.meta("schema_version") == "8"
        assert len(record.readings()) == len(whole.readings()) > 7
