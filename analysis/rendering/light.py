"""Distant lamps of a picture."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from instrument.geometry import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Light:
    """Distant lamp: unit vector (3,) to it, and its irradiance on a plane that faces it."""

    direction: FloatArray
    irradiance: float = 1.0

    def __post_init__(self) -> None:
        if self.direction[2] < 0:
            angle = math.degrees(math.acos(max(float(self.direction[2]), -1.0)))
            raise ValueError(
                f"lamp at {angle:.4g} degrees from the viewer; allowed: 0 to 90 degrees, as a "
                "picture knows the surface from the viewer's side only"
            )
        if not (math.isfinite(self.irradiance) and self.irradiance >= 0):
            raise ValueError(f"irradiance = {self.irradiance:g}; allowed: 0 or more")


def light(theta_deg: float, phi_deg: float = 0.0, irradiance: float = 1.0) -> Light:
    """Return the lamp at `theta_deg` from the viewer, at the azimuth `phi_deg`, both in degrees.

    `theta_deg` from -90 to 90; azimuth 0 is to the right, 90 above. Raises `ValueError` for a lamp
    behind the surface.
    """
    theta, phi = math.radians(theta_deg), math.radians(phi_deg)
    # At 90 degrees rounding must not put the lamp behind the surface.
    ahead = 0.0 if abs(theta_deg) == 90 else math.cos(theta)
    across = math.sin(theta)
    return Light(np.array([across * math.cos(phi), across * math.sin(phi), ahead]), irradiance)


HEADLIGHT = light(0.0)
"""Lamp in the viewer's own direction."""
