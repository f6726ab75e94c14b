"""Where things stand: the axes by their moves, the surface on the table; only this moves them."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Mapping

from acquisition.engine.axis import Axis
from acquisition.plan.moves import Move, Pose, home_pose, moves_between
from instrument.config.axes import AXES
from instrument.config.rig import Rig
from instrument.devices import Lamp, Operator, Request, Surface
from instrument.errors import DeviceError

log = logging.getLogger(__name__)


class Positioner:
    """Moves the axes clear of all keep-out zones, and has the operator change the surface.

    `note` writes down what the operator answered.
    """

    def __init__(
        self,
        rig: Rig,
        axes: Mapping[str, Axis],
        lamp: Lamp,
        operator: Operator,
        note: Callable[[str], None],
    ) -> None:
        self._rig, self._axes, self._lamp = rig, axes, lamp
        self._operator, self._note = operator, note
        self.pose = home_pose(rig)
        self.surface: Surface | None = None
        self._moves: tuple[Move, ...] = ()
        self._target = self.pose
        self._started = False

    def home(self) -> None:
        """Have every axis find its reference."""
        for axis in self._axes.values():
            axis.home()

    def find(self) -> None:
        """After an interruption: end what still moves, home what has lost its reference."""
        for axis in self._axes.values():
            axis.stop()
        angles = {}
        home = home_pose(self._rig)
        for name, axis in self._axes.items():
            if axis.by_hand:
                angles[name] = math.nan
            elif axis.homed():
                angles[name] = axis.position_deg()
            else:
                axis.home()
                angles[name] = getattr(home, name)
        self.pose = Pose(**angles)

    def go(self, pose: Pose) -> None:
        """Move there and come to rest; raises `NoPathError` before anything moves."""
        self.set_out(pose)
        self.arrive()

    def set_out(self, pose: Pose) -> None:
        """Set the first motor going, so that something else can be done while it moves."""
        self._moves, self._target = moves_between(self.pose, pose, self._rig), pose
        first = self._moves[0] if self._moves else None
        self._started = first is not None and not self._axes[first.axis].by_hand
        if first is not None and self._started:
            self._axes[first.axis].start_move(first.angle_deg)

    def arrive(self) -> None:
        """Make the moves one after the other, then let the axes come to rest."""
        for number, move in enumerate(self._moves):
            axis = self._axes[move.axis]
            if number > 0 or not self._started:
                axis.start_move(move.angle_deg)
            axis.finish_move()
            if axis.by_hand:
                self._note(f"{move.axis} set to {axis.position_deg():g} deg")
        for name in dict.fromkeys(move.axis for move in self._moves):
            self._axes[name].settle()
        self.pose, self._moves = self._target, ()

    def require_in_place(self) -> None:
        """Raise `DeviceError` where a motor no longer stands where it was put.

        Whatever was seen meanwhile belongs to no angle.
        """
        for name, axis in self._axes.items():
            if not axis.by_hand:
                axis.require_at(getattr(self.pose, name))

    def place(self, surface: Surface, name: str) -> None:
        """Have the operator put sample or white tile on the table, unless it is there."""
        if surface == self.surface:
            return
        request = Request("place", f"Put {name} on the sample table", surface=surface)
        answer = self._operator.ask(request)
        self._note(f"{request.text}: {answer}")
        self.surface = surface

    def make_safe(self) -> None:
        """Stop every axis and shut the lamp off, even when one of them fails to answer.

        A Ctrl-C meanwhile asks for what is being done: it is done to the end, and noted.
        """
        safe: list[tuple[str, Callable[[], None]]] = [
            (name, self._axes[name].stop) for name in AXES if name in self._axes
        ]
        if self._rig.lamp.darkened_by == "shutter":
            safe.append(("lamp", self._lamp.darken))
        for name, action in safe:
            try:
                _made_safe(name, action)
            except KeyboardInterrupt:
                log.error("%s: Ctrl-C while it was made safe: made safe once more", name)
                _made_safe(name, action)  # the stop may not have gone out


def _made_safe(name: str, action: Callable[[], None]) -> None:
    try:
        action()
    except (DeviceError, OSError) as error:
        log.error("%s could not be made safe: %s", name, error)
