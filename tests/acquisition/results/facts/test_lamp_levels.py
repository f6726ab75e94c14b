"""Level of the lamp in a report: that by which the readings are corrected."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.measure.drift import Drift
from acquisition.results.facts.lamp_levels import lamp_levels
from instrument.record.reading import Check, Reading
from tests.support.storage.sample_records import reading


def checks(rng: np.random.Generator, block: int, start_s: float) -> list[Reading]:
    """Drift checks at random times, of a lamp that wanders."""
    times = start_s + np.sort(rng.uniform(0.0, 100.0, 6))
    return [
        reading(n, kind="drift", block=block, time_s=t, signal_dn=s, u_noise_dn=1.0, flags="")
        for n, (t, s) in enumerate(zip(times.tolist(), rng.uniform(900.0, 1100.0, 6).tolist(),
                                       strict=True))
    ]  # fmt: skip


@pytest.mark.parametrize("jumps", [False, True])
@pytest.mark.parametrize("seed", range(4))
def test_the_lines_shown_are_the_correction(seed: int, jumps: bool) -> None:
    """Between two checks of one stretch, at any time; times begin at the first reading."""
    rng = np.random.default_rng(seed)
    readings = [r for block in (0, 1) for r in checks(rng, block, 200.0 * block)]
    first = min(r.time_s for r in readings)
    jump = [Check(before_step=3, expected=1.0, u_expected=0.1, jumped=True,
                  reading=reading(3, block=0, time_s=readings[2].time_s + 1e-3, signal_dn=500.0,
                                  u_noise_dn=1.0, flags=""))] if jumps else []  # fmt: skip
    drifts = {block: Drift.of(readings, block, jump) for block in (0, 1, 2)}
    shown = lamp_levels(drifts, readings)
    assert len(shown) == 2  # block 2 has no check
    assert len(set(shown[0].stretch.tolist())) == 1 + jumps
    assert shown[0].time_s[0] == 0.0
    for drift, one in zip(drifts.values(), shown, strict=False):
        for stretch in set(one.stretch.tolist()):
            own = one.stretch == stretch
            at = rng.uniform(one.time_s[own][0] + 1e-9, one.time_s[own][-1], 5)
            line = np.interp(at, one.time_s[own], one.level[own])
            used = [drift.at(first + t) for t in at.tolist()]
            np.testing.assert_allclose(line, used, rtol=1e-9)
