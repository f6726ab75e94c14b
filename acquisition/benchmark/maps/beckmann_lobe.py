"""Approximations of Beckmann and Spizzichino's lobe: its two limits, and truncated sums.

All differ in the sum over m alone, so that their errors depend on g and q only.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from analysis.models.specular.beckmann_spizzichino import (
    lobe_exponent,
    lobe_factor,
    optical_roughness,
)
from instrument.geometry import FloatArray, Geometry

TERMS = (10, 100)
"""Numbers of terms of the truncated sums."""


def first_terms(g: FloatArray, q: FloatArray, count: int) -> FloatArray:
    """Sum over the first `count` terms of e^-g g^m/(m! m) e^(-q/m).

    g and q: dimensionless arrays of one shape, which is the result's.
    """
    total = np.zeros(g.shape)
    with np.errstate(under="ignore"):
        poisson = np.exp(-g)
        for term in range(1, count + 1):
            poisson = poisson * (g / term)
            total += poisson * np.exp(-q / term) / term
    return total


def lobe_sums(g: FloatArray, q: FloatArray) -> Iterator[FloatArray]:
    """The sum of `lobe_brdf` in the limits g << 1 and g >> 1, then with each number of TERMS.

    g and q: dimensionless arrays of one shape, which is that of each result.
    """
    with np.errstate(under="ignore", over="ignore"):
        yield g * np.exp(-g - q)
        yield np.exp(-q / g) / g
        for count in TERMS:
            yield first_terms(g, q, count)


def first_terms_brdf(
    geometry: Geometry, scale: float, sigma_h: float, correlation_length: float, count: int
) -> FloatArray:
    """The lobe with the first `count` terms of its sum, as in 1991 (52): 100 there.

    Other arguments and result as in `Model.brdf`.
    """
    g, q = optical_roughness(geometry, sigma_h), lobe_exponent(geometry, correlation_length)
    return scale * lobe_factor(geometry, correlation_length) * first_terms(g, q, count)
