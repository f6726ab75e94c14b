"""Methods for Wolff's smooth dielectric: coarser Fresnel, and Chandrasekhar's H of finite order.

They save little. The exact H and K are two short series in one variable, made once for each pair of
parameters: an order saves a fifth to two fifths of making them (0.35 ms in all), the polynomial a
tenth, and either nothing in scenes of thousands of geometries (measured in turns: 0.6 to 0.86 of
the time of 1 to 200 geometries, 0.9 to 1.05 from 2000 on). They stand for what they show, and for
work that used them.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from analysis.accuracy.failure_maps import ORDERS, RELATIVE, maps, smooth_grid
from analysis.accuracy.method import Method, Physics, Ranges, cell_at, cells_of, constant, priced
from analysis.models.smooth.fresnel import transmittance, wolff_polynomial
from analysis.models.smooth.wolff import SINGLE_SCATTERING_ALBEDO, N, wolff_brdf
from instrument.geometry import FloatArray, Geometry

EPSILON = 0.07
"""Wolff's choice for most dielectrics: 1998, after (7)."""

_STEPS = 9  # of a range of n


def polynomial_bound(geometry: Geometry, ranges: Ranges) -> FloatArray:
    """Largest relative error of both polynomials of F, (N,), at steps of n and between them.

    Between: a quarter of the second difference, twice what a smooth curve can rise by. At a known
    n it is the error itself.
    """
    low, high = ranges["n"]
    steps = np.linspace(low, high, 1 if low == high else _STEPS)
    off = np.stack([_of_polynomial(geometry, float(n)) for n in steps])
    most = np.abs(off)
    if steps.size > 1:
        bend = np.abs(np.diff(off, 2, axis=0)) / 4
        most = most + np.concatenate([bend[:1], bend, bend[-1:]])
    return np.asarray(most.max(axis=0))


def _of_polynomial(geometry: Geometry, n: float) -> FloatArray:
    ratio = np.ones(geometry.shape)
    for theta in (geometry.theta_i, geometry.theta_r):
        T = np.maximum(transmittance(theta, n), 1e-300)
        ratio = ratio * ((1 - wolff_polynomial(theta, EPSILON)) / T)
    return ratio - 1


def order_bound(order: int, geometry: Geometry, ranges: Ranges) -> FloatArray:
    """Largest relative error with every H of one of `failure_maps.ORDERS`, (N,).

    exp(lamp + camera) - 1, from the maps of the two rays.
    """
    edges = smooth_grid()
    low, high = (float(np.sqrt(1 - rho)) for rho in reversed(ranges["single_scattering_albedo"]))
    cells = (cells_of(edges["n"], *ranges["n"]), cells_of(edges["root"], low, high))
    total = np.zeros(geometry.shape)
    rays = (("smooth_lamp", geometry.theta_i_deg), ("smooth_camera", geometry.theta_r_deg))
    for name, theta_deg in rays:
        levels = maps()[name][ORDERS.index(order)][cells].max(axis=(0, 1))
        total += RELATIVE.errors(levels)[cell_at(edges["theta_deg"], theta_deg)]
    return np.asarray(np.expm1(total))


def _order(order: int) -> Method:
    call = 3400 + 20 * order
    return Method(
        f"order {order}",
        partial(wolff_brdf, order=order),
        partial(order_bound, order),
        priced(call, 4, call, 4),
    )


SMOOTH_BODY = Physics(
    "smooth",
    (SINGLE_SCATTERING_ALBEDO, N),
    (
        Method(
            "polynomial",
            partial(wolff_brdf, epsilon=EPSILON),
            polynomial_bound,
            priced(4000, 4, 4000, 4),
        ),
        *map(_order, ORDERS),
        Method("exact", wolff_brdf, constant(1e-10), priced(4500, 4, 4500, 4)),
    ),
    lambda geometry: np.full(geometry.shape, 1e-10),
    {"single_scattering_albedo": "even", "n": "even"},
)
