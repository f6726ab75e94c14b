"""Reader of MERL files as renderers have it: the cell of a pair of directions, per colour plane.

Written from the description of the format alone, without the writer's code.
"""

from __future__ import annotations

import math

import numpy as np

from instrument.geometry import FloatArray

Vector = tuple[float, float, float]


class MerlFile:
    """Values of a file; `at` gives those of a pair of directions."""

    def __init__(self, content: bytes) -> None:
        dims = np.frombuffer(content[:12], dtype="<i4")
        assert dims.tolist() == [90, 90, 180]
        assert len(content) == 12 + 3 * 90 * 90 * 180 * 8
        self.planes = np.frombuffer(content[12:], dtype="<f8").reshape(3, -1)

    def at(self, theta_in: float, phi_in: float, theta_out: float, phi_out: float) -> FloatArray:
        """BRDF (3,) in 1/sr of the cell, angles in radians; below 0 where there is none."""
        a, b = _vector(theta_in, phi_in), _vector(theta_out, phi_out)
        return self.cell(*half_angles(a, b))

    def cell(self, theta_half: float, theta_diff: float, phi_diff: float) -> FloatArray:
        """BRDF (3,) in 1/sr of the cell that contains the angles in radians."""
        quarter = math.pi / 2
        i = min(int(math.sqrt(max(theta_half, 0) / quarter) * 90), 89)
        j = min(int(theta_diff / quarter * 90), 89)
        k = min(int((phi_diff % math.pi) / math.pi * 180), 179)
        factors = np.array([1.0 / 1500, 1.15 / 1500, 1.66 / 1500])
        return np.asarray(self.planes[:, k + 180 * (j + 90 * i)] * factors)


def half_angles(a: Vector, b: Vector) -> tuple[float, float, float]:
    """theta_half, theta_diff, phi_diff in radians of two unit vectors."""
    total = [x + y for x, y in zip(a, b, strict=True)]
    length = math.sqrt(sum(x * x for x in total))
    h = [x / length for x in total]
    theta_half = math.acos(min(1.0, h[2]))
    phi_half = math.atan2(h[1], h[0])
    difference = _about_y(_about_z(a, -phi_half), -theta_half)
    theta_diff = math.acos(max(-1.0, min(1.0, difference[2])))
    return theta_half, theta_diff, math.atan2(difference[1], difference[0])


def _vector(theta: float, phi: float) -> Vector:
    return math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi), math.cos(theta)


def _about_z(v: Vector, angle: float) -> Vector:
    c, s = math.cos(angle), math.sin(angle)
    return c * v[0] - s * v[1], s * v[0] + c * v[1], v[2]


def _about_y(v: Vector, angle: float) -> Vector:
    c, s = math.cos(angle), math.sin(angle)
    return c * v[0] + s * v[2], v[1], c * v[2] - s * v[0]
