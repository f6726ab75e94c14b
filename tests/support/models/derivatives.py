"""Numerical derivatives to compare gradients with."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from instrument.geometry import FloatArray


def central_difference(
    function: Callable[[float], FloatArray], x: float, step: float
) -> FloatArray:
    """Derivative of `function` at x by a central difference of fourth order."""
    f = [function(x + k * step) for k in (-2, -1, 1, 2)]
    return np.asarray((f[0] - 8 * f[1] + 8 * f[2] - f[3]) / (12 * step))
