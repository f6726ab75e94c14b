"""Polar lobes of a model: its BRDF in the plane of incidence, part by part."""

from __future__ import annotations

from collections.abc import Mapping

from analysis.models.base import Model, named_terms
from instrument.geometry import FloatArray, Geometry


def lobes(
    model: Model,
    parameters: Mapping[str, float],
    theta_i_deg: float,
    theta_r_deg: FloatArray,
) -> dict[str, FloatArray]:
    """Return the BRDF (N,) in 1/sr of each part of a model by name, at one incidence.

    theta_r_deg: (N,), signed, positive on the lamp's side. The parts of a sum are its terms; those
    of a model with several scales, such as `unified`, the model with each scale alone.
    """
    geometry = Geometry.from_degrees(theta_i=theta_i_deg, theta_r=theta_r_deg)
    found = {}
    for term in named_terms(model):
        own = {p.name: parameters[p.name] for p in term.parameters}
        scales = [p.name for p in term.parameters if p.scale]
        if len(scales) < 2:
            found[term.name] = term.brdf(geometry, **own)
            continue
        for alone in scales:
            others = {name: 0.0 for name in scales if name != alone}
            found[alone] = term.brdf(geometry, **{**own, **others})
    return found
