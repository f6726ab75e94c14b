"""One least-squares problem: a model, measured values and their covariance."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from analysis.data.covariance import Covariance
from analysis.fit.levenberg_marquardt import SETTLED, Minimum, descend, loss
from analysis.models import Model
from instrument.geometry import BoolArray, FloatArray, Geometry

# How far off a bound that no slope leads away from a search goes on, as a part of the domain; what
# it must lower chi2 by to count.
_OFF_BOUND, _SAME = 1e-3, 1e-9


@dataclass(frozen=True, slots=True)
class Problem:
    """Fit gain * model + offset to `brdf` (N,), in 1/sr, with a covariance of the points.

    `gain` (1) and `offset` (1/sr) carry what the rig's acceptance does to the model. Parameter
    vectors `x` are in the order and the units of `model.parameters`. `huber`: residuals beyond it,
    in units of u, count linearly; None: chi2 is the sum of squares.
    """

    model: Model
    geometry: Geometry
    brdf: FloatArray
    covariance: Covariance
    gain: FloatArray | float = 1.0
    offset: FloatArray | float = 0.0
    huber: float | None = None
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
        """Sum of the squares of the whitened residuals, or their robust loss."""
        return loss(self.residual(x), self.huber)

    def jacobian(self, x: FloatArray, free: Sequence[int] | None = None) -> FloatArray:
        """Whitened derivatives of the prediction by the `free` parameters (all), (N, K)."""
        parameters = self.model.parameters
        slopes = self.model.gradient(
            self.geometry, **{p.name: float(v) for p, v in zip(parameters, x, strict=True)}
        )
        indices = range(x.size) if free is None else free
        columns = [self.gain * slopes[parameters[i].name] for i in indices]
        return self.covariance.whiten(np.stack(columns, axis=1))

    def solve(
        self,
        start: FloatArray,
        held: Iterable[int] = (),
        enough: float = 0.0,
        settled: float = SETTLED,
    ) -> Minimum:
        """The minimum reached from `start`, with the `held` parameters left where they are.

        A step that lowers chi2 by no more than `enough`, or the part `settled`, is the last.
        At zero roughness a surface changes with the square of it: no slope leads away from that
        bound, also where the way on is down. From such a bound the search goes on a little off it.
        """
        held = frozenset(held)
        free = [i for i in range(start.size) if i not in held]
        if not free:
            return Minimum(start, self.chi2(start), True, "nothing to vary")
        found = self._descended(start, free, enough, settled)
        off = self.off_level_bounds(found.x, free)
        if np.array_equal(off, found.x):
            return found
        other = self._descended(off, free, enough, settled)
        return other if other.chi2 < found.chi2 * (1 - _SAME) else found

    def off_level_bounds(self, x: FloatArray, free: Sequence[int]) -> FloatArray:
        """x, but inside with free parameters that lie on a bound where nothing changes by them."""
        ends = zip(self.model.parameters, x, strict=True)  # a scale's slope is level nowhere
        on = [i for i, (p, value) in enumerate(ends) if not p.scale and value in (p.low, p.high)]
        on = [i for i in on if i in free]
        if not on:
            return x
        level = [i for i, slope in zip(on, self.jacobian(x, on).T, strict=True) if not slope.any()]
        inside, step = x.copy(), _OFF_BOUND * (self.high - self.low)
        inside[level] = np.clip(x, self.low + step, self.high - step)[level]
        return inside

    def _descended(
        self, start: FloatArray, free: list[int], enough: float, settled: float
    ) -> Minimum:
        by_log = np.array([self.model.parameters[i].logarithmic for i in free])

        def searched(x: FloatArray) -> FloatArray:
            return np.where(by_log, np.log(np.where(by_log, x[free], 1.0)), x[free])

        def full(y: FloatArray) -> FloatArray:
            x = start.copy()
            x[free] = np.clip(np.where(by_log, np.exp(np.where(by_log, y, 0.0)), y), low, high)
            return x

        def jacobian(y: FloatArray) -> FloatArray:
            x = full(y)
            return self.jacobian(x, free) * np.where(by_log, x[free], 1.0)

        low, high = self.low[free], self.high[free]
        ends = searched(self.low), searched(self.high)
        found = descend(
            lambda y: self.residual(full(y)),
            jacobian,
            searched(start),
            *ends,
            self.huber,
            enough,
            settled,
        )
        return found._replace(x=full(found.x))

    def of(self, points: BoolArray) -> Problem:
        """The same problem of some of the points (N,)."""
        geometry = Geometry(
            self.geometry.theta_i_deg[points],
            self.geometry.theta_r_deg[points],
            self.geometry.dphi_deg[points],
        )
        gain, offset = (np.broadcast_to(a, points.shape)[points] for a in (self.gain, self.offset))
        return replace(
            self,
            geometry=geometry,
            brdf=self.brdf[points],
            covariance=self.covariance.of(points),
            gain=gain,
            offset=offset,
        )
