"""Readings that a later picture puts in doubt: the fault may have begun before it was seen.

They are named in an event of the record. Until a resume has measured them again they are flagged.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from instrument.record.event_kinds import INTERLOCK
from instrument.record.reading import Reading

DOUBTED = "not at its place in the next picture"
"""Flag of a reading that a later picture puts in doubt."""

_TEXT = re.compile(r"until (\S+) s of the scan, the readings of steps ([\d ]+) are in doubt")


def doubt_text(steps: Sequence[int], scan_s: float) -> str:
    """Return the event that puts the readings of these steps in doubt, if made until scan_s."""
    numbers = " ".join(map(str, sorted(steps)))
    return f"until {scan_s:.3f} s of the scan, the readings of steps {numbers} are in doubt"


def doubted_steps(
    readings: Iterable[Reading], events: Iterable[tuple[str, str, str]]
) -> frozenset[int]:
    """Return the steps in doubt that were not measured again; `events`: time, kind and text."""
    until_s: dict[int, float] = {}
    for _, kind, text in events:
        if kind == INTERLOCK and (found := _TEXT.fullmatch(text)):
            until_s |= dict.fromkeys(map(int, found[2].split()), float(found[1]))
    return frozenset(r.step for r in readings if r.time_s <= until_s.get(r.step, -1.0))
