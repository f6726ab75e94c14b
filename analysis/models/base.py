"""What a reflectance model is: a name, its parameters with their bounds, and a kernel.

To add a model: write its kernel (geometry and parameters in, BRDF out) in a module of its own,
wrap it in a `Model`, and list that in `analysis/models/__init__.py`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import reduce, wraps
from typing import TypeVar
from weakref import WeakKeyDictionary

import numpy as np

from instrument.geometry import BoolArray, FloatArray, Geometry

Kernel = Callable[..., FloatArray]
T = TypeVar("T", bound=FloatArray | tuple[FloatArray, ...])

# Geometries in one block: a kernel's dozen arrays of them fit into a core's cache.
BLOCK = 8192


def kept(function: Callable[[Geometry], T]) -> Callable[[Geometry], T]:
    """A function of the angles alone, kept as long as its geometry lives: fits ask often.

    The arrays that it returns, one or a tuple of them, cannot be written to. Those of more
    geometries than two blocks are not kept.
    """
    known: WeakKeyDictionary[Geometry, T] = WeakKeyDictionary()

    @wraps(function)
    def looked_up(geometry: Geometry) -> T:
        if geometry in known:
            return known[geometry]
        value = function(geometry)
        if math.prod(geometry.shape) <= 2 * BLOCK:
            for array in value if isinstance(value, tuple) else (value,):
                array.setflags(write=False)
            known[geometry] = value
        return value

    return looked_up


@dataclass(frozen=True, slots=True)
class Validity:
    """Where a model holds: `mask` of the geometry's shape, and why it does not elsewhere."""

    mask: BoolArray
    reason: str


@dataclass(frozen=True, slots=True)
class Parameter:
    """A parameter of a model: `low` and `high` bound its domain, both included.

    `unit` is as people write it ("1" for a pure number). `scale` says that its part of the BRDF
    rises about in proportion to it from zero: a fit then solves for its first value instead of
    searching. `starts`: values from which a fit tries the search; none given: seven over the
    domain, denser towards its low end, as narrow lobes are easier to miss than wide ones.
    `logarithmic`: a fit searches for its logarithm; the domain then begins above 0.
    """

    name: str
    unit: str
    low: float
    high: float
    default: float
    scale: bool = False
    starts: tuple[float, ...] = ()
    logarithmic: bool = False

    def __post_init__(self) -> None:
        if not (math.isfinite(self.low) and math.isfinite(self.high) and self.low < self.high):
            raise ValueError(
                f"{self.name}: bounds {self.low:g} to {self.high:g} are not finite and rising"
            )
        for value in (self.default, *self.starts):
            self.check(value)
        if not self.starts:
            parts = ((k + 0.5) / 7 for k in range(7))
            starts = tuple(self.low + part * part * (self.high - self.low) for part in parts)
            object.__setattr__(self, "starts", starts)
        if self.scale and not 0 <= self.low < self.default:
            raise ValueError(
                f"{self.name}: a scale has a lower bound of 0 or more and a default above it; "
                f"got {self.low:g} and {self.default:g}"
            )
        if self.logarithmic and self.low <= 0:
            raise ValueError(f"{self.name}: logarithmic, so its domain begins above {self.low:g}")

    def check(self, value: float) -> float:
        """Return the value as a float, or raise `ValueError` when it is not in the domain."""
        try:
            value = float(value)
        except (TypeError, ValueError):
            raise ValueError(f"{self.name} = {value!r}; allowed: {self.domain}") from None
        if not self.low <= value <= self.high:  # also false for NaN
            given = f"{self.name} = {value:.12g} {self.unit}".removesuffix(" 1")
            raise ValueError(f"{given}; allowed: {self.domain}")
        return value

    @property
    def domain(self) -> str:
        """The allowed values in words, with the unit."""
        return f"{self.low:g} to {self.high:g} {self.unit}".removesuffix(" 1")


@dataclass(frozen=True, slots=True)
class Model:
    """A reflectance model: call `brdf`; `kernel` is the bare formula, without checks.

    `slopes`: kernel of the derivatives by each parameter, name -> array, in closed form or under
    the integral; None: `gradient` then takes central differences. `holds`: kernel of `validity`;
    None: the model holds wherever it is defined. `in_blocks`: large arrays go through the kernel
    in blocks that stay in the processor's cache, which takes two thirds of the time; not for a
    kernel that keeps what belongs to a whole set of geometries. `terms`: the models of a sum.
    """

    name: str
    parameters: tuple[Parameter, ...]
    kernel: Kernel
    slopes: Callable[..., dict[str, FloatArray]] | None = None
    holds: Callable[..., Validity] | None = None
    in_blocks: bool = True
    terms: tuple[Model, ...] = ()

    def brdf(self, geometry: Geometry, **parameters: float) -> FloatArray:
        """BRDF in 1/sr, float64, of the geometry's shape.

        Takes every parameter by name. Raises `ValueError`, naming the argument, its value and
        what is allowed, for one that is unknown, missing, not finite or out of its domain.
        """
        values = self._checked(parameters)
        if not self.in_blocks or math.prod(geometry.shape) <= 2 * BLOCK:
            return np.asarray(self.kernel(geometry, **values), dtype=np.float64)
        flat = np.empty(math.prod(geometry.shape))
        for part, few in geometry.blocks(BLOCK):
            flat[part] = self.kernel(few, **values)
        return flat.reshape(geometry.shape)

    def gradient(self, geometry: Geometry, **parameters: float) -> dict[str, FloatArray]:
        """Derivatives of the BRDF by each parameter, in 1/sr per unit of it, by name.

        Raises `ValueError` as `brdf` does.
        """
        values = self._checked(parameters)
        if self.slopes is not None:
            return self.slopes(geometry, **values)
        return {p.name: self._difference(geometry, values, p) for p in self.parameters}

    def validity(self, geometry: Geometry, **parameters: float) -> Validity:
        """Where the model holds, and why not elsewhere. Raises `ValueError` as `brdf` does."""
        values = self._checked(parameters)
        if self.holds is None:
            return Validity(np.ones(geometry.shape, dtype=bool), "")
        return self.holds(geometry, **values)

    def _difference(
        self, geometry: Geometry, values: Mapping[str, float], parameter: Parameter
    ) -> FloatArray:
        """Central difference, one-sided on a bound."""
        step = 1e-6 * (parameter.high - parameter.low)
        value = values[parameter.name]
        up, down = min(value + step, parameter.high), max(value - step, parameter.low)
        high = self.kernel(geometry, **{**values, parameter.name: up})
        low = self.kernel(geometry, **{**values, parameter.name: down})
        return np.asarray((high - low) / (up - down))

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

    def slopes(geometry: Geometry, **parameters: float) -> dict[str, FloatArray]:
        total: dict[str, FloatArray] = {}
        for model in models:
            own = model.gradient(geometry, **{p.name: parameters[p.name] for p in model.parameters})
            for name, slope in own.items():
                total[name] = total[name] + slope if name in total else slope
        return total

    def holds(geometry: Geometry, **parameters: float) -> Validity:
        each = [
            model.validity(geometry, **{p.name: parameters[p.name] for p in model.parameters})
            for model in models
        ]
        reasons = dict.fromkeys(v.reason for v in each if v.reason)
        return Validity(np.all([v.mask for v in each], axis=0), "; ".join(reasons))

    name = "+".join(m.name for m in models)
    whole = all(model.in_blocks for model in models)
    return Model(name, tuple(shared.values()), kernel, slopes, holds, in_blocks=whole, terms=models)


def _intersection(a: Parameter, b: Parameter) -> Parameter:
    low, high = max(a.low, b.low), min(a.high, b.high)
    if a.unit != b.unit or low >= high:
        raise ValueError(
            f"{a.name} cannot be shared: {a.domain} in one model, {b.domain} in the other"
        )
    default = a.default if low <= a.default <= high else (low + high) / 2
    starts = tuple(value for value in a.starts if low <= value <= high)
    scale = a.scale and b.scale
    return replace(a, low=low, high=high, default=default, scale=scale, starts=starts)
