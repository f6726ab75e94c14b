"""Where the printed forms leave the exact integral: a table over sigma and the three angles.

What to use when: `departure` to learn by how much Lambert's, the qualitative (36) or the functional
form (33) + (34) is off in a scene, without integrating; `fails` to ask whether that is too much.

With lamp and camera up to this angle from the normal (degrees), at any azimuth and albedo, a form
keeps within 1, 5 and 20 % of the integral; "-" is nowhere:

=====  ===========  ================  ====================
sigma  Lambert      qualitative (36)  functional (33)+(34)
=====  ===========  ================  ====================
2      69, 80, 85   71, 80, 85        75, 81, 85
5      28, 66, 77   -, 68, 78         28, 73, 79
10     -, 37, 64    -, 51, 67         -, 43, 74
20     -, -, 33     -, -, 50          -, 24, 70
30     -, -, -      -, -, 37          -, 25, 73
45     -, -, -      -, -, 25          -, 11, 66
60     -, -, -      -, -, 21          -, 4, 53
=====  ===========  ================  ====================

The table itself, `departure.npz`, holds the two parts of the exact radiance on a grid of sigma, the
larger angle, the smaller one over the larger, and dphi; cubic splines lie between. The grid is
dense where the radiance bends: at grazing, at small sigma, and towards the plane of incidence.
`python -m analysis.models.rough.form_error` makes it anew, in a second.

Source: M. Oren, S. K. Nayar, International Journal of Computer Vision 14 (1995), section 4.4, where
the forms are fitted to the integral.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
from scipy.interpolate import NdBSpline, make_interp_spline

from analysis.models.rough.oren_nayar import (
    ALBEDO,
    SIGMA_DEG,
    lambert_brdf,
    oren_nayar_brdf,
    oren_nayar_qualitative_brdf,
)
from analysis.models.rough.oren_nayar_exact import oren_nayar_exact_brdf
from instrument.geometry import BoolArray, FloatArray, Geometry

LIMIT_DEG = 85.0
"""Larger angles from the normal are not in the table: there the integral itself is less certain."""

ERROR = 0.012
"""What interpolation adds to a departure, at most: near the mirror direction with both angles at 84
to 85 degrees (found: 0.0102). In 99 of 100 geometries it is below 0.001."""

FILE = Path(__file__).with_name("departure.npz")

_FORMS: dict[str, Callable[[Geometry, float, float], FloatArray]] = {
    "lambert": lambda geometry, albedo, _: lambert_brdf(geometry, albedo),
    "oren_nayar_qualitative": oren_nayar_qualitative_brdf,
    "oren_nayar": oren_nayar_brdf,
}
_DARKEST = 1e-9  # in place of an albedo of 0, at which a relative error is a limit


def departure(name: str, geometry: Geometry, albedo: float, sigma_deg: float) -> FloatArray:
    """Relative error of the form called `name` against the integral, of the geometry's shape.

    0.05 is 5 % too high. Infinite beyond LIMIT_DEG, where nothing is known. Raises `ValueError`
    for another form, albedo or sigma than the table has.
    """
    if name not in _FORMS:
        raise ValueError(f"form = {name!r}; allowed: {', '.join(_FORMS)}")
    albedo = max(ALBEDO.check(albedo), _DARKEST)
    SIGMA_DEG.check(sigma_deg)
    found = _FORMS[name](geometry, albedo, sigma_deg)
    off = found / integral(geometry, albedo, sigma_deg) - 1
    return np.where(_beyond(geometry), np.inf, off)


def fails(
    name: str, geometry: Geometry, albedo: float, sigma_deg: float, tolerance: float
) -> BoolArray:
    """Where `departure` is more than the tolerance (0.01 for 1 %), or not known."""
    return np.abs(departure(name, geometry, albedo, sigma_deg)) > tolerance


def integral(geometry: Geometry, albedo: float, sigma_deg: float) -> FloatArray:
    """`oren_nayar_exact` from the table, in 1/sr, off by ERROR at most; NaN beyond LIMIT_DEG."""
    larger = np.maximum(geometry.theta_i_deg, geometry.theta_r_deg)
    smaller = np.minimum(geometry.theta_i_deg, geometry.theta_r_deg)
    ratio = np.divide(smaller, larger, out=np.ones_like(larger), where=larger > 0)
    dphi = np.minimum(geometry.dphi_deg, 360 - geometry.dphi_deg)
    at = np.stack(np.broadcast_arrays(np.float64(sigma_deg), larger, ratio, dphi), axis=-1)
    direct, twice = np.moveaxis(_splines()(at, extrapolate=False), -1, 0)
    return np.asarray(albedo / math.pi * (direct + albedo * twice))


def _beyond(geometry: Geometry) -> BoolArray:
    return np.maximum(geometry.theta_i_deg, geometry.theta_r_deg) > LIMIT_DEG


@cache
def _splines() -> NdBSpline:
    """Cubic splines through the table, for both parts at once."""
    with np.load(FILE) as table:
        axes = [table[name] for name in ("sigma_deg", "larger_deg", "ratio", "dphi_deg")]
        values = table["direct_and_twice"].astype(np.float64)
    knots = []
    for axis, nodes in enumerate(axes):
        spline = make_interp_spline(nodes, values, k=3, axis=axis)
        knots.append(spline.t)
        values = np.moveaxis(spline.c, 0, axis)
    return NdBSpline(tuple(knots), values, 3)


def grid() -> dict[str, FloatArray]:
    """Nodes of the table, an array each: sigma_deg, larger_deg, ratio, dphi_deg."""
    return {
        "sigma_deg": SIGMA_DEG.high * np.linspace(0, 1, 21) ** 2,
        "larger_deg": LIMIT_DEG * (1 - np.linspace(1, 0, 18) ** 1.6),
        "ratio": 1 - np.linspace(1, 0, 13) ** 2.5,
        "dphi_deg": 90 * (1 - np.cos(np.linspace(0, np.pi, 13))),
    }


def computed() -> FloatArray:
    """The table's values, shape (sigma, larger, ratio, dphi, 2), times pi: direct and twice."""
    nodes = grid()
    larger, ratio, dphi = np.meshgrid(*list(nodes.values())[1:], indexing="ij")
    geometry = Geometry.from_degrees(theta_i=larger, theta_r=larger * ratio, dphi=dphi)
    rows = []
    for sigma_deg in nodes["sigma_deg"]:
        direct = oren_nayar_exact_brdf(geometry, _DARKEST, float(sigma_deg)) * np.pi / _DARKEST
        both = oren_nayar_exact_brdf(geometry, 1.0, float(sigma_deg)) * np.pi
        rows.append(np.stack([direct, both - direct], axis=-1))
    return np.stack(rows)


def write(file: Path = FILE) -> None:
    """Compute the table and keep it, as 32-bit numbers."""
    values = computed().astype(np.float32)
    np.savez_compressed(file, allow_pickle=False, direct_and_twice=values, **grid())


if __name__ == "__main__":
    write()
