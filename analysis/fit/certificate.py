"""Scale of the values: whether the certificate of the reference states it, or the model's form.

The error of a certificate is the same for all values. In a generalised least-squares fit the form
of a model can tell it: the light that facets send to one another rises with the square of the
albedo, so that the shape of the curve fixes the albedo, and with it the error of the certificate,
more closely than the certificate does. That holds as far as the model does.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from analysis.data.covariance import full_covariance
from analysis.data.measurements import Measurements, SharedError
from analysis.fit.fit import FitResult
from instrument.geometry import FloatArray

CERTIFICATE = "white tile certificate"
"""Name of the errors of a certificate."""


def certificate_u(m: Measurements) -> float:
    """Relative u of the certificate that all values have in common, mean over them; 0 for none."""
    scales = [np.mean(np.abs(error.u_relative)) for error in m.shared if _is_scale(error)]
    return float(np.linalg.norm(scales)) if scales else 0.0


class Told(NamedTuple):
    """Error of a certificate as a fit tells it, in units of the stated u: value and what u is left.

    The u is 1 where data and model say nothing about it, and smaller where the model's form does.
    """

    pull: float
    u: float


def told_by(result: FitResult, m: Measurements) -> Told:
    """Return what a fit to measurements of N points says about the certificate's error."""
    free = _determined(result)
    if m.u_random is None or certificate_u(m) == 0 or not free:
        return Told(0.0, 1.0)
    covariance = full_covariance(m, result.brdf)
    problem = replace(result.solved, covariance=covariance, huber=None)
    white = covariance.whiten(_shift(result.predicted, m))
    J = problem.jacobian(result.x, free)
    J = J / np.linalg.norm(J, axis=0)
    rest = white - J @ np.linalg.lstsq(J, white, rcond=None)[0]
    pull = float(white @ covariance.whiten(m.brdf - result.predicted))
    return Told(pull, math.sqrt(max(0.0, 1.0 - float(rest @ rest))))


def led_by_certificate(result: FitResult, m: Measurements) -> FitResult:
    """Copy of a result with the parameters that the values have at the certificate's own scale.

    The fit is repeated as if the certificate had no error, which is then propagated: the form of
    the model corrects no scale, and the u of a scale is at least that of the certificate. What the
    fit says of agreement stays: there the error may take the value that the model's form tells.
    """
    free = _determined(result)
    if m.u_random is None or certificate_u(m) == 0 or not free:
        return result
    others = tuple(error for error in m.shared if not _is_scale(error))
    exact = full_covariance(replace(m, shared=others), result.brdf)
    widened = replace(exact, variance=np.maximum(exact.variance, result.solved.covariance.variance))
    problem = replace(result.solved, covariance=widened)
    held = [i for i in range(result.x.size) if i not in free]
    x = problem.solve(result.x, held).x
    J = problem.jacobian(x, free)
    own = np.linalg.inv(J.T @ J)
    shift = own @ (J.T @ widened.whiten(_shift(problem.predict(x), m)))
    return _with_parameters(result, m, x, free, own + np.outer(shift, shift))


def _with_parameters(
    result: FitResult, m: Measurements, x: FloatArray, free: list[int], C: FloatArray
) -> FitResult:
    """Copy with parameters x (K,), of which those in `free` have the covariance C."""
    names = list(result.u)
    u = {name: result.u[name] for name in names}
    u |= {names[i]: math.sqrt(C[k, k]) for k, i in enumerate(free)}
    correlation = np.full_like(result.correlation, np.nan)
    scale = np.sqrt(np.diag(C))
    correlation[np.ix_(free, free)] = C / np.outer(scale, scale)
    predicted, covariance = result.solved.predict(x), result.problem.covariance
    pulls = covariance.pulls(m.brdf - predicted)
    own = m.brdf - predicted - covariance.common @ pulls
    return replace(
        result,
        x=x,
        values=dict(zip(names, map(float, x), strict=True)),
        u=u,
        correlation=correlation,
        predicted=predicted,
        residuals=own / covariance.u_independent,
        pulls=dict(zip(covariance.names, map(float, pulls), strict=False)),
    )


def _is_scale(error: SharedError) -> bool:
    """True for an error of the certificate that all values have."""
    return (
        error.name == CERTIFICATE
        and np.unique(error.group).size == 1
        and bool(np.all(error.u_relative > 0))
    )


def _shift(predicted: FloatArray, m: Measurements) -> FloatArray:
    """Change of each value (N,) by one u of the certificate, in the unit of `predicted`."""
    shifts = [predicted * error.u_relative for error in m.shared if _is_scale(error)]
    return np.asarray(np.linalg.norm(shifts, axis=0))


def _determined(result: FitResult) -> list[int]:
    return [i for i, u in enumerate(result.u.values()) if u is not None]
