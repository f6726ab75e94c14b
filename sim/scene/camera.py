"""Simulated camera: renders the scene in simulated time."""

from __future__ import annotations

from instrument.clock import Clock
from instrument.devices import Frame, mono_picture
from instrument.errors import DeviceError
from sim.defects.camera import limit_range, read_back_s, true_exposure_s
from sim.scene.scene import Scene
from sim.scene.sensor import in_one, sensors_of


class SimulatedCamera:
    """Camera with the properties, and the defects, given in the rig file."""

    def __init__(self, scene: Scene, clock: Clock) -> None:
        self._scene, self._clock = scene, clock
        self._settings, self._defects = scene.rig.camera, scene.rig.simulation.camera_defects
        self._sensors = sensors_of(scene)
        self._set_s = self._settings.min_exposure_s

    def identity(self) -> str:
        """Return a description with size and bit depth."""
        s = self._settings
        colour = ", colour" if s.is_colour else ""
        return f"simulated camera, {s.width_px} x {s.height_px} pixels, {s.bit_depth} bit{colour}"

    def settings(self) -> dict[str, str]:
        """Return size in pixels, bit depth, and the present gain in %."""
        s = self._settings
        size = {"size_px": f"{s.width_px} x {s.height_px}", "bit_depth": str(s.bit_depth)}
        if s.is_colour:
            size["channels"] = str(s.channels)
        return {**size, "gain": f"{100 * self._scene.world.gain:g}"}

    def set_exposure_s(self, exposure_s: float) -> float:
        """Set the exposure in seconds; raise `DeviceError` outside the camera's range."""
        low, high = self._settings.min_exposure_s, self._settings.max_exposure_s
        if not low <= exposure_s <= high:
            raise DeviceError(
                f"camera: exposure {exposure_s:g} s asked for; allowed: {low:g} to {high:g} s"
            )
        self._set_s = exposure_s
        return read_back_s(exposure_s, self._defects)

    def grab(self, count: int) -> list[Frame]:
        """Take `count` frames, one after the other, in simulated time."""
        return [self._frame() for _ in range(count)]

    def close(self) -> None:
        """Do nothing: there is nothing to release."""

    def _frame(self) -> Frame:
        world = self._scene.world
        set_s = self._set_s * world.control
        exposure_s = true_exposure_s(set_s, self._defects) * world.exposure
        begin_s = self._clock.now_s() + self._settings.frame_overhead_s
        self._clock.sleep(self._settings.frame_overhead_s + exposure_s / 2)
        # In the middle: the mean of a drifting lamp.
        poses = self._scene.poses_during(begin_s, exposure_s)
        pictures = [sensor.picture(exposure_s, poses) for sensor in self._sensors]
        self._clock.sleep(exposure_s / 2)
        taken = [limit_range(picture, self._defects) for picture in pictures]
        image, read_s = in_one(taken), read_back_s(set_s, self._defects)
        if not self._settings.is_colour:
            return Frame(image, read_s, self._clock.now_s())
        mono = mono_picture(image, self._settings.max_dn)
        return Frame(mono, read_s, self._clock.now_s(), colour=image)
