"""Course of an adaptive scan: it chooses each batch, records it, and says why the scan ends."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial

from acquisition.adaptive.aims import MARGIN, Aims
from acquisition.adaptive.chooser import Chooser, Proposal
from acquisition.adaptive.endings import (
    all_measured,
    expected,
    no_help,
    out_of_time,
    reached,
    stable,
    u_text,
)
from acquisition.adaptive.knowledge import closed, full_fit
from acquisition.adaptive.layout import Layout
from acquisition.adaptive.shadow import Shadow
from acquisition.plan.plan import Plan, Step
from analysis.choice.ladder import physics
from instrument.config.load import Loaded
from instrument.errors import InputError
from instrument.record.event_kinds import CHOSEN
from instrument.record.reading import Batch, batches_of
from instrument.record.record import Record

REFERENCE = "reference"
_UNKNOWN = "reason lost"  # its choice was damaged on the disk

Say = Callable[[str], None]


class Course:
    """Choice of the steps of one run; what it chose before, the record says."""

    def __init__(self, chooser: Chooser, record: Record, say: Say = lambda _: None) -> None:
        self._chooser, self._record, self._say = chooser, record, say
        self._batches = batches_of(record.events())
        self._lost = self._without_choice()
        self._next: Shadow[Proposal] | None = None

    @property
    def steps(self) -> Sequence[Step]:
        """Steps chosen so far, in the order in which they are measured."""
        return [*self._lost, *self._chooser.steps(self._batches)]

    @property
    def ended(self) -> bool:
        """True if nothing will be chosen any more."""
        return bool(self._batches and self._batches[-1].end)

    @property
    def batches(self) -> Sequence[Batch]:
        """The choices so far."""
        return self._batches

    def more(self) -> Sequence[Step]:
        """Choose the next batch and record it; empty at the end.

        What the batch after it needs is begun: it is worked out while this one is measured.
        """
        if self.ended:
            return ()
        if self._lost:
            self._take_in_lost()
        proposal = self._begin().result() if self._next is None else self._next.result()
        batch = self._decided(proposal)
        self._add(batch)
        self._say(self._line(batch))
        self._next = None if batch.end else self._begin()
        return self._chooser.steps([batch])

    def _take_in_lost(self) -> None:
        """Record the steps that no choice names as a batch: they are not to be chosen again."""
        lost, self._lost = self._lost, []
        batch = Batch(
            number=self._batches[-1].number + 1 if self._batches else 0,
            steps=tuple(step.index for step in lost),
            frames=tuple(step.frames for step in lost),
            reasons=(_UNKNOWN,) * len(lost),
        )
        self._add(batch)

    def _add(self, batch: Batch) -> None:
        self._record.add_event(datetime.now(UTC).isoformat(), CHOSEN, batch.text)
        self._batches.append(batch)

    def _begin(self) -> Shadow[Proposal]:
        """Begin to work out the next batch, from the readings that are on disk now."""
        rows = self._record.rows()
        task = partial(self._chooser.propose, tuple(self._batches), rows.readings, rows.checks)
        return Shadow(task)

    def _decided(self, proposal: Proposal) -> Batch:
        """Return the next batch: what is proposed, or the closing references with the reason.

        The u is checked again once the drift check that closes the scan is there: it tells on it.
        """
        checked = self._full_check(proposal)
        closing = self._chooser.layout.closing(self.steps)
        drift = [step for step in closing if step.kind == "drift"]
        if checked and self._aims.reached(checked, MARGIN if closing and not drift else 1.0):
            if drift:
                return self._batch(proposal, drift, checked)
            return self._last(proposal, reached(self._aims, checked), checked)
        hopeless = no_help(self._batches, proposal, self._aims) if self._batches else ""
        if hopeless:
            return self._last(proposal, hopeless, checked)
        steps = self._chooser.layout.batch([step for step, _ in proposal.points], self.steps)
        if not steps:
            why = all_measured(self._batches, proposal, self._aims)
            return self._last(proposal, why, checked)
        within = self._within_budget(steps)
        if not within:
            why = out_of_time(self._batches, proposal, self._aims)
            return self._last(proposal, why, checked)
        return self._batch(proposal, within, checked)

    @property
    def _aims(self) -> Aims:
        return self._chooser.aims

    def _full_check(self, proposal: Proposal) -> dict[str, float | None]:
        """Return the u of the run's own fit where the goal may be reached; else nothing."""
        ahead = expected(self._batches, proposal, self._aims)
        if not ahead or not self._aims.reached(ahead) or not stable(self._batches, proposal):
            return {}
        layout, rows = self._chooser.layout, self._record.rows()
        rows = rows._replace(readings=closed(rows.readings, layout, self.steps))
        model, u = full_fit(rows, layout.loaded, self._aims)
        if physics(model) != physics(proposal.known.model):
            return dict.fromkeys(u)
        return dict(u)

    def _within_budget(self, steps: Sequence[Step]) -> Sequence[Step]:
        """Return the steps, or fewer of their points, that end within the budget."""
        while steps and self._seconds(steps) > (self._aims.budget_s or float("inf")):
            points = [step for step in steps if step.kind == "point"][:-1]
            steps = self._chooser.layout.batch(points, self.steps)
        return steps

    def _seconds(self, steps: Sequence[Step]) -> float:
        """Return the expected time of the whole scan to the end of these steps, and its closing.

        What was measured took the time that it did; the rest is as planned, and longer by the same
        factor, so far.
        """
        layout, known = self._chooser.layout, list(self.steps)
        after = [*known, *steps]
        planned = layout.seconds([*after, *layout.closing(after)])
        earlier = self._chooser.steps(self._batches[:-1])
        own = {step.index for step in earlier}
        took = [r.free_s for r in self._record.readings() if r.step in own]
        if not took:
            return planned
        before = layout.seconds(earlier)
        spent = max(took) + layout.plan.steps[0].start_s
        return spent + (planned - before) * max(spent / before, 1.0)

    def _batch(
        self, proposal: Proposal, steps: Sequence[Step], checked: dict[str, float | None]
    ) -> Batch:
        reasons = {step.index: reason for step, reason in proposal.points}
        known = proposal.known
        return Batch(
            number=self._batches[-1].number + 1 if self._batches else 0,
            steps=tuple(step.index for step in steps),
            frames=tuple(step.frames for step in steps),
            reasons=tuple(reasons.get(step.index, REFERENCE) for step in steps),
            model=known.model,
            verdict=known.verdict,
            fitted=known.u(self._aims),
            forecast=dict(proposal.forecast),
            checked=checked,
            seconds=round(self._seconds(steps), 1),
        )

    def _last(self, proposal: Proposal, why: str, checked: dict[str, float | None]) -> Batch:
        """Return the references that close the scan, with the reason for its end."""
        closing = self._chooser.layout.closing(self.steps)
        return replace(self._batch(proposal, closing, checked), end=why)

    def _line(self, batch: Batch) -> str:
        """Return a batch in a line: what it is for, and the u so far beside the goal."""
        if batch.end:
            return f"end: {batch.end}"
        points = [reason for reason in batch.reasons if reason != REFERENCE]
        kinds = ", ".join(f"{points.count(k)} for {k}" for k in dict.fromkeys(points))
        text = f"batch {batch.number + 1}: {kinds or 'the drift check that closes the scan'}"
        if not batch.model:
            return text
        return f"{text}; {batch.model} so far, {u_text(self._aims, batch.fitted)}"

    def _without_choice(self) -> list[Step]:
        """Return the steps that were measured and that no choice names: it was damaged."""
        steps = self._chooser.layout.plan.steps
        chosen = {index for batch in self._batches for index in batch.steps}
        readings = sorted(self._record.readings(), key=lambda reading: reading.time_s)
        lost = {r.step: r.frames for r in readings if r.step not in chosen}
        beyond = [index for index in (*chosen, *lost) if index >= len(steps)]
        if beyond:
            raise InputError(
                f"{self._record.folder}: step {beyond[0]} is measured or chosen, of the "
                f"{len(steps)} of its protocol: take an undamaged copy of the run"
            )
        return [replace(steps[index], frames=frames) for index, frames in lost.items()]


def chooser_of(loaded: Loaded, plan: Plan) -> Chooser:
    """Return the choice among the steps of a list of candidates; raise `InputError` if none can be.

    The first batch must fit into the budget.
    """
    aims, layout = Aims.of(loaded), Layout(plan, loaded)
    chooser = Chooser(layout, aims)
    first = layout.batch([step for step, _ in chooser.propose((), (), ()).points], ())
    seconds = layout.seconds([*first, *layout.closing(first)])
    if not first:
        raise InputError(f"{loaded.protocol_path}: no way leads from the references to a geometry")
    if aims.budget_s is not None and seconds > aims.budget_s:
        raise InputError(
            f"budget of {aims.budget_s / 60:g} min: the first batch of {len(first)} steps takes "
            f"{seconds / 60:.1f} min, homing, references and darks included; allowed: more than "
            "that. Nothing has moved"
        )
    return chooser


def chosen_while_measured(chooser: Chooser, record: Record, say: Say = lambda _: None) -> Plan:
    """Return the plan of a run whose steps are chosen while they are measured."""
    return replace(chooser.layout.plan, choosing=Course(chooser, record, say))
