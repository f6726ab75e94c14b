"""How a stopped scan goes on: as if it had never stopped, unless the lamp has changed meanwhile."""

from __future__ import annotations

import math
from dataclasses import dataclass

from acquisition.measure.drift import JUMP_U, LEAST_JUMP, Drift, usable
from acquisition.plan.plan import Plan, Step
from instrument.record.reading import Check, Reading


@dataclass(frozen=True, slots=True)
class Progress:
    """What a stopped scan has on disk: its readings in the plan's order, its earlier checks."""

    readings: tuple[Reading, ...] = ()
    checks: tuple[Check, ...] = ()

    @property
    def done(self) -> frozenset[int]:
        """The steps of the plan that are accepted."""
        return frozenset(reading.step for reading in self.readings)

    @property
    def elapsed_s(self) -> float:
        """How long the scan has taken, without the times that it stood still."""
        return max((reading.free_s for reading in self.readings), default=0.0)

    def missing(self, plan: Plan) -> tuple[Step, ...]:
        """The steps that are still to be read, in order."""
        done = self.done
        return tuple(step for step in plan.steps if step.index not in done)

    def drift_step(self, plan: Plan, block: int) -> Step | None:
        """The step of a block's last usable drift check: what a check repeats."""
        made = [r for r in self.readings if r.kind == "drift" and r.block == block and usable(r)]
        return plan.steps[made[-1].step] if made else None

    def where_it_stood(self, plan: Plan, first: Step) -> Step | None:
        """The last accepted step, where what comes next belongs to the same setting by hand."""
        if not self.readings or self.readings[-1].block != first.block:
            return None
        return plan.steps[self.readings[-1].step]

    def check(self, repeated: Reading, before: Step) -> Check:
        """What the drift reference, measured again, says of the lamp."""
        drift = Drift.of(self.readings, before.block, self.checks)
        expected, u_relative = drift.foretold(self.elapsed_s)
        u = math.hypot(u_relative * expected, repeated.u_noise_dn / repeated.exposure_s)
        off = abs(repeated.signal_dn / repeated.exposure_s - expected)
        jumped = usable(repeated) and off > max(JUMP_U * u, LEAST_JUMP * expected)
        return Check(before.index, expected, u, jumped, repeated)


def describe(check: Check) -> str:
    """What a check found, in words."""
    found = check.reading.signal_dn / check.reading.exposure_s
    text = (
        f"drift reference measured again: {found:.5g} DN/s, {check.expected:.5g} expected "
        f"(u {check.u_expected:.2g})"
    )
    if check.jumped:
        return f"{text}: the lamp has jumped, its level is counted from here on"
    if not usable(check.reading):
        return f"{text}: not usable ({check.reading.flags or 'too little signal'})"
    return f"{text}: as before"
