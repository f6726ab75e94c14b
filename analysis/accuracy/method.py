"""Methods of computing one reflectance model, each with a bound on its error and its cost.

What to use when: `analysis.accuracy.cheapest.cheapest` to find the cheapest adequate method of a
family. `rough_surface` has the family that fits and pictures use; those of the smooth dielectric
and the lobe are in `acquisition.benchmark.maps`, as their approximations save too little.

=========  ==============================================  ====================================
family     methods                                         reference
=========  ==============================================  ====================================
rough      lambert, qualitative (36), functional (33) +    the V-cavity integral with its finest
           (34), table (`form_error_table`), coarse,       quadrature, 1e-8
           exact, fine: the integral to 1e-4, 1e-6, 1e-8
smooth     polynomial (Wolff's F), order 1 to order 16     `wolff_brdf`, 1e-10
           (Chandrasekhar's H), exact
lobe       smooth (g << 1), rough (g >> 1), 10 terms,      Beckmann's adaptive sum, 1e-9
           100 terms, adaptive
=========  ==============================================  ====================================

An error is relative to the reference at each geometry; where that is below the family's `floor`,
in 1/sr, to the floor. Costs are in evaluations of the functional form in one geometry of many
(0.08 us on the core of 2 GHz where all were timed, one process, least CPU time of several), so that
they hold as ratios elsewhere.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from analysis.models.base import Parameter, Ranges
from instrument.geometry import FloatArray, Geometry

Bound = Callable[[Geometry, Ranges], FloatArray]
Sampling = Literal["ends", "high", "even", "log"]


@dataclass(frozen=True, slots=True)
class Cost:
    """Cost of a method, in functional forms of one geometry.

    `call` and `geometry`: per call and per geometry in it, when these geometries are seen for the
    first time. `call_again` and `again`: the same with other parameters.
    """

    call: float
    geometry: float
    call_again: float
    again: float

    def of(self, size: int, uses: int = 1) -> float:
        """Cost of `uses` evaluations of `size` geometries, each with other parameters."""
        first = self.call + self.geometry * size
        return first + (self.call_again + self.again * size) * (uses - 1)


@dataclass(frozen=True, slots=True)
class Method:
    """One way to compute a model.

    kernel: arguments and result as in `Model.brdf`. bound: of a vector of geometries (N,) and
    ranges the largest relative error in all of the ranges, (N,); infinite where it is not known.
    cost: of (geometries, ranges). tight_bound: a tighter bound that takes longer, used where
    `bound` leaves a doubt.
    """

    name: str
    kernel: Callable[..., FloatArray]
    bound: Bound
    cost: Callable[[Geometry, Ranges], Cost]
    tight_bound: Bound | None = None


@dataclass(frozen=True, slots=True)
class MethodFamily:
    """All methods of computing one model.

    parameters: of all the kernels, with their domains. methods: in no order; the last one is the
    most accurate. sampling: the values of a parameter's range at which errors are looked for:
    "ends" where errors are monotone between them, "high" where its upper end has the largest,
    "even" or "log" steps otherwise. floor: in 1/sr.
    """

    name: str
    parameters: tuple[Parameter, ...]
    methods: tuple[Method, ...]
    sampling: Mapping[str, Sampling]
    floor: float = 0.0

    def __getitem__(self, name: str) -> Method:
        """The method of that name. Raises `KeyError` that lists the known ones."""
        for method in self.methods:
            if method.name == name:
                return method
        known = ", ".join(m.name for m in self.methods)
        raise KeyError(f"unknown method {name!r} of {self.name}; known: {known}")

    @property
    def reference(self) -> Method:
        """The most accurate method."""
        return self.methods[-1]

    def accuracy(self, geometry: Geometry) -> FloatArray:
        """Bound on the relative error (a ratio) of the most accurate method itself, (N,)."""
        return self.reference.bound(geometry, {})

    def relative_error(self, found: FloatArray, reference: FloatArray) -> FloatArray:
        """Signed error relative to the reference or the floor; 0 where both are 0.

        `found` and `reference`: BRDFs in 1/sr of one shape, which is the result's.
        """
        whole = np.maximum(np.abs(reference), self.floor)
        difference = found - reference
        nothing = np.where(difference == 0, 0.0, np.inf)
        return np.divide(difference, whole, out=nothing, where=whole > 0)


def constant_bound(error: float) -> Bound:
    """Bound that is the same everywhere."""
    return lambda geometry, _: np.full(geometry.shape, error)


def fixed_cost(
    call: float, geometry: float, call_again: float | None = None, again: float | None = None
) -> Callable[[Geometry, Ranges], Cost]:
    """Cost that depends on neither the geometries nor the parameters.

    All are scalars in the unit of `Cost`. By default a repeated evaluation costs as much as the
    first.
    """
    cost = Cost(
        call,
        geometry,
        call if call_again is None else call_again,
        geometry if again is None else again,
    )
    return lambda *_: cost
