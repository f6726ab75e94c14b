"""Relative measurements: radiance in a unit of its own, without a reference of known BRDF.

The model gets one more parameter, `per_brdf`, a factor on its BRDF. The data cannot separate it
from a scale of the model (an albedo, the strength of a lobe), except by the model's
interreflection, which is no measurement. Both are therefore reported as not determined, with the
interval in which they may lie.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from analysis.data.measurements import Measurements
from analysis.models import Model, Parameter
from instrument.geometry import Brdf, FloatArray, Geometry

FACTOR_NAME = "per_brdf"

# Domain of `per_brdf`: this factor to either side of its value at an albedo of 1/2.
_SPAN = 1e3
# Smallest value of a scale, as a fraction of its largest.
_MIN_SCALE = 1e-6


def normalise_lamp_levels(m: Measurements, brdf: Brdf) -> Measurements:
    """Divide the points of each lamp setting by its level relative to a model near the data.

    `brdf` gives BRDF in 1/sr, of the geometry's shape. The remaining error of a level is small and
    counts as a shared error like any other. A setting at which the model, or the sample, is dark
    keeps its level.
    """
    if not m.free_levels:
        return m
    model = brdf(m.geometry)
    weight = model / (np.square(m.u_random) if m.u_random is not None else np.ones(m.size))
    settings = m.lamp_setting
    seen, expected = (np.bincount(settings, values * weight) for values in (m.brdf, model))
    lit = (seen > 0) & (expected > 0)
    level = np.divide(seen, expected, out=np.ones(seen.size), where=lit)
    u = None if m.u_random is None else m.u_random / level[settings]
    return replace(m, brdf=m.brdf / level[settings], u_random=u)


def unscaled_parameters(model: Model) -> frozenset[str]:
    """Parameters that relative measurements do not determine: all scales, and `per_brdf`."""
    return frozenset(p.name for p in model.parameters if p.scale or p.name == FACTOR_NAME)


def relative_model(model: Model, values: FloatArray) -> Model:
    """Return `model` times `per_brdf`, for relative `values` (N,) in a unit of their own.

    Raises `ValueError` where the mean of the values is not positive: the camera saw no light.
    """
    mean = float(np.mean(values))
    if not mean > 0:
        raise ValueError(f"mean of the relative values = {mean:g}; allowed: more than 0")
    middle = mean / (0.5 / np.pi)
    low, high = middle / _SPAN, middle * _SPAN
    factor = Parameter(FACTOR_NAME, "sr", low, high, middle, starts=(middle,), logarithmic=True)

    return _scaled(model, factor)


def _scaled(model: Model, factor: Parameter) -> Model:
    """The model, and each of its terms, times the factor."""

    def kernel(geometry: Geometry, **parameters: float) -> FloatArray:
        per_brdf = parameters.pop(FACTOR_NAME)
        return per_brdf * model.kernel(geometry, **parameters)

    def gradients(geometry: Geometry, **parameters: float) -> dict[str, FloatArray]:
        per_brdf = parameters.pop(FACTOR_NAME)
        own = {name: per_brdf * g for name, g in model.gradient(geometry, **parameters).items()}
        return {**own, FACTOR_NAME: np.asarray(model.kernel(geometry, **parameters))}

    # chi2 has a valley along a product of scales; in their logarithms it is straight.
    own = tuple(
        replace(p, low=_MIN_SCALE * p.high, logarithmic=True) if p.scale else p
        for p in model.parameters
    )
    return replace(
        model,
        parameters=(*own, factor),
        kernel=kernel,
        gradient_kernel=gradients,
        validity_kernel=None,
        terms=tuple(_scaled(term, factor) for term in model.terms),
    )
