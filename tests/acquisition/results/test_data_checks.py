"""Checks of the data in a run: what a bench does wrong stands in fit.json and in the notes."""

from __future__ import annotations

from pathlib import Path

from acquisition.results.finish import finish
from instrument.config.protocol import FitConfig
from instrument.record.record import Record
from tests.support.scans import changed, small_scan
from tests.support.white_tiles import SPECTRALON, with_tile
from tests.support.whole_scans.world_attacks import scanned


def test_a_tile_that_is_not_matt_breaks_reciprocity(tmp_path: Path) -> None:
    """A PTFE tile given as one number: the note names its error at each incidence.

    Seen at 10 degrees, `SPECTRALON` has the radiance factors 1.0286, 0.9984 and 0.9590 at 30, 45
    and 60 degrees.
    """
    views = [-75.0, -60.0, -45.0, -30.0, 0.0, 30.0, 45.0, 60.0, 75.0]
    sweep = {"theta_i_deg": [30.0, 45.0, 60.0], "dphi_deg": [0.0], "theta_r_deg": views}
    loaded = changed(small_scan(), sweeps=[sweep], fit=FitConfig(models=["oren_nayar"]))
    loaded = with_tile(loaded, loaded.protocol.references.white_tile, SPECTRALON)
    assert scanned(loaded, tmp_path / "run").error is None
    with Record.open(tmp_path / "run") as record:
        outcome = finish(record, loaded)
    (text,) = [n["text"] for n in outcome.fit["notes"] if n["code"] == "not_reciprocal"]
    assert "(1 at 30, 1.03 at 45, 1.07" in text
    assert "a white tile that is not matt" in text
    assert text in outcome.notes
    assert "reciprocity (Helmholtz) is broken" in outcome.report.read_text()
