"""`gonio report`: printed to PDF by an installed Chromium, its figures as files, or refused."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from acquisition.commands.outcomes.pdf import BROWSERS
from tests.support.analysis.no_charts import leave_charts_out
from tests.support.command import finished_run
from tests.support.command import gonio_here as gonio
from tests.support.scans import TWO_MODELS, small_demo

pytestmark = pytest.mark.charts


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Its report has no charts: they are drawn when it is printed."""
    folder = tmp_path_factory.mktemp("printed")
    with pytest.MonkeyPatch.context() as patched:
        leave_charts_out(patched)
        return finished_run(small_demo(folder, TWO_MODELS), folder / "run")


@pytest.mark.skipif(not any(map(shutil.which, BROWSERS)), reason="no Chromium: install chromium")
def test_a_report_is_printed(run: Path) -> None:
    done = gonio("report", run, "--pdf")
    assert done.returncode == 0, done.stderr
    printed = (run / "report.pdf").read_bytes()
    assert printed.startswith(b"%PDF-")
    assert 1 <= printed.count(b"/Type /Page\n") <= 12
    assert str(run / "report.pdf") in done.stderr


def test_without_a_browser_nothing_is_written(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(run))
    before = (run / "report.html").stat().st_mtime_ns
    done = gonio("report", run, "--pdf")
    assert done.returncode == 2
    assert "chromium" in done.stderr
    assert (run / "report.html").stat().st_mtime_ns == before


def test_a_browser_that_fails_is_named(run: Path, tmp_path: Path) -> None:
    stand_in = tmp_path / "chromium"
    stand_in.write_text("#!/bin/sh\necho broken >&2\n")
    stand_in.chmod(0o755)
    with pytest.MonkeyPatch.context() as patched:
        leave_charts_out(patched)
        patched.setenv("PATH", str(tmp_path), prepend=":")
        done = gonio("report", run, "--pdf")
    assert done.returncode == 3
    assert "broken" in done.stderr
    assert (run / "report.html").is_file()


def test_figures_are_written_into_a_new_folder_only(run: Path, tmp_path: Path) -> None:
    folder = tmp_path / "figures"
    done = gonio("report", run, "--figures", folder)
    assert done.returncode == 0, done.stderr
    written = {file.name for file in folder.iterdir()}
    assert {"shape.svg", "brdf.svg", "polar.svg", "points.csv", "lines.csv"} <= written
    assert f"{len(written)} files" in done.stderr
    before = (run / "report.html").stat().st_mtime_ns
    (taken := tmp_path / "file").touch()
    for refused, why in (
        (folder, "is not empty"), (taken, "is no folder"), (tmp_path / "a" / "b", "make it first"),
    ):  # fmt: skip
        done = gonio("report", run, "--figures", refused)
        assert done.returncode == 2
        assert why in done.stderr
        assert str(refused) in done.stderr.replace("\n", "")
    assert (run / "report.html").stat().st_mtime_ns == before
