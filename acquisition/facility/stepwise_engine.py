"""Engine whose steps another program asks for one at a time: first the move, then the frames.

Darks, references, interlocks and what is recorded are those of a scan that runs by itself.
"""

from __future__ import annotations

from collections.abc import Sequence

from acquisition.engine.engine import Engine
from acquisition.engine.exposure.exposer import Exposed
from acquisition.engine.resume import Progress
from acquisition.plan.plan import Plan, Step
from instrument.record.reading import Reading


class StepwiseEngine(Engine):
    """Engine for a program that decides when the next step comes; `last` is the last reading."""

    last: Reading | None = None

    def begin(self, plan: Plan) -> None:
        """Register and home the devices, and take the darks that come first."""
        self._register_devices()
        self._begin(plan)

    def go_to(self, plan: Plan, step: Step) -> None:
        """Place the surface of a step, move to its pose and let the axes settle."""
        self._announce(step)
        self._place(step.surface)
        moves = plan.moves_to(step, self._positioner.pose, self._rig)
        self._positioner.start_moves(moves, step.pose)
        self._positioner.finish_moves()

    def measure(self, plan: Plan, step: Step) -> None:
        """Take the frames of the step at whose pose the rig stands; its reading is on disk then."""
        self._scan(plan, [step])

    def go_on(self, plan: Plan, progress: Progress, first: Step) -> None:
        """Prepare the rig for a step after an interruption, as a resumed scan does."""
        self._positioner.recover_position()
        self._continue_from(plan, progress, first)
        progress = Progress.of(self._record)  # a lamp that has jumped casts doubt on readings
        self._references.restore(progress.references(), progress.checks)
        self._record.allow_replacing(progress.doubtful)

    def make_safe(self) -> None:
        """Stop all motion, close the shutter, and refuse to run again."""
        self._ended, self._phase = True, "ending"
        self._positioner.make_safe()

    def _step_through(self, _plan: Plan, steps: Sequence[Step]) -> None:
        for step in steps:
            exposed = self._expose(step)
            if step.kind == "point":
                self._accept(exposed)
            else:
                self._accept_reference(exposed)

    def _begin_commit(self, exposed: Exposed, reading: Reading) -> None:
        self.last = reading
        super()._begin_commit(exposed, reading)
