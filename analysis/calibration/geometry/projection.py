"""Projection of a board's corners to pixels: camera on the beam, lean of the board, distortion.

The camera is that of `instrument.pinhole`, but its middle may lie off the picture's, and points may
lie off a plane. Distortion is the first radial term of OpenCV's model.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from instrument.geometry import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Lens:
    """Camera at the end of the beam.

    distortion: relative displacement of a point at half the picture's diagonal, to the outside if
    positive. centre_column_px, centre_row_px: principal point, from the middle of the picture.
    """

    width_px: int
    height_px: int
    field_width_mm: float
    beam_length_mm: float
    axis_column_px: float
    axis_row_px: float
    roll_deg: float
    distortion: float = 0.0
    centre_column_px: float = 0.0
    centre_row_px: float = 0.0

    @property
    def focal_px(self) -> float:
        """Focal length in pixels."""
        return self.beam_length_mm * self.width_px / self.field_width_mm

    @property
    def k1(self) -> float:
        """First radial coefficient of OpenCV's model."""
        diagonal_px = float(np.hypot(self.width_px, self.height_px))
        return self.distortion * (2 * self.focal_px / diagonal_px) ** 2

    @property
    def centre_px(self) -> FloatArray:
        """Principal point (2,) in pixels, column first."""
        middle = np.array([self.width_px - 1, self.height_px - 1]) / 2
        return np.asarray(middle + np.array([self.centre_column_px, self.centre_row_px]))

    def project(self, points_mm: FloatArray, theta_r_deg: FloatArray) -> FloatArray:
        """Return the pixels (n, 2) of points (n, 3) in mm, each at its view angle (n,) in deg."""
        seen = _from_beam(points_mm, theta_r_deg, self.beam_length_mm) @ self._turn().T
        flat = seen[:, :2] / seen[:, 2:]
        flat = flat * (1 + self.k1 * np.sum(flat**2, axis=1, keepdims=True))
        return np.asarray(self.focal_px * flat + self.centre_px)

    def _turn(self) -> FloatArray:
        """Return the rotation (3, 3) from the beam's axes to the camera's: roll, then aim."""
        roll = np.radians(self.roll_deg)
        c, s = np.cos(roll), np.sin(roll)
        rolled = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        # Distortion moves the picture of the axis too: the ray is that of the ideal picture.
        flat = (np.array([self.axis_column_px, self.axis_row_px]) - self.centre_px) / self.focal_px
        return np.asarray(_smallest_turn(flat / (1 + self.k1 * np.sum(flat**2))) @ rolled)


def _from_beam(points_mm: FloatArray, theta_r_deg: FloatArray, beam_mm: float) -> FloatArray:
    """Return points (n, 3) in mm as seen from the beam's end: right, down, forward."""
    angle = np.radians(theta_r_deg)
    c, s = np.cos(angle), np.sin(angle)
    x, y, z = points_mm.T
    return np.stack([c * x - s * z, -y, beam_mm - s * x - c * z], axis=1)


def _smallest_turn(flat: FloatArray) -> FloatArray:
    """Return the smallest rotation (3, 3) that takes the forward axis to the ray (flat, 1)."""
    ray = np.array([*flat, 1.0]) / np.sqrt(1 + np.sum(flat**2))
    x, y, z = ray
    across = np.array([[0.0, 0.0, x], [0.0, 0.0, y], [-x, -y, 0.0]])
    return np.asarray(np.eye(3) + across + across @ across / (1 + z))


def on_table(
    points_mm: FloatArray,
    *,
    turn_deg: FloatArray,
    shift_mm: FloatArray,
    height_mm: float,
    lean_deg: FloatArray,
    lean_across_deg: FloatArray,
) -> FloatArray:
    """Return points (n, 2) of a board, in mm, as points (n, 3) of the table.

    Each point has its own turn (n,) and shift (n, 2) in the board's plane, and lean (n,) of the
    board's normal to the sides of positive theta_r and of positive y, in degrees.
    """
    turn, lean, across = (np.radians(a) for a in (turn_deg, lean_deg, lean_across_deg))
    c, s = np.cos(turn), np.sin(turn)
    x = c * points_mm[:, 0] - s * points_mm[:, 1] + shift_mm[:, 0]
    y = s * points_mm[:, 0] + c * points_mm[:, 1] + shift_mm[:, 1]
    up = height_mm * np.cos(across) - y * np.sin(across)
    y = y * np.cos(across) + height_mm * np.sin(across)
    return np.stack(
        [x * np.cos(lean) + up * np.sin(lean), y, up * np.cos(lean) - x * np.sin(lean)], axis=1
    )
