"""Progress of a stopped scan, and the drift check by which a resume detects a changed lamp."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass

from acquisition.interlocks.doubt import doubted_steps
from acquisition.interlocks.lamp_checks import compared, doubtful_steps
from acquisition.measure.drift import is_usable
from acquisition.plan.plan import Plan, Step
from instrument.config.rig import Rig
from instrument.record.reading import Check, Reading, Rows
from instrument.record.record import Record

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Progress:
    """Readings of a stopped scan in the plan's order, and its earlier drift checks.

    doubted: steps whose surface was not proved to be at its place.
    """

    readings: tuple[Reading, ...] = ()
    checks: tuple[Check, ...] = ()
    doubted: frozenset[int] = frozenset()

    @classmethod
    def of(cls, record: Record) -> Progress:
        """Return the progress of the scan in a record."""
        return cls.of_rows(record.rows())

    @classmethod
    def of_rows(cls, rows: Rows) -> Progress:
        """Return the progress of the scan in rows of a record."""
        doubted = doubted_steps(rows.readings, rows.events)
        return cls(tuple(rows.readings), tuple(rows.checks), doubted)

    @property
    def doubtful(self) -> frozenset[int]:
        """Indices of accepted steps to be measured again: the next proof failed."""
        return doubtful_steps(self.readings, self.checks) | self.doubted

    @property
    def done(self) -> frozenset[int]:
        """Indices of the accepted steps that stay."""
        return frozenset(reading.step for reading in self.readings) - self.doubtful

    def references(self) -> list[Reading]:
        """Return the tile readings and drift checks that stay, in order of time."""
        return [r for r in self.by_time if r.kind != "point" and r.step in self.done]

    @property
    def by_time(self) -> list[Reading]:
        """Readings in the order in which they were made.

        A scan that chooses its steps has another order than the plan.
        """
        return sorted(self.readings, key=lambda reading: reading.time_s)

    @property
    def elapsed_s(self) -> float:
        """Duration of the scan so far, without interruptions."""
        made = (*self.readings, *(check.reading for check in self.checks))
        return max((reading.free_s for reading in made), default=0.0)

    def missing(self, plan: Plan) -> tuple[Step, ...]:
        """Return the steps still to be measured, in order; of a choice, those made so far."""
        done = self.done
        return tuple(step for step in plan.known if step.index not in done)

    def missing_in(self, block: int, plan: Plan) -> list[Step]:
        """Return the steps of one block of the lamp that are still to be measured, in order."""
        return [step for step in self.missing(plan) if step.block == block]

    def drift_step(self, plan: Plan, block: int) -> Step | None:
        """Return the step of the block's last usable drift check, or None without one."""
        latest = sorted(self.readings, key=lambda r: -r.time_s)
        done = self.done
        own = (r for r in latest if r.block == block and r.step in done)
        checks = (r for r in own if r.kind == "drift")
        return next((plan.steps[r.step] for r in checks if is_usable(r)), None)

    def last_step(self, plan: Plan, block: int) -> Step | None:
        """Return the last accepted step if it belongs to the block, else None."""
        last = max(self.readings, key=lambda r: r.time_s, default=None)
        return None if last is None or last.block != block else plan.steps[last.step]

    def check_drift(self, repeated: Reading, next_step: Step) -> Check:
        """Compare the repeated drift reference with the rate predicted from earlier checks."""
        return compared(repeated, self.readings, self.checks, next_step.index)


def report_found(found: Mapping[str, float], progress: Progress, rig: Rig) -> None:
    """Log each axis that was found elsewhere than at the last accepted reading.

    A program that was killed could not stop what it had set in motion. `found`: angles in degrees
    of the axes that have kept their reference.
    """
    last = max(progress.readings, key=lambda r: r.time_s, default=None)
    for name, at_deg in found.items():
        if last is None:
            log.warning("%s: found at %.4f deg; no reading had been taken", name, at_deg)
            continue
        before_deg = getattr(last, f"{name}_deg")
        if abs(at_deg - before_deg) > rig.axes[name].tolerance_deg:
            log.warning(
                "%s: found at %.4f deg; the last reading had been taken at %g deg",
                name, at_deg, before_deg,
            )  # fmt: skip
