"""Level of the lamp at the drift checks of a run, as its report shows it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from acquisition.measure.drift import Drift
from analysis.report.data import LampLevels
from instrument.record.reading import Reading


def lamp_levels(drifts: Mapping[int, Drift], readings: Sequence[Reading]) -> tuple[LampLevels, ...]:
    """Return the levels of each block (its number: its drift) that has a usable check.

    Times begin at the first reading.
    """
    start_s = min((r.time_s for r in readings), default=0.0)
    checks = {r.block: r for r in readings[::-1] if r.kind == "drift"}  # the first of each block
    return tuple(
        LampLevels(
            theta_i_deg=checks[block].theta_i_deg,
            theta_r_deg=checks[block].theta_r_deg,
            time_s=np.concatenate([s.times_s for s in drift.segments]) - start_s,
            level=drift.level,
            u=drift.level * drift.u_relative,
            stretch=np.repeat(range(len(drift.segments)), [s.level.size for s in drift.segments]),
        )
        for block, drift in drifts.items()
        if drift.segments
    )
