"""Upper bounds on the error of the rough-surface methods over ranges of their parameters.

What to use when: `map_bound` for a fast bound from the stored map; `tight_bound` for a tighter one
of a printed form, at the cost of evaluating the form.
"""

from __future__ import annotations

import numpy as np

from analysis.models.base import Ranges
from analysis.models.error_maps import cell_at, cells_of, errors_of, maps
from analysis.models.lambert import DARKEST
from analysis.models.rough.form_error import form_error
from analysis.models.rough.form_error_table import GRID, LIMIT_DEG, table_coordinates
from instrument.geometry import FloatArray, Geometry

MAPPED = ("lambert", "qualitative", "functional", "table", "coarse")
"""Methods that have a map, in its order."""

_STATED = {"coarse": 1e-4}  # proven where the rule itself is tested
_SIGMAS = 9  # values of sigma in a range at which the tight bound evaluates the form


def map_bound(name: str, geometry: Geometry, ranges: Ranges) -> FloatArray:
    """Largest relative error of one of the MAPPED methods, (N,), at any albedo.

    Infinite beyond LIMIT_DEG, where there is no map; but 0 there too for sigma = 0, where all forms
    agree, the table alone excepted, which has no values there.
    """
    low, high = ranges["sigma_deg"]
    larger, ratio, dphi = table_coordinates(geometry)
    if high == 0:
        no_table = (larger > LIMIT_DEG) & (name == "table")
        return np.where(no_table, np.inf, 0.0)
    rows = cells_of(GRID["sigma_deg"], low, high)
    levels = maps()["rough"][MAPPED.index(name), rows].max(axis=0)
    at = (
        cell_at(GRID["larger_deg"], larger),
        cell_at(GRID["ratio"], ratio),
        cell_at(GRID["dphi_deg"], dphi),
    )
    bound = np.minimum(errors_of(levels[at]), _STATED.get(name, np.inf))
    return np.where(larger > LIMIT_DEG, np.inf, bound)


def tight_bound(model: str, geometry: Geometry, ranges: Ranges) -> FloatArray:
    """Largest relative error of a printed form over the ranges, (N,), from `form_error`.

    It adds the error of the table itself, and a quarter of the largest second difference for the
    sigmas between those at which the form is evaluated. Infinite beyond LIMIT_DEG.
    """
    low, high = ranges["sigma_deg"]
    sigmas = np.linspace(low, high, 1 if low == high else _SIGMAS)
    albedos = sorted({max(albedo, DARKEST) for albedo in ranges["albedo"]})
    errors = np.stack(
        [
            [form_error(model, geometry, albedo, float(sigma)) for sigma in sigmas]
            for albedo in albedos
        ]
    )
    largest = np.abs(errors).max(axis=(0, 1))
    if sigmas.size > 1:
        known = np.where(np.isfinite(errors), errors, 0.0)
        largest = largest + np.abs(np.diff(known, 2, axis=1)).max(axis=(0, 1)) / 4
    table = map_bound("table", geometry, ranges)
    return np.where(np.isfinite(table), largest + table * (1 + largest), np.inf)
