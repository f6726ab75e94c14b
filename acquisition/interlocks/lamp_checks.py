"""Drift checks: the lamp shines as earlier checks predict, or what was measured since is in doubt.

A lamp that warms up drifts steadily, and the prediction follows it. A lamp that jumps or goes out
does so at an unknown time after the last good check: every reading since then is doubtful.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

from acquisition.measure.drift import JUMP_U, MIN_JUMP, Drift, is_misplaced, is_usable, rate
from instrument.record.reading import Check, Reading

UNPROVEN = "lamp failed at the next reference"
"""Flag of a reading between a good drift check and one that is unusable or has jumped.

Where the tile shows that the lamp stands at a wrong angle, all readings of that block have it.
"""


STOPPED = "interlock"  # flag of a check that has no value: an interlock ended the scan


def compared(
    repeated: Reading, readings: Sequence[Reading], checks: Sequence[Check], before_step: int
) -> Check:
    """Compare a drift check with the rate predicted from earlier ones; the first has none.

    `before_step`: the first step of the plan after it.
    """
    drift = Drift.of(readings, repeated.block, checks)
    expected, u_relative = rate(repeated), 0.0
    if drift.segments:
        expected, u_relative = drift.predicted_rate(repeated.time_s)
    u = math.hypot(u_relative * expected, repeated.u_noise_dn / repeated.exposure_s)
    deviation = abs(rate(repeated) - expected)
    jumped = is_usable(repeated) and deviation > max(JUMP_U * u, MIN_JUMP * expected)
    return Check(
        before_step=before_step, expected=expected, u_expected=u, jumped=jumped, reading=repeated
    )


def failed(check: Check) -> bool:
    """Return True for a drift check that is unusable or has jumped, or a tile reading as a check.

    One of the tile is recorded only where it contradicts the lamp's angle.
    """
    return check.jumped or _is_bad(check.reading) or check.reading.kind == "tile"


def _is_bad(reading: Reading) -> bool:
    return not is_usable(reading) and not is_misplaced(reading)


def stopped_check(last: Reading, time_s: float) -> Check:
    """Return the check, without a value, that stands for an interlock in mid-scan.

    Whatever it saw may have begun at any time since the last good drift check. `last`: a reading of
    the block.
    """
    unknown = replace(
        last, kind="drift", signal_dn=math.nan, peak_dn=math.nan, time_s=time_s, free_s=time_s,
        flags=STOPPED,
    )  # fmt: skip
    return Check(before_step=last.step, expected=0.0, u_expected=0.0, jumped=False, reading=unknown)


def check_text(check: Check) -> str:
    """Return the outcome of a drift check in words."""
    text = (
        f"drift reference: {rate(check.reading):.5g} DN/s, {check.expected:.5g} expected "
        f"(u {check.u_expected:.2g})"
    )
    if check.jumped:
        return f"{text}: the lamp has jumped"
    if not is_usable(check.reading):
        return f"{text}: not usable ({check.reading.flags or 'too little signal'})"
    return f"{text}: as before"


def doubtful_steps(readings: Iterable[Reading], checks: Iterable[Check]) -> frozenset[int]:
    """Return the steps of readings that a failed check leaves without a proof of the lamp.

    They lie between a good drift check and the failed one; drift checks themselves are doubtful
    only where the lamp's angle was wrong.
    """
    spans: dict[int, list[tuple[float, float]]] = {}
    own, wrong_until_s = list(readings), dict[int, float]()
    for block in {reading.block for reading in own}:
        made = [
            (r.time_s, not _is_bad(r), is_usable(r), False) for r in own if _is_check_of(r, block)
        ]
        made += [
            (c.reading.time_s, not failed(c), is_usable(c.reading), c.reading.flags == STOPPED)
            for c in checks
            if c.reading.block == block
        ]
        angles = [c for c in checks if c.reading.kind == "tile" and c.reading.block == block]
        wrong_until_s[block] = max((c.reading.time_s for c in angles), default=-math.inf)
        spans[block] = _doubtful_spans(sorted(made))
    return frozenset(
        r.step
        for r in own
        if r.time_s <= wrong_until_s[r.block]
        or (r.kind != "drift" and any(low < r.time_s <= high for low, high in spans[r.block]))
    )


def _is_check_of(reading: Reading, block: int) -> bool:
    return reading.kind == "drift" and reading.block == block


def _doubtful_spans(made: Iterable[tuple[float, bool, bool, bool]]) -> list[tuple[float, float]]:
    """Return spans of scan time before failed checks.

    `made`: time of each check, in order; whether it confirms what came before it; whether what
    comes after it may be compared with it; whether another interlock ended the scan then, which
    says nothing about a block without drift checks.
    """
    spans, good_s = [], -math.inf
    for time_s, confirms, begins, stopped in made:
        if not confirms and not (stopped and good_s == -math.inf):
            spans.append((good_s, time_s))
        if begins:
            good_s = time_s
    return spans
