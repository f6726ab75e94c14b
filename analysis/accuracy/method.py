"""Methods of computing one reflectance model, each with a bound on its error and its cost.

What to use when: `analysis.accuracy.cheapest.cheapest` to find the cheapest adequate method of a
family. `rough_surface` has the family that fits and pictures use. The smooth dielectric and the
lobe have none, as their approximations save too little.

An error is relative to the family's most accurate method at each geometry. Costs are in evaluations
of the functional form in one geometry of many (0.08 us on the core of 2 GHz where all were timed,
one process, least CPU time of several), so that they hold as ratios elsewhere.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from analysis.models.base import Parameter, Ranges
from instrument.geometry import FloatArray, Geometry

Bound = Callable[[Geometry, Ranges], FloatArray]


class Cost(NamedTuple):
    """Cost of a method, in functional forms of one geometry: per call, and per geometry in it.

    Of geometries that are seen for the first time: nothing is cached for them.
    """

    call: float
    geometry: float

    def of(self, size: int) -> float:
        """Cost of one evaluation of `size` geometries."""
        return self.call + self.geometry * size


@dataclass(frozen=True, slots=True)
class Method:
    """One way to compute a model.

    kernel: arguments and result as in `Model.brdf`. bound: of a vector of geometries (N,) and
    ranges the largest relative error in all of the ranges, (N,); infinite where it is not known.
    tight_bound: a tighter bound that takes longer, used where `bound` leaves a doubt.
    """

    name: str
    kernel: Callable[..., FloatArray]
    bound: Bound
    cost: Cost
    tight_bound: Bound | None = None


@dataclass(frozen=True, slots=True)
class MethodFamily:
    """All methods of computing one model.

    parameters: of all the kernels, with their domains: an albedo in which errors are monotone, and
    sigma_deg. methods: the last one is the most accurate.
    """

    name: str
    parameters: tuple[Parameter, ...]
    methods: tuple[Method, ...]

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


def relative_error(found: FloatArray, reference: FloatArray) -> FloatArray:
    """Signed error relative to the reference; 0 where both are 0.

    `found` and `reference`: BRDFs in 1/sr of one shape, which is the result's.
    """
    difference = found - reference
    nothing = np.where(difference == 0, 0.0, np.inf)
    return np.divide(difference, reference, out=nothing, where=reference > 0)
