"""Methods for Beckmann and Spizzichino's lobe: the paper's two limits, its sum cut short, the sum.

All differ in the sum over m alone, so that their errors depend on g and q only: the maps of
`failure_maps` have these two axes. Far from the lobe the sum runs through hundreds of decades and
no limit follows it: there an error counts against FLOOR.
"""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from analysis.accuracy.failure_maps import ABSOLUTE, LOBE, RELATIVE, TERMS, Levels, lobe_grid, maps
from analysis.accuracy.method import Cost, Method, Physics, Ranges, cell_at, constant, priced
from analysis.models.specular.beckmann_spizzichino import (
    CORRELATION_LENGTH,
    FEW,
    SCALE,
    SIGMA_H,
    K,
    geometric_factor,
    largest_term,
    lobe_brdf,
    optical_roughness,
    rough_lobe_brdf,
    smooth_lobe_brdf,
)
from analysis.models.specular.torrance_sparrow import off_mirror2
from instrument.geometry import FloatArray, Geometry

FLOOR = 1e-6
"""In 1/sr: white has 0.3, and a count of 16 bits is worth 5e-6 of it. Less is not told from 0."""

_LEAST_HEIGHT = 1e-100  # in wavelengths; the limit of a plane, where geometrical optics has 1/0
_LIMIT = priced(270, 1.1, 270, 1.1)
_COUNTED = 512  # geometries from which the cost of the adaptive sum is foretold


def first_terms_brdf(
    geometry: Geometry, scale: float, sigma_h: float, correlation_length: float, count: int
) -> FloatArray:
    """The lobe in 1/sr with the first `count` terms of its sum, as in 1991 (52): 100 there."""
    g, q = optical_roughness(geometry, sigma_h), _exponent(geometry, correlation_length)
    total = np.zeros(geometry.shape)
    with np.errstate(under="ignore"):
        poisson = np.exp(-g)
        for term in range(1, count + 1):
            poisson = poisson * (g / term)
            total += poisson * np.exp(-q / term) / term
    return scale * _before_the_sum(geometry, correlation_length) * total


def map_bound(name: str, geometry: Geometry, ranges: Ranges) -> FloatArray:
    """Largest error of one of `failure_maps.LOBE` relative to the lobe or FLOOR, (N,)."""
    (low_h, high_h), (low_T, high_T) = ranges["sigma_h"], ranges["correlation_length"]
    edges, tiny = lobe_grid(), np.finfo(np.float64).tiny
    with np.errstate(under="ignore"):
        g = [np.log(np.maximum(optical_roughness(geometry, h), tiny)) for h in (low_h, high_h)]
        q = [np.log(np.maximum(_exponent(geometry, T), tiny)) for T in (low_T, high_T)]
    at_g = [cell_at(edges["ln_g"], end) for end in g]
    at_q = [cell_at(edges["ln_q"], end) for end in q]
    wide = [int(np.max(b - a, initial=0)) + 1 for a, b in (at_g, at_q)]
    k, first = LOBE.index(name), (at_g[0], at_q[0])
    relative = RELATIVE.errors(_windows(maps()["lobe"][k], *wide)[first])
    absolute = ABSOLUTE.errors(_windows(maps()["lobe_absolute"][k], *wide)[first])
    most = ranges["scale"][1] * _before_the_sum(geometry, high_T) / FLOOR
    return np.asarray(np.minimum(relative, most * absolute))


def _windows(levels: Levels, rows: int, columns: int) -> Levels:
    """The largest of the so many rows and columns that begin at each cell."""
    padded = np.pad(levels, ((0, rows - 1), (0, columns - 1)))
    down = np.lib.stride_tricks.sliding_window_view(padded, rows, axis=0).max(axis=-1)
    return np.asarray(np.lib.stride_tricks.sliding_window_view(down, columns, axis=1).max(axis=-1))


def _adaptive_cost(geometry: Geometry, ranges: Ranges) -> Cost:
    """By the terms that it takes: foretold from some of the geometries, in the ranges' middle."""
    height, length = (sum(ranges[name]) / 2 for name in ("sigma_h", "correlation_length"))
    some = next(iter(geometry.blocks(_COUNTED)), (None, geometry))[1]
    peak = largest_term(optical_roughness(some, height), _exponent(some, length))
    few = peak < FEW
    most = float(np.max(peak, initial=0.0, where=few))
    terms = math.ceil(most + 9 * math.sqrt(most) + 12)
    share = float(np.mean(few)) if few.size else 1.0
    each = 2.2 + share * 0.09 * terms + (1 - share) * 8.5
    call = 1500 + (90 * terms if share > 0 else 0) + (9000 if share < 1 else 0)
    return Cost(call, each, call, each)


def _exponent(geometry: Geometry, correlation_length: float) -> FloatArray:
    """q = v_xy^2 T^2/4 of 1991, (18)."""
    return np.asarray((K * correlation_length) ** 2 / 4 * off_mirror2(geometry))


def _before_the_sum(geometry: Geometry, correlation_length: float) -> FloatArray:
    """(cos_i/cos_r) pi T^2 D^2 in 1/sr: 1991, (77) over (80)."""
    ratio = np.cos(geometry.theta_i) / np.cos(geometry.theta_r)
    D = geometric_factor(geometry)
    return np.asarray(math.pi * correlation_length**2 * ratio * np.square(D))


def _rough(
    geometry: Geometry, scale: float, sigma_h: float, correlation_length: float
) -> FloatArray:
    return rough_lobe_brdf(geometry, scale, max(sigma_h, _LEAST_HEIGHT), correlation_length)


def _cut(count: int) -> Method:
    name = f"{count} terms"
    call, each = 300 + 120 * count, 1.2 + 0.1 * count
    return Method(
        name,
        partial(first_terms_brdf, count=count),
        partial(map_bound, name),
        priced(call, each, call, each),
    )


LOBE_OF_WAVES = Physics(
    "lobe",
    (SCALE, SIGMA_H, CORRELATION_LENGTH),
    (
        Method(
            "smooth", smooth_lobe_brdf, partial(map_bound, "smooth"), priced(270, 1.1, 270, 1.1)
        ),
        Method("rough", _rough, partial(map_bound, "rough"), priced(270, 1.1, 270, 1.1)),
        *map(_cut, TERMS),
        Method("adaptive", lobe_brdf, constant(1e-9), _adaptive_cost),
    ),
    lambda geometry: np.full(geometry.shape, 1e-9),
    {"scale": "high", "sigma_h": "log", "correlation_length": "log"},
    FLOOR,
)
