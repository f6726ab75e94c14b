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
    transmittance_at_cosine,
    transmittance_with_gradients,
    wolff_polynomial,
)
from instrument.geometry import FloatArray, Geometry, IntArray

# Angles up to which the distinct ones are searched for: a scan, and not a block of a picture.
_MOST_SEARCHED = 16_000


@cached_per_geometry
def distinct_cosines(geometry: Geometry) -> tuple[FloatArray, IntArray]:
    """Cosines (M,) of the distinct angles of lamp and camera, and the index (2, ...) of both.

    Dimensionless.
    """
    both = np.stack([geometry.theta_i, geometry.theta_r])
    if both.size > _MOST_SEARCHED:
        return np.cos(both.ravel()), np.arange(both.size).reshape(both.shape)
    angles, index = np.unique(both, return_inverse=True)
    return np.cos(angles), np.reshape(index, both.shape)


def refracted(cosine: FloatArray, n: float) -> FloatArray:
    """Cosine inside: sqrt(1 - sin^2(theta)/n^2), accurate at grazing for n near 1.

    Of the shape of `cosine`, that of theta outside; dimensionless.
    """
    squared = (n - 1) * (n + 1) + cosine * cosine
    return np.asarray(np.minimum(np.sqrt(squared) / n, 1.0))  # rounding may leave it above 1


def both_transmittances(geometry: Geometry, n: float, epsilon: float | None = None) -> FloatArray:
    """(1 - F(theta_i, n)) (1 - F(asin(sin(theta_r)/n), 1/n)): the way in and the way out.

    Dimensionless, of the geometry's shape. The way out transmits like the way in from theta_r. With
    an `epsilon` by Wolff's polynomial.
    """
    if epsilon is not None:
        F_i, F_r = (wolff_polynomial(t, epsilon) for t in (geometry.theta_i, geometry.theta_r))
        return (1 - F_i) * (1 - F_r)
    cosine, index = distinct_cosines(geometry)
    T = transmittance_at_cosine(cosine, n)[index]
    return np.asarray(T[0] * T[1])


def both_with_gradient(geometry: Geometry, n: float) -> tuple[FloatArray, FloatArray]:
    """The exact `both_transmittances` and its derivative by n, of the geometry's shape."""
    cosine, index = distinct_cosines(geometry)
    one, by_n, _ = transmittance_with_gradients(cosine, n)
    T, dT = one[index], by_n[index]
    return T[0] * T[1], T[1] * dT[0] + T[0] * dT[1]


def log_lowest(n: float) -> float:
    """ln of the cosine inside at grazing, the lowest of all rays."""
    return math.log(float(refracted(np.cos(np.array(np.pi / 2)), n)))
