"""A scan that is killed, at any moment, loses no accepted point and goes on to the same result."""

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
def test_killed_at_any_moment_nothing_is_lost_twice_or_different(
    tmp_path: Path, slow: bool, record_testsuite_property: Callable[[str, object], None]
) -> None:
    kills = 1000 if slow else 25
    outcome = json.loads(run_scan_killer([tmp_path, kills, 2026], {}, 3600))
    record_testsuite_property("kills at random moments", outcome)
    assert outcome["kills"] >= kills
    assert outcome["accepted_before"] > kills  # they were well under way
    assert outcome["killed_twice"] > 0
    assert nothing_lost(outcome), outcome


@pytest.mark.slow
def test_killed_before_each_thing_that_it_writes_nothing_is_lost_twice_or_different(
    recorder: dict[str, str],
    tmp_path: Path,
    slow: bool,
    record_testsuite_property: Callable[[str, object], None],
) -> None:
    """Every write, fsync, new name and removal of a scan: the journal's boundaries among them."""
    stride = 1 if slow else 23
    environment = recorder | {"GONIO_RECORD_ROOT": str(tmp_path)}
    outcome = json.loads(run_scan_killer([tmp_path, "entries", stride], environment, 3600))
    record_testsuite_property("kills before each entry", outcome)
    assert outcome["kills"] > 200 / stride
    assert nothing_lost(outcome), outcome
