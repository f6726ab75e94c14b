"""Choice of steps as a run's record tells it, for those who only follow the scan."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from acquisition.plan.plan import Plan, Step
from instrument.record.reading import Batch, batches_of


def steps_of(plan: Plan, batch: Batch) -> list[Step]:
    """Return the steps of a batch, with its frames; those that the plan does not have left out."""
    pairs = zip(batch.steps, batch.frames, strict=True)
    own = ((plan.steps[index], frames) for index, frames in pairs if index < len(plan.steps))
    return [replace(step, frames=frames) for step, frames in own]


@dataclass(frozen=True, slots=True)
class RecordedChoice:
    """Steps chosen so far; `ended`: the scan chooses no more."""

    steps: tuple[Step, ...]
    ended: bool

    def more(self) -> Sequence[Step]:
        """Choose nothing: another process does."""
        return ()


def with_recorded_choice(plan: Plan, events: Iterable[tuple[str, str, str]]) -> Plan:
    """Return the plan of a scan that chooses its steps, as far as events (time, kind, text) tell.

    Steps that the plan does not have are left out: a record may come from anybody.
    """
    batches = batches_of(events)
    chosen = RecordedChoice(
        steps=tuple(step for batch in batches for step in steps_of(plan, batch)),
        ended=bool(batches and batches[-1].end),
    )
    return replace(plan, choosing=chosen)
