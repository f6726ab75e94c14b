"""Readings of a scan whose sample's plate lies beside its place, with and without markers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from instrument.config.load import Loaded
from instrument.geometry import FloatArray
from instrument.record.event_kinds import PLATE
from instrument.record.record import Record
from tests.support.plates import MARKERS, with_plate
from tests.support.scans import changed, small_scan
from tests.support.whole_scans.stopped_scan import scan

SIZE_MM = 2.4  # of the pattern, of which the window averages little


@pytest.fixture(scope="module")
def mottled() -> Loaded:
    """A small window on a sample whose albedo varies by a fifth from place to place."""
    loaded = small_scan(shrink=1)
    (sweep,), sample = loaded.protocol.sweeps, loaded.protocol.simulated_sample
    assert sample is not None
    flat = {"model": "lambert", "parameters": {"albedo": 0.5}}
    pattern = {"mottling": 0.2, "mottling_size_mm": SIZE_MM}
    window = loaded.protocol.window.model_copy(update={"width_mm": 4.0, "height_mm": 4.0})
    return changed(
        loaded,
        sweeps=[{**sweep, "theta_i_deg": [40.0], "theta_r_deg": [-65.0, -20.0, 10.0, 60.0]}],
        simulated_sample=sample.model_copy(update={**flat, **pattern}),
        window=window,
        sample=loaded.protocol.sample.model_copy(update={"outline": "none"}),
        frames_per_point=1,
    )


def measured(loaded: Loaded, folder: Path) -> tuple[FloatArray, list[str]]:
    """Counts a second of the points, and what was said about the plate."""
    with Record.create(folder, {}) as record:
        scan(loaded, record)
        points = [r for r in record.readings() if r.kind == "point"]
        said = [text for _, kind, text in record.events() if kind == PLATE]
    return np.array([r.signal_dn / r.exposure_s for r in points]), said


def test_the_window_follows_the_plate_so_that_the_same_area_counts(
    mottled: Loaded, tmp_path: Path
) -> None:
    """A plate 1.5 mm beside its place gives the values of one in its place, if it has markers."""
    right, _ = measured(with_plate(mottled, 0.0, 0.0, 0.0), tmp_path / "right")
    beside = with_plate(mottled, 1.5, -1.2, 1.0)
    followed, said = measured(beside, tmp_path / "followed")
    blind, nothing = measured(changed(beside, markers=None), tmp_path / "blind")
    assert np.abs(followed / right - 1).max() < 0.01
    assert np.abs(blind / right - 1).max() > 0.04
    assert len(said) == 1
    assert "4 of 4 seen" in said[0]
    assert "x +1.5" in said[0]
    assert "y -1.2" in said[0]
    assert not nothing


def test_markers_that_are_never_seen_are_named_once(
    mottled: Loaded, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """The plate has none; the values are those of a scan without markers."""
    beside = with_plate(mottled, 1.5, -1.2, 0.0)
    blind, _ = measured(changed(beside, markers=None), tmp_path / "blind")
    elsewhere = MARKERS.model_copy(update={"centres_mm": [[0.0, 200.0]]})
    unseen, said = measured(changed(beside, markers=elsewhere), tmp_path / "unseen")
    assert unseen == pytest.approx(blind)
    assert len(said) == 1
    assert "none of 1 seen at theta_r" in said[0]
    assert "look at size_mm and centres_mm" in caplog.text
