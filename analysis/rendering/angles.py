"""Angles about the normals of a surface, for one lamp and a viewer along z."""

from __future__ import annotations

import numpy as np

from instrument.geometry import FloatArray, Geometry


def local_geometry(normal: FloatArray, to_lamp: FloatArray) -> Geometry:
    """Return the angles (N,) of the lamp (3,) and of the viewer about unit normals (N, 3)."""
    x, y, z = normal.T
    a, b, c = to_lamp
    cos_i = normal @ to_lamp
    # Lamp and viewer across the normal: their cross products with it, and the angle between them.
    sin_i = np.sqrt((y * c - z * b) ** 2 + (z * a - x * c) ** 2 + (x * b - y * a) ** 2)
    dphi = np.arctan2(x * b - y * a, c - cos_i * z)
    return Geometry(
        np.minimum(np.degrees(np.arctan2(sin_i, cos_i)), 90.0),
        np.minimum(np.degrees(np.arctan2(np.hypot(x, y), z)), 90.0),
        np.mod(np.degrees(dphi), 360.0),
    )


def longitudes(normal: FloatArray, to_lamp: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Return the longitudes and latitudes (N,) of normals (N, 3), and the phase, in radians.

    As on a planet, whose equator is the plane of viewer and lamp: longitude 0 faces the viewer,
    that of the phase the lamp. Lit and seen are the longitudes from phase - 90 to 90 degrees.
    Latitudes are taken as positive: the two halves are alike.
    """
    a, b, c = to_lamp
    sine = float(np.hypot(a, b))
    along = np.array([a, b]) / sine if sine > 0 else np.array([1.0, 0.0])
    x = normal[:, 0] * along[0] + normal[:, 1] * along[1]
    y = normal[:, 1] * along[0] - normal[:, 0] * along[1]
    latitude = np.arctan2(np.abs(y), np.hypot(x, normal[:, 2]))
    return np.arctan2(x, normal[:, 2]), latitude, float(np.arctan2(sine, c))
