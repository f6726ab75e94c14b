"""Methods for the rough diffuse surface of Oren and Nayar, from Lambert's law to the integral.

Costs, in functional forms of one geometry (0.08 us), for a call and a geometry: least CPU times of
1, 100, 2000 and 16384 geometries on one core of 2 GHz.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from analysis.accuracy.method import Cost, Method, MethodFamily
from analysis.models.base import Ranges
from analysis.models.lambert import ALBEDO, lambert_brdf
from analysis.models.rough.form_bounds import map_bound, tight_bound
from analysis.models.rough.form_error_table import LIMIT_DEG, tabulated_brdf
from analysis.models.rough.oren_nayar_exact import COARSE, FINE, RULE, Rule, oren_nayar_exact_brdf
from analysis.models.rough.oren_nayar_forms import (
    SIGMA_DEG,
    oren_nayar_brdf,
    oren_nayar_qualitative_brdf,
)
from instrument.geometry import FloatArray, Geometry

FINE_LIMIT_DEG = 89.5
"""Up to this angle the finest rule keeps 1e-8, against one with twice its nodes (found: 5e-9)."""


def _form(name: str, model: str, kernel: Callable[..., FloatArray], *cost: float) -> Method:
    tight = partial(tight_bound, model)
    return Method(name, kernel, partial(map_bound, name), Cost(*cost), tight)


def _rule(rule: Rule) -> Callable[..., FloatArray]:
    return partial(oren_nayar_exact_brdf, rule=rule)


def _lambert(geometry: Geometry, albedo: float, sigma_deg: float) -> FloatArray:
    """Lambert's law at any roughness."""
    del sigma_deg
    return lambert_brdf(geometry, albedo)


def _fine_error(geometry: Geometry, _: Ranges) -> FloatArray:
    larger = np.maximum(geometry.theta_i_deg, geometry.theta_r_deg)
    return np.where(larger > FINE_LIMIT_DEG, 2e-4, 1e-8)


def _rule_error(geometry: Geometry, _: Ranges) -> FloatArray:
    larger = np.maximum(geometry.theta_i_deg, geometry.theta_r_deg)
    return np.where(larger > LIMIT_DEG, 2e-4, 1e-6)


ROUGH_SURFACE = MethodFamily(
    "rough",
    (ALBEDO, SIGMA_DEG),
    (
        _form("lambert", "lambert", _lambert, 60, 0.01),
        _form("qualitative", "oren_nayar_qualitative", oren_nayar_qualitative_brdf, 200, 0.45),
        _form("functional", "oren_nayar", oren_nayar_brdf, 500, 1.0),
        Method("table", tabulated_brdf, partial(map_bound, "table"), Cost(3200, 8.5)),
        Method("coarse", _rule(COARSE), partial(map_bound, "coarse"), Cost(16e3, 130)),
        Method("exact", _rule(RULE), _rule_error, Cost(16e3, 220)),
        Method("fine", _rule(FINE), _fine_error, Cost(18e3, 680)),
    ),
)
"""From Lambert's law to the V-cavity integral: the forms (36) and (33) + (34) of 1995, the table
`form_error_table`, and the integral to 1e-4, 1e-6 and 1e-8.
"""
