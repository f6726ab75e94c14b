"""Those who watch a scan: what they are told, and devices that remember what they were told to do.

Onlookers ask from threads of their own; the scan does no more for them than to keep its state.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Literal

from acquisition.plan.plan import Step
from acquisition.plan.pose import Pose
from instrument.devices import Lamp, Surface

Phase = Literal["homing", "moving", "exposing", "pausing", "paused", "operator", "ending"]
MEASURING: tuple[Phase, ...] = ("homing", "moving", "exposing")
"""Phases in which the scan goes on by itself."""
LampState = Literal["lit", "darkened", "unknown"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Present:
    """Present state of a scan: its phase, the step that it is at, and the state of the rig.

    `pose` was reached last, in degrees; `target` is where the move of the axis `moving` leads, both
    equal at rest. `asked`: what the operator is asked to do, empty if nothing.
    """

    phase: Phase
    step: Step | None
    pose: Pose
    target: Pose
    moving: str
    surface: Surface | None
    lamp: LampState
    asked: str


class KnownLamp:
    """Lamp that remembers whether it was lit or darkened last; `asked`: which it is just told."""

    def __init__(self, lamp: Lamp) -> None:
        self._lamp = lamp
        self.state: LampState = "unknown"
        self.asked: Literal["", "lit", "darkened"] = ""

    def identity(self) -> str:
        """Return what darkens the lamp."""
        return self._lamp.identity()

    def darken(self) -> None:
        """Block all light on the sample."""
        with self._asked("darkened"):
            self._lamp.darken()

    def light(self) -> None:
        """Let full light onto the sample."""
        with self._asked("lit"):
            self._lamp.light()

    @contextmanager
    def _asked(self, state: Literal["lit", "darkened"]) -> Iterator[None]:
        self.state, self.asked = "unknown", state
        try:
            yield
            self.state = state
        finally:
            self.asked = ""
