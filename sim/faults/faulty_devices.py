"""Wrappers that make simulated devices fail on request; until then they forward every call.

The messages follow those of the real drivers. A fault also changes the scene, so that a fault
which the program overlooked would show as a wrong measured value.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from contextlib import AbstractContextManager

from instrument.config.axes import SimulatedAxis
from instrument.devices import Camera, Frame, Lamp, Operator, Request, Stage
from instrument.errors import CameraLost, DeviceError, OperatorStop
from sim.faults.triggers import Triggers
from sim.scene.scene import Scene

log = logging.getLogger(__name__)

_OFFSET_DEG = 0.3  # of a stage that slips or stops short: many times any rig file's tolerance
_MOST_TORN = 3  # consecutive bad frames tolerated, as by the V4L2 driver
_CABLE = "check the USB cable, the camera and any hub in between"


class FaultyStage:
    """Stage of one motorised axis."""

    def __init__(
        self, name: str, stage: Stage, axis: SimulatedAxis, scene: Scene, triggers: Triggers
    ) -> None:
        self._name, self._stage, self._axis = name, stage, axis
        self._scene, self._triggers = scene, triggers
        self._silent = self._blocked = self._unreferenced = self._at_limit_switch = False
        self._short_deg = self._offset_deg = 0.0

    # Faults

    def fall_silent(self) -> None:
        """Stop answering."""
        self._silent = True

    def stall(self) -> None:
        """Block the axis at its position."""
        self._blocked = True

    def stop_short(self) -> None:
        """End the next move before its target, unnoticed by the controller."""
        self._short_deg = _OFFSET_DEG

    def slip(self) -> None:
        """Push the axis away from its position, without a command."""
        self._offset_deg = _OFFSET_DEG
        self._write_scene()

    def lose_reference(self) -> None:
        """Lose the reference, as after a power failure of the controller."""
        self._unreferenced = True

    def meet_switch(self) -> None:
        """Run onto the limit switch."""
        self._at_limit_switch = True

    # Stage interface

    def identity(self) -> str:
        """Return the wrapped stage's description."""
        with self._call("identity"):
            return self._stage.identity()

    def home(self) -> None:
        """Find the reference."""
        with self._call("home"):
            self._require_free("its reference was not found")
            self._stage.home()
            self._unreferenced, self._offset_deg = False, 0.0

    def homed(self) -> bool:
        """Return True if the reference is known."""
        with self._call("homed"):
            return not self._unreferenced and self._stage.homed()

    def settings(self) -> dict[str, str]:
        """Return the wrapped stage's settings."""
        with self._call("settings"):
            return self._stage.settings()

    def start_move(self, angle_deg: float) -> None:
        """Start a move."""
        with self._call("start_move"):
            self._require_reference()
            self._stage.start_move(angle_deg)

    def wait(self) -> float:
        """Let the move finish and return the position in degrees."""
        with self._call("wait"):
            self._require_free("stalled")
            self._require_reference()
            reached_deg = self._stage.wait()
            self._offset_deg, self._short_deg = -self._short_deg, 0.0
            self._write_scene()
            return reached_deg + self._offset_deg

    def position_deg(self) -> float:
        """Return the current position."""
        with self._call("position_deg"):
            self._require_reference()
            return self._stage.position_deg() + self._offset_deg

    def limits_deg(self) -> tuple[float, float]:
        """Return the rig file's limits."""
        with self._call("limits_deg"):
            return self._stage.limits_deg()

    def stop(self) -> None:
        """End the move at the current position."""
        with self._call("stop"):
            self._stage.stop()
            self._write_scene()

    def close(self) -> None:
        """Do nothing: there is nothing to release."""

    def _call(self, name: str) -> AbstractContextManager[None]:
        return self._triggers.call(f"{self._name}.{name}", self._require_answer)

    def _require_answer(self) -> None:
        if self._silent:
            raise DeviceError(f"{self._name}: no answer within 0.15 s: check its power and cable")

    def _require_free(self, failure: str) -> None:
        """Stop and raise if the axis is blocked or at its limit switch."""
        if not (self._blocked or self._at_limit_switch):
            return
        self._stage.stop()
        at_deg = self._stage.position_deg()
        if self._at_limit_switch:
            raise DeviceError(
                f"{self._name}: limit switch met at {at_deg:g} deg: find out why the stage ran "
                "onto it, move it clear by hand, then home it"
            )
        raise DeviceError(
            f"{self._name}: {failure} at {at_deg:g} deg: find out what blocks the stage, then "
            "home it"
        )

    def _require_reference(self) -> None:
        if self._unreferenced:
            raise DeviceError(
                f"{self._name}: reference lost: check the controller's power supply, then home it"
            )

    def _write_scene(self) -> None:
        if self._offset_deg:
            device_deg = self._stage.position_deg() + self._offset_deg
            self._scene.set_axis(self._name, self._axis.from_device_deg(device_deg))


class FaultyCamera:
    """Camera on a cable; reopening it and retaking torn frames take no simulated time."""

    def __init__(self, camera: Camera, triggers: Triggers) -> None:
        self._camera, self._triggers = camera, triggers
        self._unplugged = self._frozen = False
        self._torn = 0

    # Faults

    def unplug(self) -> None:
        """Disconnect the camera."""
        self._unplugged = True

    def replug(self) -> None:
        """Connect the camera again."""
        self._unplugged = False

    def freeze(self) -> None:
        """Deliver no frame until the camera is reopened."""
        self._frozen = True

    def tear(self) -> None:
        """Tear the next frame."""
        self._torn += 1

    def tear_all(self) -> None:
        """Tear all frames from now on."""
        self._torn = 10**6

    # Camera interface

    def identity(self) -> str:
        """Return the wrapped camera's description."""
        with self._call("identity"):
            return self._camera.identity()

    def settings(self) -> dict[str, str]:
        """Return the wrapped camera's settings."""
        with self._call("settings"):
            return self._camera.settings()

    def set_exposure_s(self, exposure_s: float) -> float:
        """Set the exposure in seconds."""
        with self._call("set_exposure_s"):
            return self._camera.set_exposure_s(exposure_s)

    def grab(self, count: int) -> list[Frame]:
        """Take `count` frames, retaking torn ones."""
        with self._call("grab"):
            self._require_stream()
            self._discard_torn()
            return self._camera.grab(count)

    def close(self) -> None:
        """Do nothing: there is nothing to release."""

    def _call(self, name: str) -> AbstractContextManager[None]:
        return self._triggers.call(f"camera.{name}", self._require_plugged)

    def _require_plugged(self) -> None:
        if self._unplugged:
            raise CameraLost(f"camera: not found: unplugged or without power; {_CABLE}")

    def _require_stream(self) -> None:
        """Raise once if the stream is frozen: the next attempt reopens the camera."""
        if self._frozen:
            self._frozen = False
            raise CameraLost(f"camera: no frame for 1 s: the stream has stopped; {_CABLE}")

    def _discard_torn(self) -> None:
        discarded = 0
        while self._torn:
            self._torn, discarded = self._torn - 1, discarded + 1
            if discarded > _MOST_TORN:
                raise DeviceError(f"camera: {discarded} bad frames in a row, all torn; {_CABLE}")
            log.warning("camera: a torn frame: retaken")


class FaultyLamp:
    """Lamp with a shutter."""

    def __init__(self, lamp: Lamp, triggers: Triggers) -> None:
        self._lamp, self._triggers = lamp, triggers
        self._stuck = False

    def stick(self) -> None:
        """Block the shutter; the next command reports it."""
        self._stuck = True

    def identity(self) -> str:
        """Return the wrapped lamp's description."""
        with self._triggers.call("lamp.identity"):
            return self._lamp.identity()

    def darken(self) -> None:
        """Close the shutter."""
        with self._triggers.call("lamp.darken"):
            self._move(self._lamp.darken, "close")

    def light(self) -> None:
        """Open the shutter."""
        with self._triggers.call("lamp.light"):
            self._move(self._lamp.light, "open")

    def _move(self, action: Callable[[], None], verb: str) -> None:
        if self._stuck:
            raise DeviceError(
                f"lamp: its shutter does not {verb}: check its cable and power supply, and cover "
                "the lamp by hand if it is on"
            )
        action()


class FaultyOperator:
    """Operator who can refuse a request or leave."""

    def __init__(self, operator: Operator, triggers: Triggers) -> None:
        self._operator, self._triggers = operator, triggers
        self._refuses = self._absent = False

    def refuse(self) -> None:
        """Answer q to every request."""
        self._refuses = True

    def leave(self) -> None:
        """Close the terminal."""
        self._absent = True

    def ask(self, request: Request) -> str:
        """Return the operator's answer; raise `OperatorStop` if there is none."""
        with self._triggers.call("operator.ask"):
            if self._refuses:
                raise OperatorStop(f"stopped at the prompt: {request.text}")
            if self._absent:
                raise OperatorStop("standard input ended: nobody answers")
            return self._operator.ask(request)
