"""Simulated devices that fail when they are told to: each passes on to a sound one until then.

Messages are as real drivers write them; what fails also shows in the scene, so that a fault which
nobody noticed would be a wrong value.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from contextlib import AbstractContextManager

from instrument.config.axes import SimulatedAxis
from instrument.devices import Camera, Frame, Lamp, Operator, Request, Stage
from instrument.errors import CameraLost, DeviceError, OperatorStop
from sim.faults.triggers import Moments
from sim.scene.scene import Scene

log = logging.getLogger(__name__)

OFF_DEG = 0.3  # of a stage that slips or stops short: many times any rig file's tolerance
MOST_TORN = 3  # bad frames in a series, as the V4L2 driver counts them
_CABLE = "look at the USB cable, at the camera and at the hub between"


class FaultyStage:
    """One motor axis."""

    def __init__(
        self, name: str, stage: Stage, axis: SimulatedAxis, scene: Scene, moments: Moments
    ) -> None:
        self._name, self._stage, self._axis = name, stage, axis
        self._scene, self._moments = scene, moments
        self._mute = self._held = self._lost = self._at_switch = False
        self._short_deg = self._off_deg = 0.0

    # What can go wrong.

    def fall_silent(self) -> None:
        """It does not answer any more."""
        self._mute = True

    def stall(self) -> None:
        """Something holds it: it gets no further."""
        self._held = True

    def stop_short(self) -> None:
        """The move ends before its target, and the controller does not notice."""
        self._short_deg = OFF_DEG

    def slip(self) -> None:
        """Something pushes it away from where it stands, and no command tells of it."""
        self._off_deg = OFF_DEG
        self._write_scene()

    def lose_reference(self) -> None:
        """Its controller was without power: it no longer knows where it is."""
        self._lost = True

    def meet_switch(self) -> None:
        """It runs onto its limit switch."""
        self._at_switch = True

    # What the program asks for.

    def identity(self) -> str:
        """What this stage is."""
        with self._call("identity"):
            return self._stage.identity()

    def home(self) -> None:
        """Find the reference."""
        with self._call("home"):
            self._refuse_held("its reference was not found")
            self._stage.home()
            self._lost, self._off_deg = False, 0.0

    def homed(self) -> bool:
        """Whether it knows its reference."""
        with self._call("homed"):
            return not self._lost and self._stage.homed()

    def settings(self) -> dict[str, str]:
        """What it keeps to."""
        with self._call("settings"):
            return self._stage.settings()

    def start_move(self, angle_deg: float) -> None:
        """Begin to move."""
        with self._call("start_move"):
            self._refuse_lost()
            self._stage.start_move(angle_deg)

    def wait(self) -> float:
        """Let the move end and return the position in degrees."""
        with self._call("wait"):
            self._refuse_held("stalled")
            self._refuse_lost()
            reached_deg = self._stage.wait()
            self._off_deg, self._short_deg = -self._short_deg, 0.0
            self._write_scene()
            return reached_deg + self._off_deg

    def position_deg(self) -> float:
        """Where the stage is."""
        with self._call("position_deg"):
            self._refuse_lost()
            return self._stage.position_deg() + self._off_deg

    def limits_deg(self) -> tuple[float, float]:
        """The rig file's limits."""
        with self._call("limits_deg"):
            return self._stage.limits_deg()

    def stop(self) -> None:
        """End the move where the axis is now."""
        with self._call("stop"):
            self._stage.stop()
            self._write_scene()

    def close(self) -> None:
        """Nothing to let go of."""

    def _call(self, name: str) -> AbstractContextManager[None]:
        return self._moments.call(f"{self._name}.{name}", self._require_answer)

    def _require_answer(self) -> None:
        if self._mute:
            raise DeviceError(
                f"{self._name}: no answer within 0.15 s: look at its power and at its cable"
            )

    def _refuse_held(self, what: str) -> None:
        """Stand still where it is held, or at the switch."""
        if not (self._held or self._at_switch):
            return
        self._stage.stop()
        at_deg = self._stage.position_deg()
        if self._at_switch:
            raise DeviceError(
                f"{self._name}: limit switch met at {at_deg:g} deg: look at what brought the stage "
                "there, move it clear by hand, then home it"
            )
        raise DeviceError(
            f"{self._name}: {what} at {at_deg:g} deg: look for what holds the stage, then home it"
        )

    def _refuse_lost(self) -> None:
        if self._lost:
            raise DeviceError(
                f"{self._name}: not homed any more: look at its controller's supply, then home it"
            )

    def _write_scene(self) -> None:
        if self._off_deg:
            stands_deg = self._stage.position_deg() + self._off_deg
            self._scene.set_axis(self._name, self._axis.from_device_deg(stands_deg))


class FaultyCamera:
    """A camera that a cable leads to. Looking for it, and torn frames, take no simulated time."""

    def __init__(self, camera: Camera, moments: Moments) -> None:
        self._camera, self._moments = camera, moments
        self._away = self._frozen = False
        self._torn = 0

    # What can go wrong.

    def unplug(self) -> None:
        """Take it away."""
        self._away = True

    def replug(self) -> None:
        """Bring it back."""
        self._away = False

    def freeze(self) -> None:
        """No frame comes until it is opened anew."""
        self._frozen = True

    def tear(self) -> None:
        """The next frame is torn."""
        self._torn += 1

    def tear_all(self) -> None:
        """All frames are torn from now on."""
        self._torn = 10**6

    # What the program asks for.

    def identity(self) -> str:
        """What this camera is."""
        with self._call("identity"):
            return self._camera.identity()

    def settings(self) -> dict[str, str]:
        """What it keeps to."""
        with self._call("settings"):
            return self._camera.settings()

    def set_exposure_s(self, exposure_s: float) -> float:
        """Set the exposure in seconds."""
        with self._call("set_exposure_s"):
            return self._camera.set_exposure_s(exposure_s)

    def grab(self, count: int) -> list[Frame]:
        """Take `count` frames; a torn one is refused and taken anew."""
        with self._call("grab"):
            self._wait_for_frame()
            self._refuse_torn()
            return self._camera.grab(count)

    def close(self) -> None:
        """Nothing to let go of."""

    def _call(self, name: str) -> AbstractContextManager[None]:
        return self._moments.call(f"camera.{name}", self._require_there)

    def _require_there(self) -> None:
        if self._away:
            raise CameraLost(f"camera: is gone, unplugged or without power; {_CABLE}")

    def _wait_for_frame(self) -> None:
        """A frozen stream: the next try opens the camera anew."""
        if self._frozen:
            self._frozen = False
            raise CameraLost(f"camera: no frame for 1 s: the stream stands still; {_CABLE}")

    def _refuse_torn(self) -> None:
        refused = 0
        while self._torn:
            self._torn, refused = self._torn - 1, refused + 1
            if refused > MOST_TORN:
                raise DeviceError(f"camera: {refused} bad frames in a series, all torn; {_CABLE}")
            log.warning("camera: a frame was torn: taken anew")


class FaultyLamp:
    """A lamp with a shutter."""

    def __init__(self, lamp: Lamp, moments: Moments) -> None:
        self._lamp, self._moments = lamp, moments
        self._stuck = False

    def stick(self) -> None:
        """Its shutter moves no more, and says so."""
        self._stuck = True

    def identity(self) -> str:
        """What this lamp is."""
        with self._moments.call("lamp.identity"):
            return self._lamp.identity()

    def darken(self) -> None:
        """Close the shutter."""
        with self._moments.call("lamp.darken"):
            self._move(self._lamp.darken, "close")

    def light(self) -> None:
        """Open the shutter."""
        with self._moments.call("lamp.light"):
            self._move(self._lamp.light, "open")

    def _move(self, action: Callable[[], None], what: str) -> None:
        if self._stuck:
            raise DeviceError(
                f"lamp: its shutter does not {what}: look at its cable and its supply, and cover "
                "the lamp by hand if it burns"
            )
        action()


class FaultyOperator:
    """The operator, who may have had enough."""

    def __init__(self, operator: Operator, moments: Moments) -> None:
        self._operator, self._moments = operator, moments
        self._refuses = self._away = False

    def refuse(self) -> None:
        """They answer q."""
        self._refuses = True

    def leave(self) -> None:
        """They close the terminal."""
        self._away = True

    def ask(self, request: Request) -> str:
        """What the operator answers."""
        with self._moments.call("operator.ask"):
            if self._refuses:
                raise OperatorStop(f"stopped at the prompt: {request.text}")
            if self._away:
                raise OperatorStop("standard input ended: nobody answers")
            return self._operator.ask(request)
