"""Radiance of a surface under distant lamps, by the BRDF of any model.

What to use when: `render` for a picture; `radiance` for normals without a place, as on a
reflectance map or a cross-section: there nothing casts a shadow.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from analysis.rendering.angles import local_geometry
from analysis.rendering.light import Light
from analysis.rendering.material import Material
from analysis.rendering.shadows import lit
from analysis.rendering.surface import Surface
from instrument.geometry import Brdf, FloatArray


def render(surface: Surface, brdf: Brdf | Material, lights: Iterable[Light]) -> FloatArray:
    """Return the radiance (R, C) towards the viewer: per sr, times the unit of the irradiance.

    0 in a shadow, NaN beside the object. Light from one place of the object to another is left out.
    """
    found = np.where(surface.seen, 0.0, np.nan)
    for light in lights:
        seen = lit(surface, light)
        found[seen] += _reflected(surface.normal[seen], brdf, light)
    return found


def radiance(normal: FloatArray, brdf: Brdf | Material, lights: Iterable[Light]) -> FloatArray:
    """Return the radiance (...) towards the viewer of facets with unit normals (..., 3).

    0 for a facet that is turned away from the lamp or from the viewer.
    """
    flat = normal.reshape(-1, 3)
    found = np.zeros(len(flat))
    for light in lights:
        seen = (flat @ light.direction > 0) & (flat[:, 2] > 0)
        found[seen] += _reflected(flat[seen], brdf, light)
    return found.reshape(normal.shape[:-1])


def _reflected(normal: FloatArray, brdf: Brdf | Material, light: Light) -> FloatArray:
    """Radiance (N,) of facets that face lamp and viewer: BRDF x irradiance x cos(theta_i)."""
    if isinstance(brdf, Material):
        return light.irradiance * brdf.reflected(normal, light.direction)
    found = brdf(local_geometry(normal, light.direction))
    return np.asarray(found * light.irradiance * (normal @ light.direction))
