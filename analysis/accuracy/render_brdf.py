"""BRDF of a model with just the accuracy that a rendered picture needs.

What to use when: `adequate_brdf` for a model whose values are rendered, not fitted; the model's own
`brdf` where full accuracy is needed.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from analysis.accuracy.cheapest import cheapest
from analysis.accuracy.rough_surface import ROUGH_SURFACE
from analysis.models import MODELS
from analysis.models.rough.form_error_table import LIMIT_DEG
from instrument.geometry import Brdf, FloatArray, Geometry

TOLERANCE = 3e-5
"""Relative, of each term: below a tenth of the noise of a window's mean (a few 1e-4), and a third
of the error allowed for picture and window together (1e-4)."""

INTEGRATED = "oren_nayar_exact"
"""The one model for which the search pays. For a picture's geometries the exact methods of the
smooth dielectric and of `beckmann_spizzichino` cost about as much as a search (18 and 11 ms)."""

NEAR_GRAZING = 2e-4
"""Relative tolerance beyond 85 degrees: the accuracy that the exact model itself states there."""

_METHODS = ("table", "coarse", "exact")  # no form keeps TOLERANCE on a surface that is not a plane
_CHECKS = 64  # at most, of doubtful geometries: a scan renders many pictures


def adequate_brdf(name: str, parameters: Mapping[str, float], tolerance: float = TOLERANCE) -> Brdf:
    """The model's BRDF in 1/sr, with `oren_nayar_exact` by the cheapest method within `tolerance`.

    It keeps the geometry's shape. All other models and terms are those of `MODELS`, bit for bit.
    Raises `KeyError` for an unknown model; the returned function raises the model's own errors.
    """
    model = MODELS[name]
    terms = model.terms or (model,)
    if not any(term.name == INTEGRATED for term in terms):
        return lambda geometry: model.brdf(geometry, **parameters)
    own = [(term.name, {p.name: parameters[p.name] for p in term.parameters}) for term in terms]

    def brdf(geometry: Geometry) -> FloatArray:
        parts = [_term(term, geometry, values, tolerance) for term, values in own]
        return np.asarray(np.sum(parts, axis=0))

    return brdf


def _term(
    name: str, geometry: Geometry, values: Mapping[str, float], tolerance: float
) -> FloatArray:
    if name != INTEGRATED:
        return MODELS[name].brdf(geometry, **values)
    larger = np.maximum(geometry.theta_i_deg, geometry.theta_r_deg)
    allowed = np.where(larger > LIMIT_DEG, np.maximum(tolerance, NEAR_GRAZING), tolerance)
    ranges = {parameter: (value, value) for parameter, value in values.items()}
    found = cheapest(ROUGH_SURFACE, geometry, ranges, allowed, checks=_CHECKS, among=_METHODS)
    return found.brdf(geometry, **values)
