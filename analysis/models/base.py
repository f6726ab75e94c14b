"""Reflectance model: a name, parameters with bounds, and a kernel that computes the BRDF.

To add a model: write its kernel (geometry and parameters in, BRDF out) in a module of its own,
wrap it in a `Model`, and list that in `analysis/models/__init__.py`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial, reduce, wraps
from typing import TypeVar
from weakref import WeakKeyDictionary

import numpy as np

from instrument.geometry import BoolArray, FloatArray, Geometry, IntArray

Kernel = Callable[..., FloatArray]
R = TypeVar("R")
T = TypeVar("T", bound=FloatArray | tuple[FloatArray | IntArray, ...])

Ranges = Mapping[str, tuple[float, float]]
"""Lowest and highest value of each parameter; a known one has them equal."""

# Geometries in one block: a kernel's dozen arrays of them fit into a core's cache.
BLOCK = 8192


def cached_per_geometry(function: Callable[[Geometry], T]) -> Callable[[Geometry], T]:
    """Decorator: cache a function of the angles alone for as long as its geometry object lives.

    Fits evaluate the same geometry often. The returned arrays, one or a tuple of them, of the
    function's own shape and unit, are read-only. Geometries of more than two blocks are not cached.
    """
    cache: WeakKeyDictionary[Geometry, T] = WeakKeyDictionary()

    @wraps(function)
    def cached(geometry: Geometry) -> T:
        if geometry in cache:
            return cache[geometry]
        value = function(geometry)
        if math.prod(geometry.shape) <= 2 * BLOCK:
            for array in value if isinstance(value, tuple) else (value,):
                array.setflags(write=False)
            cache[geometry] = value
        return value

    return cached


def last_per_geometry(function: Callable[..., R]) -> Callable[..., R]:
    """Decorator: keep the last result of a function of a geometry and of parameters.

    A fit evaluates a model and then its derivatives at the same parameters. As with
    `cached_per_geometry`, for geometries of up to two blocks.
    """
    cache: WeakKeyDictionary[Geometry, tuple[tuple[object, ...], R]] = WeakKeyDictionary()

    @wraps(function)
    def cached(geometry: Geometry, *parameters: object) -> R:
        if geometry in cache and cache[geometry][0] == parameters:
            return cache[geometry][1]
        value = function(geometry, *parameters)
        if math.prod(geometry.shape) <= 2 * BLOCK:
            cache[geometry] = parameters, value
        return value

    return cached


@dataclass(frozen=True, slots=True)
class Validity:
    """Validity of a model: `mask`, True where it is valid, and the reason where it is not."""

    mask: BoolArray
    reason: str


@dataclass(frozen=True, slots=True)
class Parameter:
    """Parameter of a model: `low` and `high` bound its domain, both included.

    `unit` is as people write it ("1" for a pure number). `scale`: its part of the BRDF rises about
    in proportion to it from zero, so that a fit solves for its first value instead of searching.
    `level`: it rises from zero with it, but not in proportion: a fit first adjusts it to the level
    of the data, and then searches for all. `scanned`: chi2 has several minima along it, so that a
    fit looks for others on the line through the one that it has found.
    `starts`: values from which a fit starts the search; by default seven over the domain, denser
    towards its low end, as narrow lobes are easier to miss than wide ones. `logarithmic`: a fit
    searches for its logarithm; the domain then begins at 0 or above.
    """

    name: str
    unit: str
    low: float
    high: float
    default: float
    scale: bool = False
    starts: tuple[float, ...] = ()
    logarithmic: bool = False
    level: bool = False
    scanned: bool = False

    def __post_init__(self) -> None:
        if not (math.isfinite(self.low) and math.isfinite(self.high) and self.low < self.high):
            raise ValueError(
                f"{self.name}: bounds {self.low:g} to {self.high:g} are not finite, or low >= high"
            )
        for value in (self.default, *self.starts):
            self.check(value)
        if not self.starts:
            parts = ((k + 0.5) / 7 for k in range(7))
            starts = tuple(self.low + part * part * (self.high - self.low) for part in parts)
            object.__setattr__(self, "starts", starts)
        if self.scale and not 0 <= self.low < self.default:
            raise ValueError(
                f"{self.name}: lower bound {self.low:g}, default {self.default:g}; allowed for a "
                "scale: a lower bound of 0 or more and a default above it"
            )
        if self.logarithmic and self.low < 0:
            raise ValueError(
                f"{self.name}: lower bound {self.low:g}; allowed, as it is logarithmic: 0 or above"
            )

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
    """Reflectance model: call `brdf`; `kernel` is the bare formula, without checks.

    `gradient_kernel`: derivatives by each parameter, name -> array, in closed form or under the
    integral; None: `gradient` takes central differences. `validity_kernel`: None: the model is
    valid wherever it is defined. `in_blocks`: large arrays go through the kernel in blocks that
    stay in the processor's cache, which takes two thirds of the time; not for a kernel that caches
    a whole set of geometries. `terms`: the models of a sum, or the parts of one model, each with
    its own parameters.
    """

    name: str
    parameters: tuple[Parameter, ...]
    kernel: Kernel
    gradient_kernel: Callable[..., dict[str, FloatArray]] | None = None
    validity_kernel: Callable[..., Validity] | None = None
    in_blocks: bool = True
    terms: tuple[Model, ...] = ()

    def brdf(self, geometry: Geometry, **parameters: float) -> FloatArray:
        """BRDF in 1/sr, float64, of the geometry's shape.

        Takes every parameter by name, a scalar in its unit. Raises `ValueError`, naming the
        argument, its value and what is allowed, for one that is unknown, missing, not finite or out
        of its domain.
        """
        values = self._checked(parameters)
        if not self.in_blocks or math.prod(geometry.shape) <= 2 * BLOCK:
            return np.asarray(self.kernel(geometry, **values), dtype=np.float64)
        flat = np.empty(math.prod(geometry.shape))
        for part, few in geometry.blocks(BLOCK):
            flat[part] = self.kernel(few, **values)
        return flat.reshape(geometry.shape)

    def gradient(self, geometry: Geometry, **parameters: float) -> dict[str, FloatArray]:
        """Derivatives of the BRDF by each parameter, by name.

        Each is of the geometry's shape, in 1/sr per unit of the parameter. Raises `ValueError` as
        `brdf` does.
        """
        values = self._checked(parameters)
        if self.gradient_kernel is not None:
            return self.gradient_kernel(geometry, **values)
        return {p.name: self._difference(geometry, values, p) for p in self.parameters}

    def validity(self, geometry: Geometry, **parameters: float) -> Validity:
        """Mask of the geometry's shape, True where the model is valid, and the reason elsewhere.

        Raises `ValueError` as `brdf` does.
        """
        values = self._checked(parameters)
        if self.validity_kernel is None:
            return Validity(np.ones(geometry.shape, dtype=bool), "")
        return self.validity_kernel(geometry, **values)

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


Terms = tuple[Model, ...]


def add(*models: Model) -> Model:
    """Sum of models, named `a+b`: a parameter name that they share is one parameter of the sum.

    Its domain is the intersection of theirs. Raises `ValueError` when that is empty or the units
    differ.
    """
    shared: dict[str, Parameter] = {}
    for parameter in (p for model in models for p in model.parameters):
        known = shared.get(parameter.name)
        shared[parameter.name] = _intersection(known, parameter) if known else parameter
    return Model(
        "+".join(m.name for m in models),
        tuple(shared.values()),
        partial(_sum_brdf, models),
        partial(_sum_gradient, models),
        partial(_sum_validity, models),
        in_blocks=all(model.in_blocks for model in models),
        terms=models,
    )


def named_terms(model: Model) -> tuple[Model, ...]:
    """Models of which this one is the sum by its name; alone if that names one."""
    return model.terms if "+" in model.name else (model,)


def _sum_brdf(models: Terms, geometry: Geometry, **parameters: float) -> FloatArray:
    return reduce(np.add, (m.kernel(geometry, **_own(m, parameters)) for m in models))


def _sum_gradient(models: Terms, geometry: Geometry, **parameters: float) -> dict[str, FloatArray]:
    total: dict[str, FloatArray] = {}
    for model in models:
        for name, by in model.gradient(geometry, **_own(model, parameters)).items():
            total[name] = total[name] + by if name in total else by
    return total


def _sum_validity(models: Terms, geometry: Geometry, **parameters: float) -> Validity:
    each = [model.validity(geometry, **_own(model, parameters)) for model in models]
    reasons = dict.fromkeys(v.reason for v in each if v.reason)
    return Validity(np.all([v.mask for v in each], axis=0), "; ".join(reasons))


def _own(model: Model, parameters: Mapping[str, float]) -> dict[str, float]:
    """Select the parameters of one model from those of the sum."""
    return {p.name: parameters[p.name] for p in model.parameters}


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
