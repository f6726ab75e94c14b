"""Curves over an angle, and what is read off them: peaks, widths, fitted lines."""

from __future__ import annotations

import numpy as np

from instrument.geometry import FloatArray, Geometry


def towards_mirror(theta_i: FloatArray | float, theta_r: FloatArray | float) -> Geometry:
    """Geometry in the plane of incidence with theta_r positive on the mirror side, in degrees.

    As in the 1991 paper. The arguments, scalars or arrays (N,), broadcast.
    """
    return Geometry.from_degrees(theta_i=theta_i, theta_r=-np.asarray(theta_r), dphi=0.0)


def around(centre: float, width: float, end: float = 89.0, number: int = 241) -> FloatArray:
    """Angles (M,) in degrees from -end to end, denser within ten `width` of a narrow peak."""
    near = centre + width * np.linspace(-10, 10, 161)
    angles = np.concatenate([np.linspace(-end, end, number), near, [centre]])
    return np.unique(angles[np.abs(angles) <= end])


def peak_at(x: FloatArray, y: FloatArray) -> float:
    """Place of the highest of the values (N,), refined by a parabola; in the unit of x."""
    k = int(np.argmax(y))
    if k in (0, y.size - 1):
        return float(x[k])
    c = np.polyfit(x[k - 1 : k + 2] - x[k], y[k - 1 : k + 2], 2)
    return float(x[k] - c[1] / (2 * c[0]))


def half_width(x: FloatArray, y: FloatArray) -> float:
    """Full width at half of the peak of values (N,) over rising x, in the unit of x."""
    k, half = int(np.argmax(y)), float(np.max(y)) / 2
    left = float(np.interp(half, y[: k + 1], x[: k + 1]))
    right = float(np.interp(-half, -y[k:], x[k:]))
    return right - left


def straightness(x: FloatArray, y: FloatArray) -> float:
    """R² of the least-squares line through values (N,) over x, a ratio."""
    fitted = np.polyval(np.polyfit(x, y, 1), x)
    return float(1 - np.sum((y - fitted) ** 2) / np.sum((y - y.mean()) ** 2))


def rises(y: FloatArray, tolerance: float = 1e-12) -> bool:
    """True if values (N,), of any unit, never fall by more than a relative `tolerance`."""
    return bool(np.all(np.diff(y) >= -tolerance * np.max(np.abs(y))))


def spread(y: FloatArray) -> float:
    """Ratio of the range of values (N,) to their mean, dimensionless."""
    return float(np.ptp(y) / np.mean(y))


def kink_at(x: FloatArray, y: FloatArray) -> float:
    """Place among evenly spaced x, in their unit, where the slope of values (N,) falls most."""
    return float(x[1:-1][int(np.argmin(np.diff(y, 2)))])
