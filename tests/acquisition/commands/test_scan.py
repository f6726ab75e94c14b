"""`gonio run`, `plan`, `resume` and `report`, called in the test's own process."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from acquisition.commands import scan
from instrument.record.record import Record
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


def test_permission_to_move_is_asked_with_the_reason_of_the_stop_and_recorded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []
    monkeypatch.setattr(scan, "require_yes", lambda question, *_: asked.append(question))
    with Record.create(tmp_path / "run", {}) as record:
        record.add_event("2026", "fault", "theta_r: stalled at 12 deg")
        scan._confirm(False, 9, record)
        scan._confirm(True, 9, record)
        said = [text for _, kind, text in record.events() if kind == "resumed"]
    assert len(asked) == 1
    assert "The scan ended with: theta_r: stalled at 12 deg" in asked[0]
    assert "9 readings are missing. Is the rig clear" in asked[0]
    assert said == [
        "the rig may move: yes, asked at the terminal",
        "the rig may move: --yes",
    ]
