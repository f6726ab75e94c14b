"""Ratios of a model's scales, such as ks/albedo: the strength of its lobe beside its diffuse part.

Measurements without a reference determine no scale, but their ratios. A ratio takes the place of
one of the two scales as a parameter of the fit; its uncertainty is then found like any other's.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from analysis.fit.search.levenberg_marquardt import Minimum
from analysis.fit.search.problem import Problem
from analysis.fit.uncertainty import uncertainty
from analysis.models import Model, Parameter
from instrument.geometry import FloatArray, Geometry


@dataclass(frozen=True, slots=True)
class Ratio:
    """Ratio of two scales, in the quotient of their units: u, or None and a 95 % interval."""

    value: float
    u: float | None
    interval: tuple[float, float] | None


def scale_ratios(
    problem: Problem, best: Minimum, variance: float, profiles: bool = True
) -> dict[str, Ratio]:
    """Ratios of the other scales to the model's first one, by name; only those determined.

    Arguments as for `uncertainty`.
    """
    first, *others = [i for i, p in enumerate(problem.model.parameters) if p.scale] or [0]
    found = {
        ratio_name(problem.model, first, i): _ratio(problem, best, variance, first, i, profiles)
        for i in others
    }
    return {name: ratio for name, ratio in found.items() if ratio is not None}


def ratio_names(model: Model) -> tuple[str, ...]:
    """Names of the ratios of a model's scales."""
    first, *others = [i for i, p in enumerate(model.parameters) if p.scale] or [0]
    return tuple(ratio_name(model, first, i) for i in others)


def ratio_name(model: Model, below: int, above: int) -> str:
    """Name of the ratio of the parameters at two indices."""
    return f"{model.parameters[above].name}/{model.parameters[below].name}"


def _ratio(
    problem: Problem, best: Minimum, variance: float, below: int, above: int, profiles: bool
) -> Ratio | None:
    """Ratio of the scales at two indices; None where it is not determined.

    The larger scale, relative to its domain, stays a parameter: then any ratio up to that of the
    domains keeps both in their domains.
    """
    share = best.x / problem.high
    inverted = bool(share[above] > share[below])
    base, other = (above, below) if inverted else (below, above)
    if best.x[base] == 0:
        return None
    x = best.x.copy()
    x[other] = best.x[other] / best.x[base]
    model = _with_ratio(problem.model, base, other)
    changed = replace(problem, model=model)
    name = model.parameters[other].name
    known = uncertainty(changed, best._replace(x=x), variance, (), profiles, only=(name,))
    if known.undetermined:
        return None
    found = Ratio(float(x[other]), known.u[name], known.intervals.get(name))
    return _inverse(found) if inverted else found


def _inverse(ratio: Ratio) -> Ratio | None:
    low, high = ratio.interval or (ratio.value, ratio.value)
    if low <= 0:
        return None
    interval = None if ratio.interval is None else (1 / high, 1 / low)
    u = None if ratio.u is None else ratio.u / ratio.value**2
    return Ratio(1 / ratio.value, u, interval)


def _with_ratio(model: Model, base: int, other: int) -> Model:
    """The model with the ratio of two scales as a parameter in place of the one at `other`."""
    scale, replaced = model.parameters[base], model.parameters[other]
    ratio = Parameter(
        ratio_name(model, base, other),
        replaced.unit,
        replaced.low / scale.high,
        replaced.high / scale.high,
        replaced.default / scale.high,
        logarithmic=replaced.logarithmic,
    )

    def own(parameters: dict[str, float]) -> dict[str, float]:
        value = parameters[ratio.name] * parameters[scale.name]
        return {p.name: parameters.get(p.name, value) for p in model.parameters}

    def kernel(geometry: Geometry, **parameters: float) -> FloatArray:
        return model.kernel(geometry, **own(parameters))

    def gradients(geometry: Geometry, **parameters: float) -> dict[str, FloatArray]:
        found = (model.gradient_kernel or model.gradient)(geometry, **own(parameters))
        by_replaced = found.pop(replaced.name)
        found[scale.name] = found[scale.name] + parameters[ratio.name] * by_replaced
        return {**found, ratio.name: np.asarray(parameters[scale.name] * by_replaced)}

    parameters = tuple(ratio if i == other else p for i, p in enumerate(model.parameters))
    return replace(model, parameters=parameters, kernel=kernel, gradient_kernel=gradients, terms=())
