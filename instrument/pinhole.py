"""The pinhole camera on the beam: points of the sample's plane to pixels and back.

Written once: the simulated camera renders with it and the measuring window is projected with it.
Pixel coordinates are (column, row); the centre of pixel `image[row, column]` lies at the whole
numbers, so the pixel covers column +- 1/2, row +- 1/2. At theta_r = 0 and no roll, columns grow
with the sample's x and rows fall with its y.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from instrument.config.rig import Rig
from instrument.geometry import FloatArray, camera_direction


@dataclass(frozen=True, slots=True)
class Pinhole:
    """A camera at the end of the beam, aimed so that the rotation axis appears at a given pixel."""

    beam_length_mm: float
    field_width_mm: float
    width_px: int
    height_px: int
    axis_column_px: float
    axis_row_px: float
    roll_deg: float

    @classmethod
    def of(cls, rig: Rig) -> Pinhole:
        """The camera that a rig file describes."""
        camera = rig.camera
        return cls(
            rig.beam_length_mm,
            camera.field_width_mm,
            camera.width_px,
            camera.height_px,
            camera.axis_column_px,
            camera.axis_row_px,
            camera.roll_deg,
        )

    @property
    def focal_px(self) -> float:
        """Focal length in pixels: the picture's width shows `field_width_mm` at the axis."""
        return self.beam_length_mm * self.width_px / self.field_width_mm

    @property
    def _centre_px(self) -> FloatArray:
        """The foot of the optical axis: the middle of the picture, (column, row)."""
        return np.array([(self.width_px - 1) / 2, (self.height_px - 1) / 2])

    def homography(self, theta_r_deg: float, height_mm: float = 0.0) -> FloatArray:
        """3 x 3 map of (x, y, 1) mm on the plane z = height_mm to (column, row, 1) times a depth.

        `theta_r_deg` is signed. The camera's position is beam_length_mm * camera_direction.
        """
        position = self.beam_length_mm * camera_direction(theta_r_deg)
        plane = np.column_stack([[1.0, 0, 0], [0, 1.0, 0], np.array([0, 0, height_mm]) - position])
        matrix: FloatArray = self._intrinsic() @ self._orientation(theta_r_deg) @ plane
        return matrix

    def project(
        self, points_mm: ArrayLike, theta_r_deg: float, height_mm: float = 0.0
    ) -> FloatArray:
        """Pixels (..., 2) as (column, row) of points (..., 2) mm on the plane z = height_mm."""
        return apply_homography(self.homography(theta_r_deg, height_mm), points_mm)

    def cos4(self, columns: ArrayLike, rows: ArrayLike) -> FloatArray:
        """Fall-off of irradiance in the picture, cos^4 of the angle off the optical axis.

        Nayar, Ikeuchi and Kanade 1991, equation (81).
        """
        centre = self._centre_px
        offset2 = (np.asarray(columns, dtype=np.float64) - centre[0]) ** 2 + (
            np.asarray(rows, dtype=np.float64) - centre[1]
        ) ** 2
        falloff: FloatArray = (1.0 + offset2 / self.focal_px**2) ** -2
        return falloff

    def _intrinsic(self) -> FloatArray:
        column, row = self._centre_px
        focal = self.focal_px
        return np.array([[focal, 0, column], [0, focal, row], [0, 0, 1.0]])

    def _orientation(self, theta_r_deg: float) -> FloatArray:
        """Rotation from the sample's axes to the camera's (right, down, forward)."""
        theta_r, roll = np.radians([theta_r_deg, self.roll_deg])
        look_at_axis = np.array(
            [
                [np.cos(theta_r), 0, -np.sin(theta_r)],
                [0, -1.0, 0],
                [-np.sin(theta_r), 0, -np.cos(theta_r)],
            ]
        )
        turn = np.array(
            [[np.cos(roll), -np.sin(roll), 0], [np.sin(roll), np.cos(roll), 0], [0, 0, 1.0]]
        )
        orientation: FloatArray = self._aim() @ turn @ look_at_axis
        return orientation

    def _aim(self) -> FloatArray:
        """Smallest rotation that brings the rotation axis from the optical axis to its pixel."""
        offset = np.array([self.axis_column_px, self.axis_row_px]) - self._centre_px
        ray = np.append(offset / self.focal_px, 1.0)
        x, y, z = ray / np.linalg.norm(ray)
        return np.array(
            [
                [1 - x * x / (1 + z), -x * y / (1 + z), x],
                [-x * y / (1 + z), 1 - y * y / (1 + z), y],
                [-x, -y, z],
            ]
        )


def apply_homography(matrix: FloatArray, points: ArrayLike) -> FloatArray:
    """Map points (..., 2) by a 3 x 3 homography."""
    points = np.asarray(points, dtype=np.float64)
    mapped = points @ matrix[:, :2].T + matrix[:, 2]
    result: FloatArray = mapped[..., :2] / mapped[..., 2:]
    return result


def area_per_pixel_mm2(homography: FloatArray, columns: ArrayLike, rows: ArrayLike) -> FloatArray:
    """Area of the plane that one pixel sees, mm^2: the Jacobian of the inverse homography."""
    back = np.linalg.inv(homography)
    depth = back[2, 0] * np.asarray(columns) + back[2, 1] * np.asarray(rows) + back[2, 2]
    area: FloatArray = np.abs(np.linalg.det(back) / depth**3)
    return area


def rectangle_mm(width_mm: float, height_mm: float) -> FloatArray:
    """The four corners (4, 2) of a rectangle about the origin of the sample's plane."""
    corners = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
    rectangle: FloatArray = corners * np.array([width_mm, height_mm])
    return rectangle
