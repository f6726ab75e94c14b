"""Camera of a rig as bluesky triggers and reads it: the radiance of the measured patch."""

from __future__ import annotations

from acquisition.engine.onlookers import KnownLamp
from acquisition.facility.devices.actions import ActionStatus, ActionThread
from acquisition.facility.devices.motion import Motion
from acquisition.facility.devices.readings import (
    KeyDict,
    ReadingDict,
    Value,
    data_key,
    data_keys,
    reading,
    readings,
)
from acquisition.facility.devices.window_camera import WindowCamera
from instrument.clock import Clock
from instrument.config.rig import Rig
from instrument.errors import DeviceError, InputError

_TYPES: dict[str, type] = {
    "radiance": float, "u_radiance": float, "exposure_s": float, "frames": int,
    "window_pixels": float, "saturated_pixels": int, "peak_dn": float, "flags": str,
}  # fmt: skip


class CameraDevice:
    """Camera with its window: each trigger takes the frames of one reading.

    Staging makes the rig ready, has the sample placed and lights it; unstaging closes the shutter.
    """

    parent = None

    def __init__(
        self, rig: Rig, camera: WindowCamera, motion: Motion, lamp: KnownLamp,
        thread: ActionThread, clock: Clock,
    ) -> None:  # fmt: skip
        self.name = "camera"
        self._rig, self._camera, self._motion, self._lamp = rig, camera, motion, lamp
        self._thread, self._clock = thread, clock
        self._values: dict[str, Value] = {}
        self._time_s = 0.0

    @property
    def hints(self) -> dict[str, list[str]]:
        """Field to plot."""
        return {"fields": [f"{self.name}_radiance"]}

    @property
    def exposure_s(self) -> float | None:
        """Exposure of each reading in seconds; None for the one that suits the brightness."""
        return self._camera.exposure_s

    @exposure_s.setter
    def exposure_s(self, exposure_s: float | None) -> None:
        low, high = self._rig.camera.min_exposure_s, self._rig.camera.max_exposure_s
        if exposure_s is not None and not low <= exposure_s <= high:
            raise InputError(
                f"camera: exposure_s: {exposure_s!r}; allowed: {low:g} to {high:g} s, the limits "
                "of the rig file, or None for the exposure that suits the brightness"
            )
        self._camera.exposure_s = exposure_s

    def stage(self) -> ActionStatus:
        """Make the axes ready, have the sample placed, and light it."""
        return self._motion.begin_ready(self._light_sample)

    def unstage(self) -> ActionStatus:
        """Halt the axes, which staging may still be homing; then close the lamp's shutter."""
        self._motion.halt_all()
        return self._thread.begin(self._close_shutter)

    def trigger(self) -> ActionStatus:
        """Begin to take the frames of a reading where the axes stand."""
        return self._thread.begin(self._take)

    def read(self) -> dict[str, ReadingDict]:
        """Return the last reading; the radiance is in counts per second, which are relative."""
        if not self._values:
            raise DeviceError("camera: no reading has been taken yet: trigger it first")
        values, time_s = self._values, self._time_s
        return {f"{self.name}_{n}": reading(value, time_s) for n, value in values.items()}

    def describe(self) -> dict[str, KeyDict]:
        """Return the units of what `read` returns."""
        own = f"gonio:{self.name}"
        return {f"{self.name}_{n}": data_key(n, kind, own) for n, kind in _TYPES.items()}

    def read_configuration(self) -> dict[str, ReadingDict]:
        """Return what answers, and what a reading consists of."""
        return readings(self._configuration(), self._clock.utc().timestamp())

    def describe_configuration(self) -> dict[str, KeyDict]:
        """Return the units of what `read_configuration` returns."""
        return data_keys(self._configuration(), f"gonio:{self.name}")

    def _configuration(self) -> dict[str, Value]:
        exposing, name = self._camera.exposing, self.name
        return {
            f"{name}_identity": self._camera.identity(),
            f"{name}_window_width_mm": float(exposing.patch.width_mm),
            f"{name}_window_height_mm": float(exposing.patch.height_mm),
            f"{name}_frames": exposing.frames,
            f"{name}_dark_frames": exposing.dark_frames,
        }

    def _light_sample(self) -> None:
        self._motion.place_sample()
        self._lamp.light()

    def _close_shutter(self) -> None:
        if self._rig.lamp.darkened_by == "shutter":
            self._lamp.darken()

    def _take(self) -> None:
        self._values = self._camera.take()
        self._time_s = self._clock.utc().timestamp()
