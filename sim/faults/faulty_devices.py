"""Wrappers that make simulated devices fail on request; until then they forward every call.

A fault is named by its words in `GONIO_FAULTS`. The messages follow those of the real drivers.
What fails also shows in the scene, so that a fault which the program overlooked would give a wrong
measured value.
"""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import ClassVar, Generic, TypeVar

from instrument.config.axes import SimulatedAxis
from instrument.devices import Camera, Frame, Lamp, Operator, Request, Stage
from instrument.errors import CameraLost, DeviceError, OperatorStop
from sim.faults.triggers import Triggers
from sim.scene.scene import Scene

log = logging.getLogger(__name__)

D = TypeVar("D")

_OFFSET_DEG = 0.3  # of a stage that slips or stops short: many times any rig file's tolerance
_MOST_TORN = 3  # consecutive bad frames tolerated, as by the V4L2 driver
_CABLE = "check the USB cable, the camera and any hub in between"


class FaultyDevice(Generic[D]):
    """Wrapper of one device: the faults that it can have, and those it has now."""

    faults: ClassVar[tuple[str, ...]]

    def __init__(self, name: str, device: D, triggers: Triggers) -> None:
        self._name, self._device, self._triggers = name, device, triggers
        self._active: Counter[str] = Counter()

    def fail(self, fault: str) -> None:
        """Begin a fault, one of `faults`."""
        self._active[fault] += 1

    def _call(self, method: str) -> AbstractContextManager[None]:
        """Context of one call: counts it, runs planned faults, and checks that it can succeed."""
        return self._triggers.call(f"{self._name}.{method}", self._check)

    def _check(self) -> None:
        """Raise if the device cannot answer at all."""


class FaultyStage(FaultyDevice[Stage]):
    """Stage of one motorised axis."""

    faults = (
        "does not answer", "stalls", "stops short", "slips", "loses its reference",
        "meets its limit switch",
    )  # fmt: skip

    def __init__(
        self, name: str, stage: Stage, axis: SimulatedAxis, scene: Scene, triggers: Triggers
    ) -> None:
        super().__init__(name, stage, triggers)
        self._axis, self._scene = axis, scene
        self._offset_deg = 0.0

    def fail(self, fault: str) -> None:
        """Begin a fault; a stage that slips moves at once."""
        super().fail(fault)
        if fault == "slips":
            self._offset_deg = _OFFSET_DEG
            self._write_scene()

    def identity(self) -> str:
        """Return the wrapped stage's description."""
        with self._call("identity"):
            return self._device.identity()

    def home(self) -> None:
        """Find the reference."""
        with self._call("home"):
            self._require_free("its reference was not found")
            self._device.home()
            self._active.pop("loses its reference", None)
            self._offset_deg = 0.0

    def homed(self) -> bool:
        """Return True if the reference is known."""
        with self._call("homed"):
            return "loses its reference" not in self._active and self._device.homed()

    def settings(self) -> dict[str, str]:
        """Return the wrapped stage's settings."""
        with self._call("settings"):
            return self._device.settings()

    def set_speed(self, speed_deg_per_s: float) -> None:
        """Set the speed of later moves."""
        with self._call("set_speed"):
            self._require_reference()
            self._device.set_speed(speed_deg_per_s)

    def start_move(self, angle_deg: float) -> None:
        """Start a move."""
        with self._call("start_move"):
            self._require_reference()
            self._device.start_move(angle_deg)

    def wait(self) -> float:
        """Let the move finish and return the position in degrees."""
        with self._call("wait"):
            self._require_free("stalled")
            self._require_reference()
            reached_deg = self._device.wait()
            self._offset_deg = -_OFFSET_DEG if self._active.pop("stops short", 0) else 0.0
            self._write_scene()
            return reached_deg + self._offset_deg

    def position_deg(self) -> float:
        """Return the current position."""
        with self._call("position_deg"):
            self._require_reference()
            return self._device.position_deg() + self._offset_deg

    def limits_deg(self) -> tuple[float, float]:
        """Return the rig file's limits."""
        with self._call("limits_deg"):
            return self._device.limits_deg()

    def begin_stop(self) -> None:
        """End the move at the current position."""
        with self._call("stop"):
            self._device.stop()
            self._write_scene()

    def finish_stop(self) -> None:
        """Do nothing: a simulated stage stands at once."""

    def stop(self) -> None:
        """End the move at the current position."""
        self.begin_stop()

    def close(self) -> None:
        """Do nothing: there is nothing to release."""

    def _check(self) -> None:
        if "does not answer" in self._active:
            raise DeviceError(f"{self._name}: no answer within 0.15 s: check its power and cable")

    def _require_free(self, failure: str) -> None:
        """Stop and raise if the axis is blocked or at its limit switch."""
        if not self._active.keys() & {"stalls", "meets its limit switch"}:
            return
        self._device.stop()
        at_deg = self._device.position_deg()
        if "meets its limit switch" in self._active:
            raise DeviceError(
                f"{self._name}: limit switch met at {at_deg:g} deg: find out why the stage ran "
                "onto it, move it clear by hand, then home it"
            )
        raise DeviceError(
            f"{self._name}: {failure} at {at_deg:g} deg: find out what blocks the stage, then "
            "home it"
        )

    def _require_reference(self) -> None:
        if "loses its reference" in self._active:
            raise DeviceError(
                f"{self._name}: reference lost: check the controller's power supply, then home it"
            )

    def _write_scene(self) -> None:
        if self._offset_deg:
            device_deg = self._device.position_deg() + self._offset_deg
            self._scene.set_axis(self._name, self._axis.from_device_deg(device_deg))
            self._scene.push(self._name, self._axis.sign * self._offset_deg)


class FaultyCamera(FaultyDevice[Camera]):
    """Camera on a cable; reopening it and retaking torn frames take no simulated time."""

    faults = (
        "gives no frame", "gives a torn frame", "gives torn frames", "is unplugged", "comes back",
    )  # fmt: skip

    def fail(self, fault: str) -> None:
        """Begin a fault; "comes back" ends an unplugging."""
        if fault == "comes back":
            self._active.pop("is unplugged", None)
        else:
            super().fail(fault)

    def identity(self) -> str:
        """Return the wrapped camera's description."""
        with self._call("identity"):
            return self._device.identity()

    def settings(self) -> dict[str, str]:
        """Return the wrapped camera's settings."""
        with self._call("settings"):
            return self._device.settings()

    def set_exposure_s(self, exposure_s: float) -> float:
        """Set the exposure in seconds."""
        with self._call("set_exposure_s"):
            return self._device.set_exposure_s(exposure_s)

    def grab(self, count: int) -> list[Frame]:
        """Take `count` frames, retaking torn ones."""
        with self._call("grab"):
            if self._active.pop("gives no frame", 0):  # the next attempt reopens the camera
                raise CameraLost(f"camera: no frame for 1 s: the stream has stopped; {_CABLE}")
            self._discard_torn()
            return self._device.grab(count)

    def close(self) -> None:
        """Do nothing: there is nothing to release."""

    def _check(self) -> None:
        if "is unplugged" in self._active:
            raise CameraLost(f"camera: not found: unplugged or without power; {_CABLE}")

    def _discard_torn(self) -> None:
        for _ in range(_MOST_TORN):
            if not self._next_is_torn():
                return
            log.warning("camera: a torn frame: retaken")
        if self._next_is_torn():
            raise DeviceError(f"camera: {_MOST_TORN + 1} bad frames in a row, all torn; {_CABLE}")

    def _next_is_torn(self) -> bool:
        if self._active["gives a torn frame"]:
            self._active["gives a torn frame"] -= 1
            return True
        return "gives torn frames" in self._active


class FaultyLamp(FaultyDevice[Lamp]):
    """Lamp with a shutter."""

    faults = ("sticks",)

    def identity(self) -> str:
        """Return the wrapped lamp's description."""
        with self._call("identity"):
            return self._device.identity()

    def darken(self) -> None:
        """Close the shutter."""
        with self._call("darken"):
            self._move(self._device.darken, "close")

    def light(self) -> None:
        """Open the shutter."""
        with self._call("light"):
            self._move(self._device.light, "open")

    def _move(self, action: Callable[[], None], verb: str) -> None:
        if "sticks" in self._active:
            raise DeviceError(
                f"lamp: its shutter does not {verb}: check its cable and power supply, and cover "
                "the lamp by hand if it is on"
            )
        action()


class FaultyOperator(FaultyDevice[Operator]):
    """Operator who can refuse a request (answer q) or leave (close the terminal)."""

    faults = ("refuses", "leaves")

    def ask(self, request: Request) -> str:
        """Return the operator's answer; raise `OperatorStop` if there is none."""
        with self._call("ask"):
            if "refuses" in self._active:
                raise OperatorStop(f"stopped at the prompt: {request.text}")
            if "leaves" in self._active:
                raise OperatorStop("standard input ended: nobody answers")
            return self._device.ask(request)
