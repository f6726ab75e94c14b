"""What a person does in a motor's place: an axis that is set, a lamp that is covered, by hand."""

from __future__ import annotations

import math

from instrument.devices import Operator, Request
from instrument.errors import DeviceError


class HandSetAxis:
    """A stage whose motor is the operator. Angles are those that the operator reads.

    `tolerance_deg`: how far from what was asked the operator may set it.
    """

    def __init__(self, name: str, words: str, operator: Operator, tolerance_deg: float) -> None:
        self._name, self._words, self._operator = name, words, operator
        self._tolerance_deg = tolerance_deg
        self._angle_deg: float | None = None

    def identity(self) -> str:
        """Who moves this axis."""
        return f"{self._name} set by hand"

    def home(self) -> None:
        """Nothing to find: the operator reads the scale."""

    def homed(self) -> bool:
        """A scale has no reference to lose."""
        return True

    def settings(self) -> dict[str, str]:
        """How exactly it is set."""
        return {"tolerance_deg": f"{self._tolerance_deg:g}"}

    def start_move(self, angle_deg: float) -> None:
        """Ask for the angle until the operator says that it is set, or stops."""
        text = f"Set {self._words} ({self._name}) to {angle_deg:g} degrees"
        while True:
            request = Request("set axis", text, axis=self._name, angle_deg=angle_deg)
            answer = self._operator.ask(request)
            said = _number(answer, angle_deg)
            if said is not None and abs(said - angle_deg) <= self._tolerance_deg:
                self._angle_deg = said
                return
            text = (
                f"{answer!r} is not within {self._tolerance_deg:g} degrees of {angle_deg:g}: set "
                f"{self._words} ({self._name}) to {angle_deg:g} degrees"
            )

    def wait(self) -> float:
        """The angle that the operator said was set, in degrees."""
        if self._angle_deg is None:
            raise DeviceError(f"{self._name} is set by hand and has not been set yet")
        return self._angle_deg

    def position_deg(self) -> float:
        """The angle that the operator said was set, in degrees."""
        return self.wait()

    def limits_deg(self) -> tuple[float, float]:
        """None of its own: the rig file's hold."""
        return -math.inf, math.inf

    def stop(self) -> None:
        """A hand needs no stopping."""

    def close(self) -> None:
        """Nothing to let go of."""


def _number(answer: str, otherwise: float) -> float | None:
    """The angle of an answer; an empty one, or "done", means as asked."""
    if answer.strip().lower() in ("", "done", "ok", "y", "yes"):
        return otherwise
    try:
        return float(answer.strip().rstrip("°").replace(",", "."))
    except ValueError:
        return None


class HandCoveredLamp:
    """A lamp without a shutter: the operator covers it."""

    def __init__(self, operator: Operator) -> None:
        self._operator = operator

    def identity(self) -> str:
        """Who darkens this lamp."""
        return "lamp covered by hand"

    def darken(self) -> None:
        """Ask to cover the lamp."""
        self._operator.ask(Request("cover lamp", "Cover the lamp: dark frames are next"))

    def light(self) -> None:
        """Ask to uncover the lamp."""
        self._operator.ask(Request("uncover lamp", "Uncover the lamp"))
