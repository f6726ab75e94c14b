"""Motion of a rig for a program that asks for one move after the other.

Limits, backlash and keep-out zones are those of a scan: each move is checked, from where the axes
then stand, before it begins. One axis moves at a time.
"""

from __future__ import annotations

import logging
from collections.abc import Callable

from acquisition.engine.engine import Devices
from acquisition.engine.positioner import Positioner
from acquisition.facility.devices.actions import ActionStatus, ActionThread
from acquisition.facility.devices.halting_axis import Halted, HaltingAxis
from acquisition.plan.pose import Pose
from instrument.config.axes import AXES
from instrument.config.rig import Rig
from instrument.errors import DeviceError, InputError

log = logging.getLogger(__name__)


class Motion:
    """Axes of an open rig, moved in its thread and halted from any thread."""

    def __init__(self, rig: Rig, devices: Devices, thread: ActionThread) -> None:
        self.axes = {name: HaltingAxis.of(axis) for name, axis in devices.axes.items()}
        self._rig, self._thread, self._ready = rig, thread, False
        self._positioner = Positioner(rig, self.axes, devices.lamp, devices.operator, log.info)

    @property
    def pose(self) -> Pose:
        """Pose that was reached last, in degrees; nan for an axis that is not set yet."""
        return self._positioner.pose

    def begin_ready(self, then: Callable[[], None] = lambda: None) -> ActionStatus:
        """Begin to make the axes ready: those without a reference are homed, which moves them.

        `then` is done afterwards, if that went well.
        """
        halts = self._halts()

        def action() -> None:
            self._make_ready(halts)
            then()

        return self._thread.begin(action)

    def begin_move(self, **angles_deg: float) -> ActionStatus:
        """Begin a move of the named axes to angles in degrees of the rig; the others stay."""
        halts = self._halts()
        return self._thread.begin(lambda: self._move(angles_deg, halts))

    def begin_nothing(self) -> ActionStatus:
        """Return a status that is done once everything asked for before has ended."""
        return self._thread.begin(lambda: None)

    def halt(self, name: str, *, expected: bool = True) -> None:
        """Halt one axis now, from any thread, and return once it was read to stand.

        What it was asked for before is not done any more; `expected`: that is no failure.
        """
        if self._thread.closed:
            return  # made safe when it was closed
        self.axes[name].halt(expected=expected)
        self.axes[name].finish_stop()

    def halt_all(self) -> None:
        """Halt every axis now, from any thread, and return once all were read to stand."""
        if not self._thread.closed:
            self.begin_halt()
            for axis in self.axes.values():
                axis.finish_stop()

    def begin_halt(self) -> None:
        """Halt every axis now, without waiting for its effect."""
        for axis in self.axes.values():
            axis.halt()

    def require_within(self, name: str, angle_deg: float) -> None:
        """Raise `InputError` for an angle in degrees outside an axis's limits in the rig file."""
        own = self._rig.axes[name]
        if not own.min_deg <= angle_deg <= own.max_deg:
            raise InputError(
                f"{name}: {angle_deg:g} deg; allowed: {own.min_deg:g} to {own.max_deg:g} deg, the "
                "limits of the rig file: nothing has moved"
            )

    def place_sample(self) -> None:
        """Have the operator put the sample on its table, once; in the rig's thread."""
        self._positioner.place("sample", "the sample")

    def require_in_place(self) -> None:
        """Raise `DeviceError` unless all angles are known and every motor is where it was moved."""
        self._require_ready()
        unknown = [name for name in AXES if not abs(getattr(self.pose, name)) <= 360]
        if unknown:
            raise DeviceError(
                f"{unknown[0]}: is set by hand and has not been set yet: move it first"
            )
        self._positioner.require_in_place()

    def make_safe(self) -> None:
        """Stop every axis and close the lamp's shutter, even if some of them fail."""
        self._positioner.make_safe()

    def _halts(self) -> dict[str, int]:
        return {name: axis.halts for name, axis in self.axes.items()}

    def _allow(self, halts: dict[str, int]) -> None:
        for name, axis in self.axes.items():
            axis.allow(halts[name])

    def _make_ready(self, halts: dict[str, int]) -> None:
        if self._ready:
            return
        self._allow(halts)
        self._positioner.recover_position()
        self._ready = True

    def _require_ready(self) -> None:
        if not self._ready:
            raise DeviceError(
                "the rig is not ready, so nothing has moved: stage one of its devices, as "
                "bluesky's plans do, or call ready(); axes without a reference are then homed"
            )

    def _move(self, angles_deg: dict[str, float], halts: dict[str, int]) -> None:
        self._require_ready()
        self._allow(halts)
        for name, angle_deg in angles_deg.items():
            self.require_within(name, angle_deg)
        try:
            self._positioner.move_to(self.pose._replace(**angles_deg))
        except Halted as halted:
            self._stand()
            if not halted.expected:
                raise
        except DeviceError:
            self._stand()
            raise

    def _stand(self) -> None:
        """Stop what moves, and find out where it stands; else the rig has to be made ready anew."""
        try:
            self._positioner.break_off(self._positioner.moving)
        except DeviceError as error:
            log.error("%s: its position is not known any more", error)
            self._ready = False
