"""Samples that no candidate model describes: an adaptive scan finds so, or the difference is told.

Measured for a u of sigma that a dozen points give. The sweep of 5 degrees finds all; the adaptive
scan all retro peaks and those of another family, 6 of 6 each, and 4 of 6 narrow lobes: it misses
one where it ends after a dozen points, none of which met it. In the time of a sweep of 10 degrees
it finds 5 of 6 retro peaks.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.support.adaptive.against_sweep import five_degrees
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
    outcomes = [found(kind, seed, tmp_path / str(seed), five_degrees()) for seed in seeds]
    by_sweep, adaptive = (sum(one[k] for one in outcomes) for k in (0, 1))
    parts = [round(one[2], 2) for one in outcomes]
    text = f"{adaptive} of {len(outcomes)}, by the sweep {by_sweep}; points {parts} of the sweep's"
    record_testsuite_property(f"found: {kind}", text)
    assert by_sweep == len(outcomes)
    assert adaptive >= (len(outcomes) / 3 if kind == "narrow lobe" else by_sweep)
