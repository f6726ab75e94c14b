"""White tile that is no perfect diffuser: its true radiance factor at any geometry."""

from __future__ import annotations

import numpy as np

from instrument.config.rig import SimulatedTile
from instrument.geometry import FloatArray, Geometry


def radiance_factor(geometry: Geometry, tile: SimulatedTile) -> FloatArray:
    """Return the true radiance factor of the tile, of the geometry's shape; a perfect white has 1.

    It falls with both angles, and rises towards forward grazing directions; never below 0.
    """
    cos_i, cos_r = np.cos(geometry.theta_i), np.cos(geometry.theta_r)
    falling = tile.falloff * ((1.0 - cos_i) + (1.0 - cos_r))
    grazing = (1.0 - cos_i**2) * (1.0 - cos_r**2) * (1.0 - geometry.cos_dphi) / 2.0
    at_normal = tile.at_normal * (1.0 - tile.aged)
    return np.maximum(at_normal * (1.0 - falling + tile.forward * grazing), 0.0)
