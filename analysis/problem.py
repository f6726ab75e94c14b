"""One least-squares problem: a model, measured values and their covariance."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares, nnls

from analysis.covariance import Covariance
from analysis.models import Model
from instrument.geometry import FloatArray, Geometry

# Step of the derivatives, as a part of a parameter's domain.
_STEP = 1e-6
# Nearer to a bound than this part of the domain, a parameter is tried on the bound itself.
_NEAR = 1e-4
# Grid points, in all, over the parameters that are searched for.
_GRID = 64


@dataclass(frozen=True, slots=True)
class Solution:
    """A minimum: parameter vector, chi2, whether the search converged, and how it ended."""

    x: FloatArray
    chi2: float
    converged: bool
    message: str


@dataclass(frozen=True, slots=True)
class Problem:
    """Fit gain * model + offset to `brdf` (N,), in 1/sr, with a covariance of the points.

    `gain` (1) and `offset` (1/sr) carry what the rig's acceptance does to the model. Parameter
    vectors `x` are in the order and the units of `model.parameters`.
    """

    model: Model
    geometry: Geometry
    brdf: FloatArray
    covariance: Covariance
    gain: FloatArray | float = 1.0
    offset: FloatArray | float = 0.0
    low: FloatArray = field(init=False)
    high: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "low", np.array([p.low for p in self.model.parameters]))
        object.__setattr__(self, "high", np.array([p.high for p in self.model.parameters]))

    def plain(self, x: FloatArray, geometry: Geometry | None = None) -> FloatArray:
        """The model's BRDF in 1/sr, without gain and offset, here or in another geometry."""
        names = (p.name for p in self.model.parameters)
        return self.model.kernel(
            self.geometry if geometry is None else geometry, **dict(zip(names, x, strict=True))
        )

    def predict(self, x: FloatArray) -> FloatArray:
        """What the rig would measure, (N,), in 1/sr."""
        return np.asarray(self.gain * self.plain(x) + self.offset)

    def residual(self, x: FloatArray) -> FloatArray:
        """Whitened prediction minus data, (N,)."""
        return self.covariance.whiten(self.predict(x) - self.brdf)

    def chi2(self, x: FloatArray) -> float:
        """Sum of the squares of the whitened residuals."""
        r = self.residual(x)
        return float(r @ r)

    def jacobian(self, x: FloatArray, free: Iterable[int] | None = None) -> FloatArray:
        """Whitened derivatives of the prediction by the `free` parameters (all), (N, K)."""
        indices = range(x.size) if free is None else free
        columns = [self._derivative(x, i) for i in indices]
        return self.covariance.whiten(np.stack(columns, axis=1))

    def _derivative(self, x: FloatArray, i: int) -> FloatArray:
        step = _STEP * (self.high[i] - self.low[i])
        above, below = x.copy(), x.copy()
        above[i] = min(x[i] + step, self.high[i])  # one-sided on a bound
        below[i] = max(x[i] - step, self.low[i])
        return np.asarray(
            self.gain * (self.plain(above) - self.plain(below)) / (above[i] - below[i])
        )

    def solve(self, start: FloatArray, held: Iterable[int] = ()) -> Solution:
        """The minimum reached from `start`, with the `held` parameters left where they are."""
        held = frozenset(held)
        solution = self._descend(start, held)
        x = solution.x
        margin = _NEAR * (self.high - self.low)
        at_low, at_high = x - self.low < margin, self.high - x < margin
        near = [i for i in range(x.size) if (at_low | at_high)[i] and i not in held]
        # The search stays inside its bounds; a minimum on a bound is found by going there: with
        # all parameters that are near one, else with each of them by itself.
        for bound in [near, *([i] for i in near if len(near) > 1)] if near else []:
            y = x.copy()
            y[bound] = np.where(at_low, self.low, self.high)[bound]
            there = self._descend(y, held | frozenset(bound))
            if there.chi2 <= solution.chi2 * (1 + 1e-9) + 1e-9:
                return there
        return solution

    def _descend(self, start: FloatArray, held: frozenset[int]) -> Solution:
        free = [i for i in range(start.size) if i not in held]
        if not free:
            return Solution(start, self.chi2(start), True, "nothing to vary")

        def full(y: FloatArray) -> FloatArray:
            x = start.copy()
            x[free] = y
            return x

        def residual(y: FloatArray) -> FloatArray:
            return self.residual(full(y))

        def jacobian(y: FloatArray) -> FloatArray:
            return self.jacobian(full(y), free)

        found = least_squares(
            residual,
            start[free],
            jac=jacobian,
            bounds=(self.low[free], self.high[free]),
            x_scale="jac",
            xtol=1e-9,
            ftol=1e-9,
            gtol=1e-9,
            max_nfev=100,
        )
        return Solution(full(found.x), 2 * float(found.cost), found.status > 0, found.message)

    def best(self, most_starts: int = 3) -> Solution:
        """The deepest minimum from the best starting points of a coarse grid."""
        solutions = [self.solve(x) for x in self.starts(most_starts)]
        return min(solutions, key=lambda s: (not s.converged, s.chi2))

    def starts(self, most: int) -> list[FloatArray]:
        """Up to `most` starting points: the grid's local minima, the deepest first.

        The grid runs over the parameters that are no scales; for each of its points the scales
        are solved for.
        """
        searched = [i for i, p in enumerate(self.model.parameters) if not p.scale]
        each = 12 if len(searched) == 1 else max(3, round(_GRID ** (1 / max(1, len(searched)))))
        # Denser towards the low bound: narrow lobes are easier to miss than wide ones.
        part = np.square((np.arange(each) + 0.5) / each)
        shape = (each,) * len(searched)
        points = np.tile([p.default for p in self.model.parameters], (*shape, 1))
        depth = np.empty(shape)
        for place in np.ndindex(shape):
            x = points[place]
            width = (self.high - self.low)[searched]
            x[searched] = self.low[searched] + part[list(place)] * width
            self._solve_scales(x)
            depth[place] = self.chi2(x)
        minima = np.argwhere(_local_minima(depth))
        order = np.argsort([depth[tuple(m)] for m in minima])[:most]
        return [points[tuple(minima[n])] for n in order]

    def _solve_scales(self, x: FloatArray) -> None:
        """Set the scales in `x` to those that fit best, each term taken as proportional to its."""
        scales = [i for i, p in enumerate(self.model.parameters) if p.scale]
        if not scales:
            return
        target = self.covariance.whiten(self.brdf - self.offset)
        for _ in range(2):  # the second time for terms that are only about proportional
            columns = [self.gain * self._alone(x, i, scales) / x[i] for i in scales]
            found = nnls(self.covariance.whiten(np.stack(columns, axis=1)), target)[0]
            # A starting point lies within the domain, and off zero, where slopes vanish.
            x[scales] = np.clip(found, 1e-3 * self.high[scales], self.high[scales])

    def _alone(self, x: FloatArray, i: int, scales: list[int]) -> FloatArray:
        only = x.copy()
        only[[j for j in scales if j != i]] = 0.0
        return self.plain(only)


def _local_minima(depth: FloatArray) -> NDArray[np.bool_]:
    """Where a grid's value is not above any neighbour's along the axes."""
    low = np.ones(depth.shape, dtype=bool)
    for axis in range(depth.ndim):
        rise = np.diff(depth, axis=axis)
        edge = [(0, 0)] * depth.ndim
        edge[axis] = (0, 1)
        low &= np.pad(rise >= 0, edge, constant_values=True)
        edge[axis] = (1, 0)
        low &= np.pad(rise <= 0, edge, constant_values=True)
    return low
