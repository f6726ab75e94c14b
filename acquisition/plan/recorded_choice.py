"""Choice of steps as a run's record tells it, for those who only follow the scan."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from acquisition.plan.plan import Plan, Step
from instrument.record.reading import batches_of


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
    numbers = (index for batch in batches for index in batch.steps if index < len(plan.steps))
    chosen = RecordedChoice(
        steps=tuple(plan.steps[index] for index in numbers),
        ended=bool(batches and batches[-1].end),
    )
    return replace(plan, choosing=chosen)
