"""Darks: without light, counts rise with the exposure by the dark current and by nothing else.

Whether a dark has light in it is told by its rise above a dark of another exposure. A constant
offset from the rig file's black level does no harm: it is subtracted. Light of the lamp that passes
a shutter or a lid does: the points are too low by it. Light of the room is subtracted correctly
only where it is the same in every pose, and nobody knows that it is. So little of it is taken as
uncertain, and more than `MOST_LIGHT` ends the scan.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from acquisition.measure.hot_pixels import without_hot_pixels
from acquisition.measure.radiometry import Dark
from acquisition.measure.window import Window
from acquisition.plan.exposure_ladder import exposure_ladder_s
from instrument.config.rig import Rig

MOST_LIGHT = 0.01
"""Share of the light from a white sample, above which the light in a dark ends the scan.

Screens and lamps of instruments give some 0.1 % on a dark bench, ceiling lamps 5 % and more
(assumed: 2 and 500 lx, beside 2000 lx and more of the lamp).
"""
_HOTTER = 4.0  # times the stated dark current: it doubles every 5 to 10 K (EMVA 1288, release 4.0)
_WANDER_DN = 1.0  # rounding to counts, and the wander of a camera's black level between two darks
_COVERAGE = 6.0  # times the noise: 200 scans of 20 darks raise no false alarm
_OFFSET = 0.05  # of the range of counts: the rig file's black level, where nothing measures it
REFERENCE_FRAMES = 4


@dataclass(frozen=True, slots=True)
class Excess:
    """Counts of a dark in DN that neither black level nor dark current explains.

    found_dn: their amount, of either sign. tolerated_dn: what noise leaves open. limit_dn: more is
    an interlock; it also leaves room for a sensor that is warmer than the rig file's dark current.
    """

    exposure_s: float
    found_dn: float
    tolerated_dn: float
    limit_dn: float

    @property
    def light_dn(self) -> float:
        """Light that may be in the dark: a warmer sensor would explain it as well."""
        return max(abs(self.found_dn) - self.tolerated_dn, 0.0)

    @property
    def is_too_much(self) -> bool:
        """True if the dark cannot be used."""
        return abs(self.found_dn) > self.limit_dn

    def text(self) -> str:
        """Return what was found and expected in words."""
        return (
            f"dark at {self.exposure_s:g} s: {self.found_dn:+.3g} DN beside black level and dark "
            f"current; allowed: {self.limit_dn:.3g} DN"
        )


@dataclass(slots=True)
class DarkCheck:
    """Comparison of each dark with one of another exposure, the reference."""

    rig: Rig
    _reference: Dark | None = field(default=None, init=False)

    def reference_s(self, exposures_s: Sequence[float]) -> float | None:
        """Return the exposure of the reference to be taken before these darks, None if none is.

        It is the shortest one, or another where that itself is the first dark.
        """
        ladder = exposure_ladder_s(self.rig.camera)
        if self._reference is not None or len(ladder) == 1 or len(exposures_s) > 1:
            return None
        return ladder[0] if exposures_s[0] > ladder[0] else ladder[min(4, len(ladder) - 1)]

    def set_reference(self, darks: Sequence[Dark]) -> None:
        """Compare later darks with the one of these that has the shortest exposure."""
        if self._reference is None:
            self._reference = min(darks, key=lambda dark: dark.exposure_s, default=None)

    def forget_reference(self) -> None:
        """Have the reference taken again: it may have been as wrong as the dark."""
        self._reference = None

    def excess(self, dark: Dark, window: Window) -> Excess:
        """Return the excess of a dark within a window."""
        camera, exposure_s = self.rig.camera, dark.exposure_s
        mean, u = _level(dark, window)
        base = self._reference
        if base is None or base.exposure_s == exposure_s:
            apart_s, rise = exposure_s, mean - camera.black_level_dn
            open_dn = _OFFSET * (camera.max_dn - camera.black_level_dn)
        else:
            base_mean, base_u = _level(base, window)
            apart_s, rise = exposure_s - base.exposure_s, mean - base_mean
            u, open_dn = math.hypot(u, base_u), 0.0
        per_s = camera.dark_current_electrons_per_s / camera.electrons_per_dn
        white_per_s = self.rig.lamp.white_electrons_per_s / camera.electrons_per_dn
        scale = exposure_s / apart_s
        tolerated = (_COVERAGE * u + _WANDER_DN + open_dn) * abs(scale)
        warmer_per_s = (_HOTTER - 1) * per_s
        return Excess(
            exposure_s,
            found_dn=(rise - per_s * apart_s) * scale,
            tolerated_dn=tolerated,
            limit_dn=tolerated + (warmer_per_s + MOST_LIGHT * white_per_s) * exposure_s,
        )


def _level(dark: Dark, window: Window) -> tuple[float, float]:
    """Return the mean of a dark in DN within the window, without hot pixels, and its noise u."""
    own, _ = without_hot_pixels(window, dark.hot)
    total = float(own.weights.sum())
    if not total > 0:  # the window lies outside the picture
        return float(dark.mean.mean()), float(np.sqrt(dark.variance.mean() / dark.mean.size))
    noise = np.sum(own.weights**2 * dark.variance[own.crop]) / dark.frames
    return own.mean(dark.mean[own.crop]) / total, float(np.sqrt(noise)) / total
