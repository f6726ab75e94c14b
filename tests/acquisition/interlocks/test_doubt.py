"""Doubt: readings before a contradiction are flagged, and measured again by a resume."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from acquisition.interlocks.doubt import DOUBTED, doubt_text, doubted_steps
from acquisition.results.reduction import reduced_run
from instrument.config.load import Loaded
from instrument.errors import Interlock
from instrument.record.event_kinds import INTERLOCK, OPERATOR
from instrument.record.reading import Reading
from instrument.record.record import Record
from sim.scene.scene import Scene
from tests.support.scans import small_scan
from tests.support.whole_scans.stopped_scan import scan


def test_readings_are_in_doubt_until_they_are_measured_again(whole: list[Reading]) -> None:
    events = [("", INTERLOCK, doubt_text([5, 2], whole[5].time_s))]
    assert doubted_steps(whole, events) == {2, 5}
    again = [replace(r, time_s=r.time_s + 1000 * (r.step == 2)) for r in whole]
    assert doubted_steps(again, events) == {5}
    assert doubted_steps(whole, [("", OPERATOR, events[0][2]), ("", INTERLOCK, "other")]) == set()


@pytest.fixture
def sparse() -> Loaded:
    return small_scan(shrink=2)


def test_a_resume_measures_again_what_a_slip_may_have_spoilt(
    sparse: Loaded, record: Record, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The stage has slipped from the beginning, which is seen at the first oblique angle only."""
    true = Scene.set_axis

    def slipped(scene: Scene, axis: str, angle_deg: float) -> None:
        true(scene, axis, angle_deg + 4.0 * (axis == "theta_r"))

    with monkeypatch.context() as patch:
        patch.setattr(Scene, "set_axis", slipped)
        with pytest.raises(Interlock, match="that of theta_r"):
            scan(sparse, record)
    spoilt = {r.step: r.signal_dn for r in record.readings()}
    assert doubted_steps(record.readings(), record.events()) == set(spoilt)
    scan(sparse, record)
    assert doubted_steps(record.readings(), record.events()) == set()
    assert all(DOUBTED not in flags for flags in reduced_run(record, sparse).flags)
    after = {r.step: r.signal_dn for r in record.readings()}
    assert np.all([after[step] != signal for step, signal in spoilt.items()])
