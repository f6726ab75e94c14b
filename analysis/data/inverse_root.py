"""Inverse root of 1 + V V^T, for N points with K shared errors V (N, K), from G = V^T V alone.

It is 1 - V Q V^T: `shrunk` applies Q (K, K), and `solved` (1 + G)^-1.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from instrument.geometry import FloatArray

# Shared errors from which on the symmetric root takes longer than a model of many points.
_MANY = 200


@dataclass(frozen=True, slots=True)
class SymmetricRoot:
    """Symmetric inverse root of 1 + V V^T as 1 - V Q V^T, by the eigenvectors (K, K) of G = V^T V.

    A point's residual stays next to where it was, as a robust loss needs it. root: (K,), square
    roots of the eigenvalues of 1 + G.
    """

    vectors: FloatArray
    root: FloatArray

    @property
    def log_determinant(self) -> float:
        """Natural logarithm of det(1 + G)."""
        return 2 * float(np.sum(np.log(self.root)))

    def shrunk(self, x: FloatArray) -> FloatArray:
        """Q x, without unit, for x (K,) or (K, M)."""
        return self._scaled(x, 1 / (self.root * (1 + self.root)))

    def solved(self, x: FloatArray) -> FloatArray:
        """(1 + G)^-1 x, without unit, for x (K,) or (K, M)."""
        return self._scaled(x, 1 / np.square(self.root))

    def _scaled(self, x: FloatArray, by: FloatArray) -> FloatArray:
        inner = self.vectors.T @ x
        return np.asarray(self.vectors @ (by * inner.T).T)


@dataclass(frozen=True, slots=True)
class TriangularRoot:
    """Another inverse root, by the Cholesky factor L (K, K) of 1 + G: Q is (1 + L)^-T L^-1.

    It gives the same chi2 several times as fast. both: 1 + L.
    """

    factor: FloatArray
    both: FloatArray

    @property
    def log_determinant(self) -> float:
        """Natural logarithm of det(1 + G)."""
        return 2 * float(np.sum(np.log(self.factor.diagonal())))

    def shrunk(self, x: FloatArray) -> FloatArray:
        """Q x, without unit, for x (K,) or (K, M)."""
        return _solved(self.both, _solved(self.factor, x), "T")

    def solved(self, x: FloatArray) -> FloatArray:
        """(1 + G)^-1 x, without unit, for x (K,) or (K, M)."""
        return _solved(self.factor, _solved(self.factor, x), "T")


def _solved(lower: FloatArray, x: FloatArray, trans: Literal["N", "T"] = "N") -> FloatArray:
    from scipy.linalg import solve_triangular  # heavy, and for long scans only

    return np.asarray(solve_triangular(lower, x, trans, lower=True, check_finite=False))


def inverse_root(G: FloatArray) -> SymmetricRoot | TriangularRoot:
    """The root for G = V^T V (K, K), without unit: symmetric unless there are many errors."""
    if len(G) < _MANY:
        s, W = np.linalg.eigh(G)
        return SymmetricRoot(W, np.sqrt(1 + np.maximum(s, 0.0)))
    L: FloatArray = np.asarray(np.linalg.cholesky(G + np.eye(len(G))), np.float64)
    return TriangularRoot(L, L + np.eye(len(G)))
