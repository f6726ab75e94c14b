"""Samples that no candidate model describes: an adaptive scan finds so, or the difference is told.

Measured with six samples of each kind, for a u of sigma that a dozen points give. The sweep of 5
degrees finds all 18; the adaptive scan 6 retro peaks, 6 of another family, 4 narrow lobes: it
misses one where it ends after a dozen points, none of which met it. Without --slow the sweep has
steps of 10 degrees.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.support.adaptive.against_sweep import five_degrees, ten_degrees
from tests.support.adaptive.surprises import KINDS, Kind, found

SAMPLES = 6


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_what_no_model_has_is_found(
    kind: Kind, tmp_path: Path, slow: bool, record_testsuite_property: Callable[[str, object], None]
) -> None:
    if not slow and kind != "retro peak":
        pytest.skip("takes seconds: with --slow")
    seeds = range(SAMPLES if slow else 1)
    plain = five_degrees() if slow else ten_degrees(five_degrees())
    outcomes = [found(kind, seed, tmp_path / str(seed), plain) for seed in seeds]
    by_sweep, adaptive = (sum(one[k] for one in outcomes) for k in (0, 1))
    parts = [round(one[2], 2) for one in outcomes]
    text = f"{adaptive} of {len(outcomes)}, by the sweep {by_sweep}; points {parts} of the sweep's"
    record_testsuite_property(f"found: {kind}", text)
    assert by_sweep == len(outcomes)
    assert adaptive >= (len(outcomes) / 3 if kind == "narrow lobe" else by_sweep)
