"""Error bounds of two approximations of Wolff's dielectric: polynomial F, and H of finite order.

They save little. The exact H and K are two short series in one variable, made once for each pair of
parameters: an order saves a fifth to two fifths of making them (0.35 ms in all), the polynomial a
tenth, and neither saves anything in scenes of thousands of geometries (measured in turns: 0.6 to
0.86 of the time of 1 to 200 geometries, 0.9 to 1.05 from 2000 on). They are here to compare with
work that used them.
"""

from __future__ import annotations

import numpy as np

from analysis.models.base import Ranges
from analysis.models.error_maps import cell_at, cells_of, errors_of, maps
from analysis.models.smooth.fresnel import transmittance, wolff_polynomial
from instrument.geometry import FloatArray, Geometry

EPSILON = 0.07
"""Wolff's choice for most dielectrics: 1998, after (7)."""

ORDERS = (1, 2, 3, 4, 6, 8, 12, 16)
"""Orders of Chandrasekhar's H that have a map, in its order."""

GRID: dict[str, FloatArray] = {
    "n": np.array([1.0, 1.01, 1.03, 1.07, 1.15, 1.25, 1.4, 1.6, 1.8, 2.1, 2.5, 3.0]),
    "root": np.linspace(0, 1, 13) ** 1.5,
    "theta_deg": 90 * (1 - np.linspace(1, 0, 25) ** 1.5),
}
"""Edges of the map's cells: n, root = sqrt(1 - rho), and the angle of one ray."""

_STEPS = 9  # of a range of n


def polynomial_bound(geometry: Geometry, ranges: Ranges) -> FloatArray:
    """Largest relative error of both polynomials of F, (N,), at steps of n and between them.

    Between: a quarter of the second difference, twice what a smooth curve can rise by. At a known
    n it is the error itself.
    """
    low, high = ranges["n"]
    steps = np.linspace(low, high, 1 if low == high else _STEPS)
    errors = np.stack([_polynomial_error(geometry, float(n)) for n in steps])
    most = np.abs(errors)
    if steps.size > 1:
        bend = np.abs(np.diff(errors, 2, axis=0)) / 4
        most = most + np.concatenate([bend[:1], bend, bend[-1:]])
    return np.asarray(most.max(axis=0))


def _polynomial_error(geometry: Geometry, n: float) -> FloatArray:
    ratio = np.ones(geometry.shape)
    for theta in (geometry.theta_i, geometry.theta_r):
        T = np.maximum(transmittance(theta, n), 1e-300)
        ratio = ratio * ((1 - wolff_polynomial(theta, EPSILON)) / T)
    return ratio - 1


def order_bound(order: int, geometry: Geometry, ranges: Ranges) -> FloatArray:
    """Largest relative error with every H of one of the ORDERS, (N,).

    exp(lamp + camera) - 1, from the maps of the two rays.
    """
    low, high = (float(np.sqrt(1 - rho)) for rho in reversed(ranges["single_scattering_albedo"]))
    cells = (cells_of(GRID["n"], *ranges["n"]), cells_of(GRID["root"], low, high))
    total = np.zeros(geometry.shape)
    rays = (("smooth_lamp", geometry.theta_i_deg), ("smooth_camera", geometry.theta_r_deg))
    for name, theta_deg in rays:
        levels = maps()[name][ORDERS.index(order)][cells].max(axis=(0, 1))
        total += errors_of(levels)[cell_at(GRID["theta_deg"], theta_deg)]
    return np.asarray(np.expm1(total))
