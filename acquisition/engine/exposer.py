"""The frames of a step: exposed to suit the brightness, with the dark that belongs to them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from acquisition.engine.retrying_camera import RetryingCamera
from acquisition.measure.radiometry import Dark, bright_level, dark_of
from acquisition.measure.window import Window
from acquisition.plan.exposure_ladder import NEARLY_FULL, longest_below
from acquisition.plan.plan import Step
from instrument.clock import Clock
from instrument.config.protocol import Protocol
from instrument.config.rig import Rig
from instrument.devices import Frame, Lamp, Surface
from instrument.record.reading import Reading
from instrument.record.record import Record

MAX_EXPOSURES_TRIED = 8  # from one end of any camera's ladder to the other in factors of four


@dataclass(frozen=True, slots=True)
class Exposed:
    """Frames of a step on their way to the record.

    `time_s` counts from the start of the scan; at `free_s` the rig can go on.
    """

    step: Step
    frames: list[Frame]
    dark: Dark
    time_s: float
    free_s: float
    time_utc: str


@dataclass(slots=True)
class Exposer:
    """Chooses exposures and keeps the darks; every dark is in the record."""

    camera: RetryingCamera
    lamp: Lamp
    clock: Clock
    protocol: Protocol
    rig: Rig
    record: Record
    _start_s: float = 0.0
    _darks: dict[float, Dark] = field(default_factory=dict)
    _before: frozenset[float] = frozenset()
    _last: dict[Surface, Reading] = field(default_factory=dict)

    def know(self, readings: Sequence[Reading]) -> None:
        """What a stopped scan has read already, in order: brightness, and whose darks are taken."""
        for reading in readings:
            self.seen(reading)
        self._before = frozenset(reading.exposure_s for reading in readings)

    def seen(self, reading: Reading) -> None:
        """From its brightness the next exposure of that surface is guessed."""
        self._last[reading.surface] = reading

    def start(self, elapsed_s: float) -> None:
        """Start the scan's time, or go on with it."""
        self._start_s = self.clock.now_s() - elapsed_s

    def expose(self, step: Step, window: Window) -> Exposed:
        """All frames of a step, none of them saturated where the camera's range allows it."""
        first = self._first_frame(step, window)
        frames = [first]
        if step.frames > 1:
            frames += self.camera.grab(step.frames - 1)
        time_s, time_utc = self._scan_s(), self.clock.utc().isoformat()
        dark = self._dark(first.exposure_s)
        return Exposed(step, frames, dark, round(time_s, 3), self._scan_s(), time_utc)

    def _scan_s(self) -> float:
        return self.clock.now_s() - self._start_s

    def _first_frame(self, step: Step, window: Window) -> Frame:
        """Try exposures until the brightest part of the window is within the target."""
        exposure_s = self._first_guess_s(step)
        tried: list[float] = []
        while True:
            tried.append(exposure_s)
            self.camera.set_exposure_s(exposure_s)
            frame = self.camera.grab(1)[0]
            exposure_s = self._suiting_s(frame, window)
            if exposure_s in tried or len(tried) == MAX_EXPOSURES_TRIED:
                return frame

    def _first_guess_s(self, step: Step) -> float:
        """From the brightness of this surface's last reading, or the plan's guess."""
        last = self._last.get(step.surface)
        if last is None or math.isnan(last.peak_dn):
            return step.expected_exposure_s
        return self._within_target_s(self._rate(last.peak_dn, last.exposure_s))

    def _suiting_s(self, frame: Frame, window: Window) -> float:
        """The exposure that this frame's brightness asks for."""
        counted = frame.image[window.crop][window.counted]
        if not counted.size:
            return frame.exposure_s
        camera, peak = self.rig.camera, bright_level(counted)
        if peak >= NEARLY_FULL * camera.max_dn:  # how far over the top cannot be seen
            return longest_below(frame.exposure_s / 4, camera)
        return self._within_target_s(self._rate(peak, frame.exposure_s))

    def _rate(self, peak_dn: float, exposure_s: float) -> float:
        """Counts per second of the brightest part."""
        return max(peak_dn - self.rig.camera.black_level_dn, 0.5) / exposure_s

    def _within_target_s(self, rate_dn_per_s: float) -> float:
        """The longest exposure of the ladder that keeps such a brightness within the target."""
        camera = self.rig.camera
        target = self.protocol.exposure_target * (camera.max_dn - camera.black_level_dn)
        return longest_below(target / rate_dn_per_s, camera)

    def _dark(self, exposure_s: float) -> Dark:
        """That exposure's dark; one that a resumed scan takes again costs none of its time."""
        if exposure_s not in self._darks:
            begun_s = self.clock.now_s()
            self.take_darks((exposure_s,))
            if exposure_s in self._before:
                self._start_s += self.clock.now_s() - begun_s
        return self._darks[exposure_s]

    def take_darks(self, exposures_s: Sequence[float]) -> None:
        """Darken the lamp, take the dark frames of these exposures, light it again."""
        if not exposures_s:
            return
        self.lamp.darken()
        self._note_hand("lamp covered for the darks")
        for exposure_s in exposures_s:
            self.camera.set_exposure_s(exposure_s)
            dark = dark_of(self.camera.grab(self.protocol.dark_frames), self.rig.camera)
            self._darks[exposure_s] = dark
            mean, noise = float(dark.mean.mean()), float(np.sqrt(dark.variance.mean()))
            time_utc = self.clock.utc().isoformat()
            self.record.add_dark(time_utc, exposure_s, dark.frames, mean, noise)
        self.lamp.light()
        self._note_hand("lamp uncovered")

    def _note_hand(self, text: str) -> None:
        if self.rig.lamp.darkened_by == "hand":
            self.record.add_event(self.clock.utc().isoformat(), "operator", text)
