"""Most likely values of the errors that points share, given the data and a fitted model.

A shared error of known u is a parameter with a prior: generalised least squares, in which it is
part of the covariance, gives the same model as a fit of both, and the same most likely errors
(`Covariance.pulls`). Here are those with the uncertainty that the data leave them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from analysis.fit.fit import FitResult

_TOLD = 0.9  # u of a value that the data tell something about, in units of the stated u
_MOST = 100  # errors, each of which costs a product with the covariance
_UNLIKELY = 2.0  # value that is told in any case


class SharedValue(NamedTuple):
    """Value of a shared error and its standard uncertainty, in units of its stated u."""

    name: str
    value: float
    u: float


def shared_values(result: FitResult) -> tuple[SharedValue, ...]:
    """Return those errors that the data tell something about, or that are unlikely large.

    Errors of single angles of the camera are left out: there is one for each view angle.

    u^2 = 1 - v (1 - Q Q^T) v, with v the whitened error (N,), and Q an orthonormal basis (N, K) of
    the whitened derivatives by the parameters: what these could explain as well does not count.
    """
    covariance = result.problem.covariance
    names = [n for n in covariance.names if n in result.pulls and not n.endswith("°")][:_MOST]
    if not names:
        return ()
    free = [i for i, name in enumerate(result.u) if result.u[name] is not None]
    basis = np.linalg.qr(result.problem.jacobian(result.x, free))[0] if free else None
    found = []
    for name in names:
        chosen = np.zeros(len(covariance.names))
        chosen[covariance.names.index(name)] = 1.0
        v = covariance.whiten(np.asarray(covariance.common @ chosen))
        explained = 0.0 if basis is None else float(np.sum(np.square(basis.T @ v)))
        u = float(np.sqrt(np.clip(1 - (v @ v - explained), 0.0, 1.0)))
        found.append(SharedValue(name, float(result.pulls[name]), u))
    return tuple(one for one in found if one.u < _TOLD or abs(one.value) > _UNLIKELY)
