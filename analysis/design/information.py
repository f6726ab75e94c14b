"""Fisher information of candidate geometries about the parameters of a model.

The errors that points share are part of the covariance of the measurements. As unknowns beside the
parameters, each known beforehand to within one u, they give the same result (generalised least
squares), and then the information of a design is a sum over its points: quick to update where one
is added. A point that repeats others averages its own noise; of what they share it says nothing
new, so that u has a floor which no repetition passes.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from analysis.data.covariance import full_covariance
from analysis.data.measurements import Measurements
from analysis.fit.relative_scale import FACTOR_NAME, relative_model
from analysis.fit.search.problem import Problem
from analysis.models import Model
from instrument.geometry import FloatArray, Geometry

# Prior u of a parameter in units of its domain: says next to nothing, and every matrix is regular.
_PRIOR_U = 10.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Information:
    """Information of N candidate geometries about K parameters, with S errors that they share.

    names: the parameters. domain: (K,), width of the domain of each, in its unit. rows: (N, K + S),
    change of each value by a whole domain of each parameter and by one u of each shared error, in
    units of the independent u of that value. errors: (S,), names of the shared errors.
    """

    names: tuple[str, ...]
    domain: FloatArray
    rows: FloatArray
    errors: tuple[str, ...] = ()

    @classmethod
    def of(cls, problem: Problem, x: FloatArray) -> Information:
        """Information at the parameters x (K,), in their units, of a problem, with its covariance.

        A parameter on a bound where nothing changes by it is moved off the bound a little.
        """
        parameters, covariance = problem.model.parameters, problem.covariance
        inside = problem.off_flat_bounds(x, range(x.size))
        values = dict(zip((p.name for p in parameters), inside.tolist(), strict=True))
        gradients = problem.model.gradient(problem.geometry, **values)
        domain = problem.high - problem.low
        J = np.stack([gradients[p.name] for p in parameters], axis=1) * domain
        rows = np.hstack([J, covariance.common_dense]) / covariance.u_independent[:, np.newaxis]
        return cls(names=tuple(values), domain=domain, rows=rows, errors=covariance.names)

    @property
    def prior(self) -> FloatArray:
        """Diagonal of the information before any point is measured, (unknowns,), as in `rows`.

        In units of domains and of shared u, to the power -2.
        """
        found = np.ones(self.rows.shape[1])
        found[: len(self.names)] = _PRIOR_U**-2
        return found

    def matrix(self, counts: FloatArray) -> FloatArray:
        """Information (K + S, K + S) of a design that measures each candidate `counts` (N,) times.

        Counts need not be whole numbers.
        """
        rows = self._measured(counts)
        return np.diag(self.prior) + rows.T @ rows

    def _measured(self, counts: FloatArray) -> FloatArray:
        """Rows (M, K + S) of the M candidates that a design measures, by the root of `counts`."""
        own = counts > 0
        return np.asarray(self.rows[own] * np.sqrt(counts[own])[:, np.newaxis])

    def root(self, counts: FloatArray) -> FloatArray:
        """Root (unknowns, unknowns) of the unknowns' covariance, by a design of `counts` (N,).

        In units of domains and of shared u: times its transpose, it is the inverse of `matrix`. It
        is found from the rows, whose condition is milder, so that rows times it are exact where
        the design leaves another unknown undetermined.
        """
        rows = self._measured(counts)
        R = np.linalg.qr(np.vstack([rows, np.diag(np.sqrt(self.prior))]), mode="r")
        return np.asarray(np.linalg.inv(R))

    def covariance(self, counts: FloatArray) -> FloatArray:
        """Covariance of all unknowns, (unknowns, unknowns), in units of domains and of shared u."""
        root = self.root(counts)
        return np.asarray(root @ root.T)

    def _of_parameters(self, counts: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Covariance (K, K) of the parameters, and with the shared errors, (K, S), negative.

        By generalised least squares for a design of `counts` (N,): rows are whitened by the
        covariance 1 + B B^T that the shared errors B give them, which is quicker than `root` and
        as exact for the parameters.
        """
        K, rows = len(self.names), self._measured(counts)
        B = rows[:, K:]
        L = np.linalg.cholesky(np.eye(len(rows)) + B @ B.T)
        white = np.linalg.solve(L, rows)
        prior = np.diag(np.sqrt(self.prior[:K]))
        inverse = np.linalg.inv(np.linalg.qr(np.vstack([white[:, :K], prior]), mode="r"))
        own = inverse @ inverse.T
        return own, own @ white[:, :K].T @ white[:, K:]

    def u(self, counts: FloatArray) -> dict[str, float]:
        """Standard uncertainty of each parameter, in its unit, by a design of `counts` (N,).

        Of a parameter that the design does not determine it is larger than the domain.
        """
        own = np.diag(self._of_parameters(counts)[0])
        return dict(zip(self.names, (np.sqrt(own) * self.domain).tolist(), strict=True))

    def shared_parts(self, counts: FloatArray) -> FloatArray:
        """Parts (K, S) of each parameter's variance by each shared error, at a design (N,).

        What one u of the error shifts the best estimate by, squared, in units of the variance; what
        they lack to a sum of 1 is the part of independent errors.
        """
        own, with_errors = self._of_parameters(counts)
        return np.asarray(np.square(with_errors) / np.diag(own)[:, np.newaxis])

    def weights(self, asked: Iterable[str], goal: Mapping[str, float] | None = None) -> FloatArray:
        """Weights (unknowns,) on the variances of the asked parameters, for one sum of all.

        Each counts in units of the variance that all candidates together would leave: 1 for each
        is the most that can be reached by measuring every candidate once. With a `goal`, the u
        wanted of each, in its unit, each counts in units of the variance wanted.
        """
        found = np.zeros(self.rows.shape[1])
        wanted = self.u(np.ones(len(self.rows))) if goal is None else goal
        for name in asked:
            k = self.names.index(name)
            found[k] = (self.domain[k] / wanted[name]) ** 2
        return found


def assumed_problem(
    model: Model, x: FloatArray, measurements: Measurements
) -> tuple[Problem, FloatArray]:
    """Problem of measurements that have the values of a model at x (K,), and its parameters.

    measurements: N planned points with their uncertainties; their values are replaced, and
    `u_random` keeps its ratio to them. Relative ones get the factor that a fit gives them.
    """
    names = [p.name for p in model.parameters]
    values = dict(zip(names, x.tolist(), strict=True))

    def brdf(geometry: Geometry) -> FloatArray:
        return np.asarray(model.kernel(geometry, **values))

    m = _with_values(measurements, brdf(measurements.geometry))
    covariance = full_covariance(m, brdf, repeatable=True)  # in it no repetition averages them
    if not m.relative:
        return Problem(model, m.geometry, m.brdf, covariance), x
    scaled = relative_model(model, m.brdf)
    values[FACTOR_NAME] = 1.0
    least = {p.name: p.low for p in scaled.parameters}
    at = np.array([max(values[p.name], least[p.name]) for p in scaled.parameters])
    return Problem(scaled, m.geometry, m.brdf, covariance), at


def _with_values(m: Measurements, brdf: FloatArray) -> Measurements:
    """Measurements with values (N,) in 1/sr, and the relative uncertainties that they had."""
    if m.u_random is None:
        raise ValueError("u_random is not stated; allowed: a u_random in 1/sr for every point")
    if np.any(brdf <= 0):
        at = int(np.argmin(brdf))
        raise ValueError(
            f"the model has a BRDF of {brdf[at]:g} 1/sr at theta_i {m.theta_i_deg[at]:g}, theta_r "
            f"{m.theta_r_deg[at]:g} deg; allowed: more than 0 at every candidate"
        )
    return replace(m, brdf=brdf, u_random=np.abs(m.u_random / m.brdf) * brdf)
