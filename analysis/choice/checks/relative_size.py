"""Sizes relative to values that may be zero, or so small that the quotient exceeds a double."""

from __future__ import annotations

import numpy as np

from instrument.geometry import FloatArray


def relative_size(size: FloatArray, value: FloatArray) -> FloatArray:
    """Return |size| / |value| (N,), of two arrays (N,) of one unit: 0 for 0 / 0, else up to inf."""
    with np.errstate(over="ignore"):
        return np.asarray(np.abs(size) / np.maximum(np.abs(value), np.finfo(float).tiny))
