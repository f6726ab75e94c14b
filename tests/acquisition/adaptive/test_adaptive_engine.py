"""Engine with a plan that grows: resumed after any stop it measures the same, to the last digit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from acquisition.adaptive.candidate_list import candidate_list, with_goal
from acquisition.adaptive.chooser import Chooser
from acquisition.adaptive.course import chooser_of, chosen_while_measured
from acquisition.plan.plan import make_plan
from acquisition.results.run_folder import run_meta
from instrument.config.load import Loaded
from instrument.config.protocol import FitConfig
from instrument.record.reading import Batch, Reading, batches_of
from instrument.record.record import Record
from tests.support.scans import changed, shortest_scan, undated
from tests.support.whole_scans.stopped_scan import scan

VIEWS = [-70.0, -45.0, -20.0, 20.0, 45.0, 70.0]


@pytest.fixture(scope="module")
def listed() -> Loaded:
    """A matt sample at two incidences: 22 candidates, drift checks after each two."""
    loaded = shortest_scan()
    (sweep,) = loaded.protocol.sweeps
    fit = FitConfig(models=["lambert", "minnaert"])
    wide = changed(loaded, sweeps=[{**sweep, "theta_r_deg": VIEWS}], fit=fit)
    return candidate_list(with_goal(wide, "albedo=0.02", None))


@pytest.fixture(scope="module")
def chooser(listed: Loaded) -> Chooser:
    return chooser_of(listed, make_plan(listed))


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
    last = [batch.steps[-1] for batch in batches][1]  # between two batches, too
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
