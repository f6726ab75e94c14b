"""A scan killed at any moment loses no accepted reading and resumes to the same result."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.support.storage.killer_process import run_scan_killer


def nothing_lost(outcome: dict[str, int]) -> bool:
    counted = {"kills", "killed_twice", "accepted_before"}
    return all(value == 0 for name, value in outcome.items() if name not in counted)


@pytest.mark.slow
def test_nothing_is_lost_or_changed_by_kills_at_random_moments(
    tmp_path: Path, slow: bool, record_testsuite_property: Callable[[str, object], None]
) -> None:
    kills = 1000 if slow else 10
    outcome = json.loads(run_scan_killer([tmp_path, kills, 2026], {}, 3600))
    record_testsuite_property("kills at random moments", outcome)
    assert outcome["kills"] >= kills
    assert outcome["accepted_before"] > kills  # scans were under way
    assert outcome["killed_twice"] > 0
    assert nothing_lost(outcome), outcome


@pytest.mark.slow
def test_nothing_is_lost_or_changed_by_kills_before_each_file_operation(
    recorder: dict[str, str],
    tmp_path: Path,
    slow: bool,
    record_testsuite_property: Callable[[str, object], None],
) -> None:
    """Each write, fsync, rename and removal of a scan, those of SQLite's log included."""
    stride = 1 if slow else 37
    environment = recorder | {"GONIO_RECORD_ROOT": str(tmp_path)}
    outcome = json.loads(run_scan_killer([tmp_path, "entries", stride], environment, 3600))
    record_testsuite_property("kills before each entry", outcome)
    assert outcome["kills"] > 200 / stride
    assert nothing_lost(outcome), outcome
