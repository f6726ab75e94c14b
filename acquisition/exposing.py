"""The frames of a step: exposed to suit the brightness, with the dark that belongs to them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from acquisition.exposure import NEARLY_FULL, longest_below
from acquisition.plan import Step
from acquisition.radiometry import Dark, bright_level, dark_of
from acquisition.window import Window
from instrument.clock import Clock
from instrument.devices import Camera, Frame, Lamp, Surface
from instrument.protocol_config import Protocol
from instrument.record import Record
from instrument.rig_config import Rig

MAX_EXPOSURES_TRIED = 8  # from one end of any camera's ladder to the other in factors of four


@dataclass(frozen=True, slots=True)
class Exposed:
    """Frames of a step on their way to the record; `time_s` counts from the start of the scan."""

    step: Step
    frames: list[Frame]
    dark: Dark
    time_s: float
    time_utc: str


@dataclass(slots=True)
class Exposer:
    """Chooses exposures and keeps the darks; every dark is in the record."""

    camera: Camera
    lamp: Lamp
    clock: Clock
    protocol: Protocol
    rig: Rig
    record: Record
    _start_s: float = 0.0
    _darks: dict[float, Dark] = field(default_factory=dict)
    _rate_dn_per_s: dict[Surface, float] = field(default_factory=dict)

    def begin(self, darks_first_s: Sequence[float], elapsed_s: float) -> None:
        """Start the scan's time, or go on with it; take the darks that need a hand."""
        self._start_s = self.clock.now_s() - elapsed_s
        if darks_first_s:
            self._take_darks(darks_first_s)

    def expose(self, step: Step, window: Window) -> Exposed:
        """All frames of a step, none of them saturated where the camera's range allows it."""
        first = self._first_frame(step, window)
        frames = [first]
        if step.frames > 1:
            frames += self.camera.grab(step.frames - 1)
        time_s, time_utc = self.clock.now_s() - self._start_s, self.clock.utc().isoformat()
        return Exposed(step, frames, self._dark(first.exposure_s), time_s, time_utc)

    def _first_frame(self, step: Step, window: Window) -> Frame:
        """Try exposures until the brightest part of the window is within the target."""
        exposure_s = self._first_guess_s(step)
        tried: list[float] = []
        while True:
            tried.append(exposure_s)
            self.camera.set_exposure_s(exposure_s)
            frame = self.camera.grab(1)[0]
            exposure_s = self._suiting_s(step, frame, window)
            if exposure_s in tried or len(tried) == MAX_EXPOSURES_TRIED:
                return frame

    def _first_guess_s(self, step: Step) -> float:
        """From the brightness of this surface's last picture, or the plan's guess."""
        rate = self._rate_dn_per_s.get(step.surface)
        return step.expected_exposure_s if rate is None else self._within_target_s(rate)

    def _suiting_s(self, step: Step, frame: Frame, window: Window) -> float:
        """The exposure that this frame's brightness asks for."""
        counted = frame.image[window.crop][window.counted]
        if not counted.size:
            return frame.exposure_s
        camera, peak = self.rig.camera, bright_level(counted)
        if peak >= NEARLY_FULL * camera.max_dn:  # how far over the top cannot be seen
            return longest_below(frame.exposure_s / 4, camera)
        rate = max(peak - camera.black_level_dn, 0.5) / frame.exposure_s
        self._rate_dn_per_s[step.surface] = rate
        return self._within_target_s(rate)

    def _within_target_s(self, rate_dn_per_s: float) -> float:
        """The longest exposure of the ladder that keeps such a brightness within the target."""
        camera = self.rig.camera
        target = self.protocol.exposure_target * (camera.max_dn - camera.black_level_dn)
        return longest_below(target / rate_dn_per_s, camera)

    def _dark(self, exposure_s: float) -> Dark:
        if exposure_s not in self._darks:
            self._take_darks((exposure_s,))
        return self._darks[exposure_s]

    def _take_darks(self, exposures_s: Sequence[float]) -> None:
        """Darken the lamp, take the dark frames of these exposures, light it again."""
        self.lamp.darken()
        for exposure_s in exposures_s:
            self.camera.set_exposure_s(exposure_s)
            dark = dark_of(self.camera.grab(self.protocol.dark_frames), self.rig.camera)
            self._darks[exposure_s] = dark
            mean, noise = float(dark.mean.mean()), float(np.sqrt(dark.variance.mean()))
            time_utc = self.clock.utc().isoformat()
            self.record.add_dark(time_utc, exposure_s, dark.frames, mean, noise)
        self.lamp.light()
