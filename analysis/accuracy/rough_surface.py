"""Methods for the rough diffuse surface of Oren and Nayar, from Lambert's law to the integral.

Costs, in functional forms of one geometry (0.08 us), for a call and a geometry the first time and
again: least CPU times of 1, 100, 2000 and 16384 geometries on one core of 2 GHz.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial

import numpy as np

from analysis.accuracy.failure_maps import RELATIVE, ROUGH, maps
from analysis.accuracy.method import Method, Physics, Ranges, cell_at, cells_of, priced
from analysis.models.rough.form_error import LIMIT_DEG, departure, grid, integral
from analysis.models.rough.oren_nayar import (
    ALBEDO,
    SIGMA_DEG,
    lambert_brdf,
    oren_nayar_brdf,
    oren_nayar_qualitative_brdf,
)
from analysis.models.rough.oren_nayar_exact import COARSE, FINE, RULE, Rule, oren_nayar_exact_brdf
from instrument.geometry import FloatArray, Geometry

FINE_LIMIT_DEG = 89.5
"""Up to this angle the finest rule keeps 1e-8, against one with twice its nodes (found: 5e-9)."""

_STATED = {"coarse": 1e-4}  # proven where the rule itself is tested
_SIGMAS = 9  # of a range, at which the closer bound asks the table
_DARKEST = 1e-9


def map_bound(name: str, geometry: Geometry, ranges: Ranges) -> FloatArray:
    """Largest relative error of one of `failure_maps.ROUGH`, (N,): the map's cells, any albedo.

    Infinite beyond LIMIT_DEG, where there is no map; 0 for sigma = 0, where all forms agree.
    """
    low, high = ranges["sigma_deg"]
    if high == 0:
        return np.zeros(geometry.shape)
    edges = _edges()
    sigmas = maps()["rough"][ROUGH.index(name), cells_of(edges["sigma_deg"], low, high)].max(axis=0)
    larger = np.maximum(geometry.theta_i_deg, geometry.theta_r_deg)
    smaller = np.minimum(geometry.theta_i_deg, geometry.theta_r_deg)
    ratio = np.divide(smaller, larger, out=np.ones_like(larger), where=larger > 0)
    dphi = np.minimum(geometry.dphi_deg, 360 - geometry.dphi_deg)
    at = (
        cell_at(edges["larger_deg"], larger),
        cell_at(edges["ratio"], ratio),
        cell_at(edges["dphi_deg"], dphi),
    )
    bound = np.minimum(RELATIVE.errors(sigmas[at]), _STATED.get(name, np.inf))
    return np.where(larger > LIMIT_DEG, np.inf, bound)


def tight_bound(model: str, geometry: Geometry, ranges: Ranges) -> FloatArray:
    """The same of a printed form, from its departure from the table: (N,).

    What the table itself may be off comes on top, and what the departure may do between the
    sigmas at which it is asked: a quarter of its largest second difference.
    """
    low, high = ranges["sigma_deg"]
    sigmas = np.linspace(low, high, 1 if low == high else _SIGMAS)
    albedos = sorted({max(albedo, _DARKEST) for albedo in ranges["albedo"]})
    off = np.stack(
        [
            [departure(model, geometry, albedo, float(sigma)) for sigma in sigmas]
            for albedo in albedos
        ]
    )
    largest = np.abs(off).max(axis=(0, 1))
    if sigmas.size > 1:
        known = np.where(np.isfinite(off), off, 0.0)
        largest = largest + np.abs(np.diff(known, 2, axis=1)).max(axis=(0, 1)) / 4
    table = map_bound("table", geometry, ranges)
    return np.where(np.isfinite(table), largest + table * (1 + largest), np.inf)


@cache
def _edges() -> dict[str, FloatArray]:
    return grid()


def _form(
    name: str,
    model: str,
    kernel: Callable[..., FloatArray],
    *cost: *tuple[float, float, float, float],
) -> Method:
    closer = partial(tight_bound, model)
    return Method(name, kernel, partial(map_bound, name), priced(*cost), closer)


def _rule(rule: Rule) -> Callable[..., FloatArray]:
    return partial(oren_nayar_exact_brdf, rule=rule)


def _lambert(geometry: Geometry, albedo: float, sigma_deg: float) -> FloatArray:
    """Lambert's law, whatever the roughness."""
    del sigma_deg
    return lambert_brdf(geometry, albedo)


def _qualitative(geometry: Geometry, albedo: float, sigma_deg: float) -> FloatArray:
    """1995 (36) as it is printed."""
    return oren_nayar_qualitative_brdf(geometry, albedo, sigma_deg)


def _fine_error(geometry: Geometry) -> FloatArray:
    larger = np.maximum(geometry.theta_i_deg, geometry.theta_r_deg)
    return np.where(larger > FINE_LIMIT_DEG, 2e-4, 1e-8)


def _rule_error(geometry: Geometry, _: Ranges) -> FloatArray:
    larger = np.maximum(geometry.theta_i_deg, geometry.theta_r_deg)
    return np.where(larger > LIMIT_DEG, 2e-4, 1e-6)


ROUGH_SURFACE = Physics(
    "rough",
    (ALBEDO, SIGMA_DEG),
    (
        _form("lambert", "lambert", _lambert, 60, 0.01, 60, 0.01),
        _form(
            "qualitative",
            "oren_nayar_qualitative",
            oren_nayar_qualitative_brdf,
            200,
            0.45,
            90,
            0.02,
        ),
        _form("functional", "oren_nayar", oren_nayar_brdf, 500, 1.0, 120, 0.03),
        Method("table", integral, partial(map_bound, "table"), priced(1200, 26, 1200, 26)),
        Method("coarse", _rule(COARSE), partial(map_bound, "coarse"), priced(30e3, 700, 1000, 5.3)),
        Method("exact", _rule(RULE), _rule_error, priced(30e3, 1100, 1100, 6.3)),
        Method(
            "fine",
            _rule(FINE),
            lambda geometry, _: _fine_error(geometry),
            priced(30e3, 3500, 1300, 10),
        ),
    ),
    _fine_error,
    {"albedo": "ends", "sigma_deg": "even"},
)
