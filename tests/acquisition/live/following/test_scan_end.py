"""State of a scan: what the page says, for each way in which a scan can stand or have ended."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from acquisition.live.following.scan_end import ScanState, scan_state
from instrument.record.event_kinds import FAULT, FINISHED, INTERLOCK, RESUMED, STOPPED
from instrument.record.folder_lock import FolderLock

NOBODY = SimpleNamespace(state=None, answers=False, silent=False)
SILENT = SimpleNamespace(state=None, answers=False, silent=True)
JUST_ASKED = SimpleNamespace(state=None, answers=True, silent=False)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path


@pytest.fixture
def locked(folder: Path) -> Iterator[Path]:
    with FolderLock(folder):
        yield folder


def said(scan: Any, kinds: list[str], folder: Path | None, *, complete: bool = False) -> ScanState:
    events = [("", kind, f"why {kind}.") for kind in kinds]
    return scan_state(scan, events, folder, complete=complete)


def test_who_answers_says_how_it_stands(locked: Path) -> None:
    for phase in ("measuring", "pausing", "paused", "operator"):
        scan = SimpleNamespace(state={"phase": phase, "text": "so"}, answers=True, silent=False)
        found = said(scan, [STOPPED, RESUMED], locked)
        assert (found.state, found.text) == (phase, "so")
        assert found.actions[-1] == "abort"
    ending = SimpleNamespace(state={"phase": "ending", "text": "so"}, answers=True, silent=False)
    assert said(ending, [], locked) == ScanState("measuring", "so", ())
    assert said(JUST_ASKED, [], locked).state == "measuring"


def test_a_scan_without_a_channel_is_measured_without_actions(locked: Path) -> None:
    assert said(NOBODY, [RESUMED], locked) == ScanState("measuring", "", ())


def test_a_scan_that_holds_its_run_and_does_not_answer_is_lost(locked: Path) -> None:
    found = said(SILENT, [], locked)
    assert found.state == "lost"
    assert "does not answer" in found.text


@pytest.mark.parametrize(
    ("kinds", "state", "why"),
    [
        ([STOPPED], "stopped", "why stopped. Go on with: gonio resume"),
        ([INTERLOCK, FAULT], "failed", "why fault. Go on with: gonio resume"),
        ([STOPPED, RESUMED], "lost", "ended without a word"),
        ([], "lost", "ended without a word"),
        ([STOPPED, RESUMED, FAULT, RESUMED, STOPPED], "stopped", "why stopped"),
        ([FINISHED], "finished", "readings were damaged on the disk since"),
    ],
)
@pytest.mark.parametrize("scan", [NOBODY, SILENT])
def test_the_record_says_how_a_scan_ended(
    folder: Path, scan: Any, kinds: list[str], state: str, why: str
) -> None:
    found = said(scan, kinds, folder)
    assert found.state == state
    assert why in found.text
    assert str(folder) in found.text
    assert found.actions == ()


def test_a_complete_run_is_finished_whoever_still_holds_it(locked: Path) -> None:
    ending = SimpleNamespace(state={"phase": "ending", "text": "so"}, answers=True, silent=False)
    for scan in (NOBODY, SILENT, ending):
        assert said(scan, [RESUMED, FINISHED], locked, complete=True).state == "finished"
    assert said(NOBODY, [FINISHED], None, complete=True).state == "finished"


def test_a_removed_run_is_lost(folder: Path) -> None:
    assert said(NOBODY, [STOPPED], None).state == "lost"
