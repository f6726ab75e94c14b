"""Table of the exact Oren-Nayar integral: a fast approximation by cubic splines.

What to use when: `tabulated_brdf` where an error of 1 % near grazing, and 0.1 % elsewhere, is
enough; `oren_nayar_exact` where it is not.

The table, `form_error_table.npz`, holds the two parts of the exact radiance on a grid of sigma, the
larger angle, the smaller one over the larger, and dphi; cubic splines interpolate between. The grid
is dense where the radiance bends: at grazing, at small sigma, and towards the plane of incidence.
`acquisition.benchmark.maps.make_form_error_table` computes it.
"""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path

import numpy as np

from analysis.models.rough.grid_spline import GridSpline
from analysis.models.rough.oren_nayar_forms import SIGMA_DEG
from instrument.geometry import FloatArray, Geometry

LIMIT_DEG = 85.0
"""Largest angle from the normal in the table: beyond, the integral itself is less certain."""

ERROR = 0.012
"""Largest relative error of the interpolation: near the mirror direction with both angles at 84
to 85 degrees (found: 0.0102). In 99 of 100 geometries it is below 0.001."""

FILE = Path(__file__).with_name("form_error_table.npz")

GRID: dict[str, FloatArray] = {
    "sigma_deg": SIGMA_DEG.high * np.linspace(0, 1, 21) ** 2,
    "larger_deg": LIMIT_DEG * (1 - np.linspace(1, 0, 18) ** 1.6),
    "ratio": 1 - np.linspace(1, 0, 13) ** 2.5,
    "dphi_deg": 90 * (1 - np.cos(np.linspace(0, np.pi, 13))),
}
"""Nodes of the table: sigma, the larger angle, the smaller one over the larger, and dphi."""


def tabulated_brdf(geometry: Geometry, albedo: float, sigma_deg: float) -> FloatArray:
    """`oren_nayar_exact` from the table, relative error up to ERROR; NaN beyond LIMIT_DEG.

    Arguments and result as in `Model.brdf`.
    """
    at = np.broadcast_arrays(*table_coordinates(geometry))
    direct, twice = _spline().at_first(sigma_deg).at(*(x.ravel() for x in at))
    brdf = albedo / math.pi * (direct + albedo * twice)
    return np.asarray(brdf.reshape(at[0].shape))


def table_coordinates(geometry: Geometry) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Larger angle in degrees, smaller over larger, and dphi from 0 to 180 degrees.

    Arrays of the geometry's shape. By reciprocity and symmetry the radiance needs no more.
    """
    larger = np.maximum(geometry.theta_i_deg, geometry.theta_r_deg)
    smaller = np.minimum(geometry.theta_i_deg, geometry.theta_r_deg)
    ratio = np.divide(smaller, larger, out=np.ones_like(larger), where=larger > 0)
    return larger, ratio, np.minimum(geometry.dphi_deg, 360 - geometry.dphi_deg)


@cache
def _spline() -> GridSpline:
    """Cubic spline through the table, for both parts at once."""
    with np.load(FILE) as table:
        axes = [table[name] for name in GRID]
        values = table["direct_and_twice"].astype(np.float64)
    return GridSpline.through(axes, values)
