"""Camera with the measuring window: one reading of the radiance where the axes stand."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from acquisition.engine.engine import Devices
from acquisition.engine.exposure.search import ExposureSearch
from acquisition.engine.onlookers import KnownLamp
from acquisition.engine.retrying_camera import RetryingCamera
from acquisition.facility.devices.motion import Motion
from acquisition.facility.devices.readings import Value
from acquisition.interlocks.watched_camera import WatchedCamera
from acquisition.measure.linearity import require_possible_times
from acquisition.measure.placement import Placement
from acquisition.measure.radiometry import Dark, Signal, average_dark, measure
from acquisition.measure.window import Window, window_at
from instrument.config.protocol import PatchConfig, Protocol
from instrument.config.rig import Rig
from instrument.devices import Frame
from instrument.pinhole import Pinhole


@dataclass(frozen=True, slots=True, kw_only=True)
class Exposing:
    """Measured patch, frames of one reading and of one dark, and level to reach.

    target: share of full scale for the brightest part of the window.
    """

    patch: PatchConfig = field(default_factory=lambda: PatchConfig(width_mm=20.0, height_mm=20.0))
    frames: int = 4
    dark_frames: int = 8
    target: float = 0.7

    @classmethod
    def of(cls, protocol: Protocol) -> Exposing:
        """Return what a protocol says."""
        return cls(
            patch=protocol.window,
            frames=protocol.frames_per_point,
            dark_frames=protocol.dark_frames,
            target=protocol.exposure_target,
        )


class WindowCamera:
    """Takes readings in the rig's thread; keeps one dark for each exposure.

    `exposure_s`: exposure of each reading in seconds; None for the one that suits the brightness.
    """

    def __init__(
        self, rig: Rig, devices: Devices, lamp: KnownLamp, motion: Motion, exposing: Exposing
    ) -> None:
        self._rig, self._devices, self._motion, self._lamp = rig, devices, motion, lamp
        self.identity = devices.camera.identity
        watched = WatchedCamera(devices.camera, rig.camera)
        wait_s = rig.camera.reconnect_s
        self._camera = RetryingCamera(watched, devices.clock, wait_s, lambda: None)
        self._search = ExposureSearch(self._camera, rig.camera, exposing.target)
        self.exposing, self._pinhole = exposing, Pinhole.of(rig)
        self._darks: dict[float, Dark] = {}
        self._last_s = rig.camera.min_exposure_s
        self._taken = 0
        self.exposure_s: float | None = None

    def take(self) -> dict[str, Value]:
        """Take the frames of a reading; return its values by name, with the unit in each name.

        The u of the radiance is that of this reading alone: noise, rounding, dark, placement and
        texture. Raises `DeviceError` where an axis has moved meanwhile.
        """
        self._motion.require_in_place()
        self._taken += 1
        self._devices.begin_step(self._taken, self._devices.clock.now_s())
        window = self._window()
        frames = self._frames(window)
        require_possible_times(frames)
        self._motion.require_in_place()
        dark = self._dark(frames[0].exposure_s)
        place = Placement(
            self._rig.u_placement_mm, self._motion.pose.theta_i, self._rig.lamp_distance_mm
        )
        least = self.exposing.patch.min_pixels
        return _values(measure(frames, dark, window, self._rig.camera, place, least), frames)

    def _window(self) -> Window:
        patch = self.exposing.patch
        return window_at(self._motion.pose.theta_r, self._pinhole, patch.width_mm, patch.height_mm)

    def _frames(self, window: Window) -> list[Frame]:
        if self.exposure_s is not None:
            self._search.set(self.exposure_s)
            return self._camera.grab(self.exposing.frames)
        first = self._search.frames(self._last_s, window)[-1]
        self._last_s = self._search.asked_s(first.exposure_s)
        more = self.exposing.frames - 1
        return [first, *(self._camera.grab(more) if more else [])]

    def _dark(self, exposure_s: float) -> Dark:
        """Return the dark of an exposure; the lamp is darkened once for it, and then as before."""
        if exposure_s not in self._darks:
            lit = self._lamp.state == "lit"
            self._lamp.darken()
            self._search.set(self._search.asked_s(exposure_s))
            dark = self._camera.grab(self.exposing.dark_frames)
            self._darks[exposure_s] = average_dark(dark, self._rig.camera)
            if lit:
                self._lamp.light()
        return self._darks[exposure_s]


def _values(signal: Signal, frames: list[Frame]) -> dict[str, Value]:
    exposure_s = frames[0].exposure_s
    u_dn = math.hypot(
        signal.u_noise_dn, signal.u_quantisation_dn, signal.u_dark_dn, signal.u_placement_dn,
        signal.u_texture_dn,
    )  # fmt: skip
    return {
        "radiance": signal.signal_dn / exposure_s,
        "u_radiance": u_dn / exposure_s,
        "exposure_s": exposure_s,
        "frames": len(frames),
        "window_pixels": signal.window_pixels,
        "saturated_pixels": signal.saturated_pixels,
        "peak_dn": signal.peak_dn,
        "flags": signal.flags,
    }
