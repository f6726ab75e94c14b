"""Brightness across an upright cylinder, such as the body of a vase."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from analysis.rendering.light import Light
from analysis.rendering.material import Material
from analysis.rendering.render import radiance
from instrument.geometry import Brdf, FloatArray


def normals_across(angles_deg: FloatArray) -> FloatArray:
    """Return normals (N, 3) at angles (N,) in degrees from the viewer, positive to the right."""
    angle = np.radians(angles_deg)
    return np.stack([np.sin(angle), np.zeros_like(angle), np.cos(angle)], axis=-1)


def across(brdf: Brdf | Material, lights: Iterable[Light], angles_deg: FloatArray) -> FloatArray:
    """Return the radiance (N,) where the normal is so many degrees to the right of the viewer.

    As in Figure 24 of Oren and Nayar 1995. Per sr, times the unit of the irradiance.
    """
    return radiance(normals_across(angles_deg), brdf, lights)
