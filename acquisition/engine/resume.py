"""Progress of a stopped scan, and the drift check by which a resume detects a changed lamp."""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import groupby

from acquisition.measure.drift import JUMP_U, MIN_JUMP, Drift, is_usable, rate
from acquisition.plan.plan import Plan, Step
from instrument.config.rig import Rig
from instrument.record.reading import Check, Reading
from instrument.record.record import Record

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Progress:
    """Readings of a stopped scan in the plan's order, and its earlier drift checks."""

    readings: tuple[Reading, ...] = ()
    checks: tuple[Check, ...] = ()

    @classmethod
    def of(cls, record: Record) -> Progress:
        """Return the progress of the scan in a record."""
        return cls(tuple(record.readings()), tuple(record.checks()))

    @property
    def done(self) -> frozenset[int]:
        """Indices of the accepted steps."""
        return frozenset(reading.step for reading in self.readings)

    @property
    def elapsed_s(self) -> float:
        """Duration of the scan so far, without interruptions."""
        return max((reading.free_s for reading in self.readings), default=0.0)

    def missing(self, plan: Plan) -> tuple[Step, ...]:
        """Return the steps still to be measured, in order."""
        done = self.done
        return tuple(step for step in plan.steps if step.index not in done)

    def missing_by_block(self, plan: Plan) -> list[list[Step]]:
        """Return the steps still to be measured, those of each block of the lamp in a list."""
        return [list(steps) for _, steps in groupby(self.missing(plan), key=lambda s: s.block)]

    def drift_step(self, plan: Plan, block: int) -> Step | None:
        """Return the step of the block's last usable drift check, or None without one."""
        latest = sorted(self.readings, key=lambda r: -r.time_s)
        checks = (r for r in latest if r.kind == "drift" and r.block == block)
        return next((plan.steps[r.step] for r in checks if is_usable(r)), None)

    def last_step(self, plan: Plan, block: int) -> Step | None:
        """Return the last accepted step if it belongs to the block, else None."""
        last = max(self.readings, key=lambda r: r.time_s, default=None)
        return None if last is None or last.block != block else plan.steps[last.step]

    def check_drift(self, repeated: Reading, next_step: Step) -> Check:
        """Compare the repeated drift reference with the rate predicted from earlier checks."""
        drift = Drift.of(self.readings, next_step.block, self.checks)
        expected, u_relative = drift.predicted_rate(self.elapsed_s)
        u = math.hypot(u_relative * expected, repeated.u_noise_dn / repeated.exposure_s)
        deviation = abs(rate(repeated) - expected)
        jumped = is_usable(repeated) and deviation > max(JUMP_U * u, MIN_JUMP * expected)
        return Check(
            before_step=next_step.index, expected=expected, u_expected=u, jumped=jumped,
            reading=repeated,
        )  # fmt: skip


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


def check_text(check: Check) -> str:
    """Return the outcome of a drift check in words."""
    text = (
        f"drift reference measured again: {rate(check.reading):.5g} DN/s, {check.expected:.5g} "
        f"expected (u {check.u_expected:.2g})"
    )
    if check.jumped:
        return f"{text}: the lamp has jumped, later levels refer to this check"
    if not is_usable(check.reading):
        return f"{text}: not usable ({check.reading.flags or 'too little signal'})"
    return f"{text}: as before"
