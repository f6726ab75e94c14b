"""Methods: ways to work out one physics, each with what it is off by, at most, and what it costs.

What to use when: `analysis.accuracy.cheapest.cheapest` to have the cheapest adequate one named;
`PHYSICS` to see what there is.

=========  ==============================================  ====================================
physics    methods                                         reference
=========  ==============================================  ====================================
rough      lambert, qualitative (36), functional (33) +    the V-cavity integral with its finest
           (34), table (`departure`), coarse, exact,       quadrature, 1e-8
           fine: the integral to 1e-4, 1e-6, 1e-8
smooth     polynomial (Wolff's F), order 1 to order 16     `wolff_brdf`, 1e-10
           (Chandrasekhar's H), exact
lobe       smooth (g << 1), rough (g >> 1), 10 terms,      Beckmann's adaptive sum, 1e-9
           100 terms, adaptive
=========  ==============================================  ====================================

An error is relative to the reference at each geometry; where that is below the physics' `floor`,
in 1/sr, to the floor. Costs are in evaluations of the functional form in one geometry of many
(0.08 us on the core of 2 GHz where all were timed, one process, least CPU time of several), so that
they hold as ratios elsewhere.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from analysis.models.base import Parameter
from instrument.geometry import FloatArray, Geometry

Ranges = Mapping[str, tuple[float, float]]
"""Lowest and highest value of each parameter; a known one has them equal."""

Bound = Callable[[Geometry, Ranges], FloatArray]
Way = Literal["ends", "high", "even", "log"]


@dataclass(frozen=True, slots=True)
class Cost:
    """What a method costs, in functional forms of one geometry.

    `call` and `geometry`: of a call, however many geometries it has, and of each of these, seen
    for the first time. `call_again` and `again`: the same with other parameters.
    """

    call: float
    geometry: float
    call_again: float
    again: float

    def of(self, size: int, uses: int = 1) -> float:
        """The cost of `uses` evaluations, with ever other parameters, of `size` geometries."""
        first = self.call + self.geometry * size
        return first + (self.call_again + self.again * size) * (uses - 1)


@dataclass(frozen=True, slots=True)
class Method:
    """One way to work out a physics.

    kernel: geometry and parameters in, BRDF out, in 1/sr. bound: of a vector of geometries (N,)
    and ranges the largest relative error in all of the ranges, (N,); infinite where it is not
    known. closer: a tighter bound, at a price, to be asked where `bound` does not settle a matter.
    cost: of (geometries, ranges).
    """

    name: str
    kernel: Callable[..., FloatArray]
    bound: Bound
    cost: Callable[[Geometry, Ranges], Cost]
    closer: Bound | None = None


@dataclass(frozen=True, slots=True)
class Physics:
    """Methods for the same thing, and how to look into their errors.

    parameters: of all the kernels, with their domains. methods: in no order; the last one is the
    most accurate. accuracy: of a geometry vector (N,), what the last one is off itself. ways: how
    a parameter's range is looked into: "ends" where errors are monotone between them, "high" where
    its upper end has the largest, "even" or "log" steps else. floor: in 1/sr.
    """

    name: str
    parameters: tuple[Parameter, ...]
    methods: tuple[Method, ...]
    accuracy: Callable[[Geometry], FloatArray]
    ways: Mapping[str, Way]
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

    def off(self, found: FloatArray, reference: FloatArray) -> FloatArray:
        """Signed error relative to the reference or the floor; 0 where both are 0."""
        whole = np.maximum(np.abs(reference), self.floor)
        difference = found - reference
        nothing = np.where(difference == 0, 0.0, np.inf)
        return np.divide(difference, whole, out=nothing, where=whole > 0)


def constant(error: float) -> Bound:
    """A bound that is the same everywhere."""
    return lambda geometry, _: np.full(geometry.shape, error)


def priced(*parts: *tuple[float, float, float, float]) -> Callable[[Geometry, Ranges], Cost]:
    """A cost that depends on neither the geometries nor the parameters: the parts of a `Cost`."""
    return lambda *_: Cost(*parts)


def cells_of(edges: FloatArray, low: float, high: float) -> slice:
    """The cells between `edges`, rising, that a range from low to high touches."""
    first = int(np.searchsorted(edges, low, side="left")) - 1
    last = int(np.searchsorted(edges, high, side="right")) - 1
    first, last = (min(max(cell, 0), edges.size - 2) for cell in (first, last))
    return slice(min(first, last), max(first, last) + 1)


def cell_at(edges: FloatArray, value: FloatArray) -> np.ndarray[tuple[int, ...], np.dtype[np.intp]]:
    """The cell between `edges`, rising, in which each value lies; the outer ones beyond them."""
    return np.clip(np.searchsorted(edges, value, side="right") - 1, 0, edges.size - 2)
