"""The cheapest adequate method: what a scene needs, and no more.

What to use when: `cheapest` before work that evaluates a model often (a fit, a picture, a search),
to learn which method of `analysis.accuracy.method` keeps a tolerance in that scene. To ask costs,
for a rough surface on a core of 2 GHz: 5 to 12 ms up to 2000 geometries and 15 to 30 ms for 20 000
where the bounds settle the matter, half as much again for ranges; 20 to 115 ms where doubtful
geometries have to be integrated. The integral itself takes 0.1 ms a geometry, so asking is worth it
where the answer saves more than a hundred or two of them; a sum such as `beckmann_spizzichino`'s is
as cheap as the question.

How: methods are tried by rising cost. Each has a bound on its error over the whole range in each
geometry. A few of the worst geometries are checked first, a form against the table and then
against the reference: that refutes most methods at once. Where the bound is within the tolerance,
that is all; where it is not, it may only be pessimistic: a closer bound is asked for, and what is
still in doubt is checked, at enough parameters that what may happen between them is known
(`_between`). A method whose doubts are too many to check is passed over.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.accuracy.method import Method, Physics, Ranges
from analysis.accuracy.methods_lobe import LOBE_OF_WAVES
from analysis.accuracy.methods_smooth import SMOOTH_BODY
from analysis.accuracy.rough_surface import ROUGH_SURFACE
from instrument.geometry import BoolArray, FloatArray, Geometry

PHYSICS = {p.name: p for p in (ROUGH_SURFACE, SMOOTH_BODY, LOBE_OF_WAVES)}

CHECKS = 256
"""Geometries that are checked against the reference, at most, where a bound leaves a doubt."""

_FEW = 4  # of the worst, with which a check begins
# Steps of a range, by how many ranges there are: to refute, and to clear, which takes rounds.
_COARSE_STEPS = {1: 3, 2: 3}
_FINE_STEPS = ({1: 17, 2: 9}, {1: 17, 2: 9}, {1: 33, 2: 17}, {1: 65, 2: 33})
_ACCURATE = 20.0  # a reference is so many times more accurate than what it checks
_DARKEST = 1e-9  # of a range that begins at 0: there a relative error is a limit
_DECADES = 1e-3  # of its upper end, at which a range on a logarithmic scale begins

Indices = NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class Adequate:
    """The answer. Errors are relative, the largest over geometries and ranges.

    predicted: by the method's bound. checked: against the reference, at `pairs` pairs of a
    geometry and parameters. cost: of `uses` evaluations, in functional forms of one geometry;
    cost_of_best: of the most accurate method. brdf: the method's kernel.
    """

    physics: str
    method: str
    brdf: Callable[..., FloatArray]
    predicted: float
    checked: float
    pairs: int
    cost: float
    cost_of_best: float


def cheapest(
    physics: str,
    geometry: Geometry,
    ranges: Ranges,
    tolerance: ArrayLike,
    *,
    uses: int = 1,
    checks: int = CHECKS,
    among: Sequence[str] | None = None,
) -> Adequate:
    """The cheapest method for `physics` that keeps a relative tolerance in a scene.

    `ranges`: lowest and highest value of every parameter; equal where it is known. `tolerance`:
    one for all, or one for each geometry. `uses`: how often the scene is evaluated, each time
    with other parameters: an integral that is costly once is cheap the next time. `among`: names
    of the methods to choose from; the most accurate one always stands by.

    Raises `ValueError` for a tolerance that not even the most accurate method keeps, a range that
    falls or leaves its parameter's domain, or one that is missing; `KeyError` for an unknown
    physics or method.
    """
    kind = _physics(physics)
    _check_ranges(kind, ranges)
    scene = _Scene(kind, _flat(geometry), ranges, _tolerances(kind, geometry, tolerance), checks)
    names = [m.name for m in kind.methods] if among is None else list(among)
    methods = [kind[name] for name in dict.fromkeys((*names, kind.reference.name))]
    costs = {m.name: m.cost(scene.geometry, ranges).of(scene.size, uses) for m in methods}
    # Of two that cost the same the more accurate one, which stands later.
    for method in sorted(methods, key=lambda m: (costs[m.name], -kind.methods.index(m))):
        predicted, checked = scene.judged(method)
        if checked is not None:
            break
    return Adequate(
        kind.name,
        method.name,
        method.kernel,
        predicted,
        checked or 0.0,
        scene.pairs,
        costs[method.name],
        costs[kind.reference.name],
    )


class _Off(NamedTuple):
    """How large the error is at some geometries over ranges: at least and at most.

    least: (n,), the largest found, less what the reference is off itself. most: (..., n), at each
    of the parameters in `axes` and about it, with that and with what may lie between them.
    """

    least: FloatArray
    most: FloatArray
    axes: dict[str, list[float]]

    def about(self, above: BoolArray) -> Ranges:
        """The ranges that hold the marked parameters (...,) and those next to them."""
        held = {}
        for k, (name, values) in enumerate(self.axes.items()):
            others = tuple(axis for axis in range(above.ndim) if axis != k)
            at = np.flatnonzero(above.any(axis=others))
            held[name] = (values[max(at[0] - 1, 0)], values[min(at[-1] + 1, len(values) - 1)])
        return held


@dataclass(slots=True)
class _Scene:
    """What is asked: geometries (N,), ranges, tolerances (N,); `pairs` counts what was checked."""

    physics: Physics
    geometry: Geometry
    ranges: Ranges
    tolerance: FloatArray
    checks: int
    pairs: int = 0

    @property
    def size(self) -> int:
        return int(self.tolerance.size)

    def judged(self, method: Method) -> tuple[float, float | None]:
        """What a method is predicted to be off, and what was found; None where it is not kept."""
        bound = method.bound(self.geometry, self.ranges)
        if self.size == 0 or method is self.physics.reference:
            return float(np.max(bound, initial=0.0)), 0.0
        worst = self._worst(bound, np.arange(self.size))[:_FEW]
        # Most methods fail before an integral is made.
        ways = {
            m.name: m for m in (self._table(method, worst), self._reference(method, worst)) if m
        }
        for reference in ways.values():
            found = self._off(method, worst, _COARSE_STEPS, self.ranges, reference)
            if self._broken(worst, found):
                return float(bound.max()), None
        bound = self._closer(method, bound)
        doubtful = self._worst(bound, np.flatnonzero(bound > self.tolerance))
        checked: float | None = float(found.least.max())
        if doubtful.size > self.checks:
            checked = None
        for part in (doubtful[: 4 * _FEW], doubtful[4 * _FEW :]):
            if part.size and checked is not None:
                checked = self._cleared(method, part, checked)
        return float(bound.max()), checked

    def _worst(self, bound: FloatArray, of: Indices) -> Indices:
        """Some geometries, those first whose bound is highest above the tolerance."""
        return of[np.argsort(-bound[of] / self.tolerance[of], kind="stable")]

    def _closer(self, method: Method, bound: FloatArray) -> FloatArray:
        """The bound, made tighter where it leaves a doubt and that can be had."""
        doubtful = np.flatnonzero(bound > self.tolerance)
        if method.closer is None or not doubtful.size:
            return bound
        bound = bound.copy()
        few = self._some(doubtful)
        bound[doubtful] = np.minimum(bound[doubtful], method.closer(few, self.ranges))
        return bound

    def _cleared(self, method: Method, doubtful: Indices, so_far: float) -> float | None:
        """The largest error found when no geometry breaks its tolerance anywhere; else None.

        Where the steps leave a doubt, the part of the ranges that does is gone through again.
        """
        ranges = self.ranges
        for steps in _FINE_STEPS:
            reference = self._reference(method, doubtful)
            found = self._off(method, doubtful, steps, ranges, reference)
            so_far = max(so_far, float(found.least.max()))
            if self._broken(doubtful, found):
                return None
            above: BoolArray = np.asarray(found.most > self.tolerance[doubtful])
            doubtful = doubtful[above.any(axis=tuple(range(above.ndim - 1)))]
            if not doubtful.size:
                return so_far
            ranges = found.about(np.asarray(above.any(axis=-1)))
        return None

    def _broken(self, at: Indices, found: _Off) -> bool:
        return bool(np.any(found.least > self.tolerance[at]))

    def _off(
        self,
        method: Method,
        at: Indices,
        steps: dict[int, int],
        ranges: Ranges,
        reference: Method,
    ) -> _Off:
        """The error at some geometries over some ranges, against a reference."""
        geometry = self._some(at)
        stepped = self._stepped(ranges)
        axes = {name: self._values(name, ranges, steps[max(sum(stepped), 1)]) for name in ranges}
        off = np.empty((*map(len, axes.values()), at.size))
        for place in np.ndindex(off.shape[:-1]):
            values = {n: v[i] for (n, v), i in zip(axes.items(), place, strict=True)}
            exact = reference.kernel(geometry, **values)
            off[place] = self.physics.off(method.kernel(geometry, **values), exact)
        self.pairs += off.size
        own = reference.bound(geometry, ranges)
        largest = np.abs(off).max(axis=tuple(range(off.ndim - 1)))
        least = np.maximum(largest - own * (1 + largest), 0.0)
        most = _between(off, stepped)
        return _Off(least, most + own * (1 + most), axes)

    def _reference(self, method: Method, at: Indices) -> Method:
        """The first of the methods behind the one in question that is accurate enough there."""
        methods, geometry = self.physics.methods, self._some(at)
        for other in methods[methods.index(method) + 1 :]:
            if other.name in _REFERENCES:
                bound = other.bound(geometry, self.ranges)
                if np.all(bound * _ACCURATE <= self.tolerance[at]):
                    return other
        return self.physics.reference

    def _table(self, method: Method, at: Indices) -> Method | None:
        """What tells cheaply, if not well, how far a printed form is off; None where it cannot."""
        if method.closer is None:
            return None
        table = self.physics[_TABLE]
        known = np.isfinite(table.bound(self._some(at), self.ranges))
        return table if known.all() else None

    def _values(self, name: str, ranges: Ranges, count: int) -> list[float]:
        """The values of a parameter that are tried."""
        low, high = ranges[name]
        way = self.physics.ways[name]
        if way == "high" or low == high:
            return [high]
        if way == "ends":
            return [max(low, _DARKEST * high), high]
        if way == "even":
            return [float(v) for v in np.linspace(low, high, count)]
        start = max(low, _DECADES * high)
        steps = [float(v) for v in np.geomspace(start, high, count)]
        return [low, *steps] if low < start else steps

    def _stepped(self, ranges: Ranges) -> list[bool]:
        """Which ranges are gone through in steps."""
        ways = self.physics.ways
        return [ways[n] in ("even", "log") and low < high for n, (low, high) in ranges.items()]

    def _some(self, at: Indices) -> Geometry:
        g = self.geometry
        return Geometry(g.theta_i_deg[at], g.theta_r_deg[at], g.dphi_deg[at])


_REFERENCES = ("exact", "fine", "adaptive")
_TABLE = "table"


def _between(off: FloatArray, stepped: Sequence[bool]) -> FloatArray:
    """How large errors (..., n) may be at each step of the ranges and about it.

    Between the nodes of a smooth curve lies at most an eighth of its second difference there;
    twice that is allowed.
    """
    most = np.abs(off)
    for axis, moves in enumerate(stepped):
        if moves and off.shape[axis] > 2:
            bend = np.abs(np.diff(off, 2, axis=axis)) / 4
            edges = [(1, 1) if k == axis else (0, 0) for k in range(off.ndim)]
            most = most + np.pad(bend, edges, mode="edge")
    return most


def _physics(name: str) -> Physics:
    if name not in PHYSICS:
        raise KeyError(f"unknown physics {name!r}; known: {', '.join(PHYSICS)}")
    return PHYSICS[name]


def _check_ranges(physics: Physics, ranges: Ranges) -> None:
    known = {p.name: p for p in physics.parameters}
    for name in ranges:
        if name not in known:
            raise ValueError(f"{physics.name} has no parameter {name}; it has: {', '.join(known)}")
    for name, parameter in known.items():
        if name not in ranges:
            raise ValueError(f"{physics.name} needs a range of {name}: {parameter.domain}")
        low, high = (parameter.check(end) for end in ranges[name])
        if low > high:
            raise ValueError(f"{name} = {low:g} to {high:g}; allowed: a range that rises")


def _flat(geometry: Geometry) -> Geometry:
    return Geometry(
        geometry.theta_i_deg.ravel(), geometry.theta_r_deg.ravel(), geometry.dphi_deg.ravel()
    )


def _tolerances(physics: Physics, geometry: Geometry, tolerance: ArrayLike) -> FloatArray:
    """One for each geometry, (N,); what no method keeps is refused."""
    each = np.broadcast_to(np.asarray(tolerance, dtype=np.float64), geometry.shape).ravel()
    least = physics.accuracy(_flat(geometry))
    if np.any(~(each >= least)):
        k = int(np.flatnonzero(~(each >= least))[0])
        raise ValueError(
            f"tolerance = {each[k]:g}; the most accurate method, {physics.reference.name}, is good "
            f"to {least[k]:g} there (theta_i {geometry.theta_i_deg.ravel()[k]:g}, theta_r "
            f"{geometry.theta_r_deg.ravel()[k]:g} degrees); allowed: that or more"
        )
    return each
