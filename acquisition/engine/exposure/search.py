"""Search for the exposure at which the brightest part of the window is within the target."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

from acquisition.measure.radiometry import SATURATION_FRACTION, bright_level
from acquisition.measure.window import Window
from acquisition.plan.exposure_ladder import longest_exposure_s
from instrument.config.camera import CameraConfig
from instrument.devices import Frame

MAX_EXPOSURES_TRIED = 8  # spans the ladder of any camera in factors of four


class Exposing(Protocol):
    """Camera as far as an exposure is searched with it."""

    def set_exposure_s(self, exposure_s: float) -> float:
        """Set the exposure and return the value read back, in seconds."""

    def grab(self, count: int) -> list[Frame]:
        """Return `count` frames whose exposure began after this call."""


@dataclass(slots=True)
class ExposureSearch:
    """Exposures of a camera by the brightness that was seen; `target` is a share of full scale.

    `taken_s`: exposures that the camera confirmed, by what was asked for; it may round them.
    """

    camera: Exposing
    config: CameraConfig
    target: float
    taken_s: dict[float, float] = field(default_factory=dict)

    def set(self, exposure_s: float) -> None:
        """Set an exposure in seconds and note the one that the camera confirms."""
        self.taken_s[exposure_s] = self.camera.set_exposure_s(exposure_s)

    def asked_s(self, taken_s: float) -> float:
        """Return what to ask for, in seconds, so that the camera takes an exposure again."""
        return next((asked for asked, taken in self.taken_s.items() if taken == taken_s), taken_s)

    def frames(self, first_s: float, window: Window) -> list[Frame]:
        """Try exposures, `first_s` first; return one frame of each, that of the chosen one last."""
        exposure_s, frames, tried = first_s, list[Frame](), list[float]()
        while True:
            tried.append(exposure_s)
            self.set(exposure_s)
            frames.append(self.camera.grab(1)[0])
            exposure_s = self._suitable_s(frames[-1], window)
            if exposure_s in tried or len(tried) == MAX_EXPOSURES_TRIED:
                return frames

    def _suitable_s(self, frame: Frame, window: Window) -> float:
        """Return the exposure that suits the brightness of a frame."""
        counted = frame.brightest(window.crop)[window.counted]
        if not counted.size:
            return self.asked_s(frame.exposure_s)
        peak = bright_level(counted)
        if peak >= SATURATION_FRACTION * self.config.max_dn:  # the true brightness is unknown
            return longest_exposure_s(frame.exposure_s / 4, self.config, self.taken_s)
        return self.exposure_s(peak, frame.exposure_s)

    def exposure_s(self, peak_dn: float, exposure_s: float) -> float:
        """Return the exposure within the target, given the peak level seen at another exposure."""
        rate_dn_per_s = max(peak_dn - self.config.black_level_dn, 0.5) / exposure_s
        target_dn = self.target * (self.config.max_dn - self.config.black_level_dn)
        return longest_exposure_s(target_dn / rate_dn_per_s, self.config, self.taken_s)
