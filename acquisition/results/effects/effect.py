"""One effect of an imperfect bench on the values of a run, and what it is computed from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from acquisition.results.effects.quick_fit import QuickFit, quick_fit
from instrument.config.protocol import Protocol
from instrument.config.rig import Rig
from instrument.geometry import FloatArray
from instrument.record.reading import Reading


@dataclass(frozen=True, kw_only=True)
class Readings:
    """Readings of the N points of a run, and for each the white tile's reading; None without it.

    value: (N,), BRDF in 1/sr, or radiance over cos(theta_i) in any unit without a white tile.
    absolute: the value is a BRDF.
    """

    points: Sequence[Reading]
    tiles: Sequence[Reading | None]
    value: FloatArray
    absolute: bool
    rig: Rig
    protocol: Protocol

    def angles_deg(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Angles theta_i, theta_r and dphi of the points, (N,) each, in degrees."""
        names = ("theta_i_deg", "theta_r_deg", "dphi_deg")
        theta_i, theta_r, dphi = (np.array([getattr(p, n) for p in self.points]) for n in names)
        return theta_i, theta_r, dphi

    @cached_property
    def fit(self) -> QuickFit | None:
        """Quick fit to the values; None if there are too few points to tell."""
        return quick_fit(self.angles_deg(), self.value, absolute=self.absolute)

    def of_points(self, name: str) -> FloatArray:
        """Numbers of the points' readings, (N,), in the unit of their name."""
        return np.array([getattr(p, name) for p in self.points], dtype=np.float64)

    def of_tiles(self, name: str) -> FloatArray:
        """Numbers of the tile's readings, (N,), in the unit of their name; NaN without a tile."""
        return np.array([np.nan if t is None else getattr(t, name) for t in self.tiles])


@dataclass(frozen=True, slots=True, kw_only=True)
class Effect:
    """Relative change of the values by an effect: `by_one` (N,) times its size.

    size: the expected one, which the values are corrected for. u: its standard uncertainty.
    independent: the sign of `by_one` differs at random from point to point.
    theta_i_deg, theta_r_deg, dphi_deg: (N,) or 0, change of the true angles by a size of 1.
    """

    name: str
    by_one: FloatArray
    u: float
    size: float = 0.0
    independent: bool = False
    theta_i_deg: FloatArray | float = 0.0
    theta_r_deg: FloatArray | float = 0.0
    dphi_deg: FloatArray | float = 0.0
