"""Uncertainty after some candidates are measured, as it changes with each one more or less.

The rows of an information (`information.py`) are the values' sensitivities to all unknowns, so that
what a design leaves uncertain is the covariance of the values that it predicts, (N, N). A point
more or less changes that by one product of a column with itself (Sherman and Morrison).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from analysis.design.information import Information
from instrument.geometry import BoolArray, FloatArray


@dataclass(slots=True)
class Posterior:
    """Uncertainty that a design of N candidates leaves; arrays change with `add` and `remove`.

    predicted: (N, N), covariance of the candidates' predicted values, in units of their own
    independent u. cross: (N, P), covariance of the values with the P weighted parameters.
    variance: (P,), of those. Each parameter is scaled by the root of its weight.
    """

    predicted: FloatArray
    cross: FloatArray
    variance: FloatArray

    @classmethod
    def of(cls, information: Information, weights: FloatArray, chosen: BoolArray) -> Posterior:
        """Uncertainty after those that `chosen` (N,) marks True, for `weights` (unknowns,)."""
        inverse = information.covariance(chosen.astype(np.float64))
        asked = np.flatnonzero(weights)
        root = np.sqrt(weights[asked])
        rows = information.rows
        return cls(
            predicted=rows @ inverse @ rows.T,
            cross=rows @ inverse[:, asked] * root,
            variance=np.diag(inverse)[asked] * root**2,
        )

    @property
    def criterion(self) -> float:
        """Weighted sum of the variances: the A-criterion, of one parameter the c-criterion."""
        return float(self.variance.sum())

    def with_one_more(self) -> FloatArray:
        """Criterion (N,), in its own unit, with each candidate added."""
        gain = np.square(self.cross).sum(axis=1) / (1 + np.diag(self.predicted))
        return np.asarray(self.criterion - gain)

    def without(self, point: int) -> FloatArray:
        """Variances (P,), in their own unit, without one of the points of the design."""
        left = max(1 - float(self.predicted[point, point]), np.finfo(float).eps)
        return np.asarray(self.variance + np.square(self.cross[point]) / left)

    def add(self, point: int) -> None:
        """Measure a candidate."""
        self._change(point, 1 + float(self.predicted[point, point]))

    def remove(self, point: int) -> None:
        """Take a point out of the design."""
        left = max(1 - float(self.predicted[point, point]), np.finfo(float).eps)
        self._change(point, -left)

    def _change(self, point: int, by: float) -> None:
        column, cross = self.predicted[:, point].copy(), self.cross[point].copy()
        self.variance = self.variance - np.square(cross) / by
        self.cross = self.cross - np.outer(column, cross) / by
        self.predicted = self.predicted - np.outer(column, column) / by
