"""Measurement of a camera's calibration: darks, flat field and levels, with the rig's devices.

Nothing moves. What is measured is checked at once, so that a covered lens or an open shutter costs
no more than the step in which it shows.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from acquisition.calibration import checks
from acquisition.calibration.exposure_search import exposure_reaching, share_of_scale
from acquisition.calibration.frame_statistics import level_of, series_of, stack_of
from acquisition.calibration.patch import Patch, patch_of
from acquisition.calibration.plan import FLAT_FRAMES, FLAT_TARGET, CalibrationPlan
from acquisition.measure.hot_pixels import find_hot_pixels
from analysis.calibration.level_series import LevelSeries
from analysis.calibration.pixel_maps import Stack
from instrument.devices import Camera, Frame, Lamp, Operator, Request

_SEED = 1288  # of the order of exposures: the same each time
PLACE = (
    "Place a matt white surface on the table so that it fills the picture without gloss; the lamp "
    "is on and warm, automatic exposure and gain are off"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Measured:
    """Measurement of a camera: levels of the patch, and stacks of whole pictures."""

    lit: LevelSeries
    dark: LevelSeries
    flat: Stack
    short_dark: Stack
    long_dark: Stack
    patch: Patch


@dataclass(frozen=True, slots=True, kw_only=True)
class _Darks:
    """Levels of the darks, stacks of the shortest and the longest one, and the patch."""

    levels: LevelSeries
    short: Stack
    long: Stack
    patch: Patch


@dataclass(slots=True, kw_only=True)
class CameraCalibrator:
    """Devices of a rig at work on a plan; `say` tells the operator what is going on."""

    plan: CalibrationPlan
    camera: Camera
    lamp: Lamp
    operator: Operator
    say: Callable[[str], None]

    def measure(self) -> Measured:
        """Measure everything; the lamp is left lit."""
        self.operator.ask(Request("place", PLACE, surface="sample"))
        if self.plan.rig.lamp.darkened_by == "shutter":
            self.lamp.light()
        flat = self._flat()
        self.lamp.darken()
        darks = self._darks(flat)
        self.lamp.light()
        return Measured(
            lit=self._levels(darks.patch), dark=darks.levels, flat=flat, short_dark=darks.short,
            long_dark=darks.long, patch=darks.patch,
        )  # fmt: skip

    def _darks(self, flat: Stack) -> _Darks:
        """Take frames without light: of the shortest and the longest exposure, then of the others.

        The hot pixels in the longest are no part of the patch. No more than one series of frames is
        held at a time.
        """
        exposures = self.plan.dark_exposures_s()
        self.say(f"darks: {len(exposures)} exposures")
        series = [self._dark(e) for e in (exposures[0], exposures[-1])]
        checks.require_dark([frames[0] for frames in series], self.plan.rig)
        short, long = map(stack_of, series)
        camera = self.plan.rig.camera
        patch = patch_of(flat, camera.black_level_dn, find_hot_pixels(long.mean_dn, camera))
        start_s = series[0][0].time_s
        levels = [level_of(frames, patch.level, start_s) for frames in series]
        del series
        levels += [level_of(self._dark(e), patch.level, start_s) for e in exposures[1:-1]]
        found = series_of(levels, patch.pixels)
        checks.require_exposures(exposures, found.exposure_s.tolist())
        return _Darks(levels=found, short=short, long=long, patch=patch)

    def _dark(self, exposure_s: float) -> list[Frame]:
        """Take the frames of a dark."""
        return self._frames(exposure_s, self.plan.dark_frames(exposure_s))

    def _flat(self) -> Stack:
        """Take the flat field near half of full scale."""
        exposure_s = self._exposure_for(FLAT_TARGET)
        self.say(f"flat field: {FLAT_FRAMES} frames at {exposure_s:g} s")
        frames = self._frames(exposure_s, FLAT_FRAMES)
        checks.require_unsaturated(frames, self.plan.rig)
        return stack_of(frames)

    def _levels(self, patch: Patch) -> LevelSeries:
        """Take the lit levels in a random order."""
        exposures = self.plan.lit_exposures_s(self._exposure_for(1.0, patch))
        self.say(f"photon transfer: {len(exposures)} exposures to {exposures[-1]:.3g} s")
        order = np.random.default_rng(_SEED).permutation(len(exposures)).tolist()
        levels, start_s = [], None
        for number in order:
            frames = self._frames(exposures[number], self.plan.frames)
            start_s = frames[0].time_s if start_s is None else start_s
            levels.append(level_of(frames, patch.level, start_s))
        return series_of(levels, patch.pixels)

    def _exposure_for(self, share: float, patch: Patch | None = None) -> float:
        """Return the exposure in seconds at which the bright pixels reach a share of full scale."""
        return exposure_reaching(share, lambda e: self._share(e, patch), self.plan.rig.camera)

    def _share(self, exposure_s: float, patch: Patch | None) -> float:
        """Return the level of the bright pixels of one frame, as a share of full scale."""
        image = self._frames(exposure_s, 1)[0].image
        level = np.percentile(image, 95) if patch is None else np.mean(image[patch.level])
        return share_of_scale(float(level), self.plan.rig.camera)

    def _frames(self, exposure_s: float, count: int) -> list[Frame]:
        """Take frames at an exposure in seconds, as nearly as the camera can set it."""
        self.camera.set_exposure_s(exposure_s)
        return self.camera.grab(count)
