"""Drift of the lamp: levels and interpolation between the checks of a block."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from acquisition.measure.drift import Drift, rate
from instrument.record.record import Record
from tests.support.scans import small_scan
from tests.support.stopped_scan import scan


def test_levels_are_those_of_the_checks(tmp_path: Path) -> None:
    small = small_scan("paper_1995")  # a lamp set by hand: two blocks, each with its checks
    with Record.create(tmp_path / "run", {}) as record:
        scan(small, record, upto=4)
        scan(small, record)
        readings = record.readings()
    made = [r for r in readings if r.kind == "drift" and r.block == 1]
    drift = Drift.of(readings, 1)
    times_s = np.array([r.time_s for r in made])
    middle_s = (times_s[:-1] + times_s[1:]) / 2
    before, share = drift.interpolation(np.concatenate([times_s, middle_s]))
    assert before.tolist() == [0, 1, 2, 0, 1]
    assert share == pytest.approx([0, 0, 0, 0.5, 0.5])
    level = [rate(r) / rate(made[0]) for r in made]
    assert drift.at(float(middle_s[0])) == pytest.approx((level[0] + level[1]) / 2)
