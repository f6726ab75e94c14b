"""A model's BRDF worked out no better than a picture needs.

What to use when: `adequate_brdf` for a model whose values are drawn, not fitted; the model's own
`brdf` where every digit counts.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from analysis.accuracy.cheapest import cheapest
from analysis.models import MODELS
from analysis.models.rough.form_error import LIMIT_DEG
from instrument.geometry import Brdf, FloatArray, Geometry

TOLERANCE = 3e-5
"""Relative, of each term: below a tenth of the noise of a window's mean (a few 1e-4), and a third
of what picture and window together are allowed (1e-4)."""

INTEGRATED = "oren_nayar_exact"
"""The one model for which asking pays. Of a picture's geometries the smooth body's exact method
costs no more than any other; and all values of `beckmann_spizzichino` cost about what it costs to
ask which terms would do (measured: 18 ms, and 11 ms to ask)."""

NEAR_GRAZING = 2e-4
"""Beyond 85 degrees, where the exact model promises no more itself."""

_METHODS = ("table", "coarse", "exact")  # no form keeps TOLERANCE on a surface that is not a plane
_CHECKS = 64  # geometries with which a doubt may be settled: pictures are too many to spend more


def adequate_brdf(name: str, parameters: Mapping[str, float], tolerance: float = TOLERANCE) -> Brdf:
    """The model's BRDF in 1/sr, by the cheapest method that keeps the tolerance in each scene.

    Of a rough surface's integral, that is; all else is as `MODELS` has it, to the bit. Raises
    `KeyError` for an unknown model; the BRDF raises what the model does.
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
    found = cheapest("rough", geometry, ranges, allowed, checks=_CHECKS, among=_METHODS)
    return found.brdf(geometry, **values)
