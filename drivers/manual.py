"""Devices served by the operator: an axis set by hand, a lamp covered by hand."""

from __future__ import annotations

import math

from instrument.devices import Operator, Request
from instrument.errors import DeviceError


class HandSetAxis:
    """Stage moved by the operator, who reads the angle from a scale.

    `words` describe the axis in the prompt. The angle set may differ from the one asked for by up
    to `tolerance_deg`.
    """

    def __init__(self, name: str, words: str, operator: Operator, tolerance_deg: float) -> None:
        self._name, self._words, self._operator = name, words, operator
        self._tolerance_deg = tolerance_deg
        self._angle_deg: float | None = None

    def identity(self) -> str:
        """Return the axis's name and that it is set by hand."""
        return f"{self._name} set by hand"

    def home(self) -> None:
        """Do nothing: the operator reads the scale."""

    def homed(self) -> bool:
        """Return True: a scale cannot lose its reference."""
        return True

    def settings(self) -> dict[str, str]:
        """Return the tolerance of a setting."""
        return {"tolerance_deg": f"{self._tolerance_deg:g}"}

    def set_speed(self, speed_deg_per_s: float) -> None:
        """Refuse: nobody turns a scale at a steady speed."""
        raise DeviceError(
            f"{self._name} is set by hand and cannot turn at {speed_deg_per_s:g} deg/s: measure "
            "with motion: stepped"
        )

    def start_move(self, angle_deg: float) -> None:
        """Ask the operator to set an angle in degrees until the answer is within tolerance."""
        text = f"Set {self._words} ({self._name}) to {angle_deg:g} degrees"
        while True:
            request = Request("set axis", text, axis=self._name, angle_deg=angle_deg)
            answer = self._operator.ask(request)
            reported = _number(answer, angle_deg)
            if reported is not None and abs(reported - angle_deg) <= self._tolerance_deg:
                self._angle_deg = reported
                return
            text = (
                f"{answer!r} is not within {self._tolerance_deg:g} degrees of {angle_deg:g}: set "
                f"{self._words} ({self._name}) to {angle_deg:g} degrees"
            )

    def wait(self) -> float:
        """Return the angle reported by the operator, in degrees."""
        if self._angle_deg is None:
            raise DeviceError(f"{self._name} is set by hand and has not been set yet")
        return self._angle_deg

    def position_deg(self) -> float:
        """Return the angle reported by the operator, in degrees."""
        return self.wait()

    def limits_deg(self) -> tuple[float, float]:
        """Return infinite limits: only the rig file's apply."""
        return -math.inf, math.inf

    def begin_stop(self) -> None:
        """Do nothing: there is no motor to stop."""

    def finish_stop(self) -> None:
        """Do nothing: there is no motor to stop."""

    def stop(self) -> None:
        """Do nothing: there is no motor to stop."""

    def close(self) -> None:
        """Do nothing: nothing is open."""


def _number(answer: str, otherwise: float) -> float | None:
    """Return the angle in an answer; an empty one, or "done", means as asked."""
    if answer.strip().lower() in ("", "done", "ok", "y", "yes"):
        return otherwise
    try:
        return float(answer.strip().rstrip("°").replace(",", "."))
    except ValueError:
        return None


class HandCoveredLamp:
    """Lamp without a shutter, covered by the operator."""

    def __init__(self, operator: Operator) -> None:
        self._operator = operator

    def identity(self) -> str:
        """Return how this lamp is darkened."""
        return "lamp covered by hand"

    def darken(self) -> None:
        """Ask the operator to cover the lamp."""
        self._operator.ask(Request("cover lamp", "Cover the lamp: dark frames are next"))

    def light(self) -> None:
        """Ask the operator to uncover the lamp."""
        self._operator.ask(Request("uncover lamp", "Uncover the lamp"))
