"""The cheapest adequate method: the one that keeps a tolerance in a scene at the lowest cost.

What to use when: `cheapest` before work that evaluates a model often (a fit, a picture, a search),
to learn which method of `analysis.accuracy.method` keeps a tolerance in that scene. The search
takes, for a rough surface on a core of 2 GHz, 5 to 12 ms up to 2000 geometries and 15 to 30 ms for
20 000 where the bounds settle the matter, half as much again for ranges; 20 to 115 ms where
doubtful geometries have to be integrated. The integral itself takes 20 us a geometry, so the
search is worth it where the answer saves more than five hundred to a thousand of them.

Algorithm: methods are tried by rising cost. Each has a bound on its error over the whole range in
each geometry. A few of the worst geometries are checked first, a form against the table and then
against the reference: that refutes most methods at once. A bound within the tolerance accepts the
method. A bound above it may only be pessimistic: a tighter bound is computed, and what is still in
doubt is checked, at enough parameters to bound the error between them (`_between`). A method with
too many doubtful geometries to check is skipped.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from analysis.accuracy.method import Method, MethodFamily, relative_error
from analysis.models.base import Ranges
from analysis.models.lambert import DARKEST
from instrument.geometry import BoolArray, FloatArray, Geometry, IntArray

CHECKS = 256
"""Largest number of doubtful geometries that are checked against the reference."""

_FEW = 4  # of the worst, with which a check begins
# Steps of a range of sigma: to refute a method, and, in rounds, to accept it.
_COARSE_STEPS = 3
_FINE_STEPS = (17, 17, 33, 65)
_ACCURATE = 20.0  # a reference is so many times more accurate than the tolerance it checks
_REFERENCES = ("exact", "fine")
_TABLE = "table"
_MOST_ERROR = 1e300  # stands for an infinite one, with which a product by 0 would be undefined


@dataclass(frozen=True, slots=True, kw_only=True)
class Adequate:
    """Result of `cheapest`. Errors are relative, the largest over geometries and ranges.

    predicted: by the method's bound. checked: against the reference. cost: in functional forms of
    one geometry. brdf: the method's kernel.
    """

    method: str
    brdf: Callable[..., FloatArray]
    predicted: float
    checked: float
    cost: float


def cheapest(
    family: MethodFamily,
    geometry: Geometry,
    ranges: Ranges,
    tolerance: ArrayLike,
    *,
    checks: int = CHECKS,
    among: Sequence[str] | None = None,
) -> Adequate:
    """The cheapest method of a family that keeps a relative tolerance in a scene.

    `geometry`: any shape. `ranges`: lowest and highest value of every parameter; equal where it is
    known. `tolerance`: one for all, or one for each geometry. `checks`: largest number of doubtful
    geometries that are checked. `among`: names of the methods to choose from; the most accurate one
    is always included.

    Raises `ValueError` for a tolerance that not even the most accurate method keeps, a range that
    falls or leaves its parameter's domain, or one that is missing; `KeyError` for an unknown
    method.
    """
    _check_ranges(family, ranges)
    tolerances = _tolerances(family, geometry, tolerance)
    scene = _Scene(family, _flat(geometry), ranges, tolerances, checks)
    names = [m.name for m in family.methods] if among is None else list(among)
    methods = [family[name] for name in dict.fromkeys((*names, family.reference.name))]
    costs = {m.name: m.cost.of(scene.size) for m in methods}
    # Of two that cost the same the more accurate one, which stands later.
    for method in sorted(methods, key=lambda m: (costs[m.name], -family.methods.index(m))):
        predicted, checked = scene.judge(method)
        if checked is not None:
            break
    return Adequate(
        method=method.name,
        brdf=method.kernel,
        predicted=predicted,
        checked=checked or 0.0,
        cost=costs[method.name],
    )


class _Errors(NamedTuple):
    """Bounds from below and above on the largest error at some geometries over ranges.

    least: (n,), the largest error found, less the reference's own. most: (sigma, n), at each of
    `sigmas_deg` and around it, plus the reference's own and what may lie between.
    """

    least: FloatArray
    most: FloatArray
    sigmas_deg: list[float]

    def range_around(self, above: BoolArray) -> tuple[float, float]:
        """The range of sigma that holds the marked steps (sigma,) and those next to them."""
        at, last = np.flatnonzero(above), len(self.sigmas_deg) - 1
        return self.sigmas_deg[max(at[0] - 1, 0)], self.sigmas_deg[min(at[-1] + 1, last)]


@dataclass(frozen=True, slots=True)
class _Scene:
    """Geometries (N,), ranges and tolerances (N,) of one search."""

    family: MethodFamily
    geometry: Geometry
    ranges: Ranges
    tolerance: FloatArray
    checks: int

    @property
    def size(self) -> int:
        return int(self.tolerance.size)

    def judge(self, method: Method) -> tuple[float, float | None]:
        """Predicted and checked error of a method; None for one that fails or stays in doubt."""
        bound = method.bound(self.geometry, self.ranges)
        if self.size == 0 or method is self.family.reference:
            return float(np.max(bound, initial=0.0)), 0.0
        worst = self._worst(bound, np.arange(self.size))[:_FEW]
        # Most methods fail before an integral is computed.
        references = {
            m.name: m for m in (self._table(method, worst), self._reference(method, worst)) if m
        }
        for reference in references.values():
            found = self._errors(method, worst, _COARSE_STEPS, self.ranges, reference)
            if self._fails(worst, found):
                return float(bound.max()), None
        bound = self._tightened(method, bound)
        doubtful = self._worst(bound, np.flatnonzero(bound > self.tolerance))
        checked: float | None = float(found.least.max())
        if doubtful.size > self.checks:
            checked = None
        for part in (doubtful[: 4 * _FEW], doubtful[4 * _FEW :]):
            if part.size and checked is not None:
                checked = self._largest_error(method, part, checked)
        return float(bound.max()), checked

    def _worst(self, bound: FloatArray, of: IntArray) -> IntArray:
        """Geometries `of`, sorted by their bound over the tolerance, highest first."""
        return of[np.argsort(-bound[of] / self.tolerance[of], kind="stable")]

    def _tightened(self, method: Method, bound: FloatArray) -> FloatArray:
        """The bound, replaced by the method's tight one where it exceeds the tolerance."""
        doubtful = np.flatnonzero(bound > self.tolerance)
        if method.tight_bound is None or not doubtful.size:
            return bound
        bound = bound.copy()
        few = self._geometries(doubtful)
        bound[doubtful] = np.minimum(bound[doubtful], method.tight_bound(few, self.ranges))
        return bound

    def _largest_error(self, method: Method, doubtful: IntArray, so_far: float) -> float | None:
        """Largest error found, or None when a geometry exceeds its tolerance anywhere.

        Where the steps leave a doubt, that part of the ranges is searched again in finer steps.
        """
        ranges = self.ranges
        for steps in _FINE_STEPS:
            reference = self._reference(method, doubtful)
            found = self._errors(method, doubtful, steps, ranges, reference)
            so_far = max(so_far, float(found.least.max()))
            if self._fails(doubtful, found):
                return None
            above: BoolArray = np.asarray(found.most > self.tolerance[doubtful])
            doubtful = doubtful[above.any(axis=0)]
            if not doubtful.size:
                return so_far
            ranges = {**ranges, "sigma_deg": found.range_around(np.asarray(above.any(axis=1)))}
        return None

    def _fails(self, at: IntArray, found: _Errors) -> bool:
        return bool(np.any(found.least > self.tolerance[at]))

    def _errors(
        self, method: Method, at: IntArray, steps: int, ranges: Ranges, reference: Method
    ) -> _Errors:
        """Error at some geometries over some ranges, against a reference.

        Errors are monotone between the ends of a range of albedos.
        """
        geometry = self._geometries(at)
        darkest, brightest = ranges["albedo"]
        albedos = sorted({max(darkest, DARKEST * brightest), brightest})
        low, high = ranges["sigma_deg"]
        sigmas = [high] if low == high else [float(v) for v in np.linspace(low, high, steps)]
        errors = np.empty((len(albedos), len(sigmas), at.size))
        for (k, albedo), (row, sigma) in product(enumerate(albedos), enumerate(sigmas)):
            found, exact = (m.kernel(geometry, albedo, sigma) for m in (method, reference))
            errors[k, row] = np.clip(relative_error(found, exact), -_MOST_ERROR, _MOST_ERROR)
        own = reference.bound(geometry, ranges)
        largest = np.abs(errors).max(axis=(0, 1))
        least = np.maximum(largest - own * (1 + largest), 0.0)
        most = _between(errors).max(axis=0)
        return _Errors(least, most + own * (1 + most), sigmas)

    def _reference(self, method: Method, at: IntArray) -> Method:
        """The first method after this one that is accurate enough there to check it."""
        methods, geometry = self.family.methods, self._geometries(at)
        for other in methods[methods.index(method) + 1 :]:
            if other.name in _REFERENCES:
                bound = other.bound(geometry, self.ranges)
                if np.all(bound * _ACCURATE <= self.tolerance[at]):
                    return other
        return self.family.reference

    def _table(self, method: Method, at: IntArray) -> Method | None:
        """The table, a cheap and coarse check of a printed form; None where it does not reach."""
        if method.tight_bound is None:
            return None
        table = self.family[_TABLE]
        known = np.isfinite(table.bound(self._geometries(at), self.ranges))
        return table if known.all() else None

    def _geometries(self, at: IntArray) -> Geometry:
        g = self.geometry
        return Geometry(g.theta_i_deg[at], g.theta_r_deg[at], g.dphi_deg[at])


def _between(errors: FloatArray) -> FloatArray:
    """Largest size of errors (albedo, sigma, n) at each step of sigma and around it.

    Between the nodes of a smooth curve lies at most an eighth of its second difference there;
    twice that is allowed.
    """
    most = np.abs(errors)
    if errors.shape[1] > 2:
        bend = np.abs(np.diff(errors, 2, axis=1)) / 4
        most = most + np.pad(bend, ((0, 0), (1, 1), (0, 0)), mode="edge")
    return most


def _check_ranges(family: MethodFamily, ranges: Ranges) -> None:
    known = {p.name: p for p in family.parameters}
    for name in ranges:
        if name not in known:
            raise ValueError(f"{family.name} has no parameter {name}; it has: {', '.join(known)}")
    for name, parameter in known.items():
        if name not in ranges:
            raise ValueError(f"{family.name} needs a range of {name}: {parameter.domain}")
        low, high = (parameter.check(end) for end in ranges[name])
        if low > high:
            raise ValueError(f"{name} = {low:g} to {high:g}; allowed: low <= high")


def _flat(geometry: Geometry) -> Geometry:
    return Geometry(
        geometry.theta_i_deg.ravel(), geometry.theta_r_deg.ravel(), geometry.dphi_deg.ravel()
    )


def _tolerances(family: MethodFamily, geometry: Geometry, tolerance: ArrayLike) -> FloatArray:
    """Tolerance of each geometry, (N,). Raises `ValueError` for one that no method keeps."""
    each = np.broadcast_to(np.asarray(tolerance, dtype=np.float64), geometry.shape).ravel()
    least = family.accuracy(_flat(geometry))
    if np.any(~(each >= least)):
        k = int(np.flatnonzero(~(each >= least))[0])
        raise ValueError(
            f"tolerance = {each[k]:g}; the most accurate method, {family.reference.name}, "
            f"keeps {least[k]:g} there (theta_i {geometry.theta_i_deg.ravel()[k]:g}, theta_r "
            f"{geometry.theta_r_deg.ravel()[k]:g} degrees); allowed: that or more"
        )
    return each
