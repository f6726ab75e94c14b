"""Rays through a flat dielectric interface: their cosines inside, and how much light gets through.

A scan has few distinct angles: what depends on one angle alone is computed for each of these once.

Source: L. B. Wolff, S. K. Nayar, M. Oren, "Improved Diffuse Reflection Models for Computer
Vision", International Journal of Computer Vision 30 (1998), section 2.2.
"""

from __future__ import annotations

import math

import numpy as np

from analysis.models.base import cached_per_geometry
from analysis.models.smooth.fresnel import (
    transmittance,
    transmittance_with_gradients,
    wolff_polynomial,
)
from instrument.geometry import FloatArray, Geometry, IntArray

# Angles up to which the distinct ones are searched for: a scan, and not a picture.
_MOST_SEARCHED = 4096


@cached_per_geometry
def distinct_angles(geometry: Geometry) -> tuple[FloatArray, IntArray]:
    """Angles of lamp and camera in radians, (M,), and the index (2, ...) of both among them."""
    both = np.stack([geometry.theta_i, geometry.theta_r])
    if both.size > _MOST_SEARCHED:
        return both.ravel(), np.arange(both.size).reshape(both.shape)
    angles, index = np.unique(both, return_inverse=True)
    return angles, np.reshape(index, both.shape)


def refracted(theta: FloatArray, n: float) -> FloatArray:
    """Cosine inside: sqrt(1 - sin^2(theta)/n^2), accurate at grazing for n near 1.

    Of the shape of `theta`, in radians.
    """
    squared = (n - 1) * (n + 1) + np.square(np.cos(theta))
    return np.asarray(np.minimum(np.sqrt(squared) / n, 1.0))  # rounding may leave it above 1


def both_transmittances(geometry: Geometry, n: float, epsilon: float | None = None) -> FloatArray:
    """(1 - F(theta_i, n)) (1 - F(asin(sin(theta_r)/n), 1/n)): the way in and the way out.

    Dimensionless, of the geometry's shape. The way out transmits like the way in from theta_r. With
    an `epsilon` by Wolff's polynomial.
    """
    theta, index = distinct_angles(geometry)
    one = transmittance(theta, n) if epsilon is None else 1 - wolff_polynomial(theta, epsilon)
    lamp, camera = one[index]
    return np.asarray(lamp * camera)


def both_with_gradient(geometry: Geometry, n: float) -> tuple[FloatArray, FloatArray]:
    """The exact `both_transmittances` and its derivative by n, of the geometry's shape."""
    theta, index = distinct_angles(geometry)
    one, by_n, _ = transmittance_with_gradients(theta, n)
    T, dT = one[index], by_n[index]
    return T[0] * T[1], T[1] * dT[0] + T[0] * dT[1]


def log_lowest(n: float) -> float:
    """ln of the cosine inside at grazing, the lowest of all rays."""
    return math.log(float(refracted(np.array(np.pi / 2), n)))
