"""Lambert's law: the same radiance in every direction.

What to use when: a smooth matte surface, and the reference that every rougher one is compared with.

Source: J. H. Lambert, Photometria (1760), as quoted by Oren and Nayar 1995, section 1.
"""

from __future__ import annotations

import numpy as np

from analysis.models.base import Model, Parameter
from instrument.geometry import FloatArray, Geometry

ALBEDO = Parameter("albedo", "1", 0.0, 1.0, 0.5, scale=True)

DARKEST = 1e-9
"""Stand-in for an albedo of 0, at which a relative error is defined only as a limit."""


def lambert_brdf(geometry: Geometry, albedo: float) -> FloatArray:
    """Lambert's BRDF: albedo / pi, the same in every direction. As in `Model.brdf`."""
    return np.full(geometry.shape, albedo / np.pi)


def lambert_gradient(geometry: Geometry, albedo: float) -> dict[str, FloatArray]:
    """Derivative of `lambert_brdf` by the albedo. As in `Model.gradient`."""
    del albedo  # the derivative is the same at every albedo
    return {"albedo": np.full(geometry.shape, 1 / np.pi)}


LAMBERT = Model("lambert", (ALBEDO,), lambert_brdf, lambert_gradient)
