"""Light at a point: a point without signal counts only if the lamp is seen to shine after it.

A lamp that has gone out and a sample that is black from there look alike. A later reading of the
same setting of the lamp that is bright, or a later drift check, tells them apart.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

from acquisition.measure.drift import is_usable
from instrument.record.reading import Reading

NO_SIGNAL = "no signal"
LEAST_SIGNAL_U = 5.0
"""Signal in u that is light without a doubt: of 50 points in the dark, 3 u would pass one in 15."""


def is_dark(reading: Reading) -> bool:
    """Return True for a signal that may be none; an unknown one is flagged for another reason."""
    return reading.signal_dn <= LEAST_SIGNAL_U * reading.u_light_dn


def unlit_steps(readings: Iterable[Reading]) -> frozenset[int]:
    """Return the steps of dark points after which no reading proves that there was light."""
    own = list(readings)
    lit_s: dict[tuple[str, int], float] = {}
    for reading in own:
        proofs = [("setting", reading.lamp_setting)] if not is_dark(reading) else []
        if reading.kind == "drift" and is_usable(reading):
            proofs.append(("block", reading.block))
        for proof in proofs:
            lit_s[proof] = max(lit_s.get(proof, -math.inf), reading.time_s)
    return frozenset(
        r.step
        for r in own
        if r.kind == "point" and (r.signal_dn == 0 or (is_dark(r) and not _proven(r, lit_s)))
    )


def _proven(reading: Reading, lit_s: dict[tuple[str, int], float]) -> bool:
    proofs = ("setting", reading.lamp_setting), ("block", reading.block)
    return any(lit_s.get(proof, -math.inf) > reading.time_s for proof in proofs)
