"""Axis that another thread may halt at any moment of a move, also between two parts of it."""

from __future__ import annotations

from typing import Self

from acquisition.engine.axis import Axis
from instrument.errors import DeviceError


class Halted(DeviceError):
    """Motion that ended early, or was not begun, because the axis was halted.

    `expected`: whoever halted it does not take that for a failure, as for a pause.
    """

    def __init__(self, text: str, *, expected: bool) -> None:
        super().__init__(text)
        self.expected = expected


class HaltingAxis(Axis):
    """Axis that is halted from any thread, and stays so for all that was asked for before.

    A stop alone has no effect on a stage that rests between two parts of a move, which would then
    go on. `halts` counts the halts; an action may move the axis if none has come since it was
    asked for.
    """

    halts = 0
    _allowed = 0
    _expected = True

    @classmethod
    def of(cls, axis: Axis) -> Self:
        """Return an axis that drives the stage of another one."""
        return cls(axis.name, axis._stage, axis._settings, axis._clock)

    def halt(self, *, expected: bool = True) -> None:
        """Stop the axis now, and refuse what was asked for before; `finish_stop` is to follow."""
        self._expected = expected
        self.halts += 1
        super().begin_stop()

    def allow(self, halts: int) -> None:
        """Let an action move the axis that was asked for when it had been halted so often."""
        self._allowed = halts

    @property
    def halted(self) -> bool:
        """True if the axis was halted since the present action was asked for."""
        return self.halts != self._allowed

    def home(self) -> None:
        """Find the reference."""
        self._refuse_if_halted("not homed")
        super().home()

    def start_move(self, angle_deg: float) -> None:
        """Start a move; one that is halted just then is stopped again."""
        self._refuse_if_halted(f"not moved to {angle_deg:g} deg")
        super().start_move(angle_deg)
        if self.halted:
            super().stop()
            raise self._halted_error(f"on the way to {angle_deg:g} deg")

    def finish_move(self) -> None:
        """Wait for the end of the move; raise `Halted` if the axis was halted on its way."""
        try:
            super().finish_move()
        except DeviceError as error:
            if not self.halted:
                raise
            raise self._halted_error(f"on the way to {self._target_deg:g} deg") from error

    def _refuse_if_halted(self, what: str) -> None:
        if self.halted:
            raise self._halted_error(what)

    def _halted_error(self, what: str) -> Halted:
        return Halted(f"{self.name}: halted, {what}", expected=self._expected)
