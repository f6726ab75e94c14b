"""Uncertainty after some candidates are measured, as it changes with each one more or less.

The rows of an information (`information.py`) are the values' sensitivities to all unknowns, so that
what a design leaves uncertain is the covariance of the values that it predicts, (N, N). A point
more or less changes that by one product of a column with itself (Sherman and Morrison).
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, field

import numpy as np

from analysis.design.information import Information
from instrument.geometry import BoolArray, FloatArray

# Factors by which a point more or less may divide: beyond them too many digits would be lost.
_SAFE = (1e-4, 1e6)


@dataclass(slots=True)
class Posterior:
    """Uncertainty that a design of N candidates leaves; it changes with `add` and `remove`.

    weights: (unknowns,). chosen: (N,), marks the design. predicted: (N, N), covariance of the
    candidates' predicted values, in units of their own independent u. cross: (N, P), covariance of
    the values with the P weighted parameters, each scaled by the root of its weight. variance:
    (P,), of those.
    """

    information: Information
    weights: FloatArray
    chosen: BoolArray
    predicted: FloatArray = field(init=False)
    cross: FloatArray = field(init=False)
    variance: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        self.chosen = self.chosen.copy()
        self._compute()

    def copy(self) -> Posterior:
        """The same, to be changed by itself."""
        other = copy(self)
        other.chosen = self.chosen.copy()
        return other

    def _compute(self) -> None:
        root = self.information.root(self.chosen.astype(np.float64))
        asked = np.flatnonzero(self.weights)
        own = root[asked] * np.sqrt(self.weights[asked])[:, np.newaxis]
        values = self.information.rows @ root
        self.predicted = values @ values.T
        self.cross = values @ own.T
        self.variance = np.square(own).sum(axis=1)

    @property
    def criterion(self) -> float:
        """Weighted sum of the variances: the A-criterion, of one parameter the c-criterion."""
        return float(self.variance.sum())

    def with_one_more(self) -> FloatArray:
        """Criterion (N,), in its own unit, with each candidate added."""
        return np.asarray(self.variances_with_one_more().sum(axis=1))

    def variances_with_one_more(self) -> FloatArray:
        """Variances (N, P), in their own unit, with each candidate added."""
        spread = 1 + np.maximum(np.diag(self.predicted), 0.0)
        return np.asarray(self.variance - np.square(self.cross) / spread[:, np.newaxis])

    def without(self, point: int) -> FloatArray:
        """Variances (P,), in their own unit, without one of the points of the design."""
        other = Posterior(self.information, self.weights, self.chosen)
        other.remove(point)
        return other.variance

    def add(self, point: int) -> None:
        """Measure a candidate."""
        self.chosen[point] = True
        self._change(point, 1 + float(self.predicted[point, point]))

    def remove(self, point: int) -> None:
        """Take a point out of the design."""
        self.chosen[point] = False
        self._change(point, float(self.predicted[point, point]) - 1)

    def _change(self, point: int, by: float) -> None:
        if not _SAFE[0] < abs(by) < _SAFE[1]:
            self._compute()
            return
        column, cross = self.predicted[:, point].copy(), self.cross[point].copy()
        self.variance = self.variance - np.square(cross) / by
        self.cross = self.cross - np.outer(column, cross) / by
        self.predicted = self.predicted - np.outer(column, column) / by
