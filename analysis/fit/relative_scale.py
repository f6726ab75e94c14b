"""Relative measurements: a radiance that no reference ties to the BRDF.

The model then has one more parameter, `per_brdf`, by which its BRDF is multiplied. A scale (an
albedo, a lobe's strength) cannot be told from it, but for what the model says of interreflection,
which is no measurement: it is reported as not determined, with the interval in which it may lie.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from analysis.data.measurements import Measurements
from analysis.models import Model, Parameter
from instrument.geometry import Brdf, FloatArray, Geometry

NAME = "per_brdf"

# The search for `per_brdf` spans this factor to either side of what an albedo of a half takes.
_SPAN = 1e3
# The least scale that is looked at, as a part of its largest.
_LEAST = 1e-6


def normalise_lamp_levels(m: Measurements, brdf: Brdf) -> Measurements:
    """The measurements with each setting's level brought to that of a model near the data.

    What a level then still may be off is small, so that it is a shared error like any other.
    """
    if not m.free_levels:
        return m
    model = brdf(m.geometry)
    weight = model / (np.square(m.u_random) if m.u_random is not None else np.ones(m.size))
    settings = m.lamp_setting
    level = np.bincount(settings, m.brdf * weight) / np.bincount(settings, model * weight)
    u = None if m.u_random is None else m.u_random / level[settings]
    return replace(m, brdf=m.brdf / level[settings], u_random=u)


def unscaled_parameters(model: Model) -> frozenset[str]:
    """The parameters of a relative model that nothing ties down."""
    return frozenset(p.name for p in model.parameters if p.scale or p.name == NAME)


def relative(model: Model, values: FloatArray) -> Model:
    """The model of relative `values` (N,): `model` times `per_brdf`, in their unit per 1/sr.

    Raises `ValueError` where the mean of the values is not positive: nothing was seen.
    """
    mean = float(np.mean(values))
    if not mean > 0:
        raise ValueError(f"mean of the relative values = {mean:g}; allowed: more than 0")
    middle = mean / (0.5 / np.pi)
    low, high = middle / _SPAN, middle * _SPAN
    factor = Parameter(NAME, "sr", low, high, middle, starts=(middle,), logarithmic=True)

    def kernel(geometry: Geometry, **parameters: float) -> FloatArray:
        per_brdf = parameters.pop(NAME)
        return per_brdf * model.kernel(geometry, **parameters)

    def gradient(geometry: Geometry, **parameters: float) -> dict[str, FloatArray]:
        per_brdf = parameters.pop(NAME)
        own = {name: per_brdf * s for name, s in model.gradient(geometry, **parameters).items()}
        return {**own, NAME: np.asarray(model.kernel(geometry, **parameters))}

    # Products of scales are searched for by their logarithms: in these their valley is straight.
    own = tuple(
        replace(p, low=_LEAST * p.high, logarithmic=True) if p.scale else p
        for p in model.parameters
    )
    parameters = (*own, factor)
    return replace(
        model,
        parameters=parameters,
        kernel=kernel,
        gradient_kernel=gradient,
        validity_kernel=None,
        terms=(),
    )
