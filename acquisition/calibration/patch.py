"""Patch of the picture in which a camera is calibrated: where the white surface is lit evenly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from analysis.calibration.pixel_maps import Stack, local_mean
from instrument.errors import NotDetermined
from instrument.geometry import BoolArray

_EVEN, _LIT = 0.9, 0.5  # of the brightest part: for levels, and for the flat field
_BRIGHTEST = 99.0  # percentile of the picture
_SMOOTH = 15  # side in pixels of the squares over which the light is averaged
_MOST_PIXELS = 1_000_000  # a gain within 0.02 %; more only take memory
_LEAST_SHARE, _LEAST_PIXELS = 0.2, 500  # of the picture, and for a gain within 5 %


@dataclass(frozen=True, slots=True)
class Patch:
    """Pixels for the levels, and those for the flat field; both (rows, columns), True if used."""

    level: BoolArray
    lit: BoolArray

    @property
    def pixels(self) -> int:
        """Number of pixels for the levels."""
        return int(np.count_nonzero(self.level))


def patch_of(flat: Stack, black_dn: float, hot: BoolArray) -> Patch:
    """Return the patch by a flat field in DN, without hot pixels, (rows, columns)."""
    signal, _ = local_mean(flat.mean_dn - black_dn, ~hot, _SMOOTH)
    brightest = float(np.percentile(signal, _BRIGHTEST))
    lit = signal >= _LIT * brightest
    share = float(np.mean(lit))
    level = (signal >= _EVEN * brightest) & ~hot
    if share < _LEAST_SHARE or np.count_nonzero(level) < _LEAST_PIXELS:
        raise NotDetermined(
            f"camera: the white surface fills {100 * share:.2g} % of the picture, "
            f"{np.count_nonzero(level)} pixels of it evenly; needed: {100 * _LEAST_SHARE:g} % and "
            f"{_LEAST_PIXELS} pixels. Take a larger surface, and see where it lies (gonio grab)"
        )
    return Patch(_thinned(level), lit)


def _thinned(level: BoolArray) -> BoolArray:
    """Return a regular choice of the pixels where there are more than any fit needs."""
    every = -(-int(np.count_nonzero(level)) // _MOST_PIXELS)
    chosen = np.zeros(level.size, dtype=bool)
    chosen[np.flatnonzero(level)[::every]] = True
    return chosen.reshape(level.shape)
