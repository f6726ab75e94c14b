"""`gonio run`, `plan`, `resume` and `report`, called in the test's own process."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.support.command import gonio_here as gonio
from tests.support.scans import small_demo


def test_a_ctrl_c_after_the_scan_loses_nothing_and_names_the_command_that_reports(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    folder = tmp_path / "run"
    with monkeypatch.context() as while_fitting:
        while_fitting.setattr("acquisition.results.finish.fit_run", interrupted)
        stopped = gonio("run", small_demo(tmp_path), "--out", folder)
    assert stopped.returncode == 4
    assert re.search(r"Nothing measured is lost: 2\d readings are safe in", stopped.stderr)
    assert f"gonio report {folder}" in stopped.stderr
    assert not (folder / "fit.json").exists()
    assert gonio("report", folder).returncode == 0
    assert (folder / "fit.json").exists()
