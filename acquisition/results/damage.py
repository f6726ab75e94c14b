"""Damage to a run's record in words: which rows no longer hold what was written."""

from __future__ import annotations

from instrument.record.record import Record

_MOST_NAMED = 10


def damage_text(record: Record) -> str:
    """Return which rows of the record are damaged and left out; empty if none is."""
    rows = record.damaged()
    if not rows:
        return ""
    more = f" and {len(rows) - _MOST_NAMED} more" if len(rows) > _MOST_NAMED else ""
    return (
        f"damaged on the disk since they were written, and left out: "
        f"{', '.join(rows[:_MOST_NAMED])}{more}"
    )
