"""Relative measurements: a radiance that no reference ties to the BRDF.

The model then has one more parameter, `per_brdf`, by which its BRDF is multiplied. What only
scales the BRDF (an albedo, but for interreflection; a lobe, but beside the diffuse part) cannot be
told from it, and is reported as not determined.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from analysis.models import Model, Parameter
from instrument.geometry import FloatArray, Geometry

NAME = "per_brdf"

# The search for `per_brdf` spans this factor to either side of what an albedo of a half takes.
_SPAN = 1e3


def relative(model: Model, values: FloatArray) -> Model:
    """The model of relative `values` (N,): `model` times `per_brdf`, in their unit per 1/sr.

    Raises `ValueError` where the mean of the values is not positive: nothing was seen.
    """
    mean = float(np.mean(values))
    if not mean > 0:
        raise ValueError(f"mean of the relative values = {mean:g}; allowed: more than 0")
    middle = mean / (0.5 / np.pi)
    low, high = middle / _SPAN, middle * _SPAN
    factor = Parameter(NAME, "sr", low, high, middle, starts=(middle,))

    def kernel(geometry: Geometry, **parameters: float) -> FloatArray:
        per_brdf = parameters.pop(NAME)
        return per_brdf * model.kernel(geometry, **parameters)

    def slopes(geometry: Geometry, **parameters: float) -> dict[str, FloatArray]:
        per_brdf = parameters.pop(NAME)
        own = {name: per_brdf * s for name, s in model.gradient(geometry, **parameters).items()}
        return {**own, NAME: np.asarray(model.kernel(geometry, **parameters))}

    parameters = (*model.parameters, factor)
    return replace(model, parameters=parameters, kernel=kernel, slopes=slopes, holds=None, terms=())
