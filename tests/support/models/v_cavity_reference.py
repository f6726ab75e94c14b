"""Reference for the isotropic single-slope surface: the printed (28), integrated by brute force."""

from __future__ import annotations

import math

import numpy as np

from analysis.models.rough.v_cavity import (
    Directions,
    critical_angle,
    unidirectional_single_slope,
)
from instrument.geometry import FloatArray

# theta_i, theta_r, dphi in degrees: in the plane and out of it, at kinks, at and near the corners.
GEOMETRIES = [
    (0, 0, 0),
    (10, 70, 60),
    (45, 45, 0),
    (60, 60, 90),
    (75, 60, 180),
    (75, 60, 0),
    (75, 75, 180),
    (85, 85, 0),
    (85, 85, 180),
    (85, 84.9, 179.5),
    (85, 20, 60),
    (83, 5, 83),
    (80.3, 80.3, 179),
    (70, 70, 150),
    (85, 0.2, 0.02),
]


def half_circle(theta_i: float, theta_r: float, dphi: float, theta_a: float) -> FloatArray:
    """Kinks of a cavity's azimuth over half a circle, from (39) and from equal widths."""
    phi_i, phi_r = (
        float(critical_angle(np.array(x), np.array(theta_a))) for x in (theta_i, theta_r)
    )
    x, y = math.tan(theta_r) * math.cos(dphi), math.tan(theta_r) * math.sin(dphi)
    equal = [math.atan2(s * math.tan(theta_i) - x, y) for s in (1, -1)]
    kinks = np.array([-phi_i, phi_i, dphi - phi_r, dphi + phi_r, *equal])
    kinks = np.sort(np.mod(kinks, np.pi))
    return np.append(kinks, kinks[0] + np.pi)


def printed_mean(theta_i: float, theta_r: float, dphi: float, theta_a: float) -> FloatArray:
    """(29) by brute force: the printed (28) at 120 nodes a piece, clustered at its ends.

    tanh(pi/2 sinh s) nodes: they converge for any singularity at the ends.
    """
    s = np.linspace(-3.2, 3.2, 120)
    x, w = np.tanh(np.pi / 2 * np.sinh(s)), np.cosh(s) / np.cosh(np.pi / 2 * np.sinh(s)) ** 2
    w *= np.pi / 2 * (s[1] - s[0])
    kinks = half_circle(theta_i, theta_r, dphi, theta_a)
    middle, half = (kinks[1:] + kinks[:-1]) / 2, (kinks[1:] - kinks[:-1]) / 2
    phi = middle[:, None] + half[:, None] * x
    towards = Directions(*(np.array(v) for v in (theta_i, 0.0, theta_r, dphi)))
    parts = unidirectional_single_slope(towards, np.array(theta_a), phi)
    return np.array([half @ (part @ w) / np.pi for part in parts])
