"""Methods for Beckmann and Spizzichino's lobe: two limits, truncated sums, and the adaptive sum.

All differ in the sum over m alone, so that their errors depend on g and q only: the error maps of
the lobe have these two axes. Far from the lobe the sum spans hundreds of decades and no limit
follows it: there an error is relative to FLOOR.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial

import numpy as np

from analysis.accuracy.method import Cost, Method, MethodFamily, constant_bound, fixed_cost
from analysis.models.base import Ranges
from analysis.models.error_maps import ABSOLUTE, RELATIVE, Levels, cell_at, maps
from analysis.models.specular.beckmann_spizzichino import (
    CORRELATION_LENGTH,
    SCALE,
    SIGMA_H,
    TERMWISE_BELOW,
    largest_term,
    lobe_brdf,
    lobe_exponent,
    lobe_factor,
    optical_roughness,
    rough_lobe_brdf,
    smooth_lobe_brdf,
)
from instrument.geometry import FloatArray, Geometry

TERMS = (10, 100)
MAPPED = ("smooth", "rough", *(f"{count} terms" for count in TERMS))
"""Methods that have a map, in its order."""

GRID: dict[str, FloatArray] = {
    "ln_g": np.log(np.geomspace(1e-6, 1e7, 131)),
    "ln_q": np.log(np.geomspace(1e-4, 1e8, 121)),
}
"""Edges of the map's cells. The first cells reach down to g = 0 and q = 0."""

FLOOR = 1e-6
"""In 1/sr: white has 0.3, and one count of 16 bits is 5e-6 of it. Less cannot be measured."""

_LEAST_HEIGHT = 1e-100  # in wavelengths; the limit of a plane, where geometrical optics has 1/0
_COUNTED = 512  # geometries from which the cost of the adaptive sum is estimated


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
    """The sum of `lobe_brdf` by each of the MAPPED methods, in turn.

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


def lobe_bound(name: str, geometry: Geometry, ranges: Ranges) -> FloatArray:
    """Largest error of one of the MAPPED methods relative to the lobe or FLOOR, (N,)."""
    (low_h, high_h), (low_T, high_T) = ranges["sigma_h"], ranges["correlation_length"]
    tiny = np.finfo(np.float64).tiny
    with np.errstate(under="ignore"):
        g = [np.log(np.maximum(optical_roughness(geometry, h), tiny)) for h in (low_h, high_h)]
        q = [np.log(np.maximum(lobe_exponent(geometry, T), tiny)) for T in (low_T, high_T)]
    at_g = [cell_at(GRID["ln_g"], end) for end in g]
    at_q = [cell_at(GRID["ln_q"], end) for end in q]
    wide = [int(np.max(b - a, initial=0)) + 1 for a, b in (at_g, at_q)]
    k, first = MAPPED.index(name), (at_g[0], at_q[0])
    relative = RELATIVE.errors(_windows(maps()["lobe"][k], *wide)[first])
    absolute = ABSOLUTE.errors(_windows(maps()["lobe_absolute"][k], *wide)[first])
    most = ranges["scale"][1] * lobe_factor(geometry, high_T) / FLOOR
    return np.asarray(np.minimum(relative, most * absolute))


def _windows(levels: Levels, rows: int, columns: int) -> Levels:
    """Largest level in the window of that many rows and columns that begins at each cell."""
    padded = np.pad(levels, ((0, rows - 1), (0, columns - 1)))
    down = np.lib.stride_tricks.sliding_window_view(padded, rows, axis=0).max(axis=-1)
    return np.asarray(np.lib.stride_tricks.sliding_window_view(down, columns, axis=1).max(axis=-1))


def _adaptive_cost(geometry: Geometry, ranges: Ranges) -> Cost:
    """Cost by the number of terms, estimated from some geometries in the middle of the ranges."""
    height, length = (sum(ranges[name]) / 2 for name in ("sigma_h", "correlation_length"))
    some = next(iter(geometry.blocks(_COUNTED)), (None, geometry))[1]
    peak = largest_term(optical_roughness(some, height), lobe_exponent(some, length))
    few = peak < TERMWISE_BELOW
    most = float(np.max(peak, initial=0.0, where=few))
    terms = math.ceil(most + 9 * math.sqrt(most) + 12)
    share = float(np.mean(few)) if few.size else 1.0
    each = 2.2 + share * 0.09 * terms + (1 - share) * 8.5
    call = 1500 + (90 * terms if share > 0 else 0) + (9000 if share < 1 else 0)
    return Cost(call, each, call, each)


def _rough(
    geometry: Geometry, scale: float, sigma_h: float, correlation_length: float
) -> FloatArray:
    return rough_lobe_brdf(geometry, scale, max(sigma_h, _LEAST_HEIGHT), correlation_length)


def _truncated(count: int) -> Method:
    name = f"{count} terms"
    kernel, bound = partial(first_terms_brdf, count=count), partial(lobe_bound, name)
    return Method(name, kernel, bound, fixed_cost(300 + 120 * count, 1.2 + 0.1 * count))


BECKMANN_LOBE = MethodFamily(
    "lobe",
    (SCALE, SIGMA_H, CORRELATION_LENGTH),
    (
        Method("smooth", smooth_lobe_brdf, partial(lobe_bound, "smooth"), fixed_cost(270, 1.1)),
        Method("rough", _rough, partial(lobe_bound, "rough"), fixed_cost(270, 1.1)),
        *map(_truncated, TERMS),
        Method("adaptive", lobe_brdf, constant_bound(1e-9), _adaptive_cost),
    ),
    {"scale": "high", "sigma_h": "log", "correlation_length": "log"},
    FLOOR,
)
