"""The stated uncertainty holds: deviations from the truth have its size, over drawn errors."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from instrument.config.simulated.sample import SimulatedSample
from tests.support.whole_scans.coverage_scans import (
    Deviations,
    by_band,
    by_parameter,
    deviations,
    drawn_scan,
    measured,
)

SAMPLES = {
    "matt": ("oren_nayar", {"sigma_deg": 30.0}),
    "gloss": ("oren_nayar+torrance_sparrow", {"sigma_deg": 20.0, "ks": 0.076}),
    "ggx": ("lambert+ggx", {"f0": 0.04, "alpha": 0.3}),
}
CASES = [("ggx", 0.3), *((kind, a) for kind in ("matt", "gloss") for a in (0.03, 0.3, 0.9))]


def _deviations(
    rig: str, kind: str, albedo: float, draws: int, shrink: int, folder: Path
) -> list[Deviations]:
    model, values = SAMPLES[kind]
    sample = SimulatedSample(model=model, parameters={**values, "albedo": albedo}, mottling=0.02)
    scans = [drawn_scan(rig, sample, n, draws, shrink=shrink) for n in range(draws)]
    return [deviations(measured(s, folder / str(n)), s.loaded) for n, s in enumerate(scans)]


@pytest.mark.slow
@pytest.mark.parametrize("rig", ["bench_12bit", "paper_1995"])
@pytest.mark.parametrize(("kind", "albedo"), CASES)
def test_deviations_have_the_size_of_the_stated_uncertainty(
    rig: str,
    kind: str,
    albedo: float,
    slow: bool,
    tmp_path: Path,
    record_property: Callable[[str, object], None],
) -> None:
    """Root mean square of (value - truth) / u in each band of view angle and of each parameter.

    The points of a scan share most errors, so that a scan counts as about one draw: the limits are
    1 +- 3 / sqrt(2 draws). Without --slow: one case, few draws, small pictures.
    `--junitxml` shows the figures.
    """
    if not slow and (kind, albedo, rig) != ("matt", 0.03, "paper_1995"):
        pytest.skip("with --slow")
    draws, shrink = (60, 1) if slow else (2, 3)
    found = _deviations(rig, kind, albedo, draws, shrink, tmp_path)
    wrong = []
    for name, own in {**by_band(found), **by_parameter(found)}.items():
        rms, covered = float(np.sqrt(np.mean(own**2))), float(np.mean(np.abs(own) < 1.96))
        record_property(name, f"rms {rms:.2f} u, within 1.96 u {covered:.0%}")
        if not abs(rms - 1) < 3 / np.sqrt(2 * draws):
            wrong.append((name, rms, covered))
    assert not wrong
