"""Least variance that any design can reach: weights on the candidates in place of counts.

Where a candidate may be measured any number of times, whole or not, the best design is that of a
convex problem. By the equivalence theorem (Kiefer and Wolfowitz 1960) no candidate's sensitivity
then exceeds the weights' mean, and how far it does says how far any weights are from the best.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from analysis.design.information import Information
from instrument.geometry import FloatArray

_ROUNDS, _CLOSE = 500, 1e-3


class Weights(NamedTuple):
    """Weights (N,) of the candidates, of sum 1; their criterion, and a bound below which none is.

    criterion: weighted sum of variances, as in `Posterior.criterion`.
    """

    weights: FloatArray
    criterion: float
    bound: float


def best_weights(
    information: Information, weights: FloatArray, count: float, rounds: int = _ROUNDS
) -> Weights:
    """Best weights of a design of `count` points for the parameters' `weights`, (all,).

    Those are 0 for the errors, as `Information.weights` returns them, in its units.

    Multiplicative iteration (Silvey, Titterington and Torsney 1978), until the criterion is within
    a thousandth of its bound; the bound holds after however many `rounds`.
    """
    asked = np.flatnonzero(weights)
    root = np.sqrt(weights[asked])
    w = np.full(len(information.rows), 1 / len(information.rows))
    criterion = bound = 0.0
    for _ in range(rounds):
        inverse = np.linalg.inv(information.matrix(count * w))[:, asked] * root
        sensitivity = count * np.square(information.rows @ inverse).sum(axis=1)
        criterion = float(np.square(root) @ np.diag(inverse[asked] / root))
        mean = float(w @ sensitivity)
        # Convex in w: no weights are better than the tangent's least value.
        bound = max(bound, criterion - (float(sensitivity.max()) - mean))
        if criterion - bound < _CLOSE * criterion:
            break
        w = w * np.sqrt(sensitivity)
        w = w / w.sum()
    return Weights(w, criterion, bound)
