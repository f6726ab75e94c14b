"""The cheapest adequate method: the one that keeps a tolerance in a scene at the lowest cost.

What to use when: `cheapest` before work that evaluates a model often (a fit, a picture, a search),
to learn which method of `analysis.accuracy.method` keeps a tolerance in that scene. The search
takes, for a rough surface on a core of 2 GHz, 5 to 12 ms up to 2000 geometries and 15 to 30 ms for
20 000 where the bounds settle the matter, half as much again for ranges; 20 to 115 ms where
doubtful geometries have to be integrated. The integral itself takes 0.1 ms a geometry, so the
search is worth it where the answer saves more than a hundred or two of them.

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
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from analysis.accuracy.method import Method, MethodFamily
from analysis.models.base import Ranges
from analysis.models.lambert import DARKEST
from instrument.geometry import BoolArray, FloatArray, Geometry, IntArray

CHECKS = 256
"""Largest number of doubtful geometries that are checked against the reference."""

_FEW = 4  # of the worst, with which a check begins
# Steps of a range, by the number of ranges: to refute a method, and, in rounds, to accept it.
_COARSE_STEPS = {1: 3, 2: 3}
_FINE_STEPS = ({1: 17, 2: 9}, {1: 17, 2: 9}, {1: 33, 2: 17}, {1: 65, 2: 33})
_ACCURATE = 20.0  # a reference is so many times more accurate than the tolerance it checks
_DECADES = 1e-3  # of its upper end, at which a range on a logarithmic scale begins


@dataclass(frozen=True, slots=True, kw_only=True)
class Adequate:
    """Result of `cheapest`. Errors are relative, the largest over geometries and ranges.

    predicted: by the method's bound. checked: against the reference, at `pairs` pairs of a
    geometry and parameters. cost: of `uses` evaluations, in functional forms of one geometry;
    cost_of_best: of the most accurate method. brdf: the method's kernel.
    """

    method: str
    brdf: Callable[..., FloatArray]
    predicted: float
    checked: float
    pairs: int
    cost: float
    cost_of_best: float


def cheapest(
    family: MethodFamily,
    geometry: Geometry,
    ranges: Ranges,
    tolerance: ArrayLike,
    *,
    uses: int = 1,
    checks: int = CHECKS,
    among: Sequence[str] | None = None,
) -> Adequate:
    """The cheapest method of a family that keeps a relative tolerance in a scene.

    `geometry`: any shape. `ranges`: lowest and highest value of every parameter; equal where it is
    known. `tolerance`: one for all, or one for each geometry. `uses`: number of evaluations of the
    scene, each with other parameters: an integral that is costly once is cheap the next time.
    `among`: names of the methods to choose from; the most accurate one is always included.

    Raises `ValueError` for a tolerance that not even the most accurate method keeps, a range that
    falls or leaves its parameter's domain, or one that is missing; `KeyError` for an unknown
    method.
    """
    _check_ranges(family, ranges)
    tolerances = _tolerances(family, geometry, tolerance)
    scene = _Scene(family, _flat(geometry), ranges, tolerances, checks)
    names = [m.name for m in family.methods] if among is None else list(among)
    methods = [family[name] for name in dict.fromkeys((*names, family.reference.name))]
    costs = {m.name: m.cost(scene.geometry, ranges).of(scene.size, uses) for m in methods}
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
        pairs=scene.pairs,
        cost=costs[method.name],
        cost_of_best=costs[family.reference.name],
    )


class _Errors(NamedTuple):
    """Bounds from below and above on the largest error at some geometries over ranges.

    least: (n,), the largest error found, less the reference's own. most: (..., n), at each of the
    parameters in `axes` and around it, plus the reference's own and what may lie between.
    """

    least: FloatArray
    most: FloatArray
    axes: dict[str, list[float]]

    def ranges_around(self, above: BoolArray) -> Ranges:
        """The ranges that hold the marked parameters (...,) and those next to them."""
        found = {}
        for k, (name, values) in enumerate(self.axes.items()):
            others = tuple(axis for axis in range(above.ndim) if axis != k)
            at = np.flatnonzero(above.any(axis=others))
            found[name] = (values[max(at[0] - 1, 0)], values[min(at[-1] + 1, len(values) - 1)])
        return found


@dataclass(slots=True)
class _Scene:
    """Geometries (N,), ranges and tolerances (N,) of one search; `pairs` counts the checks."""

    family: MethodFamily
    geometry: Geometry
    ranges: Ranges
    tolerance: FloatArray
    checks: int
    pairs: int = 0

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
            doubtful = doubtful[above.any(axis=tuple(range(above.ndim - 1)))]
            if not doubtful.size:
                return so_far
            ranges = found.ranges_around(np.asarray(above.any(axis=-1)))
        return None

    def _fails(self, at: IntArray, found: _Errors) -> bool:
        return bool(np.any(found.least > self.tolerance[at]))

    def _errors(
        self,
        method: Method,
        at: IntArray,
        steps: dict[int, int],
        ranges: Ranges,
        reference: Method,
    ) -> _Errors:
        """Error at some geometries over some ranges, against a reference."""
        geometry = self._geometries(at)
        stepped = self._stepped(ranges)
        axes = {name: self._values(name, ranges, steps[max(sum(stepped), 1)]) for name in ranges}
        errors = np.empty((*map(len, axes.values()), at.size))
        for place in np.ndindex(errors.shape[:-1]):
            values = {n: v[i] for (n, v), i in zip(axes.items(), place, strict=True)}
            exact = reference.kernel(geometry, **values)
            errors[place] = self.family.relative_error(method.kernel(geometry, **values), exact)
        self.pairs += errors.size
        own = reference.bound(geometry, ranges)
        largest = np.abs(errors).max(axis=tuple(range(errors.ndim - 1)))
        least = np.maximum(largest - own * (1 + largest), 0.0)
        most = _between(errors, stepped)
        return _Errors(least, most + own * (1 + most), axes)

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

    def _values(self, name: str, ranges: Ranges, count: int) -> list[float]:
        """Values of a parameter at which the error is evaluated."""
        low, high = ranges[name]
        sampling = self.family.sampling[name]
        if sampling == "high" or low == high:
            return [high]
        if sampling == "ends":
            return [max(low, DARKEST * high), high]
        if sampling == "even":
            return [float(v) for v in np.linspace(low, high, count)]
        start = max(low, _DECADES * high)
        steps = [float(v) for v in np.geomspace(start, high, count)]
        return [low, *steps] if low < start else steps

    def _stepped(self, ranges: Ranges) -> list[bool]:
        """True for each range that is sampled in steps."""
        kinds = self.family.sampling
        return [kinds[n] in ("even", "log") and low < high for n, (low, high) in ranges.items()]

    def _geometries(self, at: IntArray) -> Geometry:
        g = self.geometry
        return Geometry(g.theta_i_deg[at], g.theta_r_deg[at], g.dphi_deg[at])


_REFERENCES = ("exact", "fine", "adaptive")
_TABLE = "table"


def _between(errors: FloatArray, stepped: Sequence[bool]) -> FloatArray:
    """Largest size of errors (..., n) at each step of the ranges and around it.

    Between the nodes of a smooth curve lies at most an eighth of its second difference there;
    twice that is allowed.
    """
    most = np.abs(errors)
    for axis, moves in enumerate(stepped):
        if moves and errors.shape[axis] > 2:
            bend = np.abs(np.diff(errors, 2, axis=axis)) / 4
            edges = [(1, 1) if k == axis else (0, 0) for k in range(errors.ndim)]
            most = most + np.pad(bend, edges, mode="edge")
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
