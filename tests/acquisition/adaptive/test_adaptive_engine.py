"""Engine with a plan that grows: resumed after any stop it measures the same, to the last digit."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from acquisition.adaptive.chooser import Chooser
from acquisition.adaptive.course import chooser_of, chosen_while_measured
from acquisition.plan.plan import make_plan
from acquisition.results.run_folder import run_meta
from instrument.record.reading import Batch, Reading, batches_of
from instrument.record.record import Record
from tests.support.adaptive.short_list import short_list
from tests.support.scans import undated
from tests.support.storage.killer_process import run_scan_killer
from tests.support.whole_scans.stopped_scan import scan


@pytest.fixture(scope="module")
def chooser() -> Chooser:
    loaded = short_list()
    return chooser_of(loaded, make_plan(loaded))


def _scan(chooser: Chooser, record: Record, upto: int | None = None) -> None:
    scan(chooser.layout.loaded, record, upto, plan=chosen_while_measured(chooser, record))


def _result(record: Record) -> tuple[list[Batch], list[Reading]]:
    return batches_of(record.events()), undated(record.readings())


def _new(chooser: Chooser, folder: Path) -> Record:
    return Record.create(folder, run_meta(chooser.layout.loaded, chooser.layout.plan))


def test_after_stops_at_random_steps_choices_and_readings_are_the_same(
    chooser: Chooser, tmp_path: Path
) -> None:
    with _new(chooser, tmp_path / "unbroken") as record:
        _scan(chooser, record)
        batches, readings = _result(record)
    assert batches[-1].end.startswith("the goal is reached")
    steps = [index for batch in batches for index in batch.steps]
    assert sorted(steps) == [reading.step for reading in readings]
    frames = {s: n for batch in batches for s, n in zip(batch.steps, batch.frames, strict=True)}
    assert {reading.step: reading.frames for reading in readings} == frames
    assert len(readings) < len(chooser.layout.plan.steps)
    stops = np.random.default_rng(3).choice(len(steps) - 1, 3, replace=False)
    last = batches[1].steps[-1]  # between two batches, too
    with _new(chooser, tmp_path / "stopped") as record:
        for place in sorted({*stops.tolist(), steps.index(last)}):
            _scan(chooser, record, steps[place])
        _scan(chooser, record)
        again, resumed = _result(record)
        assert not any(check.jumped for check in record.checks())
    assert [(b.steps, b.reasons, b.end) for b in again] == [
        (b.steps, b.reasons, b.end) for b in batches
    ]
    assert resumed == readings


def test_a_complete_scan_measures_nothing_more(chooser: Chooser, tmp_path: Path) -> None:
    with _new(chooser, tmp_path / "run") as record:
        _scan(chooser, record)
        before = len(record.readings())
        plan = chosen_while_measured(chooser, record)
        assert not plan.growing
        assert plan.more() == ()
        assert len(plan.known) == before


@pytest.mark.slow
def test_killed_at_random_moments_a_scan_goes_on_with_the_same_choices_and_readings(
    tmp_path: Path, slow: bool, record_testsuite_property: Callable[[str, object], None]
) -> None:
    """With SIGKILL, while it measures and while it chooses."""
    kills, killer = 300 if slow else 4, "tests.support.adaptive.adaptive_killer"
    outcome = json.loads(run_scan_killer([tmp_path, kills, 21], {}, 1800, killer))
    record_testsuite_property("kills of adaptive scans", outcome)
    assert outcome["kills"] >= kills
    assert outcome["accepted_before"] > kills  # scans were under way
    counted = {"kills", "killed_twice", "accepted_before"}
    assert not any(value for name, value in outcome.items() if name not in counted), outcome
