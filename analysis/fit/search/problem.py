"""One least-squares problem: a model, measured values and their covariance."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from analysis.data.covariance import Covariance
from analysis.fit.search.levenberg_marquardt import MAX_STEPS, RTOL, Minimum, descend, loss
from analysis.models import Model
from instrument.geometry import BoolArray, FloatArray, Geometry

# Distance by which a parameter is moved off a bound where its derivative is zero, as a fraction of
# its domain; relative decrease of chi2 from which the search from there counts as better.
_OFF_BOUND, _BETTER = 1e-3, 1e-9
# Least value of a parameter that is searched for by its logarithm, as a fraction of its upper
# bound, where the domain begins at 0.
_LEAST_LOGARITHM = 1e-6


@dataclass(frozen=True, slots=True)
class Problem:
    """Fit of gain * model + offset to `brdf` (N,), in 1/sr, with a covariance of the points.

    `gain` (relative) and `offset` (1/sr), scalars or (N,), hold the effect of the rig's acceptance
    on the model. Parameter vectors `x` (K,) are in the order and the units of `model.parameters`.
    `huber`: residuals beyond it, in units of u, count linearly; None: chi2 is the sum of squares.
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

    def model_brdf(self, x: FloatArray, geometry: Geometry | None = None) -> FloatArray:
        """BRDF of the model at x (K,), without gain and offset: in 1/sr, of the geometry's shape.

        Without a `geometry`, at the points of the problem.
        """
        names = (p.name for p in self.model.parameters)
        return self.model.kernel(
            self.geometry if geometry is None else geometry,
            **dict(zip(names, x.tolist(), strict=True)),
        )

    def predict(self, x: FloatArray) -> FloatArray:
        """Values (N,) that the rig would measure, in 1/sr, at x (K,)."""
        return np.asarray(self.gain * self.model_brdf(x) + self.offset)

    def residual(self, x: FloatArray) -> FloatArray:
        """Whitened prediction minus data (N,), in units of u, at x (K,)."""
        return self.covariance.whiten(self.predict(x) - self.brdf)

    def chi2(self, x: FloatArray) -> float:
        """Sum of squares of the whitened residuals, in units of u^2, or robust loss; x is (K,)."""
        return loss(self.residual(x), self.huber)

    def jacobian(self, x: FloatArray, free: Sequence[int] | None = None) -> FloatArray:
        """Whitened derivatives (N, K) of the prediction at x, in u per unit of each parameter.

        `free` are the indices of the parameters to derive by; None means all.
        """
        parameters = self.model.parameters
        gradients = self.model.gradient(
            self.geometry, **{p.name: v for p, v in zip(parameters, x.tolist(), strict=True)}
        )
        indices = range(x.size) if free is None else free
        columns = [self.gain * gradients[parameters[i].name] for i in indices]
        return self.covariance.whiten(np.stack(columns, axis=1))

    def solve(
        self,
        start: FloatArray,
        held: Iterable[int] = (),
        atol: float = 0.0,
        rtol: float = RTOL,
        most_steps: int = MAX_STEPS,
    ) -> Minimum:
        """Find the minimum from `start` (K,), with the parameters of the indices `held` fixed.

        The search ends with a step that lowers chi2 by no more than `atol`, or the fraction `rtol`,
        or after `most_steps`.
        A rough surface depends on the square of its roughness: at zero roughness the derivative is
        zero, even where larger values fit better. From such a bound the search is repeated from a
        point a little off it.
        """
        held = frozenset(held)
        free = [i for i in range(start.size) if i not in held]
        if not free:
            return Minimum(start, self.chi2(start), True, "no parameter is free")
        found = self._descend(start, free, atol, rtol, most_steps)
        off = self.off_flat_bounds(found.x, free)
        if np.array_equal(off, found.x):
            return found
        other = self._descend(off, free, atol, rtol, most_steps)
        return other if other.chi2 < found.chi2 * (1 - _BETTER) else found

    def off_flat_bounds(self, x: FloatArray, free: Sequence[int]) -> FloatArray:
        """Copy of x (K,) with parameters moved off a bound where their derivative is zero.

        Only the parameters of the indices `free` are moved, by 1/1000 of their domain.
        """
        ends = zip(self.model.parameters, x, strict=True)  # a scale's derivative is nowhere zero
        on = [i for i, (p, value) in enumerate(ends) if not p.scale and value in (p.low, p.high)]
        on = [i for i in on if i in free]
        if not on:
            return x
        flat = [i for i, column in zip(on, self.jacobian(x, on).T, strict=True) if not column.any()]
        inside, step = x.copy(), _OFF_BOUND * (self.high - self.low)
        inside[flat] = np.clip(x, self.low + step, self.high - step)[flat]
        return inside

    def _descend(
        self, start: FloatArray, free: list[int], atol: float, rtol: float, most_steps: int
    ) -> Minimum:
        """Search over the free parameters, those marked logarithmic by their logarithms."""
        logarithmic = [self.model.parameters[i].logarithmic for i in free]
        logs = np.flatnonzero(logarithmic)  # their places among the free ones
        least = _LEAST_LOGARITHM * self.high[free]

        def searched(x: FloatArray) -> FloatArray:
            y = x[free]
            y[logs] = np.log(np.maximum(y[logs], least[logs]))
            return y

        def full(y: FloatArray) -> FloatArray:
            x, values = start.copy(), y.copy()
            if logs.size:  # rounding may put the end of a domain beyond it
                values[logs] = np.clip(np.exp(y[logs]), low[logs], high[logs])
            x[free] = values
            return x

        def jacobian(y: FloatArray) -> FloatArray:
            x = full(y)
            J = self.jacobian(x, free)
            J[:, logs] *= x[free][logs]
            return J

        low, high = self.low[free], self.high[free]
        ends = searched(self.low), searched(self.high)
        found = descend(
            lambda y: self.residual(full(y)),
            jacobian,
            searched(start),
            *ends,
            self.huber,
            atol,
            rtol,
            most_steps,
        )
        return found._replace(x=full(found.x))

    def subset(self, points: BoolArray) -> Problem:
        """The same problem for the points marked True in `points` (N,)."""
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
            covariance=self.covariance.subset(points),
            gain=gain,
            offset=offset,
        )
