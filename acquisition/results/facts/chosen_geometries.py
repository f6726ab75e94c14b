"""Geometries that a scan chose while it ran: what each was measured for, and why it ended."""

from __future__ import annotations

from instrument.record.reading import batches_of
from instrument.record.record import Record


def reasons(record: Record) -> dict[int, str]:
    """Return what each step was measured for, by its number; empty for a scan that chose none."""
    batches = batches_of(record.events())
    return {
        step: why for batch in batches for step, why in zip(batch.steps, batch.reasons, strict=True)
    }


def choice_note(record: Record) -> str:
    """Return how many geometries were measured for what, and why no more; empty without a choice.

    The reasons that a scan gives are its own words: a record may come from anybody.
    """
    batches = batches_of(record.events())
    if not batches:
        return ""
    points = {reading.step for reading in record.readings() if reading.kind == "point"}
    own = [why for step, why in reasons(record).items() if step in points]
    kinds = ", ".join(f"{own.count(why)} for {why}" for why in dict.fromkeys(own))
    end = batches[-1].end
    return f"the scan chose its geometries: {kinds or 'none yet'}{end and f'. It ended as {end}'}"
