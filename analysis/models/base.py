"""What a reflectance model is: a name, its parameters with their bounds, and a kernel.

To add a model: write its kernel (geometry and parameters in, BRDF out) in a module of its own,
wrap it in a `Model`, and list that in `analysis/models/__init__.py`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from instrument.geometry import FloatArray, Geometry

Kernel = Callable[..., FloatArray]


@dataclass(frozen=True, slots=True)
class Parameter:
    """A parameter of a model: `low` and `high` bound its domain, both included.

    `unit` is as people write it ("1" for a pure number). `scale` says that its part of the BRDF
    rises about in proportion to it from zero: a fit then solves for its first value instead of
    searching.
    """

    name: str
    unit: str
    low: float
    high: float
    default: float
    scale: bool = False

    def __post_init__(self) -> None:
        if not (math.isfinite(self.low) and math.isfinite(self.high) and self.low < self.high):
            raise ValueError(
                f"{self.name}: bounds {self.low:g} to {self.high:g} are not finite and rising"
            )
        self.check(self.default)
        if self.scale and not self.low == 0 < self.default:
            raise ValueError(
                f"{self.name}: a scale has the lower bound 0 and a default above it; "
                f"got {self.low:g} and {self.default:g}"
            )

    def check(self, value: float) -> float:
        """Return the value as a float, or raise `ValueError` when it is not in the domain."""
        value = float(value)
        if not self.low <= value <= self.high:  # also false for NaN
            raise ValueError(f"{self.name} = {value:g} {self.unit}; allowed: {self.domain}")
        return value

    @property
    def domain(self) -> str:
        """The allowed values in words, with the unit."""
        return f"{self.low:g} to {self.high:g} {self.unit}".removesuffix(" 1")


@dataclass(frozen=True, slots=True)
class Model:
    """A reflectance model: call `brdf`; `kernel` is the bare formula, without checks."""

    name: str
    parameters: tuple[Parameter, ...]
    kernel: Kernel

    def brdf(self, geometry: Geometry, **parameters: float) -> FloatArray:
        """BRDF in 1/sr, float64, of the geometry's shape.

        Takes every parameter by name. Raises `ValueError`, naming the argument, its value and
        what is allowed, for one that is unknown, missing, not finite or out of its domain.
        """
        return np.asarray(self.kernel(geometry, **self._checked(parameters)), dtype=np.float64)

    def _checked(self, given: Mapping[str, float]) -> dict[str, float]:
        known = {p.name: p for p in self.parameters}
        for name, value in given.items():
            if name not in known:
                raise ValueError(
                    f"{self.name} has no parameter {name} (= {value}); it has: {', '.join(known)}"
                )
        for name, parameter in known.items():
            if name not in given:
                raise ValueError(
                    f"{self.name} needs {name}, which is missing; allowed: {parameter.domain}"
                )
        return {name: parameter.check(given[name]) for name, parameter in known.items()}


def add(*models: Model) -> Model:
    """Sum of models, called `a+b`: a parameter name that they share is one parameter of the sum.

    Its domain is the intersection of theirs. Raises `ValueError` when that is empty or the units
    differ.
    """
    shared: dict[str, Parameter] = {}
    for parameter in (p for model in models for p in model.parameters):
        known = shared.get(parameter.name)
        shared[parameter.name] = _intersection(known, parameter) if known else parameter
    terms = [(m.kernel, tuple(p.name for p in m.parameters)) for m in models]

    def kernel(geometry: Geometry, **parameters: float) -> FloatArray:
        parts = (f(geometry, **{n: parameters[n] for n in names}) for f, names in terms)
        return reduce(np.add, parts)

    return Model("+".join(m.name for m in models), tuple(shared.values()), kernel)


def _intersection(a: Parameter, b: Parameter) -> Parameter:
    low, high = max(a.low, b.low), min(a.high, b.high)
    if a.unit != b.unit or low >= high:
        raise ValueError(
            f"{a.name} cannot be shared: {a.domain} in one model, {b.domain} in the other"
        )
    default = a.default if low <= a.default <= high else (low + high) / 2
    return replace(a, low=low, high=high, default=default, scale=a.scale and b.scale)
